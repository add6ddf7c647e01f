"""Courses through the valleys of the first-order problem over continuous gamma.

The value functions from the start and to the end add up to the cost of the best course through a
sample. A sample where this is less than at both neighbours in gamma is the bottom of a valley.
Where (6) binds, the best motion may lie in any of them.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from kerfpath.arrays import Array, Bools, Ints, freeze, short_repr
from kerfpath.kernels.beam import Alike, Beam, advance
from kerfpath.kernels.change_table import NO_TABLE
from kerfpath.kernels.continuous import Steps, Targets
from kerfpath.kernels.metric import increments, increments_between, wrap
from kerfpath.search.continuous import are_bottoms, targets_of, values_to

LAYERS = 7
"""Nodes at which valleys are looked for."""
SAME_COURSE = 0.06
"""rad: courses in the same postures whose gamma differs by less everywhere are one."""
ANY_CHANGE = 1e6
"""rad: change of an increment that no joint ever has."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Branches:
    """Samples of the joints of every node over gamma, and which of them are neighbours.

    Joints whose range is more than a turn count as endless: each is within half a turn of 0 or, if
    that is outside its range, the next turn inside.

    Parameters
    ----------
    start : (K+1,) int
        Node k has the samples ``start[k]:start[k+1]``, by posture and gamma.
    gamma : (N,) rad
    posture : (N,) int
    q : (N, n) rad
    endless : (n,) bool
        Joints that are compared modulo a turn.
    one, other : (T,) int
        Samples between which joints may be interpolated, node after node; a sample without a
        neighbour is both.
    begin : (K+1,) int
        Node k has the pairs ``begin[k]:begin[k+1]``.
    """

    start: Ints
    gamma: Array
    posture: Ints
    q: Array
    endless: Bools
    one: Ints
    other: Ints
    begin: Ints

    __repr__ = short_repr

    @property
    def node(self) -> Ints:
        """Node of each sample, (N,)."""
        return np.repeat(np.arange(len(self.start) - 1), np.diff(self.start))


class Course(NamedTuple):
    """Gamma, joints near it and posture of every node; joints are not wrapped."""

    gamma: Array
    """(K,) rad"""
    q: Array
    """(K, n) rad"""
    posture: Ints
    """(K,)"""

    def like(self, other: Course, within: float = SAME_COURSE) -> bool:
        """Return whether postures are the same, and gamma differs by less than `within` rad."""
        same = np.array_equal(self.posture, other.posture)
        return same and _same(self.gamma, other.gamma, within)


class _Direction(NamedTuple):
    """The problem from its first node to its last, or back, and its value function."""

    targets: Targets
    cost: Array
    values: Array


_Points = tuple[Ints, Ints, Array]
"""The samples between which the points of a course lie, and the shares."""


