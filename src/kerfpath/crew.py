"""Calls of one function for many items, in this process and in others beside it."""

from __future__ import annotations

import os
import pickle
import signal
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from importlib import import_module
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from threading import Thread
from types import TracebackType
from typing import Any, Self, TypeVar

from kerfpath.effort import current_effort, set_effort
from kerfpath.isolated import end_with, start_python

__all__ = ["ALONE", "Crew"]

T = TypeVar("T")
R = TypeVar("R")


class Crew:
    """Processes of this machine that do a share of the work of this one, until the block ends.

    They are started at once and import what they need while this process does something else. Each
    has one thread, and the effort of this process.

    Parameters
    ----------
    others : int
        Number of processes beside this one; with 0 all is done here.
    module : str
        Module that they import, with the functions that they are to call.
    """

    def __init__(self, others: int, module: str) -> None:
        self._others = [_Other(module) for _ in range(others)]

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        for other in self._others:
            other.end()

    def each(
        self,
        function: Callable[[T], R],
        items: Sequence[T],
        begin: Callable[[T], None] = lambda item: None,
    ) -> list[R]:
        """Return `function(item)` for all items, in their order.

        What the processes leave because they have died is done here. Whatever the function or
        `begin` raises first is raised; processes that are still at an item are ended then, as
        nobody wants its result.

        Parameters
        ----------
        function : callable
            From the top level of a module, or a partial of one; it, its items and its results are
            pickled.
        items : sequence
        begin : callable
            Called with each item that is done in this process, before that.
        """
        left, done = deque(enumerate(items)), dict[int, R]()
        failed = list[BaseException]()

        def work(call: Callable[[T], R]) -> None:
            while not failed:
                try:
                    k, item = left.popleft()
                except IndexError:
                    return
                try:
                    done[k] = call(item)
                except (EOFError, OSError) as died:
                    left.appendleft((k, item))
                    if call is here:
                        failed.append(died)
                    return
                except BaseException as error:
                    failed.append(error)

        def here(item: T) -> R:
            begin(item)
            return function(item)

        threads = [
            Thread(target=work, args=[other.calling(function)], daemon=True)
            for other in self._others
        ]
        for thread in threads:
            thread.start()
        work(here)
        for other, thread in zip(self._others, threads, strict=True):
            if failed and thread.is_alive():
                other.kill()
            thread.join()
        work(here)
        if failed:
            raise failed[0]
        return [done[k] for k in range(len(items))]


ALONE = Crew(0, __name__)
"""No process beside this one."""


class _Other:
    """One of the processes, and this end of the pipe to it."""

    def __init__(self, module: str) -> None:
        self._ours, theirs = Pipe()
        number = theirs.fileno()
        self._process = start_python(
            f"from kerfpath.crew import _serve; _serve({number}, {os.getpid()}, {module!r})",
            pass_fds=[number],
        )
        theirs.close()

    def calling(self, function: Callable[[T], R]) -> Callable[[T], R]:
        """Return the function, called in this process; it raises EOFError where that has died."""

        def call(item: T) -> R:
            self._ours.send_bytes(pickle.dumps((current_effort(), function, item)))
            is_value, found = self._ours.recv()
            if not is_value:
                raise found
            return found  # type: ignore[no-any-return]  # what the function returned, pickled

        return call

    def kill(self) -> None:
        """Kill the process; later calls raise."""
        self._process.kill()
        self._process.wait()

    def end(self) -> None:
        self.kill()
        self._ours.close()


def _serve(fd: int, parent: int, module: str) -> None:
    """Answer the calls that a parent sends through a pipe, until it is closed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.environ["NUMBA_NUM_THREADS"] = "1"
    end_with(parent)
    import_module(module)
    line = Connection(fd)
    with suppress(EOFError, BrokenPipeError, ConnectionResetError):
        while True:
            line.send_bytes(_answer(line.recv_bytes()))


def _answer(request: bytes) -> bytes:
    found: tuple[bool, Any]
    try:
        effort, function, item = pickle.loads(request)
        set_effort(effort)
        found = True, function(item)
    except (Exception, SystemExit) as error:  # sent back to the caller, not hidden
        found = False, error
    return pickle.dumps(found)
