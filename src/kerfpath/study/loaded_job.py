"""The job of a study: loaded by every worker, and checked to be the same everywhere."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from kerfpath.arrays import short_repr
from kerfpath.cad import Part
from kerfpath.errors import InputError
from kerfpath.job import Job, read_job
from kerfpath.sweep import UnfitWorker


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LoadedJob:
    """A job and its part, read from the drawing."""

    job: Job
    part: Part

    __repr__ = short_repr


def job_key(path: Path) -> dict[str, str]:
    """Return the parameters of `load_job` for a job file: its resolved path and its digest.

    Raises
    ------
    InputError
        As `digest_of`.
    """
    path = path.resolve()
    return {"job": str(path), "digest": digest_of(path)}


def digest_of(path: Path) -> str:
    """Return the SHA-256 hash of a job file and of every file that it names.

    Raises
    ------
    InputError
        As `read_job`; also where a file cannot be read.
    """
    job = read_job(path)
    rows = job.source.get("process")  # of charts, which may be in the user's folder
    whole = hashlib.sha256(b"" if rows is None else repr(rows).encode())
    for file in _files(job):
        try:
            whole.update(hashlib.sha256(file.read_bytes()).digest())
        except OSError as error:
            raise InputError(f"{file}: cannot be read ({error.strerror})") from None
    return whole.hexdigest()


def _files(job: Job) -> Iterator[Path]:
    yield job.path
    for text in _texts(job.source):
        if "\n" not in text and (file := job.path.parent / text).is_file():
            yield file
    meshes = {body.path for body in job.robot.bodies if body.path is not None}
    yield from sorted(meshes)


def _texts(value: object) -> Iterator[str]:
    """Yield all texts in a tree of plain data, in order."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, list | dict):
        for each in value.values() if isinstance(value, dict) else value:
            yield from _texts(each)


@lru_cache(maxsize=2)
def load_job(job: str, digest: str) -> LoadedJob:
    """Return a job and its part, cached for the next task of a worker.

    Parameters
    ----------
    job : str
        The job file, at the same path on every worker.
    digest : str
        The `digest_of` the job where the study was started.

    Raises
    ------
    UnfitWorker
        The files on this worker differ or are missing.
    """
    try:
        here = digest_of(Path(job))
    except InputError as error:
        raise UnfitWorker(
            f"{error}; every worker needs the job and its files at the same path"
        ) from None
    if here != digest:
        raise UnfitWorker(
            f"{job}: this job or a file that it names has changed since the study began, or "
            "differs on this worker; start the study again"
        )
    read = read_job(job)
    return LoadedJob(job=read, part=read.read_part())
