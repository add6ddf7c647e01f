"""Run tasks on processes of this machine."""

from __future__ import annotations

import os
import pickle
import signal
from collections import deque
from collections.abc import Callable, Generator, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from multiprocessing import get_context
from multiprocessing.connection import Connection
from threading import Thread
from typing import Any

from kerfpath import __version__
from kerfpath.errors import InputError
from kerfpath.progress import may_stop
from kerfpath.sweep._task import Failure, Task, TaskOutcome, attempt

__all__ = ["on_processes"]

AHEAD = 8
"""Tasks handed out per process: enough to keep it busy, few enough to lose little."""

CHECKED_EVERY = 0.1
"""s: how often a wait for tasks checks whether to stop."""

ONE_THREAD = dict.fromkeys(("NUMBA_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")


def on_processes(
    function: Callable[..., Any], waiting: deque[Task], processes: int
) -> Generator[list[TaskOutcome], None, None]:
    """Do the waiting tasks and yield outcomes as they come; an empty list if nothing is waiting.

    The generator never ends; closing it stops the processes at once. When a process dies, it is not
    known which task killed it: the tasks handed out are tried again one by one, and a task during
    which the process dies again has failed.

    Raises
    ------
    InputError
        The processes do not start, or cannot import the function.
    """
    call = pickle.dumps(function)
    while True:
        if not waiting:
            yield []
            continue
        suspects = deque((yield from _run_pool(call, waiting, processes, processes * AHEAD)))
        while suspects:
            for task in (yield from _run_pool(call, suspects, 1, 1, lasting=False)):
                failure = Failure(kind="WorkerDied", message="the task killed its process")
                yield [TaskOutcome(key=task.key, value=None, failure=failure, seconds=0.0)]


def _run_pool(
    call: bytes, waiting: deque[Task], processes: int, ahead: int, *, lasting: bool = True
) -> Generator[list[TaskOutcome], None, list[Task]]:
    """Do the waiting tasks; when a process dies, return the tasks that were interrupted.

    A lasting pool stays alive when nothing is waiting, and yields empty lists.
    """
    context = get_context("spawn")
    ours, theirs = context.Pipe()
    with _starting():  # a process that looks after semaphores
        pool = ProcessPoolExecutor(
            processes, mp_context=context, initializer=_set_up, initargs=(theirs, call)
        )
    flying: dict[Future[TaskOutcome], Task] = {}
    broken = False
    try:
        while True:
            while waiting and not broken and len(flying) < ahead:
                try:
                    with _starting():
                        future = pool.submit(attempt, __version__, call, waiting[0])
                except BrokenProcessPool:
                    broken = True
                else:
                    flying[future] = waiting.popleft()
            if not flying:
                if broken or not lasting:
                    return []
                yield []
                continue
            while not (done := wait(flying, CHECKED_EVERY, FIRST_COMPLETED).done):
                may_stop()
            if any(isinstance(future.exception(), BrokenProcessPool) for future in done):
                break
            yield [future.result() for future in done]
            for future in done:
                del flying[future]
        wait(flying)
        whole = [future for future in flying if not future.exception()]
        yield [future.result() for future in whole]
        for future in whole:
            del flying[future]
        if not ours.poll():
            raise InputError(
                "the processes of the sweep do not start; a script has to call a sweep under "
                "`if __name__ == '__main__':`"
            )
        return list(flying.values())
    finally:
        if flying:
            ours.close()
        pool.shutdown(cancel_futures=True)
        ours.close()
        theirs.close()


@contextmanager
def _starting() -> Iterator[None]:
    """Let processes start so that Ctrl-C does not reach them, without the current folder.

    Python would put it first in their `sys.path`, before they take over that of this process.
    """
    before = os.environ.get("PYTHONSAFEPATH")
    os.environ["PYTHONSAFEPATH"] = "1"
    try:
        with _interrupt_blocked():
            yield
    finally:
        del os.environ["PYTHONSAFEPATH"]
        if before is not None:
            os.environ["PYTHONSAFEPATH"] = before


@contextmanager
def _interrupt_blocked() -> Iterator[None]:
    """Block Ctrl-C while processes start; they ignore it from then on."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _set_up(link: Connection, call: bytes) -> None:
    """Set up a process: use one thread, ignore Ctrl-C, and end as soon as the sweep ends.

    The function is imported here instead of in the first task.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.environ.update(ONE_THREAD)
    Thread(target=_leave_with, args=(link,), daemon=True).start()
    with suppress(OSError):  # the sweep may have been killed meanwhile
        link.send(None)
    with suppress(ImportError, AttributeError):  # the task reports it
        pickle.loads(call)


def _leave_with(link: Connection) -> None:
    """End this process when the other end of `link` closes, by close() or because it was killed."""
    link.poll(None)
    os._exit(1)
