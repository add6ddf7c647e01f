"""The motion between the nodes of a plan, as the controller interpolates it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.spatial.transform import Rotation

from kerfpath._arrays import Array, Ints
from kerfpath._repr import short_repr
from kerfpath.auditor._chain import JointChain
from kerfpath.plans import Plan

__all__ = ["Interpolation", "Motion", "follow", "joint_increments", "motion_of", "straight"]

Interpolation = Literal["linear", "joint"]

NEWTON_STEPS = 12
"""Newton's method doubles its digits each step; a pose not reached after these is not reached."""

REACHED = 1e-9
"""Residual (m and rad) below which a pose counts as reached."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Motion:
    """Joints and tool at f = 0, 1/m, ..., 1 of the way from each node to the next.

    Parameters
    ----------
    q : (K-1, m+1, n) rad
        Joints; external axes come last, a rail in m.
    tip : (K-1, m+1, 3) m
        Tool tip in the robot base.
    axis : (K-1, m+1, 3)
        Tool axis in the robot base.
    residual : (K-1, m+1)
        Error of the commanded pose, the larger of m and rad.
    """

    q: Array
    tip: Array
    axis: Array
    residual: Array

    __repr__ = short_repr


def joint_increments(plan: Plan) -> Array:
    """Return joint increments (K-1, n) rad; an endless joint goes the short way round (13).

    Half a turn is equally long either way; it goes the way that the values go.
    """
    dq = np.diff(plan.q, axis=0)
    turns = np.round(dq / (2 * np.pi))
    return np.where(plan.robot.endless, dq - turns * 2 * np.pi, dq)


def motion_of(plan: Plan, chain: JointChain, interpolation: Interpolation, parts: int) -> Motion:
    """Return the motion between the nodes, each interval divided into `parts` equal times.

    "linear": from pose to pose the tip moves straight and the tool turns evenly about one axis, as
    in linear moves; the joints follow by inverse kinematics. "joint": the joints move evenly. In
    both, external axes and joint 3 of a seven-axis arm move evenly; the line is straight in the
    part.
    """
    K, dq = len(plan.q), joint_increments(plan)
    f = np.linspace(0.0, 1.0, parts + 1)
    q = plan.q[:-1, None, :] + f[None, :, None] * dq[:, None, :]
    flat = q.reshape(-1, plan.q.shape[1])
    chain = replace(chain, tip=chain.tip @ plan.T_flange_tip)
    residual = np.zeros(len(flat))
    if interpolation == "linear":
        poses = chain.forward(plan.q)
        k = np.repeat(np.arange(K - 1), len(f))
        wanted = straight(poses[:-1], poses[1:], k, np.tile(f, K - 1))
        flat, residual = follow(chain, wanted, flat)
    tool = chain.forward(flat)
    shape = (K - 1, parts + 1)
    return Motion(
        q=flat.reshape(*shape, -1),
        tip=tool[:, :3, 3].reshape(*shape, 3),
        axis=tool[:, :3, 2].reshape(*shape, 3),
        residual=residual.reshape(shape),
    )


def straight(start: Array, end: Array, k: Ints, f: Array) -> Array:
    """Return the poses (B, 4, 4) m at shares f (B,) of the linear moves k (B,) from start to end.

    start, end : (M, 4, 4) m, the ends of each move.
    """
    R0 = start[:, :3, :3]
    turn = Rotation.from_matrix(R0.transpose(0, 2, 1) @ end[:, :3, :3]).as_rotvec()
    T = np.zeros((len(f), 4, 4))
    T[:, :3, :3] = R0[k] @ Rotation.from_rotvec(f[:, None] * turn[k]).as_matrix()
    T[:, :3, 3] = start[k, :3, 3] + f[:, None] * (end[:, :3, 3] - start[:, :3, 3])[k]
    T[:, 3, 3] = 1.0
    return T


def follow(chain: JointChain, wanted: Array, q: Array) -> tuple[Array, Array]:
    """Solve for the tool poses `wanted` (B, 4, 4) by Newton's method from the joints q (B, n).

    A five-axis arm only has to match tip and tool axis. External axes and the joint that runs
    evenly keep their values. Returns the joints and their errors (B,), m and rad.
    """
    q, n = q.copy(), len(chain.axes)
    residual = np.full(len(q), np.inf)
    open_ = np.arange(len(q))
    for _ in range(NEWTON_STEPS):
        T, J = chain.jacobian(q[open_])
        error = np.empty((len(open_), 6))
        error[:, :3] = wanted[open_, :3, 3] - T[:, :3, 3]
        turn = wanted[open_, :3, :3] @ T[:, :3, :3].transpose(0, 2, 1)
        error[:, 3:] = Rotation.from_matrix(turn).as_rotvec()
        if n < 6:
            z = T[:, :3, 2]
            error[:, 3:] = np.cross(z, wanted[open_, :3, 2])
            J[:, 3:] -= z[:, :, None] * np.einsum("bi,bij->bj", z, J[:, 3:])[:, None]
        if chain.even is not None:
            J[:, :, chain.even] = 0.0
        residual[open_] = np.abs(error).max(axis=1)
        late = residual[open_] > REACHED
        if not late.any():
            break
        open_, J, error = open_[late], J[late], error[late]
        # Damped least squares: at a singularity the step stays bounded, and the residual shows it.
        Jt = J.transpose(0, 2, 1)
        step = np.linalg.solve(Jt @ J + 1e-12 * np.eye(n), Jt @ error[..., None])[..., 0]
        q[open_, :n] += np.clip(step, -0.5, 0.5)
    return q, residual
