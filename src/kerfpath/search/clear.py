"""The best clear path, checking only the vertices and edges that the search would use.

Vertices and edges that have not been checked count as clear and free of cost, so the best path of a
search is a lower bound; once everything on it has been checked, it is the best of all. Vertices and
edges found closed are removed and the search runs again. The result is the same as if everything
were checked, with few checks.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike

from kerfpath.arrays import Array, Bools, Ints, integers
from kerfpath.errors import InputError, NoFeasiblePath
from kerfpath.kernels.metric import increments_between
from kerfpath.losses import Loss, Reason
from kerfpath.progress import may_stop
from kerfpath.search.least_interval import LeastInterval
from kerfpath.search.pieces import InterruptedPath
from kerfpath.search.problem import SearchProblem, offsets
from kerfpath.search.shortest import LayeredPath
from kerfpath.search.slowed import SlowedPath

Price = Callable[[Ints], Array]
Passable = Callable[[Ints, Ints], Bools]
FoundPath = LayeredPath | SlowedPath | InterruptedPath | LeastInterval
_P = TypeVar("_P", bound=FoundPath)

LIKELY, OPEN, CLOSED = 1, 2, 3
"""Knowledge about an edge: not seen to be closed (by the quick test), passable, or closed."""

FIRST_ASKED = 8
"""Size of the first batch of vertices of a layer that is checked to find an open one."""
WIDEST = 16
"""Most rings around a closed edge that are checked."""


class CheckedEdges:
    """Vertices and edges of a graph that have been checked, shared by successive searches.

    Parameters
    ----------
    q : (N, n) rad
    start : (K+1,) int
        As in `shortest_path`.
    price : callable
        Takes vertices (B,) int, rows of q, and returns the cost of each on top of its
        `vertex_cost`, (B,), not negative; infinite if it is closed. The answers must not change.
    passable : callable
        Takes vertices (B,) and vertices (B,) of the next layer, and returns which edges may be
        used, (B,) bool.
    blocked : callable, optional
        Takes the same, and returns for which edges a quick test shows that they may not be used.
    around : (N, 2) int, optional
        Neighbours of each vertex that are likely to be closed with it, -1 for none. They are
        checked, too, outwards until one is open. Around a closed edge, the edges between neighbours
        of its ends are tested with `blocked`. This saves searches and changes nothing else.

    Attributes
    ----------
    searches : int
        Number of searches so far.

    Raises
    ------
    InputError
        `start` or `around` does not fit the vertices.
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
        """Number of vertices that were checked."""
        return int(self._asked.sum())

    @property
    def vertices_closed(self) -> int:
        """Number of vertices found closed."""
        return int(np.isinf(self.cost).sum())

    @property
    def edges_checked(self) -> int:
        """Number of edges known to be passable or closed."""
        return int((self._state >= OPEN).sum())

    @property
    def edges_closed(self) -> int:
        """Number of edges found closed."""
        return int((self._state == CLOSED).sum())

    @property
    def shut(self) -> Ints:
        """The edges (E, 2) found closed."""
        return np.stack(np.divmod(self._edges[self._state == CLOSED], len(self.q)), axis=1)

    def learn(self, runs: list[Ints], near: Passable) -> bool:
        """Check the unchecked parts of a path; return False if all of it is clear and free of cost.

        Parameters
        ----------
        runs : list of (m,) int
            Vertices of successive layers, one array for each piece of the path.
        near : callable
            Takes vertices (B,) and (B,) of the next layer, and returns which edges a search might
            use.
        """
        self.searches += 1
        if self._look_at_vertices(np.concatenate(runs)):
            return True
        edges = np.concatenate([np.stack([run[:-1], run[1:]], axis=1) for run in runs])
        return self._look_at_edges(edges, near)

    def learn_vertices(self, vertices: Ints) -> bool:
        """Check vertices, and neighbours of closed ones; return True if one of them is closed."""
        self.searches += 1
        self._look_at_vertices(vertices)
        return bool(np.isinf(self.cost[vertices]).any())

    def open_run(self, vertices: Ints, side: int, most: int) -> Ints:
        """Return the number of successive open neighbours of vertices (B,) on a side, up to `most`.

        `side` is the column of `around`; unchecked neighbours are checked.
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
        """Check the unchecked vertices of a path; return True if one of them has a cost."""
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
        """Ask for the price of unchecked vertices; return those of them that have a cost."""
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
        """Check the unchecked edges of a path; return True if one is closed.

        The more often edges of a layer were closed, the wider the edges around a closed one are
        checked.
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
        """Return the vertices (B, 2 steps + 1) up to `steps` neighbours away, -1 beyond the end."""
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
        """Return which edges (B, 2) are closed; edges that `ask` passes get at least `verdict`."""
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
        """Return the layers without an open vertex, and the number of layers that were decided.

        Layers are checked from the first on, until `most` vertices have been checked.
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
        """Return an answer without a path, with the collisions that contribute to it."""
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
        message = f"no admissible edge to node {there} is clear; forbidden by {reasons}"
        if elsewhere in ways:
            message = f"{broken}, {elsewhere}: {ways[elsewhere]}"
        return broken.with_message(message, counts)


def find_clear(
    search: Callable[[SearchProblem], _P], problem: SearchProblem, known: CheckedEdges
) -> _P:
    """Return the exact best path of a search through open vertices and passable edges.

    Parameters
    ----------
    search : callable
        `find_shortest`, `find_slowed`, `find_interrupted` or `find_least_interval`.
    problem : SearchProblem
    known : CheckedEdges
        Checked vertices and edges of its graph; it is extended.

    Raises
    ------
    NoFeasiblePath
        There is no clear path, which is proved; the counts include what was found closed.
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
    """Return a function that finds edges within the velocity limit; all, for a least interval."""
    bound = np.inf if isinstance(found, LeastInterval) else problem.aim.velocity

    def near(p: Ints, j: Ints) -> Bools:
        dq = increments_between(problem.q[p], problem.q[j], problem.endless)
        return np.asarray((np.abs(dq) <= bound).all(axis=1))

    return near
