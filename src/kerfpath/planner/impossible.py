"""Proofs that a task has no motion at any gamma, posture and turn, and what would allow one."""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt

import numpy as np

from kerfpath.arrays import Array, Ints
from kerfpath.certifier import MotionTest
from kerfpath.compiling import finish_compiling
from kerfpath.effort import current_effort
from kerfpath.errors import Closed, NoFeasiblePath, Relaxation
from kerfpath.limits import rates_of
from kerfpath.planner.collision_free import CollisionFreeSearch
from kerfpath.planner.layers import longest_step
from kerfpath.planner.quickest import QuickMotion, quick_motions, quickest_along
from kerfpath.planner.statements import at_least, at_most
from kerfpath.planner.task import Task
from kerfpath.plans import Plan, Proof
from kerfpath.search import ContinuousPath
from kerfpath.tolerances import LIMIT_MARGIN

FAR_OUTSIDE = 4.0
"""Share of (6) that a path must need somewhere before a proof that none is possible is tried."""
BINDS, APART = 0.9, 3
"""Share of the limits, in speed, from which they bind at a node; and distance in nodes that further
binding nodes keep."""
MUCH = 2.0
"""Multiple of the node interval up to which a quicker motion is looked for where it is proved that
none is quick enough: what is slower is advice enough."""
MOST_PLACES = 4
"""Most binding nodes around which a proof is tried for one speed."""
MOST_PARTS, FEW_TUBES = 2, 8
"""Most binding nodes around which motions are divided into tubes, and the share of the most tubes
that each such part takes: a proof that one of them gives ends early, and others take long."""
FAR, CLOSE = 300.0, 1.02
"""Largest factor on the speed that is tried to find an impossible speed; and the factor to which
the impossible speed is then narrowed down."""


def motion_test(task: Task) -> MotionTest | None:
    """Return the test of a task for motions at any gamma; None if nothing can be proved.

    Other constraints of a plan (cell, comfort, closure, rotation limits) only leave fewer motions.
    """
    asked = task.settings
    if not task.robot.encloses or asked.tilt is not None:
        return None
    finish_compiling()
    frames = task.setup.placement @ task.contour.frames(asked.frames)
    return MotionTest(task.robot, frames, task.setup.tool, asked.postures)


