"""The path to slow down if no path keeps the commanded node interval everywhere."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from kerfpath.arrays import Array, Bools, Ints, floats, freeze, scalar, short_repr
from kerfpath.effort import current_effort
from kerfpath.errors import InputError, NoFeasiblePath
from kerfpath.kernels import exact, to_go
from kerfpath.kernels.metric import CHEBYCHEV, increments, increments_between
from kerfpath.kernels.search import Aim, LostTime, SortedLayers
from kerfpath.kernels.states import EVERY
from kerfpath.search.exact import (
    FIRST_GAP,
    NO_SEAM,
    ROUNDING,
    UNLIMITED,
    BestPath,
    best_allowed,
    best_path,
    dead_end,
    layers_reached,
    lifted,
    quickest_path,
)
from kerfpath.search.long_enough import PieceLengths, PieceSpans, all_reaches, cheapest, fewest
from kerfpath.search.problem import (
    Layers,
    SearchProblem,
    broken_edge,
    empty_layer,
    refuse_ends,
    refuse_torque,
    require_joined,
    reverse,
    sort_layers,
)

# -----------------------------------------------------------------------------
# Least node interval: the fastest constant speed as a second-order minimax problem.

_LAYERS_SAMPLED = 8
"""Layers whose nearest pairs give the first guess of the interval, which affects only the time."""
_VERTICES_SAMPLED = 64
"""Vertices sampled of a layer."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LeastInterval:
    """Least time from node to node in which a path exists, and the limit that binds there.

    Parameters
    ----------
    dt : float s
    index : (K,) int
        A path that keeps it: vertex of each layer, 0-based inside its layer.
    joint : int
        The joint that binds, 0-based.
    node : int
        The node at which the binding increment ends, or at which the acceleration acts.
    limit : {"velocity", "acceleration"}
        The limit of the joint that binds.
    """

    dt: float
    index: Ints
    joint: int
    node: int
    limit: Literal["velocity", "acceleration"]

    __repr__ = short_repr


def find_least_interval(problem: SearchProblem) -> LeastInterval:
    """Return the exact least node interval in which a path through the layers keeps (5) and (6).

    Over all paths it minimises the largest of |dq_i| / (eta_v q'max_i) over edges and of
    sqrt(|ddq_i| / (eta_a q''max_i)) over pairs of edges.

    Parameters
    ----------
    problem : SearchProblem
        K >= 2; vertices cost 0, or infinity if closed. Its dt, weights, metric and objective do not
        matter.

    Raises
    ------
    NoFeasiblePath
        A layer is empty, or closed vertices and shut edges leave no path; the message says where.
    InputError
        A single layer, other vertex costs, a closure, or a limit on rotation, torque or jerk.
    """
    refuse_ends(problem, "least node interval")
    refuse_torque(problem, "least node interval")
    if len(problem.start) < 3:
        raise InputError("start: a node interval needs at least two layers, got 1")
    if not np.isin(problem.vertex_cost, (0.0, np.inf)).all():
        raise InputError(
            "vertex_cost: for the least node interval a vertex is open (0) or closed (infinity), "
            "got another cost"
        )
    layers = problem.layers
    require_joined(layers)
    v, a = problem.limits.velocity.usable, problem.limits.acceleration.usable
    aim, ceiling = aim_at_least_time(1 / v, a), first_guess(layers, v)
    while True:
        # Edges that take longer than the ceiling are left out, which is exact if a path keeps it.
        found = quickest(layers, aim, ceiling * v, ceiling)
        if found is not None:
            return binding(layers, found[0], v, a)
        ceiling *= 2


def aim_at_least_time(weight: Array, acceleration: Array) -> Aim:
    """Return the aim to minimise the time, s, that the slowest step or change of a path needs.

    A step needs its Chebychev distance under `weight` (n,) s/rad, a change of increments the time
    in which `acceleration` (n,) rad/s^2 allows it. The node interval of the aim is one second.
    """
    return Aim(
        weight=freeze(weight),
        metric=CHEBYCHEV,
        minimax=True,
        velocity=np.full(len(weight), np.inf),
        acceleration=acceleration,
        timed=True,
    )


def quickest(layers: Layers, aim: Aim, bound: Array, ceiling: float) -> tuple[Ints, float] | None:
    """Return the path of least time whose steps keep `bound` (n,) rad, and its time.

    None if it needs more than `ceiling` s, or if no path keeps the bound.
    """
    graph = sort_layers(layers, bound)
    best = quickest_path(graph, aim._replace(velocity=freeze(bound), cap=ceiling), ceiling)
    return None if best is None else (graph.rank[best.path], best.cost)


