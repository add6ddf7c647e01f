"""Motions that cost nearly the same, turned about the beam or in another posture.

They are for shorter moves before and after a cut.

Where the last joint turns about the beam, a motion costs the same at every rotation of the head,
and the one at which it is found is arbitrary. The moves between cuts are shorter if neighbouring
cuts begin and end with the head turned alike. With other heads a few rotations cost nearly the
same.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kerfpath.arrays import Array
from kerfpath.cell import Cell
from kerfpath.kernels.metric import increments_between, wrap
from kerfpath.plans import Plan, on_turns, path_cost
from kerfpath.refiner import JointCurves, refine
from kerfpath.transfer import least_time

ALIKE = 0.01
"""Relative extra cost up to which a turned motion counts as good as the motion itself."""
HOPELESS = 0.1
"""The same from which on a turned motion is not refined: on the B-pillar, those that became good
began below 0.025."""
ROTATIONS = 180
"""Number of rotations about the beam that are compared."""
APART = np.radians(20)
"""rad: least difference between two rotations that are tried."""
TRIES = 2
"""Most rotations that are refined, those with the shortest moves first."""
QUICKER = 1e-3
"""s: least time that a turned motion saves in the moves to and from it."""
OTHERS = 1e-3
"""Weight of the times of all joints beside that of the slowest one, so that no joint moves without
need."""
FIRST_STEP = 5e-3
"""rad: first change of gamma when a turned motion is refined."""


def turned(made: Plan, before: Array, after: Array, cell: Cell | None = None) -> Plan | None:
    """Return a motion turned about the beam, with shorter moves to its start and from its end.

    It is refined with gamma held at both ends, and costs at most `ALIKE` more. None is returned if
    no rotation that is tried gives one, or if the motion cannot be turned: it is planned on a grid,
    at a reduced feed, in several postures or with free joints.

    Parameters
    ----------
    made : Plan
    before, after : (n,) rad
        Joints that the move to the start comes from, and that the move from the end goes to.
    cell : Cell, optional
        Cell in which the turned motion is clear.
    """
    if not _may_turn(made):
        return None
    by = 2 * np.pi * np.arange(ROTATIONS) / ROTATIONS
    start, end = _at_node(made, 0, by, before), _at_node(made, -1, by, after)
    time = _move_times(made, start, before) + _move_times(made, end, after)
    way, tried, refined = made.unwrapped, list[float](), 0
    now = _move_times(made, way[:1], before) + _move_times(made, way[-1:], after)
    for k in np.argsort(time, kind="stable"):
        if refined == TRIES or not time[k] < now[0] - QUICKER:
            break
        if any(abs(wrap(by[k] - other)) < APART for other in tried):
            continue
        tried.append(by[k])
        begun = _begun(made, by[k], way + (start[k] - way[0]))
        if begun is None:
            continue
        refined += 1
        found = _refined(begun, made.cost, held=True)
        if found is not None and (cell is None or cell.clear_through(found.unwrapped)):
            return found
    return None


def in_other_postures(made: Plan, cell: Cell | None = None) -> list[Plan]:
    """Return the motion in other postures where it costs at most `ALIKE` more.

    It begins at the same rotation about the beam and is refined. Where a wrist is spherical, its
    other posture costs the same. None is returned for motions that `turned` does not turn.

    Parameters
    ----------
    made : Plan
    cell : Cell, optional
        Cell in which the motions are clear.
    """
    if not _may_turn(made) or made.settings.floor is not None:
        return []
    robot, every = made.robot, made.settings.postures
    limits = robot.joint_limits()
    found = []
    for posture in range(robot.postures) if every is None else every:
        if posture == made.posture[0]:
            continue
        there = replace(made, posture=np.full(len(made.q), posture))
        curves = JointCurves(robot, made.frames, made.T_flange_tip, there.posture)
        way = np.unwrap(curves.at(made.gamma[:, None], made.unwrapped), axis=0)
        if not np.isfinite(way).all():
            continue
        bound, centre = ~limits.endless, (way.min(axis=0) + way.max(axis=0)) / 2
        middle = np.where(bound, (limits.lower + limits.upper) / 2, centre)
        way = way + 2 * np.pi * np.round((middle - centre) / (2 * np.pi))
        begun = _begun(there, 0.0, way)
        one = None if begun is None else _refined(begun, made.cost, held=False)
        if one is not None and (cell is None or cell.clear_through(one.unwrapped)):
            found.append(one)
    return found


def _may_turn(made: Plan) -> bool:
    """Return whether the motion may be turned about the beam as a whole."""
    robot, whole = made.robot, made.feed is None and not np.ptp(made.posture)
    by_gamma = robot.family.free_rotation and not robot.free.size
    return by_gamma and whole and made.settings.method == "continuous"


def _at_node(made: Plan, node: int, by: Array, near: Array) -> Array:
    """Return the joints (B, n) rad of a node at rotations `by` (B,), on the turns next to `near`.

    They are NaN out of reach.
    """
    B = len(by)
    frames = np.broadcast_to(made.frames[node], (B, 4, 4))
    curves = JointCurves(made.robot, frames, made.T_flange_tip, np.full(B, made.posture[node]))
    return curves.at((made.gamma[node] + by)[:, None], np.broadcast_to(near, (B, len(near))))


def _move_times(made: Plan, q: Array, aim: Array) -> Array:
    """Return the times (B,) of straight moves between joints q (B, n) rad and `aim` (n,).

    With a small share of the times of the other joints; infinite out of reach or range.
    """
    robot, s = made.robot, made.settings
    limits, (velocity, acceleration) = robot.joint_limits(), robot.speed_limits()
    outside = ~np.isfinite(q) | (q < limits.lower) & ~limits.endless
    outside |= (q > limits.upper) & ~limits.endless
    allowed = ~np.asarray(outside.any(axis=1))
    dq = np.where(allowed[:, None], increments_between(aim, q, robot.endless), 0.0)
    rates = s.eta_v * velocity, s.eta_a * acceleration
    alone = np.sum([least_time(dq * one, *rates) for one in np.eye(dq.shape[1])], axis=0)
    return np.asarray(np.where(allowed, least_time(dq, *rates) + OTHERS * alone, np.inf))


def _begun(made: Plan, by: float, near: Array) -> Plan | None:
    """Return the motion turned by an angle, rad, as it is; None out of reach, or if it is hopeless.

    Its joints are on the turns next to `near` (K, n) rad.
    """
    curves = JointCurves(made.robot, made.frames, made.T_flange_tip, made.posture)
    gamma, s = np.unwrap(made.gamma) + by, made.settings
    way = curves.at(gamma[:, None], near)
    if not np.isfinite(way).all():
        return None
    q, turn = on_turns(made.robot, way)
    begun = replace(made, q=q, turn=turn, gamma=gamma)
    cost = path_cost(begun.increments, s.weights, s.metric, s.objective, begun.node_cost)
    return None if cost > (1 + HOPELESS) * made.cost else replace(begun, cost=cost)


def _refined(begun: Plan, cost: float, *, held: bool) -> Plan | None:
    """Return a motion refined, with its ends `held` or not; None if it costs much more."""
    fixed = np.zeros((len(begun.q), 1), np.bool_)
    fixed[[0, -1]] = held
    low, high = (np.where(fixed, begun.gamma[:, None], far) for far in (-np.inf, np.inf))
    found = refine(begun, first=FIRST_STEP, within=(low, high) if held else None)
    dear = found.cost_after > (1 + ALIKE) * cost
    return found.plan if found.done and not dear else None
