"""Which robots of the library can do a job, and how fast: find them, and write the list."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

from kerfpath import __version__
from kerfpath.arrays import Ints, short_repr
from kerfpath.cad import Part
from kerfpath.errors import InputError, NoFeasiblePath
from kerfpath.front import follows_courses
from kerfpath.graph import LayeredGraph
from kerfpath.job import Job, prepare, read_job
from kerfpath.planner import FINER
from kerfpath.post import write_set
from kerfpath.progress import Progress, no_progress
from kerfpath.report import render_table
from kerfpath.robots import Robot, acceleration_ratios, postures_named, robot, robot_ids
from kerfpath.study.loaded_job import (
    EVERY,
    Evaluator,
    SampledContour,
    job_key,
    load_job,
    out_of_reach,
    sample_contours,
)
from kerfpath.sweep import Sweep

# -----------------------------------------------------------------------------
# Find the robots that can cut the part where it is.

NEAREST = "nearest"
"""Value of `acceleration_ratio` that takes for each robot the ratio that the library recommends."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ContourReach:
    """Reach and fastest speed of a robot on one contour.

    Parameters
    ----------
    name : str
        Name of the contour.
    asked : float m/s
        Speed that the job asks for.
    reached : float
        Share of the nodes that have a pose.
    fastest : float m/s, optional
        The fastest constant speed on the job's grid; None where there is none, or where another
        contour is out of reach.
    joint : int, optional
        The joint that limits the speed, from 1.
    limit : {"velocity", "acceleration"}, optional
        The limit of that joint that is reached.
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
        """The fastest speed as a multiple of the speed asked for."""
        return None if self.fastest is None else self.fastest / self.asked


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotSpeed:
    """Reach and fastest speeds of a robot on a job.

    Parameters
    ----------
    robot : Robot
        The robot with the limits that were used.
    own : bool
        Whether it is the job's own robot, with the limits that the job gives.
    contours : tuple of ContourReach
        All contours of the job; empty where the robot was refused.
    reason : str
        Why not every contour has a speed; empty otherwise.
    """

    robot: Robot
    own: bool
    contours: tuple[ContourReach, ...] = ()
    reason: str = ""

    __repr__ = short_repr

    @property
    def binding(self) -> ContourReach | None:
        """The contour with the least margin; None unless every contour has a speed."""
        if self.reason or not self.contours:
            return None
        return min(self.contours, key=lambda contour: contour.margin or 0.0)

    @property
    def reached(self) -> float:
        """Least share of nodes that have a pose, over all contours."""
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
    """Return reach and speeds of each robot on a job, the fastest first; each robot is one task.

    Robot base, head and part stay where the job has them. The job's own robot is evaluated with the
    limits that the job gives, all others with the limits and endless axes of the library.

    Parameters
    ----------
    job_file : path
        The job file, at the same path on every worker.
    store, scheduler, processes, progress
        As in `kerfpath.sweep.run`.
    robots : sequence of str, optional
        Ids of library robots; default: all. The job's own robot is always included.
    acceleration_ratio : str, optional
        Ratio of acceleration to velocity that is assumed for robots whose maker publishes no
        accelerations: one of `kerfpath.robots.acceleration_ratios()`, or `NEAREST`. Default: the
        ratio in the job, if there is one; otherwise these robots are refused.

    Raises
    ------
    InputError
        As `read_job` and `kerfpath.sweep.run`; also for an unknown robot or ratio.
    """
    path = Path(job_file)
    job, known = read_job(path), (NEAREST, *acceleration_ratios())
    prepare(job, job.read_part())  # what is wrong with the job itself is no property of a robot
    if acceleration_ratio is not None and acceleration_ratio not in known:
        raise InputError(
            f"acceleration_ratio: expected one of {', '.join(known)}, got {acceleration_ratio!r}"
        )
    ratio = acceleration_ratio or job.source["robot"].get("acceleration_ratio")
    names = [name for name in robots or robot_ids() if name != job.robot.id]
    asked = [(None, None), *((name, _ratio_of(robot(name), ratio)) for name in names)]
    same = job_key(path)
    found = []
    with Sweep(
        evaluate_robot, store=store, scheduler=scheduler, processes=processes, progress=progress
    ) as tasks:
        keys = [tasks.submit(**same, name=name, ratio=used) for name, used in asked]
        for key, (name, used) in zip(keys, asked, strict=True):
            result = tasks.result(key)
            tried = job.robot if name is None else robot(name, acceleration_ratio=used)
            if result.failure is None:
                contours = tuple(ContourReach(**data) for data in result.value)
                why = _reason(contours)
            else:
                contours, why = (), result.failure.message
            found.append(RobotSpeed(robot=tried, own=name is None, contours=contours, reason=why))
    return sorted(found, key=_order)


def _reason(contours: Sequence[ContourReach]) -> str:
    """Return why not every contour has a speed: the worst contour's reason, and how many fail."""
    bad = [contour for contour in contours if contour.reason]
    if not bad:
        return ""
    worst = min(bad, key=lambda contour: contour.reached)
    many = f"{len(bad)} of {len(contours)} contours; " if len(contours) > 1 else ""
    return f"{many}{worst.name}: {worst.reason}"


