"""Bound (6) where the acceleration depends on the configuration: a table over joints 2 and 3.

The bound at a vertex is the one that holds everywhere times a factor, bilinear between the nodes of
the table and 1 outside it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kerfpath.arrays import Array, freeze
from kerfpath.kernels.jit import jit, jit_inline

__all__ = ["NO_TABLE", "ChangeTable", "change_factors", "fill_change", "most_factors"]

ROUNDED = 1e-12
"""Allowance for rounding, as a share."""


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


@jit
def _fill_most(table: ChangeTable, low: Array, high: Array, ones: Array, out: Array) -> None:
    a, b = len(table.joint_2) - 1, len(table.joint_3) - 1
    value = np.empty(len(ones))
    for c in range(len(low)):
        out[c] = 1.0
        first, last = max(low[c, 1], table.joint_2[0]), min(high[c, 1], table.joint_2[a])
        left, right = max(low[c, 2], table.joint_3[0]), min(high[c, 2], table.joint_3[b])
        if not (first <= last and left <= right):
            continue  # outside the table
        p, x = _cell(table.joint_2, first), first
        while True:
            r, y = _cell(table.joint_3, left), left
            while True:
                fill_change(table, x, y, ones, value)
                for i in range(len(ones)):
                    out[c, i] = max(out[c, i], value[i])
                if y >= right:
                    break
                r += 1
                y = min(table.joint_3[r], right)
            if x >= last:
                break
            p += 1
            x = min(table.joint_2[p], last)


def most_factors(table: ChangeTable, low: Array, high: Array) -> Array:
    """Return the largest factors (C, n) on bound (6) over boxes of the joints, rounded up.

    A bilinear function is largest at a corner: of the box, or where lines of the table cross it.

    Parameters
    ----------
    table : ChangeTable
        With nodes.
    low, high : (C, n) rad
    """
    n = low.shape[1]
    out = np.empty((len(low), n))
    ends = np.ascontiguousarray(low), np.ascontiguousarray(high)
    _fill_most(table, *ends, freeze(np.ones(n)), out)
    return np.asarray(np.minimum(out * (1 + ROUNDED), table.factor.max(axis=(0, 1))))
