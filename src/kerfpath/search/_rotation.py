"""Limits on how far endless joints turn away from where a path begins (hoses and cables).

A limited joint is unrolled: it no longer counts modulo 2 pi, and each vertex stands once for each
turn inside the limit. The first layer keeps one copy, on turn 0. Only joints that a best path would
turn too far are unrolled: a best path that keeps the other limits anyway is the best within all.
"""

from __future__ import annotations

import numpy as np

from kerfpath._arrays import Array, Bools, Ints, freeze
from kerfpath.errors import NoFeasiblePath
from kerfpath.kernels.limits import LIMIT_TOLERANCE
from kerfpath.kernels.metric import MANHATTAN, increments, wrap
from kerfpath.kernels.search import Aim
from kerfpath.search._branch import best_near_start
from kerfpath.search._layers import Layers, sort_layers

__all__ = ["best_within_rotation", "too_far", "unroll", "why_closed"]


def too_far(path: Array, endless: Bools, rotation: Array) -> Bools:
    """Return which joints a path (K, n) rad turns further than `rotation` (n,) rad."""
    turned = np.cumsum(increments(path, endless), axis=0)
    return np.asarray((np.abs(turned) > rotation + LIMIT_TOLERANCE).any(axis=0))


def best_within_rotation(
    layers: Layers, aim: Aim, rotation: Array, unroll: Bools, *, closed: bool
) -> tuple[Bools, tuple[Ints, float] | None]:
    """Return the joints unrolled in the end, and the best path that keeps `rotation` (n,) rad.

    `unroll` (n,) says which joints to begin with, K >= 2. The path is the vertices (K,) and the
    cost; None where the limits of the joints unrolled leave none.
    """
    while True:
        found = _best(layers, aim, np.where(unroll, rotation, np.inf), closed=closed)
        if found is None:
            return unroll, None
        path = layers.q[layers.start[:-1] + found[0]]
        more = too_far(path, layers.endless, rotation) & ~unroll
        if not more.any():
            return unroll, found
        unroll = unroll | more


def why_closed(
    layers: Layers, aim: Aim, rotation: Array, closing: Bools, *, closed: bool
) -> NoFeasiblePath:
    """Return the answer that limits close the way: those of the joints `closing` (n,)."""
    # Whether there is a path is soonest seen from those that turn least.
    aim = aim._replace(weight=freeze(closing.astype(float)), metric=MANHATTAN, minimax=False)
    layers = layers._replace(cost=np.where(layers.cost < np.inf, 0.0, np.inf))
    joints = np.flatnonzero(closing).tolist()
    only = np.isfinite(rotation).sum() == 1
    opening = [
        i for i in joints if only or _opens(layers, aim, rotation, closing, i, closed=closed)
    ]
    node = _last_node(layers, aim, rotation, closing, closed=closed)
    named = [f"joint {i + 1} ({rotation[i]:.4g} rad)" for i in opening or joints]
    one = "it" if len(named) == 1 else "any one of them"
    without = one if opening else "rotation limits"
    return NoFeasiblePath(
        f"the rotation limit of {' and of '.join(named)} closes the way"
        f"{'' if closed else f' from node {node} on'}; without {without} there is a path",
        proved=True,
        node=node,
    )


def _opens(
    layers: Layers, aim: Aim, rotation: Array, closing: Bools, i: int, *, closed: bool
) -> bool:
    """Return whether there is a path once the limit of joint i alone is taken away."""
    others = np.arange(len(rotation)) != i
    unlimited = np.where(others, rotation, np.inf)
    return (
        best_within_rotation(layers, aim, unlimited, closing & others, closed=closed)[1] is not None
    )


def _last_node(layers: Layers, aim: Aim, rotation: Array, closing: Bools, *, closed: bool) -> int:
    """Return the last node that a path within `rotation` reaches, by halving.

    Without `closed` it is known that none reaches the end.
    """
    q, start, endless, cost, shut = layers
    reached, beyond = 0, len(start) - (1 if closed else 2)
    while beyond - reached > 1:
        node = (reached + beyond) // 2
        N = start[node + 1]
        part = Layers(q[:N], start[: node + 2], endless, cost[:N], shut[shut[:, 1] < N])
        if best_within_rotation(part, aim, rotation, closing, closed=False)[1] is None:
            beyond = node
        else:
            reached = node
    return reached


def _best(layers: Layers, aim: Aim, rotation: Array, *, closed: bool) -> tuple[Ints, float] | None:
    """Return the best path that keeps `rotation`, all joints that have a limit unrolled."""
    unrolled, place = unroll(layers, rotation)
    # The other way round would be shorter.
    most = np.where(np.isfinite(rotation), np.minimum(aim.velocity, np.pi), aim.velocity)
    graph = sort_layers(unrolled, freeze(most))
    sizes = np.diff(graph.start)
    if (sizes == 0).any():
        return None
    rank = place[graph.rank + np.repeat(unrolled.start[:-1], sizes)]
    aim = aim._replace(velocity=most)
    found = best_near_start(graph._replace(rank=rank), aim, rotation, closed=closed)
    return None if found is None else (rank[found.path], found.cost)


def unroll(layers: Layers, rotation: Array) -> tuple[Layers, Ints]:
    """Return the graph with its limited joints unrolled, and which of its layer each vertex is.

    Vertices that are too far from wherever a path begins are left out.
    """
    q, start, endless, cost, shut = layers
    place = np.arange(len(q)) - np.repeat(start[:-1], np.diff(start))
    limited, origin = np.isfinite(rotation), np.arange(len(q))
    q = np.where(limited, wrap(q), q)
    for i in np.flatnonzero(limited):
        x, m, reach = q[:, i], start[1], rotation[i] + LIMIT_TOLERANCE
        first = np.ceil((x[:m].min() - reach - x) / (2 * np.pi)).astype(np.int64)
        last = np.floor((x[:m].max() + reach - x) / (2 * np.pi)).astype(np.int64)
        first[:m] = last[:m] = 0
        copies = last + 1 - first
        begin = np.concatenate([[0], np.cumsum(copies)])
        turn = np.arange(begin[-1]) - np.repeat(begin[:-1] - first, copies)
        origin, q = np.repeat(origin, copies), np.repeat(q, copies, axis=0)
        q[:, i] += 2 * np.pi * turn
        start = begin[start]
    unrolled = Layers(
        q=freeze(q),
        start=freeze(start),
        endless=freeze(endless & ~limited),
        cost=cost[origin],
        shut=_every_copy(shut, origin, len(place)),
    )
    return unrolled, place[origin]


def _every_copy(shut: Ints, origin: Ints, vertices: int) -> Ints:
    """Return the shut edges (E, 2) from each copy of the one end to each of the other."""
    if not len(shut):
        return shut
    copies = np.bincount(origin, minlength=vertices)
    most = copies.max()
    by, first = np.argsort(origin, kind="stable"), np.cumsum(copies) - copies
    each = np.mgrid[:most, :most].reshape(2, -1).T
    there = (each < copies[shut][:, None]).all(axis=2)
    return np.asarray(by[(first[shut][:, None] + each)[there]])
