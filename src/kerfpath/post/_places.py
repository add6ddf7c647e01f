"""Find the line of each move and wait in the text of a program, and when it runs."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any, NamedTuple

from kerfpath.post._issue import ProgramIssue
from kerfpath.post._program import Await, JointMove, LinearMove, Program, Request, Wait
from kerfpath.post._read import ReadHandshake, ReadMove, ReadProgram, ReadWait
from kerfpath.post._times import timetable

__all__ = ["Line", "TimedLine", "issue_lines", "timed_lines"]

_NUMBER = re.compile(r"(.*), (move|step) (\d+)")


class Line(NamedTuple):
    """A line of a text: the name of its file, and its number from 1 on."""

    file: str
    number: int


class TimedLine(NamedTuple):
    """A line that moves or waits, with its begin and end (s) on the program's clock."""

    line: Line
    begin: float
    end: float


def timed_lines(program: Program, read: ReadProgram) -> tuple[TimedLine, ...]:
    """Return the line of every move and wait of a program with its times, in their order.

    The clock is that of `timetable`: the first target is at 0.

    Parameters
    ----------
    program : Program
    read : ReadProgram
        The program as read back from its text.

    Raises
    ------
    InputError
        The joint limits are not known.
    """
    lines = [
        line
        for step, line in zip(program.steps, _lines(program, read), strict=True)
        if isinstance(step, JointMove | LinearMove | Wait)
    ]
    found, begin = [], 0.0
    for (_, end), line in zip(timetable(program), lines, strict=True):
        if line is not None:
            found.append(TimedLine(line, begin, end))
        begin = end
    return tuple(found)


def issue_lines(
    issues: Sequence[ProgramIssue], program: Program, read: ReadProgram
) -> tuple[Line | None, ...]:
    """Return the line of each issue of a preflight, or None if it belongs to no line.

    Parameters
    ----------
    issues : sequence of ProgramIssue
        Issues of the program.
    program : Program
    read : ReadProgram
        The program as read back from its text.
    """
    lines = _lines(program, read)
    return tuple(_line_of(issue.place, program, lines) for issue in issues)


def _line_of(place: str, program: Program, lines: Sequence[Line | None]) -> Line | None:
    found = _NUMBER.fullmatch(place)
    name, what, number = found.groups() if found else (place, "step", "0")
    begin = 0
    for section in program.sections:
        steps = range(begin, begin + len(section.steps))
        begin += len(section.steps)
        if section.name == name:
            counted = [
                k
                for k in steps
                if what == "step" or isinstance(program.steps[k], LinearMove | JointMove)
            ]
            return next((lines[k] for k in counted[int(number) :] if lines[k] is not None), None)
    return None


def _lines(program: Program, read: ReadProgram) -> list[Line | None]:
    """Return the line of each step; a text has as many of a kind, in the same order.

    Steps that a language does not write have no line, for example waits.
    """
    found: list[Line | None] = [None] * len(program.steps)
    kinds: tuple[tuple[Any, type], ...] = (
        (JointMove | LinearMove, ReadMove),
        (Wait, ReadWait),
        (Request | Await, ReadHandshake),
    )
    for kind, read_kind in kinds:
        own = [k for k, step in enumerate(program.steps) if isinstance(step, kind)]
        said = [step for step in read.steps if isinstance(step, read_kind)]
        if len(own) == len(said):
            for k, step in zip(own, said, strict=True):
                found[k] = Line(step.file, step.line)
    return found
