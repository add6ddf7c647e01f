"""A plan on other turns of its joints, which cost the same and may be nearer."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np

from kerfpath.arrays import Array, Bools
from kerfpath.kernels.metric import increments_between
from kerfpath.plans import Plan
from kerfpath.transfer.move import least_time

SAME_TURN = 1e-9
"""Share of a turn by which rounding may take a joint beyond the room that it keeps."""


def _turns(made: Plan, room: Array) -> tuple[Bools, Array, Array]:
    """Return which joints (n,) may turn as a whole, and the least and most turns (n,) of each.

    They keep `room` (n,) rad to their limits.
    """
    robot, limits = made.robot, made.robot.joint_limits()
    free = ~limits.endless & (np.arange(robot.joints) < robot.family.joints)
    for coupling in robot.couplings:
        free &= coupling.row[: len(free)] == 0
    low, high = made.q.min(axis=0), made.q.max(axis=0)
    least = np.ceil((limits.lower + room - low) / (2 * np.pi) - SAME_TURN)
    most = np.floor((limits.upper - room - high) / (2 * np.pi) + SAME_TURN)
    return free, np.where(free, least, 0), np.where(free, most, 0)


def _turned_by(made: Plan, turns: Array) -> Plan:
    whole = turns.astype(np.int64)
    return replace(made, q=made.q + 2 * np.pi * whole, turn=made.turn + whole)


def on_nearest_turns(
    made: Plan, before: Array | None, after: Array | None, most: int
) -> list[Plan]:
    """Return a plan on those turns of its joints from and to which straight moves are quickest.

    The joints stay within their limits, and keep the margin to them that its settings ask for.

    Parameters
    ----------
    made : Plan
    before, after : (n,) rad, optional
        Joints that the move to the start comes from, and that the move from the end goes to.
    most : int
        Most plans that are returned, the quickest first.
    """
    robot, s = made.robot, made.settings
    limits = None if s.comfort is None else s.comfort.limits
    _, least, last = _turns(made, np.full(robot.joints, 0.0 if limits is None else limits.margin))
    each = [np.arange(one, two + 1) for one, two in zip(least, last, strict=True)]
    turns = np.array(list(product(*each)))
    velocity, acceleration = robot.speed_limits()
    took = np.zeros(len(turns))
    for q, aim in ((made.unwrapped[0], before), (made.unwrapped[-1], after)):
        if aim is not None:
            way = increments_between(
                np.tile(aim, (len(turns), 1)), q + 2 * np.pi * turns, robot.endless
            )
            took += least_time(way, s.eta_v * velocity, s.eta_a * acceleration)
    return [_turned_by(made, turns[k]) for k in np.argsort(took, kind="stable")[:most]]


def on_near_turns(made: Plan, *aims: Array | None) -> list[Plan]:
    """Return a plan, and on the turns of its joints that are nearest to aims (n,) rad.

    None stands for the middle of the joint ranges. Joints keep as far from their limits as before,
    or half a turn.
    """
    limits = made.robot.joint_limits()
    low, high = made.q.min(axis=0), made.q.max(axis=0)
    room = np.minimum(np.minimum(low - limits.lower, limits.upper - high), np.pi)
    free, least, most = _turns(made, room)
    found, known = [made], {(0,) * made.robot.joints}
    for aim in aims:
        centre = (limits.lower + limits.upper) / 2 if aim is None else aim
        wanted = np.where(free, np.round((centre - made.q.mean(axis=0)) / (2 * np.pi)), 0)
        turns = np.where(free, np.clip(wanted, least, most), 0)
        if tuple(turns.tolist()) not in known:
            known.add(tuple(turns.tolist()))
            found.append(_turned_by(made, turns))
    return found
