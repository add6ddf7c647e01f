"""The part of the next layer that the states of a vertex can reach under (5) and (6).

The increments that (6) allows after any of the states that end in a vertex lie in a box, which (5)
makes smaller. The test of which vertices lie in the box takes several at once, and leaves few for
the tests of single vertices.
"""

from __future__ import annotations

import numpy as np

from kerfpath.arrays import Array
from kerfpath.kernels.cost_to_go import LANES, SIX
from kerfpath.kernels.jit import jit_inline, jit_vector, larger, trailing_zeros
from kerfpath.kernels.limits import LIMIT_TOLERANCE
from kerfpath.kernels.metric import apart, wrap_angle
from kerfpath.kernels.search import Aim, SortedLayers, runs
from kerfpath.kernels.states import Scratch, States

__all__ = ["fill_candidates"]


@jit_inline
def _fill_reach(
    layers: SortedLayers, aim: Aim, states: States, a: int, b: int, p: int, change: Array,
    out_to: Array, out_by: Array,
) -> None:  # fmt: skip
    """Fill the box, middle (n,) and half width (n,) rad, that the states a..b of p can reach.

    It contains every vertex that (5) and, for any of these states, (6) allow; change (n,) rad is
    the largest change of the increment at p.
    """
    free = aim.timed
    for s in range(a, b):
        free |= states.parent[s] < 0
    for i in range(len(out_to)):
        low, high = -aim.velocity[i], aim.velocity[i]
        if not free:
            least = most = states.dq[a, i]
            for s in range(a + 1, b):
                least, most = min(least, states.dq[s, i]), max(most, states.dq[s, i])
            low, high = max(low, least - change[i]), min(high, most + change[i])
        to = layers.q[i, p] + (low + high) / 2
        out_to[i] = wrap_angle(to) if layers.endless[i] else to
        out_by[i] = (high - low) / 2 + 2 * LIMIT_TOLERANCE


@jit_inline
def _inside(layers: SortedLayers, to: Array, by: Array, a: int, m: int) -> np.uint64:
    """Which of the vertices a..a+m-1, 64 at most, lie in the box: one bit each."""
    if len(to) == SIX:
        return _inside_of(layers.q, layers.turn, to, by, a, m, SIX)
    return _inside_of(layers.q, layers.turn, to, by, a, m, len(to))


@jit_vector
def _inside_of(q: Array, turn: Array, to: Array, by: Array, a: int, m: int, n: int) -> np.uint64:
    """As `_inside`, for n joints: branch-free code that vectorises."""
    mask, begin = np.uint64(0), np.uintp(a)
    for v in range(np.uintp(m)):
        over = -np.inf
        for i in range(n):
            over = larger(over, apart(abs(to[i] - q[i, begin + v]), turn[i]) - by[i])
        mask |= np.uint64(over <= 0) << np.uint64(v)
    return mask


@jit_inline
def fill_candidates(
    layers: SortedLayers, aim: Aim, states: States, a: int, b: int, k: int, p: int,
    out: Scratch,
) -> int:  # fmt: skip
    """Fill the vertices in the box that the states a..b of p can reach; return their number.

    They include every vertex that (5) and (6) allow, and few others. out.change is filled already.
    """
    _fill_reach(layers, aim, states, a, b, p, out.change, out.to, out.by)
    count, end = 0, layers.start[k + 2]
    for low, high in runs(layers.start, layers.low, layers.high, k, p):
        for v in range(low, high, 64):
            m = min(high - v, 64)
            whole = min((m + LANES - 1) // LANES * LANES, end - v)
            mask = _inside(layers, out.to, out.by, v, whole)
            mask &= ~np.uint64(0) >> np.uint64(64 - m)
            while mask:
                out.vertex[count] = v + np.int64(trailing_zeros(mask))
                mask &= mask - np.uint64(1)
                count += 1
    return count
