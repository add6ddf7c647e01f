"""The first-order problem solved backwards: a bound h(j) on what a path still costs.

Recursion (16) from the last layer to the first, with (5) and without (6): never more than what is
really to come, and all that the exact search needs to leave out what cannot be part of the best.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from kerfpath._arrays import Array, Bools, Ints
from kerfpath.kernels._jit import jit, jit_vector
from kerfpath.kernels.limits import LIMIT_TOLERANCE
from kerfpath.kernels.metric import EUCLID, MANHATTAN
from kerfpath.kernels.search import Layers, Objective, joined, runs

__all__ = ["cost_to_go"]


@jit
def cost_to_go(layers: Layers, aim: Objective, allowed: Bools, out_h: Array) -> None:
    """First-order bound h (N,): least cost from each vertex to the last layer, its own left out.

    Vertices that are not allowed, or from which no edges within (5) lead to the end, get infinity.
    """
    last, bound = len(layers.start) - 2, aim.velocity + LIMIT_TOLERANCE
    anew = np.full(last + 1, np.inf)  # least cost to go of a path that breaks off at the layer
    c, tail = np.empty(np.max(np.diff(layers.start))), np.empty(len(layers.low))
    time = np.empty(len(c))
    for j in range(layers.start[last], layers.start[last + 1]):
        out_h[j] = 0.0 if allowed[j] else np.inf
    for k in range(last, -1, -1):
        if k < last:
            _layer_to_go(
                layers.q, layers.turn, bound, aim.weight, aim.metric, aim.cap, aim.minimax,
                aim.penalty, aim.stretch / aim.velocity,
                layers.start, layers.low, layers.high, k, tail, c, time, out_h,
            )  # fmt: skip
            if aim.leap < np.inf:
                a, b, end = layers.start[k], layers.start[k + 1], layers.start[k + 2]
                out_h[a:b] = np.minimum(out_h[a:b], aim.leap + tail[b:end].min())
        least = np.inf
        for p in range(layers.start[k], layers.start[k + 1]):
            out_h[p] = min(out_h[p], anew[k]) if allowed[p] else np.inf
            tail[p] = joined(aim.minimax, aim.vertex_cost[p], out_h[p])
            least = min(least, tail[p])
        if layers.after[k] >= 0:
            anew[layers.after[k]] = least


@jit_vector
def _layer_to_go(
    q: Array, turn: Array, bound: Array, weight: Array, metric: int, cap: float, minimax: bool,
    penalty: float, slowness: Array,
    start: Ints, low: Ints, high: Ints, k: int, tail: Array, c: Array, time: Array, out_h: Array,
) -> None:  # fmt: skip
    """For each vertex p of layer k the least of its distance to a next vertex joined with its tail.

    The innermost loops of the first-order problem, so over bare arrays and in one piece: handing
    them to a function costs as much as a run of twenty vertices. Joint by joint, every loop
    vectorises.
    """
    for p in range(start[k], start[k + 1]):
        best = np.inf
        for a, b in runs(start, low, high, k, p):
            m = b - a
            c[:m] = 0.0
            for i in range(len(q) if m else 0):
                x, t, limit, w = q[i, p], turn[i], bound[i], weight[i]
                if metric == MANHATTAN:
                    for v in range(m):
                        y = min(abs(x - q[i, a + v]), t - abs(x - q[i, a + v]))
                        c[v] += np.inf if y > limit else w * y
                elif metric == EUCLID:
                    for v in range(m):
                        y = min(abs(x - q[i, a + v]), t - abs(x - q[i, a + v]))
                        c[v] += np.inf if y > limit else w * y * w * y
                else:
                    for v in range(m):
                        y = min(abs(x - q[i, a + v]), t - abs(x - q[i, a + v]))
                        c[v] = max(c[v], np.inf if y > limit else w * y)
            if metric == EUCLID or cap < np.inf:
                for v in range(m):
                    r = sqrt(c[v]) if metric == EUCLID else c[v]
                    c[v] = r if r <= cap else np.inf
            if penalty > 0:
                time[:m] = 1.0
                for i in range(len(q)):
                    x, t, s = q[i, p], turn[i], slowness[i]
                    for v in range(m):
                        y = min(abs(x - q[i, a + v]), t - abs(x - q[i, a + v]))
                        time[v] = max(time[v], s * y)
                for v in range(m):
                    c[v] += penalty * (time[v] - 1.0)
            if minimax:
                for v in range(m):
                    best = min(best, max(c[v], tail[a + v]))
            else:
                for v in range(m):
                    best = min(best, c[v] + tail[a + v])
        out_h[p] = best
