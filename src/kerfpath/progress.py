"""Progress: how a long call says how far it is, and where it may be stopped."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Protocol

__all__ = ["Progress", "may_stop", "no_progress", "stopped_by"]


class Progress(Protocol):
    """A callable that takes what is being done, how much of it is done, and of how much."""

    def __call__(self, what: str, done: int, total: int, /) -> None:
        """Take the state of one piece of work.

        Parameters
        ----------
        what : str
            The piece of work in words; another text is another piece.
        done, total : int
            Its parts that are done, and all of them. A total of 0: it has no measure, and is over
            when the next call comes.
        """


def no_progress(what: str, done: int, total: int, /) -> None:
    """Take the state of a piece of work and show nothing: the default of `progress=`."""


def _go_on() -> None:
    """Stop nothing: the default."""


_CHECK: ContextVar[Callable[[], None]] = ContextVar("check", default=_go_on)


def may_stop() -> None:
    """Let the work be stopped here: called where a long call can be left, nothing half done.

    Raises
    ------
    BaseException
        What the check of `stopped_by` raises; nothing without one.
    """
    _CHECK.get()()


@contextmanager
def stopped_by(check: Callable[[], None]) -> Iterator[None]:
    """Have calls inside, in this thread, call `check` now and then, which stops them by raising."""
    token = _CHECK.set(check)
    try:
        yield
    finally:
        _CHECK.reset(token)
