"""Demands on the joints between nodes where a controller rounds corners: narrow and wide zones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from time import perf_counter
from typing import NamedTuple

import numpy as np

from benchmarks._certified import in_processes
from benchmarks._compensation import compensation_reports
from benchmarks._figures import Report, Sheet
from benchmarks._random_contours import ROBOTS, cut
from benchmarks._shipped import report_shipped
from kerfpath import NoFeasiblePath, Plan, plan
from kerfpath.execution import Executed, executed, keep_limits, timing_of
from kerfpath.post import Program, Zone, build_program

__all__ = ["densest", "run", "zones_of_cut"]

COUNTS = (134, 133, 133)
"""Cuts of each robot."""
PROCESSES = 2
BEYOND = 0.2
"""rad: plans may end at a joint limit, where no tool can retract; programs here may exceed it."""
ZONES: tuple[Zone, ...] = (0.0003, "auto")
COLUMNS = (
    "zones",
    "robot",
    "plans",
    "at nodes",
    "as run",
    "95 %",
    "worst",
    "velocity over",
    "over",
    "tip mm",
)
ERRORS = (1e-4, 1e-2)
"""m: largest distance of the tip from a node when limits are lowered; the second is no limit."""
DENSER = 50
"""Samples per interval between nodes at which the limits are checked."""
KEPT_COLUMNS = (
    "zone error",
    "plans",
    "kept as planned",
    "brought in",
    "not",
    "cost %",
    "95 %",
    "worst",
    "over, densely",
    "tip mm",
    "s",
)
TIMED_COLUMNS = ("plans", "programmed s", "predicted s", "slower", "off toppra %", "worst", "ms")
HOW_TIMED = """\
The same plans with automatic zones, from rest to rest, no joint beyond a limit (`timing_of`), and
what TOPP-RA (toppra, Seidel solver) says of the same motion: a cubic spline through joints at 50
samples to the interval, by inverse kinematics, with the programmed pace as a limit of its own.
Programmed and predicted: medians. Slower: plans that do not hold the speed between the ramps. Off
toppra: how far the predicted times are off its times, median and worst. ms: of the prediction."""
HOW_KEPT = """\
The same plans, held to less at their nodes where the program needs more than a full limit between
them (`keep_limits`, automatic zones). Kept as planned, brought in, and not: plans. Cost: what the
plans that were brought in cost more, median, 95 % and worst. Over, densely: plans said to keep the
limits of which one of 50 samples to the interval, by inverse kinematics, is over one. s: median."""
HOW = """\
The random contours of `continuum_random`, planned over continuous gamma, as programs with zones of
0.3 mm and with automatic ones. At nodes: the highest share of an acceleration limit that the plan
needs from node to node, median over plans. As run: the highest in the motion of
`kerfpath.execution`, where a controller rounds the corners at constant acceleration; median, 95 %
and worst. Over: plans that need more than the full limit of velocity or acceleration there, so that
a controller would slow down. Tip: by how much it passes a node at most."""


class Peaks(NamedTuple):
    """Shares of limits, and distances from the nodes (m), of one plan with one kind of zones."""

    robot: str
    zone: Zone
    nodes: float
    velocity: float
    acceleration: float
    missed: float


def run(*, quick: bool) -> list[Report]:
    """Measure them."""
    counts = (3, 3, 3) if quick else COUNTS
    keys = [(name, i) for name, count in zip(ROBOTS, counts, strict=True) for i in range(count)]
    made = in_processes(zones_of_cut, keys, 1 if quick else PROCESSES)
    kept = in_processes(kept_of_cut, keys, 1 if quick else PROCESSES)
    timed = in_processes(timed_cut, keys, 1)
    return [
        _report([peaks for each in made for peaks in each], len(keys)),
        _kept_report([one for each in kept for one in each], len(keys)),
        _timed_report([one for each in timed for one in each], len(keys)),
        report_shipped(quick=quick),
        *compensation_reports(quick=quick),
    ]


def zones_of_cut(key: tuple[str, int]) -> list[Peaks]:
    """Plan a cut, and return the demands of its program with each kind of zones."""
    made, found = _planned(key), []
    if made is None:
        return []
    for zone in ZONES:
        (one,) = executed(build_program([made], zone=zone))
        found.append(
            Peaks(
                key[0],
                zone,
                float(made.criteria.peak_acceleration.max()),
                one.peak_velocity.share,
                one.peak_acceleration.share,
                one.missed,
            )
        )
    return found


class Brought(NamedTuple):
    """The result of planning with lower limits at the nodes."""

    error: float
    done: bool
    rounds: int
    cost: float
    over: bool
    missed: float
    seconds: float


def kept_of_cut(key: tuple[str, int]) -> list[Brought]:
    """Plan a cut, and lower its limits where its program exceeds them, for each zone error."""
    made, found = _planned(key), []
    if made is None:
        return []
    for error in ERRORS:
        program = partial(_program, error)
        began = perf_counter()
        kept = keep_limits(made, program)
        took = perf_counter() - began
        assert kept.run is not None
        over = kept.done and densest(kept.run, program(kept.plan)) > 1
        found.append(
            Brought(
                error, kept.done, kept.rounds, kept.plan.cost / made.cost - 1, over,
                kept.run.missed, took,
            )
        )  # fmt: skip
    return found


class Timed(NamedTuple):
    """Duration of the program of a plan, by `timing_of` and by toppra, s."""

    programmed: float
    predicted: float
    toppra: float
    held: float
    took: float


def timed_cut(key: tuple[str, int]) -> list[Timed]:
    """Plan a cut, and predict how long its program takes."""
    made = _planned(key)
    if made is None:
        return []
    program = build_program([made])
    (run,) = executed(program)
    began = perf_counter()
    timing = timing_of(run)
    took = perf_counter() - began
    return [Timed(timing.programmed, timing.seconds, _by_toppra(run, program), timing.held, took)]


def _by_toppra(run: Executed, program: Program) -> float:
    """Return the duration of a run by toppra, s; NaN if it is not installed."""
    try:
        import toppra
    except ImportError:
        return np.nan
    toppra.setup_logging("ERROR")
    from toppra import SplineInterpolator
    from toppra.algorithm import TOPPRA
    from toppra.constraint import JointAccelerationConstraint, JointVelocityConstraint

    time = np.linspace(0.0, run.tool_motion.time[-1], len(run.tool_motion.T) * DENSER)
    near = np.stack([np.interp(time, run.time, joint) for joint in run.q.T], axis=1)
    poses = program.T_base_part @ run.tool_motion.poses(time) @ np.linalg.inv(program.T_flange_tip)
    path = SplineInterpolator(time, np.column_stack([program.robot.arm.nearest(poses, near), time]))
    velocity, acceleration = program.robot.speed_limits()
    limits = [
        JointVelocityConstraint(np.append(velocity, 1.0)[:, None] * [-1.0, 1.0]),
        JointAccelerationConstraint(np.append(acceleration, 1e6)[:, None] * [-1.0, 1.0]),
    ]
    solver = TOPPRA(limits, path, gridpoints=time, solver_wrapper="seidel")
    _, pace, _ = solver.compute_parameterization(0.0, 0.0)
    return float((2 * np.diff(time) / (pace[1:] + pace[:-1])).sum())


def _timed_report(made: Sequence[Timed], cuts: int) -> Report:
    values = np.array(made).reshape(-1, len(Timed._fields))
    programmed, predicted, toppra, held, took = values.T
    off = 100 * np.abs(predicted / toppra - 1)
    row = (
        str(len(made)),
        f"{np.median(programmed):.2f}",
        f"{np.median(predicted):.2f}",
        str(int((held < 1).sum())),
        f"{np.nanmedian(off):.2f}",
        f"{np.nanmax(off):.2f}",
        f"{1e3 * np.median(took):.0f}",
    )
    return Report(
        title=f"Predicted times: {cuts} random contours",
        how=HOW_TIMED,
        sheets=[Sheet(columns=TIMED_COLUMNS, rows=[row])],
        findings=[],
    )


def _planned(key: tuple[str, int]) -> Plan | None:
    drawn = cut(*key)
    try:
        made = plan(
            drawn.contour, drawn.robot, tool=drawn.tool, placement=np.eye(4), speed=drawn.speed,
            certify=None,
        )  # fmt: skip
    except NoFeasiblePath:
        return None
    limits = drawn.robot.joint_limits()
    wider = drawn.robot.with_limits(lower=limits.lower - BEYOND, upper=limits.upper + BEYOND)
    return replace(made, robot=wider)


def _program(error: float, made: Plan) -> Program:
    return build_program([made], zone_error=error)


def densest(run: Executed, program: Program) -> float:
    """Return the largest share of a limit found by dense sampling with inverse kinematics."""
    robot, end = program.robot, float(run.tool_motion.time[-1])
    step = end / (len(run.tool_motion.T) * DENSER)
    time, d = np.arange(step, end - step, step), step / 10
    near = np.stack([np.interp(time, run.time, joint) for joint in run.q.T], axis=1)
    flange = np.linalg.inv(program.T_flange_tip)
    before, here, after = (
        robot.arm.nearest(
            program.T_base_part @ run.tool_motion.poses(time + sign * d) @ flange, near
        )
        for sign in (-1, 0, 1)
    )
    velocity, acceleration = robot.speed_limits()
    fast = np.abs((after - before) / (2 * d) / velocity).max()
    # Differences over d lose digits: joints are accurate to 1e-13 rad.
    sharp = np.abs((after - 2 * here + before) / d**2) - 4e-13 / d**2
    return float(max(fast, (sharp / acceleration).max()))


def _kept_report(made: Sequence[Brought], cuts: int) -> Report:
    rows = [_kept_row(error, [each for each in made if each.error == error]) for error in ERRORS]
    return Report(
        title=f"Limits kept between the nodes: {cuts} random contours",
        how=HOW_KEPT,
        sheets=[Sheet(columns=KEPT_COLUMNS, rows=rows)],
        findings=[],
    )


def _kept_row(error: float, made: Sequence[Brought]) -> tuple[str, ...]:
    brought = [each for each in made if each.done and each.rounds]
    dearer = 100 * np.array([each.cost for each in brought] or [np.nan])
    return (
        f"{error * 1e3:g} mm",
        str(len(made)),
        str(sum(each.done and not each.rounds for each in made)),
        str(len(brought)),
        str(sum(not each.done for each in made)),
        f"{np.median(dearer):.2f}",
        f"{np.quantile(dearer, 0.95):.2f}",
        f"{dearer.max():.2f}",
        str(sum(each.over for each in made)),
        f"{max((each.missed for each in made), default=np.nan) * 1e3:.3f}",
        f"{np.median([each.seconds for each in made] or [np.nan]):.2f}",
    )


def _report(made: Sequence[Peaks], cuts: int) -> Report:
    rows = [
        _row(
            zone, name, [each for each in made if each.zone == zone and name in (each.robot, "all")]
        )
        for zone in ZONES
        for name in (*ROBOTS, "all")
    ]
    return Report(
        title=f"Between the nodes: {cuts} random contours",
        how=HOW,
        sheets=[Sheet(columns=COLUMNS, rows=rows)],
        findings=[],
    )


def _row(zone: Zone, name: str, made: Sequence[Peaks]) -> tuple[str, ...]:
    said = zone if zone == "auto" else f"{zone * 1e3:g} mm"
    if not made:
        return (said, name, "0", *"-------")
    nodes, acceleration = (
        np.array([getattr(p, k) for p in made]) for k in ("nodes", "acceleration")
    )
    return (
        said,
        name,
        str(len(made)),
        f"{np.median(nodes):.2f}",
        f"{np.median(acceleration):.2f}",
        f"{np.quantile(acceleration, 0.95):.2f}",
        f"{acceleration.max():.2f}",
        str(sum(p.velocity > 1 for p in made)),
        str(sum(p.acceleration > 1 for p in made)),
        f"{max(p.missed for p in made) * 1e3:.3f}",
    )
