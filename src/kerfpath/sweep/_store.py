"""The store of results: one SQLite file, used by one sweep at a time."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from kerfpath import __version__
from kerfpath.errors import InputError
from kerfpath.sweep._task import SCHEMA, Failure, Task, TaskOutcome

__all__ = ["Store"]

APPLICATION = 0x6B657266
"""Application id of the SQLite file: "kerf"."""

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
        The file is used by another sweep, is from another version of kerfpath or of the store, or
        cannot be read or written. Every method may raise it.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
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
