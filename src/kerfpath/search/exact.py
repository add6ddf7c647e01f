"""Exact search: a bound on the cost grows until a path is found or nothing is dropped any more."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kerfpath.arrays import Array, Bools, Ints, freeze, short_repr
from kerfpath.effort import current_effort
from kerfpath.kernels import exact
from kerfpath.kernels.cost_to_go import cost_to_go
from kerfpath.kernels.search import Aim, SortedLayers
from kerfpath.kernels.states import EVERY

ROUNDING = 1e-12
"""Relative slack of a bound, so that rounding never drops the path that gave the bound."""
FIRST_GAP = 1e-3
"""First relative growth of the bound over the first-order optimum; it doubles from there."""
NARROW = 2
"""States kept for each vertex in the search for a good path, whose cost is then a ceiling."""
WORTH_A_CEILING = 0.1
"""States per vertex from which on that search saves more time than it takes."""
UNLIMITED = 2**62
NO_SEAM = np.empty(0)
"""Seam of an open path: (6) need not hold between its last increment and a first one."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class NoPathProof:
    """Proof that no admissible path exists: how far paths go, and what blocks them there.

    Parameters
    ----------
    layers : int
        Number of layers that some admissible path reaches.
    counts : (3, n) int
        Number of edges into the next layer that each joint's velocity (row 0), acceleration
        (row 1) and torque (row 2) forbids.
    shut : int
        Number of edges into the next layer that are shut.
    reached : (m,) int
        Vertices of the sorted graph, in the last layer reached, where some path ends.
    """

    layers: int
    counts: Ints
    shut: int
    reached: Ints

    __repr__ = short_repr


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BestPath:
    """A best path.

    Parameters
    ----------
    path : (K,) int
        Vertices of the sorted graph.
    cost : float
        Its objective.
    total : float
        Its sum, which breaks ties of a maximum.
    """

    path: Ints
    cost: float
    total: float

    __repr__ = short_repr


def best_path(layers: SortedLayers, aim: Aim) -> BestPath | NoPathProof:
    """Return the best path, or the proof that there is none."""
    every = np.ones(len(layers.low), np.bool_)
    return best_allowed(layers, aim, every, NO_SEAM) or dead_end(layers, aim)


def quickest_path(layers: SortedLayers, aim: Aim, ceiling: float) -> BestPath | None:
    """Return the path of least node interval (a timed objective); None if it is over `ceiling`."""
    every = np.ones(len(layers.low), np.bool_)
    found = _grow(layers, aim, every, NO_SEAM, ceiling=ceiling)
    # A path found under a bound above the ceiling is not proved: edges beyond the ceiling may have
    # been left out.
    if found is None or found[1] > ceiling:
        return None
    return BestPath(path=found[0], cost=found[1], total=found[1])


def may_cost_less(layers: SortedLayers, aim: Aim, ceiling: float) -> bool:
    """Return whether a path that need not close costs less than `ceiling`."""
    every = np.ones(len(layers.low), np.bool_)
    found = _grow(layers, aim, every, NO_SEAM, ceiling=ceiling)
    return found is not None and found[1] < ceiling


def best_allowed(
    layers: SortedLayers, aim: Aim, allowed: Bools, seam: Array, floor: float = -np.inf
) -> BestPath | None:
    """Return the best path through allowed vertices, with (6) across a seam; None if none exists.

    Of several with the same maximum, it is the one with the least sum. `floor` is a known lower
    bound on the cost.
    """
    found = _grow(layers, aim, allowed, seam, floor)
    if found is None:
        return None
    if not aim.minimax:
        return BestPath(path=found[0], cost=found[1], total=found[1])
    cap = found[1] + ROUNDING * abs(found[1])
    least_sum = aim._replace(minimax=False, cap=cap)
    again = _grow(layers, least_sum, allowed & (layers.cost <= cap), seam)
    assert again is not None, "the path that gave the cap keeps it"
    return BestPath(path=again[0], cost=found[1], total=again[1])


