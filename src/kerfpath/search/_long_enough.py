"""Where a cut may be interrupted if no piece may be short: spans of nodes, halved until all are.

Node b can end a piece that begins at node a if an admissible path leads from a to b: up to the
reach of a, which never falls behind that of a node before. With a least length the fewest pieces
are a shortest path over nodes; for the cheapest of such cuts the nodes of every interruption have a
span, and a cut that is best within the spans but has a short piece halves one of them.
"""

from __future__ import annotations

from collections.abc import Callable
from heapq import heappop, heappush
from itertools import count, pairwise
from typing import NamedTuple, TypeVar

import numpy as np

from kerfpath._arrays import Array, Bools, Ints

__all__ = ["PieceLengths", "PieceSpans", "all_reaches", "cheapest", "fewest"]

ROUNDING = 1e-9
"""Relative slack of a length, so that a piece that is just as long as asked passes."""

_T = TypeVar("_T")


class PieceLengths(NamedTuple):
    """Which nodes are far enough apart to bound a piece."""

    after: Ints
    """(K,): the first node that a piece from each node may end at; K where there is none."""
    before: Ints
    """(K,): the last node that a piece to each node may begin at; -1 where there is none."""

    @classmethod
    def of(cls, s: Array, least: float) -> PieceLengths:
        """Return them for nodes at `s` (K,) m, increasing, and pieces of `least` m or more."""
        least *= 1 - ROUNDING
        return cls(
            after=np.searchsorted(s, s + least, side="left"),
            before=np.searchsorted(s, s - least, side="right") - 1,
        )


class PieceSpans(NamedTuple):
    """First and last node, both (m + 1,), at which each of m pieces may begin, and the last end."""

    low: Ints
    high: Ints


def all_reaches(reach: Callable[[int], int], K: int) -> Ints:
    """Return the last node (K,) that a path from each node can end at; it never decreases."""
    found = np.full(K, K - 1)
    found[0] = reach(0)

    def fill(a: int, b: int) -> None:
        """Fill between nodes a and b, whose reaches are known."""
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
    """Return where the fewest pieces, two or more, may begin; None where no number will do."""
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
    """Return which nodes (K,) a piece from one of `nodes` can end at."""
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
        Some such cut is within them.
    reach : (K,) int
    apart : PieceLengths
    solve : callable
        Returns, for spans, what no cut within them costs less than, the nodes (m + 1,) at which the
        cut with that cost begins its pieces and ends, and that cut; None where there is none.
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
        # Begun here or later it would have to end later, and else it would begin earlier.
        middle = (apart.before[nodes[i + 1]] + 2 + nodes[i]) // 2
        low, high = spans.low.copy(), spans.high.copy()
        low[i], high[i] = middle, middle - 1
        look_at(_tight(spans._replace(low=low), reach, apart))
        look_at(_tight(spans._replace(high=high), reach, apart))


def _tight(spans: PieceSpans, reach: Ints, apart: PieceLengths) -> PieceSpans | None:
    """Return the spans without what their neighbours leave no room for; None if nothing is left."""
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
