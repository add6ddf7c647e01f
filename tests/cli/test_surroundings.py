"""What surrounds a command: closed and full streams, little memory, variables of numba."""

import os
import resource
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from commands import assert_refused, run
from jobs import DEMO, SMALL

KERFPATH = str(Path(sys.executable).parent / "kerfpath")


def shell(line, cwd=None, **environment):
    """Run a line of shell in which `kerfpath` is the command."""
    line = line.replace("kerfpath", KERFPATH)
    return subprocess.run(
        ["bash", "-c", line], cwd=cwd, env={**os.environ, **environment}, timeout=120,
        capture_output=True, text=True, check=False,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("kerfpath robots >&-", "stdout is closed"),
        ("kerfpath robots <&- >&-", "stdout is closed"),
        ("kerfpath robots > /dev/full", "stdout: cannot be written (No space left on device)"),
        ("kerfpath robots --json > /dev/full", "stdout: cannot be written"),
        ("kerfpath --help > /dev/full", "stdout: cannot be written"),
    ],
)
def test_output_that_cannot_be_written_is_one_line(line, said):
    done = shell(line)
    assert done.returncode == 2
    assert done.stderr.startswith(f"kerfpath: error: {said}")
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize(
    ("words", "code"), [("robots", 0), ("robots --json", 0), ("--help", 0), ("robots none", 2)]
)
def test_a_command_keeps_its_exit_code_when_nobody_reads(words, code):
    for reader in ("true", "head -0", "head -1"):
        done = shell(f"kerfpath {words} | {reader}; exit ${{PIPESTATUS[0]}}")
        assert done.returncode == code
        assert done.stderr.count("\n") == (code > 0)
    for nowhere in ("2>&-", "2> /dev/full", "2> >(true)", "2> >(head -0)"):
        assert shell(f"kerfpath {words} {nowhere} > /dev/null").returncode == code


def test_characters_that_the_terminal_has_not_are_escaped():
    done = shell("kerfpath robots | cat", PYTHONIOENCODING="ascii")
    assert (done.returncode, done.stderr) == (0, "")


@pytest.fixture(scope="module")
def job(tmp_path_factory):
    folder = tmp_path_factory.mktemp("job")
    shutil.copy(DEMO / "b_pillar.step", folder)
    (folder / "small.toml").write_text(SMALL.replace("[plan]", "[plan]\ncertify = false"))
    return folder


@pytest.mark.slow
@pytest.mark.parametrize("name", ["DISABLE_JIT", "CACHE_LOCATOR_CLASSES"])
def test_variables_of_numba_change_nothing(name, job, tmp_path):
    line = f"kerfpath --quiet plan small.toml --json --out {tmp_path}"
    done = shell(line, cwd=job, **{f"NUMBA_{name}": "1"})
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.count("\n") == 1


@pytest.mark.slow
@pytest.mark.parametrize("number", ["0", "many", "-1", "9" * 400])
def test_a_number_of_threads_that_is_none_is_one_line(number, job, tmp_path):
    line = f"kerfpath --quiet plan small.toml --out {tmp_path}"
    done = shell(line, cwd=job, NUMBA_NUM_THREADS=number)
    assert done.returncode == 2
    assert done.stderr.startswith("kerfpath: error: NUMBA_NUM_THREADS")
    assert done.stderr.count("\n") == 1


@pytest.mark.slow
@pytest.mark.parametrize("megabytes", [600, 1200])
def test_little_memory_is_one_line_or_enough(megabytes, job, tmp_path):
    def bound():
        resource.setrlimit(resource.RLIMIT_AS, (megabytes << 20, megabytes << 20))

    done = subprocess.run(
        [KERFPATH, "--quiet", "plan", "small.toml", "--out", tmp_path], cwd=job, preexec_fn=bound,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"}, capture_output=True, text=True,
        timeout=300, check=False,
    )  # fmt: skip
    if done.returncode:
        assert done.returncode == 2, done.stderr
        assert done.stderr.startswith("kerfpath: error: ")
        assert done.stderr.count("\n") == 1


@pytest.mark.parametrize(
    ("command", "option"),
    [
        (("contours", "none.step", "--html"), "--html"),
        (("script", "none.toml", "-o"), "-o"),
        (("post", "none.json", "-o"), "-o"),
    ],
)
def test_a_place_that_cannot_be_written_is_refused_before_any_work(tmp_path, command, option):
    """Before its input is read, which is not there."""
    (tmp_path / "file").write_text("mine")
    (tmp_path / "folder.html").mkdir()
    refused = run(*command, "no/such/page.html", cwd=tmp_path)
    assert_refused(refused, "no/such/page.html: cannot write (No such file", f"another {option}")
    refused = run(*command, "file/page.html", cwd=tmp_path)
    assert_refused(refused, "file/page.html: cannot write (Not a directory)", option)
    if option == "--html":
        refused = run(*command, "folder.html", cwd=tmp_path)
        assert_refused(refused, "folder.html: cannot write (it is a folder, not a file)")
