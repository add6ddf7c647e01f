"""What is called apart may crash, hang or swell: the caller gets one clear line, and goes on."""

import multiprocessing
import os
import signal
import subprocess
import sys
import time

import pytest

from apart_calls import (
    abort,
    crash,
    doubled,
    err,
    hang,
    knows,
    leave,
    refuse,
    swell,
    unpicklable,
    whose,
)  # fmt: skip
from conftest import ROOT
from kerfpath import isolated as module
from kerfpath.errors import InputError
from kerfpath.isolated import call_apart


def asked_in_a_fork(answers):
    answers.put((call_apart(doubled, 21, size=0), call_apart(whose, size=0)))


def test_a_call_is_made_in_another_process_that_is_kept():
    assert call_apart(doubled, 21, size=0) == 42
    assert call_apart(whose, size=0) == call_apart(whose, size=0) != os.getpid()


@pytest.mark.parametrize(
    ("function", "said"),
    [(crash, "(SIGSEGV)"), (abort, "(SIGABRT)"), (leave, "(exit code 3)"), (swell, "of memory")],
)
def test_a_crash_is_one_line_and_the_next_call_goes_on(function, said):
    with pytest.raises(InputError) as caught:
        call_apart(function, size=0)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)
    assert call_apart(doubled, 21, size=0) == 42


def test_what_takes_too_long_is_ended(monkeypatch):
    monkeypatch.setattr(module, "SECONDS", 1.0)
    with pytest.raises(InputError, match="more than 1 s"):
        call_apart(hang, size=0)
    monkeypatch.setattr(module, "PATIENCE", 0.3)  # of what waits, and takes no processor time
    with pytest.raises(InputError, match="more than 1 s"):
        call_apart(time.sleep, 60, size=0)
    monkeypatch.undo()
    assert call_apart(doubled, 21, size=0) == 42


def test_a_larger_file_may_take_longer(monkeypatch):
    monkeypatch.setattr(module, "SECONDS", 0.0)
    with pytest.raises(InputError, match="more than 1 s"):
        call_apart(hang, size=30_000)
    assert call_apart(doubled, 21, size=10_000_000) == 42


@pytest.mark.parametrize(
    ("function", "error", "said"),
    [(refuse, InputError, "damaged"), (err, KeyError, "key"), (unpicklable, Exception, "pickle")],
)
def test_what_the_function_raises_comes_through(function, error, said):
    with pytest.raises(error, match=said):
        call_apart(function, size=0)
    assert call_apart(doubled, 21, size=0) == 42


def test_a_process_that_has_left_is_replaced(monkeypatch):
    first = call_apart(whose, size=0)
    os.kill(first, signal.SIGKILL)
    time.sleep(0.1)
    assert call_apart(whose, size=0) != first
    # It leaves by itself, just when it is asked: the answer says so, and a new one is asked.
    worker = module._worker
    worker.end()
    monkeypatch.setattr(module, "IDLE", 0.0)
    module._worker = None
    module.stand_by()
    idle = module._worker.process
    idle.wait(30)
    monkeypatch.undo()
    assert call_apart(doubled, 21, size=0) == 42
    assert module._worker.process is not idle


@pytest.mark.parametrize(("wanted", "there"), [("colorsys", True), ("no.such.module", False)])
def test_a_process_that_stands_by_imports_what_it_will_be_asked_for(wanted, there):
    if module._worker is not None:
        module._worker.end()
        module._worker = None
    assert not call_apart(knows, "colorsys", size=0)
    module._worker.end()
    module._worker = None
    module.stand_by(wanted)
    assert call_apart(knows, wanted, size=0) == there


INTERRUPTED = """
import signal
from apart_calls import doubled, interrupted
from kerfpath.isolated import call_apart

signal.signal(signal.SIGINT, signal.default_int_handler)  # where it was ignored by who started this
try:
    call_apart(interrupted, size=0)
except KeyboardInterrupt:
    print("interrupted,", call_apart(doubled, 21, size=0))
"""


def test_an_interrupt_ends_the_call():
    """In a process of its own: the signal would end the one that runs the tests, too."""
    path = os.pathsep.join([*sys.path, str(ROOT / "tests")])
    done = subprocess.run(
        [sys.executable, "-c", INTERRUPTED],
        env={**os.environ, "PYTHONPATH": path},
        capture_output=True,
        text=True,
        timeout=60,
        check=True,
    )
    assert done.stdout == "interrupted, 42\n"


@pytest.mark.filterwarnings("ignore:This process:DeprecationWarning")
def test_a_fork_has_a_process_of_its_own():
    ours = call_apart(whose, size=0)
    context = multiprocessing.get_context("fork")
    answers = context.Queue()
    child = context.Process(target=asked_in_a_fork, args=(answers,))
    child.start()
    doubled_, theirs = answers.get(timeout=60)
    child.join()
    assert doubled_ == 42
    assert theirs != ours
    assert call_apart(whose, size=0) == ours
