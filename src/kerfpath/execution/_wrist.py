"""Joints of a controller that moves the wrist evenly and keeps the tip on its path."""

from __future__ import annotations

import numpy as np

from kerfpath._arrays import Array
from kerfpath.comfort import jacobian
from kerfpath.errors import InputError
from kerfpath.robots import Robot

__all__ = ["joints_with_wrist", "require_wrist"]

ARM = 3
"""Number of joints that place the tip; as many joints of the wrist follow."""
STEPS = 8
"""Steps of Newton's method, each of which doubles the digits."""
NEAR = 1e-10
"""Distance (m) below which the tip is at its point; rounding leaves 1e-15."""


def require_wrist(robot: Robot) -> None:
    """Raise InputError unless a robot has three joints and a wrist of three."""
    if robot.joints != 2 * ARM:
        raise InputError(
            f"robot {robot.id!r}: orientation 'wrist' is modelled for six joints, got "
            f"{robot.joints}"
        )


def joints_with_wrist(robot: Robot, points: Array, near: Array, tool: Array) -> Array:
    """Return the joints (m, 6) rad that bring the tip to points, (m, 3) m, with the wrist as given.

    It uses Newton's method in the first three joints; NaN where that does not converge.

    Parameters
    ----------
    robot : Robot
    points : (m, 3) m
        Points in the robot base.
    near : (m, 6) rad
        The first three joints close to the solution, the others as they must be.
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
