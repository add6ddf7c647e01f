"""Lines of programs end as for a controller, in every language; other characters are refused."""

import re
import sys
import unicodedata

import pytest
from tests.post.cases import CASES

from kerfpath import InputError

NOT_TEXT = [
    char
    for char in map(chr, range(sys.maxunicode + 1))
    if unicodedata.category(char) in ("Cc", "Zl", "Zp") and char not in "\t\n"
]
"""All controls and separators of lines; a carriage return that stands alone is one of them."""

SWITCHED_OFF = {
    "rapid": ("! ", r"SetDO doLaser,0;"),
    "krl": ("; ", r"\$OUT\[5\]=FALSE"),
    "fanuc": ("   1:  ! ", r"DO\[1\]=OFF"),
    "inform": ("' ", r"DOUT OT#\(1\) OFF"),
    "val3": ("// ", r"dioLaser=false"),
    "urscript": ("# ", r"laser_set\(False\)"),
    "linuxcnc": ("; ", r"M63 P0"),
    "csv": ("", r"laser off"),
    "ros": ("# ", r"set: laser, to: false"),
}
"""How a remark begins, and what switches the laser off."""


def named(char):
    return f"U+{ord(char):04X} {unicodedata.name(char, '')}".rstrip()


def refused(case, file, rows, number, char):
    """Check that rows of a golden file are refused for a character in the one with a number."""
    files = {**case.golden, file: case.new_line.join(rows)}
    message = f"{file}, line {number}: a program must not contain the character {named(char)};"
    with pytest.raises(InputError, match=re.escape(message)) as caught:
        case.read(files)
    assert "\n" not in str(caught.value)


def test_the_list_has_what_splitlines_splits_at():
    split = {
        char for char in map(chr, range(sys.maxunicode + 1)) if len(f"a{char}a".splitlines()) > 1
    }
    assert split - set(NOT_TEXT) == {"\n"}


@pytest.mark.parametrize("case", CASES.values(), ids=str)
def test_a_control_character_is_refused_wherever_it_is(case):
    """In every file, row after row: at its start, inside it and at its end, and behind a remark."""
    remark, _ = SWITCHED_OFF[case.name]
    for file, text in case.golden.items():
        rows = text.split(case.new_line)
        for n, char in enumerate(NOT_TEXT):
            k = n * max(len(rows) // len(NOT_TEXT), 1) % len(rows)
            row = rows[k]
            for said in (
                char + row, f"{row[: len(row) // 2]}{char}{row[len(row) // 2 :]} ",
                f"{row}{char} ", f"{remark}off{char}{row}",
            )[n % 2 :: 2]:  # fmt: skip
                refused(case, file, [*rows[:k], said, *rows[k + 1 :]], k + 1, char)


@pytest.mark.parametrize("case", CASES.values(), ids=str)
def test_what_switches_the_laser_off_does_not_count_behind_a_remark(case):
    remark, off = SWITCHED_OFF[case.name]
    found = 0
    for file, text in case.golden.items():
        rows = text.split(case.new_line)
        for k in [k for k, row in enumerate(rows) if re.search(off, row)][-1:]:
            found += 1
            for char in NOT_TEXT:
                hidden = f"{remark}off{char}{rows[k]}"
                refused(case, file, [*rows[:k], hidden, *rows[k + 1 :]], k + 1, char)
    assert found


@pytest.mark.parametrize("case", CASES.values(), ids=str)
def test_lines_may_end_with_lf_or_cr_lf(case):
    for new_line in ("\n", "\r\n"):
        files = {name: text.replace(case.new_line, new_line) for name, text in case.golden.items()}
        assert case.deviations(case.program, files) == []


CODE = "expected the code in one <![CDATA[...]]>, and nothing else"


@pytest.mark.parametrize(
    ("file", "old", "new", "why"),
    [
        ("start.pgx", "<![CDATA[", "&#98;<![CDATA[", "a character by its number"),
        ("start.pgx", "<![CDATA[begin", "begin<![CDATA[", CODE),
        ("start.pgx", "  dioLaser=false", "  // off]]>\n<![CDATA[dioLaser=false", CODE),
        ("start.pgx", "  dioLaser=false", "  // off]]><!-- x --><![CDATA[dioLaser=false", CODE),
        ("start.pgx", "]]>", "]]>&lt;", CODE),
        (".pjx", 'stackSize="5000"', 'stackSize="&#53;000"', "a character by its number"),
        (".pjx", "<Project", "<!DOCTYPE Project [<!ENTITY e 'x'>]><Project", "a document type"),
        (".dtx", "<Datas>", "<Datas>\u00a0", "text is not expected"),
    ],
)
def test_code_is_one_part_of_a_project_without_entities(file, old, new, why):
    case = CASES["val3"]
    (name,) = (each for each in case.golden if each.endswith(file))
    text = case.golden[name].replace("]]>", " ]]> ")
    assert case.deviations(case.program, {**case.golden, name: text}) == []
    case.refuses(name, old, new, why)