def _ratio_of(candidate: Robot, ratio: str | None) -> str | None:
    """Return the ratio for assumed accelerations; None where accelerations are known.

    Also None where the velocities are not known, or for an arm with a free elbow, which the list
    refuses: ratios are for six joints.
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
    *, job: str, digest: str, name: str | None, ratio: str | None
) -> list[dict[str, object]]:
    """Return the contour speeds of a library robot or the job's own; the task of the sweep."""
    found = load_job(job, digest)
    placed = found.job
    if name is not None:
        candidate = robot(name, acceleration_ratio=ratio)
        if candidate.limits_missing:
            raise InputError(f"joint limits are not known: {candidate.limits_missing}")
        placed = with_robot(placed, candidate)
    return [asdict(contour) for contour in contour_speeds(placed, found.part)]


def with_robot(job: Job, candidate: Robot) -> Job:
    """Return a job with its robot replaced by another, for `contour_speeds`.

    The external axes stay where they are, and the new robot is mounted on those that carry one.

    Raises
    ------
    InputError
        The family of the robot lacks the job's posture; the cell uses the links of the job's
        description; the job has a load or jerk limits; or one of the arms has seven axes.
    """
    for each in (job.robot, candidate):
        each.require_no_free_joint("a list of robots")
    if job.robot.dynamics.load is not None or job.robot.limits.jerk is not None:
        raise InputError(
            "its torque and jerk limits are not known: remove mass_kg and jerk_deg_s3 to compare "
            "robots without them"
        )
    words = job.source.get("plan", {}).get("posture")
    postures = None if words is None else postures_named(words, candidate.kinematics)
    if job.cell is not None and job.cell.links == "description":
        raise InputError(
            'its links are not known: links = "description" in [cell] applies only to the job\'s '
            'own robot; write links = "capsules", which fit any robot'
        )
    candidate = _on_axes_of(job.robot, candidate)
    return replace(job, robot=candidate, options=replace(job.options, postures=postures))


def _on_axes_of(own: Robot, candidate: Robot) -> Robot:
    """Return a robot on the external axes of another.

    Raises
    ------
    InputError
        Its accelerations are not known; without them there are no courses of external axes.
    """
    if own.externals and candidate.acceleration is None:
        names = ", ".join(axis.name for axis in own.externals)
        raise InputError(
            f"its accelerations are not known, and without them there is no course of {names}; "
            "give --acceleration-ratio, or acceleration_ratio in [robot], to assume a typical "
            "ratio to the speeds"
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


def contour_speeds(job: Job, part: Part) -> list[ContourReach]:
    """Return reach and fastest speed of the job's robot on each contour, placed as in the job.

    Reach counts all poses on the job's grid that keep the margins of [comfort]. Speeds are searched
    only where every node of every contour has a pose and, in a cell, every `EVERY`-th node a clear
    one. They are exact on that grid and clear in the cell. External axes are sampled on a coarse
    grid for the reach, and follow their gentlest course for the speeds, unless the job's method
    takes them on a grid.

    Raises
    ------
    InputError
        Limits are not known, or the cell is not valid.
    """
    evaluator = Evaluator(job=job, part=part)
    _ = evaluator.cell  # report errors of the cell first
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
            "it reaches every node, but its accelerations are not known: give "
            "--acceleration-ratio, or acceleration_ratio in [robot], to assume a typical ratio "
            "to the speeds"
        )
    for i, graph in enumerate(graphs):
        found[i] = _with_speed(evaluator, contours[i], graph, found[i])
    return found


def _along_courses(evaluator: Evaluator, contours: Sequence[SampledContour]) -> list[ContourReach]:
    """Return reach and speed on each contour along the gentlest course of the external axes."""
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
    evaluator: Evaluator, contour: SampledContour, graph: LayeredGraph | None, known: ContourReach
) -> ContourReach:
    """Return a contour's result completed by its fastest speed, or by why there is none."""
    try:
        best = evaluator.fastest(contour.nodes, graph)
    except NoFeasiblePath as broken:
        return replace(known, reason=str(broken))
    return replace(known, fastest=best.speed, joint=best.joint + 1, limit=best.limit)


def _share_reached(contour: SampledContour, graph: LayeredGraph) -> ContourReach:
    """Return the share of nodes that have a pose, and what rules out the first that has none."""
    empty = np.flatnonzero(np.diff(graph.start) == 0)
    first = f"at node {empty[0]} mostly: {graph.main_loss(int(empty[0]))}" if empty.size else ""
    return _reached(contour, empty, first)


