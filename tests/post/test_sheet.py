"""The process sheet: comments at the head of a program, left out by readers, audited."""

from dataclasses import replace

import pytest
from tests.post.cases import CASES

from kerfpath.job.program_file import MISSING, check_sheet

SHEET = (
    "- PROCESS SHEET, set by hand:",
    "- mild steel 2 mm N2 normal",
    "- EXAMPLE VALUES, NOT MEASURED",
    "- machine: FOLD; ENDFOLD ]]>",
    "+ py,(MSG, x) UFRAME 1 X 3",
    "- duty 80 %",
    "- focus -1.5 mm",
    "- pierce 1: 0.2 s 1200 W",
)
"""With words that some language, or its reader, gives a meaning elsewhere."""
WITH_COMMENTS = [name for name in CASES if name != "csv"]


@pytest.fixture
def written(tmp_path):
    """A function that writes the golden program of a language with a sheet, and its main file."""

    def write(name, sheet=SHEET):
        case = CASES[name]
        program = replace(case.program, caveats=tuple(sheet))
        files, _ = case.reads_back(program)
        for file, text in files.items():
            (tmp_path / file).parent.mkdir(exist_ok=True)
            (tmp_path / file).write_bytes(text.encode("ascii"))
        return tmp_path / next(iter(files))

    return write


@pytest.mark.parametrize("name", WITH_COMMENTS)
def test_a_program_has_its_sheet_and_is_read_as_without(name, written):
    file = written(name)
    (row,), note = check_sheet(file, SHEET)
    assert row.ok, row.title
    assert note == ""


@pytest.mark.parametrize("name", WITH_COMMENTS)
@pytest.mark.parametrize("change", [("80 %", "60 %"), ("- duty 80 %", ""), ("1200 W", "1200 W 1")])
def test_another_sheet_is_found(name, change, written):
    sheet = [changed for line in SHEET if (changed := line.replace(*change))]
    (row,), _ = check_sheet(written(name, sheet), SHEET)
    assert not row.ok
    assert row.level == "error"


@pytest.mark.parametrize("name", CASES)
def test_a_program_without_a_sheet_has_a_note(name, written):
    file = written(name, ())
    assert check_sheet(file, SHEET) == ([], MISSING)
    assert check_sheet(file, ()) == ([], "")


def test_a_sheet_that_the_job_does_not_have_is_found(written):
    (row,), _ = check_sheet(written("rapid"), ())
    assert not row.ok


def test_a_table_has_no_comments(written):
    assert check_sheet(written("csv"), SHEET) == ([], MISSING)
