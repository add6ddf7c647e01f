"""Match the contours and moves of two programs."""

from __future__ import annotations

from collections.abc import Sequence
from difflib import SequenceMatcher
from typing import NamedTuple

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.spatial import cKDTree

from kerfpath._arrays import Array, Ints
from kerfpath.errors import InputError
from kerfpath.post._groups import ReadGroup
from kerfpath.post._read import ReadMove, ReadWait

__all__ = ["MovePair", "Stop", "match_groups", "pair_moves"]

NEAR = 5e-3
"""Contours whose paths are farther apart (m) are matched by their names only."""
SAMPLES = 50
"""Number of evenly spaced points at which paths are compared."""
NEVER = 1e6
"""Distance (m) of what must not be matched."""


class Stop(NamedTuple):
    """A move, the wait (s) at its end, and file and line of the wait."""

    move: ReadMove
    wait: float = 0.0
    waits_at: str = ""


class MovePair(NamedTuple):
    """A move of program A and one of B; None if only the other program has the move."""

    a: Stop | None
    b: Stop | None

    @property
    def places(self) -> tuple[str, ...]:
        """File and line of both."""
        return tuple(stop.move.place for stop in self if stop is not None)


def match_groups(a: Sequence[ReadGroup], b: Sequence[ReadGroup]) -> list[tuple[int, int]]:
    """Return the pairs of contours of A and B along the same path, or with the same name."""
    one, two = [_trace(group) for group in a], [_trace(group) for group in b]
    cost = np.full((len(a), len(b)), NEVER)
    for i, path in enumerate(one):
        for j, other in enumerate(two):
            if (path is None) == (other is None):
                # Of equal contours, the one in the same order.
                cost[i, j] = _distance(path, other) + 1e-9 * abs(i - j)
    rows, columns = linear_sum_assignment(np.minimum(cost, NEAR))
    found = {int(i): int(j) for i, j in zip(rows, columns, strict=True) if cost[i, j] < NEAR}
    for i, group in enumerate(a):
        left = [j for j in range(len(b)) if j not in found.values() and cost[i, j] < NEVER]
        same = [j for j in left if b[j].name.lower() == group.name.lower()]
        if i not in found and same:
            found[i] = same[0]
    return sorted(found.items())


def _distance(one: Array | None, two: Array | None) -> float:
    """Return the median distance (m) of two paths."""
    if one is None or two is None:
        return 0.0
    return float(np.median(np.linalg.norm(one - two, axis=1)))


def _trace(group: ReadGroup) -> Array | None:
    """Return points (SAMPLES, 3) along the path of a contour; None after the last."""
    points = _points(group.path)
    if not len(points):
        return None
    way = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))
    at = np.linspace(0, way[-1], SAMPLES)
    return np.stack([np.interp(at, way, x) for x in points.T], axis=1)


def _points(moves: Sequence[ReadMove]) -> Array:
    """Return the ends (K, 3) m of moves in the part."""
    ends = [move.T_part_tip for move in moves if move.T_part_tip is not None]
    if len(ends) < len(moves):
        raise InputError("a program gives joints alone along its path; apply with_tips first")
    return np.array(ends).reshape(-1, 4, 4)[:, :3, 3]


def pair_moves(a: ReadGroup, b: ReadGroup, near: float) -> list[MovePair]:
    """Return the moves of a contour in A with those in B that end at the same place.

    Other moves between them are paired in order, as many as both programs have.

    Parameters
    ----------
    a, b : ReadGroup
    near : float m
        Distance up to which two places are the same.
    """
    joint = min(len(a.joint), len(b.joint))
    ways = [_add_waits(g.joint, [(len(g.joint), w) for k, w in g.waits if k == 0]) for g in (a, b)]
    pairs = [MovePair(stop, None) for stop in ways[0][: len(ways[0]) - joint]]
    pairs += [MovePair(None, stop) for stop in ways[1][: len(ways[1]) - joint]]
    pairs += [
        MovePair(*both) for both in zip(*(way[len(way) - joint :] for way in ways), strict=True)
    ]
    one, two = _add_waits(a.path, a.waits), _add_waits(b.path, b.waits)
    keys = _number_places(a.path, b.path, near)
    if len(one) == len(two) and 2 * (keys[0] == keys[1]).sum() >= len(one):
        return pairs + [MovePair(*both) for both in zip(one, two, strict=True)]
    matcher = SequenceMatcher(None, keys[0].tolist(), keys[1].tolist(), autojunk=False)
    for _, i0, i1, j0, j1 in matcher.get_opcodes():
        both = min(i1 - i0, j1 - j0)
        pairs += [MovePair(one[i0 + k], two[j0 + k]) for k in range(both)]
        pairs += [MovePair(stop, None) for stop in one[i0 + both : i1]]
        pairs += [MovePair(None, stop) for stop in two[j0 + both : j1]]
    return pairs


def _add_waits(moves: Sequence[ReadMove], waits: Sequence[tuple[int, ReadWait]]) -> list[Stop]:
    """Return moves with the waits after them."""
    stops = [Stop(move) for move in moves]
    for behind, wait in waits:
        if behind > 0:
            move, time, at = stops[behind - 1]
            stops[behind - 1] = Stop(move, time + wait.time, at or wait.place)
    return stops


def _number_places(a: Sequence[ReadMove], b: Sequence[ReadMove], near: float) -> tuple[Ints, Ints]:
    """Return a number for each place that moves of a path end at."""
    one, two = _points(a), _points(b)
    if not len(one):
        return np.zeros(0, np.int64), -1 - np.arange(len(two))
    tree = cKDTree(one)
    first = np.arange(len(one))
    for i, j in sorted(tree.query_pairs(near)):
        first[j] = min(first[j], first[i])
    off, nearest = tree.query(two)
    return first, np.where(off <= near, first[nearest], -1 - np.arange(len(two)))
