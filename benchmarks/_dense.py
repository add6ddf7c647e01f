"""The yardstick of the search: a plain first-order recursion over every edge.

It has no windows, no sorting and no acceleration limit: for each vertex it computes the cost of all
edges into it from the layer before, and takes the least. Layers are stored by joint, the loop over
the six joints is written out, and nothing is stored per edge; the endless joints and the metric are
constants of the compiled code. The compiled loop handles one predecessor at a time: LLVM does not
recognise its `min` as a reduction that could be vectorised.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from math import pi, sqrt
from typing import Literal, ParamSpec, TypeVar

import numba
import numpy as np

from kerfpath.arrays import Array, Bools, Ints

__all__ = ["Metric", "dense_cost", "second_order_cost"]

_P = ParamSpec("_P")
_R = TypeVar("_R")
Metric = Literal["manhattan", "euclid", "squared"]
_Forward = Callable[[Array, Ints, Array, Array], float]

SLACK = 1e-9
"""Slack on the velocity bound, rad, as in kerfpath."""


def _jit(function: Callable[_P, _R]) -> Callable[_P, _R]:
    flags = {"nnan", "nsz", "reassoc", "contract"}
    compiled: Callable[_P, _R] = numba.njit(nogil=True, fastmath=flags)(function)
    return compiled


@_jit
def _step(angle: float, to: float, endless: bool) -> float:
    step = abs(angle - to)
    return min(step, 2 * pi - step) if endless else step


@cache
def _recursion(endless: tuple[bool, ...], metric: Metric) -> _Forward:
    manhattan, squared = metric == "manhattan", metric == "squared"

    @_jit
    def least(dist: Array, q: Array, to: Array, w: Array, most: Array) -> float:
        """Return the least dist[p] + rho(p, to) over the columns p of q (6, m)."""
        q0, q1, q2, q3, q4, q5 = q[0], q[1], q[2], q[3], q[4], q[5]
        best = np.inf
        for p in range(len(dist)):
            y0, y1 = _step(q0[p], to[0], endless[0]), _step(q1[p], to[1], endless[1])
            y2, y3 = _step(q2[p], to[2], endless[2]), _step(q3[p], to[3], endless[3])
            y4, y5 = _step(q4[p], to[4], endless[4]), _step(q5[p], to[5], endless[5])
            far = (y0 > most[0]) | (y1 > most[1]) | (y2 > most[2])
            far |= (y3 > most[3]) | (y4 > most[4]) | (y5 > most[5])
            y0, y1, y2, y3, y4, y5 = (
                w[0] * y0,
                w[1] * y1,
                w[2] * y2,
                w[3] * y3,
                w[4] * y4,
                w[5] * y5,
            )
            if manhattan:
                rho = y0 + y1 + y2 + y3 + y4 + y5
            else:
                rho = y0 * y0 + y1 * y1 + y2 * y2 + y3 * y3 + y4 * y4 + y5 * y5
                rho = rho if squared else sqrt(rho)
            best = min(best, np.inf if far else dist[p] + rho)
        return best

    @_jit
    def forward(q: Array, start: Ints, weights: Array, bound: Array) -> float:
        dist = np.zeros(start[1])
        for k in range(1, len(start) - 1):
            before = q[:, start[k - 1] : start[k]]
            reached = np.empty(start[k + 1] - start[k])
            for j in range(len(reached)):
                reached[j] = least(dist, before, q[:, start[k] + j], weights, bound)
            dist = reached
        return float(dist.min())

    return forward


def dense_cost(
    q: Array,
    start: Ints,
    *,
    dt: float,
    velocity: Array,
    endless: Bools,
    weights: Array,
    metric: Metric,
) -> float:
    """Return the least cost of a path through the layers, inf if there is none.

    Arguments are those of `kerfpath.shortest_path`, for six joints; the metric "squared" is the one
    of Descartes, the squares of the Euclidean steps.
    """
    turned = q - 2 * np.pi * np.ceil((q - np.pi) / (2 * np.pi))
    columns = np.ascontiguousarray(np.where(endless, turned, q).T)
    forward = _recursion(tuple(bool(e) for e in endless), metric)
    return float(forward(columns, start, weights, velocity * dt + SLACK))


@cache
def _second_order(endless: tuple[bool, ...]) -> Callable[..., float]:
    n = len(endless)

    @_jit
    def increment(dq: float, i: int) -> float:
        return dq - 2 * pi * np.round(dq / (2 * pi)) if endless[i] else dq

    @_jit
    def forward(
        q: Array, start: Ints, weights: Array, most: Array, change: Array, closed: Bools
    ) -> float:
        """Keep every admissible edge (p, j) as a state, grouped by the vertex j."""
        edge = 0
        first, d = np.zeros(start[1] + 1, np.int64), np.zeros(0)
        dq, step = np.empty((0, n)), np.empty(n)
        for k in range(1, len(start) - 1):
            a, b, c = start[k - 1], start[k], start[k + 1]
            room, count = 1024, 0
            new_d, new_dq = np.empty(room), np.empty((room, n))
            new_first = np.zeros(c - b + 1, np.int64)
            for j in range(b, c):
                for p in range(a, b):
                    rho, far = 0.0, False
                    if len(closed):
                        far = closed[edge + (p - a) * (c - b) + j - b]
                    for i in range(n):
                        step[i] = increment(q[j, i] - q[p, i], i)
                        rho += weights[i] * abs(step[i])
                        far |= abs(step[i]) > most[i]
                    if far:
                        continue
                    best = 0.0 if k == 1 else np.inf
                    for s in range(first[p - a], first[p - a + 1]):
                        sharp = False
                        for i in range(n):
                            sharp |= abs(step[i] - dq[s, i]) > change[i]
                        best = best if sharp else min(best, d[s])
                    if best == np.inf:
                        continue
                    if count == room:
                        room *= 2
                        wider_d, wider_dq = np.empty(room), np.empty((room, n))
                        wider_d[:count], wider_dq[:count] = new_d, new_dq
                        new_d, new_dq = wider_d, wider_dq
                    new_d[count] = best + rho
                    new_dq[count] = step
                    count += 1
                new_first[j - b + 1] = count
            first, d, dq = new_first, new_d[:count], new_dq[:count]
            edge += (b - a) * (c - b)
        return float(d.min()) if len(d) else np.inf

    return forward


def second_order_cost(
    q: Array,
    start: Ints,
    *,
    dt: float,
    velocity: Array,
    acceleration: Array,
    endless: Bools,
    weights: Array,
    passable: Sequence[Bools] = (),
) -> float:
    """Return the least Manhattan cost of a path under both limits, inf if there is none; K >= 2.

    This is the plain second-order recursion: over every pair of vertices of neighbouring layers,
    and for each admissible pair over every admissible edge before it. Arguments are those of
    `dense_cost`; `passable` may give the edges that are free between two layers, (from, to).
    """
    forward = _second_order(tuple(bool(e) for e in endless))
    bounds = velocity * dt + SLACK, acceleration * dt**2 + SLACK
    closed = ~np.concatenate([np.zeros(0, bool), *(edges.ravel() for edges in passable)])
    return float(forward(np.ascontiguousarray(q), start, weights, *bounds, closed))
