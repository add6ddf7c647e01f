"""Velocity limit (5) and acceleration limit (6) as bounds on finite differences."""

from __future__ import annotations

from math import sqrt

from kerfpath.arrays import Array
from kerfpath.kernels.jit import jit_equation, jit_inline

__all__ = [
    "LIMIT_TOLERANCE",
    "acceleration_excess",
    "acceleration_time",
    "exceeds",
    "velocity_excess",
    "velocity_time",
]

LIMIT_TOLERANCE = 1e-9
"""Slack on (5) and (6), rad: a thousandth of what any encoder resolves, far above rounding."""


@jit_inline
def exceeds(size: float, bound: float) -> bool:
    """Whether the size of an increment, or of its change, exceeds its bound; both rad."""
    return size > bound + LIMIT_TOLERANCE


@jit_equation
def velocity_excess(dq: Array, bound: Array) -> int:
    """First joint with |q_k - q_{k-1}| > eta_v dq^(v), or -1: the test f_v (Eq. 5).

    dq (n,) is the increment, bound (n,) is eta_v q'max dt, both rad.
    """
    for i in range(len(dq)):
        if exceeds(abs(dq[i]), bound[i]):
            return i
    return -1


@jit_equation
def acceleration_excess(dq: Array, dq_before: Array, bound: Array) -> int:
    """First joint with |q_k - 2 q_{k-1} + q_{k-2}| > eta_a dq^(a), or -1: the test f_a (Eq. 6).

    dq, dq_before (n,) are successive increments, bound (n,) is eta_a q''max dt^2, all rad.
    """
    for i in range(len(dq)):
        if exceeds(abs(dq[i] - dq_before[i]), bound[i]):
            return i
    return -1


@jit_inline
def velocity_time(dq: Array, bound: Array) -> float:
    """Time, in node intervals, in which (5) holds: largest |dq_i| over its bound, both (n,) rad."""
    least = 0.0
    for i in range(len(dq)):
        least = max(least, abs(dq[i]) / bound[i])
    return least


@jit_inline
def acceleration_time(dq: Array, dq_before: Array, bound: Array) -> float:
    """Time, in node intervals, in which (6) holds: root of the largest change over its bound.

    dq, dq_before (n,) are successive increments, bound (n,) is that of their change, all rad.
    """
    least = 0.0
    for i in range(len(dq)):
        least = max(least, abs(dq[i] - dq_before[i]) / bound[i])
    return sqrt(least)
