"""Task frames of the augmented line: H_k and L_k(gamma), section 2.1 of the paper."""

from __future__ import annotations

import numpy as np

from kerfpath._arrays import Array
from kerfpath.kernels._jit import jit

__all__ = ["closing_twist", "location", "rotation_minimising_x", "tangent_x"]

DEGENERATE_SINE = 1e-6
"""Sine of the angle between tangent and tool axis below which a node has no usable direction."""


@jit
def tangent_x(p: Array, n: Array, closed: bool, out_x: Array) -> int:
    """Project the unit directions a_k on the planes normal to n_k; return -1, or the bad node.

    a_k points from p_k to p_{k+1}; the last node takes a_n = a_0 on a closed contour (section
    2.1) and the previous direction on an open one.
    """
    last = len(p) - 1
    for k in range(last + 1):
        j = k if k < last else (0 if closed else last - 1)
        a = p[j + 1] - p[j]
        a /= np.sqrt(a @ a)
        x = a - (a @ n[k]) * n[k]
        sine = np.sqrt(x @ x)
        if sine < DEGENERATE_SINE:
            return k
        out_x[k] = x / sine
    return -1


@jit
def rotation_minimising_x(n: Array, out_x: Array) -> int:
    """Carry out_x[0] along the axes n_k without rotation about them; return -1, or the bad node.

    Double reflection (Wang, Juettler, Zheng and Liu, ACM Trans. Graph. 27(1), 2008) on the curve
    whose tangent is the tool axis: reflect at the plane normal to n_k + n_{k+1}, then at the plane
    normal to n_{k+1}.
    """
    for k in range(len(n) - 1):
        v = n[k] + n[k + 1]
        vv = v @ v
        if vv < DEGENERATE_SINE * DEGENERATE_SINE:
            return k + 1
        x = out_x[k] - (2.0 / vv) * (v @ out_x[k]) * v
        x = x - 2.0 * (n[k + 1] @ x) * n[k + 1]
        x = x - (n[k + 1] @ x) * n[k + 1]
        out_x[k + 1] = x / np.sqrt(x @ x)
    return -1


@jit
def closing_twist(n: Array, x: Array) -> float:
    """Return the angle about n_n from the carried direction x_n to the first direction x_0, rad."""
    z = n[-1]
    cosine = x[-1] @ x[0]
    sine = z @ np.cross(x[-1], x[0])
    return float(np.arctan2(sine, cosine))


@jit
def location(H: Array, cos_gamma: float, sin_gamma: float, out_L: Array) -> None:
    """Turn a task frame about its own z-axis, L_k = H_k R_z(gamma) (Eq. 2).

    Column vectors: the paper prints R_z . H_k and means the rotation about z_k.
    """
    for i in range(3):
        x, y = H[i, 0], H[i, 1]
        out_L[i, 0] = x * cos_gamma + y * sin_gamma
        out_L[i, 1] = y * cos_gamma - x * sin_gamma
        out_L[i, 2] = H[i, 2]
        out_L[i, 3] = H[i, 3]
