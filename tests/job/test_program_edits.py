"""Programs spoilt by a grammar of edits: what does harm passes no audit, in any language."""

import re

import numpy as np
import pytest
from benchmarks import program_edits

FAULTS, EDITS, CHARACTERS, HARMLESS = 6, 8, 60, 15
"""One fault in so many, and so many edits of the text, of its characters, and harmless ones, for
each; the benchmark makes more."""
LANGUAGES = ("csv", "fanuc", "inform", "krl", "linuxcnc", "rapid", "ros", "urscript", "val3")
RESETS = {
    "rapid": r"SetDO doGas,0;",
    "krl": r"\$OUT\[6\]=FALSE",
    "fanuc": r"  DO\[6\]=OFF",
    "inform": r"DOUT OT#\(6\) OFF",
    "val3": r"dioGas=false",
    "urscript": r"gas_set\(False\)",
    "linuxcnc": r"M6[35] P1",
}
"""What switches the gas off: at first, and wherever; a trajectory and a table have no such line."""
TURNING = {
    "rapid": (r"(vCut1:=\[[\d.]+),500,", r"\1,5,"),
    "krl": (r"\$VEL\.ORI1=200\.0", "$VEL.ORI1=5.0"),
    "urscript": (r"a=1\.200000", "a=5.000000"),
    "val3": (r'rmax="99999"', 'rmax="5"'),
}
"""How fast the tool turns, or how hard the tip speeds up, where a program says it."""


@pytest.fixture(scope="module")
def subjects(tmp_path_factory):
    folder = tmp_path_factory.mktemp("edits")
    return {subject.language.name: subject for subject in program_edits.subjects(folder)}


@pytest.mark.slow
@pytest.mark.parametrize("language", LANGUAGES)
def test_no_fault_and_no_edit_that_does_harm_passes(subjects, language):
    subject = subjects[language]
    assert subject.outcome(subject.files) == ("passed", "")
    tally, number = program_edits.Tally(), LANGUAGES.index(language)
    tally.try_faults(subject, np.random.default_rng(number), every=FAULTS, first=number)
    assert tally.of("harmful") > 60 / FAULTS
    tally.try_edits(subject, np.random.default_rng(number), EDITS)
    assert tally.wrong == []


@pytest.mark.parametrize("language", LANGUAGES)
def test_no_edit_of_characters_that_does_harm_passes(subjects, language):
    tally = program_edits.Tally()
    rng = np.random.default_rng(LANGUAGES.index(language))
    tally.try_characters(subjects[language], rng, CHARACTERS)
    assert tally.of("harmful") == CHARACTERS
    assert tally.wrong == []


@pytest.mark.slow
@pytest.mark.parametrize("language", LANGUAGES)
def test_edits_that_people_make_all_the_time_pass(subjects, language):
    tally = program_edits.Tally()
    rng = np.random.default_rng(LANGUAGES.index(language))
    tally.try_characters(subjects[language], rng, HARMLESS, harmless=True)
    assert tally.of("harmless", "passed") == HARMLESS, tally.wrong


def without_each(files, pattern):
    """The files with one line that matches left out, for each such line."""
    for name, text in files.items():
        lines = text.splitlines()
        end = "\r\n" if "\r\n" in text else "\n"
        for k, line in enumerate(lines):
            if re.search(pattern, line):
                yield {**files, name: end.join([*lines[:k], *lines[k + 1 :], ""])}


@pytest.mark.parametrize("language", RESETS)
def test_an_output_that_is_not_switched_off_does_not_pass(subjects, language):
    subject = subjects[language]
    outcomes = [subject.outcome(files) for files in without_each(subject.files, RESETS[language])]
    assert outcomes
    for outcome, said in outcomes:
        assert outcome in ("caught", "refused")
        assert re.search(r"line \d+|\.ls|\.pgx|\.JBI", said), said
    assert "refused" in {outcome for outcome, _ in outcomes}


@pytest.mark.parametrize("language", TURNING)
def test_what_bounds_the_motion_beside_its_speed_is_read(subjects, language):
    subject = subjects[language]
    pattern, other = TURNING[language]
    edited = {name: re.sub(pattern, other, text) for name, text in subject.files.items()}
    assert edited != subject.files
    outcome, said = subject.outcome(edited)
    assert (outcome, "line" in said) == ("refused", True)


def test_a_finding_names_the_line_where_a_speed_is_declared(subjects):
    subject = subjects["rapid"]
    (text,) = subject.files.values()
    edited = re.sub(r"(vApproach1:=\[)100\.00", r"\g<1>200.00", text)
    line = next(k for k, row in enumerate(edited.splitlines(), 1) if "vApproach1:=[200" in row)
    outcome, said = subject.outcome({"job.mod": edited})
    assert outcome == "caught"
    assert "100 mm/s in the job and 200 mm/s in the text" in said
    assert f"job.mod, line {line})" in said


def test_remarks_and_names_of_routines_are_nobodys_business(subjects):
    (text,) = subjects["rapid"].files.values()
    renamed = re.sub(r"\bhole\b", "round_hole", text).replace("  ! Complete", "  ! Please complete")
    assert renamed != text
    assert subjects["rapid"].outcome({"job.mod": renamed}) == ("passed", "")


def test_a_cut_that_comes_again_in_the_same_routine_hides_no_finding_of_the_first(subjects):
    subject = subjects["rapid"]
    (text,) = subject.files.values()
    body = re.search(r"(?<=PROC slit\(\)\n).*?(?=  ENDPROC)", text, re.DOTALL)[0]
    slow = body.replace("WaitTime 0.250;", "WaitTime 0.100;")
    edited = subject.read({"job.mod": text.replace(body, slow + body)})
    found = subject.audit.program(edited, "job.mod")
    assert {"slit (slit)", "slit (slit), again"} <= found.tables.keys()
    wrong = {(name, c.code) for name, table in found.tables.items() for c in table if not c.ok}
    assert {("slit (slit)", "pierce"), ("slit (slit), again", "once")} <= wrong