def at_any_gamma(
    broken: NoFeasiblePath, task: Task, motions: Sequence[QuickMotion] = ()
) -> NoFeasiblePath:
    """Return the answer of a search without a path, with whether it is proved at every gamma.

    It is tried first around the nodes that bind `motions`, each quicker than the one before, where
    it takes least work; and at last by dividing motions into tubes, from where limits bind the
    quickest of them.
    """
    test = motion_test(task)
    if test is None or task.settings.feed == "dip":
        return broken
    limits = task.problem.limits
    nodes = binding_nodes(motions)[:MOST_PLACES] if motions else [broken.node + 1]
    binding = (motions[-1].plan.gamma, motions[-1].plan.posture) if motions else None
    tried: list[tuple[int | None, int, tuple[Array, Ints] | None]]
    tried = [(around, 0, None) for around in (*nodes, None)]
    if tubes := current_effort().infeasibility_tubes:
        few = max(tubes // FEW_TUBES, 1)
        tried.append((nodes[0], few, binding))
        tried += [(node, few, None) for node in nodes[:MOST_PARTS]]
        tried.append((nodes[0], tubes, binding))
    tests = (
        test.closed(limits, task.dt, around, tubes=most, binding=about)
        for around, most, about in tried
    )
    closed = next((found for found in tests if found is not None), None)
    if closed is None:
        return broken.with_message(f"{broken}; whether there is a motion off the grid is undecided")
    if not broken.proved:
        return proved_impossible(task, closed)
    return broken.with_message(f"{broken}; proved for every rotation: {closed}", closed=closed)


def refuse_impossible(
    task: Task, finder: CollisionFreeSearch, paths: Sequence[ContinuousPath]
) -> None:
    """Raise NoFeasiblePath if all paths exceed (6) by far and, where they do, no motion can pass.

    It is for speeds that are much too high: a proof about a few nodes takes little time compared
    with refinements of all of them that cannot end inside the limits. With a path at a lower speed,
    the answer says which.
    """
    claim = Proof(optimal=False, statement="a path of the search over continuous rotation")
    made = [task.plan_between(path, claim) for path in paths]
    needed = [np.abs(plan.acceleration_share).max(axis=1, initial=0.0) for plan in made]
    most = min((float(share.max(initial=0.0)) for share in needed), default=0.0)
    if most <= FAR_OUTSIDE * task.settings.eta_a:
        return
    test = motion_test(task)
    if test is None:
        return
    gentlest = sorted(range(len(made)), key=lambda i: float(np.median(needed[i])))
    closed = test.closed(task.problem.limits, task.dt, int(needed[gentlest[0]].argmax()) + 1)
    if closed is None:
        return
    broken = proved_impossible(task, closed)
    for i in gentlest if can_be_slower(task) else ():
        slower = quickest_along(task, finder, paths[i])
        if slower is not None:
            if slower.dt < MUCH * task.dt:
                *_, quickest = quick_motions(task, finder, wanted=task.dt)
                slower = quickest.plan
            raise with_relaxation(broken, task, slower)
    raise broken


def proved_impossible(task: Task, closed: Closed) -> NoFeasiblePath:
    """Return the answer that no motion passes a place."""
    return NoFeasiblePath(
        f"contour {task.contour.name!r}: no motion keeps the limits at any rotation, which is "
        f"proved: {closed}",
        proved=True,
        node=closed.node,
        closed=closed,
    )


def can_be_slower(task: Task) -> bool:
    """Return whether the search for quickest motions supports all that a task asks for."""
    asked, held = task.settings, task.problem.limits
    priced = asked.comfort is not None and asked.comfort.prices_clearance
    unknown = held.torque is not None or held.jerk is not None
    return not (asked.closure == "periodic" or priced or unknown)


def limit_shares(task: Task, made: Plan) -> tuple[float, float]:
    """Return the largest shares of the velocities and accelerations of a motion of a task."""
    limits = task.problem.limits
    v, a = rates_of(made.increments, np.full(len(task.contour) - 1, task.dt))
    fast, sharp = (
        float((np.abs(rates) / usable).max(initial=0.0))
        for rates, usable in (
            (v, limits.velocity.usable),
            (a, limits.acceleration.usable_at(made.unwrapped[1:-1])),
        )
    )
    return fast, sharp


def interval_of(task: Task, made: Plan) -> float:
    """Return the interval, s, in which the joints of a plan keep (5) and (6); NaN out of reach."""
    fast, sharp = limit_shares(task, made)
    return float(task.dt * np.maximum(fast, np.sqrt(sharp)))


def speed_at(task: Task, dt: float) -> str:
    """Return the speed along the contour of a task with `dt` s between its nodes, in words."""
    return f"{at_most(longest_step(task.contour) / dt * 60, 3)} m/min"


def with_relaxation(broken: NoFeasiblePath, task: Task, quick: Plan) -> NoFeasiblePath:
    """Return an answer without a path, with the lower speed or higher limits that would suffice.

    They are those of the quickest motion found, which is slower than asked for; the figures are
    rounded so that they hold as printed. With a limit on the rotation, which quickest motions need
    not keep, the answer stays as it is.
    """
    if task.settings.rotation is not None:
        return broken
    shares = limit_shares(task, quick)
    fast, sharp = (float(at_least(max(1.0, share * (1 + LIMIT_MARGIN)))) for share in shares)
    needed = Relaxation(speed=float(at_most(task.dt / quick.dt)), velocity=fast, acceleration=sharp)
    limits_said = " and ".join(
        f"{value:g} times the {what}"
        for value, what in ((fast, "velocities"), (sharp, "accelerations"))
        if value > 1
    )
    said = f"a motion was found at {needed.speed:g} of the speed, and at the speed asked for with "
    return broken.with_message(f"{broken}; {said}{limits_said}", relaxation=needed)


def impossible_share(task: Task, reached: float, nodes: Sequence[int]) -> float | None:
    """Return an interval, as a share of `reached` s, that is too short for any motion at any gamma.

    This is proved, and holds for every shorter interval, too; None if nothing is proved. `nodes`
    are those where limits bind a motion with the interval `reached`, the most binding one first.
    """
    test = motion_test(task)
    if test is None:
        return None
    limits = task.problem.limits

    def impossible(times: float, around: int | None, *, brief: bool = False) -> bool:
        """Return whether no motion is this many times as fast, tested around a node or at all."""
        return test.closed(limits, reached / times, around, brief=brief) is not None

    low, high = 1.0, 2.0
    while not any(impossible(high, around) for around in (*nodes[:1], None)):
        low, high = high, high * high
        if high > FAR:
            return None
    for node in nodes:
        # The part around another node may be closed at a lower speed, too.
        least = low if node == nodes[0] else 1.0
        if not impossible(high / CLOSE, node, brief=node != nodes[0]):
            continue
        high /= CLOSE
        while high > CLOSE * least:
            middle = sqrt(least * high)
            if impossible(middle, node):
                high = middle
            else:
                least = middle
    return 1 / high


def binding_nodes(motions: Sequence[QuickMotion]) -> list[int]:
    """Return nodes where limits bind successively faster motions, that of the quickest first.

    They are the binding node of each motion, and nodes where limits nearly bind the quickest one,
    at most `Effort.binding_nodes`, not close to each other.
    """
    plan = motions[-1].plan
    velocity = np.abs(plan.velocity_share).max(axis=1) / plan.settings.eta_v
    acceleration = np.abs(plan.acceleration_share).max(axis=1) / plan.settings.eta_a
    used = np.zeros(len(plan.q))
    used[1:] = velocity
    used[1:-1] = np.maximum(used[1:-1], np.sqrt(acceleration))
    used[used < BINDS * used.max()] = 0.0
    near = np.argsort(-used, kind="stable")[: np.count_nonzero(used)]
    nodes: list[int] = []
    for node in [*(motion.at.node for motion in reversed(motions)), *near.tolist()]:
        if all(abs(node - other) > APART for other in nodes):
            nodes.append(node)
    return nodes[: current_effort().binding_nodes]
