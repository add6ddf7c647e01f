"""Plan contours again around targets that a person has moved in a program; the others are kept."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from kerfpath.arrays import Array, Ints, short_repr
from kerfpath.cad import Part
from kerfpath.contour import Contour, angle_between
from kerfpath.errors import InputError
from kerfpath.job.comparison import compare
from kerfpath.job.expected import Expected, expect_plans
from kerfpath.job.format import Candidate, CutRequest, Job, PreparedJob, prepare, read_job
from kerfpath.job.plan_file import PlanFile, plan_entry, read_plan_file
from kerfpath.job.program_file import add_tips, in_language_of, program_on_disk
from kerfpath.job.programs import expected_of_plans, program_of
from kerfpath.job.run.contour import cut_as_before
from kerfpath.job.run.job import run_again
from kerfpath.job.run.results import CutResult, JobResult
from kerfpath.operations import touched_up
from kerfpath.plans import Plan
from kerfpath.post import ReadGroup, ReadMove, differences, groups_of, read_program
from kerfpath.progress import Progress, no_progress
from kerfpath.tolerances import SAME_PLACE

MOVED = 1e-6
"""Least distance (m) of a moved target from the planned one."""
TURNED = np.radians(1e-3)
"""Least angle (rad) of a moved target's tool axis to the planned one."""
MOST_MOVED = 0.1
"""Largest share of moved targets; if more were moved, the part itself is elsewhere."""
SAME_PATH = 1e-5
"""Distance (m) of a plan's nodes from the drawn path beyond which it was touched up before."""
ALONG = ("added", "removed", "order", "kinds")
"""Codes of differences other than moved targets."""
MEASURE = "for a part that is elsewhere: kerfpath post PLAN.json --measured POINTS.csv"


@dataclass(frozen=True, slots=True, kw_only=True)
class MovedTarget:
    """A target that a person has moved.

    Parameters
    ----------
    contour : str
    node : int
    place : str
        File and line.
    off : float m
        Distance from the planned target.
    turned : float rad
        Angle of its tool axis to the planned one.
    """

    contour: str
    node: int
    place: str
    off: float
    turned: float

    __repr__ = short_repr


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TouchUp:
    """A job planned again around moved targets.

    Parameters
    ----------
    part : Part
    outcome : JobResult
        Its cuts say which of them are `kept`.
    targets : tuple of MovedTarget
    notes : tuple of str
        Other changes in the program, which are not kept.
    renewed : tuple of str
        Why contours without moved targets were planned again, a line for each.
    """

    part: Part
    outcome: JobResult
    targets: tuple[MovedTarget, ...]
    notes: tuple[str, ...]
    renewed: tuple[str, ...]

    __repr__ = short_repr


def touch_up(
    program: Path,
    plan_file: Path,
    job_file: Path,
    *,
    ease: float = 0.01,
    progress: Progress = no_progress,
) -> TouchUp:
    """Plan contours again around the targets that were moved in a job's program.

    Moved nodes keep tip and axis as taught, and the path eases back to the planned one; the
    rotation about the beam is planned again. Starts, directions, order and postures stay. All
    other contours keep their motion, joint by joint, and so do the moves between them. Where the
    job does not allow it any more, they are planned again, too, and the result says why.

    Parameters
    ----------
    program : Path
        The main file of the edited program.
    plan_file : Path
        The plan.json that it was written from.
    job_file : Path
        The job of that plan.
    ease : float m
        Distance along the path over which a shift fades out.

    Raises
    ------
    InputError
        A file cannot be read, does not belong to the others, or is of a kind that cannot be
        touched up; or no target was moved, or the start of a contour, a frame, or more than a
        tenth of the targets.
    """
    job, file = read_job(job_file), read_plan_file(plan_file)
    _require_kind(job, file)
    part = job.read_part()
    prepared = prepare(job, part)
    job = prepared.job
    groups, notes = _read_edits(program, job, file)
    for p, group in zip(file.plans, groups, strict=True):
        if len(group.path) != len(p.contour) + 1:
            raise InputError(
                f"{program}: contour {p.name!r} has {len(group.path) - 1} targets for "
                f"{len(p.contour)} nodes, so that it cannot be touched up; write thin_mm = 0 in "
                "[program] and make the program again"
            )
    targets = [
        _taught(p, group.path[: len(p.contour)])
        for p, group in zip(file.plans, groups, strict=True)
    ]
    _require_few(program, targets, file.plans)
    requests = dict(zip(prepared.names, prepared.contours, strict=True))
    if set(requests) != set(file.contours.values()):
        raise InputError(
            f"{job.path}: the job has other contours than {file.path}; give the job of that plan"
        )
    prepared = prepared.with_contours(
        [replace(requests[p.name], candidates=(_planned(requests[p.name], p),)) for p in file.plans]
    )
    touched = {each[0].contour for each in targets if each}
    kept, renewed = _keep(prepared, file, touched, progress)
    contours = [
        request if p.name in kept else _again(request, p, moved, group.path, ease)
        for request, p, moved, group in zip(
            prepared.contours, file.plans, targets, groups, strict=True
        )
    ]
    prepared = prepared.with_contours(contours)
    outcome = run_again(prepared, file.plans, file.moves, kept, progress)
    found = tuple(target for moved in targets for target in moved)
    return TouchUp(
        part=part, outcome=outcome, targets=found, notes=tuple(notes), renewed=tuple(renewed)
    )


