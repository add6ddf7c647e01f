"""Calls that may take their process with them, as C++ libraries do on damaged files: made apart.

One process is kept for them while they come; it is replaced when it dies, and leaves by itself
when nothing is asked of it for a while.
"""

from __future__ import annotations

import atexit
import math
import os
import pickle
import resource
import signal
import subprocess
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from importlib import import_module
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, TypeVar

from kerfpath.errors import InputError

__all__ = ["call_apart", "stand_by"]

SECONDS = 20.0
"""Processor time that a small file may take."""
SECONDS_PER_MB = 20.0
"""And so much more for each megabyte of it."""
MEMORY = 2 * 1024**3
"""Bytes that a small file may take, beside what the libraries themselves do."""
MEMORY_PER_BYTE = 100
"""And so many more for each byte of it."""
PATIENCE = 20.0
"""Times the processor time: what it may take by the clock, on a machine that is busy."""
IDLE = 10.0
"""s after which a process leaves that nothing is asked of."""

_T = TypeVar("_T")
_LEAVES = "leaves"
_START = (
    "import sys; sys.path[:] = {path!r}; from kerfpath.apart import _serve; "
    "_serve({fd}, {idle}, {module!r})"
)


def call_apart(function: Callable[..., _T], *arguments: object, size: int) -> _T:
    """Return `function(*arguments)`, called in a process of its own.

    Parameters
    ----------
    function : callable
        From the top level of a module; it, its arguments and what it returns are pickled.
    *arguments
        For it. Files by absolute paths.
    size : int
        Bytes of the file that it reads: what it may take of time and memory grows with them.

    Raises
    ------
    InputError
        The process crashed, or took more than it may: what of it, without the name of the file.
    Exception
        What the function raised.
    """
    seconds = math.ceil(SECONDS + SECONDS_PER_MB * size / 1e6)
    memory = MEMORY + MEMORY_PER_BYTE * size
    request = pickle.dumps((function, arguments, seconds, memory))
    with _lock:
        done, value = _answer(request, seconds)
    if done == "value":
        return value  # type: ignore[no-any-return]  # what the function returned, pickled
    if isinstance(value, MemoryError):
        raise InputError(
            f"it takes more than {memory / 1024**3:.0f} GB of memory to read; it is damaged, or "
            "holds far more than what is to be cut: export it again"
        )
    assert isinstance(value, BaseException)
    raise value


def stand_by(module: str | None = None) -> None:
    """Have the process started, which takes a second, while this one does something else.

    A new one imports `module`, that of a function that it will be asked for, without being asked.
    """
    with _lock:
        _ready(module)


def _answer(request: bytes, seconds: int) -> tuple[str, Any]:
    """Return what the process sends back: what is done, and its value."""
    global _worker
    done: tuple[str, Any] = (_LEAVES, None)
    while done[0] == _LEAVES:
        worker = _ready()
        try:
            with suppress(BrokenPipeError, ConnectionResetError):  # it left just now, and said so
                worker.ours.send_bytes(request)
            if not worker.ours.poll(PATIENCE * seconds):
                raise _too_slow(seconds)
            done = worker.ours.recv()
        except (EOFError, ConnectionResetError):
            number = -worker.process.wait()
            if number == signal.SIGXCPU:
                raise _too_slow(seconds) from None
            name = signal.Signals(number).name if number > 0 else f"exit code {-number}"
            raise InputError(
                f"it crashes the library that reads it ({name}), so it is damaged; copy or export "
                "it again"
            ) from None
        finally:
            if done[0] == _LEAVES or isinstance(done[1], MemoryError):
                worker.end()
                _worker = None
    return done


def _too_slow(seconds: int) -> InputError:
    return InputError(
        f"it takes more than {seconds} s to read; it is damaged, or holds far more than what is to "
        "be cut: export it again"
    )


class _Worker:
    """The process, and this end of the line to it."""

    def __init__(self, module: str | None) -> None:
        self.ours, theirs = Pipe()
        number = theirs.fileno()
        start = _START.format(path=sys.path, fd=number, idle=IDLE, module=module)
        self.process = subprocess.Popen(
            [sys.executable, "-c", start],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            pass_fds=[number],
        )
        theirs.close()

    def end(self) -> None:
        self.ours.close()
        self.process.kill()
        self.process.wait()


_worker: _Worker | None = None
_lock = threading.Lock()


def _ready(module: str | None = None) -> _Worker:
    """Return the process, a new one where there is none, which imports a module first."""
    global _worker
    if _worker is not None and _worker.process.poll() is not None:
        _worker.end()
        _worker = None
    if _worker is None:
        _worker = _Worker(module)
    return _worker


@atexit.register
def _end() -> None:
    if _worker is not None:
        _worker.end()


def _forget() -> None:
    """Leave the process to the parent of this one, after a fork."""
    global _worker, _lock
    if _worker is not None:
        _worker.ours.close()
        _worker.process.returncode = 0  # the parent's to wait for
    _worker, _lock = None, threading.Lock()


os.register_at_fork(after_in_child=_forget)


def _serve(fd: int, idle: float, module: str | None) -> None:
    """Do what is asked over a line, until it is closed or nothing comes for `idle` seconds."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if module is not None:
        with suppress(ImportError):  # whoever asks for what is in it is told
            import_module(module)
    line = Connection(fd)
    with suppress(EOFError, BrokenPipeError, ConnectionResetError):
        while line.poll(idle):
            line.send_bytes(_attempt(line.recv_bytes()))
        line.send((_LEAVES, None))


def _attempt(request: bytes) -> bytes:
    try:
        # What is imported to unpickle the function is no part of what its file takes.
        function, arguments, seconds, memory = pickle.loads(request)
        used = resource.getrusage(resource.RUSAGE_SELF)
        _bound(resource.RLIMIT_CPU, math.ceil(used.ru_utime + used.ru_stime) + seconds)
        if (here := _address_space()) is not None:
            _bound(resource.RLIMIT_AS, here + memory)
        return pickle.dumps(("value", function(*arguments)))
    except (Exception, SystemExit) as error:  # sent to who asked, not hidden
        return pickle.dumps(("error", error))


def _bound(which: int, most: int) -> None:
    hard = resource.getrlimit(which)[1]
    resource.setrlimit(which, (most if hard < 0 else min(most, hard), hard))


def _address_space() -> int | None:
    """Return the bytes that this process has mapped, None where the system does not say."""
    with suppress(OSError):
        return int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    return None
