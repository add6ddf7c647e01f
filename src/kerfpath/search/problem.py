"""The search problem: a layered graph, limits and objective, cast and checked once.

The graph is given in the order of its nodes and sorted for the kernels; limits on the rotation of
endless joints from where a path begins (hoses and cables) are kept here, too.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import ArrayLike

from kerfpath.arrays import (
    Array,
    Bools,
    Ints,
    bools,
    floats,
    freeze,
    integers,
    require_one_of,
    scalar,
    short_repr,
)
from kerfpath.errors import InputError, NoFeasiblePath
from kerfpath.kernels import metric as metrics
from kerfpath.kernels import search as kernel
from kerfpath.kernels.change_table import NO_TABLE, ChangeTable
from kerfpath.kernels.limits import LIMIT_TOLERANCE
from kerfpath.kernels.metric import MANHATTAN, increments, increments_between, wrap
from kerfpath.kernels.search import NO_REVERSALS, Aim, ReversalPrices, SortedLayers
from kerfpath.kernels.torque import NO_TORQUE, TorqueTest
from kerfpath.limits import Limits
from kerfpath.losses import Loss, Reason
from kerfpath.search.branch import best_near_start

# -----------------------------------------------------------------------------
# Layered graph as given, and sorted for the kernels.

_LAYERS_SAMPLED = 32
"""Layers sampled to choose the joint that sorts them: enough to rank the joints."""
_VERTICES_SAMPLED = 16
"""Vertices of each sampled layer whose windows are counted."""


TESTS = (Loss.VELOCITY, Loss.ACCELERATION, Loss.TORQUE)
"""Tests that may forbid an edge, in the order in which they are made."""


class Layers(NamedTuple):
    """A layered graph as given: one row for each vertex."""

    q: Array
    """(N, n) rad."""
    start: Ints
    """(K+1,): layer k is q[start[k]:start[k+1]]."""
    endless: Bools
    """(n,): joints that turn without end."""
    cost: Array
    """(N,): cost of visiting a vertex; infinite if it is closed."""
    shut: Ints
    """(E, 2): edges that may not be used, as rows of q, from and to."""


def sort_layers(
    layers: Layers, velocity: Array, key: Array | None = None, width: float = 0.0
) -> SortedLayers:
    """Return the graph without closed vertices, each layer sorted by a key (N,).

    Along an edge the key may change by at most `width`. Without a key, layers are sorted by the
    joint whose window under `velocity` (n,) rad leaves the fewest vertices. Ranks count all
    vertices of a layer, including closed ones.
    """
    q, start, endless, cost, shut = layers
    kept, circular = None, False
    if cost.max(initial=0.0) == np.inf:
        kept = np.flatnonzero(cost < np.inf)
        q, start = freeze(q[kept]), np.searchsorted(kept, start)
        key = None if key is None else key[kept]
    if key is None:
        key, width, circular = _narrowest_key(q, start, velocity, endless)
    N, n = q.shape
    columns, keys, rank = np.empty((n, N)), np.empty(N), np.empty(N, np.int64)
    kernel.arrange(q, key, start, endless, columns, keys, rank)
    low, high = np.zeros(N, np.int64), np.zeros(N, np.int64)
    kernel.windows(keys, start, width, circular, low, high)
    del key, keys
    sizes = np.diff(start)
    order = np.repeat(start[:-1], sizes)
    order += rank
    if kept is not None:
        order = kept[order]
        rank = order - np.repeat(layers.start[:-1], sizes)
    shut_from, shut = _by_vertex(shut, order, len(layers.q))
    return SortedLayers(
        q=columns,
        given=columns if _is_wrapped(layers) else np.ascontiguousarray(layers.q[order].T),
        start=freeze(start),
        cost=freeze(cost[order] if cost.any() else cost),
        rank=rank,
        low=low,
        high=high,
        endless=endless,
        turn=np.where(endless, 2 * np.pi, np.inf),
        after=np.full(len(start) - 1, -1),
        shut_from=shut_from,
        shut=shut,
    )


def _is_wrapped(layers: Layers) -> bool:
    """Return whether every endless joint is given within (-pi, pi]."""
    return all(
        np.array_equal(wrap(layers.q[:, i]), layers.q[:, i]) for i in np.flatnonzero(layers.endless)
    )


def _by_vertex(edges: Ints, order: Ints, vertices: int) -> tuple[Ints, Ints]:
    """Return shut edges as `SortedLayers` stores them, without those of closed vertices."""
    if not len(edges):
        return np.empty(0, np.int64), np.empty(0, np.int64)
    place = np.full(vertices, -1)
    place[order] = np.arange(len(order))
    p, j = place[edges[(place[edges] >= 0).all(axis=1)]].T
    by = np.lexsort((j, p))
    return np.searchsorted(p[by], np.arange(len(order) + 1)), np.ascontiguousarray(j[by])


def empty_layer(layers: Layers, k: int) -> NoFeasiblePath:
    """Return the answer for a graph whose layer k has no open vertex."""
    closed = int(layers.start[k + 1] - layers.start[k])
    why = "no path can start" if k == 0 else "no admissible pose at that node"
    return NoFeasiblePath(
        f"layer {k} is empty: {why}" + (f"; closed vertices: {closed}" if closed else ""),
        proved=True,
        node=k - 1,
        counts={Reason(Loss.CLOSED): closed} if closed else {},
    )


def broken_edge(k: int, forbidden: Ints, shut: int, *, proved: bool) -> NoFeasiblePath:
    """Return the answer that no admissible edge leads into layer k, with the reasons counted."""
    counts: dict[str, int] = {
        Reason(test, i + 1): int(number)
        for test, row in zip(TESTS, forbidden, strict=True)
        for i, number in enumerate(row)
        if number
    }
    if shut:
        counts[Reason(Loss.SHUT)] = shut
    reasons = ", ".join(f"{name}: {number}" for name, number in counts.items())
    total = int(sum(counts.values()))
    return NoFeasiblePath(
        f"no admissible edge from node {k - 1} to node {k}; "
        f"of {total} edges, forbidden by {reasons}",
        proved=proved,
        node=k - 1,
        counts=counts,
    )


def require_joined(layers: Layers) -> None:
    """Raise NoFeasiblePath if closed vertices and shut edges alone leave no path."""
    q, start, _, cost, edges = layers
    open_ = reached = cost < np.inf
    edges = edges[np.argsort(edges[:, 0])]
    begin = np.searchsorted(edges[:, 0], start)
    for k in range(len(start) - 1):
        here = open_[start[k] : start[k + 1]]
        if k > 0 and begin[k - 1] < begin[k]:
            p, j = np.unique(edges[begin[k - 1] : begin[k]], axis=0).T
            ways = np.bincount(j[reached[p - start[k - 1]]] - start[k], minlength=len(here))
            shut = int(ways[here].sum())
            here = here & (ways < reached.sum())
            if shut and not here.any():
                none = np.zeros((3, q.shape[1]), np.int64)
                raise broken_edge(k, none, shut, proved=True)
        if not here.any():
            raise empty_layer(layers, k)
        reached = here


def reverse(layers: Layers) -> Layers:
    """Return the layers in reverse order."""
    q, start, endless, cost, shut = layers
    sizes = np.diff(start)[::-1]
    begin = np.concatenate([[0], np.cumsum(sizes)])
    # Vertex i of reversed layer k comes from the old position of that layer.
    order = np.arange(len(q)) + np.repeat(start[:-1][::-1] - begin[:-1], sizes)
    return Layers(
        q=freeze(q[order]),
        start=freeze(begin),
        endless=endless,
        cost=freeze(cost[order]),
        shut=np.argsort(order)[shut[:, ::-1]] if len(shut) else shut,
    )


def _narrowest_key(
    q: Array, start: Ints, bound: Array, endless: Bools
) -> tuple[Array, float, bool]:
    """Choose the joint whose velocity window leaves the fewest vertices, to sort the layers by."""
    layers = np.unique(np.linspace(0, max(len(start) - 3, 0), _LAYERS_SAMPLED).astype(int))
    pairs = np.zeros(q.shape[1], np.int64)
    for k in layers[layers + 2 < len(start)]:
        here, there = q[start[k] : start[k + 1]], q[start[k + 1] : start[k + 2]]
        some = freeze(here[:: len(here) // _VERTICES_SAMPLED + 1].copy())
        kernel.count_within(some, there, bound, endless, pairs)
    best = int(np.argmin(pairs))
    key = np.empty(len(q))
    kernel.fill_key(q, best, bool(endless[best]), key)
    # Twice the slack of (5): the key must never exclude an edge that the test itself would pass.
    return key, float(bound[best] + 2 * LIMIT_TOLERANCE), bool(endless[best])


# -----------------------------------------------------------------------------
# Limits on the rotation of endless joints from where a path begins (hoses and cables).
#
# A limited joint is not wrapped: it no longer counts modulo 2 pi, and the graph has a copy of
# each vertex for each turn within the limit. The first layer has one copy, on turn 0. Only joints
# that a best path would turn too far are treated like this: if the path then keeps the limits of
# all other joints anyway, it is the best within all limits.


def too_far(path: Array, endless: Bools, rotation: Array) -> Bools:
    """Return which joints a path (K, n) rad turns further than `rotation` (n,) rad."""
    turned = np.cumsum(increments(path, endless), axis=0)
    return np.asarray((np.abs(turned) > rotation + LIMIT_TOLERANCE).any(axis=0))


def best_within_rotation(
    layers: Layers, aim: Aim, rotation: Array, unroll: Bools, *, closed: bool
) -> tuple[Bools, tuple[Ints, float] | None]:
    """Return the joints not wrapped at last, and the best path that keeps `rotation` (n,) rad.

    `unroll` (n,) are the joints that are not wrapped at first; K >= 2. The path is given by its
    vertices (K,) and cost; None if the limits of the joints that are not wrapped leave none.
    """
    while True:
        found = _best(layers, aim, np.where(unroll, rotation, np.inf), closed=closed)
        if found is None:
            return unroll, None
        path = layers.q[layers.start[:-1] + found[0]]
        more = too_far(path, layers.endless, rotation) & ~unroll
        if not more.any():
            return unroll, found
        unroll = unroll | more


def closed_before(
    layers: Layers, aim: Aim, rotation: Array, broken: NoFeasiblePath
) -> NoFeasiblePath | None:
    """Return the answer that rotation limits end all paths before they break anyway; else None.

    `broken` is the answer without limits on the rotation.
    """
    limited = np.isfinite(rotation)
    if broken.node < 1 or not limited.any():
        return None
    part, none = _until(layers, broken.node), np.zeros(len(limited), np.bool_)
    least, plain = _turning_least(part, aim, limited)
    closing, found = best_within_rotation(plain, least, rotation, none, closed=False)
    if found is not None:
        return None
    why = why_closed(part, aim, rotation, closing, closed=False)
    return why.with_message(f"{why} to node {broken.node}, and there {broken}")


def why_closed(
    layers: Layers, aim: Aim, rotation: Array, closing: Bools, *, closed: bool
) -> NoFeasiblePath:
    """Return the answer that the rotation limits of the joints `closing` (n,) leave no path."""
    aim, layers = _turning_least(layers, aim, closing)
    joints = np.flatnonzero(closing).tolist()
    only = np.isfinite(rotation).sum() == 1
    opening = [
        i for i in joints if only or _opens(layers, aim, rotation, closing, i, closed=closed)
    ]
    node = _last_node(layers, aim, rotation, closing, closed=closed)
    named = [f"joint {i + 1} ({rotation[i]:.4g} rad)" for i in opening or joints]
    one = "it" if len(named) == 1 else "any one of them"
    without = one if opening else "rotation limits"
    return NoFeasiblePath(
        f"the rotation limit of {' and of '.join(named)} leaves no path"
        f"{'' if closed else f' from node {node} on'}; without {without} there is a path",
        proved=True,
        node=node,
    )


def _turning_least(layers: Layers, aim: Aim, joints: Bools) -> tuple[Aim, Layers]:
    """Return aim and layers of the path whose `joints` (n,) turn least.

    That path shows soonest whether the limits leave a path.
    """
    weight = freeze(joints.astype(float))
    aim = aim._replace(weight=weight, metric=MANHATTAN, minimax=False, reversals=NO_REVERSALS)
    return aim, layers._replace(cost=np.where(layers.cost < np.inf, 0.0, np.inf))


def _until(layers: Layers, node: int) -> Layers:
    """Return the layers up to and including a node."""
    q, start, endless, cost, shut = layers
    N = start[node + 1]
    return Layers(q[:N], start[: node + 2], endless, cost[:N], shut[shut[:, 1] < N])


def _opens(
    layers: Layers, aim: Aim, rotation: Array, closing: Bools, i: int, *, closed: bool
) -> bool:
    """Return whether there is a path if only the limit of joint i is removed."""
    others = np.arange(len(rotation)) != i
    unlimited = np.where(others, rotation, np.inf)
    return (
        best_within_rotation(layers, aim, unlimited, closing & others, closed=closed)[1] is not None
    )


def _last_node(layers: Layers, aim: Aim, rotation: Array, closing: Bools, *, closed: bool) -> int:
    """Return the last node that a path within `rotation` reaches, by bisection.

    Without `closed`, it is known that no path reaches the end.
    """
    reached, beyond = 0, len(layers.start) - (1 if closed else 2)
    while beyond - reached > 1:
        node = (reached + beyond) // 2
        part = _until(layers, node)
        if best_within_rotation(part, aim, rotation, closing, closed=False)[1] is None:
            beyond = node
        else:
            reached = node
    return reached


def _best(layers: Layers, aim: Aim, rotation: Array, *, closed: bool) -> tuple[Ints, float] | None:
    """Return the best path that keeps `rotation`, with all limited joints not wrapped."""
    unrolled, place = unroll(layers, rotation, aim.velocity)
    # A limited joint turns by at most pi in a step: the other direction would be shorter.
    most = np.where(np.isfinite(rotation), np.minimum(aim.velocity, np.pi), aim.velocity)
    graph = sort_layers(unrolled, freeze(most))
    sizes = np.diff(graph.start)
    if (sizes == 0).any():
        return None
    rank = place[graph.rank + np.repeat(unrolled.start[:-1], sizes)]
    aim = aim._replace(velocity=most)
    found = best_near_start(graph._replace(rank=rank), aim, rotation, closed=closed)
    return None if found is None else (rank[found.path], found.cost)


def unroll(layers: Layers, rotation: Array, velocity: Array) -> tuple[Layers, Ints]:
    """Return the graph with its limited joints not wrapped, and the rank of each vertex's original.

    Vertices that are too far from every start are left out. If `velocity` (n,) rad allows a step of
    half a turn, it keeps the direction that it has in the original graph.
    """
    q, start, endless, cost, shut = layers
    place = np.arange(len(q)) - np.repeat(start[:-1], np.diff(start))
    limited, origin = np.isfinite(rotation), np.arange(len(q))
    q = np.where(limited, wrap(q), q)
    for i in np.flatnonzero(limited):
        x, m, reach = q[:, i], start[1], rotation[i] + LIMIT_TOLERANCE
        first = np.ceil((x[:m].min() - reach - x) / (2 * np.pi)).astype(np.int64)
        last = np.floor((x[:m].max() + reach - x) / (2 * np.pi)).astype(np.int64)
        first[:m] = last[:m] = 0
        copies = last + 1 - first
        begin = np.concatenate([[0], np.cumsum(copies)])
        turn = np.arange(begin[-1]) - np.repeat(begin[:-1] - first, copies)
        origin, q = np.repeat(origin, copies), np.repeat(q, copies, axis=0)
        q[:, i] += 2 * np.pi * turn
        start = begin[start]
    shut = _every_copy(shut, origin, len(place))
    for i in np.flatnonzero(limited & (velocity > np.pi - 2 * LIMIT_TOLERANCE)):
        shut = np.vstack([shut, _wrong_half_turns(layers.q[origin, i], q[:, i], start)])
    unrolled = Layers(
        q=freeze(q),
        start=freeze(start),
        endless=freeze(endless & ~limited),
        cost=cost[origin],
        shut=shut,
    )
    return unrolled, place[origin]


def _wrong_half_turns(given: Array, unrolled: Array, start: Ints) -> Ints:
    """Return the edges (E, 2) along which a joint makes half a turn in the wrong direction.

    given, unrolled (N,) rad are its angles as given and not wrapped.
    """
    found = [np.empty((0, 2), np.int64)]
    for k in range(len(start) - 2):
        a, b, c = start[k : k + 3]
        way = increments_between(given[a:b, None], given[None, b:c], np.ones(1, np.bool_))
        step = unrolled[None, b:c] - unrolled[a:b, None]
        half = np.abs(np.abs(step) - np.pi) < LIMIT_TOLERANCE
        found.append(np.argwhere(half & (way * step < 0)) + start[k : k + 2])
    return np.concatenate(found)


def _every_copy(shut: Ints, origin: Ints, vertices: int) -> Ints:
    """Return the shut edges (E, 2) between all copies of their ends."""
    if not len(shut):
        return shut
    copies = np.bincount(origin, minlength=vertices)
    most = copies.max()
    by, first = np.argsort(origin, kind="stable"), np.cumsum(copies) - copies
    each = np.mgrid[:most, :most].reshape(2, -1).T
    there = (each < copies[shut][:, None]).all(axis=2)
    return np.asarray(by[(first[shut][:, None] + each)[there]])


# -----------------------------------------------------------------------------
# Search problem: a layered graph, limits and objective, cast and checked once.

Metric = Literal["manhattan", "chebychev", "euclid"]
ObjectiveKind = Literal["sum", "max"]
Method = Literal["exact", "paper", "known"]
Closure = Literal["free", "periodic"]

METRIC_CODES: dict[str, int] = {
    "euclid": metrics.EUCLID,
    "manhattan": metrics.MANHATTAN,
    "chebychev": metrics.CHEBYCHEV,
}


@dataclass(frozen=True, slots=True, eq=False, init=False)
class SearchProblem:
    """A layered graph given as arrays, and the limits and objective of a path through it.

    A path takes one vertex of each layer, in order.

    Parameters
    ----------
    q, start, dt, endless, vertex_cost, shut, weights, metric, objective, closure, rotation, posture
        As in `kerfpath.shortest_path`; q is not copied.
    limits : Limits
        Limits (5) and (6) and on the torque of each step; searches do not keep a jerk limit.
    most : (n,) rad, optional
        Largest change of each joint from node to node, whatever its limits; default: none.
    method : {"exact", "paper", "known"}
        Method of `find_shortest`; all other searches are exact.
    reversals : ReversalPrices, optional
        Costs of joints that turn back from one step to the next; `find_shortest` adds them to the
        objective. Default: none.

    Raises
    ------
    InputError
        Arrays whose shapes do not fit, NaN, a dt that is not positive, unknown names, a finite
        rotation of a joint that is not endless, another method than "exact" with a closure, a
        rotation, or a limit on torque or jerk, or costs of reversals with another method or
        objective than "exact" and "sum".
    """

    q: Array
    start: Ints
    dt: float
    limits: Limits
    endless: Bools
    vertex_cost: Array
    shut: Ints
    weights: Array
    metric: Metric
    objective: ObjectiveKind
    closure: Closure
    rotation: Array
    most: Array
    method: Method
    posture: Ints | None
    reversals: ReversalPrices

    __repr__ = short_repr

    def __init__(
        self,
        *,
        q: ArrayLike,
        start: ArrayLike,
        dt: float,
        limits: Limits,
        endless: ArrayLike | None = None,
        vertex_cost: ArrayLike | None = None,
        shut: ArrayLike | None = None,
        weights: ArrayLike | None = None,
        metric: Metric = "manhattan",
        objective: ObjectiveKind = "sum",
        closure: Closure = "free",
        rotation: ArrayLike | None = None,
        most: ArrayLike | None = None,
        method: Method = "exact",
        posture: ArrayLike | None = None,
        reversals: ReversalPrices = NO_REVERSALS,
    ) -> None:
        for name, value, known in (
            ("method", method, get_args(Method)),
            ("closure", closure, get_args(Closure)),
            ("metric", metric, tuple(METRIC_CODES)),
            ("objective", objective, get_args(ObjectiveKind)),
        ):
            require_one_of(value, name, known)
        q = floats(q, "q", (None, None), copy=False)
        N, n = q.shape
        if n == 0:
            raise InputError(f"q: expected at least one joint, got shape {q.shape}")
        dt = scalar(dt, "dt", unit="s", above=0.0)
        limits.require_joints(n)
        start = offsets(start, N)
        turning = bools(np.zeros(n, bool) if endless is None else endless, "endless", (n,))
        cast: dict[str, Any] = {
            "q": q,
            "start": start,
            "dt": dt,
            "limits": limits,
            "endless": turning,
            "vertex_cost": _vertex_costs(vertex_cost, N),
            "shut": _shut_edges(shut, start),
            "weights": _weights(weights, limits, dt),
            "metric": metric,
            "objective": objective,
            "closure": closure,
            "rotation": rotation_limits(rotation, turning),
            "most": floats(
                np.full(n, np.inf) if most is None else most, "most", (n,), infinite=True
            ),
            "method": method,
            "posture": None if posture is None else integers(posture, "posture", (N,)),
            "reversals": reversals,
        }
        for name, value in cast.items():
            object.__setattr__(self, name, value)
        if method != "exact" and closure == "periodic":
            raise InputError(f'closure: "periodic" needs method="exact", got method={method!r}')
        if method != "exact" and np.isfinite(self.rotation).any():
            raise InputError(f'rotation: a limit needs method="exact", got method={method!r}')
        for name in ("torque", "jerk"):
            if method != "exact" and getattr(limits, name) is not None:
                raise InputError(f'{name}: a limit needs method="exact", got method={method!r}')

        if len(reversals.price) and (method, objective) != ("exact", "sum"):
            raise InputError(
                'reversals: a cost needs method="exact" and objective="sum", got '
                f"method={method!r} and objective={objective!r}"
            )

    @property
    def layers(self) -> Layers:
        """The layered graph."""
        return Layers(self.q, self.start, self.endless, self.vertex_cost, self.shut)

    def free(self) -> SearchProblem:
        """Return the problem without closure, rotation limits, and costs but distances."""
        return replace(
            self,
            vertex_cost=np.where(self.vertex_cost < np.inf, 0.0, np.inf),
            closure="free",
            rotation=np.full(len(self.endless), np.inf),
            reversals=NO_REVERSALS,
        )

    @property
    def aim(self) -> Aim:
        """Objective and bounds on the increments, for the kernels."""
        torque = self.limits.torque
        return Aim(
            weight=self.weights,
            metric=METRIC_CODES[self.metric],
            minimax=self.objective == "max",
            velocity=freeze(np.minimum(self.limits.velocity.per_interval(self.dt), self.most)),
            acceleration=self.limits.acceleration.per_interval(self.dt),
            table=change_table(self.limits),
            torque=NO_TORQUE
            if torque is None
            else TorqueTest(arm=torque.dynamics.bodies, bound=torque.bound, dt=self.dt),
            reversals=self.reversals,
        )


def example_problem() -> SearchProblem:
    """Return a problem of three nodes with four vertices each, to compile kernels with."""
    nodes, samples, joints = 3, 4, 6
    q = np.zeros((nodes * samples, joints))
    q[:, -1] = np.tile(np.arange(samples), nodes)
    ones = np.ones(joints)
    return SearchProblem(
        q=freeze(q),
        start=freeze(np.arange(0, len(q) + 1, samples)),
        dt=1.0,
        limits=Limits.of(ones, ones),
        endless=ones > 0,
    )


def change_table(limits: Limits) -> ChangeTable:
    """Return the factors by which accelerations may be above their bound, for the kernels."""
    table = limits.acceleration.table
    if table is None:
        return NO_TABLE
    factor = np.ones((len(table.joint_2), len(table.joint_3), len(limits.acceleration.bound)))
    factor[..., table.joints] = table.values / table.least
    return ChangeTable(table.joint_2, table.joint_3, freeze(factor))


def offsets(start: ArrayLike, vertices: int) -> Ints:
    """Return `start` as checked offsets of layers; InputError if it is not."""
    start = integers(start, "start", (None,))
    if len(start) < 2 or start[0] != 0 or start[-1] != vertices or (np.diff(start) < 0).any():
        raise InputError(
            "start: expected K+1 offsets that begin with 0, never decrease and end with the number "
            f"of vertices ({vertices}), got {start.tolist() if len(start) < 12 else '...'}"
        )
    return start


def _weights(weights: ArrayLike | None, limits: Limits, dt: float) -> Array:
    velocity = limits.velocity.bound
    if weights is None:
        return freeze(1.0 / (velocity * dt))
    weights = floats(weights, "weights", velocity.shape)
    if (weights < 0).any():
        raise InputError(f"weights: must not be negative, got {weights.tolist()}")
    return weights


def _vertex_costs(vertex_cost: ArrayLike | None, vertices: int) -> Array:
    if vertex_cost is None:
        return freeze(np.zeros(vertices))
    cost = floats(vertex_cost, "vertex_cost", (vertices,), infinite=True)
    if (cost == -np.inf).any():
        raise InputError("vertex_cost: a vertex may cost infinity, which closes it, but not -inf")
    return cost


def _shut_edges(shut: ArrayLike | None, start: Ints) -> Ints:
    if shut is None:
        return np.empty((0, 2), np.int64)
    edges = integers(shut, "shut", (None, 2))
    layer = np.searchsorted(start, edges, side="right") - 1
    inside = ((edges >= 0) & (edges < start[-1])).all(axis=1)
    wrong = np.flatnonzero(~inside | (layer[:, 1] != layer[:, 0] + 1))
    if wrong.size:
        raise InputError(
            "shut: an edge leads from a vertex to one of the next layer, got "
            f"{edges[wrong[0]].tolist()}"
        )
    return edges


def rotation_limits(rotation: ArrayLike | None, endless: Bools) -> Array:
    """Return the largest angle (n,) rad that each joint may turn away, infinity where unlimited.

    Raises
    ------
    InputError
        Negative or NaN; a finite limit of a joint that is not endless.
    """
    n = len(endless)
    if rotation is None:
        return np.full(n, np.inf)
    limit = floats(rotation, "rotation", (n,), infinite=True)
    if (limit < 0).any():
        raise InputError(f"rotation: must not be negative, got {limit.tolist()}")
    plain = np.flatnonzero(np.isfinite(limit) & ~endless)
    if plain.size:
        raise InputError(
            f"rotation: joint {plain[0] + 1} is not endless and already limited by its range; "
            f"expected infinity, got {limit[plain[0]]:g}"
        )
    return limit


def refuse_torque(problem: SearchProblem, what: str) -> None:
    """Raise InputError for limits on torque or jerk, which a search does not support."""
    for name in ("torque", "jerk"):
        if getattr(problem.limits, name) is not None:
            raise InputError(f"{what}: limits on the {name} are not supported; remove them")


def refuse_ends(problem: SearchProblem, what: str) -> None:
    """Raise InputError for a closure or a rotation limit, which a search does not support."""
    if problem.closure != "free" or np.isfinite(problem.rotation).any():
        raise InputError(
            f'{what}: needs closure "free" and no rotation limit, got {problem.closure!r} and '
            f"{problem.rotation.tolist()}"
        )
