"""The checks of joint velocities, accelerations, torques and jerks, node by node."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from kerfpath._arrays import Array
from kerfpath.auditor._between import BetweenNodes
from kerfpath.auditor._motion import joint_increments
from kerfpath.auditor._rounding import MOST_ROUNDED, Rounding
from kerfpath.auditor._table import Check
from kerfpath.auditor._torque import LagrangeArm
from kerfpath.plans import Plan

__all__ = ["rate_checks"]

SHARE_SLACK = 1e-6
"""Relative slack on limits that the planner may use up to the last digit."""


def rate_checks(plan: Plan, reached: BetweenNodes, rounding: Rounding | None) -> list[Check]:
    """Return the checks of joint velocities, accelerations, torques and jerks."""
    velocity, acceleration = plan.robot.speed_limits()
    eta_v, eta_a = plan.settings.eta_v, plan.settings.eta_a
    dt = np.diff(plan.time)
    dq = joint_increments(plan)
    speed = np.abs(dq / dt[:, None]) / velocity
    fine = reached.speed / dt[:, None] / velocity
    left = None if rounding is None else rounding.of_velocity(dq, dt) / velocity
    rows = [
        _per_joint(plan, "velocity", "joint velocity from node to node", speed, eta_v, left),
        _per_joint(plan, "velocity-between", "joint velocity between the nodes", fine, 1.0, left),
    ]
    if len(dq) > 1:
        change = np.diff(dq / dt[:, None], axis=0) / ((dt[1:] + dt[:-1]) / 2)[:, None]
        share = np.abs(change) / acceleration
        left = None if rounding is None else rounding.of_acceleration(dq, dt) / acceleration
        rows.append(
            _per_joint(plan, "acceleration", "joint acceleration at the nodes", share, eta_a, left)
        )
        rows += _torques(plan, dq, dt, change, rounding)
        rows += _jerks(plan, dq, dt, change, rounding)
    return rows


def _torques(
    plan: Plan, dq: Array, dt: Array, change: Array, rounding: Rounding | None
) -> Iterator[Check]:
    """Yield the check of the torques for accelerations `change` (K-2, n) rad/s^2."""
    arm = LagrangeArm.of(plan.robot)
    if arm is None:
        return
    velocity, q = dq / dt[:, None], plan.q[1:-1]
    share = np.abs(arm.torque(q, (velocity[1:] + velocity[:-1]) / 2, change)) / plan.robot.torque
    left = None
    if rounding is not None:
        M, _ = arm.inertia(q)
        left = np.einsum("bij,bj->bi", np.abs(M), rounding.of_acceleration(dq, dt))
        left = left / plan.robot.torque
    title = "joint torque at the nodes, without friction and rotors"
    yield _per_joint(plan, "torque", title, share, 1.0, left)


def _jerks(
    plan: Plan, dq: Array, dt: Array, change: Array, rounding: Rounding | None
) -> Iterator[Check]:
    """Yield the check of the jerks between accelerations `change` (K-2, n) rad/s^2.

    In a text with short intervals, rounding appears as jerk; where it explains much of the jerk,
    the check is only a warning.
    """
    limit = plan.robot.jerk_limit()
    if limit is None or len(change) < 2:
        return
    inside = dt[1:-1, None]
    share = np.abs(np.diff(change, axis=0) / inside) / limit.bound
    left = None
    if rounding is not None:
        off = rounding.of_acceleration(dq, dt)
        left = (off[1:] + off[:-1]) / inside / limit.bound
    row = _per_joint(plan, "jerk", "joint jerk between the nodes", share, 1.0, left, 1)
    coarse = left is not None and bool((left > MOST_ROUNDED).any())
    yield replace(row, level="warning") if coarse else row


def _per_joint(
    plan: Plan,
    code: str,
    title: str,
    share: Array,
    limit: float,
    left: Array | None,
    first: int | None = None,
) -> Check:
    """Check shares (rows, joints) of a limit, which is widened by rounding errors `left` at each.

    Row 0 belongs to node `first`; default: 0 for K - 1 rows, 1 for the accelerations.
    """
    first = len(plan.q) - 1 - len(share) if first is None else first
    wider = np.zeros(share.shape) if left is None else np.minimum(left, MOST_ROUNDED)
    over = np.where(np.isnan(share), np.inf, share - wider)
    row, joint = (int(i) for i in np.unravel_index(np.argmax(over), over.shape))
    digits = f"; {wider[row, joint] * 100:.2g} % of it for digits" if left is not None else ""
    return Check(
        code=code,
        title=f"{title} (highest: {plan.robot.joint_names[joint]}{digits})",
        value=float(share[row, joint]),
        limit=limit * (1 + SHARE_SLACK) + float(wider[row, joint]),
        unit="share",
        node=first + row,
        advice="lower the speed or eta, or move the part",
    )
