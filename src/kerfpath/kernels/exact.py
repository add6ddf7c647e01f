"""Recursion (16) made exact under the acceleration limit (6).

The procedure of section 3.2 tests the acceleration against the best predecessor alone and can lose
the optimum. Here the state is an edge (p, j): (5) is then a test on a state and (6) one on two
neighbouring states, and the recursion

    d(p, j) = rho(p, j) + min over l of d(l, p), with (6) for l, p, j

is exact. The first-order problem solved backwards is a bound h(j) on what is still to come: with a
bound on the cost, only states with d + h inside it are ever kept.
"""

from __future__ import annotations

from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from kerfpath._arrays import Array, Ints
from kerfpath.kernels._jit import jit, jit_inline
from kerfpath.kernels.limits import (
    acceleration_excess,
    acceleration_time,
    velocity_excess,
)
from kerfpath.kernels.reach import Scratch, States, fill_candidates
from kerfpath.kernels.search import (
    Layers,
    Objective,
    distance,
    fill_increment,
    joined,
)

__all__ = ["EVERY", "Reached", "States", "count_closing", "recursion", "trace"]

EVERY = 2**62
"""States of a vertex that are kept: all."""
LONG = 32
"""Edges into one vertex from which on sorting them one by one takes longer than by halves."""

_T = TypeVar("_T", bound="np.generic[Any]")


class Reached(NamedTuple):
    """What a recursion under a bound came to."""

    layers: int
    """Number of layers that some state reached."""
    cost: float
    """Cost of the best path, infinite if none kept the bound."""
    lowest: float
    """Least cost bound among what was dropped for its cost; infinite if nothing was."""
    state: int
    """The best state of the last layer, -1 if none."""
    offset: Ints
    """(K+1,): states of layer k in the record are offset[k]:offset[k+1]."""
    vertex: NDArray[np.int32]
    """The record: vertex of every state kept,"""
    parent: NDArray[np.int32]
    """and its parent within the layer before."""
    last: States
    """The states of the last layer that some state reached."""
    recorded: bool
    """The record is whole."""


@jit
def _grown(old: NDArray[_T]) -> NDArray[_T]:
    new = np.empty((2 * len(old), *old.shape[1:]), old.dtype)
    new[: len(old)] = old
    return new


@jit
def _begin(layers: Layers, aim: Objective, h: Array, bound: float) -> tuple[States, float]:
    """States of layer 0, one per vertex, with no edge before them; and the least cost dropped."""
    m, lowest, count = layers.start[1], np.inf, 0
    vertex, first = np.empty(m, np.int64), np.zeros(m + 1, np.int64)
    for j in range(m):
        f = joined(aim.minimax, aim.vertex_cost[j], h[j])
        if f <= bound:
            vertex[count] = j
            count += 1
        else:
            lowest = min(lowest, f)
        first[j + 1] = count
    vertex = vertex[:count]
    none = np.empty((count, len(layers.endless)))
    return States(vertex, aim.vertex_cost[vertex], none, np.full(count, -1), first), lowest


@jit_inline
def _cheapest(
    states: States,
    a: int,
    b: int,
    aim: Objective,
    step: float,
    dq: Array,
    rest: float,
    bound: float,
) -> tuple[int, float]:
    """First of the states a..b, cheapest first, that (6) lets go on by dq; -1 if none in the bound.

    Also returns the cost bound of the state at which the search was given up, or infinity.
    """
    for s in range(a, b):
        f = joined(aim.minimax, joined(aim.minimax, states.d[s], step), rest)
        if f > bound:
            return -1, f
        if states.parent[s] < 0 or acceleration_excess(dq, states.dq[s], aim.acceleration) < 0:
            return s, np.inf
    return -1, np.inf


@jit_inline
def _quickest(
    states: States, a: int, b: int, aim: Objective, dq: Array, least: float, bound: float
) -> tuple[int, float, float]:
    """Find which of the states a..b, cheapest first, goes on by dq in the least node interval.

    `least` is the interval that the step and what is to come ask for. Returns the state, -1 if none
    keeps the bound; the interval up to and with the step; and the least one over the bound.
    """
    best, best_d, over = -1, np.inf, np.inf
    for s in range(a, b):
        if states.d[s] >= best_d:
            break
        d = states.d[s]
        if states.parent[s] >= 0:
            d = max(d, acceleration_time(dq, states.dq[s], aim.acceleration))
        if max(d, least) > bound:
            over = min(over, max(d, least))
        elif d < best_d:
            best, best_d = s, d
    return best, best_d, over


