"""A sweep: what is not in the store yet is done, and kept as it comes."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable, Mapping
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

from kerfpath.errors import InputError
from kerfpath.sweep._cluster import on_cluster
from kerfpath.sweep._local import on_processes
from kerfpath.sweep._store import Store
from kerfpath.sweep._task import Failure, name_of, task_of

__all__ = ["Result", "run"]


@dataclass(frozen=True, kw_only=True, slots=True)
class Result:
    """What became of one task.

    Parameters
    ----------
    parameters : dict
        As JSON gives them back.
    value : JSON data
        What the function returned; None where it failed.
    failure : Failure or None
    seconds : float
        The time that the call took, s.
    """

    parameters: dict[str, Any]
    value: Any
    failure: Failure | None
    seconds: float


def run(
    function: Callable[..., Any],
    parameters: Iterable[Mapping[str, Any]],
    *,
    store: str | os.PathLike[str],
    scheduler: str | None = None,
    processes: int | None = None,
    progress: Callable[[int, int, float | None], None] | None = None,
) -> list[Result]:
    """Call a function with each of many parameters, exactly once each, and keep the results.

    What the store holds already is not done again, so that the same call goes on after Ctrl-C,
    `kill -9` or a full disk; only tasks that were under way are lost. A task that fails is kept
    with its reason, is not tried again, and does not stop the others.

    Parameters
    ----------
    function : callable
        From the top level of a module, and pure: the same parameters, the same value, which is
        plain JSON data without inf and NaN. An edit of it goes unnoticed: take another store.
    parameters : iterable of mapping
        The keyword arguments of each task, plain JSON data; those that come twice are done once.
    store : path
        An SQLite file, made if it is not there; one sweep at a time.
    scheduler : str, optional
        Address of a Dask scheduler, as "tcp://10.0.0.1:8786", whose workers do the tasks.
    processes : int, optional
        How many local processes of one thread do them; as many as there are cores if not given.
    progress : callable, optional
        Called with the tasks done, all tasks, and the seconds left (None while nothing is known).

    Returns
    -------
    list of Result
        In the order of `parameters`.

    Raises
    ------
    InputError
        Bad parameters; a store that is in use, from another version, unreadable or full; a
        scheduler that cannot be reached or whose workers have another version of kerfpath.
    """
    if processes is not None and (scheduler is not None or processes < 1):
        raise InputError(
            f"processes = {processes}: expected at least 1, and none where a scheduler is given"
        )
    name = name_of(function)
    asked = [task_of(function, p, f"parameters[{i}]") for i, p in enumerate(parameters)]
    tasks = {task.key: task for task in asked}
    with Store(Path(store)) as kept:
        known = kept.keys()
        missing = [task for task in tasks.values() if task.key not in known]
        before = done = len(tasks) - len(missing)
        begun = perf_counter()
        if progress:
            progress(done, len(tasks), None if missing else 0.0)
        if scheduler is None:
            source = on_processes(function, missing, processes or os.cpu_count() or 1)
        else:
            source = on_cluster(function, missing, scheduler)
        with closing(source) as batches:
            for batch in batches:
                kept.add(name, [(tasks[outcome.key], outcome) for outcome in batch])
                done += len(batch)
                if progress and batch:
                    each = (perf_counter() - begun) / (done - before)
                    progress(done, len(tasks), each * (len(tasks) - done))
        found = {key: kept.outcome(key) for key in tasks}
    return [
        Result(
            parameters=json.loads(task.parameters),
            value=None if (outcome := found[task.key]).value is None else json.loads(outcome.value),
            failure=outcome.failure,
            seconds=outcome.seconds,
        )
        for task in asked
    ]
