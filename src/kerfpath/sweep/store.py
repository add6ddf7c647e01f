"""A sweep: do the tasks whose results are not in the store, and store their results."""

from __future__ import annotations

import json
import os
import sqlite3
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from kerfpath import __version__
from kerfpath.arrays import short_repr
from kerfpath.errors import InputError
from kerfpath.files import require_replaceable
from kerfpath.progress import Progress, no_progress
from kerfpath.sweep.task import SCHEMA, Failure, Task, TaskOutcome, name_of, task_of
from kerfpath.sweep.workers import on_cluster, on_processes

# -----------------------------------------------------------------------------
# The store of results: one SQLite file, used by one sweep at a time.

APPLICATION = 0x6B657266
"""Application id of the SQLite file: "kerf"."""

BESIDE = ("-wal", "-journal", "-shm")
"""Ends of the names of files that SQLite writes beside the store."""

TABLES = f"""
BEGIN EXCLUSIVE;
PRAGMA application_id = {APPLICATION};
PRAGMA user_version = {SCHEMA};
CREATE TABLE package (version TEXT NOT NULL);
CREATE TABLE result (
    key TEXT PRIMARY KEY, function TEXT NOT NULL, parameters TEXT NOT NULL,
    value TEXT, kind TEXT, message TEXT, seconds REAL NOT NULL,
    CHECK ((value IS NULL) = (kind IS NOT NULL) AND (kind IS NULL) = (message IS NULL))
);
INSERT INTO package VALUES ('{__version__}');
COMMIT;
"""

REASONS = {
    sqlite3.SQLITE_BUSY: "another sweep uses this store: wait until it ends, or name another store",
    sqlite3.SQLITE_FULL: "the disk is full; the results so far are stored: free some space and run "
    "the same sweep again",
    sqlite3.SQLITE_IOERR: "cannot be read or written: check whether the disk is full or faulty",
    sqlite3.SQLITE_NOTADB: "this file is not the store of a sweep: name another file",
    sqlite3.SQLITE_CANTOPEN: "cannot be opened: check that its folder exists and is writable",
    sqlite3.SQLITE_READONLY: "is read-only: make it writable, or name another store",
}


class Store:
    """The results of sweeps, in the order in which they came; a context manager.

    An open store holds SQLite's own lock, which the system releases when the process dies. The
    write-ahead log keeps every added result even after `kill -9`; a power cut may lose the last
    results, but never damages the file.

    Raises
    ------
    InputError
        The file is used by another sweep, is from another version of kerfpath or of the store, is
        not a regular file, or cannot be read or written. Every method may raise it.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        try:
            for suffix in ("", *BESIDE):
                require_replaceable(path.with_name(path.name + suffix))
        except OSError as error:
            said = f"{error.filename}: cannot be the store of a sweep"
            raise InputError(f"{said} ({error.strerror}): name another file") from None
        with self._explain():
            self._base = sqlite3.connect(path, timeout=0)
            try:
                self._open()
            except BaseException:
                self._base.close()
                raise

    def _open(self) -> None:
        self._base.execute("PRAGMA locking_mode = EXCLUSIVE")
        if not self._number("PRAGMA application_id") and not self._number(
            "SELECT count(*) FROM sqlite_master"
        ):
            self._base.execute("PRAGMA journal_mode = WAL")
            self._base.executescript(TABLES)
        if self._number("PRAGMA application_id") != APPLICATION:
            raise InputError(f"{self._path}: {REASONS[sqlite3.SQLITE_NOTADB]}")
        again = "name another store to run the sweep again"
        if (schema := self._number("PRAGMA user_version")) != SCHEMA:
            raise InputError(
                f"{self._path}: expected a store of schema {SCHEMA}, got schema {schema}; {again}"
            )
        (version,) = self._base.execute("SELECT version FROM package").fetchone() or ("unknown",)
        if version != __version__:
            raise InputError(
                f"{self._path}: expected a store of kerfpath {__version__}, got one of {version}; "
                f"{again}"
            )
        self._base.execute("PRAGMA synchronous = NORMAL")
        self._base.executescript("BEGIN EXCLUSIVE; COMMIT")

    def _number(self, query: str) -> int:
        return int(self._base.execute(query).fetchone()[0])

    @contextmanager
    def _explain(self) -> Iterator[None]:
        try:
            yield
        except UnicodeDecodeError as error:
            raise InputError(f"{self._path}: {REASONS[sqlite3.SQLITE_NOTADB]}") from error
        except sqlite3.DatabaseError as error:
            reason = REASONS.get(getattr(error, "sqlite_errorcode", 0) & 0xFF, str(error))
            raise InputError(f"{self._path}: {reason}") from error

    def keys(self) -> set[str]:
        """Return the keys of all results."""
        with self._explain():
            return {key for (key,) in self._base.execute("SELECT key FROM result")}

    def add(self, function: str, done: Iterable[tuple[Task, TaskOutcome]]) -> None:
        """Store outcomes, all or none of them; a key that exists already is an error."""
        rows = [
            (
                task.key,
                function,
                task.parameters,
                outcome.value,
                outcome.failure and outcome.failure.kind,
                outcome.failure and outcome.failure.message,
                outcome.seconds,
            )
            for task, outcome in done
        ]
        with self._explain(), self._base:
            self._base.executemany("INSERT INTO result VALUES (?, ?, ?, ?, ?, ?, ?)", rows)

    def outcome(self, key: str) -> TaskOutcome:
        """Return the outcome stored under a key."""
        query = "SELECT value, kind, message, seconds FROM result WHERE key = ?"
        with self._explain():
            row = self._base.execute(query, (key,)).fetchone()
        match row:
            case (str() as value, None, None, float() as seconds):
                return TaskOutcome(key=key, value=value, failure=None, seconds=seconds)
            case (None, str() as kind, str() as message, float() as seconds):
                failure = Failure(kind=kind, message=message)
                return TaskOutcome(key=key, value=None, failure=failure, seconds=seconds)
        raise self.damaged(key)

    def damaged(self, key: str) -> InputError:
        """Return the error for a row that is not a valid result."""
        return InputError(
            f"{self._path}: the store is damaged: result {str(key)[:16]!r} is not valid; name "
            "another store to run the sweep again"
        )

    def __enter__(self) -> Store:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the file."""
        self._base.close()


# -----------------------------------------------------------------------------
# The sweep.


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
        total = max(len(self._tasks), self._total or 0)
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
