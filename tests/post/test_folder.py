"""Programs in folders: whole or not at all, and nothing of an earlier one beside them."""

import json
import os
import socket
from pathlib import Path

import pytest

from kerfpath import InputError
from kerfpath.post import MANIFEST, replace_program, write_files, write_program

LONG = {"cut.src": "calls a and b", "a.src": "a", "b.src": "b", "sub/c.src": "c"}
SHORT = {"cut.src": "calls a", "a.src": "a anew"}


def names(folder):
    return {str(p.relative_to(folder)) for p in folder.rglob("*") if p.is_file()}


@pytest.fixture
def folder(tmp_path):
    """A folder with a person's own files and a long program of ours."""
    (tmp_path / "mine.src").write_text("mine")
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "mine.src").write_text("mine, too")
    replace_program(tmp_path, LONG, list(LONG), only="cut.src")
    return tmp_path


MINE = {"mine.src", "sub/mine.src"}


def test_files_of_an_earlier_program_go_and_those_of_a_person_stay(folder):
    done = replace_program(folder, SHORT, list(SHORT), only="cut.src")
    assert {path.name for path in done.removed} == {"b.src", "c.src"}
    assert names(folder) == {*MINE, *SHORT, MANIFEST}
    assert (folder / "a.src").read_text() == "a anew"


def test_another_program_in_the_folder_stays(folder):
    replace_program(
        folder, {"other.src": "o", "o2.src": "o"}, ["other.src", "o2.src"], only="other.src"
    )
    assert names(folder) == {*MINE, *LONG, "other.src", "o2.src", MANIFEST}
    replace_program(folder, SHORT, list(SHORT), only="cut.src")
    assert names(folder) == {*MINE, *SHORT, "other.src", "o2.src", MANIFEST}


def test_a_file_that_was_edited_since_is_not_removed_and_nothing_is_written(folder):
    (folder / "b.src").write_text("b, by hand")
    with pytest.raises(InputError, match=r"b\.src belongs to the earlier program .* move it away"):
        replace_program(folder, SHORT, list(SHORT), only="cut.src")
    assert (folder / "cut.src").read_text() == LONG["cut.src"]
    assert names(folder) == {*MINE, *LONG, MANIFEST}


def test_a_run_without_a_program_removes_the_earlier_ones(folder):
    (folder / "b.src").write_text("b, by hand")
    done = replace_program(folder, {"plan.json": "failed"}, [])
    assert [path.name for path in done.edited] == ["b.src"]
    assert names(folder) == {*MINE, "plan.json", "b.src", MANIFEST}
    (folder / "b.src").unlink()
    replace_program(folder, {"plan.json": "failed"}, [])
    assert names(folder) == {*MINE, "plan.json"}


def test_a_folder_of_an_earlier_project_goes_with_its_last_file(tmp_path):
    replace_program(tmp_path, {"p/p.pjx": "p", "p/a.pgx": "a"}, ["p/p.pjx", "p/a.pgx"])
    replace_program(tmp_path, {"q.mod": "q"}, ["q.mod"])
    assert names(tmp_path) == {"q.mod", MANIFEST}
    assert not (tmp_path / "p").exists()


@pytest.mark.parametrize(
    "text",
    ["", "[]", "{", '{"programs": 3}', '{"programs": {"mine.src": {"of": "cut.src"}}}', "\0"],
)
def test_a_list_that_is_not_ours_lists_nothing(folder, text):
    (folder / MANIFEST).write_text(text)
    replace_program(folder, SHORT, list(SHORT), only="cut.src")
    assert names(folder) == {*MINE, *LONG, MANIFEST}


def test_nothing_outside_the_folder_is_ever_removed(folder, tmp_path_factory):
    outside = tmp_path_factory.mktemp("outside") / "x.src"
    outside.write_text("x")
    listed = json.loads((folder / MANIFEST).read_text())
    entry = next(iter(listed["programs"].values()))
    listed["programs"][str(Path("..") / outside.parent.name / "x.src")] = entry
    listed["programs"][str(outside)] = entry
    (folder / MANIFEST).write_text(json.dumps(listed))
    replace_program(folder, SHORT, list(SHORT), only="cut.src")
    assert outside.read_text() == "x"


def test_one_file_needs_no_list(tmp_path):
    replace_program(tmp_path, {"cut.mod": "cut"}, ["cut.mod"], only="cut.mod")
    assert names(tmp_path) == {"cut.mod"}


def test_all_files_are_written_or_none(folder):
    (folder / "z.src").mkdir()  # no file can take its place
    with pytest.raises(InputError, match=r"cannot write the program to .*z\.src"):
        write_files(folder, {"cut.src": "new", "a.src": "new", "z.src": "new"})
    assert (folder / "cut.src").read_text() == LONG["cut.src"]
    assert names(folder) == {*MINE, *LONG, MANIFEST}


def test_only_a_regular_file_is_replaced(tmp_path):
    fifo, device = tmp_path / "x.mod", tmp_path / "null"
    os.mkfifo(fifo)
    device.symlink_to("/dev/null")
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind(str(tmp_path / "s"))
        for path, what in (
            (fifo, "a FIFO"), (device, "a device"), (tmp_path / "s", "a socket"),
            (tmp_path, "a folder"),
        ):  # fmt: skip
            with pytest.raises(InputError, match=rf"it is {what}, not a file$"):
                write_program(path, "text")
            with pytest.raises(InputError, match=rf"it is {what}, not a file$"):
                replace_program(tmp_path.parent, {str(path): "text"}, [str(path)])
    assert fifo.is_fifo()
    assert {path.name for path in tmp_path.iterdir()} == {"x.mod", "null", "s"}
    link = tmp_path / "link.mod"
    link.symlink_to("cut.mod")  # to nothing, which is as good as a file
    write_program(link, "new")
    assert link.read_text() == "new"


def test_writing_replaces_the_file_at_one_stroke(tmp_path):
    target = tmp_path / "cut.mod"
    write_program(target, "first\n")
    write_program(target, "second\n")
    assert target.read_bytes() == b"second\n"
    assert list(tmp_path.iterdir()) == [target]
    for bad in (tmp_path / "missing" / "cut.mod", tmp_path, target / "x.mod", ""):
        with pytest.raises(InputError, match="cannot write the program"):
            write_program(bad, "text")
    assert list(tmp_path.iterdir()) == [target]
