"""The message about the job: its text, values with defaults, allowed words, and errors."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from functools import cache
from typing import Any, get_args

from pydantic import BaseModel

from kerfpath.errors import InputError
from kerfpath.front import CRITERIA
from kerfpath.job import Job, JobFile
from kerfpath.post import languages
from kerfpath.robots import Robot
from kerfpath.studio._document import Document
from kerfpath.studio._messages import ContourName, Fault, JobMessage
from kerfpath.studio._numbers import flat

__all__ = ["faults_of", "job_message"]

_PLACE = re.compile(r"^.*?\.toml:(?:(\d+):)? ?(?:([a-z_][\w.]*): )?(.*)$", re.DOTALL)
"""File, line, key and text of an error message about a job."""
_TABLE = re.compile(r"^[ \t]*\[\[[ \t]*contour[ \t]*\]\]")


def job_message(
    document: Document,
    job: Job | None,
    contours: list[ContourName],
    faults: list[Fault],
    *,
    interval: float,
) -> JobMessage:
    """Return the message about the current job.

    Parameters
    ----------
    document : Document
    job : Job or None
        The job that the text describes; None if the text is not valid.
    contours : list of ContourName
        The contours that are cut.
    faults : list of Fault
    interval : float s
        Interval of the nodes of the first contour; the default weights depend on it.
    """
    weights = None
    if job is not None:
        weights = 1 / (job.robot.speed_limits()[0] * interval)
    return JobMessage(
        revision=document.revision,
        name=document.path.name,
        text=document.text,
        values=None if job is None else _values(job),
        given=[] if job is None else list(_given(job.source)),
        contours=contours,
        undo=document.can_undo,
        redo=document.can_redo,
        saved=document.saved,
        faults=faults,
        choices=_choices() | ({} if job is None else {"plan.posture": _postures(job.robot)}),
        weights=[] if weights is None else flat(weights),
    )


def faults_of(error: InputError, text: str) -> list[Fault]:
    """Return the errors of a job, each with the key that its message names, if any."""
    lines = text.split("\n")
    return [_fault(said, lines) for said in (str(error), *error.others)]


def _fault(said: str, lines: list[str]) -> Fault:
    found = _PLACE.match(said)
    if found is None:
        return Fault(key=[], message=said)
    line, key, words = found.groups()
    way: list[str | int] = [] if key is None else list(key.split("."))
    if line is not None and way[:1] == ["contour"]:
        number = sum(map(bool, map(_TABLE.match, lines[: int(line)]))) - 1
        way[1:1] = [max(number, 0)]
    return Fault(key=way, message=words)


def _values(job: Job) -> dict[str, object]:
    file = JobFile.model_validate(dict(job.source), context={"folder": job.path.parent})
    return file.model_dump(mode="json")


def _given(value: object, way: str = "") -> Iterator[str]:
    """Yield the dotted keys of a job, each table before its entries."""
    if way:
        yield way
    entries = list[tuple[object, object]]()
    if isinstance(value, Mapping):
        entries = list(value.items())
    elif isinstance(value, list) and all(isinstance(one, Mapping) for one in value):
        entries = list(enumerate(value))
    for name, inner in entries:
        yield from _given(inner, f"{way}.{name}" if way else str(name))


@cache
def _choices() -> dict[str, list[str]]:
    """Return the allowed words of each key that takes one of a fixed list."""
    found: dict[str, list[str]] = {}
    _gather(JobFile, (), found)
    found["pareto.criteria"] = list(CRITERIA)
    found["program.language"] = [*sorted(languages()), "none"]
    return found


def _gather(table: type[BaseModel], way: tuple[str, ...], found: dict[str, list[str]]) -> None:
    for name, field in table.model_fields.items():
        words, tables = _words(field.annotation)
        if words:
            found[".".join((*way, name))] = words
        for inner in tables:
            _gather(inner, (*way, name), found)


def _words(annotation: Any) -> tuple[list[str], list[type[BaseModel]]]:
    """Return the words that a type allows, and the tables in it."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [], [annotation]
    words, tables = list[str](), list[type[BaseModel]]()
    for part in get_args(annotation):
        if isinstance(part, str):
            words.append(part)
        else:
            more, inner = _words(part)
            words += more
            tables += inner
    return words, tables


def _postures(robot: Robot) -> list[str]:
    """Return the names by which postures may be requested, the least specific first."""
    names = [name.split("/") for name in robot.family.postures]
    return list(dict.fromkeys("/".join(name[:n]) for n in (1, 2, 3) for name in names))
