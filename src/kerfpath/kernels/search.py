"""The path planning procedure of section 3.2: recursion (16) with the tests (5) and (6).

The layered graph is sorted within each layer by one key (a joint, or the posture), so that the
vertices of the next layer that can pass the velocity test are one or two short runs.
"""

from __future__ import annotations

from math import pi
from typing import NamedTuple

import numpy as np

from kerfpath.arrays import Array, Bools, Ints, freeze
from kerfpath.kernels.change_table import NO_TABLE, ChangeTable, fill_change
from kerfpath.kernels.jit import jit, jit_inline
from kerfpath.kernels.limits import acceleration_excess, exceeds
from kerfpath.kernels.metric import apart, extend, finish, increment, wrap_angle
from kerfpath.kernels.torque import NO_TORQUE, TorqueTest

__all__ = [
    "NO_REVERSALS",
    "Aim",
    "LostTime",
    "ReversalPrices",
    "SortedLayers",
    "arrange",
    "combined",
    "count_within",
    "distance",
    "fill_change_at",
    "fill_increment",
    "fill_key",
    "first_from",
    "is_shut",
    "late_cost",
    "path_planning",
    "runs",
    "shut_edges",
    "windows",
]


class SortedLayers(NamedTuple):
    """A layered graph in the form of the kernels: vertices are columns, sorted in each layer."""

    q: Array
    """(n, N) rad, endless joints wrapped to (-pi, pi]."""
    given: Array
    """(n, N) rad, not wrapped: increments are taken of these; q itself if no joint is wrapped."""
    start: Ints
    """(K+1,): layer k is q[:, start[k]:start[k+1]]."""
    cost: Array
    """(N,): cost of visiting a vertex, finite."""
    rank: Ints
    """(N,): index of each vertex in its layer in the order given by the user; breaks ties."""
    low: Ints
    """(N,): edges from vertex p can lead to the vertices low[p]..high[p]-1 of the next layer."""
    high: Ints
    """(N,): if high[p] < low[p], the run continues at the beginning of that layer."""
    endless: Bools
    turn: Array
    """(n,): 2 pi for endless joints, infinity for the others."""
    after: Ints
    """(K,): a path may break off at the earlier layer after[k] and begin again at layer k, with the
    cost up to after[k]; -1: it may not."""
    shut_from: Ints
    """(N+1,): the shut edges from vertex p lead to shut[shut_from[p]:shut_from[p+1]]."""
    shut: Ints
    """(S,): vertices, ascending for each p. Both arrays are empty if no edge is shut."""


class LostTime(NamedTuple):
    """The cost of time that steps take beyond their node interval."""

    penalty: float = 0.0
    """Cost of one node interval of lost time; 0 if time has no price."""
    stretch: float = 1.0
    """`Aim.velocity` divided by the increment that a step covers without losing time."""
    leap: float = np.inf
    """Least cost of a step beyond `Aim.velocity`; infinite if there are none."""


class ReversalPrices(NamedTuple):
    """The cost of joints that turn back."""

    price: Array
    """(n,): cost of a reversal of each joint; (0,) if none has a cost."""
    still: float
    """rad: a joint that moves no further than this in a step does not turn back there."""


NO_REVERSALS = ReversalPrices(freeze(np.empty(0)), 0.0)


class Aim(NamedTuple):
    """The objective (14) or (15), the bounds (5) and (6) on increments, and bounds on torques."""

    weight: Array
    """(n,) 1/rad."""
    metric: int
    minimax: bool
    """Whether the objective is (15) instead of (14)."""
    velocity: Array
    """(n,) rad: largest increment of each joint."""
    acceleration: Array
    """(n,) rad: largest change of its increment, at any vertex."""
    cap: float = np.inf
    """Largest distance, and largest cost of a vertex, allowed."""
    timed: bool = False
    """Whether (6), instead of forbidding a change, takes the node intervals in which it would hold:
    with (15) they are the cost, with (14) they cost what `lost` says."""
    lost: LostTime = LostTime()
    table: ChangeTable = NO_TABLE
    """By how much larger changes may be at a vertex."""
    torque: TorqueTest = NO_TORQUE
    """Torque limits, kept by the exact recursion if it is not `timed`."""
    reversals: ReversalPrices = NO_REVERSALS
    """Counted by the exact recursion if it is not `timed`, with (14)."""


