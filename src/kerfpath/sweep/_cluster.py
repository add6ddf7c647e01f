"""Run tasks on the workers of a Dask cluster."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Generator, Iterator
from importlib.metadata import version
from typing import Any

from kerfpath import __version__
from kerfpath._extras import require_extra
from kerfpath.errors import InputError
from kerfpath.sweep._task import Failure, Task, TaskOutcome, attempt

__all__ = ["on_cluster"]

AHEAD = 4096
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
    call = distributed.protocol.pickle.dumps(function)
    coming = distributed.as_completed(loop=client.loop)

    def hand_out() -> None:
        count = min(len(waiting), AHEAD - coming.count())
        tasks = [waiting.popleft() for _ in range(count)]
        coming.update(
            [client.submit(attempt, __version__, call, t, key=f"{GROUP}{t.key}") for t in tasks]
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
