"""Joints where a controller moves the wrist evenly and keeps the tip on its way."""

from __future__ import annotations

import numpy as np

from kerfpath._arrays import Array
from kerfpath.comfort import jacobian
from kerfpath.errors import InputError
from kerfpath.robots import Robot

__all__ = ["joints_with_wrist", "require_wrist"]

ARM = 3
"""Joints that place the tip, while as many after them are the wrist."""
STEPS = 8
"""Of Newton's method, each of which doubles the digits."""
NEAR = 1e-10
"""m: the tip is where it has to be; rounding leaves 1e-15."""


def require_wrist(robot: Robot) -> None:
    """Raise InputError where a robot does not have three joints and a wrist of three."""
    if robot.joints != 2 * ARM:
        raise InputError(
            f"robot {robot.id!r}: orientation 'wrist' is modelled for six joints, it has "
            f"{robot.joints}"
        )


def joints_with_wrist(robot: Robot, points: Array, near: Array, tool: Array) -> Array:
    """Return the joints (m, 6) rad that bring the tip to points, (m, 3) m, with the wrist as given.

    Newton's method in the first three joints. NaN where it does not get there.

    Parameters
    ----------
    robot : Robot
    points : (m, 3) m
        In the robot base.
    near : (m, 6) rad
        The first three joints nearby, the others as they are to be.
    tool : (4, 4) m
        T_flange_tip.
    """
    q = near.copy()
    good = ~np.isnan(q).any(axis=1)
    off = np.full(len(q), np.inf)
    for _ in range(STEPS):
        tip = (robot.forward(q[good]) @ tool)[:, :3, 3]
        gap = points[good] - tip
        off[good] = np.linalg.norm(gap, axis=1)
        if (off[good] < NEAR * 1e-4).all():
            break
        J = jacobian(robot, q[good], tool=tool)[:, :3, :ARM]
        step = np.linalg.pinv(J) @ gap[:, :, None]
        q[good, :ARM] += np.clip(step[:, :, 0], -0.5, 0.5)
    return np.asarray(np.where((off < NEAR)[:, None], q, np.nan))
