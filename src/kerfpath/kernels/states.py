"""The states of the exact recursion in one layer, and how they are stored and sorted."""

from __future__ import annotations

from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from kerfpath.arrays import Array, Ints
from kerfpath.kernels.jit import jit_part
from kerfpath.kernels.torque import TorqueRoom

__all__ = ["EVERY", "Scratch", "States", "group_by_vertex", "joined_states", "with_more_room"]

_T = TypeVar("_T", bound="np.generic[Any]")

EVERY = 2**62
"""A width that keeps all states of a vertex."""
LONG = 32
"""Number of edges into one vertex above which merge sort is faster than insertion sort."""


class States(NamedTuple):
    """The edges kept into one layer, grouped by the vertex they lead to, cheapest first."""

    vertex: Ints
    """(S,): the vertex j that the edge leads to."""
    d: Array
    """(S,): cost of the best path that ends with this edge, vertex j included."""
    dq: Array
    """(S, n): increment along the edge."""
    parent: Ints
    """(S,): index of the preceding edge among the states of the layer before."""
    way: Ints
    """(S,): directions of the joints whose reversals have a price, 0 if none has; see `_turned`."""
    first: Ints
    """(m+1,): the states of vertex start[k] + i are first[i]:first[i+1]."""


class Scratch(NamedTuple):
    """Scratch arrays, created once per layer."""

    vertex: Ints
    """(m,): vertices of the next layer."""
    dq: Array
    """(n,): an increment."""
    to: Array
    """(n,): middle of the box."""
    by: Array
    """(n,): half width of the box."""
    change: Array
    """(n,): largest change of the increment at a vertex."""
    seam: Array
    """(n,): the same at the vertex that closes a path."""
    torque: TorqueRoom


@jit_part
def with_more_room(old: NDArray[_T]) -> NDArray[_T]:
    """Return a copy with twice the room."""
    new = np.empty((2 * len(old), *old.shape[1:]), old.dtype)
    new[: len(old)] = old
    return new


@jit_part
def joined_states(one: States, two: States) -> States:
    """Return the states of both, not sorted."""
    return States(
        np.concatenate((one.vertex, two.vertex)),
        np.concatenate((one.d, two.d)),
        np.concatenate((one.dq, two.dq)),
        np.concatenate((one.parent, two.parent)),
        np.concatenate((one.way, two.way)),
        one.first,
    )


@jit_part
def group_by_vertex(states: States, a: int, b: int, width: int) -> States:
    """Group states by their vertex a..b-1, cheapest first; ties keep their order.

    Only the `width` cheapest of each vertex are kept.
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
    parent, way = states.parent[order], states.way[order]
    return States(vertex[order], d[order], states.dq[order], parent, way, first)
