"""Bound (6) where the acceleration depends on the configuration: a table over joints 2 and 3.

The bound at a vertex is the one that holds everywhere times a factor, bilinear between the nodes of
the table and 1 outside it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kerfpath.arrays import Array, freeze
from kerfpath.kernels.jit import jit, jit_inline

__all__ = ["NO_TABLE", "ChangeTable", "change_factors", "fill_change"]


class ChangeTable(NamedTuple):
    """Factors on bound (6), by joints 2 and 3."""

    joint_2: Array
    """(A,) rad, increasing; (0,) if the bound is the same everywhere."""
    joint_3: Array
    """(B,) rad, increasing."""
    factor: Array
    """(A, B, n), not below 1."""


NO_TABLE = ChangeTable(freeze(np.empty(0)), freeze(np.empty(0)), freeze(np.empty((0, 0, 0))))
"""The same bound everywhere."""


@jit_inline
def _cell(nodes: Array, x: float) -> int:
    """Index of the node before x, which lies between the first and the last node."""
    a, b = 0, len(nodes) - 1
    while b - a > 1:
        middle = (a + b) // 2
        if nodes[middle] <= x:
            a = middle
        else:
            b = middle
    return a


@jit_inline
def fill_change(table: ChangeTable, x: float, y: float, bound: Array, out: Array) -> None:
    """Fill the bound (n,) on changes of increments where joints 2 and 3 are x and y rad.

    bound (n,) is the one that holds everywhere.
    """
    n, a, b = len(bound), len(table.joint_2) - 1, len(table.joint_3) - 1
    if (
        a < 0
        or not (table.joint_2[0] <= x <= table.joint_2[a])
        or not (table.joint_3[0] <= y <= table.joint_3[b])
    ):
        for i in range(n):
            out[i] = bound[i]
        return
    p, r = _cell(table.joint_2, x), _cell(table.joint_3, y)
    u = (x - table.joint_2[p]) / (table.joint_2[p + 1] - table.joint_2[p])
    w = (y - table.joint_3[r]) / (table.joint_3[r + 1] - table.joint_3[r])
    for i in range(n):
        # This form gives a constant table its value without rounding.
        f = table.factor
        low = f[p, r, i] + w * (f[p, r + 1, i] - f[p, r, i])
        high = f[p + 1, r, i] + w * (f[p + 1, r + 1, i] - f[p + 1, r, i])
        out[i] = bound[i] * (low + u * (high - low))


@jit
def _fill_factors(table: ChangeTable, q: Array, ones: Array, out: Array) -> None:
    for k in range(len(q)):
        fill_change(table, q[k, 1], q[k, 2], ones, out[k])


def change_factors(table: ChangeTable, q: Array) -> Array:
    """Return the factors (..., n) on bound (6) at joints q (..., n) rad."""
    if not len(table.joint_2):
        return np.ones_like(q)
    out = np.empty_like(q, order="C")
    n = q.shape[-1]
    _fill_factors(table, freeze(q.reshape(-1, n).copy()), freeze(np.ones(n)), out.reshape(-1, n))
    return out
