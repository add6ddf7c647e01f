"""Progress of long calls, and the places where they may be stopped."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Protocol

__all__ = ["Progress", "may_stop", "no_progress", "stopped_by"]


class Progress(Protocol):
    """Callable that receives the progress of a long call."""

    def __call__(self, what: str, done: int, total: int, /) -> None:
        """Take the state of one piece of work.

        Parameters
        ----------
        what : str
            Name of the piece of work; another name means another piece.
        done, total : int
            Number of parts done, and number of all parts. With a total of 0 the work cannot be
            measured, and it ends when the next call comes.
        """


def no_progress(what: str, done: int, total: int, /) -> None:
    """Take the state of a piece of work and show nothing: the default of `progress=`."""


def _go_on() -> None:
    """Stop nothing: the default."""


_CHECK: ContextVar[Callable[[], None]] = ContextVar("check", default=_go_on)


def may_stop() -> None:
    """Let the work be stopped here; long calls call it where nothing is left half done.

    Raises
    ------
    BaseException
        Whatever the check of `stopped_by` raises; nothing without one.
    """
    _CHECK.get()()


@contextmanager
def stopped_by(check: Callable[[], None]) -> Iterator[None]:
    """Make long calls in this thread call `check` now and then; it stops them by raising."""
    token = _CHECK.set(check)
    try:
        yield
    finally:
        _CHECK.reset(token)
