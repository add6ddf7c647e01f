"""Branch and bound over the start of a path, for constraints that depend on the start.

A closed path returns to the vertex it left, and the rotation of an endless joint may be limited
from its start. A relaxation lets the path begin at any vertex of a set, return to any other of it,
and turn as far as the least strict of them allows. If the path of the cheapest relaxation keeps the
constraints, it is the answer; else the set is split so that this path is excluded.
"""

from __future__ import annotations

import heapq
import itertools
from dataclasses import dataclass

import numpy as np

from kerfpath.arrays import Array, Bools, Ints
from kerfpath.kernels.change_table import change_factors
from kerfpath.kernels.limits import LIMIT_TOLERANCE, acceleration_excess
from kerfpath.kernels.metric import increments, increments_between
from kerfpath.kernels.search import Aim, SortedLayers
from kerfpath.kernels.torque import exceeds_torque
from kerfpath.search.exact import NO_SEAM, BestPath, NoPathProof, best_allowed, best_path, dead_end


def best_closed_path(layers: SortedLayers, aim: Aim) -> BestPath | NoPathProof:
    """Return the best path that returns to the vertex it left, with (6) and torques at the seam."""
    if len(layers.start) == 2:
        return best_path(layers, aim)
    free = np.full(len(layers.endless), np.inf)
    return best_near_start(layers, aim, free, closed=True) or dead_end(layers, aim)


def best_near_start(
    layers: SortedLayers, aim: Aim, rotation: Array, *, closed: bool
) -> BestPath | None:
    """Return the best path within `rotation` (n,) rad of its start, K >= 2; None if there is none.

    If `closed`, it returns to the vertex it left, and (6) holds across the seam.
    """
    twin = _twins(layers) if closed else None
    within = _Starts(layers=layers, aim=aim, rotation=rotation, twin=twin)
    count = itertools.count()
    queue: list[tuple[float, float, int, BestPath, Ints, Ints]] = []
    every = np.arange(layers.start[1]), np.arange(layers.start[1], layers.start[2])
    parts, floor = [every], -np.inf
    while True:
        for starts, firsts in parts:
            found = within.relaxed(starts, firsts, floor)
            if found is not None:
                # Maxima that differ only by rounding tie; their sums decide.
                cost = float(f"{found.cost:.12g}") if aim.minimax else found.cost
                entry = (cost, found.total, next(count), found, starts, firsts)
                heapq.heappush(queue, entry)
        if not queue:
            return None
        *_, found, starts, firsts = heapq.heappop(queue)
        floor = found.cost
        parts = within.parted(starts, firsts, found.path)
        if not parts:
            return found


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Starts:
    """The constraints of a path from its start, and their relaxations.

    A relaxation is a set of start vertices and a set of vertices of the second layer.

    Parameters
    ----------
    layers, aim
        The graph and the objective.
    rotation : (n,) rad
        Largest distance of a joint from where the path begins.
    twin : (m,) int or None
        The vertex of the first layer that each vertex of the last one repeats, -1 if that vertex is
        closed; None: the path need not return.
    """

    layers: SortedLayers
    aim: Aim
    rotation: Array
    twin: Ints | None

    def relaxed(self, starts: Ints, firsts: Ints, floor: float) -> BestPath | None:
        """Return the best path of a relaxation, which is exact for one start and one first edge."""
        start = self.layers.start
        allowed = self.near(starts)
        allowed[: start[1]] = False
        allowed[starts] = True
        if self.twin is None:
            return best_allowed(self.layers, self.aim, allowed, NO_SEAM, floor)
        allowed[start[1] : start[2]] &= np.isin(np.arange(start[1], start[2]), firsts)
        allowed[start[-2] :] &= np.isin(self.twin, starts)
        one = len(starts) == len(firsts) == 1
        seam = _increments(self.layers, np.append(starts, firsts))[0] if one else NO_SEAM
        return best_allowed(self.layers, self.aim, allowed, seam, floor)

    def near(self, starts: Ints) -> Bools:
        """Return which vertices are within the rotation limits of at least one of `starts`."""
        allowed = np.ones(len(self.layers.low), np.bool_)
        for i in np.flatnonzero(np.isfinite(self.rotation)):
            q, reach = self.layers.q[i], self.rotation[i] + LIMIT_TOLERANCE
            allowed &= (q >= q[starts].min() - reach) & (q <= q[starts].max() + reach)
        return allowed

    def parted(self, starts: Ints, firsts: Ints, path: Ints) -> list[tuple[Ints, Ints]]:
        """Split a relaxation so that its path is excluded; empty if the path keeps everything."""
        left = path[0]
        if self.twin is not None:
            returned = self.twin[path[-1] - self.layers.start[-2]]
            if left != returned:
                return [(half, firsts) for half in _split(self.layers, starts, left, returned)]
        if not self.near(path[:1])[path].all():
            return [(half, firsts) for half in self.split_by_rotation(starts, path)]
        one = len(starts) == len(firsts) == 1
        if self.twin is None or one or _passes_seam(self.layers, self.aim, path):
            return []
        if len(starts) > 1:
            return [(starts[starts == left], firsts), (starts[starts != left], firsts)]
        return [(starts, firsts[firsts == path[1]]), (starts, firsts[firsts != path[1]])]

    def split_by_rotation(self, starts: Ints, path: Ints) -> tuple[Ints, Ints]:
        """Split the starts by the joint that turns too far, away from the start of the path.

        In the half with that start no path turns as far as this one, or the half is smaller.
        """
        limited = np.flatnonzero(np.isfinite(self.rotation))
        q = self.layers.q[limited][:, path]
        ahead = q.max(axis=1) - q[:, 0] - self.rotation[limited]
        behind = q[:, 0] - q.min(axis=1) - self.rotation[limited]
        i = int(np.argmax(np.maximum(ahead, behind)))
        sign = 1.0 if ahead[i] > behind[i] else -1.0
        x, own = sign * self.layers.q[limited[i]][starts], sign * q[i, 0]
        middle = (x.min() + x.max()) / 2
        # From a start at `far` or beyond, the path would keep the limit.
        far = own + max(ahead[i], behind[i])
        nearer = x < far if middle >= far else x <= max(own, middle)
        if nearer.all():
            nearer = x <= own
        return starts[nearer], starts[~nearer]


