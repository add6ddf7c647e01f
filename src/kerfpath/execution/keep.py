"""A plan that keeps the joint limits between the nodes, too, when its program runs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from kerfpath.arrays import Array, Ints, short_repr
from kerfpath.execution.executed import Executed, Peak, executed
from kerfpath.limits import meetings
from kerfpath.plans import Plan
from kerfpath.post import PLAIN, Controller, Program, build_program
from kerfpath.refiner import KeptShares, refine

ROUNDS = 10
"""Largest number of refinements, unless another is asked for; the first two or three do most of the
work."""
AIM = 0.998
"""Share of the limits that is aimed at: proved bounds are a little above the true values."""
CLOSER = 0.003
"""Reduction of the aim if only the proof is missing."""
LEAST = 0.05
"""Smallest share of a limit that is left to a node."""
PROGRAMS = 12
"""Most convex programs of each descent in a refinement: one that needs more ends far away."""
AWAY = 1.2
"""Multiple of the least need so far from which on a motion is another one, which is left."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Kept:
    """Result of `keep_limits`.

    Parameters
    ----------
    plan : Plan
        The plan whose program keeps the limits; the given plan if `done` is False.
    done : bool
        Whether it is proved that no joint exceeds a limit at any instant of the program.
    rounds : int
        Number of refinements.
    run : Executed or None
        The run of that plan; None if the robot stops at every node.
    statement : str
        What was done, or which limit is exceeded, where, and what would help.
    """

    plan: Plan
    done: bool
    rounds: int
    run: Executed | None
    statement: str

    __repr__ = short_repr


def _alone(plan: Plan) -> Program:
    return build_program([plan])


def keep_limits(
    plan: Plan,
    program: Callable[[Plan], Program] = _alone,
    *,
    controller: Controller = PLAIN,
    rounds: int = ROUNDS,
) -> Kept:
    """Return a plan whose program keeps every limit of velocity and acceleration at every instant.

    Where the motion of the program (see `executed`) needs more of a limit than the nodes, the limit
    at the nodes is reduced by the difference and the plan is refined again, until the bounds that
    hold at every instant are within the limits. Speed, nodes, postures and turns stay; only gamma
    changes.

    Parameters
    ----------
    plan : Plan
    program : callable
        Returns the program of a plan; default: `build_program` with automatic zones.
    controller : Controller
        As in `executed`.
    rounds : int
        Largest number of refinements.

    Raises
    ------
    InputError
        As `executed`.
    """
    first = run = longest_run(program(plan), controller)
    if first is None or run is None:
        return Kept(plan=plan, done=True, rounds=0, run=None, statement="it stops at every node")
    intervals, n = np.diff(plan.q, axis=0).shape
    into, _ = meetings(intervals, periodic=plan.settings.closure == "periodic")
    kept = KeptShares(np.ones((intervals, n)), np.ones((len(into), n)))
    made, aim, why = plan, AIM, "lower limits at the nodes do not reduce it"
    least = np.inf
    for count in range(rounds + 1):
        if max(run.velocity_bound, run.acceleration_bound) <= 1:
            statement = "it keeps the limits between the nodes, too"
            return Kept(plan=made, done=True, rounds=count, run=run, statement=statement)
        if count == rounds:
            break
        worst = run.most
        if np.isinf(worst) or np.isinf(run.acceleration_bound):
            why = run.sampled or "nothing can be proved there for this arm"
            break
        if worst > 1 >= max(run.peak_velocity.share, np.abs(_in_zones(run)).max()):
            why = "the straight stretch between two zones needs that, whatever the nodes do"
            break
        aim -= CLOSER if worst <= 1 else 0.0
        kept = _held(made, run, kept, aim)
        refined = refine(made, kept=kept, most=PROGRAMS)
        if not refined.done:
            why = refined.statement.removeprefix("not refined: ")
            break
        made = refined.plan
        run = longest_run(program(made), controller) or run
        least = min(least, worst)
        if run.most > AWAY * least:
            break
    statement = _need(plan, first, why)
    return Kept(plan=plan, done=False, rounds=count, run=first, statement=statement)


