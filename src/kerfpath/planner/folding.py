"""Joints with a wide range count as endless for a search, whose motion is then put on their turns.

A joint that turns 360 deg either way has each pose on two turns, and six of them have it on 64. On
one turn each, modulo 2 pi, the layers are as much smaller. Every motion within the ranges is one of
them, with the same increments: nothing better is lost, and where they have no motion there is none.
Only a motion that winds further than a range is sought again, with that joint on all its turns.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from kerfpath.arrays import Bools
from kerfpath.certifier import foldable
from kerfpath.kernels.turns import EDGE
from kerfpath.options import EXACT_OR_BETTER, PlanOptions
from kerfpath.plans import Plan, has_room, on_turns
from kerfpath.robots import Robot

WIDE = 3 * np.pi
"""rad: least range of a joint that is folded. Poses on two turns are few below it, and a motion
that turns the joint by no more than half a turn always fits."""
CLOSED = 1e-6
"""rad: largest difference of a joint at the ends of a periodic motion, for rounding."""


def folds(robot: Robot, options: PlanOptions, dt: float) -> Bools:
    """Return which joints (n,) a search may fold, for nodes `dt` s apart.

    None are if turns have a price or a limit of their own, and for the methods of the paper. A
    joint that keeps a margin to a singularity stays on its side of it, so it is not folded.
    """
    limits, comfort = robot.joint_limits(), options.comfort
    priced = comfort is not None and comfort.limits is not None and comfort.limits.cost > 0
    if priced or options.rotation is not None or options.method not in EXACT_OR_BETTER:
        return np.zeros(robot.joints, np.bool_)
    joints = foldable(robot, options.eta_v * robot.velocity_limits() * dt)
    joints &= limits.upper - limits.lower >= WIDE
    joints[robot.free] = False
    if comfort is not None:
        joints[comfort.bent(robot)] = False
    joints[(limits.rows != 0).any(axis=0)] = False
    return joints


def within_ranges(robot: Robot, planned: Callable[[Bools], Plan]) -> Plan:
    """Return the plan of a robot, from one that is planned with joints folded.

    Parameters
    ----------
    robot : Robot
        The robot with all its ranges.
    planned : callable
        Returns the plan with joints folded, except some (n,); it is called again with those whose
        motion does not fit into their ranges.
    """
    return all_within_ranges(robot, lambda unfold: [planned(unfold)])[0]


def all_within_ranges(robot: Robot, planned: Callable[[Bools], list[Plan]]) -> list[Plan]:
    """Return the plans of a robot, as `within_ranges` returns one."""
    unfold = np.zeros(robot.joints, np.bool_)
    while True:
        found = [unfolded(made, robot) for made in planned(unfold)]
        beyond = np.any([out for _, out in found], axis=0)
        if not beyond.any():
            return [made for made, _ in found]
        unfold = unfold | beyond


def unfolded(made: Plan, robot: Robot) -> tuple[Plan, Bools]:
    """Return a plan of the folded robot on the turns of `robot` that are furthest from its limits.

    Also returned is which joints (n,) do not fit there, and are to be sought on all their turns.
    """
    folded = made.robot.endless & ~robot.endless
    if not folded.any():
        return replace(made, robot=robot), folded
    limits, asked = robot.joint_limits(), made.settings
    way = made.unwrapped
    low, high = way.min(axis=0), way.max(axis=0)
    centre = np.where(folded, (limits.lower + limits.upper - low - high) / 2, 0.0)
    shift = 2 * np.pi * np.round(centre / (2 * np.pi))
    margin = asked.comfort.limits.margin if asked.comfort and asked.comfort.limits else 0.0
    out = np.maximum(limits.lower - (low + shift), high + shift - limits.upper)
    beyond = out + margin > EDGE
    if asked.closure == "periodic":
        beyond |= np.abs(way[-1] - way[0]) > CLOSED
    q = made.q + np.where(folded, 2 * np.pi * np.round((way + shift - made.q) / (2 * np.pi)), 0.0)
    if asked.retract is not None:
        ends = [0, -1]
        at = q[ends], made.posture[ends], made.T_flange_tip
        lost = has_room(asked, made.robot, *at) & ~has_room(asked, robot, *at)
        beyond |= lost.any()
    q, turn = on_turns(robot, q)
    return replace(made, robot=robot, q=q, turn=turn), folded & beyond