@jit_inline
def _fill_from(
    layers: Layers, aim: Objective, h: Array, bound: float, seam: Array, k: int, states: States,
    i: int, count: int, scratch: Scratch, out: States,
) -> tuple[int, float]:  # fmt: skip
    """Append the states that leave vertex i of layer k; their number so far, least cost dropped."""
    a, b, p, lowest = states.first[i], states.first[i + 1], layers.start[k] + i, np.inf
    if a == b:
        return count, lowest
    closes = len(seam) > 0 and k == len(layers.start) - 3
    some, dq = fill_candidates(layers, aim, states, a, b, k, p, scratch), scratch.dq
    for v in range(some):
        j = scratch.vertex[v]
        if h[j] == np.inf:
            continue
        step = joined(aim.minimax, distance(layers, aim, p, j), aim.vertex_cost[j])
        if step == np.inf:
            continue
        fill_increment(layers, p, j, dq)
        if closes and acceleration_excess(seam, dq, aim.acceleration) >= 0:
            continue
        if aim.timed:
            least = max(step, h[j])
            s, cost, dropped = _quickest(states, a, b, aim, dq, least, bound)
            cost = max(cost, step)
        else:
            s, dropped = _cheapest(states, a, b, aim, step, dq, h[j], bound)
            cost = joined(aim.minimax, states.d[s], step) if s >= 0 else np.inf
        lowest = min(lowest, dropped)
        if s >= 0:
            out.vertex[count], out.parent[count], out.d[count] = j, s, cost
            for x in range(len(dq)):
                out.dq[count, x] = dq[x]
            count += 1
    return count, lowest


@jit_inline
def _fill_states(
    layers: Layers, aim: Objective, h: Array, bound: float, seam: Array, k: int, states: States,
    i: int, count: int, scratch: Scratch, out: States,
) -> tuple[int, int, float]:  # fmt: skip
    """Append what leaves vertex i of layer k and those after it, while there is room for one more.

    Returns the vertex to go on with, the number of states so far and the least cost dropped.
    """
    lowest = np.inf
    while i < len(states.first) - 1 and count + len(scratch.vertex) <= len(out.vertex):
        count, dropped = _fill_from(layers, aim, h, bound, seam, k, states, i, count, scratch, out)
        lowest, i = min(lowest, dropped), i + 1
    return i, count, lowest


@jit
def _extend(
    layers: Layers, aim: Objective, h: Array, bound: float, seam: Array, k: int, states: States,
    width: int,
) -> tuple[States, float]:  # fmt: skip
    """States of layer k + 1 from those of layer k, sorted; and the least cost dropped."""
    n, lowest = len(layers.endless), np.inf
    begin, end, first = layers.start[k + 1], layers.start[k + 2], states.first
    scratch = Scratch(np.empty(end - begin, np.int64), np.empty(n), np.empty(n), np.empty(n))
    room = 2 * (end - begin)
    vertex, parent = np.empty(room, np.int64), np.empty(room, np.int64)
    out = States(vertex, np.empty(room), np.empty((room, n)), parent, first)
    i = count = int(first[0])  # 0; a plain 0 would be a type of its own
    while i < len(first) - 1:
        if count + end - begin > room:
            room *= 2
            out = States(
                _grown(out.vertex), _grown(out.d), _grown(out.dq), _grown(out.parent), first
            )
        i, count, dropped = _fill_states(
            layers, aim, h, bound, seam, k, states, i, count, scratch, out
        )
        lowest = min(lowest, dropped)
    unsorted = States(out.vertex[:count], out.d[:count], out.dq[:count], out.parent[:count], first)
    return _sorted(unsorted, begin, end, width), lowest


