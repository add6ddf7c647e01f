"""A program as joints over time: sampled in moves from stop to stop, else node by node."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from kerfpath._arrays import Array, Bools, Ints, freeze
from kerfpath._repr import short_repr
from kerfpath.errors import InputError
from kerfpath.plans import node_rates
from kerfpath.post._program import JointMove, LinearMove, Program, Wait
from kerfpath.post._times import timetable
from kerfpath.robots import base_in_part
from kerfpath.transfer import least_time

__all__ = ["Trajectory", "rates", "trajectory"]

BRANCH = 0.5
"""Largest distance (rad) of joints from even motion on a straight move in one posture."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Trajectory:
    """Joints over time.

    Parameters
    ----------
    time : (K,) s
        Strictly increasing from 0.
    q : (K, n) rad
    stops : (K,) bool
        Whether the robot is stopped.
    done : (S,) int
        Index of the point at which each move or wait of the program ends.
    """

    time: Array
    q: Array
    stops: Bools
    done: Ints

    __repr__ = short_repr


def rates(time: Array, q: Array, stops: Bools) -> tuple[Array, Array]:
    """Return velocities and accelerations (K, n), rad/s and rad/s^2: 0 at stops.

    Elsewhere they are those of the parabola through a point and its two neighbours.
    """
    velocity, acceleration = node_rates(time, q)
    velocity[stops] = acceleration[stops] = 0.0
    return velocity, acceleration


def trajectory(program: Program, step_time: float) -> Trajectory:
    """Return the motion of a program.

    Joint moves, and path moves from stop to stop, have points every `step_time` (s) or less. Other
    path moves have one point, where they end: the nodes of the plan.

    Raises
    ------
    InputError
        A straight move leaves the robot's reach or its posture on the way.
    """
    steps = timetable(program)
    moves, tips = program.moves, program.tips(program.moves)
    time, q, stops, done = [np.zeros(1)], [moves[0].q[None]], [np.ones(1, np.bool_)], [0]
    number, standing = 0, True
    for (step, end), (_, start) in zip(steps[1:], steps, strict=False):
        before = moves[number].q
        if isinstance(step, Wait):
            share, way = np.ones(1), before[None]
        else:
            number += 1
            between_stops = standing and step.zone == 0
            count = int(np.ceil((end - start) / step_time - 1e-9)) if between_stops else 1
            share = np.arange(1, count + 1) / max(count, 1)
            if isinstance(step, JointMove):
                way = before + _trapezoid(program, before, step, share) * (step.q - before)
            else:
                way = _straight(program, step, before, tips[number - 1], share)
            way = np.vstack([way[:-1], step.q])
            standing = step.zone == 0
        done.append(done[-1] + (len(share) if end > start else 0))
        if end > start:
            time.append(start + (end - start) * share)
            q.append(way)
            stops.append(np.arange(len(share)) == (len(share) - 1 if standing else -1))
    return Trajectory(
        time=freeze(np.concatenate(time)),
        q=freeze(np.vstack(q)),
        stops=np.concatenate(stops),
        done=np.array(done),
    )


def _trapezoid(program: Program, before: Array, move: JointMove, share: Array) -> Array:
    """Return how far (m, 1) a joint motion from stop to stop is after each share of its time.

    Its speed rises evenly, stays, and falls; or only rises and falls.
    """
    velocity, acceleration = program.robot.speed_limits()
    way = np.abs(move.q - before)
    took = float(least_time(way[None], velocity, acceleration)[0])
    ramp = min(1 - (way / velocity).max() / took, 0.5) if took else 0.5
    near = np.minimum(share, 1 - share)
    part = np.where(near < ramp, near**2 / (2 * ramp), near - ramp / 2) / (1 - ramp)
    return np.where(share <= 0.5, part, 1 - part)[:, None]


def _straight(
    program: Program, move: LinearMove, before: Array, T_before: Array, share: Array
) -> Array:
    """Return joints (m, n) along a straight move, after each share of its time.

    The tip speeds up and slows down as a cubic: 3 s^2 - 2 s^3 of its way after the share s.
    """
    if len(share) == 1:
        return move.q[None]
    way = (share**2 * (3 - 2 * share))[:, None]
    T = np.tile(T_before, (len(share), 1, 1))
    T[:, :3, 3] += way * (move.T_part_tip[:3, 3] - T_before[:3, 3])
    ends = Rotation.from_matrix(np.array([T_before[:3, :3], move.T_part_tip[:3, :3]]))
    T[:, :3, :3] = Slerp([0.0, 1.0], ends)(way[:, 0]).as_matrix()
    evenly = before + way * (move.q - before)
    robot, n = program.robot, program.robot.family.joints
    # Free joints move evenly; the arm sees the tip from where external axes carry it.
    seen = np.linalg.inv(base_in_part(robot.externals, evenly[:, n:])) @ program.T_base_part @ T
    # The tool's rotation about its axis counts only for arms that can choose it.
    arm = robot.alone()
    given = arm.given_of(evenly)
    solved, reach = arm.inverse_nodes(seen, np.zeros(1), program.T_flange_tip, given)
    apart = solved[:, 0] - evenly[:, None, :n]
    apart -= 2 * np.pi * np.round(apart / (2 * np.pi))
    off = np.where(reach[:, 0], np.abs(apart).max(axis=2), np.inf)
    if not (off.min(axis=1) < BRANCH).all():
        raise InputError("a straight move leaves the robot's reach, or its posture, on the way")
    q = evenly[:, :n] + apart[np.arange(len(share)), off.argmin(axis=1)]
    return np.hstack([q, evenly[:, n:]])
