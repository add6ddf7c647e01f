"""Two programs on disk, compared."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from kerfpath.job._program_read import language_of, program_on_disk
from kerfpath.job._read import Job, read_job
from kerfpath.post import Difference, ReadMove, ReadProgram, ReadStep, differences, not_compared

__all__ = ["Compared", "compare_programs"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Compared:
    """What differs between two programs, and what could not be compared.

    Parameters
    ----------
    differences : tuple of Difference
        Empty: the same.
    not_compared : tuple of str
        What only one of them says.
    """

    differences: tuple[Difference, ...]
    not_compared: tuple[str, ...]


def compare_programs(a: Path, b: Path, job_file: Path) -> Compared:
    """Return what differs between two programs of a job, in the same language or in two.

    Parameters
    ----------
    a, b : Path
        The files that are started.
    job_file : Path
        The job that they were made for: its robot, frames and settings of languages.

    Raises
    ------
    InputError
        A file cannot be read, or a line is not of our making.
    """
    job = read_job(job_file)
    (one, settings), (two, other) = language_of(a, job), language_of(b, job)
    reads = [
        program_on_disk(path, chosen, of, job.robot)
        for path, chosen, of in ((a, one, settings), (b, two, other))
    ]
    alike = one.name == two.name
    rules = () if alike else (one.rules(settings), two.rules(other))
    first, second = (_comparable(read, job, postures=alike) for read in reads)
    left = not_compared(first, second)
    if not alike and any(move.posture for read in reads for move in read.moves):
        left.append("postures")
    return Compared(
        differences=tuple(differences(first, second, rules=rules)), not_compared=tuple(left)
    )


def _comparable(read: ReadProgram, job: Job, *, postures: bool) -> ReadProgram:
    """Return a program with the tip of every target along its paths, its words of posture or not.

    Those of another language mean something else.
    """
    tool = job.tool if read.T_flange_tip is None else read.T_flange_tip
    part = job.placement if read.T_base_part is None else read.T_base_part

    def changed(step: ReadStep) -> ReadStep:
        if not isinstance(step, ReadMove):
            return step
        T = step.T_part_tip
        if T is None and step.q is not None and step.kind != "joint":
            T = np.asarray(np.linalg.solve(part, job.robot.forward(step.q) @ tool), dtype=float)
        return replace(step, T_part_tip=T, posture=step.posture if postures else ())

    sections = (
        replace(section, steps=tuple(changed(step) for step in section.steps))
        for section in read.sections
    )
    return replace(read, sections=tuple(sections))
