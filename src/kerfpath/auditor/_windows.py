"""Check that gamma keeps its windows, from the joints and the path alone."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from kerfpath._arrays import Array
from kerfpath.auditor._nominal import tilt_turns
from kerfpath.auditor._table import Check
from kerfpath.contour import Contour
from kerfpath.plans import Plan

__all__ = ["window_checks"]

SLACK = 1e-6
"""rad: allowance for two kinematics and for the digits of a window's ends, far below a degree."""
ON_IT = 1e-9
"""m: a node this close to the end of a stretch is on it."""


def window_checks(plan: Plan, tool: Array, *, slack: float = SLACK) -> list[Check]:
    """Return the check of the windows of gamma; no check if there are none.

    Parameters
    ----------
    plan : Plan
    tool : (K, 4, 4) m
        Poses of the tool in the robot base.
    slack : float rad
        By how much gamma may be outside, for rounding.
    """
    windows = plan.settings.gamma_windows
    if not windows:
        return []
    nominal = _reference(plan.contour, plan.settings.frames) @ plan.T_base_part[:3, :3].T
    x = Rotation.from_rotvec(tilt_turns(plan)).apply(nominal)
    y = np.cross(tool[:, :3, 2], x)
    gamma = np.arctan2((tool[:, :3, 0] * y).sum(axis=1), (tool[:, :3, 0] * x).sum(axis=1))
    out, s = np.zeros(len(gamma)), plan.contour.s
    for w in windows:
        half = np.mod(w.high - w.low, 2 * np.pi) / 2
        off = np.abs(np.angle(np.exp(1j * (gamma - w.low - half))))
        held = (s >= w.start - ON_IT) & (s <= w.end + ON_IT)
        out = np.where(held, np.maximum(out, off - half), out)
    node = int(np.argmax(np.where(np.isnan(out), np.inf, out)))
    return [
        Check(
            code="gamma-window",
            title="gamma outside its pinned windows at the nodes",
            value=float(out[node]),
            limit=slack,
            unit="rad",
            node=node,
        )
    ]


def _reference(contour: Contour, kind: str) -> Array:
    """Return the directions (K, 3) of gamma = 0, in the part."""
    n, step = contour.axes, np.diff(contour.points, axis=0)
    if contour.x is not None:
        return _across(contour.x, n)
    ahead = np.vstack([step, step[:1] if contour.closed else step[-1:]])
    if kind == "tangent":
        return _across(ahead, n)
    x = np.empty_like(n)
    x[0] = _across(ahead[:1], n[:1])[0]
    for k in range(len(n) - 1):  # the least rotation that takes one axis to the next
        turn, cosine = np.cross(n[k], n[k + 1]), n[k] @ n[k + 1]
        once = np.cross(turn, x[k])
        x[k + 1] = _across((x[k] + once + np.cross(turn, once) / (1 + cosine))[None], n[k + 1])[0]
    if not contour.closed:
        return x
    missing = np.arctan2(n[-1] @ np.cross(x[-1], x[0]), x[-1] @ x[0])
    share = (contour.s - contour.s[0]) / (contour.s[-1] - contour.s[0])
    return np.asarray(Rotation.from_rotvec((missing * share)[:, None] * n).apply(x))


def _across(v: Array, n: Array) -> Array:
    """Return the components of v (K, 3) perpendicular to n, scaled to length one."""
    across = v - (v * n).sum(axis=-1, keepdims=True) * n
    return np.asarray(across / np.linalg.norm(across, axis=-1, keepdims=True))
