"""Distances in the weighted joint space, (13)-(15), and the smoothness criteria, (7)-(9)."""

from __future__ import annotations

from math import pi, sqrt
from typing import TypeVar

import numpy as np

from kerfpath.arrays import Array, Bools
from kerfpath.kernels.jit import either, jit, jit_equation, jit_inline, jit_vector, larger, smaller

__all__ = [
    "CHEBYCHEV",
    "EUCLID",
    "MANHATTAN",
    "apart",
    "coordinate_range",
    "extend",
    "finish",
    "increment",
    "increments",
    "increments_between",
    "largest_increment",
    "maximum_distance",
    "rho",
    "total_displacement",
    "total_distance",
    "turns_of",
    "wrap",
    "wrap_angle",
]

_X = TypeVar("_X", float, Array)

EUCLID, MANHATTAN, CHEBYCHEV = 0, 1, 2


def _short(dq: _X) -> _X:
    """Return an increment, a number or an array, taken the short way round.

    Half a turn is equally long either way, but (6) makes a difference. It goes the way that the
    values go, so that it is the same in reverse; between values more than a turn apart it goes the
    way from the even turn.
    """
    short: _X = dq - 2.0 * pi * np.rint(dq / (2.0 * pi))
    return short


def turns_of(q: _X) -> _X:
    """Return by how many turns of 2 pi each angle lies outside (-pi, pi]."""
    turns: _X = np.ceil((q - pi) / (2.0 * pi))
    return turns


def wrap(q: _X) -> _X:
    """Bring angles into (-pi, pi]."""
    wrapped: _X = q - 2.0 * pi * np.ceil((q - pi) / (2.0 * pi))
    return wrapped


_short_way, wrap_angle = jit_inline(_short), jit_inline(wrap)


@jit_equation
def increment(dq: float, endless: bool) -> float:
    """Smallest representative of a joint difference, min over p of dq + 2 pi p (Eq. 13)."""
    return _short_way(dq) if endless else dq


def increments_between(q0: Array, q1: Array, endless: Bools) -> Array:
    """Return the joint increments (..., n) rad from q0 to q1 (..., n) rad."""
    dq = q1 - q0
    return np.where(endless, _short(dq), dq)


def increments(q: Array, endless: Bools) -> Array:
    """Return the joint increments (K-1, n) rad along a path q (K, n) rad."""
    return increments_between(q[:-1], q[1:], endless)


@jit_vector
def apart(difference: float, turn: float) -> float:
    """Size of the increment between two wrapped angles, from the size of their difference.

    turn is 2 pi for an endless joint, infinity for another. It vectorises.
    """
    return smaller(difference, turn - difference)


@jit_vector
def extend(total: float, part: float, metric: int) -> float:
    """Add one weighted increment to the total that `finish` turns into a distance; vectorises."""
    euclid = either(metric == EUCLID, total + part * part, larger(total, part))
    return either(metric == MANHATTAN, total + part, euclid)


@jit_vector
def finish(total: float, metric: int) -> float:
    """Return the distance rho_a of a step from the total of its weighted increments."""
    return either(metric == EUCLID, sqrt(total), total)


@jit
def rho(dq: Array, weight: Array, metric: int) -> float:
    """Weighted length rho_a of a joint increment dq (n,), a in {E, M, C}."""
    total = 0.0
    for i in range(len(dq)):
        total = extend(total, weight[i] * abs(dq[i]), metric)
    return finish(total, metric)


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

    It is taken along the motion, so that an endless joint turning through pi does not jump.
    """
    travelled = np.vstack([np.zeros_like(dq[:1]), np.cumsum(dq, axis=0)])
    return np.asarray(np.ptp(travelled, axis=0))
