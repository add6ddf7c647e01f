"""What an ABB controller calls the joints: its axes, and the configuration (confdata) of a pose.

From ABB's manuals: cf1, cf4 and cf6 are the quarter turns of axes 1, 4 and 6, 0 for 0 to 90 deg,
-1 for -90 to 0 deg, unbounded both ways; cfx numbers the eight postures of a bending-backwards arm
by three bits: 4 = wrist centre behind axis 1, 2 = wrist centre behind the lower arm, 1 = axis 5
negative. Our reading of "behind": 4 where the wrist centre lies on the far side of axis 1 as the
arm faces, 2 where it lies behind the line from axis 2 through axis 3, prolonged. That bit therefore
turns over at the stretched arm, where the elbow is singular. So it does at 28 positions of an
IRB 6700 that others had RobotStudio compute (tests/test_post_measured.py).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from kerfpath._arrays import Array, Ints, floats, freeze
from kerfpath.post._arm_plane import wrist_in_plane
from kerfpath.robots import Robot

__all__ = ["axes_from_joints", "axis_matrix", "confdata", "joints_from_axes", "posture"]

ROD = (0.0, 1.0, 1.0, 0.0, 0.0, 0.0)
"""The coupling of a parallel rod: it carries the upper arm, so that its motor turns joint 2 + 3."""
NOISE_DECIMALS = 6
"""Angles are rounded to this many decimals (deg) before a quadrant: -1e-15 deg is zero."""


def axis_matrix(robot: Robot) -> Array:
    """Return the matrix (6, 6) that takes joints of the serial model to the controller's axes.

    The identity, but for arms with a parallel rod (IRB 2400, IRB 4400): there the controller's
    axis 3 is joint 2 + joint 3, the coupling that the robot's data carry.
    """
    matrix = np.eye(6)
    if any(np.array_equal(coupling.row, ROD) for coupling in robot.couplings):
        matrix[2] = ROD
    return freeze(matrix)


def axes_from_joints(robot: Robot, q: ArrayLike) -> Array:
    """Return the controller's axes (K, 6) rad of joint vectors q (K, 6) rad."""
    return freeze(floats(q, "q", (None, 6)) @ axis_matrix(robot).T)


def joints_from_axes(robot: Robot, axes: ArrayLike) -> Array:
    """Return the joint vectors (K, 6) rad of a controller's axes (K, 6) rad."""
    rows = floats(axes, "axes", (None, 6))
    return freeze(np.asarray(rows @ np.linalg.inv(axis_matrix(robot)).T, dtype=np.float64))


def confdata(robot: Robot, q: ArrayLike) -> Ints:
    """Return cf1, cf4, cf6 and cfx, (K, 4), of joint vectors q (K, 6) rad.

    See the module's text for what is ABB's and what is our reading.
    """
    q = floats(q, "q", (None, 6))
    ahead, bend = wrist_in_plane(robot, q)
    axes_deg = np.round(np.degrees(axes_from_joints(robot, q)), NOISE_DECIMALS)
    conf = np.empty((len(q), 4), dtype=np.int64)
    conf[:, :3] = np.floor(axes_deg[:, [0, 3, 5]] / 90.0)
    conf[:, 3] = 4 * (ahead < 0) + 2 * (bend < 0) + (axes_deg[:, 4] < 0)
    return freeze(conf)


def posture(robot: Robot, q: Array, settings: object) -> list[tuple[int | str, ...]]:
    """Return `confdata` of joint vectors q (K, 6) rad, as tuples."""
    return [tuple(row) for row in confdata(robot, q).tolist()]