def _require_kind(job: Job, file: PlanFile) -> None:
    """Raise InputError if job and plan do not belong together, or cannot be touched up."""
    options = job.options
    kinds = (
        (options.interruptions != "none", "interruptions"),
        (options.tilt is not None, "a tilt of the tool axis"),
        (options.refine_parts > 1, "refine_parts"),
        (job.program.arc_tolerance is not None, "arcs_mm"),
        (job.compensation is not None, "compensate"),
    )
    for found, words in kinds:
        if found:
            raise InputError(
                f"{job.path}: programs of jobs with {words} cannot be touched up; remove it and "
                "plan the job again"
            )
    if file.missing or file.failed:
        names = ", ".join(file.missing + file.failed)
        raise InputError(f"{file.path}: {names} has no plan that passed; plan the job again")
    for p in file.plans:
        _require_same_setup(p, job, file.path)


def _require_same_setup(plan: Plan, job: Job, path: Path) -> None:
    """Raise InputError if the tool, the part or the arm of a plan differs from the job."""
    pairs = {
        "tool": (plan.T_flange_tip, job.tool),
        "part": (plan.T_base_part, job.placement),
        "robot": (plan.robot.forward(plan.q[:1]), job.robot.forward(plan.q[:1])),
    }
    for name, (here, there) in pairs.items():
        if np.abs(here - there).max() > SAME_PLACE:
            raise InputError(
                f"{job.path}: its {name} is not at the place of that in {path}; give the job of "
                "that plan, or plan it again"
            )


def _read_edits(program: Path, job: Job, file: PlanFile) -> tuple[list[ReadGroup], list[str]]:
    """Return the steps of an edited program, a group for each plan, and its other changes."""
    job = in_language_of(program, job)
    options, expected = job.program, expected_of_plans(job, file.plans)
    texts, _ = program_of(file.plans, options, file.moves, expected=expected)
    planned, edited = (
        add_tips(read, job)
        for read in (
            read_program(texts, options.language, job.robot, options.settings),
            program_on_disk(program, job),
        )
    )
    found = {each.code: each for each in differences(planned, edited)}
    if "frames" in found:
        raise InputError(f"{program}: {found['frames'].message}; {MEASURE}")
    for code in ALONG:
        if code in found:
            raise InputError(
                f"{program}: {found[code]}; only moved targets are taken over: change the job and "
                "plan it again"
            )
    notes = [f"not kept: {each}" for code, each in found.items() if code != "targets"]
    return [group for group in groups_of(edited) if group.path], notes


def _taught(p: Plan, moves: Sequence[ReadMove]) -> list[MovedTarget]:
    """Return the targets of a contour that were moved."""
    T = np.array([move.T_part_tip for move in moves])
    off = np.linalg.norm(T[:, :3, 3] - p.contour.points, axis=1)
    turned = angle_between(p.contour.axes, T[:, :3, 2])
    return [
        MovedTarget(
            contour=p.name, node=k, place=moves[k].place, off=float(off[k]), turned=float(turned[k])
        )
        for k in np.flatnonzero((off > MOVED) | (turned > TURNED)).tolist()
    ]


