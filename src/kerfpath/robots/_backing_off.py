"""Whether the tool can go straight back along its axis, as before and after a cut."""

from __future__ import annotations

import numpy as np

from kerfpath._arrays import Array, Bools, Ints
from kerfpath.robots._robot import Robot

__all__ = ["can_back_off"]


def can_back_off(
    robot: Robot, q: Array, posture: Ints, tool: Array, retract: float, margin: float = 0.0
) -> Bools:
    """Return of which joints (B,) the tool can back off along its axis within the joint limits.

    The posture is kept, and no joint goes more than half a turn; an external axis stays.

    Parameters
    ----------
    robot : Robot
    q : (B, n) rad
    posture : (B,) int
    tool : (4, 4) m
        T_flange_tip.
    retract : float m
    margin : float rad
        Kept from every limit there.
    """
    arm, q = robot.alone(), q[:, : robot.family.joints]
    T = arm.forward(q) @ tool
    T[:, :3, 3] -= retract * T[:, :3, 2]
    back = arm.follow(T @ np.linalg.inv(tool), q, posture)
    limits = arm.joint_limits()
    reached = np.asarray(np.isfinite(back).all(axis=1))
    back = np.where(reached[:, None], back, q)
    room = np.minimum(back - limits.lower, limits.upper - back)
    sums = back @ limits.rows.T
    coupled = np.minimum(sums - limits.row_lower, limits.row_upper - sums)
    held = ((room >= margin) | limits.endless).all(axis=1) & (coupled >= margin).all(axis=1)
    return np.asarray(reached & held)
