"""Which robots of the library can cut the part of a job where it lies, and how fast."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

from kerfpath._arrays import Ints
from kerfpath._repr import short_repr
from kerfpath.cad import Part
from kerfpath.errors import InputError, NoFeasiblePath
from kerfpath.front import follows_courses
from kerfpath.graph import LayeredGraph
from kerfpath.job import Job, read_job
from kerfpath.progress import Progress, no_progress
from kerfpath.robots import Robot, acceleration_ratios, postures_named, robot, robot_ids
from kerfpath.study._evaluator import (
    EVERY,
    Evaluator,
    SampledContour,
    out_of_reach,
    sample_contours,
)
from kerfpath.study._job import digest, load_job
from kerfpath.sweep import Sweep

__all__ = ["NEAREST", "ContourSpeed", "RobotSpeed", "contour_speeds", "which_robots", "with_robot"]

NEAREST = "nearest"
"""In place of a ratio: of each robot the one that the library calls its nearest."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ContourSpeed:
    """What a robot can do of one contour.

    Parameters
    ----------
    name : str
    asked : float m/s
        What the job asks for.
    reached : float
        Share of its nodes that have a pose.
    fastest : float m/s, optional
        The fastest constant speed on the job's grid; None where there is none, or another contour
        is out of reach.
    joint : int, optional
        Which binds, from 1.
    limit : {"velocity", "acceleration"}, optional
    reason : str
        Why there is no speed; empty otherwise.
    """

    name: str
    asked: float
    reached: float
    fastest: float | None = None
    joint: int | None = None
    limit: str | None = None
    reason: str = ""

    __repr__ = short_repr

    @property
    def margin(self) -> float | None:
        """The fastest speed as a multiple of what is asked."""
        return None if self.fastest is None else self.fastest / self.asked


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotSpeed:
    """What a robot can do of a job.

    Parameters
    ----------
    robot : Robot
        With the limits that were used.
    own : bool
        It is the job's own, with the limits that the job gives.
    contours : tuple of ContourSpeed
        Of the whole job; empty where the robot was refused before.
    reason : str
        Why not every contour has a speed; empty otherwise.
    """

    robot: Robot
    own: bool
    contours: tuple[ContourSpeed, ...] = ()
    reason: str = ""

    __repr__ = short_repr

    @property
    def binding(self) -> ContourSpeed | None:
        """The contour with the least margin; None unless every contour has a speed."""
        if self.reason or not self.contours:
            return None
        return min(self.contours, key=lambda contour: contour.margin or 0.0)

    @property
    def reached(self) -> float:
        """Share of the nodes that have a pose, of the contour that is reached least."""
        return min((contour.reached for contour in self.contours), default=0.0)


def which_robots(
    job_file: str | os.PathLike[str],
    *,
    store: str | os.PathLike[str],
    scheduler: str | None = None,
    processes: int | None = None,
    robots: Sequence[str] | None = None,
    acceleration_ratio: str | None = None,
    progress: Progress = no_progress,
) -> list[RobotSpeed]:
    """Return what each robot can do of a job, the fastest first; each is a task of its own.

    Robot base, head and part stay where the job has them. The job's own robot is evaluated with its
    limits as the job gives them, all others with those of the library and the endless axes that
    are so there.

    Parameters
    ----------
    job_file : path
        At the same place on every worker.
    store, scheduler, processes, progress
        As in `kerfpath.sweep.run`.
    robots : sequence of str, optional
        Ids of the library; default: all of it. The job's own robot is there in any case.
    acceleration_ratio : str, optional
        Of robots whose maker publishes no accelerations, assume them by this ratio to the speeds
        (one of `kerfpath.robots.acceleration_ratios()`), or by `NEAREST`. Default: the ratio
        that the job names, if it does; otherwise these robots are refused.

    Raises
    ------
    InputError
        As `read_job` and `kerfpath.sweep.run`; an unknown robot or ratio.
    """
    path = Path(job_file)
    job, known = read_job(path), (NEAREST, *acceleration_ratios())
    if acceleration_ratio is not None and acceleration_ratio not in known:
        raise InputError(
            f"acceleration_ratio: expected one of {', '.join(known)}, got {acceleration_ratio!r}"
        )
    ratio = acceleration_ratio or job.source["robot"].get("acceleration_ratio")
    names = [name for name in robots or robot_ids() if name != job.robot.id]
    asked = [(None, None), *((name, _ratio_of(robot(name), ratio)) for name in names)]
    same = {"path": str(path.resolve()), "digest_then": digest(path)}
    found = []
    with Sweep(
        evaluate_robot, store=store, scheduler=scheduler, processes=processes, progress=progress
    ) as tasks:
        keys = [tasks.submit(**same, name=name, ratio=used) for name, used in asked]
        for key, (name, used) in zip(keys, asked, strict=True):
            result = tasks.result(key)
            arm = job.robot if name is None else robot(name, acceleration_ratio=used)
            if result.failure is None:
                contours = tuple(ContourSpeed(**data) for data in result.value)
                why = _reason(contours)
            else:
                contours, why = (), result.failure.message
            found.append(RobotSpeed(robot=arm, own=name is None, contours=contours, reason=why))
    return sorted(found, key=_order)


