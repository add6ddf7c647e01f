"""The path to slow down if no path keeps the commanded node interval everywhere."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kerfpath.arrays import Array, Ints, freeze, scalar, short_repr
from kerfpath.effort import current_effort
from kerfpath.errors import InputError
from kerfpath.kernels import exact
from kerfpath.kernels.change_table import change_factors
from kerfpath.kernels.cost_to_go import cost_to_go
from kerfpath.kernels.search import Aim, LostTime, SortedLayers
from kerfpath.kernels.states import EVERY
from kerfpath.search.exact import (
    FIRST_GAP,
    NO_SEAM,
    ROUNDING,
    UNLIMITED,
    lifted,
)
from kerfpath.search.least_interval import times_asked
from kerfpath.search.problem import (
    Layers,
    SearchProblem,
    refuse_ends,
    refuse_torque,
    require_joined,
    sort_layers,
)
from kerfpath.search.slow_path import require_steps

FIRST_STRETCH = 2.0
"""Steps longer than this many node intervals are left out at first; the number doubles."""
CORNER = 0.1
"""Lost time, in node intervals, with which the recursion gets through where there is no corner."""
AROUND = 32
"""Layers before and after a corner in which a path prepares for it and recovers."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SlowedPath:
    """One vertex per layer, the cost of the path, and where it exceeds the node interval.

    Parameters
    ----------
    index : (K,) int
        Vertex of each layer, 0-based inside its layer.
    cost : float
        Distances, vertex costs and the price of the time lost; proved to be the least.
    lost : (K-1,) node intervals
        Time that each step on its own needs beyond its node interval.
    """

    index: Ints
    cost: float
    lost: Array

    __repr__ = short_repr


def find_slowed(problem: SearchProblem, *, penalty: float = 100.0) -> SlowedPath:
    """Return the path with the least sum of distances, vertex costs and priced lost time.

    A step needs the time t in which (5) would hold on it, and (6) with the step before it: the
    larger of |dq_i| / (eta_v q'max_i) and sqrt(|ddq_i| / (eta_a q''max_i)). It loses t / dt - 1
    node intervals, if that is positive. The answer is exact: the second-order recursion with both
    tests turned into prices. If some path keeps dt throughout and the penalty outweighs the
    distances, the result is that of `find_shortest`.

    Parameters
    ----------
    problem : SearchProblem
        With objective "sum".
    penalty : float
        Cost of one node interval of lost time.

    Raises
    ------
    NoFeasiblePath
        A layer is empty, or closed vertices, shut edges and the largest steps of the problem leave
        no path; the message says where.
    InputError
        Another objective, a closure, a limit on rotation, torque or jerk, costs of reversals, or a
        penalty that is not positive.
    """
    refuse_ends(problem, "slowed path")
    refuse_torque(problem, "slowed path")
    if len(problem.reversals.price):
        raise InputError("reversals: a slowed path has no costs of reversals; remove them")
    if problem.objective != "sum":
        raise InputError(f'objective: a slowed path needs "sum", got "{problem.objective}"')
    penalty = scalar(penalty, "penalty", above=0.0)
    layers, aim = problem.layers, problem.aim
    require_joined(layers)
    require_steps(problem)
    index, least = _least(layers, aim, penalty, problem.most)
    path = layers.q[layers.start[:-1] + index]
    change = aim.acceleration * change_factors(aim.table, path[1:-1])
    time, sharp = (
        asked.max(axis=1) for asked in times_asked(path, layers.endless, aim.velocity, change)
    )
    time[1:] = np.maximum(time[1:], sharp)
    lost = np.maximum(time - 1.0, 0.0)
    return SlowedPath(index=freeze(index), cost=least, lost=freeze(lost))


def _least(layers: Layers, aim: Aim, penalty: float, most: Array) -> tuple[Ints, float]:
    """Return the best path, as vertices of each layer, and its cost.

    Steps beyond `stretch` times the velocity are left out. In their place a leap may lead from
    any vertex to any other, at the least price that such a step can have. A best path without a
    leap is the best of all; else more steps are let in.
    """
    reach = np.minimum(np.where(layers.endless, np.pi, np.ptp(layers.q, axis=0)), most)
    every = float((reach / aim.velocity).max())
    stretch = FIRST_STRETCH
    while True:
        bound = np.minimum(stretch * aim.velocity, most)
        leap = float((aim.weight * bound).min()) + penalty * (stretch - 1)
        lost = LostTime(penalty, stretch, leap if stretch < every else np.inf)
        stretched = aim._replace(velocity=freeze(bound), timed=True, lost=lost)
        graph = sort_layers(layers, bound)
        path, cost = _best(graph, stretched)
        if path[0] >= 0:
            return graph.rank[path], cost
        stretch *= 2


def _best(layers: SortedLayers, aim: Aim) -> tuple[Ints, float]:
    """Raise the bound until the recursion finds a path; return the path and its cost."""
    layers, rise = lifted(layers, aim)
    K, h = len(layers.start) - 1, np.empty(len(layers.low))
    cost_to_go(layers, aim, np.ones(len(h), np.bool_), h)
    _add_corners(layers, aim, h)
    least = float((layers.cost + h)[: layers.start[1]].min())
    bound = least * (1 + ROUNDING)
    room = current_effort().recorded_states
    while (reached := exact.recursion(layers, aim, h, bound, NO_SEAM, room, EVERY)).best[-1] < 0:
        gap = max(2 * (bound - least), FIRST_GAP * least)
        bound = max(least + gap, reached.lowest * (1 + ROUNDING))
    if not reached.recorded:
        bound = reached.cost * (1 + ROUNDING)
        reached = exact.recursion(layers, aim, h, bound, NO_SEAM, UNLIMITED, EVERY)
    path = np.empty(K, np.int64)
    exact.trace(layers, reached, path)
    return path, float(reached.cost) - K * rise


def _add_corners(layers: SortedLayers, aim: Aim, h: Array) -> None:
    """Add to the first-order bound h (N,) the least loss at corners.

    Measured by h, no step costs less than zero. So the least price of passing some layers with (6),
    from any vertex to any other, is still to be paid by every path before them, and the prices of
    stretches that share no step add up. There is a stretch around each layer that the recursion
    does not reach at a small price.
    """
    last, at = len(layers.start) - 2, 0
    prices = []
    while at < last:
        stuck = at + _search_window(layers, aim, h, at, last, CORNER * aim.lost.penalty).layers
        if stuck > last:
            break
        first, at = max(stuck - AROUND, at), min(stuck + AROUND, last)
        gap = CORNER * aim.lost.penalty
        while (reached := _search_window(layers, aim, h, first, at, gap)).best[-1] < 0:
            gap = max(2 * gap, reached.lowest * (1 + ROUNDING))
        prices.append((layers.start[first + 1], reached.cost))
    for end, price in prices:
        h[:end] += price


def _search_window(
    layers: SortedLayers, aim: Aim, h: Array, first: int, last: int, gap: float
) -> exact.RecursionResult:
    """Run the recursion through layers first..last with costs measured by h and bound `gap`."""
    enter, leave = (slice(layers.start[k], layers.start[k + 1]) for k in (first, last))
    cost, rest = layers.cost.copy(), h.copy()
    cost[enter] = np.where(h[enter] < np.inf, -h[enter], 0.0)
    cost[leave] += h[leave]
    rest[leave] = np.where(h[leave] < np.inf, 0.0, np.inf)
    part = layers._replace(start=layers.start[first : last + 2], cost=freeze(cost))
    return exact.recursion(part, aim, rest, gap, NO_SEAM, 0, EVERY)
