"""The cache of compiled kernels: damage is found and mended, and no other code is ever run."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from conftest import ROOT

SCRIPT = """
import warnings
warnings.simplefilter("always")
from kerfpath.kernels import CACHE  # before numba, as everywhere
import numpy as np
from numba.core import event

compiled = []

class Listener(event.Listener):
    def on_start(self, event): pass
    def on_end(self, event): compiled.append(event.data["dispatcher"].py_func.__name__)

event.register("numba:compile", Listener())
from kerfpath.kernels.metric import MANHATTAN, total_distance
print(total_distance(np.ones((2, 3)), np.ones(3), MANHATTAN), "total_distance" in compiled)
"""


def asked(begin="", *, cwd=None, **environment):
    """Let another process compute a distance; return it, whether it compiled, and its warnings."""
    known = {k: v for k, v in os.environ.items() if not k.startswith("NUMBA_")}
    process = subprocess.run(
        [sys.executable, "-c", begin + SCRIPT], env={**known, **environment}, cwd=cwd, timeout=120,
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert process.returncode == 0, process.stderr
    value, compiled = process.stdout.split()
    return float(value), compiled == "True", process.stderr


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A folder for caches with the kernels of one distance."""
    folder = tmp_path_factory.mktemp("whole")
    assert asked(NUMBA_CACHE_DIR=str(folder)) == (6.0, True, "")
    assert asked(NUMBA_CACHE_DIR=str(folder)) == (6.0, False, "")
    return folder


def rewrite(change):
    """Return the ruin that changes the bytes of each file."""

    def ruin(files, other):
        for path in files:
            path.write_bytes(change(path.read_bytes()))

    return ruin


def replace(make):
    """Return the ruin that puts something else in the place of each file."""

    def ruin(files, other):
        for path in files:
            path.unlink()
            make(path)

    return ruin


def flipped(data):
    rng = np.random.default_rng(4)
    bits = np.unpackbits(np.frombuffer(data, np.uint8))
    bits[rng.integers(len(bits), size=10)] ^= 1
    return np.packbits(bits).tobytes()


def swapped(files, other):
    for kind in (".nbi", ".nbc"):
        alike = [path for path in files if path.suffix == kind]
        contents = [path.read_bytes() for path in alike]
        for path, content in zip(alike, contents[1:] + contents[:1], strict=True):
            path.write_bytes(content)


def foreign(files, other):
    """Files that were made for another processor, under the names of these."""
    theirs = sorted(other.rglob("*.nb?"))
    for path, their in zip(files, theirs, strict=True):
        path.write_bytes(their.read_bytes())


