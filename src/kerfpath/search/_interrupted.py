"""Where no path keeps the limits all along: the fewest interruptions, and the cheapest such plan.

A piece of an admissible path is itself admissible. So a plan that reaches as far as any path can
before each interruption (the greedy reach) never falls behind another one with as many, and its
number is the least. From the front the reach says which node interruption i lies before at the
latest, from the back which at the earliest, and these spans of nodes do not overlap. Where pieces
must have a least length, `_long_enough` finds the spans.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from kerfpath._arrays import Array, Bools, Ints, floats, freeze, scalar
from kerfpath._repr import short_repr
from kerfpath.errors import InputError, NoFeasiblePath
from kerfpath.kernels.search import Aim, SortedLayers
from kerfpath.search._exact import (
    NO_SEAM,
    BestPath,
    best_allowed,
    best_path,
    dead_end,
    layers_reached,
)
from kerfpath.search._layers import Layers, broken_edge, empty_layer, reverse, sort_layers
from kerfpath.search._long_enough import PieceLengths, PieceSpans, all_reaches, cheapest, fewest
from kerfpath.search._problem import SearchProblem, refuse_ends

__all__ = ["InterruptedPath", "Piece", "find_interrupted"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Piece:
    """What is cut without interruption: one vertex for each of several successive layers.

    Parameters
    ----------
    first : int
        Node it begins at.
    index : (m,) int
        Vertex of layers first to first + m - 1, 0-based inside its layer; m >= 2 unless K = 1.
    """

    first: int
    index: Ints

    __repr__ = short_repr


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class InterruptedPath:
    """A path in pieces: each begins at the node where the one before ends, at any vertex of it.

    Parameters
    ----------
    pieces : tuple of Piece
    cost : float
        Objective (14) or (15) over all pieces, vertex costs included; a node that is in two pieces
        is visited in both.
    optimal : bool
        True: proved to have the fewest interruptions, and of all such plans the least cost.
    """

    pieces: tuple[Piece, ...]
    cost: float
    optimal: bool

    __repr__ = short_repr

    @property
    def interruptions(self) -> int:
        """Number of times that the cut is interrupted."""
        return len(self.pieces) - 1


def find_interrupted(
    problem: SearchProblem, *, s: ArrayLike | None = None, least_piece: float | None = None
) -> InterruptedPath:
    """Return the cheapest of the plans with the fewest interruptions, exactly.

    At an interruption the laser goes off at a node, the robot moves to any vertex of the same node
    (or stops where it is), and the cut goes on from there as a path begins: (6) is not tested
    across. Every edge between neighbouring nodes is cut. The moves between cost nothing; the node
    is visited before and after, and its vertex costs count for both. Of several plans with the same
    maximum, the one with the least sum.

    Parameters
    ----------
    problem : SearchProblem
    s : (K,) m, optional
        How far along the cut each node is, increasing; what `least_piece` is measured on.
    least_piece : float m, optional
        Where the cut is interrupted every piece is at least as long. The number of interruptions is
        the least with which that can be, and of all such plans the cost is the least.

    Raises
    ------
    NoFeasiblePath
        No number of interruptions helps: a layer is empty, or no edge between two neighbouring
        layers is open and keeps (5). `node` is the last one before. Or no division has only pieces
        of the least length; `node` is then where the first one breaks at the latest.
    InputError
        A closure or a rotation limit; nodes that do not fit the layers.
    """
    refuse_ends(problem, "interrupted path")
    if least_piece is not None:
        least_piece = scalar(least_piece, "least_piece", unit="m", above=0.0)
        s = _increasing(s, len(problem.start) - 1)
    given, aim = problem.layers, problem.aim
    layers = sort_layers(given, aim.velocity)
    last = _reach(given, layers, aim)
    if least_piece is not None and len(last) > 1:
        return _long_enough(layers, aim, last, np.asarray(s), least_piece)
    first = np.zeros(1, np.int64) if len(last) == 1 else _first(given, aim)
    layers, nodes = _in_stages(layers, first, last)
    found = best_path(layers, aim)
    assert isinstance(found, BestPath), "a plan with this number of interruptions has been found"
    return InterruptedPath(pieces=_pieces(layers, nodes, found.path), cost=found.cost, optimal=True)


def _increasing(s: ArrayLike | None, K: int) -> Array:
    if s is None:
        raise InputError("s: expected where each node is, which least_piece needs, got nothing")
    s = floats(s, "s", (K,))
    if not (np.diff(s) > 0).all():
        raise InputError(
            "s: expected nodes farther and farther along the cut, got some that are not"
        )
    return s


def _long_enough(
    layers: SortedLayers, aim: Aim, last: Ints, s: Array, least_piece: float
) -> InterruptedPath:
    """Return the cheapest plan of the fewest pieces that are all long enough.

    `last` is how far the greedy reach comes with each interruption.
    """
    K, apart = len(s), PieceLengths.of(s, least_piece)

    def reach(k: int) -> int:
        return k + layers_reached(layers._replace(start=layers.start[k:]), aim) - 1

    reached = all_reaches(reach, K)
    spans = fewest(reached, apart)
    if spans is None:
        raise NoFeasiblePath(
            f"no division into pieces of {least_piece:g} m or more keeps the limits; "
            f"{len(last) - 1} interruptions do where pieces may be shorter",
            proved=True,
            node=int(last[0]),
        )

    def solve(spans: PieceSpans) -> tuple[tuple[float, float], Ints, InterruptedPath] | None:
        staged, nodes = _in_stages(layers, spans.low[:-1], spans.high[1:])
        every = np.ones(len(staged.low), np.bool_)
        best = best_allowed(staged, aim, every, NO_SEAM)
        if best is None:
            return None
        pieces = _pieces(staged, nodes, best.path)
        begun = np.array([*(piece.first for piece in pieces), K - 1])
        cut = InterruptedPath(pieces=pieces, cost=best.cost, optimal=True)
        return (best.cost, best.total), begun, cut

    return cheapest(spans, reached, apart, solve)


def _reach(given: Layers, layers: SortedLayers, aim: Aim) -> Ints:
    """Return the farthest node that can be cut with 0, 1, 2... interruptions, up to the last one.

    Raises
    ------
    NoFeasiblePath
        From some node on nothing can be cut.
    """
    K, k = len(layers.start) - 1, 0
    if layers.start[1] == 0:
        raise empty_layer(given, 0)
    reached: list[int] = []
    while not reached or k < K - 1:
        rest = layers._replace(start=layers.start[k:])
        edges = layers_reached(rest, aim) - 1
        if edges == 0 and K > 1:
            if layers.start[k + 1] == layers.start[k + 2]:
                raise empty_layer(given, k + 1)
            dead = dead_end(rest, aim)
            raise broken_edge(k + 1, dead.counts, dead.shut, proved=True)
        k += edges
        reached.append(k)
    return np.array(reached)


def _first(given: Layers, aim: Aim) -> Ints:
    """Return the first node from which the end is cut with as few interruptions as are left.

    (5) and (6) hold for a path and its reverse alike: it is the reach from the last layer back.
    """
    given = reverse(given)
    layers = sort_layers(given, aim.velocity)
    return (len(layers.start) - 2 - _reach(given, layers, aim))[::-1]


def _in_stages(layers: SortedLayers, first: Ints, last: Ints) -> tuple[SortedLayers, Ints]:
    """Lay out, one after the other, the layers first[i]..last[i] that piece i can go through.

    Where the layers of two pieces are the same nodes, a path may break off in the one and begin
    anew in the other. Returns the graph, and the node of each of its layers.
    """
    nodes = np.concatenate([np.arange(a, b + 1) for a, b in zip(first, last, strict=True)])
    begin = np.concatenate([[0], np.cumsum(last + 1 - first)])
    sizes = np.diff(layers.start)[nodes]
    start = np.concatenate([[0], np.cumsum(sizes)])
    shift = layers.start[nodes] - start[:-1]
    onwards = np.repeat(np.append(shift[1:], 0), sizes)
    order = np.arange(start[-1]) + np.repeat(shift, sizes)
    low, high = layers.low[order] - onwards, layers.high[order] - onwards
    after = np.full(len(nodes), -1)
    for i in range(1, len(first)):
        a, b = first[i], last[i - 1]
        after[begin[i] : begin[i] + b + 1 - a] = np.arange(begin[i] - 1 - (b - a), begin[i])
        # No edge leads from the last layer of a piece to the first of the next.
        seam = slice(start[begin[i] - 1], start[begin[i]])
        low[seam] = high[seam] = 0
    q = np.ascontiguousarray(layers.q[:, order])
    given = q if layers.given is layers.q else np.ascontiguousarray(layers.given[:, order])
    shut_from, shut = _shut_in_stages(layers, order, onwards, low != high)
    staged = layers._replace(
        q=q,
        given=given,
        start=freeze(start),
        cost=freeze(layers.cost[order]),
        rank=layers.rank[order],
        low=low,
        high=high,
        after=after,
        shut_from=shut_from,
        shut=shut,
    )
    return staged, nodes


def _shut_in_stages(
    layers: SortedLayers, order: Ints, onwards: Ints, leading: Bools
) -> tuple[Ints, Ints]:
    """Return the shut edges of the vertices `order` (N,), which lead `onwards` vertices before.

    Only vertices that are `leading` (N,) have any.
    """
    if not len(layers.shut):
        return layers.shut_from, layers.shut
    begin = layers.shut_from[order]
    count = np.where(leading, layers.shut_from[order + 1] - begin, 0)
    shut_from = np.concatenate([[0], np.cumsum(count)])
    place = np.arange(shut_from[-1]) + np.repeat(begin - shut_from[:-1], count)
    return shut_from, layers.shut[place] - np.repeat(onwards, count)


def _pieces(layers: SortedLayers, nodes: Ints, path: Ints) -> tuple[Piece, ...]:
    """Part a path through the stages, -1 where it skips a layer, into its pieces."""
    visited = np.flatnonzero(path >= 0)
    again = nodes[visited[1:]] == nodes[visited[:-1]]
    return tuple(
        Piece(first=int(nodes[part[0]]), index=freeze(layers.rank[path[part]]))
        for part in np.split(visited, np.flatnonzero(again) + 1)
    )
