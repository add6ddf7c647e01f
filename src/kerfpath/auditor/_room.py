"""Check that the tool can back off at both ends of a plan, with the joint chain alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kerfpath._arrays import Array
from kerfpath.auditor._chain import JointChain, chain_of
from kerfpath.auditor._motion import follow
from kerfpath.auditor._table import Check
from kerfpath.plans import Plan

__all__ = ["retract_checks"]

SLACK = 1e-8
"""rad: as for the joints at the nodes."""
MISSED = 1e-6
"""m and rad: largest error of a pose that counts as reached; Newton's method ends far below."""
OUT_OF_REACH = 2 * np.pi
"""rad: excess that means that there is no way, or only one through a singularity."""
PARTS = 10
"""Number of parts in which the retract is followed."""


def retract_checks(plan: Plan, retract: float | None) -> list[Check]:
    """Return the check that a retract (m) is possible at both ends of a plan; None: no check."""
    if retract is None:
        return []
    chain = chain_of(plan.robot)
    ends = np.array([0, len(plan.q) - 1])
    q, over = plan.q[ends], np.full(2, -OUT_OF_REACH)
    chain = replace(chain, tip=chain.tip @ plan.T_flange_tip)
    start, side = chain.forward(q), _side(chain, q)
    limits, bound = plan.robot.joint_limits(), ~plan.robot.endless
    for part in np.arange(1, PARTS + 1) / PARTS:
        T = start.copy()
        T[:, :3, 3] -= part * retract * T[:, :3, 2]
        q, missed = follow(chain, T, q)
        beyond = np.maximum(limits.lower - q, q - limits.upper)[:, bound].max(
            axis=1, initial=-OUT_OF_REACH
        )
        for coupling in plan.robot.couplings:
            value = q @ coupling.row
            beyond = np.maximum(beyond, np.maximum(coupling.lower - value, value - coupling.upper))
        kept = (missed <= MISSED) & (_side(chain, q) == side)
        over = np.maximum(over, np.where(kept, beyond, OUT_OF_REACH))
        if (over >= OUT_OF_REACH).any():
            break
    worst = int(np.argmax(over))
    out = " (no way there in the posture)" if over[worst] >= OUT_OF_REACH else ""
    return [
        Check(
            code="retract",
            title=f"excess over the joint limits where the tool backs off by {retract * 1e3:g} mm"
            f"{out}",
            value=float(over[worst]),
            limit=SLACK,
            unit="rad",
            node=int(ends[worst]),
            advice="lower retract_mm in [program] or gamma_step_deg in [plan], or move the part",
        )
    ]


def _side(chain: JointChain, q: Array) -> Array:
    """Return on which side (B,) of its singularities a six-axis arm is; 0 for other arms."""
    _, J = chain.jacobian(q)
    return np.sign(np.linalg.det(J)) if J.shape[1] == J.shape[2] else np.zeros(len(q))