def _reason(contours: Sequence[ContourSpeed]) -> str:
    """Say why not every contour has a speed: of the worst one, and how many there are."""
    bad = [contour for contour in contours if contour.reason]
    if not bad:
        return ""
    worst = min(bad, key=lambda contour: contour.reached)
    many = f"{len(bad)} of {len(contours)} contours; " if len(contours) > 1 else ""
    return f"{many}{worst.name}: {worst.reason}"


def _ratio_of(candidate: Robot, ratio: str | None) -> str | None:
    """Return by which ratio accelerations are assumed; None where they are known, or not at all.

    Nor for an arm whose elbow is free, which the list refuses: ratios are those of six joints.
    """
    if candidate.acceleration is not None or candidate.velocity is None or candidate.free.size:
        return None
    return candidate.acceleration_ratio if ratio == NEAREST else ratio


def _order(found: RobotSpeed) -> tuple[float, float, str]:
    """Order by margin, then by reach, then by name."""
    binding = found.binding
    margin = 0.0 if binding is None else binding.margin or 0.0
    return -margin, -found.reached, found.robot.id


def evaluate_robot(
    *, path: str, digest_then: str, name: str | None, ratio: str | None
) -> list[dict[str, object]]:
    """Return what a robot of the library, or the job's own, can do of a job: a task of a sweep."""
    found = load_job(path, digest_then)
    job = found.job
    if name is not None:
        candidate = robot(name, acceleration_ratio=ratio)
        if candidate.limits_missing:
            raise InputError(f"joint limits are not known: {candidate.limits_missing}")
        job = with_robot(job, candidate)
    return [asdict(contour) for contour in contour_speeds(job, found.part)]


def with_robot(job: Job, candidate: Robot) -> Job:
    """Return a job with another robot in its place, for `contour_speeds`.

    Its external axes stay where they are, the base of the robot on those that carry it.

    Raises
    ------
    InputError
        A posture that its family has not; a cell that asks for the links of a description; a job
        with a load or jerk limits.
    """
    for each in (job.robot, candidate):
        each.require_no_free_joint("a list of robots")
    if job.robot.load is not None or job.robot.jerk is not None:
        raise InputError(
            "its limits on torque and jerk are not known: remove mass_kg and jerk_deg_s3 to "
            "compare robots without them"
        )
    words = job.source.get("plan", {}).get("posture")
    postures = None if words is None else postures_named(words, candidate.kinematics)
    if job.cell is not None and job.cell.links == "description":
        raise InputError(
            'its links are not known, as links = "description" in [cell] describes the job\'s own '
            'robot alone; write links = "capsules", which stand for those of any'
        )
    candidate = _on_axes_of(job.robot, candidate)
    return replace(job, robot=candidate, options=replace(job.options, postures=postures))


