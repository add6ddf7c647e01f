"""Joints as functions of the free variables of every node, with posture and turns fixed."""

from __future__ import annotations

from copy import copy

import numpy as np

from kerfpath.arrays import Array, Ints
from kerfpath.plans import Plan, has_room
from kerfpath.robots import Robot, base_in_part

DERIVATIVE_STEP = 1e-5
"""rad or m: central differences are exact to 1e-10 of the third derivative, rounding to 1e-11."""


class JointCurves:
    """Joints q_k of every node in its posture, by the true kinematics.

    The free variables of a node are gamma, rad, one joint of a seven-axis arm, and the external
    axes, rad or m, in this order: F = 1 + E numbers.

    Parameters
    ----------
    robot : Robot
    H : (K, 4, 4)
        Task frames in the robot base, m.
    T_flange_tip : (4, 4)
        Tool, m.
    posture : (K,) int
        Posture of each node.
    """

    def __init__(self, robot: Robot, H: Array, T_flange_tip: Array, posture: Ints) -> None:
        self._robot = robot.alone()
        self._externals = robot.externals
        self._inner = self._robot.free
        self._H = H
        self._T_tip_flange = np.linalg.inv(T_flange_tip)
        self._posture = posture

    def part(self, nodes: slice) -> JointCurves:
        """Return the joints of some successive nodes."""
        part = copy(self)
        part._H, part._posture = self._H[nodes], self._posture[nodes]
        return part

    def at(self, free: Array, near: Array) -> Array:
        """Return the joints (K, n) rad at `free` (K, F), each on the turn nearest to `near` (K, n).

        Nodes that are out of reach get NaN.
        """
        x = free[:, 1 + len(self._inner) :]
        H = self._H
        if self._externals:
            H = np.linalg.inv(base_in_part(self._externals, x)) @ H
        near = np.array(near[:, : self._robot.joints])
        near[:, self._inner] = free[:, 1 : 1 + len(self._inner)]
        arm = self._of_arm(H, free[:, 0], near)
        return np.concatenate([arm, x], axis=1)

    def _of_arm(self, H: Array, gamma: Array, near: Array) -> Array:
        c, s = np.cos(gamma)[:, None], np.sin(gamma)[:, None]
        turned = np.array(H)
        turned[:, :, 0] = H[:, :, 0] * c + H[:, :, 1] * s
        turned[:, :, 1] = H[:, :, 1] * c - H[:, :, 0] * s
        T = (turned.reshape(-1, 4) @ self._T_tip_flange).reshape(-1, 4, 4)
        return self._robot.arm.follow(T, near, self._posture)

    def slope(self, free: Array, q: Array) -> Array:
        """Return dq/dfree (K, n, F) at joints `q` (K, n); NaN at the edge of reach."""
        slopes = []
        for step in DERIVATIVE_STEP * np.eye(free.shape[1]):
            ahead, behind = self.at(free + step, q), self.at(free - step, q)
            slopes.append((ahead - behind) / (2 * DERIVATIVE_STEP))
        return np.stack(slopes, axis=2)


# -----------------------------------------------------------------------------
# Range of gamma at both ends of a plan in which the tool can back off.

STEP = np.radians(1.5)
"""rad: step in which gamma is tested, from that of the plan on; the range may lose up to this."""
AWAY = STEP * np.arange(61)
"""rad: distances tested in either direction; if all of them have room, gamma is not bounded."""


def room_at_ends(plan: Plan) -> tuple[Array, Array]:
    """Return the least and the largest gamma (K,) rad with room for the retract of a plan.

    They are infinite between the ends, without a retract, and at an end that has no room as it is.
    """
    K, m = len(plan.q), len(AWAY)
    low, high = np.full(K, -np.inf), np.full(K, np.inf)
    if plan.settings.retract is None:
        return low, high
    end, way = np.repeat([0, K - 1], 2 * m), np.tile(np.append(-AWAY, AWAY), 2)
    near, posture, gamma = plan.unwrapped[end], plan.posture[end], plan.gamma[end] + way
    curves = JointCurves(plan.robot, plan.frames[end], plan.T_flange_tip, posture)
    there = curves.at(np.column_stack([gamma, near[:, plan.robot.free]]), near)
    reached = np.asarray(np.isfinite(there).all(axis=1))
    there = np.where(reached[:, None], there, near)
    room = has_room(plan.settings, plan.robot, there, posture, plan.T_flange_tip) & reached
    for k, both, far in zip((0, K - 1), room.reshape(2, 2, m), gamma.reshape(2, 2, m), strict=True):
        for bound, free, angle in zip((low, high), both, far, strict=True):
            if free[0] and not free.all():
                bound[k] = angle[np.argmin(free) - 1]
    return low, high