@jit
def count_within(here: Array, there: Array, bound: Array, endless: Bools, out_count: Ints) -> None:
    """Add to out_count (n,), for each joint, the pairs of vertices within its bound; q (m, n)."""
    for p in range(len(here)):
        for j in range(len(there)):
            for i in range(len(bound)):
                out_count[i] += abs(increment(there[j, i] - here[p, i], endless[i])) <= bound[i]


@jit
def fill_key(q: Array, joint: int, endless: bool, out_key: Array) -> None:
    """Fill the angle (N,) of one joint of q (N, n), an endless one brought into (-pi, pi]."""
    for v in range(len(out_key)):
        out_key[v] = wrap_angle(q[v, joint]) if endless else q[v, joint]


@jit
def arrange(
    q: Array, key: Array, start: Ints, endless: Bools, out_q: Array, out_key: Array, out_rank: Ints
) -> None:
    """Sort each layer by its keys, ties in the order given, and lay the joints out by column."""
    for k in range(len(start) - 1):
        a = start[k]
        for v, rank in enumerate(np.argsort(key[a : start[k + 1]], kind="mergesort")):
            out_key[a + v], out_rank[a + v] = key[a + rank], rank
            for i in range(len(endless)):
                x = q[a + rank, i]
                out_q[i, a + v] = wrap_angle(x) if endless[i] else x


@jit
def windows(
    key: Array, start: Ints, width: float, circular: bool, out_low: Ints, out_high: Ints
) -> None:
    """Find the edges that may be admissible: for each vertex a run of the next layer (Eq. 12).

    Each layer is sorted by `key` (N,), and along an admissible edge the key changes by at most
    `width` (modulo 2 pi if `circular`): all other edges of (12) break the velocity limit. As the
    key grows, both ends of the run advance, and start again where the circle closes.
    """
    for k in range(len(start) - 2):
        a, b = start[k + 1], start[k + 2]
        low, high, was_first, was_last = a, a, -np.inf, -np.inf
        for p in range(start[k], start[k + 1]):
            first, last = key[p] - width, key[p] + width
            if circular and width < pi:
                first = first + 2 * pi if first < -pi else first
                last = last - 2 * pi if last > pi else last
            low = a if first < was_first else low
            high = a if last < was_last else high
            while low < b and key[low] < first:
                low += 1
            while high < b and key[high] < last:
                high += 1
            was_first, was_last = first, last
            every = (circular and width >= pi) or (last < first and low <= high)
            out_low[p], out_high[p] = (a, b) if every else (low, high)


@jit_inline
def runs(
    start: Ints, low: Ints, high: Ints, k: int, p: int
) -> tuple[tuple[int, int], tuple[int, int]]:
    """Return the two runs a..b of layer k + 1 that vertex p can lead to; one may be empty."""
    if low[p] <= high[p]:
        return (low[p], high[p]), (high[p], high[p])
    return (start[k + 1], high[p]), (low[p], start[k + 2])


@jit_inline
def shut_edges(layers: SortedLayers, p: int) -> tuple[int, int]:
    """Return the range a..b of `shut` with the edges from vertex p; a == b if none is shut."""
    if len(layers.shut) == 0:
        return 0, 0
    return layers.shut_from[p], layers.shut_from[p + 1]


@jit_inline
def first_from(key: Array | Ints, a: int, b: int, x: float) -> int:
    """First index of a..b whose key is not below x, keys ascending; b if there is none."""
    while a < b:
        middle = (a + b) // 2
        if key[middle] < x:
            a = middle + 1
        else:
            b = middle
    return a


@jit_inline
def is_shut(shut: Ints, a: int, b: int, j: int) -> bool:
    """Return whether vertex j is among a..b of `shut`."""
    at = first_from(shut, a, b, j)
    return at < b and shut[at] == j


@jit_inline
def distance(layers: SortedLayers, aim: Aim, p: int, j: int) -> float:
    """Distance rho from vertex p to vertex j; infinite where (5) or the cap forbids it."""
    total = 0.0
    for i in range(len(layers.endless)):
        y = apart(abs(layers.q[i, j] - layers.q[i, p]), layers.turn[i])
        if exceeds(y, aim.velocity[i]):
            return np.inf
        total = extend(total, aim.weight[i] * y, aim.metric)
    total = finish(total, aim.metric)
    return total if total <= aim.cap else np.inf


