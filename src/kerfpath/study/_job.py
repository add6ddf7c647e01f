"""The job that the tasks of a study are about: found by every worker, and the very same one."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from kerfpath._repr import short_repr
from kerfpath.cad import Part
from kerfpath.errors import InputError
from kerfpath.job import Job, read_job
from kerfpath.sweep import UnfitWorker

__all__ = ["LoadedJob", "digest", "load_job"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LoadedJob:
    """A job, and its part as read."""

    job: Job
    part: Part

    __repr__ = short_repr


def digest(path: Path) -> str:
    """Return the hash of a job file and of every file that it names.

    Raises
    ------
    InputError
        As `read_job`; a file that cannot be read.
    """
    job = read_job(path)
    whole = hashlib.sha256()
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
    """Yield the text in a tree of plain data, in order."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, list | dict):
        for each in value.values() if isinstance(value, dict) else value:
            yield from _texts(each)


@lru_cache(maxsize=2)
def load_job(path: str, digest_then: str) -> LoadedJob:
    """Return a job and its part, kept for the next task of a worker.

    Parameters
    ----------
    path : str
        The job file, which every worker has at the same place.
    digest_then : str
        What `digest` said of it where the study began.

    Raises
    ------
    UnfitWorker
        The files here are not those, or not here.
    """
    try:
        here = digest(Path(path))
    except InputError as error:
        raise UnfitWorker(f"{error}; every worker needs job and files at the same path") from None
    if here != digest_then:
        raise UnfitWorker(
            f"{path}: this job or a file that it names has changed, or is another one on this "
            "worker; start the study again"
        )
    job = read_job(path)
    return LoadedJob(job=job, part=job.read_part())
