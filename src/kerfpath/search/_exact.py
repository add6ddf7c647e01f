"""The exact search: bounds that grow until a path is found, or nothing is left to drop."""

from __future__ import annotations

import heapq
import itertools
from dataclasses import dataclass

import numpy as np

from kerfpath._arrays import Array, Bools, Ints
from kerfpath.kernels import exact, to_go
from kerfpath.kernels.limits import acceleration_excess
from kerfpath.kernels.metric import increments
from kerfpath.kernels.search import Layers, Objective

__all__ = ["Best", "Dead", "best_closed_path", "best_path", "dead_end", "quickest_path"]

ROUNDING = 1e-12
"""Relative slack on a bound, so that rounding never drops the path that the bound came from."""
FIRST_GAP = 1e-3
"""First growth of the bound over the first-order optimum, relative; it doubles from there."""
NARROW = 2
"""States of a vertex that the search for a good path keeps, whose cost is then a ceiling."""
WORTH_A_CEILING = 0.1
"""States per vertex from which on that search takes less time than it saves."""
ROOM = 10_000_000
"""States that a search under a loose bound may remember: 80 MB."""
UNLIMITED = 2**62
NO_SEAM = np.empty(0)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Dead:
    """Proof that no admissible path exists: how far any goes, and what forbids to go on.

    Parameters
    ----------
    layers : int
        Number of layers that some admissible path reaches.
    counts : (2, n) int
        Of the ways into the next layer, how many each joint's velocity (row 0) and acceleration
        (row 1) forbids.
    """

    layers: int
    counts: Ints


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Best:
    """A best path.

    Parameters
    ----------
    path : (K,) int
        Vertices of the sorted graph.
    cost : float
        Its objective.
    total : float
        Its sum; what ties of a maximum are broken by.
    """

    path: Ints
    cost: float
    total: float


def best_path(layers: Layers, aim: Objective) -> Best | Dead:
    """Return the best path, or how far any goes."""
    every = np.ones(len(layers.low), np.bool_)
    return _lexicographic(layers, aim, every, NO_SEAM, 0.0) or dead_end(layers, aim)


def best_closed_path(layers: Layers, aim: Objective) -> Best | Dead:
    """Return the best path that returns to the vertex it left, with (6) across the seam.

    Branch and bound over the vertex left and the edge it is left by. A relaxation lets a path leave
    by any vertex of a set and return to any other of it; the cheapest relaxation that happens to
    close is the answer.
    """
    K = len(layers.start) - 1
    twin = _twins(layers)
    count = itertools.count()
    queue: list[tuple[float, float, int, Best, Ints, Ints]] = []

    def look(starts: Ints, firsts: Ints, floor: float) -> None:
        """Put the best path that leaves by `starts` and `firsts` in the queue."""
        allowed = np.ones(len(layers.low), np.bool_)
        allowed[: layers.start[1]] = False
        allowed[starts] = True
        allowed[layers.start[1] : layers.start[2]] &= np.isin(
            np.arange(layers.start[1], layers.start[2]), firsts
        )
        allowed[layers.start[K - 1] :] &= np.isin(
            np.arange(layers.start[K - 1], len(layers.low)), twin[starts]
        )
        one = len(starts) == len(firsts) == 1
        seam = _increments(layers, np.append(starts, firsts))[0] if one else NO_SEAM
        found = _lexicographic(layers, aim, allowed, seam, floor)
        if found is not None:
            heapq.heappush(queue, (found.cost, found.total, next(count), found, starts, firsts))

    if K == 1:
        return best_path(layers, aim)
    look(np.arange(layers.start[1]), np.arange(layers.start[1], layers.start[2]), 0.0)
    if not queue:
        return dead_end(layers, aim)
    while queue:
        cost, _, _, found, starts, firsts = heapq.heappop(queue)
        path = found.path
        if len(starts) == len(firsts) == 1:
            return found  # the recursion has kept the seam
        if twin[path[0]] == path[-1] and _passes_seam(layers, aim, path):
            return found
        if len(starts) > 1:
            for half in _split(layers, starts, path[0], np.flatnonzero(twin == path[-1])):
                look(half, firsts, cost)
        else:
            look(starts, path[1:2], cost)
            if len(firsts) > 1:
                look(starts, firsts[firsts != path[1]], cost)
    return Dead(layers=K - 1, counts=np.zeros((2, len(layers.endless)), np.int64))


def quickest_path(layers: Layers, aim: Objective, ceiling: float) -> Best | None:
    """Return the path of least node interval, if that is `ceiling` or less (a timed objective)."""
    every = np.ones(len(layers.low), np.bool_)
    found = _grow(layers, aim, every, NO_SEAM, 0.0, ceiling)
    return None if found is None else Best(path=found[0], cost=found[1], total=found[1])


