"""Ctrl-C at any moment: exit code 130, one line, no traceback, no crash, no temporary file."""

import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from commands import run
from jobs import DEMO, SMALL

KERFPATH = Path(sys.executable).parent / "kerfpath"
TRIES = int(os.environ.get("KERFPATH_STOPS", "8"))
"""More than the suite can wait for are asked for by hand."""


def started(*arguments, cwd):
    """Start the command so that it hears Ctrl-C, whatever this process does with it."""

    def hears():
        signal.signal(signal.SIGINT, signal.default_int_handler)

    return subprocess.Popen(
        [KERFPATH, *map(str, arguments)], cwd=cwd, text=True, preexec_fn=hears,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )  # fmt: skip


def assert_stopped(process, folder):
    stdout, stderr = process.communicate(timeout=60)
    assert process.returncode == 130, stdout + stderr
    *progress, last = stderr.splitlines()
    assert last == "kerfpath: stopped"
    assert all(line.startswith("kerfpath: ") for line in progress)  # a line every few seconds
    assert not list(folder.rglob("*.tmp"))


@pytest.fixture(scope="module")
def job(tmp_path_factory):
    folder = tmp_path_factory.mktemp("stop")
    shutil.copy(DEMO / "b_pillar.step", folder)
    (folder / "small.toml").write_text(SMALL)
    (folder / "demo.toml").write_text((DEMO / "b_pillar.toml").read_text())
    return folder


@pytest.fixture(scope="module")
def life(job):
    """How long a run takes that nobody stops, with the kernels compiled, s."""
    assert run("plan", "small.toml", cwd=job).returncode == 0
    start = time.perf_counter()
    process = started("plan", "small.toml", cwd=job)
    assert process.communicate(timeout=300)
    assert process.returncode == 0
    return time.perf_counter() - start


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="signals as POSIX has them")
def test_ctrl_c_at_any_moment_ends_a_plan_with_one_line(job, life):
    rng = np.random.default_rng(71)
    stopped = 0
    # Before some 0.1 s the interpreter starts, and no code of ours runs yet.
    for at in rng.uniform(0.15, max(0.9 * life, 0.3), TRIES):
        process = started("plan", "small.toml", "--out", f"at-{at:.3f}", cwd=job)
        time.sleep(at)
        if process.poll() is None:
            process.send_signal(signal.SIGINT)
        if process.wait(60) == 0:  # it was quicker than the one that was clocked
            process.communicate()
            continue
        assert_stopped(process, job)
        stopped += 1
    assert stopped > TRIES / 2


@pytest.mark.skipif(os.name != "posix", reason="signals as POSIX has them")
def test_a_command_that_is_to_ignore_ctrl_c_goes_on(job):
    process = subprocess.Popen(
        [KERFPATH, "robots"], cwd=job, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_IGN),
    )  # fmt: skip
    time.sleep(0.3)
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=60)
    assert process.returncode == 0