def _require_few(
    program: Path, targets: Sequence[Sequence[MovedTarget]], plans: Sequence[Plan]
) -> None:
    moved = [target for each in targets for target in each]
    total = sum(len(p.contour) for p in plans)
    if not moved:
        raise InputError(f"{program}: no target on a contour was moved; there is nothing to do")
    if len(moved) > MOST_MOVED * total:
        raise InputError(f"{program}: {len(moved)} of {total} targets were moved; {MEASURE}")
    for p, each in zip(plans, targets, strict=True):
        ends = (0, len(p.contour) - 1) if p.contour.returns else (0,)
        for target in each:
            if target.node in ends:
                raise InputError(
                    f"{target.place}: the {'end' if target.node else 'start'} of contour "
                    f"{target.contour!r} was moved; write another start in the job and plan it "
                    f"again; {MEASURE}"
                )


def _keep(
    prepared: PreparedJob, file: PlanFile, touched: Collection[str], progress: Progress
) -> tuple[dict[str, CutResult], list[str]]:
    """Return the cuts that keep their motion, and why others without moved targets do not.

    A motion is kept if it is what the job asks for, and passes its audit by the job as it is now.
    """
    kept, renewed, job = dict[str, CutResult](), list[str](), prepared.job
    planned, _ = expect_plans(Expected.of(prepared), file)
    for request, p, each in zip(prepared.contours, file.plans, planned, strict=True):
        if p.name in touched:
            continue
        rows = [*each.checks]
        if each.plan is not None:
            entry = file.entries[p.name]
            picked = p.name in file.picked
            asked = plan_entry(
                each.plan, p.name, (), picked=picked, certificate="certificate" in entry
            )
            asked["audit"] = entry["audit"]  # made again
            rows += compare(asked["dt"], entry["dt"], of="the job", under=("dt",))
            rows += compare(asked, entry, of="the job")
            same = replace(p, robot=job.robot, T_flange_tip=job.tool, T_base_part=job.placement)
            cut = cut_as_before(prepared, request, same, progress, picked=picked)
            rows += [*cut.checks, *cut.as_run.checks]
            if cut.passed and all(row.ok or row.level == "warning" for row in rows):
                kept[p.name] = cut
                continue
        failed = next(row for row in rows if not row.ok and row.level == "error")
        why = failed.title if failed.unit == "count" else failed.issue().message
        renewed.append(f"{p.name} was planned again, as the job has changed: {why}")
    return kept, renewed


def _again(
    request: CutRequest, p: Plan, moved: Sequence[MovedTarget], moves: Sequence[ReadMove],
    ease: float,
) -> CutRequest:  # fmt: skip
    """Return the request for a contour around its moved targets, in the postures of its plan."""
    (planned,) = request.candidates
    if moved:
        k = np.array([target.node for target in moved])
        T = np.array([moves[node].T_part_tip for node in k])
        path, keep = touched_up(planned.path, planned.nodes, k, T[:, :3, 3], T[:, :3, 2], ease=ease)
        nodes = _sample_touched(path, planned.nodes, keep, request.task.speed)
        planned = Candidate.at(request.task.speed, path, nodes)
    postures = tuple(np.unique(p.posture).tolist())
    return replace(
        request,
        candidates=(planned,),
        options=replace(request.options, postures=postures),
        touched_up=bool(moved),
    )


def _planned(request: CutRequest, p: Plan) -> Candidate:
    """Return the candidate of a plan.

    For a plan that was touched up before, its path is straight lines between the plan's nodes.
    """
    for candidate in request.candidates:
        fits = len(candidate.nodes) == len(p.contour)
        if fits and _distances(p.contour, candidate.path) < SAME_PATH:
            return candidate
    slowed = bool((p.contour.speed_share < 1).any())
    nodes = replace(p.contour, time=p.time if slowed else None)
    return Candidate.at(request.task.speed, p.contour, nodes)


def _sample_touched(path: Contour, nodes: Contour, keep: Ints, speed: float) -> Contour:
    """Return a touched-up path sampled as finely as the nodes that it replaces."""
    if nodes.time is not None:
        return path.resample(dt=float(np.diff(nodes.time).max()), speed=speed, keep=keep)
    return path.resample(spacing=float(np.diff(nodes.s).max()), keep=keep)


def _distances(planned: Contour, path: Contour) -> float:
    """Return the largest error (m, rad) of nodes and axes on a path at the same arc lengths."""
    points, axes = path.at(planned.s)
    off: Array = np.linalg.norm(planned.points - points, axis=1)
    return float(np.maximum(off, angle_between(planned.axes, axes)).max())
