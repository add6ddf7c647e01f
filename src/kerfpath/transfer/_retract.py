"""Back off along the tool axis before and after a cut."""

from __future__ import annotations

from typing import Literal

import numpy as np

from kerfpath._arrays import Array, freeze
from kerfpath.errors import InputError
from kerfpath.plans import Plan
from kerfpath.robots import posture_name

__all__ = ["End", "back_off"]

End = Literal["start", "end"]


def back_off(plan: Plan, end: End, retract: float) -> Array:
    """Return the joints (n,) rad after backing off along the tool axis from an end of a plan.

    The posture is kept, endless joints stay on their turn, and external axes and joint 3 of a
    seven-axis arm do not move.

    Parameters
    ----------
    plan : Plan
    end : {"start", "end"}
    retract : float m
        How far the tool backs off.

    Raises
    ------
    InputError
        There is no such pose within the joint limits.
    """
    node = 0 if end == "start" else len(plan.q) - 1
    # Endless joints, not wrapped: with all their turns along the contour.
    q = plan.q[0] + plan.increments[:node].sum(axis=0)
    arm, n = plan.robot.alone(), plan.robot.family.joints
    T = arm.forward(q[:n]) @ plan.T_flange_tip
    T[:3, 3] -= retract * T[:3, 2]
    given = arm.given_of(q[None])
    found = arm.inverse(T @ np.linalg.inv(plan.T_flange_tip), given=given)
    q_found = found.q[found.posture == plan.posture[node]]
    q_found = np.hstack([q_found, np.tile(q[n:], (len(q_found), 1))])
    # An endless joint is solved within one turn: bring it onto the turn that the contour is on.
    turns = np.round((q - q_found) / (2 * np.pi)) * plan.robot.endless
    q_found = q_found + 2 * np.pi * turns
    # A straight move cannot reach joints that are a turn away.
    q_found = q_found[(np.abs(q_found - q) <= np.pi).all(axis=1)]
    if not len(q_found):
        raise InputError(
            f"contour {plan.name!r}, node {node}: the tool cannot back off by {retract * 1e3:g} mm "
            f"in posture {posture_name(int(plan.posture[node]))} within the joint limits; lower "
            "the retract"
        )
    nearest = q_found[int(np.argmin(np.abs(q_found - q).max(axis=1)))]
    return freeze(nearest)
