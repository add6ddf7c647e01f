"""Axes of KUKA controllers, and Status and Turn of a pose.

KUKA's axes 1, 4 and 6 turn positive against the right-hand rule, and all axes are zero with the arm
stretched ahead: the candle pose is A2 = -90 deg, A3 = 0. Library robots by KUKA count their joints
this way. From KUKA's manuals: bit 0 of the Status is set where the wrist centre lies behind axis 1
(x below zero in a frame that turns with it), bit 1 where A3 is not below the angle at which the arm
is stretched (0 deg without an offset between axes 3 and 4), bit 2 where A5 is negative; bit n of
the Turn where axis n + 1 is negative. Manuals differ on bit 2 at A5 = 0: here it is 0.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from kerfpath._arrays import Array, Ints, floats, freeze
from kerfpath.post._axes import AxisCount, wrist_in_plane
from kerfpath.robots import Robot

__all__ = ["axes_from_joints", "joints_from_axes", "posture", "status_and_turn"]

SIGN = np.array([-1.0, 1.0, 1.0, -1.0, 1.0, -1.0])
COUNTED_FROM = (0.0, -90.0, 0.0, 0.0, 0.0, 0.0)
"""KUKA's axes (deg) where the angles of the model are 0, before the signs."""
COUNT = AxisCount(
    counted_from=COUNTED_FROM, matrix=np.diag(SIGN), shift=SIGN * np.radians(COUNTED_FROM)
)
axes_from_joints = COUNT.from_joints
joints_from_axes = COUNT.to_joints
NOISE_DECIMALS = 6
"""Angles are rounded to this many decimals (deg) before their sign: -1e-15 deg is zero."""


def status_and_turn(robot: Robot, q: ArrayLike) -> Ints:
    """Return Status and Turn, (K, 2), for joint vectors q (K, n) rad.

    An endless axis is taken modulo 360 deg, from -180 deg on.
    """
    q = floats(q, "q", (None, robot.joints))
    arm = robot.arm()
    ahead, _ = wrist_in_plane(robot, q)
    axes_deg = np.degrees(axes_from_joints(robot, q))
    stretched_deg = np.degrees(np.arctan2(-arm.a2, arm.c3))
    bent = np.round(axes_deg[:, 2] - stretched_deg, NOISE_DECIMALS) >= 0
    once = (axes_deg + 180.0) % 360.0 - 180.0
    negative = np.round(np.where(robot.endless[:6], once, axes_deg), NOISE_DECIMALS) < 0
    found = np.empty((len(q), 2), dtype=np.int64)
    found[:, 0] = (ahead < 0) + 2 * bent + 4 * negative[:, 4]
    found[:, 1] = negative @ (1 << np.arange(6))
    return freeze(found)


def posture(robot: Robot, q: Array, settings: object) -> list[tuple[int | str, ...]]:
    """Return `status_and_turn` for joint vectors q (K, n) rad, as tuples."""
    return [tuple(row) for row in status_and_turn(robot, q).tolist()]