@jit_inline
def combined(minimax: bool, a: float, b: float) -> float:
    """Combine two costs: their sum for (14), the larger for (15)."""
    return max(a, b) if minimax else a + b


@jit_inline
def late_cost(lost: LostTime, time: float) -> float:
    """Price of a step that takes `time` node intervals."""
    return lost.penalty * max(0.0, time - 1.0)


@jit_inline
def fill_change_at(layers: SortedLayers, aim: Aim, p: int, out: Array) -> None:
    """Fill the largest change (n,) rad of the increment at vertex p."""
    if len(aim.table.joint_2) > 0:
        fill_change(aim.table, layers.given[1, p], layers.given[2, p], aim.acceleration, out)
    else:
        for i in range(len(out)):
            out[i] = aim.acceleration[i]


@jit_inline
def fill_increment(layers: SortedLayers, p: int, j: int, out_dq: Array) -> None:
    """Fill the joint increment (n,) from vertex p to vertex j."""
    for i in range(len(layers.endless)):
        out_dq[i] = increment(layers.given[i, j] - layers.given[i, p], layers.endless[i])


@jit_inline
def _offer(
    layers: SortedLayers, aim: Aim, k: int, p: int, dq: Array, dq_before: Array, change: Array,
    out_dist: Array, out_before: Ints, out_free: Array,
) -> None:  # fmt: skip
    """Offer vertex p of layer k as predecessor to the vertices its edges lead to, step (2b).

    out_free keeps the best offer regardless of acceleration; dq, dq_before, change (n,) are scratch
    arrays.
    """
    if k > 0:
        fill_increment(layers, out_before[p], p, dq_before)
        fill_change_at(layers, aim, p, change)
    (a, b), (c, d) = runs(layers.start, layers.low, layers.high, k, p)
    first, last = shut_edges(layers, p)
    for v in range(a, b + d - c):
        j = v if v < b else v - b + c
        if is_shut(layers.shut, first, last, j):
            continue
        cost = combined(aim.minimax, out_dist[p], distance(layers, aim, p, j))
        best, best_p = out_dist[j], out_before[j]
        tie = cost == best and best_p >= 0 and layers.rank[p] < layers.rank[best_p]
        if not (cost < best or tie):
            continue
        out_free[j] = min(out_free[j], cost)
        if k > 0:
            fill_increment(layers, p, j, dq)
            if acceleration_excess(dq, dq_before, change) >= 0:
                continue
        out_dist[j], out_before[j] = cost, p


@jit_inline
def _step(
    layers: SortedLayers, aim: Aim, k: int, dq: Array, dq_before: Array, change: Array,
    out_dist: Array, out_before: Ints, out_free: Array,
) -> tuple[bool, bool]:  # fmt: skip
    """Step (2) from layer k to the next: whether any vertex was reached, and any was refused."""
    for p in range(layers.start[k], layers.start[k + 1]):
        if out_dist[p] < np.inf:
            _offer(layers, aim, k, p, dq, dq_before, change, out_dist, out_before, out_free)
    reached = turned_away = False
    for j in range(layers.start[k + 1], layers.start[k + 2]):
        turned_away |= out_free[j] < out_dist[j]
        reached |= out_before[j] >= 0
        out_dist[j] = combined(aim.minimax, out_dist[j], layers.cost[j])
    return reached, turned_away


@jit
def path_planning(
    layers: SortedLayers, aim: Aim, out_dist: Array, out_before: Ints
) -> tuple[int, bool]:
    """Fill d*_{k,j} = min over p of d*_{k-1,p} + rho(p, j), and the best p, by layers (Eq. 16).

    Steps (1) and (2) of the procedure, with (5) in (2b-beta) and, greedily, (6) in (2b-gamma): the
    acceleration is tested against the best predecessor of p only. Returns the number of layers
    reached, and whether the greedy test ever refused a better edge (if not, the recursion was
    exact).
    """
    n, K, turned_away = len(layers.endless), len(layers.start) - 1, False
    dq, dq_before, change = np.empty(n), np.empty(n), np.empty(n)
    free = np.full(len(layers.low), np.inf)
    first = layers.start[1]
    out_dist[:first] = layers.cost[:first]
    for k in range(K - 1):
        reached, away = _step(layers, aim, k, dq, dq_before, change, out_dist, out_before, free)
        turned_away |= away
        if not reached:
            return k + 1, turned_away
    return K, turned_away
