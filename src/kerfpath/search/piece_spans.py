"""Interruptions with a least length of pieces: spans of nodes, halved until all pieces fit.

Node b can end a piece that begins at node a if an admissible path leads from a to b, that is, up to
the reach of a, which never decreases from node to node. The fewest pieces with a least length are a
shortest path over nodes. To find the cheapest of such cuts, each interruption gets a span of nodes;
if the best cut within the spans has a short piece, one of the spans is halved.
"""

from __future__ import annotations

from collections.abc import Callable
from heapq import heappop, heappush
from itertools import count, pairwise
from typing import NamedTuple, TypeVar

import numpy as np

from kerfpath.arrays import Array, Bools, Ints

ROUNDING = 1e-9
"""Relative slack of a length, so that a piece of exactly the least length passes."""

_T = TypeVar("_T")


class PieceLengths(NamedTuple):
    """Nodes that are far enough apart to bound a piece."""

    after: Ints
    """(K,): the first node at which a piece from each node may end; K if there is none."""
    before: Ints
    """(K,): the last node at which a piece to each node may begin; -1 if there is none."""

    @classmethod
    def of(cls, s: Array, least: float) -> PieceLengths:
        """Return the nodes for arc lengths `s` (K,) m, increasing, and pieces of `least` m."""
        least *= 1 - ROUNDING
        return cls(
            after=np.searchsorted(s, s + least, side="left"),
            before=np.searchsorted(s, s - least, side="right") - 1,
        )


class PieceSpans(NamedTuple):
    """First and last node, (m + 1,) each, at which each of m pieces may begin and the last end."""

    low: Ints
    high: Ints


def all_reaches(reach: Callable[[int], int], K: int) -> Ints:
    """Return the last node (K,) at which a path from each node can end; it never decreases."""
    found = np.full(K, K - 1)
    found[0] = reach(0)

    def fill(a: int, b: int) -> None:
        """Fill in the reaches between nodes a and b, whose own are known."""
        if found[a] == found[b]:
            found[a : b + 1] = found[a]
        elif b - a > 1:
            middle = (a + b) // 2
            found[middle] = reach(middle)
            fill(a, middle)
            fill(middle, b)

    fill(0, K - 1)
    return found


def fewest(reach: Ints, apart: PieceLengths) -> PieceSpans | None:
    """Return the spans of the fewest pieces, two or more; None if no number of pieces fits."""
    K = len(reach)
    begun = [np.arange(K) == 0]
    while not begun[-1][K - 1]:
        ends = _between(np.flatnonzero(begun[-1]), apart.after, reach, K)
        if not ends.any():
            return None
        begun.append(ends)
    low, high = np.empty(len(begun), np.int64), np.empty(len(begun), np.int64)
    there = np.arange(K) == K - 1
    for i in range(len(begun) - 1, -1, -1):
        low[i], high[i] = np.flatnonzero(there)[[0, -1]]
        if i:
            on = np.cumsum(np.append(0, there))
            last = np.minimum(reach + 1, K)
            there = begun[i - 1] & (on[last] > on[np.minimum(apart.after, last)])
    return PieceSpans(low, high)


def _between(nodes: Ints, after: Ints, reach: Ints, K: int) -> Bools:
    """Return at which nodes (K,) a piece from one of `nodes` can end."""
    begin, end = after[nodes], reach[nodes] + 1
    some = begin < end
    marks = np.zeros(K + 1, np.int64)
    np.add.at(marks, begin[some], 1)
    np.add.at(marks, end[some], -1)
    return np.asarray(np.cumsum(marks[:-1]) > 0)


def cheapest(
    spans: PieceSpans,
    reach: Ints,
    apart: PieceLengths,
    solve: Callable[[PieceSpans], tuple[tuple[float, float], Ints, _T] | None],
) -> _T:
    """Return the cheapest cut within the spans whose pieces are all long enough.

    Parameters
    ----------
    spans : PieceSpans
        Spans that contain at least one such cut.
    reach : (K,) int
    apart : PieceLengths
    solve : callable
        Takes spans and returns the cost of the cheapest cut within them, the nodes (m + 1,) at
        which its pieces begin and it ends, and the cut itself; None if there is no cut.
    """
    order, heap = count(), list[tuple[tuple[float, float], int, PieceSpans, Ints, _T]]()

    def look_at(spans: PieceSpans | None) -> None:
        found = None if spans is None else solve(spans)
        if spans is not None and found is not None:
            heappush(heap, (found[0], next(order), spans, *found[1:]))

    look_at(_tight(spans, reach, apart))
    while True:
        _, _, spans, nodes, cut = heappop(heap)
        short = [i for i, (a, b) in enumerate(pairwise(nodes)) if b < apart.after[a]]
        if not short:
            return cut
        i = short[0]
        # Split the start of the short piece: if it begins at `middle` or later, it must end later.
        middle = (apart.before[nodes[i + 1]] + 2 + nodes[i]) // 2
        low, high = spans.low.copy(), spans.high.copy()
        low[i], high[i] = middle, middle - 1
        look_at(_tight(spans._replace(low=low), reach, apart))
        look_at(_tight(spans._replace(high=high), reach, apart))


def _tight(spans: PieceSpans, reach: Ints, apart: PieceLengths) -> PieceSpans | None:
    """Return the spans without nodes that no neighbouring span allows; None if one is empty."""
    low, high = spans.low.copy(), spans.high.copy()
    while True:
        was = low.sum(), high.sum()
        for i in range(len(low) - 1):
            if not _some(low, high):
                return None
            low[i + 1] = max(low[i + 1], apart.after[low[i]])
            high[i + 1] = min(high[i + 1], reach[high[i]])
        for i in range(len(low) - 1, 0, -1):
            if not _some(low, high):
                return None
            low[i - 1] = max(low[i - 1], np.searchsorted(reach, low[i]))
            high[i - 1] = min(high[i - 1], apart.before[high[i]])
        if not _some(low, high):
            return None
        if (low.sum(), high.sum()) == was:
            return PieceSpans(low, high)


def _some(low: Ints, high: Ints) -> bool:
    return bool((low <= high).all())