class Valleys:
    """Valleys of the first-order problem on samples of branches.

    Parameters
    ----------
    branches : Branches
    steps : Steps
        Costs of the steps from node to node, and the box of their increments.
    cost : (N,)
        Cost of each sample; infinite where it is not admitted.
    """

    def __init__(self, branches: Branches, steps: Steps, cost: Array) -> None:
        self._branches, self._steps = branches, steps
        targets = targets_of(
            branches.q, branches.start, branches.one, branches.other, branches.begin,
            branches.endless, steps.high,
        )  # fmt: skip
        cost = freeze(np.ascontiguousarray(cost))
        self._ahead = _Direction(targets, cost, values_to(targets, steps, cost))
        self._behind = _reversed(self._ahead, steps)

    @property
    def value(self) -> float:
        """Cost of the best course under (5) alone; infinite if there is none. It is no bound."""
        first = self._ahead.values[: self._branches.start[1]]
        return float(first.min(initial=np.inf))

    def courses(self) -> Iterator[Course]:
        """Yield the best course through each valley, the cheapest first, and each only once."""
        branches, known = self._branches, list[Course]()
        for node, v in self._bottoms():
            gamma, posture = branches.gamma[v], branches.posture[v]
            if any(c.posture[node] == posture and _same(c.gamma[node], gamma) for c in known):
                continue
            points = self._through(v)
            if points is None:
                continue
            course = self._course(*points)
            if not any(course.like(other) for other in known):
                known.append(course)
                yield course

    def left(self, followed: list[Course]) -> int:
        """Return how many valleys none of the courses is in, at the node where they are most."""
        gamma, posture = (np.array([course[part] for course in followed]) for part in (0, 2))
        count, branches = Counter[int](), self._branches
        for node, v in self._bottoms():
            apart = np.abs(wrap(gamma[:, node] - branches.gamma[v]))
            passed = (posture[:, node] == branches.posture[v]) & (apart < SAME_COURSE)
            count[node] += not passed.any()
        return max(count.values(), default=0)

    def _bottoms(self) -> Iterator[tuple[int, int]]:
        """Yield node and sample of each valley, by the cost of the best course through it."""
        to_go, from_start = self._ahead.values, self._behind.values[::-1]
        passed = np.isfinite(to_go + from_start)
        if self._steps.minimax:
            through = np.maximum(to_go, from_start)
        else:
            through = to_go + from_start
            through[passed] -= self._ahead.cost[passed]  # it is in both
        node = self._branches.node
        bottom = passed & are_bottoms(self._ahead.targets, through)
        last = len(self._branches.start) - 2
        bottom &= np.isin(node, np.linspace(0, last, LAYERS).astype(int))
        found = np.flatnonzero(bottom)
        for v in found[np.argsort(through[found], kind="stable")].tolist():
            yield int(node[v]), v

    def _through(self, v: int) -> _Points | None:
        """Return the best course through a sample; None if no step leads on from a point of it."""
        last = len(self._ahead.cost) - 1
        on = _course(v, self._ahead, self._steps)
        back = _course(last - v, self._behind, self._steps)
        if on is None or back is None:
            return None
        one, other = (np.append(last - b[:0:-1], a) for a, b in zip(on[:2], back[:2], strict=True))
        return one, other, np.append(back[2][:0:-1], on[2])

    def _course(self, one: Ints, other: Ints, share: Array) -> Course:
        branches = self._branches
        across = wrap(branches.gamma[other] - branches.gamma[one])
        between = increments_between(branches.q[one], branches.q[other], branches.endless)
        q = branches.q[one] + share[:, None] * between
        q[1:] = q[0] + np.cumsum(increments(q, branches.endless), axis=0)
        gamma = np.unwrap(branches.gamma[one] + share * across)
        return Course(gamma, q, branches.posture[one])


def _same(one: Array, other: Array, within: float = SAME_COURSE) -> bool:
    """Return whether gammas differ by too little, rad, to belong to two courses."""
    return bool(np.abs(wrap(one - other)).max() < within)


def _course(v: int, direction: _Direction, steps: Steps) -> _Points | None:
    """Return the best course from a sample to the last node of a direction."""
    targets, cost, values = direction
    k = int(np.searchsorted(targets.start, v, side="right")) - 1
    K = len(targets.start) - 1 - k
    here = np.array([v])
    if K == 1:
        return here, here, np.zeros(1)
    part = targets._replace(start=targets.start[k:], begin=targets.begin[k:], half=targets.half[k:])
    beam = Beam(
        np.empty((K, 1), np.int64), np.empty((K, 1)), np.empty((K, 1), np.int64), np.empty((K, 1)),
        np.zeros(K, np.int64),
    )  # fmt: skip
    change = freeze(np.full(targets.q.shape[1], ANY_CHANGE))
    if advance(part, steps, cost, values, change, NO_TABLE, here, Alike(1.0, 1.0), beam) < K:
        return None
    at = beam.at[1:, 0]
    one, other = (np.append(here, ends[at]) for ends in (targets.one, targets.other))
    return one, other, np.append(0.0, beam.share[1:, 0])


def _reversed(ahead: _Direction, steps: Steps) -> _Direction:
    """Return the same problem from its last node to its first."""
    targets = ahead.targets
    N, layers = len(targets.q), np.diff(targets.begin)[::-1]
    order = np.concatenate(
        [np.arange(a, b) for a, b in zip(targets.begin[-2::-1], targets.begin[:0:-1], strict=True)]
    )
    back = Targets(
        freeze(np.ascontiguousarray(targets.q[::-1])),
        freeze(np.ascontiguousarray(N - targets.start[::-1])),
        N - 1 - targets.one[order],
        N - 1 - targets.other[order],
        np.append(0, np.cumsum(layers)),
        targets.key[order],
        np.ascontiguousarray(targets.half[::-1]),
        targets.joint,
        targets.endless,
    )
    cost = freeze(np.ascontiguousarray(ahead.cost[::-1]))
    return _Direction(back, cost, values_to(back, steps, cost))