def _on_axes_of(own: Robot, candidate: Robot) -> Robot:
    """Return a robot on the external axes of another.

    Raises
    ------
    InputError
        Its accelerations are not known: then nothing is known of how it moves with the axes.
    """
    if own.externals and candidate.acceleration is None:
        names = ", ".join(axis.name for axis in own.externals)
        raise InputError(
            f"its accelerations are not known, and no course of {names} without them: give "
            "--acceleration-ratio, or acceleration_ratio in [robot], to assume a typical ratio "
            "to the speeds"
        )
    velocity, acceleration = own.speed_limits() if own.externals else ((), ())
    limits = own.joint_limits()
    for i, axis in enumerate(own.externals, own.family.joints):
        candidate = candidate.with_external(
            axis,
            lower=float(limits.lower[i]),
            upper=float(limits.upper[i]),
            velocity=float(velocity[i]),
            acceleration=float(acceleration[i]),
            endless=bool(own.endless[i]),
        )
    return candidate


def contour_speeds(job: Job, part: Part) -> list[ContourSpeed]:
    """Return what the job's robot can do of each contour, with part and robot where the job says.

    Reach is that of all poses on the job's grid, margins of [comfort] kept. Only where every node
    of every contour has a pose, and in a cell every `EVERY`-th a clear one, are speeds looked for:
    exact on that grid, clear in the cell. External axes are at any place of a coarse grid of them
    for the reach, and speeds are along the gentlest course of theirs, unless the job's method takes
    them on a grid.

    Raises
    ------
    InputError
        Limits that are not known, a cell that cannot be.
    """
    evaluator = Evaluator(job=job, part=part)
    _ = evaluator.cell  # what is wrong with it is said first
    contours = sample_contours(job, part)
    if follows_courses(job.robot, job.options):
        return _along_courses(evaluator, contours)
    graphs = [evaluator.graph(contour.nodes) for contour in contours]
    found = [
        _share_reached(contour, graph) for contour, graph in zip(contours, graphs, strict=True)
    ]
    if not any(each.reason for each in found):
        for i, graph in enumerate(graphs):
            if (node := next(evaluator.blocked(graph, EVERY), None)) is not None:
                found[i] = replace(found[i], reason=f"collision: no clear pose at node {node}")
    if any(each.reason for each in found):
        return found
    if job.robot.acceleration is None:
        raise InputError(
            "in reach of every node, but its accelerations are not known: give "
            "--acceleration-ratio, or acceleration_ratio in [robot], to assume a typical ratio "
            "to the speeds"
        )
    for i, graph in enumerate(graphs):
        found[i] = _with_speed(evaluator, contours[i], graph, found[i])
    return found


def _along_courses(evaluator: Evaluator, contours: Sequence[SampledContour]) -> list[ContourSpeed]:
    """Return what a robot can do of each contour along the gentlest course of external axes."""
    job = evaluator.job
    names = ", ".join(axis.name for axis in job.robot.externals)
    found = [
        _reached(
            contour,
            out_of_reach(job, contour.nodes, job.options.without_penalties),
            f"at any sampled value of {names}",
        )
        for contour in contours
    ]
    if any(each.reason for each in found):
        return found
    return [
        _with_speed(evaluator, contour, None, known)
        for contour, known in zip(contours, found, strict=True)
    ]


def _with_speed(
    evaluator: Evaluator, contour: SampledContour, graph: LayeredGraph | None, known: ContourSpeed
) -> ContourSpeed:
    """Return what is known of a contour with its fastest speed, or why there is none."""
    try:
        best = evaluator.fastest(contour.nodes, graph)
    except NoFeasiblePath as broken:
        return replace(known, reason=str(broken))
    return replace(known, fastest=best.speed, joint=best.joint + 1, limit=best.limit)


def _share_reached(contour: SampledContour, graph: LayeredGraph) -> ContourSpeed:
    """Return which share of the nodes has a pose, and what forbids the first that has none."""
    empty = np.flatnonzero(np.diff(graph.start) == 0)
    first = f"at node {empty[0]} mostly: {graph.main_loss(int(empty[0]))}" if empty.size else ""
    return _reached(contour, empty, first)


def _reached(contour: SampledContour, empty: Ints, why: str) -> ContourSpeed:
    """Return which share of the nodes has a pose, given those that have none, and why they have."""
    nodes = len(contour.nodes)
    return ContourSpeed(
        name=contour.name,
        asked=contour.speed,
        reached=1 - empty.size / nodes,
        reason=f"no pose at {empty.size} of {nodes} nodes, {why}" if empty.size else "",
    )
