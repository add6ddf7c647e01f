"""The first-order problem solved backwards: a bound h(j) on what a path still costs.

Recursion (16) from the last layer to the first, with (5) and without (6): never more than what is
really to come, and all that the exact search needs to leave out what cannot be part of the best.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from kerfpath._arrays import Array, Bools, Ints
from kerfpath.kernels._jit import either, jit, jit_vector, larger, smaller
from kerfpath.kernels.limits import LIMIT_TOLERANCE
from kerfpath.kernels.metric import EUCLID, MANHATTAN
from kerfpath.kernels.search import Layers, Objective

__all__ = ["cost_to_go"]

LANES = 8
"""Numbers that one instruction works on; runs are made whole multiples of it where they can be."""


def cost_to_go(layers: Layers, aim: Objective, allowed: Bools, out_h: Array) -> None:
    """First-order bound h (N,): least cost from each vertex to the last layer, its own left out.

    Vertices that are not allowed, or from which no edges within (5) lead to the end, get infinity.
    """
    joints = (True,) * len(layers.q)
    _to_go(layers, aim, joints, np.inf, allowed, out_h)


@jit
def _to_go(
    layers: Layers,
    aim: Objective,
    joints: tuple[bool, ...],
    none: float,
    allowed: Bools,
    out_h: Array,
) -> None:
    last, bound = len(layers.start) - 2, aim.velocity + LIMIT_TOLERANCE
    tail = np.empty(len(layers.low))
    out_h[layers.start[last] :] = 0.0
    for k in range(last, -1, -1):
        if k < last:
            _layer_to_go(
                layers.q, layers.turn, bound, aim.weight, aim.metric, aim.cap, aim.minimax,
                layers.start, layers.low, layers.high, k, tail, joints, none, out_h,
            )  # fmt: skip
        here = slice(layers.start[k], layers.start[k + 1])
        _join(aim.minimax, aim.vertex_cost[here], allowed[here], out_h[here], tail[here])


@jit_vector
def _join(minimax: bool, cost: Array, allowed: Bools, out_h: Array, out_tail: Array) -> None:
    """Close the vertices that are not allowed, and join what is to come with their own cost."""
    for v in range(len(cost)):
        out_h[v] = out_h[v] if allowed[v] else np.inf
    for v in range(len(cost)):
        out_tail[v] = either(minimax, larger(cost[v], out_h[v]), cost[v] + out_h[v])


@jit_vector
def _layer_to_go(
    q: Array, turn: Array, bound: Array, weight: Array, metric: int, cap: float, minimax: bool,
    start: Ints, low: Ints, high: Ints, k: int, tail: Array, joints: tuple[bool, ...], none: float,
    out_h: Array,
) -> None:  # fmt: skip
    """For each vertex p of layer k the least of its distance to a next vertex joined with its tail.

    A run is lengthened to whole `LANES`: what it takes in breaks (5), or it would be in the run.
    """
    first, last = start[k + 1], start[k + 2]
    for p in range(start[k], start[k + 1]):
        a, b = low[p], high[p]
        if a <= b:
            m = min((b - a + LANES - 1) // LANES * LANES, last - first)
            a = min(a, last - m)
            out_h[p] = _least(
                q, turn, bound, weight, metric, cap, minimax, p, a, m, tail, joints, none
            )
        else:
            ahead = _least(
                q, turn, bound, weight, metric, cap, minimax, p, a, last - a, tail, joints, none
            )
            around = _least(
                q, turn, bound, weight, metric, cap, minimax, p, first, b - first, tail, joints,
                none,
            )  # fmt: skip
            out_h[p] = min(ahead, around)


@jit_vector
def _least(
    q: Array, turn: Array, bound: Array, weight: Array, metric: int, cap: float, minimax: bool,
    p: int, a: int, m: int, tail: Array, joints: tuple[bool, ...], none: float,
) -> float:  # fmt: skip
    """Least of the distances from vertex p to the vertices a..a+m-1, joined with their tails.

    The innermost loop of the first-order problem: one straight line of code that vectorises. So
    the number of joints is that of a tuple, which is known when this is compiled; no index is
    signed, which would be one counted from the end if negative; and infinity is an argument, as
    LLVM folds a constant into jumps.
    """
    best, begin = np.inf, np.uintp(a)
    for v in range(np.uintp(m)):
        j, r = begin + v, 0.0
        for i in range(len(joints)):
            y = abs(q[i, p] - q[i, j])
            y = smaller(y, turn[i] - y)
            y = either(y > bound[i], none, weight[i] * y)
            longest = larger(r, y)
            r = either(metric == MANHATTAN, r + y, either(metric == EUCLID, r + y * y, longest))
        r = either(metric == EUCLID, sqrt(r), r)
        r = either(r <= cap, r, none)
        best = smaller(best, either(minimax, larger(r, tail[j]), r + tail[j]))
    return best
