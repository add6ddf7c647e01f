"""Work beside the server: a thread of which the newest request wins, and how work is stopped."""

from __future__ import annotations

import logging
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from threading import Event, Lock
from time import monotonic

from kerfpath.errors import KerfpathError
from kerfpath.progress import stopped_by

__all__ = ["Newest", "Seldom", "Stop", "Superseded", "said_of"]

log = logging.getLogger("kerfpath.studio")


class Superseded(Exception):  # it says what has happened, and is no error
    """Raised inside work that nobody waits for any more."""


class Stop:
    """Says to work that it is not wanted any more."""

    def __init__(self) -> None:
        self._event = Event()

    def set(self) -> None:
        """Ask the work to stop."""
        self._event.set()

    @property
    def asked(self) -> bool:
        """Whether it is to stop."""
        return self._event.is_set()

    def check(self) -> None:
        """Raise where the work is to stop.

        Raises
        ------
        Superseded
            It is.
        """
        if self._event.is_set():
            raise Superseded

    def rest(self, seconds: float) -> None:
        """Wait, unless the work is stopped meanwhile.

        Raises
        ------
        Superseded
            It is.
        """
        if self._event.wait(seconds):
            raise Superseded


class Newest:
    """A thread that does the newest of what it is asked for; what it is at is asked to stop.

    Parameters
    ----------
    name : str
        Of the thread.
    failed : callable
        Takes what work raised, other than that it was stopped; in that thread.
    """

    def __init__(self, name: str, failed: Callable[[BaseException], None]) -> None:
        self._pool = ThreadPoolExecutor(1, thread_name_prefix=f"studio-{name}")
        self._failed, self._lock = failed, Lock()
        self._stop = Stop()

    def ask(self, work: Callable[[Stop], None]) -> None:
        """Do this next, and nothing else that was asked for before."""
        with self._lock:
            self._stop.set()
            stop = self._stop = Stop()
            future = self._pool.submit(_do, work, stop)
        future.add_done_callback(self._done)

    def cancel(self) -> None:
        """Stop what is being done."""
        with self._lock:
            self._stop.set()

    def close(self) -> None:
        """Stop, and take nothing more."""
        self.cancel()
        self._pool.shutdown(wait=False, cancel_futures=True)

    def _done(self, future: Future[None]) -> None:
        if future.cancelled():
            return
        error = future.exception()
        if error is not None and not isinstance(error, Superseded):
            self._failed(error)


def _do(work: Callable[[Stop], None], stop: Stop) -> None:
    stop.check()
    with stopped_by(stop.check):
        work(stop)


class Seldom:
    """Lets something through a few times a second.

    Parameters
    ----------
    every : float s
    """

    def __init__(self, every: float) -> None:
        self._every, self._last = every, -every

    def may(self) -> bool:
        """Return whether enough time has passed since it last returned True."""
        now = monotonic()
        if now - self._last < self._every:
            return False
        self._last = now
        return True


def said_of(error: BaseException) -> str:
    """Return what work raised in one line; what is a fault of kerfpath goes to the log, too."""
    if isinstance(error, KerfpathError):
        return str(error)
    log.error("the studio's work failed", exc_info=error)
    return f"a fault in kerfpath, {type(error).__name__}: {error}; the terminal has more"