def longest_run(
    program: Program, controller: Controller = PLAIN, *, bounded: bool = True
) -> Executed | None:
    """Return the run with the most targets in a program of one plan, its cut; None without one.

    It has proved bounds if `bounded`, see `executed`.
    """
    runs = executed(program, controller=controller, bounded=bounded)
    return max(runs, key=lambda each: len(each.tool_motion.T), default=None)


def _held(plan: Plan, run: Executed, kept: KeptShares, aim: float) -> KeptShares:
    """Return the shares of the limits, reduced where the run needs more than the aim.

    The difference of the needs between the nodes and at them is assumed to stay the same.
    """
    settings, time = plan.settings, plan.time - plan.time[0]
    intervals, nodes = len(kept.velocity), len(kept.acceleration)
    of_interval = np.clip(np.searchsorted(time, run.planned) - 1, 0, intervals - 1)
    # The run ends where the plan does: of a closed contour at the node that it began with.
    of_node = np.abs(run.planned[:, None] - time[None]).argmin(axis=1) - 1
    v, a = plan.velocity_share, np.zeros_like(kept.acceleration)
    a[: intervals - 1] = plan.acceleration_share  # the robot stops at a seam
    return KeptShares(
        _less(kept.velocity, v, run.velocity_share, of_interval, aim, settings.eta_v),
        _less(
            kept.acceleration, a, _in_zones(run), np.clip(of_node, 0, nodes - 1), aim,
            settings.eta_a,
        ),
    )  # fmt: skip


def _in_zones(run: Executed) -> Array:
    """Return the needed shares of acceleration limits (m, n) in zones; 0 on straight stretches.

    What a straight stretch needs does not depend on the corners at its ends.
    """
    motion = run.tool_motion
    after = np.searchsorted(motion.time, run.time).clip(1, len(motion.time) - 1)
    zone = [np.abs(run.time - motion.time[k]) < motion.half[k] for k in (after - 1, after)]
    return np.asarray(np.where((zone[0] | zone[1])[:, None], run.acceleration_share, 0.0))


def _less(kept: Array, own: Array, needed: Array, place: Ints, aim: float, eta: float) -> Array:
    """Return shares (M, n), smaller where the needs (m, n) at places (m,) exceed the aim."""
    most = np.zeros_like(kept)
    np.maximum.at(most, place, np.abs(needed))
    allowed = np.maximum(aim - (most - np.abs(own)), LEAST) / eta
    return np.where(most > aim, np.minimum(kept, allowed), kept)


def _need(plan: Plan, run: Executed, why: str) -> str:
    """Return what a plan needs between its nodes, why that is not reduced, and what would help."""
    velocity, acceleration = run.peak_velocity, run.peak_acceleration
    fast = velocity.share > 1
    peak, what = (velocity, "velocity") if fast else (acceleration, "acceleration")
    joint = plan.robot.joint_names[peak.joint]
    at = np.interp(peak.time, run.time, run.planned)
    s = np.interp(at, plan.time - plan.time[0], plan.contour.s)
    sentence = (
        f"between the nodes {joint} needs {peak.share:.3g} of its {what} limit at "
        f"s = {s * 1000:.1f} mm, and {why}"
    )
    if not np.isfinite(peak.share):
        return sentence
    if peak.share > 1:
        slower = max(velocity.share, np.sqrt(acceleration.share))
        share = np.floor(99 / slower) / 100
        sentence += f"; at {share:.0%} of the speed the plan keeps the limits as it is"
    return sentence if fast else sentence + _wider(run, peak)


def _wider(run: Executed, peak: Peak) -> str:
    """Return the spacing of nodes, or the zone error, with which zones would meet."""
    motion = run.tool_motion
    k = int(np.clip(np.abs(motion.time - peak.time).argmin(), 1, len(motion.time) - 2))
    share = 2 * motion.half[k] / min(motion.duration[k - 1], motion.duration[k])
    if share > 0.9:
        return ""
    steps = np.diff(motion.T[k - 1 : k + 2, :3, 3], axis=0)
    gaps = np.linalg.norm(steps, axis=1)
    passed = float(np.linalg.norm(np.diff(steps / gaps[:, None], axis=0)) * gaps.min() / 8)
    return (
        f"; the zone there takes {share:.0%} of the way to the next node; nodes at most "
        f"{gaps.min() * np.sqrt(share) * 1000:.2g} mm apart, or a zone error of "
        f"{passed * 1000:.2g} mm, would let the zones meet"
    )
