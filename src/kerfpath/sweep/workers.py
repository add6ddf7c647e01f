"""Run the tasks of a sweep on processes of this machine, or on the workers of a Dask cluster."""

from __future__ import annotations

import os
import pickle
import signal
from collections import deque
from collections.abc import Callable, Generator, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from importlib.metadata import version
from multiprocessing import get_context
from multiprocessing.connection import Connection
from threading import Thread
from typing import Any

from kerfpath import __version__
from kerfpath.effort import current_effort
from kerfpath.errors import InputError
from kerfpath.extras import require_extra
from kerfpath.isolated import NOT_INHERITED, clean_environment
from kerfpath.progress import may_stop
from kerfpath.sweep.task import Failure, Task, TaskOutcome, attempt

# -----------------------------------------------------------------------------
# Processes of this machine.

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
            processes,
            mp_context=context,
            initializer=_set_up,
            initargs=(theirs, call),
        )
    flying: dict[Future[TaskOutcome], Task] = {}
    broken = False
    try:
        while True:
            while waiting and not broken and len(flying) < ahead:
                try:
                    with _starting():
                        future = pool.submit(
                            attempt, __version__, call, current_effort(), waiting[0]
                        )
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
    """Let processes start so that Ctrl-C does not reach them, in a clean environment.

    Python would put the current folder first in their `sys.path`, before they take over that of
    this process.
    """
    clean = clean_environment()
    before = {name: os.environ.get(name) for name in (*NOT_INHERITED, *clean)}
    changed = {name: value for name, value in before.items() if value != clean.get(name)}
    _set_environment({name: clean.get(name) for name in changed})
    try:
        with _interrupt_blocked():
            yield
    finally:
        _set_environment(changed)


def _set_environment(variables: Mapping[str, str | None]) -> None:
    for name, value in variables.items():
        if value is None:
            os.environ.pop(name, None)
        else:
            os.environ[name] = value


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


# -----------------------------------------------------------------------------
# Workers of a Dask cluster.

AHEAD_CLUSTER = 4096
"""Number of tasks at the scheduler at a time: more than there are workers, but easy on memory."""

GROUP = "task-"
"""Prefix of the keys of tasks: with it Dask treats them as one group and keeps them in a queue.

Without it each task would be a separate group, which the scheduler never forgets."""

PATIENCE = 10.0
"""s: longest wait for a scheduler, and then for its first worker."""


def on_cluster(
    function: Callable[..., Any], waiting: deque[Task], address: str
) -> Generator[list[TaskOutcome], None, None]:
    """Do the waiting tasks and yield outcomes as they come; an empty list if nothing is waiting.

    The generator never ends; closing it cancels the remaining tasks at the scheduler. Dask gives
    the tasks of a lost worker to the others; a task that kills several workers has failed (Dask's
    `allowed-failures`).

    Raises
    ------
    InputError
        Dask is not installed, the scheduler does not answer or is lost, or a worker has another
        version of kerfpath.
    """
    require_extra("cluster", "a scheduler")
    import distributed

    try:
        client = distributed.Client(address, timeout=PATIENCE, set_as_default=False)
    except (OSError, ValueError) as error:
        raise InputError(
            f"scheduler {address}: no answer within {PATIENCE:g} s; check the address, and that "
            "`dask scheduler` is running there"
        ) from error
    try:
        with client:
            _check(client, address)
            yield from _gather(distributed, client, function, waiting)
    except (distributed.CancelledError, OSError, RuntimeError) as error:
        # Closing a client that has lost its scheduler may end in a RuntimeError of Dask's own.
        raise InputError(
            f"scheduler {address}: the connection was lost; the results so far are stored: run the "
            "same sweep again"
        ) from error


def _check(client: Any, address: str) -> None:
    """Require at least one worker, and this version of kerfpath on all workers."""
    try:
        client.wait_for_workers(1, timeout=PATIENCE)
    except TimeoutError as error:
        raise InputError(
            f"scheduler {address}: no worker within {PATIENCE:g} s; start workers with: dask "
            f"worker {address} --nthreads 1"
        ) from error
    found = client.run(version, "kerfpath", on_error="return")
    others = [f"{worker} has {v}" for worker, v in sorted(found.items()) if v != __version__]
    if others:
        raise InputError(
            f"scheduler {address}: every worker needs kerfpath {__version__}, but "
            f"{', '.join(others)}: install it there"
        )


def _gather(
    distributed: Any, client: Any, function: Callable[..., Any], waiting: deque[Task]
) -> Iterator[list[TaskOutcome]]:
    call, effort = distributed.protocol.pickle.dumps(function), current_effort()
    coming = distributed.as_completed(loop=client.loop)

    def hand_out() -> None:
        count = min(len(waiting), AHEAD_CLUSTER - coming.count())
        tasks = [waiting.popleft() for _ in range(count)]
        coming.update(
            [
                client.submit(attempt, __version__, call, effort, t, key=f"{GROUP}{t.key}")
                for t in tasks
            ]
        )

    while True:
        hand_out()
        for batch in coming.batches():
            whole = [future for future in batch if future.status == "finished"]
            yield [
                *client.gather(whole),
                *(_failure_of(distributed, f) for f in batch if f not in whole),
            ]
            hand_out()
        yield []


def _failure_of(distributed: Any, future: Any) -> TaskOutcome:
    """Return the failure of a task that kills its workers; raise any other error."""
    error = future.exception()
    if isinstance(error, distributed.KilledWorker):
        failure = Failure(kind="WorkerDied", message="the task killed several workers")
        key = future.key.removeprefix(GROUP)
        return TaskOutcome(key=key, value=None, failure=failure, seconds=0.0)
    if isinstance(error, InputError | distributed.CancelledError):
        raise error
    raise InputError(f"a worker cannot do the task: {type(error).__name__}: {error}")
