"""Where the wrist centre lies in the plane of the arm: what controllers call shoulder and elbow."""

from __future__ import annotations

import numpy as np

from kerfpath._arrays import Array
from kerfpath.robots import Robot

__all__ = ["wrist_in_plane"]


def wrist_in_plane(robot: Robot, q: Array) -> tuple[Array, Array]:
    """Return how far the wrist centre is ahead of axis 1, and of the lower arm, (K,) m each.

    At joint vectors q (K, 6) rad. In the plane of the arm, with x ahead and z up, the lower arm
    points along u = (sin q2, cos q2) and the wrist centre lies at
    w = c3 (sin q23, cos q23) + a2 (cos q23, -sin q23) from axis 3. It is behind the lower arm, the
    second value negative, where w turns from u towards the back: u_x w_z > u_z w_x, that is
    c3 sin q3 + a2 cos q3 < 0.
    """
    arm = robot.arm()
    _, q2, q3, *_ = (arm.sign * q - arm.offset).T
    ahead = arm.a1 + arm.c2 * np.sin(q2) + arm.c3 * np.sin(q2 + q3) + arm.a2 * np.cos(q2 + q3)
    bend = arm.c3 * np.sin(q3) + arm.a2 * np.cos(q3)
    return np.asarray(ahead), np.asarray(bend)
