"""Every spoilt file is read, or refused in one line that names it; `fuzz.py` looks deeper."""

import contextlib
import io
import time
from pathlib import Path

import numpy as np
import pytest

import spoilt
from kerfpath.cad import read
from kerfpath.cell import read_mesh
from kerfpath.errors import InputError, about
from kerfpath.job import read_job
from kerfpath.robots import Robot
from readers import READERS, write_meshes

MUTANTS = {
    "step": 30, "iges": 40, "dxf": 60, "table": 100, "mesh": 60, "urdf": 60, "job": 60, "plan": 40,
    "measured": 50, "store": 30,
}  # fmt: skip
"""How many of each: as many as a few seconds allow in all; 40 of programs in each language."""


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Sound files of a reader, read, and their bytes; made once each."""
    known = {}

    def make(name):
        if name not in known:
            wholes = READERS[name].wholes(tmp_path_factory.mktemp(name))
            with contextlib.redirect_stdout(io.StringIO()):
                for whole in wholes:
                    READERS[name].read(whole.main)
            known[name] = wholes, {whole.spoilt: whole.spoilt.read_bytes() for whole in wholes}
        return known[name]

    return make


@pytest.mark.slow
@pytest.mark.parametrize("name", READERS)
def test_a_spoilt_file_is_read_or_refused_in_one_line(made, name, capfd):
    wholes, sound = made(name)
    refused = 0
    for seed in range(MUTANTS.get(name, 40)):
        whole, content = spoilt.spoilt(wholes, sound, seed)
        whole.spoilt.write_bytes(content)
        assert spoilt.complaint(READERS[name].read, whole) == "", f"seed {seed}"
        refused += content != sound[whole.spoilt]
        whole.spoilt.write_bytes(sound[whole.spoilt])
    assert refused > 0
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("name", ["step", "iges", "dxf", "table", "job", "measured"])
def test_a_file_cut_off_anywhere_is_read_or_refused_in_one_line(made, name):
    wholes, sound = made(name)
    whole = min(wholes, key=lambda each: len(sound[each.spoilt]))
    content = sound[whole.spoilt]
    for at in range(0, len(content), len(content) // 25 + 1):
        whole.spoilt.write_bytes(content[:at])
        assert spoilt.complaint(READERS[name].read, whole) == ""
    whole.spoilt.write_bytes(content)


def test_the_complaints_find_what_they_are_for(tmp_path):
    """A reader that does each of the things that none may do is caught at it."""
    path = tmp_path / "a.csv"
    path.write_text("1,2")
    whole = spoilt.Whole(path, path)

    def refusing(said):
        def read(path):
            error = InputError("")
            error.args = (said,)
            raise error

        return read

    assert spoilt.complaint(lambda path: None, whole) == ""
    assert spoilt.complaint(refusing(f"{path}: is wrong"), whole) == ""
    assert "one line" in spoilt.complaint(refusing(f"{path}: is\nwrong"), whole)
    assert "one line" in spoilt.complaint(refusing("is wrong"), whole)
    assert "700" in spoilt.complaint(refusing(f"{path.name}:{'x' * (699 - 5)}"), whole)
    assert "KeyError" in spoilt.complaint(lambda path: {}["a"], whole)
    assert "RuntimeWarning" in spoilt.complaint(lambda path: np.float64(1e308) * 1e308, whole)


# --- the message -----------------------------------------------------------------------------


def test_bad_input_is_one_short_line_whatever_is_quoted(tmp_path):
    said = str(InputError(f"a.csv: expected a number, got {'x' * 10_000}; write one"))
    assert len(said) == 600
    assert said.startswith("a.csv: expected a number, got xxx")
    assert said.endswith("xxx; write one")
    assert str(InputError("a\nb\0c\u2028d\x1b[31m")) == "a\\nb\\x00c\\u2028d\\x1b[31m"
    with pytest.raises(InputError, match=r"a\.csv: no number$"), about(tmp_path / "a.csv"):
        raise InputError("no number")
    with pytest.raises(InputError, match=r"^line 3 of a\.csv$"), about(tmp_path / "a.csv"):
        raise InputError("line 3 of a.csv")


# --- memory ----------------------------------------------------------------------------------


def _fan(count):
    """A closed surface of `count` triangles or so, each as wide as the body: a double cone."""
    turn = np.linspace(0, 2 * np.pi, count // 2, endpoint=False)
    rim = np.c_[np.cos(turn), np.sin(turn), np.zeros_like(turn)]
    corners = np.vstack([rim, [[0, 0, 1], [0, 0, -1]]])
    k = np.arange(len(turn))
    after, top = (k + 1) % len(k), np.full_like(k, len(k))
    return corners, np.vstack([np.c_[k, after, top], np.c_[after, k, top + 1]])


def test_a_mesh_takes_memory_as_it_is_large(tmp_path):
    """Wide triangles, and many vertices in one place, took gigabytes from files of kilobytes."""
    corners, faces = _fan(4000)
    write_meshes(tmp_path, corners, faces)
    path = tmp_path / "binary.stl"
    whole = spoilt.Whole(path, path)
    size = path.stat().st_size
    assert spoilt.taken(lambda path: read_mesh(path, "m"), whole) * 1e6 < 300 * size
    crowd = np.random.default_rng(0).uniform(0, 1e-8, (3000, 3))
    corners[: len(crowd)][: len(corners)] = crowd[: len(corners)]
    write_meshes(tmp_path, corners, faces)
    assert spoilt.taken(lambda path: read_mesh(path, "m"), whole) * 1e6 < 300 * size


# --- time ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "text", ["a." * 200_000 + "a = 1", "[" + "a." * 200_000 + "a]", "#" * 11**7]
)
def test_a_job_takes_no_time_for_what_no_job_holds(tmp_path, text):
    (tmp_path / "job.toml").write_text(f"[robot]\n{text}\n")
    started = time.process_time()
    with pytest.raises(InputError, match=r"job\.toml"):
        read_job(tmp_path / "job.toml")
    assert time.process_time() - started < 2  # s; minutes where it grows with the square


@pytest.mark.skipif(not Path("/dev/zero").exists(), reason="no such device here")
@pytest.mark.parametrize("suffix", [".step", ".csv", ".toml", ".urdf"])
def test_a_device_is_no_file(tmp_path, suffix):
    path = tmp_path / f"endless{suffix}"
    path.symlink_to("/dev/zero")
    reading = {".toml": read_job, ".urdf": Robot.from_urdf}.get(suffix, read)
    with pytest.raises(InputError, match=f"endless{suffix}: is not a (regular )?file"):
        reading(path)
