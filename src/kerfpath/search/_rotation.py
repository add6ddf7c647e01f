"""Limits on the rotation of endless joints from where a path begins (hoses and cables).

A limited joint is not wrapped: it no longer counts modulo 2 pi, and the graph has a copy of each
vertex for each turn within the limit. The first layer has one copy, on turn 0. Only joints that a
best path would turn too far are treated like this: if the path then keeps the limits of all other
joints anyway, it is the best within all limits.
"""

from __future__ import annotations

import numpy as np

from kerfpath._arrays import Array, Bools, Ints, freeze
from kerfpath.errors import NoFeasiblePath
from kerfpath.kernels.limits import LIMIT_TOLERANCE
from kerfpath.kernels.metric import MANHATTAN, increments, increments_between, wrap
from kerfpath.kernels.search import Aim
from kerfpath.search._branch import best_near_start
from kerfpath.search._layers import Layers, sort_layers

__all__ = ["best_within_rotation", "closed_before", "too_far", "unroll", "why_closed"]


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
    aim = aim._replace(weight=freeze(joints.astype(float)), metric=MANHATTAN, minimax=False)
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
