"""Ctrl-C, SIGTERM, SIGHUP at any moment: the exit code, one line, no crash, no temporary file."""

import os
import shutil
import signal
import subprocess
import sys
import time
from contextlib import suppress
from itertools import cycle
from pathlib import Path

import numpy as np
import pytest

from commands import run
from jobs import DEMO, SMALL

KERFPATH = Path(sys.executable).parent / "kerfpath"
TRIES = int(os.environ.get("KERFPATH_STOPS", "6"))
"""More than the suite can wait for are asked for by hand."""


STOPS = {signal.SIGINT: 130, signal.SIGTERM: 143, signal.SIGHUP: 129}


def started(*arguments, cwd):
    """Start the command so that it hears signals, whatever this process does with it."""

    def hears():
        signal.signal(signal.SIGINT, signal.default_int_handler)
        signal.signal(signal.SIGHUP, signal.SIG_DFL)  # nohup ignores it

    return subprocess.Popen(
        [KERFPATH, *map(str, arguments)], cwd=cwd, text=True, preexec_fn=hears,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True,
    )  # fmt: skip


STOPPED = ("kerfpath: stopped",)
ENDED = (
    *STOPPED,
    "kerfpath: stopped before anything was planned; nothing is written",
    "kerfpath: stopped; what was planned by then is written",
)
"""Last lines after Ctrl-C, by when it comes."""


def assert_stopped(process, folder, number, said=STOPPED):
    stdout, stderr = process.communicate(timeout=60)
    assert process.returncode == STOPS[number], stdout + stderr
    *progress, last = stderr.splitlines()
    assert last in said
    assert all(line.startswith("kerfpath: ") for line in progress)  # a line every few seconds
    assert not list(folder.rglob("*.tmp"))
    assert_alone(process)


def assert_alone(process):
    """Assert that the processes that a process has started end with it."""
    end = time.perf_counter() + 10
    while processes_of(process):
        assert time.perf_counter() < end, processes_of(process)
        time.sleep(0.1)


def processes_of(process):
    """The processes of the session that a process has begun."""
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):
            session = (folder / "stat").read_text().rpartition(")")[2].split()[3]
            if int(session) == process.pid:
                found.append((folder / "cmdline").read_bytes())
    return found


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
def test_a_signal_at_any_moment_ends_a_plan_with_one_line(job, life):
    rng = np.random.default_rng(71)
    stopped = 0
    # Before some 0.1 s the interpreter starts, and no code of ours runs yet.
    for number, at in zip(cycle(STOPS), rng.uniform(0.15, max(0.9 * life, 0.3), TRIES)):
        process = started("plan", "small.toml", "--out", f"at-{at:.3f}", cwd=job)
        time.sleep(at)
        if process.poll() is None:
            process.send_signal(number)
        if process.wait(60) == 0:  # it was quicker than the one that was clocked
            process.communicate()
            continue
        assert_stopped(process, job, number, ENDED if number == signal.SIGINT else STOPPED)
        stopped += 1
    assert stopped > TRIES / 2


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="signals as POSIX has them")
def test_a_second_ctrl_c_stops_at_once(job, life):
    process = started("plan", "demo.toml", "--out", "twice", cwd=job)
    while (line := process.stderr.readline()) and "(10 s)" not in line:
        pass  # compiled and planning
    process.send_signal(signal.SIGINT)
    assert "what is planned is kept" in process.stderr.readline()
    process.send_signal(signal.SIGINT)
    assert process.wait(10) == 130
    process.communicate()


@pytest.mark.slow
@pytest.mark.parametrize("number", STOPS)
def test_a_signal_ends_a_batch_with_all_its_processes(job, life, number, tmp_path):
    process = started("batch", "small.toml", "--out", tmp_path, "--processes", 2, cwd=job)
    while len(processes_of(process)) < 3 and process.poll() is None:
        time.sleep(0.05)
    time.sleep(0.5)
    process.send_signal(number)
    said = "kerfpath: stopped; the same command continues from the results so far"
    assert_stopped(process, tmp_path, number, (said,))


@pytest.mark.slow
def test_kill_ends_the_processes_of_a_command_too(job, life, tmp_path):
    process = started("batch", "small.toml", "--out", tmp_path, "--processes", 2, cwd=job)
    while len(processes_of(process)) < 3 and process.poll() is None:
        time.sleep(0.05)
    process.kill()
    process.communicate()
    assert_alone(process)


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
