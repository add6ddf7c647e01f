"""Branch and bound over where a path begins, for what is measured from there.

A closed path returns to the vertex it left, and an endless joint may have turned only so far from
where it began. A relaxation lets the path begin at any vertex of a set, return to any other of it,
and turn as far as the least strict of them allows. Where the cheapest relaxation's own path keeps
what is asked, it is the answer; else the set is parted so that this path falls away.
"""

from __future__ import annotations

import heapq
import itertools
from dataclasses import dataclass

import numpy as np

from kerfpath._arrays import Array, Bools, Ints
from kerfpath.kernels.limits import LIMIT_TOLERANCE, acceleration_excess
from kerfpath.kernels.metric import increments, increments_between
from kerfpath.kernels.search import Aim, SortedLayers
from kerfpath.kernels.torque import exceeds_torque
from kerfpath.search._exact import NO_SEAM, BestPath, NoPathProof, best_allowed, best_path, dead_end

__all__ = ["best_closed_path", "best_near_start"]


def best_closed_path(layers: SortedLayers, aim: Aim) -> BestPath | NoPathProof:
    """Return the best path that returns to the vertex it left, with (6) and torques kept there."""
    if len(layers.start) == 2:
        return best_path(layers, aim)
    free = np.full(len(layers.endless), np.inf)
    return best_near_start(layers, aim, free, closed=True) or dead_end(layers, aim)


def best_near_start(
    layers: SortedLayers, aim: Aim, rotation: Array, *, closed: bool
) -> BestPath | None:
    """Return the best path that keeps its distance (n,) rad from its start, K >= 2; None if none.

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
                # Maxima that are the same but for rounding tie, and sums say which is first.
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
    """What is asked of a path from its start, and the relaxations of it.

    A relaxation is given by vertices to begin at, and vertices to go to from there.

    Parameters
    ----------
    layers, aim
        The graph and the objective.
    rotation : (n,) rad
        Largest distance of a joint from where the path begins.
    twin : (m,) int or None
        The vertex of the first layer that each vertex of the last one repeats, -1 where that is
        closed; None: the path need not return.
    """

    layers: SortedLayers
    aim: Aim
    rotation: Array
    twin: Ints | None

    def relaxed(self, starts: Ints, firsts: Ints, floor: float) -> BestPath | None:
        """Return the best path of a relaxation; one start and one first edge leave nothing open."""
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
        """Return which vertices some path that begins at one of `starts` may turn to."""
        allowed = np.ones(len(self.layers.low), np.bool_)
        for i in np.flatnonzero(np.isfinite(self.rotation)):
            q, reach = self.layers.q[i], self.rotation[i] + LIMIT_TOLERANCE
            allowed &= (q >= q[starts].min() - reach) & (q <= q[starts].max() + reach)
        return allowed

    def parted(self, starts: Ints, firsts: Ints, path: Ints) -> list[tuple[Ints, Ints]]:
        """Part a relaxation so that its path falls away; nothing if the path is as asked."""
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
        """Part the vertices by the joint that turns too far, the start of the path from the far.

        In the half of the start no path goes as far as this one, or the half is smaller.
        """
        limited = np.flatnonzero(np.isfinite(self.rotation))
        q = self.layers.q[limited][:, path]
        ahead = q.max(axis=1) - q[:, 0] - self.rotation[limited]
        behind = q[:, 0] - q.min(axis=1) - self.rotation[limited]
        i = int(np.argmax(np.maximum(ahead, behind)))
        sign = 1.0 if ahead[i] > behind[i] else -1.0
        x, own = sign * self.layers.q[limited[i]][starts], sign * q[i, 0]
        middle = (x.min() + x.max()) / 2
        # The path keeps the limit of a start at `far` or beyond.
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
    if acceleration_excess(dq[0], dq[-1], aim.acceleration) >= 0:
        return False
    return not exceeds_torque(aim.torque, layers.given, int(path[-1]), dq[-1], dq[0])


def _split(layers: SortedLayers, starts: Ints, a: int, b: int) -> tuple[Ints, Ints]:
    """Part the vertices by which of a and b they are nearer to; these come to different parts."""
    nearer = _gap(layers, starts, a) < _gap(layers, starts, b)
    nearer |= starts == a
    nearer &= starts != b
    return starts[nearer], starts[~nearer]


def _gap(layers: SortedLayers, vertices: Ints, v: int) -> Array:
    """Return the sum of joint differences from vertex v to others of its layer, rad."""
    gap = increments_between(layers.q[:, [v]].T, layers.q[:, vertices].T, layers.endless)
    return np.asarray(np.abs(gap).sum(axis=1))
