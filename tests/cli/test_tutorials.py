"""The lessons of the tutorials, from first to last, as a reader would do them."""

import re

import pytest

import lessons
from commands import run

PAGE = lessons.PAGE.read_text(encoding="utf-8")
KEPT = re.compile(r"(wrote|audit|loop|contour|plan|body)\b")
"""Lines of an output that do not depend on the machine: heads of tables, files, verdicts."""


def in_process(words, folder):
    """Run a command of a lesson."""
    ran = run(*words, cwd=folder)
    return ran.returncode, ran.stdout


def kept(printed):
    """The lines that an output must have, with single blanks."""
    return [" ".join(line.split()) for line in printed.splitlines() if KEPT.match(line)]


def test_every_lesson_has_a_command_and_shows_what_it_prints():
    of_page = re.split(r"^## ", PAGE, flags=re.MULTILINE)[1:]
    assert len(of_page) == 7
    assert all("```console\n$ kerfpath " in lesson for lesson in of_page)
    blocks = list(lessons.BLOCK.finditer(PAGE))
    assert {block[1] for block in blocks} == {"toml", "console"}
    assert all(block[3] for block in blocks if block[1] == "console")
    assert all(f"]({name})" in PAGE for name in lessons.SHOTS)


def test_an_output_is_shown_without_repetitions():
    seen = set()
    text = "head  worst\na  1  ok\nb  2  ok\nc  3  ERROR\nnote: some prose\n"
    first = "head  worst\n...\nc  3  ERROR\nnote: some prose\n"
    assert lessons.shortened(text, seen) == first
    assert lessons.shortened(text, seen) == first.replace("note: some prose", "...")


@pytest.mark.slow
def test_the_lessons_run_and_print_what_the_page_shows(tmp_path):
    said = {}
    for block, printed in lessons.played(PAGE, tmp_path, in_process):
        said[block[2].splitlines()[-1]] = printed
        assert kept(printed) == kept(block[3])
    programs = ["hole/hole.mod", "part/part.mod", "rail/rail.mod"]
    assert all((tmp_path / program).exists() for program in programs)
    assert "skin1/hole1" in said["$ kerfpath contours bracket.step"]
    assert "Cycle time" in said["$ kerfpath plan part.toml --out part"]
    failed = said["$ kerfpath audit edited.mod --job hole.toml    # exit 1"]
    assert "line 53" in failed
    assert "3 mm" in failed
