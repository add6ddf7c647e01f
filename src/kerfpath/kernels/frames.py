"""Task frames of the augmented line: H_k and L_k(gamma), section 2.1 of the paper."""

from __future__ import annotations

from math import atan2, sqrt

import numpy as np

from kerfpath.arrays import Array
from kerfpath.kernels.jit import jit, jit_equation, jit_inline

__all__ = ["closing_twist", "location", "rotation_minimising_x", "tangent_x"]

DEGENERATE_SINE = 1e-6
"""Sine of the angle between tangent and tool axis below which a node has no usable direction."""


@jit_inline
def _dot(a: Array, b: Array) -> float:
    product: float = a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    return product


@jit
def tangent_x(p: Array, n: Array, closed: bool, out_x: Array) -> int:
    """Project the unit directions a_k on the planes normal to n_k; return the bad node, or -1.

    a_k points from p_k to p_{k+1}; the last node takes a_n = a_0 on a closed contour (section
    2.1) and the previous direction on an open one.
    """
    last = len(p) - 1
    a = np.empty(3)
    for k in range(last + 1):
        j = k if k < last else (0 if closed else last - 1)
        for i in range(3):
            a[i] = p[j + 1, i] - p[j, i]
        length = sqrt(_dot(a, a))
        along = _dot(a, n[k]) / length
        for i in range(3):
            a[i] = a[i] / length - along * n[k, i]
        sine = sqrt(_dot(a, a))
        if sine < DEGENERATE_SINE:
            return k
        for i in range(3):
            out_x[k, i] = a[i] / sine
    return -1


@jit_inline
def _reflect(x: Array, v: Array, vv: float) -> None:
    """Reflect x at the plane normal to v; vv is v . v."""
    share = 2.0 * _dot(v, x) / vv
    for i in range(3):
        x[i] -= share * v[i]


@jit
def rotation_minimising_x(n: Array, out_x: Array) -> int:
    """Carry out_x[0] along the axes n_k without rotation about them; return the bad node, or -1.

    Double reflection (Wang, Juettler, Zheng and Liu, ACM Trans. Graph. 27(1), 2008) on the curve
    whose tangent is the tool axis: reflect at the plane normal to n_k + n_{k+1}, then at the plane
    normal to n_{k+1}.
    """
    v, x = np.empty(3), np.empty(3)
    for k in range(len(n) - 1):
        for i in range(3):
            v[i], x[i] = n[k, i] + n[k + 1, i], out_x[k, i]
        vv = _dot(v, v)
        if vv < DEGENERATE_SINE * DEGENERATE_SINE:
            return k + 1
        _reflect(x, v, vv)
        _reflect(x, n[k + 1], 1.0)
        along = _dot(n[k + 1], x)
        for i in range(3):
            x[i] -= along * n[k + 1, i]
        length = sqrt(_dot(x, x))
        for i in range(3):
            out_x[k + 1, i] = x[i] / length
    return -1


@jit
def closing_twist(n: Array, x: Array) -> float:
    """Return the angle about n_n from the carried direction x_n to the first direction x_0, rad."""
    z, last, first = n[-1], x[-1], x[0]
    sine = (
        z[0] * (last[1] * first[2] - last[2] * first[1])
        + z[1] * (last[2] * first[0] - last[0] * first[2])
        + z[2] * (last[0] * first[1] - last[1] * first[0])
    )
    return atan2(sine, _dot(last, first))


@jit_equation
def location(H: Array, cos_gamma: float, sin_gamma: float, out_L: Array) -> None:
    """Turn a task frame about its own z-axis, L_k = H_k R_z(gamma) (Eq. 2).

    Vectors are columns; the paper prints R_z . H_k and means the rotation about z_k.
    """
    for i in range(3):
        x, y = H[i, 0], H[i, 1]
        out_L[i, 0] = x * cos_gamma + y * sin_gamma
        out_L[i, 1] = y * cos_gamma - x * sin_gamma
        out_L[i, 2] = H[i, 2]
        out_L[i, 3] = H[i, 3]
