"""Audit a program on disk: compare the motion that its text means with the job."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from kerfpath._arrays import Array
from kerfpath._repr import short_repr
from kerfpath.auditor import Check, transfer_checks, worst_of
from kerfpath.cell import Cell
from kerfpath.errors import InputError
from kerfpath.job.format import Candidate, Job, PreparedJob, prepare, read_job
from kerfpath.job.plan_file import AuditReport, check, check_order, collision_note, count
from kerfpath.job.programs._cut_checks import check_cut
from kerfpath.job.programs._expected import TargetNodes, expect_program
from kerfpath.job.programs._laser_and_gas import BeamProcess, check_laser_and_gas
from kerfpath.job.programs._pins import check_pins
from kerfpath.job.programs._read import (
    ReadCut,
    add_tips,
    divide_arcs,
    language_of,
    program_on_disk,
    read_cuts,
)
from kerfpath.plans import Plan
from kerfpath.post import Language, LanguageSettings, ReadProgram, differences
from kerfpath.transfer import least_time
from kerfpath.windows import GammaWindow

__all__ = ["ProgramAudit", "audit_program"]

NEAR = 5e-3
"""Median distance (m) from a contour of the job beyond which a cut is not of that contour."""
SAME_FRAME = 1e-6
"""Tolerance (m, sine) of tool and part against those of the job."""
FOLLOWED = ("postures",)
"""Codes of differences that follow from the path that was read, and are checked with it."""
WHAT = {
    "added": "moves",
    "removed": "moves",
    "targets": "targets beside the cut",
    "joints": "joint targets",
    "external": "external axes",
    "times": "times of moves",
    "zones": "corners and stops",
    "switches": "laser and gas",
    "kinds": "kinds of moves",
}
"""What differs, by the code of the difference."""


def audit_program(path: Path, job_file: Path) -> AuditReport:
    """Audit every cut of a program against its job.

    The joints of its targets follow from the robot's kinematics and are audited like those of a
    plan: against the drawing, the limits and the cell of the job. Frames, speeds, switches and
    waits are compared with those of the job.

    Parameters
    ----------
    path : Path
        The main file of the program.
    job_file : Path
        The job that the program was made for.

    Raises
    ------
    InputError
        A file cannot be read, a line was not written by kerfpath, or programs of such a job cannot
        be audited.
    """
    audit = ProgramAudit.of(job_file)
    chosen, settings = language_of(path, audit.job)
    read = program_on_disk(path, chosen, settings, audit.job.robot)
    return audit.audited(read, chosen, settings, path.name)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ProgramAudit:
    """The audit of programs of one job, whose drawing and cell are read once.

    Parameters
    ----------
    job : Job
    contours : tuple of tuples of Candidate
        The ways to cut each contour; their nodes have its name.
    windows : tuple of tuples of GammaWindow
        The windows of gamma of each contour.
    cell : Cell or None
    inner_first : tuple of (int, int)
        Pairs of contours (from 0) of which the first is to be cut before the second.
    """

    job: Job
    contours: tuple[tuple[Candidate, ...], ...]
    windows: tuple[tuple[GammaWindow, ...], ...]
    cell: Cell | None
    inner_first: tuple[tuple[int, int], ...] = ()

    __repr__ = short_repr

    @classmethod
    def of(cls, job_file: Path) -> ProgramAudit:
        """Return the audit of a job's programs.

        Raises
        ------
        InputError
            A file cannot be read, or programs of such a job cannot be audited.
        """
        return cls.by(prepare(read_job(job_file)))

    @classmethod
    def by(cls, prepared: PreparedJob) -> ProgramAudit:
        """Return the audit of a prepared job's programs.

        Raises
        ------
        InputError
            The job has interruptions.
        """
        job = prepared.job
        if job.options.interruptions != "none":
            raise InputError(
                f"{job.path}: programs of jobs with interruptions cannot be compared with the "
                "drawing yet; audit the plan.json"
            )
        return cls(
            job=job,
            contours=tuple(contour.candidates for contour in prepared.contours),
            windows=tuple(contour.options.gamma_windows for contour in prepared.contours),
            cell=prepared.cell,
            inner_first=prepared.inner_first,
        )

    def audited(
        self, read: ReadProgram, chosen: Language, settings: LanguageSettings, name: str
    ) -> AuditReport:
        """Audit every cut of a program that was read."""
        job, contours, cell = self.job, self.contours, self.cell
        names = [candidates[0].nodes.name for candidates in contours]
        read = add_tips(read, job)
        cuts, home = read_cuts(read, job)
        tables: dict[str, list[Check]] = {}
        places: dict[str, tuple[str, ...]] = {name: tuple(step.place for step in read.steps)}
        tool = job.tool if read.T_flange_tip is None else read.T_flange_tip
        placed = job.placement if read.T_base_part is None else read.T_base_part
        off = max(np.abs(tool - job.tool).max(), np.abs(placed - job.placement).max())
        process = BeamProcess.of(job.program, ahead=chosen.ahead)
        tables[name] = [
            check("frames", "distance of tool and part from the job's", off, SAME_FRAME, "m"),
            *check_laser_and_gas(read, job.robot, process),
        ]
        done: list[int] = []
        starts: list[str] = []
        followed: list[tuple[ReadCut, TargetNodes, Plan]] = []
        for cut in cuts:
            apart, which, c = _closest(cut, contours)
            title = _new_title(f"{cut.name} ({names[which]})" if apart < NEAR else cut.name, tables)
            places[title] = tuple(move.place for move in cut.moves)
            if apart >= NEAR:
                said = "distance from the nearest contour of the job"
                tables[title] = [check("contour", said, apart, NEAR, "m")]
                continue
            candidate = contours[which][c]
            cut = divide_arcs(cut, candidate.dt, job)
            places[title] = tuple(move.place for move in (*cut.moves, cut.group.path[-1]))
            tables[title], along = check_cut(job, candidate, cut, cell, chosen, settings)
            tables[title].append(count("once", "earlier cuts of this contour", done.count(which)))
            done.append(which)
            starts.append(cut.moves[0].place)
            if along is not None:
                followed.append((cut, *along))
                pins, rules = self.windows[which], chosen.rules(settings)
                tables[title] += check_pins(job, cut, *along, pins, rules)
        steps = [places[name].index(start) for start in starts]
        tables[name] += [
            row if row.ok else replace(row, node=steps[row.node])
            for row in check_order(job.sequence, self.inner_first, done)
        ]
        tables[name] += _compared(job, followed, home, read, chosen, settings)
        tables[_new_title("air", tables)] = _air(
            job, cuts, home, cell if job.sequence is not None else None
        )
        missing = tuple(name for i, name in enumerate(names) if i not in done)
        note = collision_note(cell, moves_too=job.sequence is not None)
        return AuditReport(tables=tables, missing=missing, note=note, places=places)


def _new_title(title: str, tables: Mapping[str, object]) -> str:
    """Return a title that no table has yet, so that a repeated cut does not hide the first."""
    return title if title not in tables else _new_title(f"{title}, again", tables)


def _compared(
    job: Job, followed: Sequence[tuple[ReadCut, TargetNodes, Plan]], home: Array,
    read: ReadProgram, chosen: Language, settings: LanguageSettings,
) -> list[Check]:  # fmt: skip
    """Compare a program with the one that the job would have along the same paths.

    Each kind of difference is a check, with the number of moves and the place of the largest.
    """
    if not followed:
        return []
    try:
        asked = expect_program(job, followed, home, chosen, settings)
    except InputError as error:
        said = f"the program of the job cannot be made along these paths ({error})"
        return [count("asked", said, 1)]
    rules = chosen.rules(settings)
    asked = add_tips(asked, job)
    found = differences(asked, read, rules=(rules,), names=("the job", "the text"), strict=True)
    places = [step.place for step in read.steps]
    rows = [
        count(
            f"asked-{each.code}",
            f"different from the job, {WHAT.get(each.code, each.code)}: {each.message}"
            + (f" (from {each.said_at})" if each.said_at else ""),
            each.count,
            places.index(each.place) if each.place in places else 0,
        )
        for each in found
        if each.code not in FOLLOWED
    ]
    return rows or [count("asked", "differences from the job", 0)]


def _closest(cut: ReadCut, contours: Sequence[Sequence[Candidate]]) -> tuple[float, int, int]:
    """Return the distance (m) of a cut from the contour that it follows best, and the candidate.

    Points at the same share of the length are compared.
    """
    points = cut.T_part_tip[:, :3, 3]
    way = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))
    some = np.unique(np.linspace(0, len(points) - 1, 100).round().astype(int))
    found = []
    for i, candidates in enumerate(contours):
        for c, path in enumerate(candidate.path for candidate in candidates):
            s = path.s[0] + way[some] / way[-1] * path.length
            apart = np.linalg.norm(path.at(s)[0] - points[some], axis=1)
            found.append((float(np.median(apart)), i, c))
    return min(found)


def _air(job: Job, cuts: Sequence[ReadCut], home: Array, cell: Cell | None) -> list[Check]:
    """Check the joint moves to, between and after the cuts; the node is the number of the move."""
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
    return [row for row in transfer_checks(job.robot, q, time, cell=cell) if row.code != "air-time"]
