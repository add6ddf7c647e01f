"""Progress: how a long call says what it is doing and how far it is."""

from __future__ import annotations

from typing import Protocol

__all__ = ["Progress", "no_progress"]


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
