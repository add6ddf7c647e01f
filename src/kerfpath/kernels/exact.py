"""Recursion (16) made exact under the acceleration limit (6), and under torque limits.

The procedure of section 3.2 tests the acceleration against the best predecessor only and can lose
the optimum. Here the state is an edge (p, j): (5) is then a test of a state and (6) a test of two
neighbouring states, and the recursion

    d(p, j) = rho(p, j) + min over l of d(l, p), with (6) for l, p, j

is exact. Torques at p are functions of the same two states, see `kerfpath.kernels.torque`. Where
joints that turn back have a price, which is added to d, a state also has the direction in which
each of them moved last. The first-order problem solved backwards gives a bound h(j) on the cost to
come: given a bound on the cost, only states with d + h within it are kept.
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kerfpath.arrays import Array, Ints
from kerfpath.kernels.jit import jit, jit_inline, jit_part
from kerfpath.kernels.limits import (
    acceleration_excess,
    acceleration_time,
    velocity_excess,
    velocity_time,
)
from kerfpath.kernels.reach import fill_candidates
from kerfpath.kernels.search import (
    Aim,
    ReversalPrices,
    SortedLayers,
    combined,
    distance,
    fill_change_at,
    fill_increment,
    is_shut,
    late_cost,
    shut_edges,
)
from kerfpath.kernels.states import Scratch, States, group_by_vertex, joined_states, with_more_room
from kerfpath.kernels.torque import TorqueRoom, torque_excess, torque_room

__all__ = ["RecursionResult", "count_closing", "recursion", "trace"]

LEAPT = -2
"""Parent of a state that was reached by a step beyond `aim.velocity`, from any vertex."""


class RecursionResult(NamedTuple):
    """The result of a recursion under a bound on the cost."""

    layers: int
    """Number of layers that some state reached."""
    cost: float
    """Cost of the best path, infinite if none kept the bound."""
    lowest: float
    """Least d + h of the states dropped for their cost; infinite if none was."""
    best: Ints
    """(K,): the best state of each layer, -1 if none."""
    offset: Ints
    """(K+1,): the states of layer k in the record are offset[k]:offset[k+1]."""
    vertex: NDArray[np.int32]
    """Record: the vertex of every state kept."""
    parent: NDArray[np.int32]
    """Record: the parent of every state kept, its place in the layer before."""
    last: States
    """The states of the last layer that some state reached."""
    recorded: bool
    """Whether the record is complete."""


@jit_part
def _begin(
    layers: SortedLayers, aim: Aim, h: Array, bound: float, k: int, cost: float
) -> tuple[States, float]:
    """States of layer k, one per vertex, with no edge before them; and the least cost dropped.

    `cost` is the cost up to there.
    """
    a, count, lowest = layers.start[k], 0, np.inf
    m = layers.start[k + 1] - a
    vertex, d, first = np.empty(m, np.int64), np.empty(m), np.zeros(m + 1, np.int64)
    for i in range(m):
        enter = combined(aim.minimax, cost, layers.cost[a + i])
        f = combined(aim.minimax, enter, h[a + i])
        if f <= bound and f < np.inf:
            vertex[count], d[count] = a + i, enter
            count += 1
        else:
            lowest = min(lowest, f)
        first[i + 1] = count
    none = np.empty((count, len(layers.endless)))
    parent, way = np.full(count, -1), np.zeros(count, np.int64)
    return States(vertex[:count], d[:count], none, parent, way, first), lowest


@jit_inline
def _breaks(
    layers: SortedLayers, aim: Aim, p: int, dq_before: Array, dq: Array, change: Array,
    room: TorqueRoom,
) -> bool:  # fmt: skip
    """Whether (6) or a torque limit forbids the increment dq after dq_before at vertex p.

    change (n,) rad is the largest change of the increment there.
    """
    if acceleration_excess(dq, dq_before, change) >= 0:
        return True
    return torque_excess(aim.torque, layers.given, p, dq_before, dq, room) >= 0


@jit_inline
def _turned(reversals: ReversalPrices, way: int, dq: Array) -> tuple[int, float]:
    """Directions of the joints after the increment dq (n,), and the price of those that turn back.

    `way` is the directions before, a digit of base 3 for each joint: 0 if it has not moved yet, 1
    up, 2 down. A joint that is still keeps its direction.
    """
    price, unit = 0.0, 1
    for i in range(len(dq)):
        if reversals.price[i] > 0.0 and abs(dq[i]) > reversals.still:
            before, after = way // unit % 3, 1 if dq[i] > 0.0 else 2
            if before not in (0, after):
                price += reversals.price[i]
            way += (after - before) * unit
        unit *= 3
    return way, price


@jit_inline
def _predecessor(
    layers: SortedLayers, aim: Aim, states: States, a: int, b: int, p: int, step: float, dq: Array,
    rest: float, bound: float, change: Array, room: TorqueRoom,
) -> tuple[int, float, float]:  # fmt: skip
    """Find which of the states a..b of p, cheapest first, continues by dq at the least cost.

    `step` is the cost of the step, `rest` the cost to come. Returns the state, -1 if none keeps the
    bound; the cost up to and with the step; and the least cost over the bound.
    """
    if aim.timed:
        return _quickest(states, a, b, aim, step, dq, rest, bound, change)
    for s in range(a, b):
        d = combined(aim.minimax, states.d[s], step)
        f = combined(aim.minimax, d, rest)
        if f > bound:
            return -1, np.inf, f
        if states.parent[s] < 0 or not _breaks(layers, aim, p, states.dq[s], dq, change, room):
            return s, d, np.inf
    return -1, np.inf, np.inf


@jit_inline
def _quickest(
    states: States, a: int, b: int, aim: Aim, step: float, dq: Array, rest: float, bound: float,
    change: Array,
) -> tuple[int, float, float]:  # fmt: skip
    """As `_predecessor`, where a change of the increment takes time."""
    best, best_d, over, paid = -1, np.inf, np.inf, 0.0
    if aim.lost.penalty > 0:
        paid = late_cost(aim.lost, aim.lost.stretch * velocity_time(dq, aim.velocity))
        step += paid
    for s in range(a, b):
        d = combined(aim.minimax, states.d[s], step)
        if d >= best_d:
            break
        if combined(aim.minimax, d, rest) > bound:
            over = min(over, combined(aim.minimax, d, rest))
            break
        time = 0.0
        if states.parent[s] >= 0:
            time = acceleration_time(dq, states.dq[s], change)
        elif states.parent[s] == LEAPT:
            time = _braking_time(dq, aim, change)
        d = max(d, time) if aim.minimax else d + max(0.0, late_cost(aim.lost, time) - paid)
        f = combined(aim.minimax, d, rest)
        if f > bound:
            over = min(over, f)
        elif d < best_d:
            best, best_d = s, d
    return best, best_d, over


@jit_inline
def _braking_time(dq: Array, aim: Aim, change: Array) -> float:
    """Least time, in node intervals, for the change between dq and any step over `aim.velocity`.

    change (n,) rad is the largest change of the increment there.
    """
    least = np.inf
    for i in range(len(dq)):
        least = min(least, max(0.0, aim.velocity[i] - abs(dq[i])) / change[i])
    return sqrt(least)


@jit_part
def _add_leaps(
    layers: SortedLayers, aim: Aim, h: Array, bound: float, k: int, before: States,
    states: States, width: int,
) -> tuple[States, float]:  # fmt: skip
    """Add to the states of layer k those that steps beyond `aim.velocity` may lead to.

    They cost no more than any such step from any of the states before.
    """
    a, b, d, lowest = layers.start[k], layers.start[k + 1], np.inf, np.inf
    paid, change = late_cost(aim.lost, aim.lost.stretch), np.empty(len(layers.endless))
    for s in range(len(before.vertex)):
        fill_change_at(layers, aim, before.vertex[s], change)
        time = _braking_time(before.dq[s], aim, change) if before.parent[s] >= 0 else 0.0
        d = min(d, before.d[s] + aim.lost.leap + max(0.0, late_cost(aim.lost, time) - paid))
    f = d + layers.cost[a:b] + h[a:b]
    leapt = a + np.flatnonzero(f <= bound)
    m = len(leapt)
    for v in range(b - a):
        lowest = min(lowest, f[v]) if f[v] > bound else lowest
    none = np.zeros((m, states.dq.shape[1]))
    parent, way = np.full(m, LEAPT), np.zeros(m, np.int64)
    more = States(leapt, d + layers.cost[leapt], none, parent, way, states.first)
    return group_by_vertex(joined_states(states, more), a, b, width), lowest


@jit_inline
def _fill_ways(
    layers: SortedLayers, aim: Aim, states: States, a: int, b: int, p: int, j: int, step: float,
    dq: Array, rest: float, bound: float, count: int, scratch: Scratch, out: States,
) -> tuple[int, float]:  # fmt: skip
    """Append the states of the edge from p to j where joints that turn back at p have a price.

    There is one for each way in which joints that stand still along the edge moved before. Returns
    the count, -1 if there is no room, and the least cost dropped.
    """
    begin, lowest = count, np.inf
    for s in range(a, b):
        d = states.d[s] + step
        if d + rest > bound:
            lowest = min(lowest, d + rest)
            break
        if states.parent[s] >= 0 and _breaks(
            layers, aim, p, states.dq[s], dq, scratch.change, scratch.torque
        ):
            continue
        way, price = _turned(aim.reversals, states.way[s], dq)
        d += price
        if d + rest > bound:
            lowest = min(lowest, d + rest)
            continue
        at = begin
        while at < count and out.way[at] != way:
            at += 1
        if at == len(out.vertex):
            return -1, lowest
        if at == count or d < out.d[at]:
            out.vertex[at], out.parent[at], out.d[at], out.way[at] = j, s, d, way
            for x in range(len(dq)):
                out.dq[at, x] = dq[x]
            count = max(count, at + 1)
    return count, lowest


@jit_inline
def _fill_from(
    layers: SortedLayers, aim: Aim, h: Array, bound: float, seam: Array, k: int, states: States,
    i: int, count: int, scratch: Scratch, out: States,
) -> tuple[int, float]:  # fmt: skip
    """Append the states that leave vertex i of layer k; return the count and least cost dropped.

    The count is -1 if there is no room for them.
    """
    a, b, p, lowest = states.first[i], states.first[i + 1], layers.start[k] + i, np.inf
    if a == b:
        return count, lowest
    closes = len(seam) > 0 and k == len(layers.start) - 3
    fill_change_at(layers, aim, p, scratch.change)
    some, dq = fill_candidates(layers, aim, states, a, b, k, p, scratch), scratch.dq
    for v in range(some):
        j = scratch.vertex[v]
        if h[j] == np.inf:
            continue
        step = combined(aim.minimax, distance(layers, aim, p, j), layers.cost[j])
        if step == np.inf:
            continue
        f = combined(aim.minimax, combined(aim.minimax, states.d[a], step), h[j])
        if f > bound:
            lowest = min(lowest, f)
            continue
        first, last = shut_edges(layers, p)
        if is_shut(layers.shut, first, last, j):  # tested last: few edges get here
            continue
        fill_increment(layers, p, j, dq)
        if closes:
            fill_change_at(layers, aim, j, scratch.seam)
            if _breaks(layers, aim, j, dq, seam, scratch.seam, scratch.torque):
                continue
        if len(aim.reversals.price) > 0:
            count, dropped = _fill_ways(
                layers, aim, states, a, b, p, j, step, dq, h[j], bound, count, scratch, out
            )
            lowest = min(lowest, dropped)
            if count < 0:
                return count, lowest
            continue
        s, cost, dropped = _predecessor(
            layers, aim, states, a, b, p, step, dq, h[j], bound, scratch.change, scratch.torque
        )
        lowest = min(lowest, dropped)
        if s >= 0:
            out.vertex[count], out.parent[count], out.d[count], out.way[count] = j, s, cost, 0
            for x in range(len(dq)):
                out.dq[count, x] = dq[x]
            count += 1
    return count, lowest


@jit_inline
def _fill_states(
    layers: SortedLayers, aim: Aim, h: Array, bound: float, seam: Array, k: int, states: States,
    i: int, count: int, scratch: Scratch, out: States,
) -> tuple[int, int, float]:  # fmt: skip
    """Append the states that leave vertices i, i + 1, ... of layer k while there is room.

    Returns the vertex to go on with, the number of states so far and the least cost dropped.
    """
    lowest = np.inf
    while i < len(states.first) - 1 and count + len(scratch.vertex) <= len(out.vertex):
        made, dropped = _fill_from(layers, aim, h, bound, seam, k, states, i, count, scratch, out)
        lowest = min(lowest, dropped)
        if made < 0:
            break
        count, i = made, i + 1
    return i, count, lowest


@jit_part
def _extend(
    layers: SortedLayers, aim: Aim, h: Array, bound: float, seam: Array, k: int, states: States,
    width: int,
) -> tuple[States, float]:  # fmt: skip
    """States of layer k + 1 from those of layer k, sorted; and the least cost dropped."""
    n, lowest = len(layers.endless), np.inf
    begin, end, first = layers.start[k + 1], layers.start[k + 2], states.first
    scratch = Scratch(
        np.empty(end - begin, np.int64), np.empty(n), np.empty(n), np.empty(n), np.empty(n),
        np.empty(n), torque_room(len(aim.torque.bound)),
    )  # fmt: skip
    room = 2 * (end - begin)
    vertex, parent = np.empty(room, np.int64), np.empty(room, np.int64)
    way = np.empty(room, np.int64)
    out = States(vertex, np.empty(room), np.empty((room, n)), parent, way, first)
    i = count = int(first[0])  # 0; a literal 0 would have a different numba type
    while True:
        i, count, dropped = _fill_states(
            layers, aim, h, bound, seam, k, states, i, count, scratch, out
        )
        lowest = min(lowest, dropped)
        if i == len(first) - 1:
            break
        out = States(
            with_more_room(out.vertex),
            with_more_room(out.d),
            with_more_room(out.dq),
            with_more_room(out.parent),
            with_more_room(out.way),
            first,
        )
    unsorted = States(
        out.vertex[:count], out.d[:count], out.dq[:count], out.parent[:count], out.way[:count],
        first,
    )  # fmt: skip
    return group_by_vertex(unsorted, begin, end, width), lowest


@jit_part
def _next(
    layers: SortedLayers, aim: Aim, h: Array, bound: float, seam: Array, k: int, states: States,
    least: Array, width: int,
) -> tuple[States, float]:  # fmt: skip
    """States of layer k + 1, with leaps and new beginnings; and the least cost dropped.

    least (K,) is the least cost of a state of each layer so far.
    """
    a, b = layers.start[k + 1], layers.start[k + 2]
    on, lowest = _extend(layers, aim, h, bound, seam, k, states, width)
    if aim.lost.leap < np.inf:
        on, dropped = _add_leaps(layers, aim, h, bound, k + 1, states, on, width)
        lowest = min(lowest, dropped)
    if layers.after[k + 1] < 0:
        return on, lowest
    anew, dropped = _begin(layers, aim, h, bound, k + 1, least[layers.after[k + 1]])
    return group_by_vertex(joined_states(on, anew), a, b, width), min(lowest, dropped)


@jit
def recursion(
    layers: SortedLayers, aim: Aim, h: Array, bound: float, seam: Array, room: int, width: int
) -> RecursionResult:
    """Best path whose cost is within `bound`, exactly, under (5), (6) and `aim.torque`.

    h (N,) is `cost_to_go`; seam (n,) is the increment that must be able to follow the last one by
    (6), or it is (0,). The states of all layers are recorded for `trace` as long as there are at
    most `room` of them. The `width` cheapest states of each vertex are kept; with a `width` below
    `EVERY` the path found need not be the best.
    """
    K = len(layers.start) - 1
    offset, best, least = np.zeros(K + 1, np.int64), np.full(K, -1), np.full(K, np.inf)
    vertex, parent = np.empty(1024, np.int32), np.empty(1024, np.int32)
    states, lowest = _begin(layers, aim, h, bound, 0, -np.inf if aim.minimax else 0.0)
    before, recorded = states, True
    for k in range(K):
        size = len(states.vertex)
        if size == 0 and (layers.after[k:] < 0).all():
            return RecursionResult(
                k, np.inf, lowest, best, offset, vertex, parent, before, recorded
            )
        offset[k + 1] = offset[k] + size
        recorded = recorded and offset[k + 1] <= room
        if recorded:
            while offset[k + 1] > len(vertex):
                vertex, parent = with_more_room(vertex), with_more_room(parent)
            vertex[offset[k] : offset[k + 1]] = states.vertex
            parent[offset[k] : offset[k + 1]] = states.parent
        if size > 0:
            best[k] = np.argmin(states.d)
            least[k] = states.d[best[k]]
        if k < K - 1:
            before = states
            states, dropped = _next(layers, aim, h, bound, seam, k, states, least, width)
            lowest = min(lowest, dropped)
    return RecursionResult(K, least[K - 1], lowest, best, offset, vertex, parent, states, recorded)


@jit
def trace(layers: SortedLayers, found: RecursionResult, out_path: Ints) -> None:
    """Read the best path (K,) back from a record, as vertices of the sorted graph.

    Layers that the path skips, between breaking off and beginning again, get -1; so do the layers
    before a leap, where the path is not known.
    """
    out_path[:] = -1
    k = len(out_path) - 1
    s = found.best[k]
    while k >= 0:
        i = found.offset[k] + s
        out_path[k], s = found.vertex[i], found.parent[i]
        if s == LEAPT:
            break
        if s >= 0:
            k -= 1
        else:
            k = layers.after[k]
            s = found.best[k]


@jit
def count_closing(layers: SortedLayers, aim: Aim, states: States, k: int) -> tuple[Ints, int]:
    """Count the limits that forbid ways from the states of layer k-1 into layer k, by joint i.

    Row 0 counts edges whose first velocity excess (5) is at joint i. Row 1 counts, for the other
    edges that are not shut, the pairs of state and edge whose first acceleration excess (6) is at
    joint i; row 2, among the other pairs, those whose first torque excess is. Also returns the
    number of shut edges.
    """
    n, shut = len(layers.endless), 0
    counts, dq, room = np.zeros((3, n), np.int64), np.empty(n), torque_room(len(aim.torque.bound))
    change = np.empty(n)
    for i in range(len(states.first) - 1):
        a, b, p = states.first[i], states.first[i + 1], layers.start[k - 1] + i
        if a == b:
            continue
        fill_change_at(layers, aim, p, change)
        first, last = shut_edges(layers, p)
        for j in range(layers.start[k], layers.start[k + 1]):
            fill_increment(layers, p, j, dq)
            excess = velocity_excess(dq, aim.velocity)
            if excess >= 0:
                counts[0, excess] += 1
                continue
            if is_shut(layers.shut, first, last, j):
                shut += 1
                continue
            for s in range(a, b):
                if states.parent[s] >= 0:
                    excess = acceleration_excess(dq, states.dq[s], change)
                    if excess >= 0:
                        counts[1, excess] += 1
                        continue
                    excess = torque_excess(aim.torque, layers.given, p, states.dq[s], dq, room)
                    if excess >= 0:
                        counts[2, excess] += 1
    return counts, shut
