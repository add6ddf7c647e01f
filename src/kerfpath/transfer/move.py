"""A transfer move: straight where that is clear, otherwise around obstacles, and its time."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from kerfpath.arrays import Array, floats, freeze
from kerfpath.cell import Cell
from kerfpath.errors import InputError, NoFeasiblePath
from kerfpath.extras import require_extra
from kerfpath.plans import Plan, TransferMove
from kerfpath.robots import Robot, posture_name, require_axes

# -----------------------------------------------------------------------------
# Explain a collision: which bodies a motion brings too close together, where and by how much.

SAMPLES = 65
"""Number of poses of a motion that are checked."""
PAIRS = 3
"""Number of pairs of bodies that are named."""


def explain_collision(cell: Cell, corners: Array) -> str:
    """Return which bodies come nearer than allowed on straight motions through corners (m, n) rad.

    The pair that is too near at the most poses comes first; each is given with its worst place.
    """
    steps = np.linspace(0, len(corners) - 1, SAMPLES)
    at = np.arange(len(corners))
    q = np.array([np.interp(steps, at, joint) for joint in corners.T]).T
    over = cell.distances(q) - cell.required
    hits = over <= 0
    worst = np.argsort(-hits.sum(axis=0), kind="stable")[:PAIRS]
    words = []
    for p in worst[hits[:, worst].any(axis=0)]:
        one, two = cell.pair_names[int(p)]
        k = int(np.argmin(over[:, p]))
        words.append(
            f"{one!r} and {two!r} come {-over[k, p] * 1e3:.3g} mm nearer than allowed "
            f"{100 * steps[k] / steps[-1]:.0f} % of the way"
        )
    if words:
        return "; ".join(words)
    k, p = (int(i) for i in np.unravel_index(np.argmin(over), over.shape))
    one, two = cell.pair_names[p]
    return (
        f"{one!r} and {two!r} keep {over[k, p] * 1e3:.3g} mm more than required where they are "
        "nearest, which is too little to prove clearance between the poses checked"
    )


# -----------------------------------------------------------------------------
# Back off along the tool axis before and after a cut.

End = Literal["start", "end"]


def back_off(plan: Plan, end: End, retract: float) -> Array:
    """Return the joints (n,) rad after backing off along the tool axis from an end of a plan.

    The posture is kept, endless joints stay on their turn, and external axes and the free joint
    of a seven-axis arm do not move.

    Parameters
    ----------
    plan : Plan
    end : {"start", "end"}
    retract : float m
        How far the tool backs off; 0: not at all, at the end itself.

    Raises
    ------
    InputError
        There is no such pose within the joint limits.
    """
    node = 0 if end == "start" else len(plan.q) - 1
    # Endless joints, not wrapped: with all their turns along the contour.
    q = plan.q[0] + plan.increments[:node].sum(axis=0)
    if retract == 0:
        return freeze(q)
    arm, n = plan.robot.arm, plan.robot.arm.joints
    T = arm.forward(q[:n]) @ plan.T_flange_tip
    T[:3, 3] -= retract * T[:3, 2]
    given = arm.given_of(q[None])
    found = plan.robot.alone().inverse(T @ np.linalg.inv(plan.T_flange_tip), given=given)
    q_found = found.q[found.posture == plan.posture[node]]
    q_found = np.hstack([q_found, np.tile(q[n:], (len(q_found), 1))])
    # An endless joint is solved within one turn: bring it onto the turn that the contour is on.
    turns = np.round((q - q_found) / (2 * np.pi)) * plan.robot.endless
    q_found = q_found + 2 * np.pi * turns
    # A straight move cannot reach joints that are a turn away.
    q_found = q_found[(np.abs(q_found - q) <= np.pi).all(axis=1)]
    if not len(q_found):
        raise InputError(
            f"contour {plan.name!r}, node {node}: the tool cannot back off by {retract * 1e3:g} mm "
            f"in posture {posture_name(int(plan.posture[node]))} within the joint limits; lower "
            "the retract"
        )
    nearest = q_found[int(np.argmin(np.abs(q_found - q).max(axis=1)))]
    return freeze(nearest)


# -----------------------------------------------------------------------------
# Find a way around obstacles by OMPL's RRT-Connect, and shorten it.

SEED = 1
"""Seed of the random samples: the same arguments give the same way."""
RANGE = 0.1
"""Longest branch of the tree, as a share of the diagonal of the scaled joint ranges."""
SHORTCUTS = 60
"""Number of attempts to shorten a way."""


def find_way_around(
    ends: Array,
    lower: Array,
    upper: Array,
    scale: Array,
    *,
    clear: Callable[[Array], bool],
    passable: Callable[[Array], bool],
    seconds: float,
) -> Array | None:
    """Return corners (m, n) of a clear way between ends (2, n), or None if none is found in time.

    Parameters
    ----------
    ends : (2, n) rad
        First and last joint vector.
    lower, upper : (n,) rad
        Bounds of the joints.
    scale : (n,) s/rad
        Scale that makes the joints comparable: time to turn by one rad.
    clear : callable
        Returns whether joint vectors (1, n) are clear.
    passable : callable
        Returns whether the straight motion between joint vectors (2, n) is clear.
    seconds : float s
        Time limit of the search.

    Raises
    ------
    InputError
        OMPL is not installed.
    """
    require_extra("cells", "ways around obstacles")
    from ompl import base, geometric, util  # loaded where it is needed: half a second

    util.setLogLevel(util.LogLevel.LOG_NONE)
    util.RNG.setSeed(SEED)
    n = len(scale)
    space, bounds = base.RealVectorStateSpace(n), base.RealVectorBounds(n)
    for i in range(n):
        bounds.setLow(i, float(lower[i] * scale[i]))
        bounds.setHigh(i, float(upper[i] * scale[i]))
    space.setBounds(bounds)
    info = base.SpaceInformation(space)

    def joints(*states: Any) -> Array:
        return np.array([state[0:n] for state in states]) / scale

    class Motions(base.MotionValidator):  # type: ignore[misc]  # ompl has no types
        """The check of motions that OMPL calls."""

        def checkMotion(self, one: Any, two: Any) -> bool:  # OMPL's name
            return passable(joints(one, two))

    motions = Motions(info)  # held here: OMPL does not keep it alive
    info.setStateValidityChecker(lambda state: clear(joints(state)))
    info.setMotionValidator(motions)
    info.setup()
    problem, (start, goal) = base.ProblemDefinition(info), (info.allocState(), info.allocState())
    for state, q in ((start, ends[0]), (goal, ends[1])):
        for i in range(n):
            state[i] = float(q[i] * scale[i])
    problem.setStartAndGoalStates(start, goal)
    planner = geometric.RRTConnect(info)
    planner.setProblemDefinition(problem)
    planner.setRange(RANGE * float(np.linalg.norm((upper - lower) * scale)))
    planner.setup()
    planner.solve(base.timedPlannerTerminationCondition(float(seconds)))
    if not problem.hasExactSolution():
        return None
    path = problem.getSolutionPath()
    shorten = geometric.PathSimplifier(info)
    shorten.reduceVertices(path)
    shorten.partialShortcutPath(path, SHORTCUTS, SHORTCUTS)
    shorten.reduceVertices(path)
    return np.vstack([ends[:1], joints(*path.getStates())[1:-1], ends[1:]])


# -----------------------------------------------------------------------------
# A move from one joint vector to another: its corners, and the time it takes.

SECONDS = 10.0
"""s: default time limit of the search for a way around."""


def least_time(dq: ArrayLike, velocity: ArrayLike, acceleration: ArrayLike) -> Array:
    """Return the least times (B,) s of straight joint motions dq (B, n) rad from stop to stop.

    All joints start and arrive together. Let s run from 0 to 1 along the motion: the joints bound
    its speed v and its acceleration a, and the motion takes 1 / v + v / a, or 2 / sqrt(a) where v
    is not reached.

    Parameters
    ----------
    dq : (B, n) rad
    velocity : (n,) rad/s
    acceleration : (n,) rad/s^2
    """
    step = np.abs(floats(dq, "dq", (None, None)))
    n = step.shape[1]
    # 1 / v and 1 / a of the slowest joints.
    cross = (step / floats(velocity, "velocity", (n,))).max(axis=1)
    gain = (step / floats(acceleration, "acceleration", (n,))).max(axis=1)
    full = cross**2 >= gain
    over = np.where(cross > 0, cross, 1.0)
    return np.asarray(np.where(full, cross + gain / over, 2 * np.sqrt(gain)))


def least_times(robot: Robot, q: Array, eta_v: float = 1.0, eta_a: float = 1.0) -> Array:
    """Return when (m,) s the corners q (m, n) rad of a move can be reached at the earliest."""
    velocity, acceleration = robot.speed_limits()
    took = least_time(np.diff(q, axis=0), eta_v * velocity, eta_a * acceleration)
    return np.concatenate([[0.0], np.cumsum(np.maximum(took, 1e-9))])


def share_of_way(way: Array, velocity: Array, acceleration: Array, share: Array) -> Array:
    """Return how far (m,) a joint motion from stop to stop is after each share (m,) of its time.

    Its speed rises evenly, stays, and falls; or only rises and falls.

    Parameters
    ----------
    way : (n,) rad
        How far each joint moves; all at least 0.
    velocity, acceleration : (n,) rad/s, rad/s^2
    share : (m,)
        From 0 to 1.
    """
    took = float(least_time(way[None], velocity, acceleration)[0])
    ramp = min(1 - (way / velocity).max() / took, 0.5) if took else 0.5
    near = np.minimum(share, 1 - share)
    part = np.where(near < ramp, near**2 / (2 * ramp), near - ramp / 2) / (1 - ramp)
    return np.where(share <= 0.5, part, 1 - part)


def speed_share(dq: ArrayLike, velocity: ArrayLike, acceleration: ArrayLike, time: Array) -> Array:
    """Return the shares (B,) of full velocity at which motions dq (B, n) rad take times (B,) s.

    The motions go from stop to stop with full acceleration, so this is the inverse of `least_time`
    with that share of the velocities. The share is 1 for a motion of length zero.
    """
    step = np.abs(floats(dq, "dq", (None, None)))
    n = step.shape[1]
    cross = (step / floats(velocity, "velocity", (n,))).max(axis=1)
    gain = (step / floats(acceleration, "acceleration", (n,))).max(axis=1)
    # Time at constant speed without acceleration; half of `time` where speed is never constant.
    even = (time + np.sqrt(np.maximum(time**2 - 4 * gain, 0.0))) / 2
    return np.asarray(np.where(cross > 0, cross / np.maximum(even, 1e-300), 1.0))


def transfer_move(
    robot: Robot,
    q0: ArrayLike,
    q1: ArrayLike,
    *,
    cell: Cell | None = None,
    eta_v: float = 1.0,
    eta_a: float = 1.0,
    seconds: float = SECONDS,
) -> TransferMove:
    """Return a transfer move from q0 to q1, clear in the cell and within the limits.

    The move is the straight joint motion if that is clear; otherwise a way around obstacles by
    RRT-Connect, shortened. External axes move with the arm. The same arguments give the same move.

    Parameters
    ----------
    robot : Robot
        A robot with known limits.
    q0, q1 : (n,) rad
        Start and end. Endless joints turn exactly from q0 to q1, not the short way round.
    cell : Cell, optional
        Without a cell the straight motion is returned, and it is not `clear`.
    eta_v, eta_a : float
        Shares of the velocity and acceleration limits that may be used.
    seconds : float s
        Time limit of the search for a way around.

    Raises
    ------
    NoFeasiblePath
        An end is not clear (proved), or no way was found in time (not proved).
    InputError
        Limits are not known, an end is beyond them, or the cell has other external axes.
    """
    if cell is not None:
        require_axes(cell.chain, robot)
    n = robot.joints
    ends = np.array([floats(q0, "q0", (n,)), floats(q1, "q1", (n,))])
    lower, upper = _bounds(robot, ends)
    corners = ends
    if cell is not None:
        _require_clear(cell, ends)
        if not cell.clear_through(ends):
            found = find_way_around(
                ends, lower, upper, 1 / robot.speed_limits()[0],
                clear=lambda q: bool(cell.clear(q).all()), passable=cell.clear_through,
                seconds=seconds,
            )  # fmt: skip
            if found is None:
                raise NoFeasiblePath(
                    f"no transfer move found in {seconds:g} s between its clear ends; on the "
                    f"straight motion, {explain_collision(cell, ends)}",
                    proved=False,
                    node=-1,
                )
            corners = found
    return TransferMove(
        q=freeze(corners),
        time=freeze(least_times(robot, corners, eta_v, eta_a)),
        clear=cell is not None,
    )


def _bounds(robot: Robot, ends: Array) -> tuple[Array, Array]:
    """Return joint bounds (n,) rad; endless joints may go one turn beyond either end."""
    limits = robot.joint_limits()
    low = np.where(robot.endless, ends.min(axis=0) - 2 * np.pi, limits.lower)
    high = np.where(robot.endless, ends.max(axis=0) + 2 * np.pi, limits.upper)
    beyond = (ends < low - 1e-9) | (ends > high + 1e-9)
    if beyond.any():
        joint = int(np.flatnonzero(beyond.any(axis=0))[0])
        name = robot.joint_names[joint]
        raise InputError(f"transfer move: {name} is beyond its limits at an end of the move")
    return np.minimum(low, ends.min(axis=0)), np.maximum(high, ends.max(axis=0))


def _require_clear(cell: Cell, ends: Array) -> None:
    over, pair = cell.clearance(ends)
    for what, gap, p in zip(("start", "end"), over, pair, strict=True):
        if gap <= 0:
            one, two = cell.pair_names[int(p)]
            raise NoFeasiblePath(
                f"the {what} of a transfer move is not clear: {one!r} and {two!r} come "
                f"{-gap * 1e3:.3g} mm nearer than allowed",
                proved=True,
                node=-1,
            )
