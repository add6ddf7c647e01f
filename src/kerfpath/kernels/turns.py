"""Admissible turns of a posture: joint limits q_min <= q <= q_max over I_q (section 2.2).

A joint with a finite range admits every representative q + 2 pi t inside it, each as a separate
vertex; an endless joint has one representative, compared modulo 2 pi by (13).

Reason codes are indices into `Robot.reasons`: the `Loss` if a pose is admitted or unreachable,
LOW + 2 i and HIGH + 2 i for bound i, with the couplings after the n joints, and the next code if
the posture is not wanted.
"""

from __future__ import annotations

from math import ceil, floor, pi
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kerfpath.arrays import Array, Bools, Ints
from kerfpath.kernels.jit import jit, jit_part
from kerfpath.losses import Loss

__all__ = [
    "ADMITTED",
    "UNREACHABLE",
    "JointLimits",
    "admissible_turns",
    "count_admissible",
    "fill_admissible",
]

ADMITTED, UNREACHABLE = int(Loss.ADMITTED), int(Loss.UNREACHABLE)
LOW, HIGH = int(Loss.LOW), int(Loss.HIGH)

EDGE = 1e-9
"""Slack on joint limits, rad, so that rounding does not drop a pose that is on a limit."""

MOST_TURNS = 4096
"""Room for the combinations of turns of one posture: six joints with 4 turns each."""


class JointLimits(NamedTuple):
    """Ranges of the joints and of their linear couplings, rad."""

    lower: Array
    """(n,)"""
    upper: Array
    """(n,)"""
    endless: Bools
    """(n,)"""
    rows: Array
    """(m, n): coupling r bounds rows[r] @ q."""
    row_lower: Array
    """(m,)"""
    row_upper: Array
    """(m,)"""


@jit_part
def _broken_coupling(q: Array, turn: Ints, limits: JointLimits) -> int:
    """Reason code of the first coupling that q + 2 pi turn breaks, or 0."""
    n = len(q)
    for r in range(len(limits.rows)):
        value = 0.0
        for i in range(n):
            value += limits.rows[r, i] * (q[i] + 2.0 * pi * turn[i])
        if value < limits.row_lower[r] - EDGE:
            return LOW + 2 * (n + r)
        if value > limits.row_upper[r] + EDGE:
            return HIGH + 2 * (n + r)
    return ADMITTED


@jit_part
def admissible_turns(q: Array, limits: JointLimits, out_turn: Ints) -> tuple[int, int]:
    """Fill out_turn (MOST_TURNS, n) with every admissible turn of q (n,) in (-pi, pi].

    Returns their number and, if there is none, the reason code (the first joint without a turn,
    else the coupling that turned the last combination away).
    """
    n = len(q)
    first, last = np.zeros(n, np.int64), np.zeros(n, np.int64)
    for i in range(n):
        if not limits.endless[i]:
            first[i] = ceil((limits.lower[i] - EDGE - q[i]) / (2.0 * pi))
            last[i] = floor((limits.upper[i] + EDGE - q[i]) / (2.0 * pi))
            if last[i] < first[i]:
                below = limits.lower[i] - (q[i] + 2.0 * pi * last[i])
                above = q[i] + 2.0 * pi * first[i] - limits.upper[i]
                return 0, (LOW if below <= above else HIGH) + 2 * i
    turn, count, reason = np.empty(n, np.int64), 0, ADMITTED
    for i in range(n):
        turn[i] = first[i]
    while True:
        broken = _broken_coupling(q, turn, limits)
        if broken == ADMITTED:
            for i in range(n):
                out_turn[count, i] = turn[i]
            count += 1
        else:
            reason = broken
        i = n - 1
        while i >= 0 and turn[i] == last[i]:
            turn[i] = first[i]
            i -= 1
        if i < 0 or count == MOST_TURNS:
            return count, (ADMITTED if count else reason)
        turn[i] += 1


@jit
def count_admissible(
    q: Array,
    reach: Bools,
    wanted: Bools,
    limits: JointLimits,
    out_count: Ints,
    out_reason: NDArray[np.uint8],
) -> None:
    """Count the turns of q (K, m, P, n) per node, out_count (K,); fill out_reason (K, m, P).

    out_reason is the reason why a pose is dropped; wanted (P,) marks the postures that may be used.
    """
    K, m, P, n = q.shape
    turn = np.empty((MOST_TURNS, n), np.int64)
    for k in range(K):
        out_count[k] = 0
        for j in range(m):
            for mu in range(P):
                if not (wanted[mu] and reach[k, j, mu]):
                    unwanted = LOW + 2 * (n + len(limits.rows))
                    out_reason[k, j, mu] = UNREACHABLE if wanted[mu] else unwanted
                    continue
                count, reason = admissible_turns(q[k, j, mu], limits, turn)
                out_count[k] += count
                out_reason[k, j, mu] = reason


@jit
def fill_admissible(
    q: Array,
    reason: NDArray[np.uint8],
    limits: JointLimits,
    out_q: Array,
    out_sample: NDArray[np.signedinteger[Any]],
    out_posture: NDArray[np.signedinteger[Any]],
    out_turn: NDArray[np.signedinteger[Any]],
) -> None:
    """Write the admitted vertices of q (K, m, P, n) one after the other, with their origin."""
    K, m, P, n = q.shape
    turn, v = np.empty((MOST_TURNS, n), np.int64), 0
    for k in range(K):
        for j in range(m):
            for mu in range(P):
                if reason[k, j, mu] != ADMITTED:
                    continue
                count, _ = admissible_turns(q[k, j, mu], limits, turn)
                for t in range(count):
                    for i in range(n):
                        out_q[v, i] = q[k, j, mu, i] + 2.0 * pi * turn[t, i]
                        out_turn[v, i] = turn[t, i]
                    out_sample[v], out_posture[v] = j, mu
                    v += 1
