"""Certificates made by simple means: cells by the other enclosure, potentials by hand."""

import numpy as np

from kerfpath.certificate import BASE, LIFTS, Certificate, Stage

TURN = 2 * np.pi


def every_cell(plan, level=0):
    """All cells of a level that `Arm.enclose` does not rule out: node, posture, index, q, slope.

    On every turn that the ranges let any joint of the cell have.
    """
    K = len(plan.q)
    arm, count = plan.robot, BASE << level
    node = np.repeat(np.arange(K), count)
    index = np.tile(np.arange(count), K)
    width = TURN / count
    half = np.full(len(node), width / 2 + 4e-15)
    found = arm.arm.enclose(
        plan.frames, node, -np.pi + width * (index + 0.5), half, plan.T_flange_tip
    )
    cell, posture = np.nonzero(found.status)
    q, slope, low, high, radius = (
        getattr(found, name)[cell, posture] for name in ("center", "slope", "low", "high", "radius")
    )
    h = width / 2
    reach = np.abs(slope) * h + np.maximum(np.abs(low), np.abs(high)) * h * h / 2 + radius
    limits = arm.joint_limits()
    for i in np.flatnonzero(~limits.endless):
        turns = np.tile(TURN * np.arange(-2, 3), len(cell))
        cell, posture, q, slope, reach = (
            np.repeat(of, 5, axis=0) for of in (cell, posture, q, slope, reach)
        )
        q[:, i] += turns
        fits = (q[:, i] - reach[:, i] <= limits.upper[i]) & (
            q[:, i] + reach[:, i] >= limits.lower[i]
        )
        cell, posture, q, slope, reach = (of[fits] for of in (cell, posture, q, slope, reach))
    keep = np.ones(len(cell), bool)
    for row, lower, upper in zip(limits.rows, limits.row_lower, limits.row_upper, strict=True):
        off = reach @ np.abs(row)
        keep &= (q @ row - off <= upper) & (q @ row + off >= lower)
    return tuple(of[keep] for of in (node[cell], posture, index[cell], q, slope, reach))


def stage_of(node, posture, level, index, q, value=None, dual=None, multipliers=None):
    C, n = q.shape
    return Stage(
        node=node.astype(np.int32),
        posture=posture.astype(np.int8),
        level=np.full(C, level, np.int8),
        index=index.astype(np.int32),
        lift=np.round(q * LIFTS / np.pi).astype(np.int8),
        value=np.zeros((C, 2)) if value is None else value,
        dual=np.zeros((C, 2, n), np.float32) if dual is None else dual.astype(np.float32),
        multipliers=multipliers,
    )


def flat(plan, level=0):
    """The certificate without a potential: least distances between cells."""
    node, posture, index, q, *_ = every_cell(plan, level)
    return Certificate(bound=0.0, stages=(stage_of(node, posture, level, index, q),))


def increments(plan, q, q_next):
    off = q_next[None] - q[:, None]
    return np.where(plan.robot.endless, off - TURN * np.round(off / TURN), off)


def grid_values(plan, node, q, reach, most):
    """The value function over the cells' middles, steps as long as the cells let them be: (C,).

    The metric is "manhattan".
    """
    K = len(plan.q)
    value = np.zeros(len(node))
    for k in range(K - 2, -1, -1):
        here, there = (np.flatnonzero(node == k + i) for i in (0, 1))
        u = increments(plan, q[here], q[there])
        near = (np.abs(u) <= most + reach[here][:, None] + reach[there][None]).all(-1)
        cost = np.abs(u) @ plan.settings.weights + value[there]
        best = np.where(near, cost, np.inf).min(1)
        value[here] = np.where(np.isfinite(best), best, 1e3)
    return value