@jit
def _sorted(states: States, a: int, b: int, width: int) -> States:
    """Group states by their vertex a..b-1, cheapest first; ties keep the order of their making.

    Of each vertex only the `width` cheapest are kept.
    """
    vertex, d = states.vertex, states.d
    first = np.zeros(b - a + 1, np.int64)
    for j in vertex:
        first[j - a + 1] += 1
    first = np.cumsum(first)
    place, order = first.copy(), np.empty(len(vertex), np.int64)
    for s, j in enumerate(vertex):
        order[place[j - a]] = s
        place[j - a] += 1
    for i in range(b - a):
        begin, end = first[i], first[i + 1]
        if end - begin > LONG:
            group = order[begin:end]
            group[:] = group[np.argsort(d[group], kind="mergesort")]
            continue
        for v in range(begin + 1, end):
            s = order[v]
            while v > begin and d[order[v - 1]] > d[s]:
                order[v] = order[v - 1]
                v -= 1
            order[v] = s
    count = 0
    for i in range(b - a):
        begin, end = first[i], first[i + 1]
        first[i] = count
        for v in range(begin, min(end, begin + width)):
            order[count] = order[v]
            count += 1
    first[b - a] = count
    order = order[:count]
    return States(vertex[order], d[order], states.dq[order], states.parent[order], first)


@jit
def recursion(
    layers: Layers, aim: Objective, h: Array, bound: float, seam: Array, room: int,
    width: int = EVERY,
) -> Reached:  # fmt: skip
    """Best path whose cost keeps `bound`, exactly, under (5) and (6).

    h (N,) is `cost_to_go`; seam (n,) is the increment that the last one must go on to by (6), or
    (0,). The states of all layers are recorded for `trace` as long as they are no more than `room`.
    With a `width`, only so many states of each vertex are kept: then the path found need not be the
    best.
    """
    K = len(layers.start) - 1
    offset = np.zeros(K + 1, np.int64)
    vertex, parent = np.empty(1024, np.int32), np.empty(1024, np.int32)
    states, lowest = _begin(layers, aim, h, bound)
    before, recorded = states, True
    for k in range(K):
        size = len(states.vertex)
        if size == 0:
            return Reached(k, np.inf, lowest, -1, offset, vertex, parent, before, recorded)
        offset[k + 1] = offset[k] + size
        recorded = recorded and offset[k + 1] <= room
        if recorded:
            while offset[k + 1] > len(vertex):
                vertex, parent = _grown(vertex), _grown(parent)
            vertex[offset[k] : offset[k + 1]] = states.vertex
            parent[offset[k] : offset[k + 1]] = states.parent
        if k < K - 1:
            before = states
            states, dropped = _extend(layers, aim, h, bound, seam, k, states, width)
            lowest = min(lowest, dropped)
    best = int(np.argmin(states.d))
    return Reached(K, states.d[best], lowest, best, offset, vertex, parent, states, recorded)


@jit
def trace(found: Reached, out_path: Ints) -> None:
    """Read the best path (K,) back from a record, as vertices of the sorted graph."""
    s = found.state
    for k in range(len(out_path) - 1, -1, -1):
        i = found.offset[k] + s
        out_path[k], s = found.vertex[i], found.parent[i]


@jit
def count_closing(layers: Layers, aim: Objective, states: States, k: int) -> Ints:
    """Count, for ways from the states of layer k-1 into layer k, what forbids them.

    Row 0: edges whose first velocity excess (5) is at joint i; row 1: of the others, the pairs of
    state and edge whose first acceleration excess (6) is at joint i.
    """
    n = len(layers.endless)
    counts, dq = np.zeros((2, n), np.int64), np.empty(n)
    for i in range(len(states.first) - 1):
        a, b, p = states.first[i], states.first[i + 1], layers.start[k - 1] + i
        if a == b:
            continue
        for j in range(layers.start[k], layers.start[k + 1]):
            fill_increment(layers, p, j, dq)
            excess = velocity_excess(dq, aim.velocity)
            if excess >= 0:
                counts[0, excess] += 1
                continue
            for s in range(a, b):
                if states.parent[s] >= 0:
                    excess = acceleration_excess(dq, states.dq[s], aim.acceleration)
                    if excess >= 0:
                        counts[1, excess] += 1
    return counts
