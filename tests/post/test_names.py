"""Names of contours, in any characters, never become statements of a program."""

import re
from dataclasses import replace

import pytest
from tests.post.cases import CASES, refusal

HOSTILE = (
    "a\r\nDO[1]=ON ;", "x ; DO[1]=ON ;", "a\nset_digital_out(0,True)", "x;$OUT[1]=TRUE",
    "\x1b[2J", "\x00", "\x85y", "\u2028z", "\u202eabc", "\ufeff", "\ud800", "\U0001f525", " ", "",
    "=HYPERLINK(1)", "]]><x/>", "&#10;&lt;", "../../etc/passwd", "P[1:x]", "*[1]", "'", "//", "///",
    "!UFRAME 1 X 5.0", "UFRAME 1 X 5.0", "TOOL 0 X 1.0", "--eg:", '$ 1 "x"', '"', "\\", "%s{0}",
    "\u00e9" * 80, "1" * 300, ";FOLD x", "&REL 5", "#", "-1",
)  # fmt: skip
RESERVED = ("end", "if", "main", "halt", "con", "stop", "start", "tLaser", "laser_set", "nFirst",
            "switchOff", "true", "skin_outer", "SKIN_OUTER", "x_OFF", "trajectory")  # fmt: skip
"""Names that mean something in a language, or are those of what programs contain."""


def named(case, *names):
    contour = case.small.contour
    return [replace(case.small, contour=replace(contour, name=name)) for name in names]


@pytest.mark.parametrize("case", CASES.values(), ids=str)
def test_a_name_is_text_wherever_it_stands(case):
    program = case.built(named(case, *HOSTILE))
    files = case.post(program)
    for file, text in files.items():
        assert re.fullmatch(r"[\w./]+", file, re.ASCII)
        assert re.fullmatch(r"[\t\n -~]*", text.replace("\r\n", "\n")), file
    assert refusal(files, case.name, program, case.settings) == ""


@pytest.mark.parametrize("case", CASES.values(), ids=str)
def test_a_name_that_means_something_is_refused_or_harmless(case):
    for name in RESERVED:
        program = case.built(named(case, name, "other"))
        found = set(case.codes(program, "error"))
        assert found <= {"name-reserved", "name-collision"}
        if not found:
            assert refusal(case.post(program), case.name, program, case.settings) == ""