RUINS = {
    "cut": rewrite(lambda data: data[: len(data) // 2]),
    "zeroed": rewrite(lambda data: bytes(len(data))),
    "emptied": rewrite(lambda data: b""),
    "longer": rewrite(lambda data: data + b"x"),
    "a bit": rewrite(flipped),
    "text": rewrite(lambda data: b"not a cache\n"),
    "a pickle": rewrite(lambda data: b"cos\nabort\n(tR."),
    "swapped": swapped,
    "foreign": foreign,
    "no code": lambda files, other: [path.unlink() for path in files if path.suffix == ".nbc"],
    "no index": lambda files, other: [path.unlink() for path in files if path.suffix == ".nbi"],
    "a link to itself": replace(lambda path: path.symlink_to(path.name)),
    "a device": replace(lambda path: path.symlink_to("/dev/zero")),
    "a FIFO": replace(os.mkfifo),
}


@pytest.mark.slow
@pytest.mark.parametrize("ruin", RUINS)
def test_a_ruined_cache_is_noticed_and_mended(ruin, whole, tmp_path):
    folder = tmp_path / "cache"
    shutil.copytree(whole, folder)
    other = tmp_path / "other"
    if ruin == "foreign":
        asked(NUMBA_CACHE_DIR=str(other), NUMBA_CPU_NAME="generic", NUMBA_CPU_FEATURES="")
    files = sorted(folder.rglob("*.nb?"))
    assert len(files) > 2
    RUINS[ruin](files, other)
    assert asked(NUMBA_CACHE_DIR=str(folder)) == (6.0, True, "")
    assert asked(NUMBA_CACHE_DIR=str(folder)) == (6.0, False, "")


@pytest.mark.slow
def test_another_processor_has_a_folder_of_its_own(whole, tmp_path):
    folder = tmp_path / "cache"
    shutil.copytree(whole, folder)
    generic = {"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": ""}
    assert asked(NUMBA_CACHE_DIR=str(folder), **generic) == (6.0, True, "")
    assert asked(NUMBA_CACHE_DIR=str(folder), **generic) == (6.0, False, "")
    assert asked(NUMBA_CACHE_DIR=str(folder)) == (6.0, False, "")
    assert len(list(folder.iterdir())) == 2


FULL = "import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))\n"
"""Lets no file of this process have any content, as on a full disk."""


@pytest.mark.slow
@pytest.mark.parametrize("spoil", ["a file", "no folder", "a link to nothing", "a full disk"])
def test_a_cache_folder_that_cannot_be_used_is_said_once(spoil, tmp_path):
    folder, begin = tmp_path / "cache", ""
    if spoil == "a file":
        folder.write_text("a file")
    elif spoil == "no folder":
        folder = Path("/proc/cache")
    elif spoil == "a link to nothing":
        folder.symlink_to(tmp_path / "no" / "where")
    else:
        begin = FULL
    value, compiled, said = asked(begin, NUMBA_CACHE_DIR=str(folder))
    assert (value, compiled) == (6.0, True)
    assert said.count("compiled kernels cannot be kept in") == 1
    assert "Traceback" not in said


@pytest.mark.slow
def test_without_a_home_nothing_is_read_from_the_current_folder(tmp_path):
    """Nor from a relative cache folder, which anyone could have put there."""
    before = {"XDG_CACHE_HOME": "cache", "HOME": "home"}
    value, _, said = asked(cwd=tmp_path, PYTHONPATH=str(ROOT / "src"), **before)
    assert (value, said) == (6.0, "")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_the_settings_of_the_current_folder_are_not_read(whole, tmp_path):
    (tmp_path / ".numba_config.yaml").write_text(
        f"cache_dir: {tmp_path / 'evil'}\ndisable_jit: 1\n"
    )
    path = str(ROOT / "src")
    found = asked(cwd=tmp_path, PYTHONPATH=path, NUMBA_CACHE_DIR=str(whole))
    assert found == (6.0, False, "")
    assert asked(cwd=tmp_path, PYTHONPATH=path)[2] == ""
    assert [each.name for each in tmp_path.iterdir()] == [".numba_config.yaml"]


@pytest.mark.slow
def test_python_code_in_place_of_compiled_is_refused_in_one_line():
    done = subprocess.run(
        [sys.executable, "-c", "from kerfpath import robot; robot('ur_ur5e')"],
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.stderr.splitlines()[-1].startswith(
        "kerfpath.errors.InputError: NUMBA_DISABLE_JIT: expected kernels that are compiled"
    )


OLD = """
import os
from kerfpath.kernels import CACHE, is_kept
for i in range(12):
    folder = CACHE.parent / f"numba-{i:016x}"
    folder.mkdir(parents=True)
    (folder / "x.nbi").touch()
    os.utime(folder, (1e9 + i, 1e9 + i))
(CACHE.parent / "numba-mine").mkdir()
(CACHE.parent / "numba-ffffffffffffffff").symlink_to("numba-mine")
CACHE.mkdir()
half = CACHE / "y.nbi.tmp.1234"
half.touch()
os.utime(half, (1e9, 1e9))
assert is_kept()
print(*sorted(path.name for path in CACHE.parent.iterdir() if path != CACHE))
print(*CACHE.iterdir())
"""


def test_old_caches_go_but_those_used_last(tmp_path):
    done = subprocess.run(
        [sys.executable, "-c", OLD], env={**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)},
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    folders, half = done.stdout.split("\n")[:2]
    last = [f"numba-{i:016x}" for i in range(5, 12)]
    assert folders.split() == [*last, "numba-ffffffffffffffff", "numba-mine"]
    assert half == ""
    assert Path(tmp_path / "numba-mine").is_dir()
