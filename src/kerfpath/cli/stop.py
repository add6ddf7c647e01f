"""Ctrl-C: the command prints one line and exits with code 130, whatever it is doing.

No exception is raised: inside foreign code (a solver, a CAD kernel, an import) it may be swallowed,
turn into another exception or crash the interpreter, and so may an exit while threads of a solver
run. Instead a thread waits for the signal and ends the process.
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

from kerfpath.files import finish_writes

STOPPED = 130
"""Exit code of a command that Ctrl-C has stopped."""
FILE_SECONDS = 5.0
"""Time in which a file that is being written may be finished, s."""

_in_order = False
_received = False


@contextmanager
def stoppable() -> Iterator[None]:
    """Exit at Ctrl-C, unless the signal is ignored, as under nohup, or handled by someone else."""
    plain = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    if not plain or current_thread() is not main_thread():
        yield
        return
    receiver, sender = socket.socketpair()
    sender.setblocking(False)
    watch = Thread(target=_watch, args=(receiver,), daemon=True)
    watch.start()
    before = signal.set_wakeup_fd(sender.fileno(), warn_on_full_buffer=False)
    signal.signal(signal.SIGINT, _note)
    # When the interpreter shuts down, the work is done; ignore Ctrl-C while that takes its time.
    atexit.register(signal.signal, signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)
        signal.set_wakeup_fd(before)
        sender.close()
        watch.join()
        receiver.close()


@contextmanager
def stop_in_order(line: str) -> Iterator[None]:
    """Stop the work inside by KeyboardInterrupt, so that it frees its processes, and exit.

    Raises
    ------
    SystemExit
        Code 130, at Ctrl-C, after printing `line`; another Ctrl-C meanwhile exits at once.
    """
    global _in_order
    _in_order = True
    try:
        yield
    except BaseException as error:  # foreign code may have made another error of it
        if not (_received or isinstance(error, KeyboardInterrupt)):
            raise
        _print(line)
        raise SystemExit(STOPPED) from None
    finally:
        _in_order = False


def _note(*_: object) -> None:
    """Handle the signal in the main thread, as soon as that runs Python code."""
    global _received
    if _in_order and not _received:
        _received = True
        raise KeyboardInterrupt


def _watch(receiver: socket.socket) -> None:
    """Wait for the signal, which the interpreter writes to the socket at any time."""
    count = 0
    while signals := receiver.recv(16):
        count += signals.count(signal.SIGINT)
        if count > (1 if _in_order else 0):
            finish_writes(FILE_SECONDS)
            _print("kerfpath: stopped")
            os._exit(STOPPED)


def _print(line: str) -> None:
    """Write a line to stderr directly: another writer there may have stopped half-way."""
    begin = "\r\x1b[K\x1b[?25h" if sys.stderr.isatty() else ""  # over the bar, and the cursor back
    os.write(2, f"{begin}{line}\n".encode())
