"""Joint motion with velocities and accelerations, also in the coordinates of pinocchio."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from kerfpath._arrays import Array, freeze
from kerfpath.errors import InputError

__all__ = ["JointMotion", "in_model", "node_rates"]


class JointMotion(NamedTuple):
    """Joints, velocities and accelerations at the nodes of a motion."""

    time: Array
    """(K,) s."""
    q: Array
    """(K, n) rad; a linear axis: m."""
    v: Array
    """(K, n) rad/s; a linear axis: m/s."""
    a: Array
    """(K, n) rad/s^2; a linear axis: m/s^2."""


def node_rates(time: Array, q: Array) -> tuple[Array, Array]:
    """Return velocities and accelerations (K, n), rad/s and rad/s^2, of joints q (K, n) rad.

    They are those of the parabola through a node and its two neighbours; the first and the last
    node use the parabola of the node beside them. With only two nodes they are those of a straight
    line. `time` (K,) is in seconds.
    """
    step = np.diff(time)[:, None]
    slope = np.diff(q, axis=0) / step
    if len(time) < 3:
        return np.tile(slope.sum(axis=0), (len(time), 1)), np.zeros_like(q)
    before, after = step[:-1], step[1:]
    inner = (after * slope[:-1] + before * slope[1:]) / (before + after)
    bend = 2 * np.diff(slope, axis=0) / (before + after)
    first, last = slope[:1] - bend[:1] * step[0] / 2, slope[-1:] + bend[-1:] * step[-1] / 2
    return np.vstack([first, inner, last]), np.vstack([bend[:1], bend, bend[-1:]])


def in_model(motion: JointMotion, names: Sequence[str], model: Any) -> JointMotion:
    """Return a motion of joints with the given names in the coordinates of a pinocchio model.

    Parameters
    ----------
    motion : JointMotion
    names : sequence of str
    model : pinocchio.Model
        With these joints and no others, in any order.

    Raises
    ------
    InputError
        `model` is no pinocchio model, lacks one of the joints, or has others.
    """
    if not hasattr(model, "existJointName"):
        raise InputError(f"model: expected a pinocchio.Model, got {type(model).__name__}")
    missing = [name for name in names if not model.existJointName(name)]
    if missing or model.nv != len(names):
        what = f"no {', '.join(missing)}" if missing else f"{model.nv} degrees of freedom"
        raise InputError(
            f"model: expected exactly the joints {', '.join(names)}, got one with {what}; "
            "use pinocchio.buildModelFromXML(plan.robot.to_urdf())"
        )
    q = np.zeros((len(motion.time), model.nq))
    v, a = np.zeros((2, len(q), model.nv))
    for i, name in enumerate(names):
        joint = model.joints[model.getJointId(name)]
        # Pinocchio stores a joint that turns without end as a point on the unit circle.
        turns = joint.nq == 2
        value = motion.q[:, i]
        q[:, joint.idx_q] = np.cos(value) if turns else value
        if turns:
            q[:, joint.idx_q + 1] = np.sin(value)
        v[:, joint.idx_v], a[:, joint.idx_v] = motion.v[:, i], motion.a[:, i]
    return JointMotion(motion.time, freeze(q), freeze(v), freeze(a))
