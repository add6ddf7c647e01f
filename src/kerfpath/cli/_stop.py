"""Ctrl-C: the command leaves with one line and exit code 130, whatever it is doing.

An exception raised in the middle of foreign code (a solver, a CAD kernel, an import) may be
swallowed, come out as another one, or crash the interpreter, and one that ends it while threads of
a solver run may crash it, too. So none is raised: a thread hears the signal and ends the process.
"""

from __future__ import annotations

import atexit
import os
import signal
import socket
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Thread, current_thread, main_thread

from kerfpath._writing import no_more_writing

__all__ = ["STOPPED", "in_order", "stoppable"]

STOPPED = 130
"""Exit code of a command that Ctrl-C has stopped."""
FILE_SECONDS = 5.0
"""What a file that is being written may take to be finished."""

_ordered = False
_heard = False


@contextmanager
def stoppable() -> Iterator[None]:
    """Leave at Ctrl-C; but where the signal is ignored, as under nohup, or another's, let it be."""
    plain = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    if not plain or current_thread() is not main_thread():
        yield
        return
    hears, speaks = socket.socketpair()
    speaks.setblocking(False)
    watch = Thread(target=_watch, args=(hears,), daemon=True)
    watch.start()
    before = signal.set_wakeup_fd(speaks.fileno(), warn_on_full_buffer=False)
    signal.signal(signal.SIGINT, _note)
    # Once the interpreter ends all is done, and that takes a while, too.
    atexit.register(signal.signal, signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)
        signal.set_wakeup_fd(before)
        speaks.close()
        watch.join()
        hears.close()


@contextmanager
def in_order(said: str) -> Iterator[None]:
    """Stop what runs here by KeyboardInterrupt, so that it lets go of its processes, and leave.

    Raises
    ------
    SystemExit
        Code 130, at Ctrl-C, after saying `said`; another Ctrl-C meanwhile leaves at once.
    """
    global _ordered
    _ordered = True
    try:
        yield
    except BaseException as error:  # foreign code may have made another error of it
        if not (_heard or isinstance(error, KeyboardInterrupt)):
            raise
        _say(said)
        raise SystemExit(STOPPED) from None
    finally:
        _ordered = False


def _note(*_: object) -> None:
    """Take the signal in the main thread, as soon as that is in Python code."""
    global _heard
    if _ordered and not _heard:
        _heard = True
        raise KeyboardInterrupt


def _watch(hears: socket.socket) -> None:
    """Wait for the signal, which the interpreter's own handler tells of at any time."""
    asked = 0
    while told := hears.recv(16):
        asked += told.count(signal.SIGINT)
        if asked > (1 if _ordered else 0):
            no_more_writing(FILE_SECONDS)
            _say("kerfpath: stopped")
            os._exit(STOPPED)


def _say(line: str) -> None:
    """Write a line to standard error as it is: who else writes there may have stopped half-way."""
    begin = "\r\x1b[K\x1b[?25h" if sys.stderr.isatty() else ""  # over the bar, and the cursor back
    os.write(2, f"{begin}{line}\n".encode())
