"""A sweep: do the tasks whose results are not in the store, and store their results."""

from __future__ import annotations

import json
import os
from collections import deque
from collections.abc import Callable, Generator, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from kerfpath._repr import short_repr
from kerfpath.errors import InputError
from kerfpath.progress import Progress, no_progress
from kerfpath.sweep._cluster import on_cluster
from kerfpath.sweep._local import on_processes
from kerfpath.sweep._store import Store
from kerfpath.sweep._task import Failure, Task, TaskOutcome, name_of, task_of

__all__ = ["Result", "Sweep", "run"]


@dataclass(frozen=True, kw_only=True, slots=True)
class Result:
    """The result of one task.

    Parameters
    ----------
    parameters : dict
        Parameters of the task, as read back from JSON.
    value : JSON data
        Return value of the function; None where it failed.
    failure : Failure or None
        Why the task has no value.
    seconds : float s
        Time that the call took.
    """

    parameters: dict[str, Any]
    value: Any
    failure: Failure | None
    seconds: float

    __repr__ = short_repr


class Sweep:
    """Calls of one function, submitted one by one, whose results are stored as they come.

    A sweep is a context manager for searches whose next task depends on results; `run` takes all
    tasks at once. Results in the store are not computed again. Workers start with the first task
    that is not in the store.

    Parameters
    ----------
    function, store, scheduler, processes
        As in `run`.
    progress : Progress, optional
        Called with "tasks", the number of tasks done, and the number of all; see
        `kerfpath.progress`.
    total : int, optional
        Total number of tasks, for the progress; default: the number submitted so far.

    Raises
    ------
    InputError
        As `run`.
    """

    def __init__(
        self,
        function: Callable[..., Any],
        *,
        store: str | os.PathLike[str],
        scheduler: str | None = None,
        processes: int | None = None,
        progress: Progress = no_progress,
        total: int | None = None,
    ) -> None:
        if processes is not None and (scheduler is not None or processes < 1):
            raise InputError(
                f"processes: expected at least 1, and none with a scheduler, got {processes}"
            )
        self._function, self._name = function, name_of(function)
        self._waiting: deque[Task] = deque()
        self._source: Generator[list[TaskOutcome], None, None]
        if scheduler is None:
            self._source = on_processes(function, self._waiting, processes or os.cpu_count() or 1)
        else:
            self._source = on_cluster(function, self._waiting, scheduler)
        self._tasks: dict[str, Task] = {}
        self._coming: set[str] = set()
        self._total, self._progress, self._begun = total, progress, False
        self._kept = Store(Path(store))
        self._there = self._kept.keys()

    def submit(self, **parameters: Any) -> str:
        """Submit a call with these parameters and return its key for `result`.

        Raises
        ------
        InputError
            The parameters are not plain JSON data, or not those of the function.
        """
        return self._hand_in(task_of(self._function, parameters, "parameters"))

    def _hand_in(self, task: Task) -> str:
        if task.key not in self._tasks:
            self._tasks[task.key] = task
            if task.key not in self._there:
                self._coming.add(task.key)
                self._waiting.append(task)
        return task.key

    def result(self, key: str) -> Result:
        """Wait for the result of a task, given its key, and return it.

        Raises
        ------
        InputError
            As `run`.
        """
        if not self._begun:
            self._begun = True
            self._report()
        while key in self._coming:
            batch = next(self._source)
            self._kept.add(self._name, [(self._tasks[done.key], done) for done in batch])
            self._coming -= {done.key for done in batch}
            if batch:
                self._report()
        outcome = self._kept.outcome(key)
        try:
            value = None if outcome.value is None else json.loads(outcome.value)
        except (ValueError, RecursionError):
            raise self._kept.damaged(key) from None
        return Result(
            parameters=json.loads(self._tasks[key].parameters),
            value=value,
            failure=outcome.failure,
            seconds=outcome.seconds,
        )

    def _report(self) -> None:
        total = len(self._tasks) if self._total is None else self._total
        self._progress("tasks", len(self._tasks) - len(self._coming), total)

    def __enter__(self) -> Sweep:
        return self

    def __exit__(self, *_: object) -> None:
        try:
            self._source.close()
        finally:
            self._kept.close()


def run(
    function: Callable[..., Any],
    parameters: Iterable[Mapping[str, Any]],
    *,
    store: str | os.PathLike[str],
    scheduler: str | None = None,
    processes: int | None = None,
    progress: Progress = no_progress,
) -> list[Result]:
    """Call a function with each of many parameters, exactly once each, and store the results.

    Results in the store are not computed again, so the same call continues after Ctrl-C, `kill -9`
    or a full disk; only tasks in progress are lost. A task that fails is stored with its reason, is
    not tried again, and does not stop the others.

    Parameters
    ----------
    function : callable
        A pure function at the top level of a module: the same parameters give the same value, which
        is plain JSON data without inf and NaN. A change of its code is not noticed: use another
        store.
    parameters : iterable of mapping
        The keyword arguments of each task, as plain JSON data; duplicates are done once.
    store : path
        An SQLite file, created if it does not exist; it is used by one sweep at a time.
    scheduler : str, optional
        Address of a Dask scheduler whose workers do the tasks, such as "tcp://10.0.0.1:8786".
    processes : int, optional
        Number of local processes, with one thread each; default: the number of cores.
    progress : Progress, optional
        Called with "tasks", the number of tasks done, and the number of all; see
        `kerfpath.progress`.

    Returns
    -------
    list of Result
        In the order of `parameters`.

    Raises
    ------
    InputError
        The parameters are not valid; the store is in use, from another version, unreadable or full;
        the scheduler cannot be reached, or its workers have another version of kerfpath.
    """
    asked = [task_of(function, p, f"parameters[{i}]") for i, p in enumerate(parameters)]
    with Sweep(
        function, store=store, scheduler=scheduler, processes=processes, progress=progress
    ) as sweep:
        keys = [sweep._hand_in(task) for task in asked]
        return [sweep.result(key) for key in keys]
