"""Python processes of our own code, and calls in one of them.

Calls in another process are for libraries that may crash (C++ readers of damaged files). One
process serves all calls. It is replaced when it dies, and it ends by itself when no call comes
for a while.
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
import sysconfig
import threading
import weakref
from collections.abc import Callable, Collection
from contextlib import suppress
from importlib import import_module
from multiprocessing import Pipe, active_children
from multiprocessing.connection import Connection
from pathlib import Path
from time import sleep
from typing import Any, TypeVar

from kerfpath.errors import InputError

SECONDS = 15.0
"""Processor time allowed for any file, s."""
SECONDS_PER_MB = 10.0
"""Processor time allowed in addition for each megabyte of the file, s."""
MEMORY = 3 * 1024**3 // 2
"""Bytes allowed for any file, beside those of the libraries themselves."""
MEMORY_PER_BYTE = 100
"""Bytes allowed in addition for each byte of the file."""
PATIENCE = 20.0
"""Wall-clock time allowed, as a multiple of the processor time, for a busy machine."""
IDLE = 10.0
"""Time without a call after which the process ends, s."""
CHECKED_EVERY = 0.2
"""Time between two looks whether the parent process still runs, s."""

_started: weakref.WeakSet[subprocess.Popen[bytes]] = weakref.WeakSet()
_T = TypeVar("_T")
_LEAVES = "leaves"


NOT_INHERITED = ("PYTHONPATH", "PYTHONSTARTUP", "PYTHONINSPECT")
"""Variables of the environment that could make a Python process run other code than ours."""
OF_NUMBA = ("NUMBA_CACHE_DIR", "NUMBA_NUM_THREADS")
"""The variables of numba that do not change compiled code; those that commands heed."""


def clean_environment() -> dict[str, str]:
    """Return the environment of Python processes, which get their import path by other means."""
    kept = {name: value for name, value in os.environ.items() if name not in NOT_INHERITED}
    return kept | {"PYTHONSAFEPATH": "1"}


def python_command(code: str) -> list[str]:
    """Return the command of a Python process that runs `code` of kerfpath.

    It imports from where this process does, but not from the current folder or the folder of the
    script that this process runs, unless kerfpath or the standard library (``python -m pdb``) is
    there.
    """
    left_out = {"", os.curdir}
    with suppress(OSError):  # the current folder may have been removed
        left_out.add(str(Path.cwd()))
    if script := getattr(sys.modules.get("__main__"), "__file__", None):
        left_out.add(str(Path(script).absolute().parent))
    left_out -= {str(Path(__file__).parents[1]), sysconfig.get_path("stdlib")}
    path = [folder for folder in sys.path if folder not in left_out]
    return [sys.executable, "-P", "-c", f"import sys; sys.path[:] = {path!r}; {code}"]


def start_python(code: str, *, pass_fds: Collection[int] = ()) -> subprocess.Popen[bytes]:
    """Start a Python process, as `python_command` and `clean_environment` say, without output."""
    none = subprocess.DEVNULL
    process = subprocess.Popen(
        python_command(code),
        env=clean_environment(),
        stdin=none,
        stdout=none,
        stderr=none,
        pass_fds=pass_fds,
    )
    _started.add(process)
    return process


def end_with(parent: int) -> None:
    """End this process soon after its parent has ended, even if that was killed meanwhile."""

    def wait() -> None:
        while os.getppid() == parent:
            sleep(CHECKED_EVERY)
        os._exit(1)

    threading.Thread(target=wait, daemon=True).start()


def end_processes() -> None:
    """Kill the processes that this one has started; only its own end may follow."""
    processes: list[Any] = [*_started, *active_children()]
    for process in processes:
        with suppress(OSError):
            process.kill()


def call_apart(function: Callable[..., _T], *arguments: object, size: int) -> _T:
    """Return `function(*arguments)`, called in a process of its own.

    Parameters
    ----------
    function : callable
        From the top level of a module; it, its arguments and its result are pickled.
    *arguments
        Arguments of the function; files by absolute paths.
    size : int
        Bytes of the file that it reads; the time and memory allowed grow with it.

    Raises
    ------
    InputError
        The process crashed, or took more time or memory than allowed. The message does not name
        the file.
    Exception
        Whatever the function raised.
    """
    seconds = seconds_for(size)
    memory = MEMORY + MEMORY_PER_BYTE * size
    request = pickle.dumps((function, arguments, seconds, memory))
    with _lock:
        done, value = _answer(request, seconds)
    if done == "value":
        return value  # type: ignore[no-any-return]  # what the function returned, pickled
    if isinstance(value, MemoryError):
        raise InputError(
            f"reading it takes more than {memory / 1024**3:.1f} GB of memory; it is damaged, or "
            "contains much more than the part to cut: export that part alone"
        )
    assert isinstance(value, BaseException)
    raise value


def seconds_for(size: int) -> int:
    """Return the processor time (s) allowed for reading a file of `size` bytes."""
    return math.ceil(SECONDS + SECONDS_PER_MB * size / 1e6)


def too_slow(seconds: int) -> InputError:
    """Return the error of a file that takes more than `seconds`; it does not name the file."""
    return InputError(
        f"reading it takes more than {seconds} s; it is damaged, or contains much more than the "
        "part to cut: export that part alone"
    )


def stand_by(module: str | None = None) -> None:
    """Start the process, which takes a second, while this process does something else.

    A new process imports `module`, so that its functions are ready for the first call.
    """
    with _lock:
        _ready(module)


def _answer(request: bytes, seconds: int) -> tuple[str, Any]:
    """Return the answer of the process: "value" or "error", and the value or exception."""
    global _worker
    done: tuple[str, Any] = (_LEAVES, None)
    while done[0] == _LEAVES:
        worker = _ready()
        try:
            with suppress(BrokenPipeError, ConnectionResetError):  # it left just now, and said so
                worker.ours.send_bytes(request)
            if not worker.ours.poll(PATIENCE * seconds):
                raise too_slow(seconds)
            done = worker.ours.recv()
        except (EOFError, ConnectionResetError):
            number = -worker.process.wait()
            if number == signal.SIGXCPU:
                raise too_slow(seconds) from None
            name = signal.Signals(number).name if number > 0 else f"exit code {-number}"
            raise InputError(
                f"the library that reads it crashed ({name}): it is damaged, or takes too much "
                "memory; export the part to cut again, alone"
            ) from None
        finally:
            if done[0] == _LEAVES or isinstance(done[1], MemoryError):
                worker.end()
                _worker = None
    return done


class _Worker:
    """The process, and this end of the pipe to it."""

    def __init__(self, module: str | None) -> None:
        self.ours, theirs = Pipe()
        number = theirs.fileno()
        self.process = start_python(
            f"from kerfpath.isolated import _serve; "
            f"_serve({number}, {os.getpid()}, {IDLE}, {module!r})",
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
    """Return the process; start one if there is none, which imports a module first."""
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
    """After a fork, leave the process to the parent and forget it here."""
    global _worker, _lock
    if _worker is not None:
        _worker.ours.close()
        _worker.process.returncode = 0  # the parent's to wait for
    _worker, _lock = None, threading.Lock()


os.register_at_fork(after_in_child=_forget)


def _serve(fd: int, parent: int, idle: float, module: str | None) -> None:
    """Answer requests of a parent from a pipe until it is closed, or idle for some seconds."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    end_with(parent)
    if module is not None:
        with suppress(ImportError):  # a call of a function in it reports the error
            import_module(module)
    line = Connection(fd)
    with suppress(EOFError, BrokenPipeError, ConnectionResetError):
        while line.poll(idle):
            line.send_bytes(_attempt(line.recv_bytes()))
        line.send((_LEAVES, None))


def _attempt(request: bytes) -> bytes:
    try:
        # Imports needed to unpickle the function do not count towards the limits of its file.
        function, arguments, seconds, memory = pickle.loads(request)
        used = resource.getrusage(resource.RUSAGE_SELF)
        _bound(resource.RLIMIT_CPU, math.ceil(used.ru_utime + used.ru_stime) + seconds)
        if (here := _address_space()) is not None:
            _bound(resource.RLIMIT_AS, here + memory)
        return pickle.dumps(("value", function(*arguments)))
    except (Exception, SystemExit) as error:  # sent back to the caller, not hidden
        return pickle.dumps(("error", error))


def _bound(which: int, most: int) -> None:
    hard = resource.getrlimit(which)[1]
    resource.setrlimit(which, (most if hard < 0 else min(most, hard), hard))


def _address_space() -> int | None:
    """Return the bytes that this process has mapped; None if the system does not report them."""
    with suppress(OSError):
        return int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    return None
