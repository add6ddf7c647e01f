"""From bare arrays to the sorted graph that the kernels search."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from kerfpath._arrays import Array, Bools, Ints, freeze, integers
from kerfpath.errors import InputError, NoFeasiblePath
from kerfpath.kernels import search as kernel
from kerfpath.kernels.limits import LIMIT_TOLERANCE

__all__ = [
    "backwards",
    "broken_edge",
    "empty_layer",
    "narrowest_key",
    "offsets",
    "reduced",
    "sorted_layers",
]

_LAYERS_SAMPLED = 32
"""Layers looked at to choose the joint that sorts them: enough to rank the joints."""
_VERTICES_SAMPLED = 16
"""Vertices of each of them whose windows are counted."""


def offsets(start: ArrayLike, vertices: int) -> Ints:
    start = integers(start, "start", (None,))
    if len(start) < 2 or start[0] != 0 or start[-1] != vertices or (np.diff(start) < 0).any():
        raise InputError(
            "start: expected K+1 offsets that begin with 0, never decrease and end with the number "
            f"of vertices ({vertices}), got {start.tolist() if len(start) < 12 else '...'}"
        )
    return start


def sorted_layers(
    q: Array, start: Ints, key: Array, window: float, circular: bool, endless: Bools
) -> tuple[kernel.Layers, Ints]:
    """Return the graph as the kernels take it, and where each of its vertices stands in q."""
    N, n = q.shape
    columns, keys, rank = np.empty((n, N)), np.empty(N), np.empty(N, np.int64)
    kernel.arrange(q, key, start, endless, columns, keys, rank)
    low, high = np.zeros(N, np.int64), np.zeros(N, np.int64)
    kernel.windows(keys, start, window, circular, low, high)
    del keys
    layers = kernel.Layers(
        q=columns,
        start=start,
        rank=rank,
        low=low,
        high=high,
        endless=endless,
        turn=np.where(endless, 2 * np.pi, np.inf),
        after=np.full(len(start) - 1, -1),
    )
    order = np.repeat(start[:-1], np.diff(start))
    order += rank
    return layers, order


def empty_layer(k: int) -> NoFeasiblePath:
    """Return the answer for a graph whose layer k has no vertex."""
    if k == 0:
        return NoFeasiblePath("layer 0 is empty: no path can start", proved=True, node=-1)
    return NoFeasiblePath(
        f"layer {k} is empty: no admissible pose at that node", proved=True, node=k - 1
    )


def broken_edge(k: int, forbidden: Ints, *, proved: bool) -> NoFeasiblePath:
    """Say that no admissible edge leads into layer k, and which limits forbid how many."""
    counts = {
        f"{test}, joint {i + 1}": int(number)
        for test, row in zip(("velocity", "acceleration"), forbidden, strict=True)
        for i, number in enumerate(row)
        if number
    }
    told = ", ".join(f"{name}: {number}" for name, number in counts.items())
    total = int(sum(counts.values()))
    return NoFeasiblePath(
        f"no admissible edge from node {k - 1} to node {k}; of {total} edges, forbidden by {told}",
        proved=proved,
        node=k - 1,
        counts=counts,
    )


def backwards(q: Array, start: Ints) -> tuple[Array, Ints]:
    """Return the same graph with its layers in reverse order: q (N, n), start (K+1,)."""
    sizes = np.diff(start)[::-1]
    begin = np.concatenate([[0], np.cumsum(sizes)])
    # Vertex i of reversed layer k comes from where that layer stood.
    order = np.arange(len(q)) + np.repeat(start[:-1][::-1] - begin[:-1], sizes)
    return freeze(q[order]), freeze(begin)


def narrowest_key(q: Array, start: Ints, bound: Array, endless: Bools) -> tuple[Array, float, bool]:
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
    # Twice the slack of (5): the key must never exclude what the test itself would pass.
    return key, float(bound[best] + 2 * LIMIT_TOLERANCE), bool(endless[best])


def reduced(q: Array, endless: Bools) -> Array:
    """Bring the endless joints of q (N, n) into (-pi, pi]."""
    turned = q - 2 * np.pi * np.ceil((q - np.pi) / (2 * np.pi))
    return np.where(endless, turned, q)
