"""Where the tool goes before and after a cut: straight back along its axis."""

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
    """Return the joints (n,) rad after backing off an end of a plan along the tool axis.

    The posture is kept, an endless joint stays on its turn, and external axes stand still, as does
    joint 3 of a seven-axis arm.

    Parameters
    ----------
    plan : Plan
    end : {"start", "end"}
    retract : float m

    Raises
    ------
    InputError
        No such pose within the joint limits.
    """
    node = 0 if end == "start" else len(plan.q) - 1
    # Where endless joints are after all their turns along the contour.
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
    # A straight move leads to no joints that are a turn away, where the limits end before.
    q_found = q_found[(np.abs(q_found - q) <= np.pi).all(axis=1)]
    if not len(q_found):
        raise InputError(
            f"contour {plan.name!r}, node {node}: the tool cannot back off by {retract * 1e3:g} mm "
            f"in posture {posture_name(int(plan.posture[node]))} within the joint limits; lower "
            "the retract"
        )
    nearest = q_found[int(np.argmin(np.abs(q_found - q).max(axis=1)))]
    return freeze(nearest)
