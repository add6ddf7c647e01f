"""The surroundings of a command: closed or full standard streams, and variables of numba."""

from __future__ import annotations

import io
import os
import sys
import warnings
from contextlib import suppress
from typing import Any

from kerfpath.errors import InputError
from kerfpath.isolated import OF_NUMBA


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
