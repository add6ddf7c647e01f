"""Tasks on the workers of a Dask cluster."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Generator, Iterator
from importlib.metadata import version
from typing import Any

from kerfpath import __version__
from kerfpath.errors import InputError
from kerfpath.sweep._task import Failure, Outcome, Task, attempt

__all__ = ["on_cluster"]

AHEAD = 4096
"""Tasks at the scheduler at a time: more than a cluster has workers, few for its memory."""

GROUP = "task-"
"""What the keys of tasks begin with: Dask takes them for one group, which it keeps in a queue.

Without it each task would be a group of its own, which the scheduler never forgets."""

PATIENCE = 10.0
"""How long a scheduler, and then its first worker, is waited for, s."""


def on_cluster(
    function: Callable[..., Any], waiting: deque[Task], address: str
) -> Generator[list[Outcome], None, None]:
    """Take what is waiting and yield the outcomes as they come, none where there is nothing to do.

    It goes on for as long as it is asked; closing it takes the rest back from the scheduler. Dask
    gives the tasks of a worker that is lost to the others; a task that has lost several is its
    failure (Dask's `allowed-failures`).

    Raises
    ------
    InputError
        Where Dask is not installed, the scheduler is not there or goes away, or a worker has
        another version of kerfpath.
    """
    try:
        import distributed
    except ImportError as error:
        raise InputError(
            "a scheduler needs Dask, which is not installed: pip install 'kerfpath[cluster]'"
        ) from error
    try:
        client = distributed.Client(address, timeout=PATIENCE, set_as_default=False)
    except (OSError, ValueError) as error:
        raise InputError(
            f"scheduler {address}: no answer within {PATIENCE:g} s; is `dask scheduler` running "
            f"there, and the address right?"
        ) from error
    try:
        with client:
            _check(client, address)
            yield from _gathered(distributed, client, function, waiting)
    except (distributed.CancelledError, OSError, RuntimeError) as error:
        # Closing a client that has lost its scheduler may end in a RuntimeError of Dask's own.
        raise InputError(
            f"scheduler {address}: lost on the way; the results so far are kept: run the same "
            f"sweep again"
        ) from error


def _check(client: Any, address: str) -> None:
    """Refuse a cluster without workers, or with one of another version, by its address."""
    try:
        client.wait_for_workers(1, timeout=PATIENCE)
    except TimeoutError as error:
        raise InputError(
            f"scheduler {address}: no worker within {PATIENCE:g} s; start some: dask worker "
            f"{address} --nthreads 1"
        ) from error
    found = client.run(version, "kerfpath", on_error="return")
    others = [f"{worker} has {v}" for worker, v in sorted(found.items()) if v != __version__]
    if others:
        raise InputError(
            f"scheduler {address}: every worker needs kerfpath {__version__}, but "
            f"{', '.join(others)}: install it there"
        )


def _gathered(
    distributed: Any, client: Any, function: Callable[..., Any], waiting: deque[Task]
) -> Iterator[list[Outcome]]:
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
                *(_failed(distributed, f) for f in batch if f not in whole),
            ]
            hand_out()
        yield []


def _failed(distributed: Any, future: Any) -> Outcome:
    """Return the outcome of a task that kills its workers; raise whatever else it is."""
    error = future.exception()
    if isinstance(error, distributed.KilledWorker):
        failure = Failure(kind="WorkerDied", message="the task took several workers with it")
        key = future.key.removeprefix(GROUP)
        return Outcome(key=key, value=None, failure=failure, seconds=0.0)
    if isinstance(error, InputError | distributed.CancelledError):
        raise error
    raise InputError(f"a worker cannot do the task: {type(error).__name__}: {error}")
