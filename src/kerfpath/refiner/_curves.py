"""The joints as functions of gamma at every node, posture and turns fixed."""

from __future__ import annotations

import numpy as np

from kerfpath._arrays import Array, Ints
from kerfpath.robots import Robot

__all__ = ["JointCurves"]

DERIVATIVE_STEP = 1e-5
"""rad: the central difference is good to 1e-10 of the curvature, rounding to 1e-11."""


class JointCurves:
    """q_k(gamma) of every node in one posture: the true kinematics, not a model of it.

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
        self._external = robot.external
        self._H = H
        self._T_tip_flange = np.linalg.inv(T_flange_tip)
        self._posture = posture

    def at(self, gamma: Array, near: Array) -> Array:
        """Return the joints (K, n) rad at `gamma` (K,), each on the turn nearest to `near` (K, n).

        NaN at the nodes that are out of reach. An external axis stays where it is in `near`.
        """
        H = self._H
        if self._external is not None:
            H = np.linalg.inv(self._external.poses(near[:, -1])) @ H
            return np.column_stack([self._of_arm(H, gamma, near[:, :-1]), near[:, -1]])
        return self._of_arm(H, gamma, near)

    def _of_arm(self, H: Array, gamma: Array, near: Array) -> Array:
        K = len(gamma)
        spin = np.tile(np.eye(4), (K, 1, 1))
        spin[:, 0, 0] = spin[:, 1, 1] = np.cos(gamma)
        spin[:, 1, 0] = np.sin(gamma)
        spin[:, 0, 1] = -spin[:, 1, 0]
        return self._robot.follow(H @ spin @ self._T_tip_flange, near, self._posture)

    def slope(self, gamma: Array, q: Array) -> Array:
        """Return dq/dgamma (K, n) where the joints are `q`; NaN at the edge of reach."""
        ahead, behind = (self.at(gamma + h, q) for h in (DERIVATIVE_STEP, -DERIVATIVE_STEP))
        return np.asarray((ahead - behind) / (2 * DERIVATIVE_STEP))
