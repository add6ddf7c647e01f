"""Range of gamma at both ends of a plan in which the tool can back off."""

from __future__ import annotations

import numpy as np

from kerfpath._arrays import Array
from kerfpath.plans import Plan, has_room
from kerfpath.refiner._curves import JointCurves

__all__ = ["room_at_ends"]

STEP = np.radians(1.5)
"""rad: step in which gamma is tested, from that of the plan on; the range may lose up to this."""
AWAY = STEP * np.arange(61)
"""rad: distances tested in either direction; if all of them have room, gamma is not bounded."""


def room_at_ends(plan: Plan) -> tuple[Array, Array]:
    """Return the least and the largest gamma (K,) rad with room for the retract of a plan.

    They are infinite between the ends, without a retract, and at an end that has no room as it is.
    """
    K, n = plan.q.shape
    low, high = np.full(K, -np.inf), np.full(K, np.inf)
    if plan.settings.retract is None:
        return low, high
    frames, q = plan.frames, plan.unwrapped
    for end in (0, K - 1):
        for bound, sign in ((low, -1.0), (high, 1.0)):
            posture = np.full(len(AWAY), plan.posture[end])
            H = np.broadcast_to(frames[end], (len(AWAY), 4, 4))
            curves = JointCurves(plan.robot, H, plan.T_flange_tip, posture)
            near = np.broadcast_to(q[end], (len(AWAY), n))
            gamma = plan.gamma[end] + sign * AWAY
            there = curves.at(np.column_stack([gamma, near[:, plan.robot.free]]), near)
            reached = np.asarray(np.isfinite(there).all(axis=1))
            there = np.where(reached[:, None], there, near)
            tool = plan.T_flange_tip
            room = has_room(plan.settings, plan.robot, there, posture, tool) & reached
            if room[0] and not room.all():
                bound[end] = plan.gamma[end] + sign * AWAY[np.argmin(room) - 1]
    return low, high
