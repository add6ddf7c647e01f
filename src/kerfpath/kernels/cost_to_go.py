"""The first-order problem solved backwards: a bound h(j) on the cost to come.

Recursion (16) runs from the last layer to the first, with (5) and without (6). The bound never
exceeds the true cost to come, so that the exact search can drop what cannot be part of the best.
"""

from __future__ import annotations

import numpy as np

from kerfpath.arrays import Array, Bools
from kerfpath.kernels.jit import either, jit, jit_inline, jit_vector, larger, smaller
from kerfpath.kernels.limits import exceeds
from kerfpath.kernels.metric import apart, extend, finish
from kerfpath.kernels.search import Aim, SortedLayers, combined, shut_edges

__all__ = ["LANES", "SIX", "cost_to_go"]

LANES = 8
"""Numbers per vector instruction; runs are lengthened to multiples of it where possible."""
SIX = 6
"""Joints of a robot arm; a constant number lets the compiler unroll the loop over them."""


@jit
def cost_to_go(layers: SortedLayers, aim: Aim, allowed: Bools, out_h: Array) -> None:
    """First-order bound h (N,): least cost from each vertex to the last layer, without its own.

    Vertices that are not allowed, or from which no edges within (5) lead to the end, get infinity.
    """
    last = len(layers.start) - 2
    slowness, tail = aim.lost.stretch / aim.velocity, np.empty(len(layers.low))
    anew = np.full(last + 1, np.inf)  # least cost to go of a path that breaks off at the layer
    out_h[layers.start[last] :] = 0.0
    for k in range(last, -1, -1):
        a, b = layers.start[k], layers.start[k + 1]
        if k < last:
            _layer_to_go(layers, aim, slowness, k, tail, out_h)
            if aim.lost.leap < np.inf:
                leap = aim.lost.leap + tail[b : layers.start[k + 2]].min()
                out_h[a:b] = np.minimum(out_h[a:b], leap)
        least = _join(aim.minimax, layers.cost[a:b], allowed[a:b], anew[k], out_h[a:b], tail[a:b])
        if layers.after[k] >= 0:
            anew[layers.after[k]] = least


@jit_vector
def _join(
    minimax: bool, cost: Array, allowed: Bools, anew: float, out_h: Array, out_tail: Array
) -> float:
    """Close the vertices that are not allowed, and join the cost to come with their own cost.

    Returns the least of the joined costs.
    """
    least = np.inf
    for v in range(len(cost)):
        out_h[v] = smaller(out_h[v], anew) if allowed[v] else np.inf
    for v in range(len(cost)):
        out_tail[v] = either(minimax, larger(cost[v], out_h[v]), cost[v] + out_h[v])
        least = smaller(least, out_tail[v])
    return least


@jit_inline
def _layer_to_go(
    layers: SortedLayers, aim: Aim, slowness: Array, k: int, tail: Array, out_h: Array
) -> None:
    """Fill, for each vertex p of layer k, the least of distance and tail of a next vertex, joined.

    A run is lengthened to full `LANES`: the vertices added break (5), or they would be in the run.
    While p is processed, the tails at the ends of its shut edges are infinite.
    """
    first, last = layers.start[k + 1], layers.start[k + 2]
    for p in range(layers.start[k], layers.start[k + 1]):
        s, t = shut_edges(layers, p)
        for i in range(s, t):
            tail[layers.shut[i]] = np.inf
        a, b = layers.low[p], layers.high[p]
        if a <= b:
            m = min((b - a + LANES - 1) // LANES * LANES, last - first)
            out_h[p] = _least(layers, aim, slowness, p, min(a, last - m), m, tail)
        else:
            ahead = _least(layers, aim, slowness, p, a, last - a, tail)
            out_h[p] = min(ahead, _least(layers, aim, slowness, p, first, b - first, tail))
        for i in range(s, t):
            j = layers.shut[i]
            tail[j] = combined(aim.minimax, layers.cost[j], out_h[j])


@jit_inline
def _least(
    layers: SortedLayers, aim: Aim, slowness: Array, p: int, a: int, m: int, tail: Array
) -> float:
    """Least of the distances from vertex p to the vertices a..a+m-1, joined with their tails.

    With a penalty, the price of the time that the step takes is added to the distance. Arguments
    passed as constants keep their branches out of the loop.
    """
    n = len(slowness)
    none = aim.cap + np.inf  # infinity, not as a constant, which would be compiled into jumps
    if aim.lost.penalty > 0:
        if n == SIX:
            return _least_of(layers, aim, slowness, p, a, m, tail, True, SIX, none)
        return _least_of(layers, aim, slowness, p, a, m, tail, True, n, none)
    if n == SIX:
        return _least_of(layers, aim, slowness, p, a, m, tail, False, SIX, none)
    return _least_of(layers, aim, slowness, p, a, m, tail, False, n, none)


@jit_vector
def _least_of(
    layers: SortedLayers, aim: Aim, slowness: Array, p: int, a: int, m: int, tail: Array,
    priced: bool, n: int, none: float,
) -> float:  # fmt: skip
    """As `_least`, for n joints: the innermost loop of the first-order problem.

    The distance is the same to the bit as that of `distance`, in branch-free code that vectorises.
    """
    best, begin, q = np.inf, np.uintp(a), layers.q
    for v in range(np.uintp(m)):
        j, r, time = begin + v, 0.0, 1.0
        for i in range(n):
            y = apart(abs(q[i, p] - q[i, j]), layers.turn[i])
            time = larger(time, slowness[i] * y) if priced else time
            y = either(exceeds(y, aim.velocity[i]), none, aim.weight[i] * y)
            r = extend(r, y, aim.metric)
        r = finish(r, aim.metric)
        r = either(r <= aim.cap, r, none)
        r = r + aim.lost.penalty * (time - 1.0) if priced else r
        best = smaller(best, either(aim.minimax, larger(r, tail[j]), r + tail[j]))
    return best
