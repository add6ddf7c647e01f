"""Check whether the tool can back off along its axis, as it does before and after a cut."""

from __future__ import annotations

import numpy as np

from kerfpath._arrays import Array, Bools, Ints
from kerfpath.robots._robot import Robot

__all__ = ["can_back_off"]


def can_back_off(
    robot: Robot, q: Array, posture: Ints, tool: Array, retract: float, margin: float = 0.0
) -> Bools:
    """Return from which joint vectors (B,) the tool can back off within the joint limits.

    The tool moves straight along its axis. The posture is kept, no joint moves more than half a
    turn, and external axes do not move.

    Parameters
    ----------
    robot : Robot
    q : (B, n) rad
    posture : (B,) int
    tool : (4, 4) m
        T_flange_tip.
    retract : float m
        How far the tool backs off.
    margin : float rad
        Distance kept from every joint limit in the backed-off pose.
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
