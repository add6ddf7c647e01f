"""Compute what follows from the joints of a plan: gamma, tilt, posture, turns, and cost."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kerfpath._arrays import Array, Ints
from kerfpath.auditor import chain_of
from kerfpath.plans import Plan, path_cost
from kerfpath.robots import Robot

__all__ = ["SAME", "recompute"]

SAME = 1e-7
"""Tolerance, relative or absolute below 1 (m, rad, s); two machines agree far better."""
SAME_POSTURE = 1e-5
"""Error of an inverse near a singularity, rad; postures are much farther apart."""
NO_TILT = 1e-9
"""Tilt, rad, below which it is attributed to rounding."""


def recompute(plan: Plan) -> Plan:
    """Return the plan with everything that its joints, contour and settings decide.

    Values of the plan that agree are kept to the last digit: an angle near pi may be written as one
    near -pi, and at a singularity several postures fit the joints.
    """
    tilt, gamma = _rotation(plan)
    made = replace(
        plan,
        tilt=tilt,
        gamma=gamma,
        posture=_posture(plan.robot, plan.q, plan.posture),
        turn=_turn(plan.robot, plan.q, plan.turn),
    )
    return replace(made, cost=_cost(made))


def _rotation(plan: Plan) -> tuple[Array, Array]:
    """Return lead and lean (K, 2) and gamma (K,) of the joints, by the audit's kinematics."""
    tip = chain_of(plan.robot).forward(plan.q) @ plan.T_flange_tip
    tilt = np.zeros((len(plan.q), 2))
    if plan.settings.tilt is not None:
        along = plan.contour.along @ plan.T_base_part[:3, :3].T
        nominal = plan.contour.axes @ plan.T_base_part[:3, :3].T
        cross = np.cross(nominal, tip[:, :3, 2])
        sine = np.linalg.norm(cross, axis=1)
        angle = np.arctan2(sine, (nominal * tip[:, :3, 2]).sum(axis=1))
        turn = cross * (angle / np.maximum(sine, 1e-300))[:, None]
        tilt[:, 0] = (turn * np.cross(nominal, along)).sum(axis=1)
        tilt[:, 1] = (turn * along).sum(axis=1)
        tilt[np.abs(tilt) < NO_TILT] = 0.0
    if not plan.robot.family.free_rotation:
        return tilt, np.zeros(len(plan.q))
    frames = replace(plan, tilt=tilt).frames
    x = tip[:, :3, 0]
    gamma = np.arctan2((x * frames[:, :3, 1]).sum(axis=1), (x * frames[:, :3, 0]).sum(axis=1))
    off = np.remainder(plan.gamma - gamma + np.pi, 2 * np.pi) - np.pi
    agrees = (np.abs(off) <= SAME) & (np.abs(plan.gamma) <= np.pi + SAME)
    return tilt, np.where(agrees, plan.gamma, gamma)


def _posture(robot: Robot, q: Array, said: Ints) -> Ints:
    """Return the postures (K,) of joints q (K, n); those `said` where they fit, too.

    At a singularity, where no posture gives the joints back, any may be right.
    """
    arm = robot.alone()
    q = np.ascontiguousarray(q[:, : arm.joints])
    solved, reach = arm.inverse_all(np.ascontiguousarray(arm.forward(q)), arm.given_of(q))
    off = np.abs(np.remainder(solved - q[:, None] + np.pi, 2 * np.pi) - np.pi)
    fits = reach & (np.where(reach[..., None], off, np.inf).max(axis=2) < SAME_POSTURE)
    row = np.arange(len(q))
    known = (said >= 0) & (said < arm.postures)
    kept = known & (fits[row, np.where(known, said, 0)] | ~fits.any(axis=1))
    return np.where(kept, said, np.argmax(fits, axis=1))


def _turn(robot: Robot, q: Array, said: Ints) -> Ints:
    """Return the turns (K, n) from (-pi, pi] to joints q (K, n); free joints have none."""
    turn = np.ceil((q - np.pi) / (2 * np.pi)).astype(np.int64)
    kept = np.abs(q - 2 * np.pi * said) <= np.pi + SAME
    turn = np.where(kept, said, turn)
    turn[:, robot.free] = 0
    return turn


def _cost(plan: Plan) -> float:
    """Return the objective of a plan; the penalty of clearance is the plan's, within its bounds."""
    s = plan.settings
    cost = path_cost(plan.increments, s.weights, s.metric, s.objective, plan.node_cost)
    band = None if s.comfort is None else s.comfort.clearance
    if band is not None and band.cost:
        most = band.cost * (len(plan.q) if s.objective == "sum" else 1)
        if cost * (1 - SAME) <= plan.cost <= cost + most:
            return plan.cost
    return cost
