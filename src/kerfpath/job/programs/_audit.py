"""The audit of a program on disk: what its text means, against the job that it is to do."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kerfpath._arrays import Array
from kerfpath._told import told
from kerfpath.air import least_time
from kerfpath.auditor import Check, air_checks, worst_of
from kerfpath.cell import Cell
from kerfpath.contour import Contour
from kerfpath.errors import InputError
from kerfpath.job.format import ContourTask, Job, read_job
from kerfpath.job.plan_file import Asked, Audited, asked_of, collision_note
from kerfpath.job.programs._asked import AskedNodes, asked_program
from kerfpath.job.programs._beam import Process, beam_checks
from kerfpath.job.programs._cut import asked_times, cut_checks, row
from kerfpath.job.programs._read import ReadCut, at_interval, cuts_of, language_of, program_on_disk
from kerfpath.plans import Plan
from kerfpath.post import Language, ReadProgram, Settings, differences, with_tips

__all__ = ["ProgramAsked", "audit_program"]

NEAR = 5e-3
"""A cut that leaves every contour of the job by more (m), all along, is none of them."""
SAME_FRAME = 1e-6
"""How far (m, sine) tool and part may be from those of the job."""
FOLLOWED = ("postures",)
"""Differences that follow from the path that was read, and are judged with it."""
WHAT = {
    "added": "moves",
    "removed": "moves",
    "targets": "targets beside the cut",
    "joints": "joint targets",
    "times": "times of moves",
    "zones": "corners and stops",
    "switches": "laser and gas",
    "kinds": "kinds of moves",
}
"""What differs, by the code of the difference."""


def audit_program(path: Path, job_file: Path) -> Audited:
    """Return what the audit says of every cut of a program.

    Its targets are led through the robot's kinematics to joints, and these are audited as those of
    a plan are: against the drawing, the limits and the cell of the job. Frames, speeds, switches
    and waits are compared with what the job asks for.

    Parameters
    ----------
    path : Path
        The file that is started.
    job_file : Path
        The job that the program was made for.

    Raises
    ------
    InputError
        A file cannot be read, a line is not of our making, or the job is of a kind that programs
        cannot be compared with.
    """
    asked = ProgramAsked.of(job_file)
    chosen, settings = language_of(path, asked.job)
    read = program_on_disk(path, chosen, settings, asked.job.robot)
    return asked.audit(read, chosen, settings, path.name)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ProgramAsked:
    """A job and its drawing, read once, to audit programs by.

    Parameters
    ----------
    job : Job
    tasks : tuple of ContourTask
    candidates : tuple of tuples of Contour
        The paths that each of them may be cut along.
    cell : Cell or None
    inner_first : tuple of (int, int)
        Contours of which the first is to be cut before the second.
    """

    job: Job
    tasks: tuple[ContourTask, ...]
    candidates: tuple[tuple[Contour, ...], ...]
    cell: Cell | None
    inner_first: tuple[tuple[int, int], ...] = ()

    __repr__ = told

    @classmethod
    def of(cls, job_file: Path) -> ProgramAsked:
        """Return what a job asks of its program.

        Raises
        ------
        InputError
            A file cannot be read, or the job is of a kind that programs cannot be compared with.
        """
        return cls.by(asked_of(read_job(job_file)))

    @classmethod
    def by(cls, asked: Asked) -> ProgramAsked:
        """Return the same of a job whose drawing and cell are read already."""
        job = asked.job
        if job.options.interruptions != "none":
            raise InputError(
                f"{job.path}: programs of jobs with interruptions cannot be compared with the "
                "drawing yet; audit the plan.json"
            )
        return cls(
            job=job,
            tasks=asked.tasks,
            candidates=tuple(tuple(way.path for way in ways) for ways in asked.candidates),
            cell=asked.cell,
            inner_first=asked.inner_first,
        )

    def audit(self, read: ReadProgram, chosen: Language, settings: Settings, name: str) -> Audited:
        """Return what the audit says of every cut of a program that was read."""
        job, tasks, candidates, cell = self.job, self.tasks, self.candidates, self.cell
        read = with_tips(read, job.robot, job.tool, job.placement)
        cuts, home = cuts_of(read, job.robot, job.tool, job.placement)
        tables: dict[str, list[Check]] = {}
        places: dict[str, tuple[str, ...]] = {name: tuple(step.place for step in read.steps)}
        tool = job.tool if read.T_flange_tip is None else read.T_flange_tip
        placed = job.placement if read.T_base_part is None else read.T_base_part
        off = max(np.abs(tool - job.tool).max(), np.abs(placed - job.placement).max())
        process = Process.of(job.program, ahead=chosen.ahead)
        tables[name] = [
            row("frames", "tool and part, off the job's", off, SAME_FRAME, "m"),
            *beam_checks(read, job.robot, process),
        ]
        done: list[int] = []
        starts: list[str] = []
        followed: list[tuple[ReadCut, AskedNodes, Plan]] = []
        for cut in cuts:
            apart, which, candidate = _closest(cut, candidates)
            title = _unused(
                f"{cut.name} ({tasks[which].name})" if apart < NEAR else cut.name, tables
            )
            places[title] = tuple(move.place for move in cut.moves)
            if apart >= NEAR:
                said = "distance from the nearest contour of the job"
                tables[title] = [row("contour", said, apart, NEAR, "m")]
                continue
            reference = candidates[which][candidate]
            dt = asked_times(tasks[which], reference)[1]
            cut = at_interval(cut, dt, job.robot, job.tool, job.placement)
            places[title] = tuple(move.place for move in (*cut.moves, cut.group.path[-1]))
            tables[title], along = cut_checks(
                job, tasks[which], cut, reference, cell, chosen, settings
            )
            times = done.count(which)
            tables[title].append(row("once", "earlier cuts of this contour", times, 0, "count"))
            done.append(which)
            starts.append(cut.moves[0].place)
            followed += [] if along is None else [(cut, *along)]
        tables[name] += self._order(done, [places[name].index(start) for start in starts])
        tables[name] += _asked_for(job, followed, home, read, chosen, settings)
        tables[_unused("air", tables)] = _air(
            job, cuts, home, cell if job.sequence is not None else None
        )
        missing = tuple(task.name for i, task in enumerate(tasks) if i not in done)
        note = collision_note(cell, moves_too=job.sequence is not None)
        return Audited(tables=tables, missing=missing, note=note, places=places)

    def _order(self, done: Sequence[int], starts: Sequence[int]) -> list[Check]:
        """Compare the order of contours with that of the job, or with the rules of [sequence].

        Parameters
        ----------
        done : sequence of int
            Which contour each cut is of.
        starts : sequence of int
            The step of the program that each begins with.
        """
        sequence = self.job.sequence
        given = sequence is None or sequence.order == "given"
        wrong = [
            k
            for k, i in enumerate(done)
            if (given and any(j > i for j in done[:k]))
            or any(inner == i and outer in done[:k] for inner, outer in self.inner_first)
        ]
        said = "contours cut after one that comes later in the job, or that they lie in"
        node = starts[wrong[0]] if wrong else 0
        return [row("order", said, len(wrong), 0, "count", node)]


def _unused(title: str, tables: Mapping[str, object]) -> str:
    """Return a title that no table has yet: a cut that comes again must not hide the first."""
    return title if title not in tables else _unused(f"{title}, again", tables)


def _asked_for(
    job: Job, followed: Sequence[tuple[ReadCut, AskedNodes, Plan]], home: Array,
    read: ReadProgram, chosen: Language, settings: Settings,
) -> list[Check]:  # fmt: skip
    """Compare a program with the one that the job would have along the same paths.

    Whatever differs is a finding: how many moves, and where the largest stands.
    """
    if not followed:
        return []
    try:
        asked = asked_program(job, followed, home, chosen, settings)
    except InputError as error:
        said = f"a program as the job asks for cannot be made along these paths ({error})"
        return [row("asked", said, 1, 0, "count")]
    rules = chosen.rules(settings)
    asked = with_tips(asked, job.robot, job.tool, job.placement)
    found = differences(asked, read, rules=(rules,), names=("the job", "the text"), strict=True)
    places = [step.place for step in read.steps]
    rows = [
        row(
            f"asked-{each.code}",
            f"not as the job asks for, {WHAT.get(each.code, each.code)}: {each.message}"
            + (f" (said in {each.said_at})" if each.said_at else ""),
            each.count,
            0,
            "count",
            places.index(each.place) if each.place in places else 0,
        )
        for each in found
        if each.code not in FOLLOWED
    ]
    return rows or [row("asked", "what is not as the job asks for", 0, 0, "count")]


def _closest(cut: ReadCut, candidates: Sequence[Sequence[Contour]]) -> tuple[float, int, int]:
    """Return how far (m) the cut leaves the contour that it follows best, its task and candidate.

    Compared at the same shares of the way.
    """
    points = cut.T_part_tip[:, :3, 3]
    way = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))
    some = np.unique(np.linspace(0, len(points) - 1, 100).round().astype(int))
    found = []
    for i, tried in enumerate(candidates):
        for c, contour in enumerate(tried):
            s = contour.s[0] + way[some] / way[-1] * contour.length
            apart = np.linalg.norm(contour.at(s)[0] - points[some], axis=1)
            found.append((float(np.median(apart)), i, c))
    return min(found)


def _air(job: Job, cuts: Sequence[ReadCut], home: Array, cell: Cell | None) -> list[Check]:
    """Check the joint moves to, between and after the cuts; the node is the number of the way."""
    starts: list[Array | None] = [None, *(cut.q_out for cut in cuts)]
    corners = [cut.approach for cut in cuts] + [home]
    ways = (
        way if start is None else np.vstack([start[None], way])
        for start, way in zip(starts, corners, strict=True)
    )
    return worst_of(_way_checks(job, way[~np.isnan(way).any(axis=1)], cell) for way in ways)


def _way_checks(job: Job, q: Array, cell: Cell | None) -> list[Check]:
    """Check straight joint motions between corners (m, n) rad in the least time that they need."""
    if len(q) < 2:
        return []
    took = np.maximum(least_time(np.diff(q, axis=0), *job.robot.speed_limits()), 1e-9)
    time = np.append(0.0, np.cumsum(took))
    checked = air_checks(job.robot, q, time, cell=cell)
    return [check for check in checked if check.code != "air-time"]
