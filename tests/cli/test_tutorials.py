"""The lessons of the tutorials, from first to last, as a reader would do them."""

import re
import shutil

import pytest

from commands import run
from conftest import ROOT

PAGE = (ROOT / "docs" / "tutorials.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```(toml|console)\n(.*?)^```", PAGE, re.DOTALL | re.MULTILINE)
PARTS = ROOT / "examples" / "parts"


def test_every_lesson_has_a_command():
    lessons = re.split(r"^## ", PAGE, flags=re.MULTILINE)[1:]
    assert len(lessons) == 7
    assert all("```console\n$ kerfpath " in lesson for lesson in lessons)
    assert {kind for kind, _ in BLOCKS} == {"toml", "console"}


def write_job(folder, text):
    """Write the file that a block names, after the one that it goes on from."""
    name, before = re.match(r"# (\S+\.toml)(?:, after (\S+\.toml))?\n", text).groups()
    whole = (folder / before).read_text() + "\n" + text if before else text
    (folder / name).write_text(whole)


def edit_program(folder):
    """Lift the target of line 53 by 3 mm, as the last lesson says."""
    lines = (folder / "hole" / "hole.mod").read_text().splitlines(keepends=True)
    assert lines[52].count(",0.0000],[") == 1
    lines[52] = lines[52].replace(",0.0000],[", ",3.0000],[")
    (folder / "edited.mod").write_text("".join(lines))


@pytest.mark.slow
def test_the_lessons_run(tmp_path):
    for drawing in ("bracket.step", "beam.step"):
        shutil.copy(PARTS / drawing, tmp_path)
    said = {}
    for kind, text in BLOCKS:
        if kind == "toml":
            write_job(tmp_path, text)
            continue
        for line in text.splitlines():
            command, _, code = line.partition("# exit ")
            if "edited.mod" in command:
                edit_program(tmp_path)
            words = command.split()
            assert words[:2] == ["$", "kerfpath"]
            ran = run(*words[2:], cwd=tmp_path)
            assert ran.returncode == int(code or 0), f"{line}: {ran.stderr}"
            said[command.strip()] = ran.stdout
    programs = ["hole/hole.mod", "part/part.mod", "rail/rail.mod"]
    assert all((tmp_path / program).exists() for program in programs)
    assert "skin1/hole1" in said["$ kerfpath contours bracket.step"]
    assert "Cycle time" in said["$ kerfpath plan part.toml --out part"]
    assert "audit passed" in said["$ kerfpath audit hole/hole.mod --job hole.toml"]
    failed = said["$ kerfpath audit edited.mod --job hole.toml"]
    assert "line 53" in failed
    assert "3 mm" in failed