def times_asked(path: Array, endless: Bools, velocity: Array, acceleration: Array) -> list[Array]:
    """Return the node intervals in which (5) and (6) would hold on a path (K, n) rad.

    They are those of its steps, (K-1, n), and of the changes of its steps, (K-2, n). They are in s
    with limits (n,) in rad/s and rad/s^2, and in node intervals with limits in rad.
    """
    dq = increments(path, endless)
    return [np.abs(dq) / velocity, np.sqrt(np.abs(np.diff(dq, axis=0)) / acceleration)]


def first_guess(layers: Layers, v: Array) -> float:
    """Return a first node interval: twice the one that the nearest vertices of some layers need."""
    least = 0.0
    for steps in sampled_steps(layers, _LAYERS_SAMPLED):
        least = max(least, min(float((step / v).max(axis=1).min()) for step in steps))
    return 2 * least or 1e-6


def sampled_steps(layers: Layers, count: int) -> Iterator[Iterator[Array]]:
    """Yield, for `count` layers, the steps (m, n) rad from all vertices to some of the next."""
    q, start = layers.q, layers.start
    for k in np.unique(np.linspace(0, len(start) - 3, count).astype(int)):
        here, there = (q[start[i] : start[i + 1]] for i in (k, k + 1))
        some = there[:: max(1, len(there) // _VERTICES_SAMPLED)]
        yield (np.abs(increments_between(vertex, here, layers.endless)) for vertex in some)


def binding(layers: Layers, index: Ints, v: Array, a: Array) -> LeastInterval:
    """Return the least interval of a path, and the limit that requires it."""
    path = layers.q[layers.start[:-1] + index]
    fast, sharp = times_asked(path, layers.endless, v, a)
    limit: Literal["velocity", "acceleration"]
    limit = "acceleration" if sharp.max(initial=0.0) > fast.max() else "velocity"
    time = sharp if limit == "acceleration" else fast
    k, joint = np.unravel_index(np.argmax(time), time.shape)
    return LeastInterval(
        dt=float(time.max()), index=freeze(index), joint=int(joint), node=int(k) + 1, limit=limit
    )


# -----------------------------------------------------------------------------
# Paths in pieces, if no path keeps the limits all along: fewest interruptions, least cost.
#
# A piece of an admissible path is itself admissible. So a plan that goes as far as any path can
# before each interruption (the greedy reach) is never behind another one with as many, and its
# number of interruptions is the least. The reach from the front gives the last node, and the
# reach from the back the first node, at which interruption i can be; these spans of nodes do not
# overlap. If pieces must have a least length, `_long_enough` finds the spans.


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
            f"no division into pieces of {least_piece:g} m or more keeps the limits; with shorter "
            f"pieces the least number of interruptions is {len(last) - 1}",
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


# -----------------------------------------------------------------------------
# The path to slow down if no path keeps the commanded node interval everywhere.

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
        A layer is empty, or closed vertices and shut edges leave no path; the message says where.
    InputError
        Another objective, a closure, a limit on rotation, torque or jerk, or a penalty that is not
        positive.
    """
    refuse_ends(problem, "slowed path")
    refuse_torque(problem, "slowed path")
    if problem.objective != "sum":
        raise InputError(f'objective: a slowed path needs "sum", got "{problem.objective}"')
    penalty = scalar(penalty, "penalty", above=0.0)
    layers, aim = problem.layers, problem.aim
    require_joined(layers)
    index, least = _least(layers, aim, penalty)
    path = layers.q[layers.start[:-1] + index]
    time, sharp = (
        asked.max(axis=1)
        for asked in times_asked(path, layers.endless, aim.velocity, aim.acceleration)
    )
    time[1:] = np.maximum(time[1:], sharp)
    lost = np.maximum(time - 1.0, 0.0)
    return SlowedPath(index=freeze(index), cost=least, lost=freeze(lost))


def _least(layers: Layers, aim: Aim, penalty: float) -> tuple[Ints, float]:
    """Return the best path, as vertices of each layer, and its cost.

    Steps beyond `stretch` times the velocity are left out. In their place a leap may lead from
    any vertex to any other, at the least price that such a step can have. A best path without a
    leap is the best of all; else more steps are let in.
    """
    reach = np.where(layers.endless, np.pi, np.ptp(layers.q, axis=0))
    every = float((reach / aim.velocity).max())
    stretch = FIRST_STRETCH
    while True:
        bound = stretch * aim.velocity
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
    to_go.cost_to_go(layers, aim, np.ones(len(h), np.bool_), h)
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
