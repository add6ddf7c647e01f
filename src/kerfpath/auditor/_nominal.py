"""The tool axes required by a plan, including its tilts, by the audit's own calculation."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from kerfpath._arrays import Array
from kerfpath.plans import Plan

__all__ = ["axes_asked_for", "tilt_turns"]


def tilt_turns(plan: Plan) -> Array:
    """Return the rotations from the nominal axes to the tilted ones at the nodes, (K, 3) rad.

    They are rotation vectors in the robot base, from lead and lean as defined in `kerfpath.Tilt`;
    NaN where the path has no direction across the axis.
    """
    if not plan.tilt.any():
        return np.zeros((len(plan.q), 3))
    step = np.diff(plan.contour.points, axis=0)
    ahead = np.vstack([step, step[:1] if plan.contour.closed else step[-1:]])
    z = plan.contour.axes
    y = np.cross(z, ahead)
    with np.errstate(invalid="ignore"):
        y /= np.linalg.norm(y, axis=1, keepdims=True)
    turn = plan.tilt[:, :1] * y + plan.tilt[:, 1:] * np.cross(y, z)
    return np.asarray(turn @ plan.T_base_part[:3, :3].T)


def axes_asked_for(nominal: Array, s_nodes: Array, turn_nodes: Array, s: Array) -> Array:
    """Return the tilted axes (B, 3) at arc lengths s (B,) m, given the nominal axes (B, 3).

    Between the nodes, at s_nodes (K,) m, the rotations turn_nodes (K, 3) rad are interpolated
    linearly.
    """
    turn = np.stack([np.interp(s, s_nodes, part) for part in turn_nodes.T], axis=1)
    return np.asarray(Rotation.from_rotvec(turn).apply(nominal))
