"""The best path that is clear, looking only at what the search wants to use.

Whatever has not been looked at counts as clear and free of charge, so the best path of a search is
a lower bound; where all it uses has been looked at, it is the best of all. What is found closed is
taken out of the graph and the search runs again: the optimum of checking everything, at a few
checks.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike

from kerfpath._arrays import Array, Bools, Ints, integers
from kerfpath.errors import InputError, NoFeasiblePath
from kerfpath.kernels.metric import increments_between
from kerfpath.losses import Loss, Reason
from kerfpath.progress import may_stop
from kerfpath.search._fastest import LeastInterval
from kerfpath.search._interrupted import InterruptedPath
from kerfpath.search._problem import SearchProblem, offsets
from kerfpath.search._shortest import LayeredPath
from kerfpath.search._slowed import SlowedPath

__all__ = ["CheckedEdges", "FoundPath", "find_clear"]

Price = Callable[[Ints], Array]
Passable = Callable[[Ints, Ints], Bools]
FoundPath = LayeredPath | SlowedPath | InterruptedPath | LeastInterval
_P = TypeVar("_P", bound=FoundPath)

LIKELY, OPEN, CLOSED = 1, 2, 3
"""What is known of an edge: not seen to be closed, passable, or closed."""

FIRST_ASKED = 8
"""Vertices of a layer that are asked about at once to find an open one, to begin with."""
WIDEST = 16
"""Rings around a closed edge that are looked at, at most."""


class CheckedEdges:
    """What has been found out about a graph, for one search after another.

    Parameters
    ----------
    q : (N, n) rad
    start : (K+1,) int
        As in `shortest_path`.
    price : callable
        Given vertices (B,) int, rows of q: what each costs on top of its `vertex_cost`, (B,), not
        negative; infinite where it is closed. It must always answer the same.
    passable : callable
        Given vertices (B,) and vertices (B,) of the next layer: which edges may be used, (B,) bool.
    blocked : callable, optional
        Given the same: of which edges it is seen at little cost that they may not.
    around : (N, 2) int, optional
        Neighbours of each vertex that are likely to be closed with it, -1 for none: they are looked
        at, too, outwards until one is open. Around a closed edge, those between neighbours of its
        ends are asked whether they are `blocked`. It saves searches and changes nothing else.

    Attributes
    ----------
    searches : int
        How often a search ran.
    """

    def __init__(
        self,
        q: ArrayLike,
        start: ArrayLike,
        *,
        price: Price,
        passable: Passable,
        blocked: Passable | None = None,
        around: ArrayLike | None = None,
    ) -> None:
        self.q = np.asarray(q, dtype=np.float64)
        N = len(self.q)
        self.start = offsets(start, N)
        self._layer = np.searchsorted(self.start, np.arange(N), side="right") - 1
        self._price, self._passable, self._blocked = price, passable, blocked
        self._around = None if around is None else integers(around, "around", (N, 2))
        self.cost, self._asked = np.zeros(N), np.zeros(N, bool)
        self._edges, self._state = np.empty(0, np.int64), np.empty(0, np.int64)
        self._hits = np.zeros(len(self.start), np.int64)
        self.searches = 0

    @property
    def vertices_checked(self) -> int:
        """How many vertices were asked about, each once."""
        return int(self._asked.sum())

    @property
    def vertices_closed(self) -> int:
        """How many vertices were found closed."""
        return int(np.isinf(self.cost).sum())

    @property
    def edges_checked(self) -> int:
        """How many edges are known to be passable or closed."""
        return int((self._state >= OPEN).sum())

    @property
    def edges_closed(self) -> int:
        """How many edges were found closed."""
        return int((self._state == CLOSED).sum())

    @property
    def shut(self) -> Ints:
        """The edges (E, 2) found closed."""
        return np.stack(np.divmod(self._edges[self._state == CLOSED], len(self.q)), axis=1)

    def learn(self, runs: list[Ints], near: Passable) -> bool:
        """Ask for what is not known of a path; False where all of it is clear and free.

        Parameters
        ----------
        runs : list of (m,) int
            Vertices of successive layers.
        near : callable
            Given vertices (B,) and (B,) of the next layer, which edges a search might use.
        """
        self.searches += 1
        if self._look_at_vertices(np.concatenate(runs)):
            return True
        edges = np.concatenate([np.stack([run[:-1], run[1:]], axis=1) for run in runs])
        return self._look_at_edges(edges, near)

    def learn_vertices(self, vertices: Ints) -> bool:
        """Ask for what is not known of vertices, and about; True where one of them is closed."""
        self.searches += 1
        self._look_at_vertices(vertices)
        return bool(np.isinf(self.cost[vertices]).any())

    def open_run(self, vertices: Ints, side: int, most: int) -> Ints:
        """Return how many neighbours of vertices (B,) on a side are open in a row, `most` at most.

        side: column of `around`; what is not known of them is asked for.
        """
        assert self._around is not None
        run, front = np.zeros(len(vertices), np.int64), vertices
        for _ in range(most):
            front = np.where(front >= 0, self._around[front, side], -1)
            there = np.flatnonzero(front >= 0)
            self._ask(front[there])
            front[there[np.isinf(self.cost[front[there]])]] = -1
            run += front >= 0
        return run

    def _look_at_vertices(self, vertices: Ints) -> bool:
        """Ask for what is not known of a path's vertices; True where one costs something."""
        dearer = self._ask(vertices)
        closed = dearer[np.isinf(self.cost[dearer])]
        if self._around is not None:
            for side in range(2):
                front = closed
                for _ in range(2**self.searches):
                    front = self._around[front, side]
                    front = front[front >= 0]
                    if not front.size:
                        break
                    self._ask(front)
                    front = front[np.isinf(self.cost[front])]
        return bool(dearer.size)

    def _ask(self, vertices: Ints) -> Ints:
        """Learn the price of vertices; returns those now known to cost something."""
        may_stop()
        new = np.unique(vertices[~self._asked[vertices]])
        if not new.size:
            return new
        price = np.asarray(self._price(new), dtype=np.float64)
        if price.shape != new.shape or not (price >= 0).all():
            raise InputError(
                f"price: expected one number >= 0 for each of {len(new)} vertices, got "
                f"{'another shape' if price.shape != new.shape else 'a negative one or NaN'}"
            )
        self._asked[new], self.cost[new] = True, price
        return new[price > 0]

    def _look_at_edges(self, edges: Ints, near: Passable) -> bool:
        """Ask for what is not known of a path's edges; True where one is closed.

        Around closed ones it looks the wider, the more often edges of that layer were closed.
        """
        closed = edges[self._closed(edges, self._passable, OPEN)]
        self._hits[np.unique(self._layer[closed[:, 0]])] += 1
        core, ring = closed, 1
        while core.size and self._around is not None and self._blocked is not None:
            sides = [self._beside(core[:, end], ring) for end in range(2)]
            step = np.abs(np.arange(-ring, ring + 1))
            here, there = np.nonzero(np.maximum(step[:, None], step) == ring)
            pairs = np.stack([sides[0][:, here], sides[1][:, there]], axis=2)
            open_ = (pairs >= 0) & (self.cost[pairs] < np.inf)
            wanted: Bools = np.asarray(open_.all(axis=2))
            wanted[wanted] = near(*pairs[wanted].T)
            hit = np.zeros(wanted.shape, bool)
            hit[wanted] = self._closed(pairs[wanted], self._not_blocked, LIKELY)
            ring += 1
            wide = np.minimum(2.0 ** (self._hits[self._layer[core[:, 0]]] - 1), WIDEST)
            core = core[hit.any(axis=1) & (ring <= wide)]
        return bool(closed.size)

    def _beside(self, vertices: Ints, steps: int) -> Ints:
        """Return the vertices (B, 2 steps + 1) up to so many neighbours away, -1 beyond the end."""
        assert self._around is not None
        out = np.full((len(vertices), 2 * steps + 1), -1)
        out[:, steps] = vertices
        for side, way in ((0, -1), (1, 1)):
            for i in range(steps):
                v = out[:, steps + way * i]
                out[:, steps + way * (i + 1)] = np.where(v >= 0, self._around[v, side], -1)
        return out

    def _not_blocked(self, p: Ints, j: Ints) -> Bools:
        assert self._blocked is not None
        return np.asarray(~np.asarray(self._blocked(p, j), dtype=np.bool_))

    def _closed(self, edges: Ints, ask: Passable, verdict: int) -> Bools:
        """Return which edges (B, 2) are closed, `ask` giving the others at least the verdict."""
        key = edges[:, 0] * len(self.q) + edges[:, 1]
        new = np.setdiff1d(key, self._edges[self._state >= verdict])
        if new.size:
            passed = np.asarray(ask(*np.divmod(new, len(self.q))), dtype=np.bool_)
            old = ~np.isin(self._edges, new)
            edges, state = self._edges[old], self._state[old]
            at = np.searchsorted(edges, new)
            self._edges = np.insert(edges, at, new)
            self._state = np.insert(state, at, np.where(passed, verdict, CLOSED))
        return np.asarray(self._state[np.searchsorted(self._edges, key)] == CLOSED)

    def closed_layers(self, most: int) -> tuple[list[int], int]:
        """Return the layers that hold no open vertex, and how many layers that is settled of.

        Layer by layer from the first, until `most` vertices have been asked about.
        """
        closed: list[int] = []
        for k in range(len(self.start) - 1):
            layer = np.arange(self.start[k], self.start[k + 1])
            if (self._asked[layer] & np.isfinite(self.cost[layer])).any():
                continue
            unknown = np.random.default_rng(k).permutation(layer[~self._asked[layer]])
            at, batch = 0, FIRST_ASKED
            while at < len(unknown):
                if most <= 0:
                    return closed, k
                some = unknown[at : at + min(batch, most)]
                self._ask(some)
                at, batch, most = at + len(some), 4 * batch, most - len(some)
                if np.isfinite(self.cost[some]).any():
                    break
            else:
                closed.append(k)
        return closed, len(self.start) - 1

    def explain(self, broken: NoFeasiblePath) -> NoFeasiblePath:
        """Return a break with what collision has to do with it."""
        counts = dict(broken.counts)
        counts.pop(Reason(Loss.CLOSED), None)
        there, closed = broken.node + 1, np.isinf(self.cost)
        ways = {
            Reason(Loss.COLLISION, "at the node"): int(closed[self._layer == there].sum()),
            Reason(Loss.COLLISION, "on the way"): counts.pop(Reason(Loss.SHUT), 0),
        }
        elsewhere = Reason(Loss.COLLISION, "elsewhere")
        if not broken.counts or not any(ways.values()):
            ways = {elsewhere: self.vertices_closed + self.edges_closed}
        if not any(ways.values()):
            return broken
        counts |= {name: number for name, number in ways.items() if number}
        reasons = ", ".join(f"{name}: {number}" for name, number in counts.items())
        message = f"no admissible way to node {there} that is clear; forbidden by {reasons}"
        if elsewhere in ways:
            message = f"{broken}, {elsewhere}: {ways[elsewhere]}"
        return broken.with_message(message, counts)