def lifted(layers: SortedLayers, aim: Aim) -> tuple[SortedLayers, float]:
    """Return the graph with no vertex cost below 0, and the rise of all costs.

    Bounds grow by shares of themselves, so they may not be negative. Every path visits the same
    number of vertices, so its sum grows by that number times the rise. A maximum needs no rise if
    there is a step: a step costs at least 0, so costs below 0 have no effect.
    """
    below = -float(layers.cost.min(initial=0.0))
    if below <= 0:
        return layers, 0.0
    if aim.minimax and len(layers.start) > 2:
        return layers._replace(cost=freeze(np.maximum(layers.cost, 0.0))), 0.0
    return layers._replace(cost=freeze(layers.cost + below)), below


def _grow(
    layers: SortedLayers,
    aim: Aim,
    allowed: Bools,
    seam: Array,
    floor: float = -np.inf,
    ceiling: float = np.inf,
) -> tuple[Ints, float] | None:
    """Raise the bound until the recursion finds a path, or drops no state for its cost.

    Paths that cost more than `ceiling` are not looked for.
    """
    layers, rise = lifted(layers, aim)
    h, K = np.empty(len(layers.low)), len(layers.start) - 1
    cost_to_go(layers, aim, allowed, h)
    entry = h[: layers.start[1]]
    enter = layers.cost[: layers.start[1]]
    least = float((np.maximum(enter, entry) if aim.minimax else enter + entry).min(initial=np.inf))
    if least == np.inf:
        return None
    bound, good, sought = max(least, floor + K * rise) * (1 + ROUNDING), np.inf, False
    first_gap, room = FIRST_GAP * abs(least - K * rise), current_effort().recorded_states
    while True:
        reached = exact.recursion(layers, aim, h, bound, seam, room, EVERY)
        if reached.best[-1] >= 0:
            break
        if reached.lowest == np.inf or reached.lowest > ceiling:
            return None
        if not sought and reached.offset.max() > WORTH_A_CEILING * len(layers.low):
            good = exact.recursion(layers, aim, h, np.inf, seam, 0, NARROW).cost * (1 + ROUNDING)
            sought = True
        grown = good if good < np.inf else least + max(2 * (bound - least), first_gap)
        bound = max(min(grown, ceiling), reached.lowest * (1 + ROUNDING))
    if not reached.recorded:
        # Repeat at the tightest bound, where few states have to be remembered.
        bound = reached.cost * (1 + ROUNDING)
        reached = exact.recursion(layers, aim, h, bound, seam, UNLIMITED, EVERY)
    path = np.empty(K, np.int64)
    exact.trace(layers, reached, path)
    return path, float(reached.cost) - rise * int((path >= 0).sum())


def dead_end(layers: SortedLayers, aim: Aim) -> NoPathProof:
    """Follow admissible paths as far as they go, and count what forbids the next step."""
    reached = _reach_farthest(layers, aim)
    K, n = len(layers.start) - 1, len(layers.endless)
    ends = np.unique(reached.last.vertex)
    if reached.layers in (0, K):
        none = np.zeros((3, n), np.int64)
        return NoPathProof(layers=reached.layers, counts=none, shut=0, reached=ends)
    counts, shut = exact.count_closing(layers, aim, reached.last, reached.layers)
    return NoPathProof(layers=reached.layers, counts=counts, shut=int(shut), reached=ends)


def layers_reached(layers: SortedLayers, aim: Aim) -> int:
    """Return the number of layers that some admissible path reaches."""
    return int(_reach_farthest(layers, aim).layers)


def _reach_farthest(layers: SortedLayers, aim: Aim) -> exact.RecursionResult:
    """Follow admissible paths of any cost as far as they go."""
    free = np.zeros(len(layers.low))
    return exact.recursion(layers, aim, free, np.inf, NO_SEAM, 0, EVERY)
