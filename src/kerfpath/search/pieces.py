"""Paths in pieces, if no path keeps the limits all along: fewest interruptions, least cost.

A piece of an admissible path is itself admissible. So a plan that goes as far as any path can
before each interruption (the greedy reach) is never behind another one with as many, and its number
of interruptions is the least. The reach from the front gives the last node, and the reach from the
back the first node, at which interruption i can be; these spans of nodes do not overlap. If pieces
must have a least length, `piece_spans` finds the spans.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from kerfpath.arrays import Array, Bools, Ints, floats, freeze, scalar, short_repr
from kerfpath.errors import InputError, NoFeasiblePath
from kerfpath.kernels.search import Aim, SortedLayers
from kerfpath.search.exact import (
    NO_SEAM,
    BestPath,
    best_allowed,
    best_path,
    dead_end,
    layers_reached,
)
from kerfpath.search.piece_spans import PieceLengths, PieceSpans, all_reaches, cheapest, fewest
from kerfpath.search.problem import (
    Layers,
    SearchProblem,
    broken_edge,
    empty_layer,
    refuse_ends,
    reverse,
    sort_layers,
)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Piece:
    """Part of a path without interruption: one vertex for each of several successive layers.

    Parameters
    ----------
    first : int
        Node at which it begins.
    index : (m,) int
        Vertex of layers first to first + m - 1, 0-based inside its layer; m >= 2 unless K = 1.
    """

    first: int
    index: Ints

    __repr__ = short_repr


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class InterruptedPath:
    """A path in pieces: each begins, at any vertex, at the node where the one before ends.

    Parameters
    ----------
    pieces : tuple of Piece
    cost : float
        Objective (14) or (15) over all pieces, vertex costs included; a node in two pieces counts
        in both.
    optimal : bool
        True if it is proved to have the fewest interruptions, and the least cost with these.
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
    """Return the exact cheapest of the plans with the fewest interruptions.

    At an interruption the beam goes off at a node, the robot moves to any vertex of the same node
    (or stops where it is), and the cut goes on from there as a path begins: (6) does not hold
    across an interruption. Every edge between neighbouring nodes is cut. The moves in between cost
    nothing; the node is visited before and after, and its vertex costs count twice. Of several
    plans with the same maximum, the result has the least sum.

    Parameters
    ----------
    problem : SearchProblem
    s : (K,) m, optional
        Arc length of the nodes, increasing; needed for `least_piece`.
    least_piece : float m, optional
        Least length of every piece if the cut is interrupted. The number of interruptions is then
        the least possible with this length, and the cost the least of all such plans.

    Raises
    ------
    NoFeasiblePath
        No number of interruptions helps: a layer is empty, or no edge between two neighbouring
        layers is open and keeps (5); `node` is the last one before. Or no division has only pieces
        of the least length; `node` is then the last one that the first piece can reach.
    InputError
        A closure or a rotation limit, or `s` that does not fit the layers.
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
        raise InputError("s: expected the arc length of each node for least_piece, got nothing")
    s = floats(s, "s", (K,))
    if not (np.diff(s) > 0).all():
        raise InputError(
            "s: expected increasing arc lengths, got a node that is not farther than the one before"
        )
    return s


def _long_enough(
    layers: SortedLayers, aim: Aim, last: Ints, s: Array, least_piece: float
) -> InterruptedPath:
    """Return the cheapest plan of the fewest pieces that are all long enough.

    `last` has the last node of the greedy reach for each number of interruptions.
    """
    K, apart = len(s), PieceLengths.of(s, least_piece)

    def reach(k: int) -> int:
        return k + layers_reached(layers._replace(start=layers.start[k:]), aim) - 1

    reached = all_reaches(reach, K)
    spans = fewest(reached, apart)
    if spans is None:
        raise NoFeasiblePath(
            f"no division into pieces of {least_piece * 1e3:g} mm or more keeps the limits; with "
            f"shorter pieces the least number of interruptions is {len(last) - 1}",
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
    """Return the farthest node that can be cut with 0, 1, 2... interruptions, up to the last node.

    Raises
    ------
    NoFeasiblePath
        From some node no next node can be cut.
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
    """Return the first node at which each piece can begin with the fewest interruptions after it.

    (5) and (6) hold for a path and its reverse alike, so this is the reach from the last layer
    back.
    """
    given = reverse(given)
    layers = sort_layers(given, aim.velocity)
    return (len(layers.start) - 2 - _reach(given, layers, aim))[::-1]


def _in_stages(layers: SortedLayers, first: Ints, last: Ints) -> tuple[SortedLayers, Ints]:
    """Return a graph of the layers first[i]..last[i] of each piece i in turn, and their nodes.

    Where the layers of two pieces are the same nodes, a path may end in one piece and begin again
    in the next.
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
    """Return the shut edges of the vertices `order` (N,), their targets lowered by `onwards` (N,).

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
    """Split a path through the stages (-1 where it skips a layer) into its pieces."""
    visited = np.flatnonzero(path >= 0)
    again = nodes[visited[1:]] == nodes[visited[:-1]]
    return tuple(
        Piece(first=int(nodes[part[0]]), index=freeze(layers.rank[path[part]]))
        for part in np.split(visited, np.flatnonzero(again) + 1)
    )
