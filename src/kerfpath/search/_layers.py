"""Layered graph as given, and sorted for the kernels."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kerfpath._arrays import Array, Bools, Ints, freeze
from kerfpath.errors import NoFeasiblePath
from kerfpath.kernels import search as kernel
from kerfpath.kernels.limits import LIMIT_TOLERANCE
from kerfpath.kernels.metric import wrap
from kerfpath.kernels.search import SortedLayers
from kerfpath.losses import Loss, Reason

__all__ = [
    "Layers",
    "broken_edge",
    "empty_layer",
    "require_joined",
    "reverse",
    "sort_layers",
]

_LAYERS_SAMPLED = 32
"""Layers sampled to choose the joint that sorts them: enough to rank the joints."""
_VERTICES_SAMPLED = 16
"""Vertices of each sampled layer whose windows are counted."""


TESTS = (Loss.VELOCITY, Loss.ACCELERATION, Loss.TORQUE)
"""Tests that may forbid an edge, in the order in which they are made."""


class Layers(NamedTuple):
    """A layered graph as given: one row for each vertex."""

    q: Array
    """(N, n) rad."""
    start: Ints
    """(K+1,): layer k is q[start[k]:start[k+1]]."""
    endless: Bools
    """(n,): joints that turn without end."""
    cost: Array
    """(N,): cost of visiting a vertex; infinite if it is closed."""
    shut: Ints
    """(E, 2): edges that may not be used, as rows of q, from and to."""


def sort_layers(
    layers: Layers, velocity: Array, key: Array | None = None, width: float = 0.0
) -> SortedLayers:
    """Return the graph without closed vertices, each layer sorted by a key (N,).

    Along an edge the key may change by at most `width`. Without a key, layers are sorted by the
    joint whose window under `velocity` (n,) rad leaves the fewest vertices. Ranks count all
    vertices of a layer, including closed ones.
    """
    q, start, endless, cost, shut = layers
    kept, circular = None, False
    if cost.max(initial=0.0) == np.inf:
        kept = np.flatnonzero(cost < np.inf)
        q, start = q[kept], np.searchsorted(kept, start)
        key = None if key is None else key[kept]
    if key is None:
        key, width, circular = _narrowest_key(q, start, velocity, endless)
    N, n = q.shape
    columns, keys, rank = np.empty((n, N)), np.empty(N), np.empty(N, np.int64)
    kernel.arrange(q, key, start, endless, columns, keys, rank)
    low, high = np.zeros(N, np.int64), np.zeros(N, np.int64)
    kernel.windows(keys, start, width, circular, low, high)
    del key, keys
    sizes = np.diff(start)
    order = np.repeat(start[:-1], sizes)
    order += rank
    if kept is not None:
        order = kept[order]
        rank = order - np.repeat(layers.start[:-1], sizes)
    shut_from, shut = _by_vertex(shut, order, len(layers.q))
    return SortedLayers(
        q=columns,
        given=columns if _is_wrapped(layers) else np.ascontiguousarray(layers.q[order].T),
        start=freeze(start),
        cost=freeze(cost[order] if cost.any() else cost),
        rank=rank,
        low=low,
        high=high,
        endless=endless,
        turn=np.where(endless, 2 * np.pi, np.inf),
        after=np.full(len(start) - 1, -1),
        shut_from=shut_from,
        shut=shut,
    )


def _is_wrapped(layers: Layers) -> bool:
    """Return whether every endless joint is given within (-pi, pi]."""
    return all(
        np.array_equal(wrap(layers.q[:, i]), layers.q[:, i]) for i in np.flatnonzero(layers.endless)
    )


def _by_vertex(edges: Ints, order: Ints, vertices: int) -> tuple[Ints, Ints]:
    """Return shut edges as `SortedLayers` stores them, without those of closed vertices."""
    if not len(edges):
        return np.empty(0, np.int64), np.empty(0, np.int64)
    place = np.full(vertices, -1)
    place[order] = np.arange(len(order))
    p, j = place[edges[(place[edges] >= 0).all(axis=1)]].T
    by = np.lexsort((j, p))
    return np.searchsorted(p[by], np.arange(len(order) + 1)), np.ascontiguousarray(j[by])


def empty_layer(layers: Layers, k: int) -> NoFeasiblePath:
    """Return the answer for a graph whose layer k has no open vertex."""
    closed = int(layers.start[k + 1] - layers.start[k])
    why = "no path can start" if k == 0 else "no admissible pose at that node"
    return NoFeasiblePath(
        f"layer {k} is empty: {why}" + (f"; closed vertices: {closed}" if closed else ""),
        proved=True,
        node=k - 1,
        counts={Reason(Loss.CLOSED): closed} if closed else {},
    )


def broken_edge(k: int, forbidden: Ints, shut: int, *, proved: bool) -> NoFeasiblePath:
    """Return the answer that no admissible edge leads into layer k, with the reasons counted."""
    counts: dict[str, int] = {
        Reason(test, i + 1): int(number)
        for test, row in zip(TESTS, forbidden, strict=True)
        for i, number in enumerate(row)
        if number
    }
    if shut:
        counts[Reason(Loss.SHUT)] = shut
    reasons = ", ".join(f"{name}: {number}" for name, number in counts.items())
    total = int(sum(counts.values()))
    return NoFeasiblePath(
        f"no admissible edge from node {k - 1} to node {k}; "
        f"of {total} edges, forbidden by {reasons}",
        proved=proved,
        node=k - 1,
        counts=counts,
    )


def require_joined(layers: Layers) -> None:
    """Raise NoFeasiblePath if closed vertices and shut edges alone leave no path."""
    q, start, _, cost, edges = layers
    open_ = reached = cost < np.inf
    edges = edges[np.argsort(edges[:, 0])]
    begin = np.searchsorted(edges[:, 0], start)
    for k in range(len(start) - 1):
        here = open_[start[k] : start[k + 1]]
        if k > 0 and begin[k - 1] < begin[k]:
            p, j = np.unique(edges[begin[k - 1] : begin[k]], axis=0).T
            ways = np.bincount(j[reached[p - start[k - 1]]] - start[k], minlength=len(here))
            shut = int(ways[here].sum())
            here = here & (ways < reached.sum())
            if shut and not here.any():
                none = np.zeros((3, q.shape[1]), np.int64)
                raise broken_edge(k, none, shut, proved=True)
        if not here.any():
            raise empty_layer(layers, k)
        reached = here


def reverse(layers: Layers) -> Layers:
    """Return the layers in reverse order."""
    q, start, endless, cost, shut = layers
    sizes = np.diff(start)[::-1]
    begin = np.concatenate([[0], np.cumsum(sizes)])
    # Vertex i of reversed layer k comes from the old position of that layer.
    order = np.arange(len(q)) + np.repeat(start[:-1][::-1] - begin[:-1], sizes)
    return Layers(
        q=freeze(q[order]),
        start=freeze(begin),
        endless=endless,
        cost=freeze(cost[order]),
        shut=np.argsort(order)[shut[:, ::-1]] if len(shut) else shut,
    )


def _narrowest_key(
    q: Array, start: Ints, bound: Array, endless: Bools
) -> tuple[Array, float, bool]:
    """Choose the joint whose velocity window leaves the fewest vertices, to sort the layers by."""
    layers = np.unique(np.linspace(0, max(len(start) - 3, 0), _LAYERS_SAMPLED).astype(int))
    pairs = np.zeros(q.shape[1], np.int64)
    for k in layers[layers + 2 < len(start)]:
        here, there = q[start[k] : start[k + 1]], q[start[k + 1] : start[k + 2]]
        kernel.count_within(
            here[:: len(here) // _VERTICES_SAMPLED + 1], there, bound, endless, pairs
        )
    best = int(np.argmin(pairs))
    key = np.empty(len(q))
    kernel.fill_key(q, best, bool(endless[best]), key)
    # Twice the slack of (5): the key must never exclude an edge that the test itself would pass.
    return key, float(bound[best] + 2 * LIMIT_TOLERANCE), bool(endless[best])
