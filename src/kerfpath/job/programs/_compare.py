"""Compare two programs on disk."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from kerfpath._repr import short_repr
from kerfpath.job.format import read_job
from kerfpath.job.programs._read import add_tips, language_of, program_on_disk
from kerfpath.post import (
    Difference,
    ReadMove,
    ReadProgram,
    Rules,
    differences,
    not_compared,
)

__all__ = ["ProgramComparison", "compare_programs"]


@dataclass(frozen=True, slots=True, kw_only=True)
class ProgramComparison:
    """What differs between two programs, and what could not be compared.

    Parameters
    ----------
    differences : tuple of Difference
        Empty if the programs are the same.
    not_compared : tuple of str
        What only one of them states.
    """

    differences: tuple[Difference, ...]
    not_compared: tuple[str, ...]

    __repr__ = short_repr


def compare_programs(a: Path, b: Path, job_file: Path) -> ProgramComparison:
    """Return what differs between two programs of a job, in the same language or in two.

    Parameters
    ----------
    a, b : Path
        The main files of the programs.
    job_file : Path
        The job that they were made for, with robot, frames and settings of languages.

    Raises
    ------
    InputError
        A file cannot be read, or a line was not written by kerfpath.
    """
    job = read_job(job_file)
    (one, settings), (two, other) = language_of(a, job), language_of(b, job)
    reads = [
        add_tips(program_on_disk(path, chosen, of, job.robot), job)
        for path, chosen, of in ((a, one, settings), (b, two, other))
    ]
    rules: tuple[Rules, ...] = ()
    said = any(move.posture for read in reads for move in read.moves)
    if one.name != two.name:  # words for postures have another meaning in another language
        rules = (one.rules(settings), two.rules(other))
        reads = [_without_postures(read) for read in reads]
    found, left = differences(*reads, rules=rules), not_compared(*reads)
    left += ["postures"] if said and rules else []
    return ProgramComparison(differences=tuple(found), not_compared=tuple(left))


def _without_postures(read: ReadProgram) -> ReadProgram:
    sections = [
        replace(
            section,
            steps=tuple(
                replace(step, posture=()) if isinstance(step, ReadMove) else step
                for step in section.steps
            ),
        )
        for section in read.sections
    ]
    return replace(read, sections=tuple(sections))
