"""Axes of an arm as controllers count them, and the side of the arm on which the wrist lies."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from kerfpath._arrays import Array, floats, freeze
from kerfpath._repr import short_repr
from kerfpath.post._external import arm_joints
from kerfpath.robots import Robot

__all__ = ["AxisCount", "offset_near", "wrist_in_plane"]


def offset_near(robot: Robot, makers_deg: ArrayLike) -> Array:
    """Return the joint offsets (6,) rad of a robot, each within half a turn of its maker's (deg).

    The geometry of an arm is the same whether joint 6 counts from -180 or from 180 deg, but the
    axes and turns of its controller are not.
    """
    # Slightly less than half a turn, so that halves always round the same way.
    makers = np.radians(np.asarray(makers_deg, dtype=float))
    off = robot.offset - makers
    return np.asarray(makers + off - 2 * np.pi * np.round(off / (2 * np.pi) - 1e-9))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class AxisCount:
    """Axes of an ortho-parallel arm as a controller counts them: matrix @ angles + shift.

    The angles of the model are 0 with the arm upright.

    Parameters
    ----------
    counted_from : (6,) deg
        Joint offsets of the maker's own descriptions.
    matrix : (6, 6)
    shift : (6,) rad
    """

    counted_from: tuple[float, ...] = (0.0,) * 6
    matrix: Array = field(default_factory=lambda: np.eye(6))
    shift: Array = field(default_factory=lambda: np.zeros(6))

    __repr__ = short_repr

    def from_joints(self, robot: Robot, q: ArrayLike) -> Array:
        """Return the controller's axes (K, 6) rad for joint vectors q (K, n) rad."""
        angles = robot.sign * arm_joints(robot, q)
        return freeze(np.asarray(angles @ self.matrix.T + self._shift(robot), dtype=np.float64))

    def to_joints(self, robot: Robot, axes: ArrayLike) -> Array:
        """Return the joints (K, 6) rad of the arm for the controller's axes (K, 6) rad."""
        rows = floats(axes, "axes", (None, 6)) - self._shift(robot)
        angles = rows @ np.linalg.inv(self.matrix).T
        return freeze(np.asarray(robot.sign * angles, dtype=np.float64))

    def _shift(self, robot: Robot) -> Array:
        """Return the axes (6,) rad at which all joints of the robot are 0."""
        return np.asarray(self.shift - self.matrix @ offset_near(robot, self.counted_from))


def wrist_in_plane(robot: Robot, q: Array) -> tuple[Array, Array]:
    """Return how far the wrist centre is ahead of axis 1 and of the lower arm, (K,) m each.

    The joint vectors q are (K, n) rad. In the plane of the arm, with x ahead and z up, the lower
    arm points along u = (sin q2, cos q2) and the wrist centre lies at
    w = c3 (sin q23, cos q23) + a2 (cos q23, -sin q23) from axis 3. It is behind the lower arm, and
    the second value is negative, where w turns from u towards the back: u_x w_z > u_z w_x, that is
    c3 sin q3 + a2 cos q3 < 0.
    """
    arm = robot.arm()
    _, q2, q3, *_ = (arm.sign * arm_joints(robot, q) - arm.offset).T
    ahead = arm.a1 + arm.c2 * np.sin(q2) + arm.c3 * np.sin(q2 + q3) + arm.a2 * np.cos(q2 + q3)
    bend = arm.c3 * np.sin(q3) + arm.a2 * np.cos(q3)
    return np.asarray(ahead), np.asarray(bend)
