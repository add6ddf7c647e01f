"""Progress of long calls, and the places where they may be stopped."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Protocol

__all__ = [
    "Progress",
    "StopEarly",
    "counted",
    "may_stop",
    "no_progress",
    "shown_by",
    "stopped_by",
    "unstopped",
]


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


class StopEarly(Exception):  # not an error, so its name does not end in Error
    """Raised by `may_stop` where the work is to end early, with the best result that it has.

    Work that improves a result suppresses it and keeps that result; other work has none.
    """


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
    """Make long calls in this thread call `check` now and then; it stops them by raising.

    A check that was set before is called as well, after it.
    """
    before = _CHECK.get()

    def both() -> None:
        check()
        before()

    token = _CHECK.set(both)
    try:
        yield
    finally:
        _CHECK.reset(token)


@contextmanager
def unstopped() -> Iterator[None]:
    """Let the calls inside run to their end: they finish a result that has been found."""
    token = _CHECK.set(_go_on)
    try:
        yield
    finally:
        _CHECK.reset(token)


def _hide(done: int, total: int) -> None:
    """Show nothing: the default."""


_SHOW: ContextVar[Callable[[int, int], None]] = ContextVar("show", default=_hide)


@contextmanager
def shown_by(show: Callable[[int, int], None]) -> Iterator[None]:
    """Show how far the long calls in this thread are: `show` takes the parts done and all parts."""
    token = _SHOW.set(show)
    try:
        yield
    finally:
        _SHOW.reset(token)


@contextmanager
def counted(about: int) -> Iterator[Callable[[int], None]]:
    """Count the places inside where the work may be stopped; there are `about` so many of them.

    The work calls what it gets with the number of places that are still to come whenever it knows
    better. An estimate that turns out too low is raised by a quarter, so that the share of the
    work done may fall, but is never close to all of it for long.
    """
    show, done = _SHOW.get(), 0

    def remain(places: int) -> None:
        nonlocal about
        about = done + places

    def step() -> None:
        nonlocal about, done
        done += 1
        if done >= about:
            about = done + max(1, done // 4)
        show(done, about)

    with stopped_by(step):
        yield remain
