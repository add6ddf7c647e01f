"""Axes of ABB controllers, and the configuration (confdata) of a pose.

From ABB's manuals: cf1, cf4 and cf6 are the quarter turns of axes 1, 4 and 6, 0 for 0 to 90 deg,
-1 for -90 to 0 deg, unbounded both ways; cfx numbers the eight postures of a bending-backwards arm
by three bits: 4 = wrist centre behind axis 1, 2 = wrist centre behind the lower arm, 1 = axis 5
negative. We read "behind" as follows: 4 where the wrist centre lies on the side of axis 1 away from
which the arm faces, 2 where it lies behind the extended line from axis 2 through axis 3. That bit
therefore changes at the stretched arm, where the elbow is singular. RobotStudio agrees at 28
positions of an IRB 6700, which others published (tests/post/test_measured.py).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from kerfpath._arrays import Array, Ints, floats, freeze
from kerfpath.post._axes import AxisCount, wrist_in_plane
from kerfpath.robots import Robot

__all__ = ["axes_from_joints", "confdata", "joints_from_axes", "posture"]

UPRIGHT = (0.0, 0.0, -90.0, 0.0, 0.0, 0.0)
"""ABB's axes (deg) where the angles of the model are 0, with the arm upright."""
ROD = np.eye(6) + np.outer(np.eye(6)[2], np.eye(6)[1])
"""With a parallel rod, axis 3 is joint 2 + joint 3."""
SERIAL = AxisCount(counted_from=UPRIGHT, shift=np.radians(UPRIGHT))
HORIZONTAL = replace(SERIAL, matrix=ROD)
NOISE_DECIMALS = 6
"""Angles are rounded to this many decimals (deg) before their quadrant: -1e-15 deg is zero."""


def axes_from_joints(robot: Robot, q: ArrayLike) -> Array:
    """Return the controller's axes (K, 6) rad of the arm for joint vectors q (K, n) rad.

    With a parallel rod (IRB 2400, IRB 4400: `Robot.axis_3` is "horizontal"), axis 3 is joint 2 +
    joint 3. Descriptions that count joints differently from ABB are converted by the arm's model.
    """
    return _count(robot).from_joints(robot, q)


def joints_from_axes(robot: Robot, axes: ArrayLike) -> Array:
    """Return the joints (K, 6) rad of the arm for the controller's axes (K, 6) rad."""
    return _count(robot).to_joints(robot, axes)


def _count(robot: Robot) -> AxisCount:
    return HORIZONTAL if robot.axis_3 == "horizontal" else SERIAL


def confdata(robot: Robot, q: ArrayLike) -> Ints:
    """Return cf1, cf4, cf6 and cfx, (K, 4), for joint vectors q (K, n) rad.

    The docstring of the module says what is from ABB's manuals and what is our reading.
    """
    q = floats(q, "q", (None, robot.joints))
    ahead, bend = wrist_in_plane(robot, q)
    axes_deg = np.round(np.degrees(axes_from_joints(robot, q)), NOISE_DECIMALS)
    conf = np.empty((len(q), 4), dtype=np.int64)
    conf[:, :3] = np.floor(axes_deg[:, [0, 3, 5]] / 90.0)
    conf[:, 3] = 4 * (ahead < 0) + 2 * (bend < 0) + (axes_deg[:, 4] < 0)
    return freeze(conf)


def posture(robot: Robot, q: Array, settings: object) -> list[tuple[int | str, ...]]:
    """Return `confdata` for joint vectors q (K, n) rad, as tuples."""
    return [tuple(row) for row in confdata(robot, q).tolist()]
