"""The surroundings of a command: signals that stop it, standard streams, and variables of numba."""

from __future__ import annotations

import atexit
import io
import os
import signal
import socket
import sys
import warnings
from collections.abc import Collection, Iterator
from contextlib import contextmanager, suppress
from threading import Event, Thread, current_thread, main_thread
from typing import Any

from kerfpath.errors import InputError
from kerfpath.files import finish_writes, remove_scratch
from kerfpath.isolated import OF_NUMBA, end_processes
from kerfpath.progress import StopEarly, stopped_by

# -----------------------------------------------------------------------------
# Closed or full standard streams, and variables of numba.


class _Output(io.FileIO):
    """A standard stream whose reader may leave: what it would have read goes nowhere.

    The command goes on, because its files and its exit code count, too.
    """

    def write(self, data: Any, /) -> int:
        """Write bytes.

        Raises
        ------
        InputError
            Stdout cannot be written, because a disk is full for example.
        """
        try:
            return super().write(data)
        except OSError as error:
            os.dup2(os.open(os.devnull, os.O_WRONLY), self.fileno())
            if self.fileno() == 1 and not isinstance(error, BrokenPipeError):
                raise InputError(
                    f"stdout: cannot be written ({error.strerror}); redirect it elsewhere"
                ) from None
            return memoryview(data).nbytes


def settle() -> None:
    """Make standard streams safe to write to, and let no variable of numba change the kernels.

    Streams that somebody has replaced, as tests do, stay.

    Raises
    ------
    InputError
        Stdout is closed.
    """
    for name in [n for n in os.environ if n.startswith("NUMBA_") and n not in OF_NUMBA]:
        del os.environ[name]
    if sys.stdout is not sys.__stdout__ or sys.stderr is not sys.__stderr__:
        return
    closed = [stream is None for stream in (sys.stdin, sys.stdout, sys.stderr)]
    for _ in filter(None, closed):
        os.open(os.devnull, os.O_RDWR)  # or a file would get the number of the stream
    sys.stdout, sys.stderr = _output(1, sys.stdout), _output(2, sys.stderr)
    warnings.formatwarning = lambda message, *_, **__: f"kerfpath: {message}\n"
    if closed[1]:
        raise InputError("stdout is closed, but results go there; redirect it, to /dev/null even")


def _output(number: int, like: Any) -> io.TextIOWrapper:
    """Return the text stream of a standard stream; characters that it cannot write are escaped."""
    strict = like is None or like.errors == "strict"
    return io.TextIOWrapper(
        io.BufferedWriter(_Output(number, "w", closefd=False)),
        encoding=None if like is None else like.encoding,
        errors="backslashreplace" if strict else like.errors,
        line_buffering=number == 2 or (like is not None and like.line_buffering),
    )


def flush() -> None:
    """Write what stdout still holds, while a failure can be reported."""
    with suppress(ValueError):  # it is closed
        sys.stdout.flush()


# -----------------------------------------------------------------------------
# Ctrl-C: the command prints one line and exits with code 130, whatever it is doing.
#
# SIGTERM and SIGHUP stop it in the same way, with codes 143 and 129.
#
# While contours are planned, the first Ctrl-C only ends the searches, see `end_early`.
#
# No exception is raised: inside foreign code (a solver, a CAD kernel, an import) it may be
# swallowed, turn into another exception or crash the interpreter, and so may an exit while threads
# of a solver run. Instead a thread waits for the signal and ends the process.

STOPS: dict[int, Any] = {
    signal.SIGINT: signal.default_int_handler,
    signal.SIGTERM: signal.SIG_DFL,
    signal.SIGHUP: signal.SIG_DFL,
}
"""Signals that stop a command, and what handles each in a process where nobody has changed that."""
FILE_SECONDS = 5.0
"""Time in which a file that is being written may be finished, s."""

_in_order = _may_end_early = False
_received = 0
"""The number of the signal that is stopping the work in order."""
_ending = Event()
"""Set when the searches are to end early."""


def exit_code(number: int) -> int:
    """Return the exit code of a command that a signal has stopped."""
    return 128 + number


@contextmanager
def stoppable() -> Iterator[None]:
    """Exit at a signal, unless it is ignored, as under nohup, or handled by someone else."""
    heard = [number for number, usual in STOPS.items() if signal.getsignal(number) == usual]
    if not heard or current_thread() is not main_thread():
        yield
        return
    receiver, sender = socket.socketpair()
    sender.setblocking(False)
    watch = Thread(target=_watch, args=(receiver, heard), daemon=True)
    watch.start()
    before = signal.set_wakeup_fd(sender.fileno(), warn_on_full_buffer=False)
    for number in heard:
        signal.signal(number, _note)
    # When the interpreter shuts down, the work is done; ignore signals while that takes its time.
    for number in heard:
        atexit.register(signal.signal, number, signal.SIG_IGN)
    try:
        yield
    finally:
        for number in heard:
            signal.signal(number, STOPS[number])
        signal.set_wakeup_fd(before)
        sender.close()
        watch.join()
        receiver.close()


@contextmanager
def end_early() -> Iterator[None]:
    """End the searches inside at the first Ctrl-C, with what they have found; another one exits."""
    global _may_end_early
    _may_end_early = True
    try:
        with stopped_by(_end_if_asked):
            yield
    finally:
        _may_end_early = False


def _end_if_asked() -> None:
    if _ending.is_set():
        raise StopEarly


def ended_early() -> bool:
    """Return whether Ctrl-C has ended the searches early."""
    return _ending.is_set()


@contextmanager
def stop_in_order(line: str) -> Iterator[None]:
    """Stop the work inside by KeyboardInterrupt, so that it frees its processes, and exit.

    Raises
    ------
    SystemExit
        Code 130, at Ctrl-C, after printing `line`; another Ctrl-C meanwhile exits at once. Other
        signals in the same way.
    """
    global _in_order
    _in_order = True
    try:
        yield
    except BaseException as error:  # foreign code may have made another error of it
        if not (_received or isinstance(error, KeyboardInterrupt)):
            raise
        _print(line)
        raise SystemExit(exit_code(_received or signal.SIGINT)) from None
    finally:
        _in_order = False


def _note(number: int, _frame: object) -> None:
    """Handle a signal in the main thread, as soon as that runs Python code."""
    global _received
    if _in_order and not _received:
        _received = number
        raise KeyboardInterrupt


def _watch(receiver: socket.socket, heard: Collection[int]) -> None:
    """Wait for signals, which the interpreter writes to the socket at any time."""
    count = 0
    while signals := receiver.recv(16):
        stops = [number for number in signals if number in heard]
        if stops == [signal.SIGINT] and _may_end_early and not _ending.is_set():
            _ending.set()
            _print("kerfpath: stopping; what is planned is kept (Ctrl-C again: stop at once)")
            continue
        count += len(stops)
        if count > (1 if _in_order else 0):
            finish_writes(FILE_SECONDS)
            end_processes()
            remove_scratch()
            _print("kerfpath: stopped")
            os._exit(exit_code(stops[-1]))


def _print(line: str) -> None:
    """Write a line to stderr directly: another writer there may have stopped half-way."""
    begin = "\r\x1b[K\x1b[?25h" if sys.stderr.isatty() else ""  # over the bar, and the cursor back
    with suppress(OSError):  # nobody may read it
        os.write(2, f"{begin}{line}\n".encode())
