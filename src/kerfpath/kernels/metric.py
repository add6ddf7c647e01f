"""Distances in the weighted joint space, (13)-(15), and the smoothness criteria, (7)-(9)."""

from __future__ import annotations

from math import pi, sqrt

import numpy as np

from kerfpath._arrays import Array, Bools
from kerfpath.kernels._jit import jit, jit_inline

__all__ = [
    "CHEBYCHEV",
    "EUCLID",
    "MANHATTAN",
    "coordinate_range",
    "increment",
    "increments",
    "largest_increment",
    "maximum_distance",
    "rho",
    "total_displacement",
    "total_distance",
]

EUCLID, MANHATTAN, CHEBYCHEV = 0, 1, 2


@jit_inline
def increment(dq: float, endless: bool) -> float:
    """Smallest representative of a joint difference, min over p of dq + 2 pi p (Eq. 13)."""
    return dq - 2.0 * pi * np.round(dq / (2.0 * pi)) if endless else dq


@jit
def rho(dq: Array, weight: Array, metric: int) -> float:
    """Weighted length rho_a of a joint increment dq (n,), a in {E, M, C}."""
    total = 0.0
    for i in range(len(dq)):
        part = weight[i] * abs(dq[i])
        if metric == EUCLID:
            total += part * part
        elif metric == MANHATTAN:
            total += part
        else:
            total = max(total, part)
    return sqrt(total) if metric == EUCLID else total


@jit
def increments(q: Array, endless: Bools) -> Array:
    """Joint increments (K-1, n) rad along a path q (K, n) rad."""
    dq = q[1:] - q[:-1]
    for k in range(len(dq)):
        for i in range(len(endless)):
            dq[k, i] = increment(dq[k, i], endless[i])
    return dq


@jit
def total_distance(dq: Array, weight: Array, metric: int) -> float:
    """Sum of the distances along a path, J^(s) (Eq. 14); dq (K-1, n)."""
    total = 0.0
    for k in range(len(dq)):
        total += rho(dq[k], weight, metric)
    return total


@jit
def maximum_distance(dq: Array, weight: Array, metric: int) -> float:
    """Largest distance along a path (Eq. 15); dq (K-1, n).

    The paper prints the superscript Delta of the range (9); the formula is that of (8).
    """
    largest = 0.0
    for k in range(len(dq)):
        largest = max(largest, rho(dq[k], weight, metric))
    return largest


def total_displacement(dq: Array) -> Array:
    """Total displacement J_i^(s) of each joint, rad (Eq. 7); dq (K-1, n)."""
    return np.asarray(np.abs(dq).sum(axis=0))


def largest_increment(dq: Array) -> Array:
    """Largest increment J_i^(v) of each joint, rad (Eq. 8); dq (K-1, n), K >= 2."""
    return np.asarray(np.abs(dq).max(axis=0))


def coordinate_range(dq: Array) -> Array:
    """Range J_i^(Delta) that each joint sweeps, rad (Eq. 9); dq (K-1, n).

    Taken along the motion, so that an endless joint turning through pi does not jump.
    """
    travelled = np.vstack([np.zeros_like(dq[:1]), np.cumsum(dq, axis=0)])
    return np.asarray(np.ptp(travelled, axis=0))
