"""Whether a task has a motion at all, at any gamma, posture and turn."""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt

import numpy as np

from kerfpath.certifier import MotionTest
from kerfpath.errors import NoFeasiblePath, Relaxation
from kerfpath.limits import rates_of
from kerfpath.planner._quickest import QuickMotion
from kerfpath.planner._task import PlanningTask
from kerfpath.planner._words import at_least, at_most

__all__ = [
    "at_any_gamma",
    "binding_nodes",
    "impossible_share",
    "motion_test",
    "with_relaxation",
]

MOST_NODES = 5_000
"""Nodes up to which cells of all of them are held at once: some 200 MB."""
BINDS, APART, MOST_BINDING = 0.9, 3, 12
"""Share of the limits, in speed, from which they bind at a node; how many nodes apart others are;
and how many are looked at."""
SLACK = 1e-6
"""Share of a limit that is left free against rounding."""
FAR, CLOSE = 300.0, 1.02
"""Multiples of a speed: up to which one that is impossible is looked for, and how close to the
fastest that may be possible."""


def motion_test(task: PlanningTask) -> MotionTest | None:
    """Return the test of a task for motions at any gamma; None where nothing can be proved.

    What else a plan keeps (a cell, comfort, a closure, a limit on the rotation) only leaves fewer.
    """
    asked = task.settings
    if not task.robot.encloses or asked.tilt is not None or len(task.contour) > MOST_NODES:
        return None
    frames = task.T_base_part @ task.contour.frames(asked.frames)
    return MotionTest(task.robot, frames, task.T_flange_tip, asked.postures)


def at_any_gamma(broken: NoFeasiblePath, task: PlanningTask) -> NoFeasiblePath:
    """Return what a search found to be broken, and whether it is so at every gamma."""
    test = motion_test(task)
    if test is None or task.settings.feed == "dip":
        return broken
    limits = task.problem.limits
    closed = test.closed(limits, task.dt) or test.closed(limits, task.dt, broken.node + 1)
    if closed is None:
        return broken.with_message(f"{broken}; whether there is a motion off the grid is undecided")
    return broken.with_message(f"{broken}; proved for every rotation: {closed}", closed=closed)


def with_relaxation(
    broken: NoFeasiblePath, task: PlanningTask, quick: QuickMotion
) -> NoFeasiblePath:
    """Return what is broken, and how much less speed or how much more of the limits would do.

    Of the quickest motion found, slower than asked for: figures that keep what they say.
    """
    limits = task.problem.limits
    v, a = rates_of(quick.plan.increments, np.full(len(task.contour) - 1, task.dt))
    shares = (
        float((np.abs(rates) / limit.usable).max(initial=0.0))
        for rates, limit in ((v, limits.velocity), (a, limits.acceleration))
    )
    fast, sharp = (float(at_least(max(1.0, share * (1 + SLACK)))) for share in shares)
    needed = Relaxation(speed=float(at_most(task.dt / quick.dt)), velocity=fast, acceleration=sharp)
    limits_said = " and ".join(
        f"{value:g} times the {what}"
        for value, what in ((fast, "velocities"), (sharp, "accelerations"))
        if value > 1
    )
    said = f"a motion was found at {needed.speed:g} of the speed, and at the speed asked for with "
    return broken.with_message(f"{broken}; {said}{limits_said}", relaxation=needed)


def impossible_share(task: PlanningTask, reached: float, nodes: Sequence[int]) -> float | None:
    """Return an interval, as a share of `reached` s, too short for any motion at any gamma.

    Proved for it and so for every shorter one; `nodes` are where limits bind a motion that takes
    `reached`, most of all at the first. None where nothing is proved.
    """
    test = motion_test(task)
    if test is None:
        return None
    limits = task.problem.limits

    def impossible(times: float, around: int | None) -> bool:
        """Return whether no motion is so many times as fast, by what is about a node or by all."""
        return test.closed(limits, reached / times, around) is not None

    low, high = 1.0, 2.0
    while not any(impossible(high, around) for around in (*nodes[:1], None)):
        low, high = high, high * high
        if high > FAR:
            return None
    for node in nodes:
        # What is about another node may be closed at a lower speed, too.
        least = low if node == nodes[0] else 1.0
        if not impossible(high / CLOSE, node):
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
    """Return the nodes where limits bind ever quicker motions, that of the quickest first.

    Where a limit binds each, and where limits nearly bind the quickest: some of them, not close to
    each other.
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
    return nodes[:MOST_BINDING]
