"""From bare arrays to the sorted graph that the kernels search."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from kerfpath._arrays import Array, Bools, Ints, freeze, integers
from kerfpath.errors import InputError, NoFeasiblePath
from kerfpath.kernels import search as kernel
from kerfpath.kernels.limits import LIMIT_TOLERANCE

__all__ = ["backwards", "empty_layer", "narrowest_key", "offsets", "sorted_layers"]

_LAYERS_SAMPLED = 32
"""Layers looked at to choose the joint that sorts them: enough to rank the joints."""


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
    layers = kernel.Layers(
        q=columns,
        start=start,
        rank=rank,
        low=low,
        high=high,
        endless=endless,
        turn=np.where(endless, 2 * np.pi, np.inf),
    )
    return layers, rank + np.repeat(start[:-1], np.diff(start))


def empty_layer(k: int) -> NoFeasiblePath:
    """Return the answer for a graph whose layer k has no vertex."""
    if k == 0:
        return NoFeasiblePath("layer 0 is empty: no path can start", proved=True, node=-1)
    return NoFeasiblePath(
        f"layer {k} is empty: no admissible pose at that node", proved=True, node=k - 1
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
    pairs = np.zeros(q.shape[1])
    layers = np.unique(np.linspace(0, max(len(start) - 3, 0), _LAYERS_SAMPLED).astype(int))
    for k in layers[layers + 2 < len(start)]:
        here, there = (_reduced(q[start[i] : start[i + 1]], endless) for i in (k, k + 1))
        for i in range(q.shape[1]):
            sorted_ = np.sort(there[:, i])
            around = endless[i] and bound[i] < np.pi
            reach = np.inf if endless[i] and not around else bound[i]
            for shift in (-2 * np.pi, 0.0, 2 * np.pi) if around else (0.0,):
                low = np.searchsorted(sorted_, here[:, i] + shift - reach, side="left")
                high = np.searchsorted(sorted_, here[:, i] + shift + reach, side="right")
                pairs[i] += (high - low).sum()
    best = int(np.argmin(pairs))
    key = _reduced(q[:, [best]], endless[[best]])[:, 0]
    # Twice the slack of (5): the key must never exclude what the test itself would pass.
    return key, float(bound[best] + 2 * LIMIT_TOLERANCE), bool(endless[best])


def _reduced(q: Array, endless: Bools) -> Array:
    """Bring the endless joints of q (N, n) into (-pi, pi]."""
    turned = q - 2 * np.pi * np.ceil((q - np.pi) / (2 * np.pi))
    return np.where(endless, turned, q)