def find_clear(
    search: Callable[[SearchProblem], _P], problem: SearchProblem, known: CheckedEdges
) -> _P:
    """Return the best path of a search through open vertices and passable edges alone, exactly.

    Parameters
    ----------
    search : callable
        `find_shortest`, `find_slowed`, `find_interrupted` or `find_least_interval`.
    problem : SearchProblem
    known : CheckedEdges
        What is known of its graph; it learns more.

    Raises
    ------
    NoFeasiblePath
        Proved: what is closed was found closed; the counts say how much.
    InputError
        As the search; another method; a price that is negative or not a number.
    """
    if problem.method != "exact":
        raise InputError(f'method: only "exact" finds the best clear path, got {problem.method!r}')
    while True:
        may_stop()
        cost, shut = problem.vertex_cost + known.cost, np.vstack([problem.shut, known.shut])
        try:
            found = search(replace(problem, vertex_cost=cost, shut=shut))
        except NoFeasiblePath as broken:
            raise known.explain(broken) from None
        if not known.learn(_runs(found, known.start), _near(problem, found)):
            return found


def _runs(found: FoundPath, start: Ints) -> list[Ints]:
    """Return the vertices of each piece of a path."""
    if not isinstance(found, InterruptedPath):
        return [start[:-1] + found.index]
    return [start[p.first : p.first + len(p.index)] + p.index for p in found.pieces]


def _near(problem: SearchProblem, found: FoundPath) -> Passable:
    """Return what tells which edges keep the velocity limit; at the least interval, all do."""
    bound = np.inf if isinstance(found, LeastInterval) else problem.aim.velocity

    def near(p: Ints, j: Ints) -> Bools:
        dq = increments_between(problem.q[p], problem.q[j], problem.endless)
        return np.asarray((np.abs(dq) <= bound).all(axis=1))

    return near
