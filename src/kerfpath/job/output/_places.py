"""Lines of a run's program: when each line runs, and what the preflight finds at it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from kerfpath._repr import short_repr
from kerfpath.errors import InputError
from kerfpath.job.run import JobResult
from kerfpath.post import (
    Line,
    ProgramIssue,
    TimedLine,
    issue_lines,
    preflight,
    read_program,
    timed_lines,
)
from kerfpath.post import language as find_language

__all__ = ["ProgramPlaces", "program_places"]


@dataclass(frozen=True, slots=True, kw_only=True)
class ProgramPlaces:
    """The lines of a program, with their times and the findings of the preflight.

    Parameters
    ----------
    lines : tuple of TimedLine
        Lines of moves and waits, in the order of the program; none if the language has no reader.
    findings : tuple of (ProgramIssue, Line or None)
        What the preflight finds, and at which line.
    """

    lines: tuple[TimedLine, ...] = ()
    findings: tuple[tuple[ProgramIssue, Line | None], ...] = ()

    __repr__ = short_repr


def program_places(outcome: JobResult, files: Mapping[str, str]) -> ProgramPlaces:
    """Return when the lines of a run's program run, and what its preflight finds.

    Parameters
    ----------
    outcome : JobResult
    files : mapping of str to str
        The program by the names of its files, the one to start first; if empty, findings have no
        lines.
    """
    options = outcome.job.program
    if not outcome.plans or outcome.stuck is not None or options.language == "none":
        return ProgramPlaces()
    try:
        program = options.program(outcome.plans, outcome.moves)
        issues = preflight(program, options.language, options.settings)
    except InputError:  # reported when the program is written
        return ProgramPlaces()
    where: tuple[Line | None, ...] = (None,) * len(issues)
    lines: tuple[TimedLine, ...] = ()
    if files and find_language(options.language).read is not None:
        read = read_program(files, options.language, program.robot, options.settings)
        where = issue_lines(issues, program, read)
        lines = timed_lines(program, read)
    return ProgramPlaces(lines=lines, findings=tuple(zip(issues, where, strict=True)))
