"""The path planning procedure of section 3.2: recursion (16) with the tests (5) and (6).

A layered graph arrives sorted: within each layer by one key (a joint, or the posture), so that the
vertices of the layer before that can pass the velocity test lie in one or two short runs.
"""

from __future__ import annotations

from math import pi, sqrt
from typing import NamedTuple

import numpy as np

from kerfpath._arrays import Array, Bools, Ints
from kerfpath.kernels._jit import jit
from kerfpath.kernels.limits import LIMIT_TOLERANCE, acceleration_excess, velocity_excess
from kerfpath.kernels.metric import EUCLID, MANHATTAN, increment

__all__ = ["Layers", "Objective", "closing_counts", "path_planning"]


class Layers(NamedTuple):
    """A sorted layered graph: vertices by column, edges implied."""

    q: Array
    """(n, N) rad, endless joints reduced to (-pi, pi]."""
    start: Ints
    """(K+1,): layer k is q[:, start[k]:start[k+1]]."""
    rank: Ints
    """(N,): place of each vertex in its layer as the user gave it; breaks ties."""
    key: Array
    """(N,): what each layer is sorted by."""
    window: float
    """Largest difference of the key along an admissible edge."""
    circular: bool
    """The key is an angle modulo 2 pi."""
    endless: Bools


class Objective(NamedTuple):
    """What (14) or (15) adds up, and the bounds (5) and (6) on the increments."""

    weight: Array
    metric: int
    minimax: bool
    vertex_cost: Array
    velocity: Array
    acceleration: Array
    cap: float
    """Largest distance, and largest cost of a vertex, that is allowed."""


@jit
def _place(key: Array, a: int, b: int, value: float) -> int:
    """First place in the sorted key[a:b] that is not below `value`; b if there is none."""
    while a < b:
        middle = (a + b) // 2
        if key[middle] < value:
            a = middle + 1
        else:
            b = middle
    return a


@jit
def _window(layers: Layers, k: int, key: float, out_run: Ints) -> int:
    """Find the edges into a vertex: the runs of layer k within the window about `key` (Eq. 12).

    Of the edges that (12) allows, all others break the velocity limit. Returns how many runs there
    are, 1 or 2.
    """
    a, b = layers.start[k], layers.start[k + 1]
    low, high = key - layers.window, key + layers.window
    if layers.circular and (low < -pi or high > pi):
        if high - low >= 2 * pi:
            out_run[0, 0], out_run[0, 1] = a, b
            return 1
        low, high = (low + 2 * pi, high) if low < -pi else (low, high - 2 * pi)
        out_run[0, 0], out_run[0, 1] = a, _place(layers.key, a, b, high)
        out_run[1, 0], out_run[1, 1] = _place(layers.key, a, b, low), b
        return 2
    out_run[0, 0] = _place(layers.key, a, b, low)
    out_run[0, 1] = _place(layers.key, a, b, high)
    return 1


@jit
def _distance(layers: Layers, aim: Objective, p: int, j: int) -> float:
    """Distance rho from vertex p to vertex j; infinite where (5) or the cap forbids it."""
    total = 0.0
    for i in range(len(layers.endless)):
        y = abs(layers.q[i, j] - layers.q[i, p])
        if layers.endless[i]:
            y = min(y, 2 * pi - y)
        if y > aim.velocity[i] + LIMIT_TOLERANCE:
            return np.inf
        part = aim.weight[i] * y
        if aim.metric == MANHATTAN:
            total += part
        elif aim.metric == EUCLID:
            total += part * part
        else:
            total = max(total, part)
    total = sqrt(total) if aim.metric == EUCLID else total
    return total if total <= aim.cap else np.inf


@jit
def _increment(layers: Layers, p: int, j: int, out_dq: Array) -> None:
    for i in range(len(layers.endless)):
        out_dq[i] = increment(layers.q[i, j] - layers.q[i, p], layers.endless[i])


@jit
def path_planning(
    layers: Layers, aim: Objective, out_dist: Array, out_before: Ints
) -> tuple[int, bool]:
    """Fill d*_{k,j} = min over p of d*_{k-1,p} + rho(p, j), and the best p, by layers (Eq. 16).

    Steps (1) and (2) of the procedure, with (5) in (2b-beta) and, greedily, (6) in (2b-gamma): the
    acceleration is tested against the best predecessor of p only. Returns the number of layers
    reached, and whether the greedy test ever turned away a better edge (if not, the recursion was
    exact).
    """
    first, last = layers.start[0], layers.start[1]
    for j in range(first, last):
        out_dist[j], out_before[j] = aim.vertex_cost[j], -1
    n = len(layers.endless)
    run, dq, dq_before = np.empty((2, 2), np.int64), np.empty(n), np.empty(n)
    turned_away = False
    for k in range(1, len(layers.start) - 1):
        reached = False
        for j in range(layers.start[k], layers.start[k + 1]):
            best, first_order, best_p = np.inf, np.inf, -1
            for r in range(_window(layers, k - 1, layers.key[j], run)):
                for p in range(run[r, 0], run[r, 1]):
                    if out_dist[p] > best:
                        continue
                    c = _distance(layers, aim, p, j)
                    d = max(out_dist[p], c) if aim.minimax else out_dist[p] + c
                    tie = d == best and best_p >= 0 and layers.rank[p] < layers.rank[best_p]
                    if not (d < best or tie):
                        continue
                    first_order = min(first_order, d)
                    if k > 1:
                        _increment(layers, p, j, dq)
                        _increment(layers, out_before[p], p, dq_before)
                        if acceleration_excess(dq, dq_before, aim.acceleration) >= 0:
                            continue
                    best, best_p = d, p
            turned_away |= first_order < best
            cost = aim.vertex_cost[j]
            out_dist[j] = max(best, cost) if aim.minimax else best + cost
            out_before[j] = best_p
            reached |= best_p >= 0
        if not reached:
            return k, turned_away
    return len(layers.start) - 1, turned_away


@jit
def closing_counts(layers: Layers, aim: Objective, dist: Array, before: Ints, k: int) -> Ints:
    """Count, for edges from reached vertices of layer k-1 into layer k, what forbids them.

    Row 0: edges whose first velocity excess (5) is at joint i; row 1: of the others, those whose
    first acceleration excess (6) is at joint i.
    """
    n = len(layers.endless)
    counts = np.zeros((2, n), np.int64)
    dq, dq_before = np.empty(n), np.empty(n)
    for p in range(layers.start[k - 1], layers.start[k]):
        if dist[p] == np.inf:
            continue
        if k > 1:
            _increment(layers, before[p], p, dq_before)
        for j in range(layers.start[k], layers.start[k + 1]):
            _increment(layers, p, j, dq)
            i = velocity_excess(dq, aim.velocity)
            if i >= 0:
                counts[0, i] += 1
            elif k > 1:
                i = acceleration_excess(dq, dq_before, aim.acceleration)
                if i >= 0:
                    counts[1, i] += 1
    return counts
