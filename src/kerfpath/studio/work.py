"""Work in threads: each does only the newest request, and running work can be stopped."""

from __future__ import annotations

import logging
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from threading import Event, Lock
from time import monotonic

from kerfpath.errors import KerfpathError
from kerfpath.progress import stopped_by

log = logging.getLogger("kerfpath.studio")


class Superseded(Exception):  # not an error, so its name does not end in Error
    """Raised inside work whose result is no longer wanted."""


class Stop:
    """A flag that asks running work to stop."""

    def __init__(self) -> None:
        self._event = Event()

    def set(self) -> None:
        """Ask the work to stop."""
        self._event.set()

    @property
    def asked(self) -> bool:
        """Whether the work is asked to stop."""
        return self._event.is_set()

    def check(self) -> None:
        """Raise `Superseded` if the work is asked to stop.

        Raises
        ------
        Superseded
            The work is asked to stop.
        """
        if self._event.is_set():
            raise Superseded

    def rest(self, seconds: float) -> None:
        """Wait, unless the work is asked to stop meanwhile.

        Raises
        ------
        Superseded
            The work is asked to stop.
        """
        if self._event.wait(seconds):
            raise Superseded


class Newest:
    """A thread that does only the newest request; a new one asks the running work to stop.

    Parameters
    ----------
    name : str
        Name of the thread.
    failed : callable
        Takes every exception of the work except `Superseded`; called in that thread.
    """

    def __init__(self, name: str, failed: Callable[[BaseException], None]) -> None:
        self._pool = ThreadPoolExecutor(1, thread_name_prefix=f"studio-{name}")
        self._failed, self._lock = failed, Lock()
        self._stop = Stop()

    def ask(self, work: Callable[[Stop], None]) -> None:
        """Do this next, in place of every earlier request."""
        with self._lock:
            self._stop.set()
            stop = self._stop = Stop()
            future = self._pool.submit(_do, work, stop)
        future.add_done_callback(self._done)

    def cancel(self) -> None:
        """Stop the running work."""
        with self._lock:
            self._stop.set()

    def close(self) -> None:
        """Stop the running work and take no further requests."""
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
    """A limiter of how often something is done.

    Parameters
    ----------
    every : float s
        Least time from one permission to the next.
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
    """Return the message of an exception in one line; an internal error is also logged."""
    if isinstance(error, KerfpathError):
        return str(error)
    log.error("the studio's work failed", exc_info=error)
    return f"internal error, {type(error).__name__}: {error}; see the terminal for the traceback"