def _lexicographic(
    layers: Layers, aim: Objective, allowed: Bools, seam: Array, floor: float
) -> Best | None:
    """Return the best path; for a maximum, of all best paths the one with the least sum."""
    found = _grow(layers, aim, allowed, seam, floor)
    if found is None:
        return None
    if not aim.minimax:
        return Best(path=found[0], cost=found[1], total=found[1])
    cap = found[1]
    least_sum = aim._replace(minimax=False, cap=cap)
    again = _grow(layers, least_sum, allowed & (aim.vertex_cost <= cap), seam, 0.0)
    assert again is not None, "the path that gave the cap keeps it"
    return Best(path=again[0], cost=cap, total=again[1])


def _grow(
    layers: Layers,
    aim: Objective,
    allowed: Bools,
    seam: Array,
    floor: float,
    ceiling: float = np.inf,
) -> tuple[Ints, float] | None:
    """Raise the bound until the recursion comes through, or drops nothing for its cost.

    No path dearer than `ceiling` is looked for.
    """
    h = np.empty(len(layers.low))
    to_go.cost_to_go(layers, aim, allowed, h)
    entry = h[: layers.start[1]]
    enter = aim.vertex_cost[: layers.start[1]]
    least = float((np.maximum(enter, entry) if aim.minimax else enter + entry).min(initial=np.inf))
    if least == np.inf:
        return None
    bound, good, sought = max(least, floor) * (1 + ROUNDING), np.inf, False
    while True:
        reached = exact.recursion(layers, aim, h, bound, seam, ROOM, exact.EVERY)
        if reached.state >= 0:
            break
        if reached.lowest == np.inf or reached.lowest > ceiling:
            return None
        if not sought and reached.offset.max() > WORTH_A_CEILING * len(layers.low):
            good = exact.recursion(layers, aim, h, np.inf, seam, 0, NARROW).cost * (1 + ROUNDING)
            sought = True
        grown = good if good < np.inf else least + max(2 * (bound - least), FIRST_GAP * least)
        bound = max(min(grown, ceiling), reached.lowest * (1 + ROUNDING))
    if not reached.recorded:
        # Once more at the tightest bound: few states are left to remember.
        bound = reached.cost * (1 + ROUNDING)
        reached = exact.recursion(layers, aim, h, bound, seam, UNLIMITED, exact.EVERY)
    path = np.empty(len(layers.start) - 1, np.int64)
    exact.trace(reached, path)
    return path, float(reached.cost)


def dead_end(layers: Layers, aim: Objective) -> Dead:
    """Go as far as any admissible path goes, whatever it costs."""
    free = np.zeros(len(layers.low))
    reached = exact.recursion(layers, aim, free, np.inf, NO_SEAM, 0, exact.EVERY)
    K, n = len(layers.start) - 1, len(layers.endless)
    if reached.layers in (0, K):
        return Dead(layers=reached.layers, counts=np.zeros((2, n), np.int64))
    counts = exact.count_closing(layers, aim, reached.last, reached.layers)
    return Dead(layers=reached.layers, counts=counts)


def _twins(layers: Layers) -> Ints:
    """Return, for each vertex of the first layer, the same vertex of the last one."""
    first, last = layers.start[1], layers.start[-2]
    by_rank = np.empty(first, np.int64)
    by_rank[layers.rank[last:]] = np.arange(last, len(layers.low))
    return by_rank[layers.rank[:first]]


def _increments(layers: Layers, path: Ints) -> Array:
    return increments(np.ascontiguousarray(layers.q[:, path].T), layers.endless)


def _passes_seam(layers: Layers, aim: Objective, path: Ints) -> bool:
    dq = _increments(layers, path)
    return acceleration_excess(dq[0], dq[-1], aim.acceleration) < 0


def _split(layers: Layers, starts: Ints, left: int, returned: Ints) -> tuple[Ints, Ints]:
    """Part the vertices by which of two they are nearer to; the two come to lie in different parts.

    Where the path closed and only the seam failed, the vertex left is parted from the others.
    """
    a, b = int(left), int(returned[0])
    if a == b:
        return starts[starts == a], starts[starts != a]
    nearer = _gap(layers, starts, a) < _gap(layers, starts, b)
    nearer |= starts == a
    nearer &= starts != b
    return starts[nearer], starts[~nearer]


def _gap(layers: Layers, vertices: Ints, v: int) -> Array:
    """Return the sum of joint differences from vertex v to others of its layer, rad."""
    gap = np.abs(layers.q[:, vertices] - layers.q[:, [v]])
    around = np.minimum(gap, 2 * np.pi - gap)
    return np.asarray(np.where(layers.endless[:, None], around, gap).sum(axis=0))
