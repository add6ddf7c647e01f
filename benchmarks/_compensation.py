"""Compensation of small holes by the model of the response, and correction by measured runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from benchmarks._certified import in_processes
from benchmarks._figures import Report, Sheet
from benchmarks._random_contours import ROBOTS, arm, head
from kerfpath import Contour, NoFeasiblePath, Plan, Robot, plan, robot
from kerfpath.arrays import Array
from kerfpath.auditor import checks
from kerfpath.contour import KINDS
from kerfpath.execution import (
    ASSUMED,
    CommandedRun,
    Compensation,
    Compensator,
    Correction,
    Executed,
    Log,
    Response,
    correct,
    longest_run,
    moved,
    path_error,
    response,
    smoothing,
    timing_of,
)
from kerfpath.planner import fastest_speed
from kerfpath.post import build_program

__all__ = ["compensation_reports"]

RADII = np.linspace(2.5e-3, 15e-3, 10)
SPEEDS = (0.05, 0.1, 0.15)
"""m/s: 3, 6 and 9 m/min."""
TOLERANCE = 5e-5
MOST = 3e-3
"""m: largest displacement of a target."""
SPACING = 1e-3
LEAD = 0.7
"""Radius of the arcs that lead in and out, as a share of that of the hole."""
SLOWER = 0.98
"""Share of the fastest speed of the plan at which a hole is cut that cannot be as fast as asked."""
COLUMNS = (
    "robot", "holes", "before mm", "worst", "as asked", "rest mm", "worst", "slower", "m/min",
    "rest mm", "worst", "no speed", "over a limit",
)  # fmt: skip
HOW = """\
Holes of radius 2.5 to 15 mm, each at 3, 6 and 9 m/min, in front of three arms, with arcs of 0.7 of
the radius that lead in and out; sigma 25 ms is assumed, and the controller rounds corners at
constant acceleration. Before: largest distance of the executed tip from the circle, median and
worst. As asked: holes whose targets can be moved so that it is 0.05 mm at most, with every limit
kept, and what is left. Slower: the others, at the speed that is stated for them (median); where the
plan itself cannot be as fast as asked, before is at the speed of the plan. Over a limit: of these
motions, those that need more than a limit at one of 50 samples to the interval, by inverse
kinematics."""


def hole(radius: float) -> Contour:
    """Return a dense circle with a quarter of a smaller one at both ends, from inside, m."""
    small, a, b = LEAD * radius, np.linspace(0, 2 * np.pi, 1601), np.linspace(0, np.pi / 2, 201)
    inner, whole = radius - small, np.c_[np.cos(a), np.sin(a), 0 * a]
    out = np.c_[inner + small * np.cos(b), small * np.sin(b), 0 * b]
    into = out[::-1] * [1.0, -1.0, 1.0]
    points = np.concatenate([into[:-1], radius * whole, out[1:]])
    kind = np.full(len(points), KINDS.index("cut"))
    kind[: len(into) - 1], kind[-len(out) :] = KINDS.index("lead-in"), KINDS.index("lead-out")
    axes = np.tile([0.0, 0.0, -1.0], (len(points), 1))
    return Contour(points, axes, kind=kind, name="hole")


def placed(machine: Robot) -> Array:
    """Return T_base_part of a part in front of a robot, level with its axis 2."""
    assert machine.reach is not None
    T = np.eye(4)
    T[:3, 3] = [0.6 * machine.reach, 0.1, 0.3 * machine.reach]
    return T


class Hole(NamedTuple):
    """One hole as asked: its path errors, m, and where it is refused the speed, m/s, and those."""

    robot: str
    before: float
    rest: float
    speed: float
    slower: float
    over: bool


def compensated_hole(key: tuple[str, float, float]) -> Hole | None:
    """Plan a hole, and compensate it, more slowly if need be; None if there is no plan."""
    name, radius, speed = key
    machine, path = arm(name), hole(radius)
    task = {"robot": machine, "tool": head(), "placement": placed(machine)}
    nodes = path.resample(spacing=SPACING)
    asked = True
    try:
        made = plan(nodes, **task, speed=speed, certify=None)  # type: ignore[arg-type]
    except NoFeasiblePath:
        asked, speed = False, min(SLOWER * fastest_speed(nodes, **task).speed, speed)  # type: ignore[arg-type]
        made = plan(nodes, **task, speed=speed, certify=None)  # type: ignore[arg-type]
    made = wider(made)
    compensator = by_model(path, ASSUMED)
    found = compensator.of(made)
    if asked and not found.failure:
        return Hole(name, found.before, found.rest, speed, np.nan, over(found))
    share = compensator.share(made)
    if share is None:
        return Hole(name, found.before, np.nan, speed, np.nan, False)
    slow = compensator.of(replace(made, time=made.time / share))
    return Hole(name, found.before, slow.rest, speed, share * speed, over(slow))


def wider(made: Plan) -> Plan:
    """Return a plan on a robot with room to retract."""
    limits = made.robot.joint_limits()
    room = made.robot.with_limits(lower=limits.lower - 0.2, upper=limits.upper + 0.2)
    return replace(made, robot=room)


def run_of(made: Plan, bounded: bool) -> Executed:
    """Return the run of a plan."""
    run = longest_run(build_program([made]), bounded=bounded)
    assert run is not None
    return run


def broken(made: Plan, run: Executed) -> str:
    """Return which limit a plan breaks, in words; empty if none."""
    if max(run.velocity_bound, run.acceleration_bound) > 1.001:
        return "a limit between the nodes"
    failed = [row for row in checks(made) if row.level == "error" and not row.ok]
    return str(failed[0].issue()) if failed else ""


def by_model(path: Contour, how: Response) -> Compensator:
    """Return the compensation along a path by a response."""
    return Compensator(
        path=path, response=how, tolerance=TOLERANCE, most=MOST, run=run_of, broken=broken
    )


def over(found: Compensation) -> bool:
    """Return whether a compensated motion exceeds a limit at one of many samples."""
    from benchmarks.execution import densest

    assert found.run is not None
    return densest(found.run, build_program([found.plan])) > 1.001


def _compensated(made: Sequence[Hole]) -> Report:
    rows = [_row(name, [each for each in made if name in (each.robot, "all")])
            for name in (*ROBOTS, "all")]  # fmt: skip
    return Report(
        title=f"Compensation by the model: {len(made)} holes",
        how=HOW,
        sheets=[Sheet(columns=COLUMNS, rows=rows)],
        findings=[],
    )


def _row(name: str, made: Sequence[Hole]) -> tuple[str, ...]:
    before, rest, slower = (
        np.array([getattr(each, of) for each in made]) for of in ("before", "rest", "slower")
    )
    asked = np.isnan(slower) & ~np.isnan(rest)
    later = ~np.isnan(slower)

    def two(values: Array) -> tuple[str, str]:
        if not len(values):
            return "-", "-"
        return f"{1e3 * np.median(values):.3f}", f"{1e3 * values.max():.3f}"

    return (
        name, str(len(made)), *two(before), str(asked.sum()), *two(rest[asked]), str(later.sum()),
        f"{60 * np.median(slower[later]):.2f}" if later.any() else "-", *two(rest[later]),
        str(np.isnan(rest).sum()), str(sum(each.over for each in made)),
    )  # fmt: skip


# -----------------------------------------------------------------------------
# Correction by measured runs: elastic joints with friction as the robot, a low-pass as the model.

ARM = "abb_irb6640_180_255"
TRIED = ((0.005, 0.03), (0.005, 0.05), (0.01, 0.05), (0.01, 0.08), (0.015, 0.08), (0.015, 0.1))
"""Radii, m, and speeds, m/s."""
NOISE = 5e-6
"""m: standard deviation of each coordinate of the measured tip."""
EVERY = 2
"""Samples of 2 ms from row to row of the logs."""
LOGS = 3
MEASURED_ROUNDS = 3
LEARNT_COLUMNS = (
    "radius mm", "m/min", "as drawn mm", "by the model", *(f"round {k + 1}" for k in range(3)),
    "noise mm", "share of a limit",
)  # fmt: skip
HOW_LEARNT = """\
Holes cut by a simulated ABB IRB 6640 whose joints give way and stick (`real`), by programs that are
compensated by a low-pass (`robotstudio`), and then corrected by the measured path of each run:
three logs of it every 4 ms, with 5 um of noise. Each number is the largest distance of the executed
tip from the circle. Noise: three standard deviations of the mean of the logs. Share of a limit: the
largest of velocity and acceleration in the last program, at any instant."""


def corrected_hole(key: tuple[float, float]) -> list[float]:
    """Return the largest distances of a hole as drawn, by the model, and by rounds.

    After them come the noise and the largest share of a limit.
    """
    radius, speed = key
    machine, path = robot(ARM), hole(radius)
    nodes = path.resample(spacing=SPACING)
    made = wider(
        plan(nodes, machine, tool=head(), placement=placed(machine), speed=speed, certify=None)
    )
    truth = replace(response(ARM, "real"), sigma_range=None)
    model = response(ARM, "robotstudio")
    rng = np.random.default_rng([1, int(radius * 1e6), int(speed * 1e6)])
    found = [_rest(made, path, truth)]
    by = by_model(path, model)
    now = replace(by, tolerance=1e-6).of(made)  # as near as it comes
    program = by.of(made).plan if now.failure else now.plan
    known = Correction()
    for _ in range(MEASURED_ROUNDS):
        found.append(_rest(program, path, truth))
        run = run_of(program, False)
        logs = [_logged(run, path, truth, rng, k) for k in range(LOGS)]
        by_now = program.contour.points - nodes.points
        known = correct(
            [(made, by_now)], [CommandedRun.of(run)], logs, known, gain=0.8, width=smoothing(model)
        )
        following = moved(made, known.displacement_at(nodes))
        assert following is not None
        program = following
    found.append(_rest(program, path, truth))
    run = run_of(program, True)
    most = max(run.velocity_bound, run.acceleration_bound)
    return [*found, known.contours["hole"].rounds[-1].noise, most]


def _rest(made: Plan, path: Contour, truth: Response) -> float:
    run = run_of(made, False)
    return path_error(run, path, timing=timing_of(run), response=truth).largest


def _logged(
    run: Executed, path: Contour, truth: Response, rng: np.random.Generator, number: int
) -> Log:
    """Return the tip in the base, every few samples, with noise."""
    T = path_error(run, path, timing=timing_of(run), response=truth).T
    tip = (run.T_base_part @ T)[rng.integers(EVERY) :: EVERY, :3, 3]
    return Log(name=f"log{number}", tip=tip + rng.normal(0, NOISE, tip.shape))


def _corrected(made: Sequence[Sequence[float]]) -> Report:
    rows = []
    for (radius, speed), (*found, share) in zip(TRIED, made, strict=False):
        shown = [f"{1e3 * each:.3f}" for each in found]
        rows.append((f"{radius * 1e3:g}", f"{speed * 60:g}", *shown, f"{share:.2f}"))
    return Report(
        title="Correction by measured runs",
        how=HOW_LEARNT,
        sheets=[Sheet(columns=LEARNT_COLUMNS, rows=rows)],
        findings=[],
    )


def compensation_reports(*, quick: bool) -> list[Report]:
    """Measure both."""
    radii = RADII[[3]] if quick else RADII
    keys = [
        (name, float(r), v) for name in ROBOTS for r in radii for v in SPEEDS[: 1 if quick else 3]
    ]
    made = in_processes(compensated_hole, keys, 1 if quick else 2)
    tried = TRIED[1:2] if quick else TRIED
    learnt = in_processes(corrected_hole, tried, 1 if quick else 2)
    return [_compensated([each for each in made if each is not None]), _corrected(learnt)]
