"""A move from one joint vector to another: its corners, and the time it takes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from kerfpath._arrays import Array, floats, freeze
from kerfpath._repr import short_repr
from kerfpath.cell import Cell
from kerfpath.errors import InputError, NoFeasiblePath
from kerfpath.robots import Robot, require_axes
from kerfpath.transfer._around import find_way_around
from kerfpath.transfer._near_miss import explain_collision

__all__ = ["TransferMove", "least_time", "speed_share", "transfer_move"]

SECONDS = 10.0
"""s: default time limit of the search for a way around."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TransferMove:
    """Straight joint motions from corner to corner, with a stop at each.

    Parameters
    ----------
    q : (m, n) rad
        Corners, including both ends.
    time : (m,) s
        Time at which each corner is reached, from 0.
    clear : bool
        Whether the move is proved clear in a cell; False where no cell was given.
    """

    q: Array
    time: Array
    clear: bool

    __repr__ = short_repr

    @property
    def duration(self) -> float:
        """Duration of the move (s)."""
        return float(self.time[-1])


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
    velocity, acceleration = robot.speed_limits()
    lower, upper = _bounds(robot, ends)
    corners = ends
    if cell is not None:
        _require_clear(cell, ends)
        if not cell.clear_through(ends):
            found = find_way_around(
                ends, lower, upper, 1 / velocity,
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
    took = least_time(np.diff(corners, axis=0), eta_v * velocity, eta_a * acceleration)
    return TransferMove(
        q=freeze(corners),
        time=freeze(np.concatenate([[0.0], np.cumsum(np.maximum(took, 1e-9))])),
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