def _reached(contour: SampledContour, empty: Ints, why: str) -> ContourReach:
    """Return the share of nodes that have a pose, given the ones that have none and why."""
    nodes = len(contour.nodes)
    return ContourReach(
        name=contour.name,
        asked=contour.speed,
        reached=1 - empty.size / nodes,
        reason=f"no pose at {empty.size} of {nodes} nodes, {why}" if empty.size else "",
    )


# -----------------------------------------------------------------------------
# Write robots.json and robots.html.

ROBOT_COLUMNS = (
    ("Robot", ""),
    ("Payload", "kg"),
    ("Reach", "mm"),
    ("Margin", ""),
    ("Fastest", "m/min"),
    ("Accelerations", ""),
    ("Limiting contour, or reason", ""),
)
"""Head and unit of each column of the table of robots."""
ROBOT_WORDS = (0, 5, 6)
"""Columns of that table that hold text."""
ROBOT_NOTES = (
    "Margin: the fastest constant speed divided by the speed asked for, of the contour where this "
    "ratio is least. Speeds are exact on the job's grid (and along one course of external axes, "
    f"where the job has them). From a margin of 1 on the robot does the job as asked; {FINER}.",
    "Robot base, head and part stay where the job has them. The payload is listed but not checked, "
    "because the job does not state the weight of the head.",
)
"""Notes below the table of robots."""


def robots_entry(found: Sequence[RobotSpeed]) -> list[dict[str, object]]:
    """Return the results as plain data, with units in the names."""
    return [_entry(each) for each in found]


def _entry(each: RobotSpeed) -> dict[str, object]:
    binding, robot = each.binding, each.robot
    return {
        "robot": robot.id,
        "model": f"{robot.manufacturer} {robot.model}".strip(),
        "own": each.own,
        "payload_kg": robot.payload,
        "reach_m": robot.reach,
        "acceleration": robot.acceleration_source or None,
        "margin": binding and binding.margin,
        "binding_contour": binding and binding.name,
        "slowest_m_min": _slowest(each),
        "reached": each.reached if each.contours else None,
        "reason": each.reason or None,
        "contours": [_contour_entry(contour) for contour in each.contours],
    }


def _contour_entry(contour: ContourReach) -> dict[str, object]:
    return {
        "name": contour.name,
        "asked_m_min": contour.asked * 60,
        "reached": contour.reached,
        "fastest_m_min": None if contour.fastest is None else contour.fastest * 60,
        "margin": contour.margin,
        "joint": contour.joint,
        "limit": contour.limit,
        "reason": contour.reason or None,
    }


def _slowest(each: RobotSpeed) -> float | None:
    speeds = [contour.fastest for contour in each.contours if contour.fastest is not None]
    return min(speeds) * 60 if each.binding else None


def write_robots(
    job_file: str | Path,
    found: Sequence[RobotSpeed],
    folder: str | os.PathLike[str],
) -> list[Path]:
    """Write robots.json and robots.html into an existing folder.

    Raises
    ------
    InputError
        As `read_job`; also where there are no robots, or a file cannot be written.
    """
    job = read_job(job_file)
    whole = {"version": __version__, "job": job.source, "robots": robots_entry(found)}
    if not found:
        raise InputError("no robots to write: the list of results is empty")
    able = sum(each.binding is not None for each in found)
    page = render_table(
        f"Robots for {job.part_file.stem.replace('_', ' ')}",
        kind="Which robot",
        heads=ROBOT_COLUMNS,
        rows=robot_rows(found),
        text_columns=ROBOT_WORDS,
        caption=f"{able} of {len(found)} robots can cut every contour.",
        facts=[("Job", job.path.name), ("Part", job.part_file.name)],
        notes=ROBOT_NOTES,
        job_text=job.path.read_text(encoding="utf-8-sig"),
    )
    texts = {"robots.json": json.dumps(whole, indent=1, allow_nan=False), "robots.html": page}
    return write_set(folder, texts)


def robot_rows(found: Sequence[RobotSpeed]) -> list[list[str]]:
    """Return a row for each robot, with the columns of `ROBOT_COLUMNS`."""
    return [_row(each) for each in found]


def _row(each: RobotSpeed) -> list[str]:
    robot, binding = each.robot, each.binding
    row = [
        f"{robot.id} (the job's own)" if each.own else robot.id,
        "-" if robot.payload is None else f"{robot.payload:g}",
        "-" if robot.reach is None else f"{robot.reach * 1000:.0f}",
    ]
    if binding is None or binding.margin is None or binding.fastest is None:
        return [*row, "-", "-", "-", each.reason]
    source = robot.acceleration_source
    return [
        *row,
        f"{binding.margin:.3f}",
        f"{binding.fastest * 60:.3f}",
        source.removesuffix(" times the speeds") if source.startswith("assumed") else "known",
        f"{binding.name}: {binding.limit} of joint {binding.joint}",
    ]