def _twins(layers: SortedLayers) -> Ints:
    """Return, for each vertex of the last layer, the vertex of the first one that it repeats."""
    first, last = layers.start[1], layers.start[-2]
    by_rank = np.full(layers.rank[last:].max(initial=-1) + 1, -1)
    known = np.flatnonzero(layers.rank[:first] < len(by_rank))
    by_rank[layers.rank[known]] = known
    return by_rank[layers.rank[last:]]


def _increments(layers: SortedLayers, path: Ints) -> Array:
    return np.ascontiguousarray(increments(layers.given[:, path].T, layers.endless))


def _passes_seam(layers: SortedLayers, aim: Aim, path: Ints) -> bool:
    dq = _increments(layers, path)
    here = layers.given[:, path[-1]]
    if acceleration_excess(dq[0], dq[-1], aim.acceleration * change_factors(aim.table, here)) >= 0:
        return False
    return not exceeds_torque(aim.torque, layers.given, int(path[-1]), dq[-1], dq[0])


def _split(layers: SortedLayers, starts: Ints, a: int, b: int) -> tuple[Ints, Ints]:
    """Split the vertices by whether a or b is nearer; a and b come to different parts."""
    nearer = _gap(layers, starts, a) < _gap(layers, starts, b)
    nearer |= starts == a
    nearer &= starts != b
    return starts[nearer], starts[~nearer]


def _gap(layers: SortedLayers, vertices: Ints, v: int) -> Array:
    """Return the sums of absolute joint differences from vertex v to others of its layer, rad."""
    gap = increments_between(layers.q[:, [v]].T, layers.q[:, vertices].T, layers.endless)
    return np.asarray(np.abs(gap).sum(axis=1))
