"""The best path that is clear, looking only at what the search wants to use.

Whatever has not been looked at counts as clear and free of charge, so the best path of a search is
a lower bound; where all it uses has been looked at, it is the best of all. What is found closed is
taken out of the graph and the search runs again: the optimum of checking everything, at a few
checks.

A closed vertex leaves its layer. A closed edge cannot, as edges are implied by the joints; but one
more joint can keep its ends apart: at -1 on one end, at +1 on the other, at 0 on all else, with a
velocity limit that lets 1 pass and 2 not. One such gate closes all edges from a vertex; gates are
shared by layers far enough apart. Every gate is a joint for the search to compare, and edges are
closed one path at a time: where most motions between two layers hit, as with nodes too far apart
for straight joint motions, that takes long; sample the contour more finely there.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from kerfpath._arrays import Array, Bools, Ints, floats, freeze, integers, positive, scalar
from kerfpath.errors import InputError, NoFeasiblePath
from kerfpath.search._fastest import GATE_LIMIT, LeastInterval, least_interval
from kerfpath.search._layers import offsets
from kerfpath.search._shortest import LayeredPath, shortest_path

__all__ = ["ClearPath", "clear_interval", "clear_path"]

Price = Callable[[Ints], Array]
Passable = Callable[[Ints, Ints], Bools]

STANDSTILL = 1e6
"""s from node to node: so slow that no limit of a joint forbids a step."""
FEWEST_CLOSED = 4
"""Layers from which on the gates of a closed path's first and last edges do not meet."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ClearPath:
    """A best clear path, and what it took to find it.

    Parameters
    ----------
    path : LayeredPath
    searches : int
        How often the search ran.
    vertices_checked, edges_checked : int
        How many of each were asked about, each once.
    vertices_closed, edges_closed : int
        How many of them were closed.
    """

    path: LayeredPath
    searches: int
    vertices_checked: int
    vertices_closed: int
    edges_checked: int
    edges_closed: int


def clear_path(
    q: ArrayLike,
    start: ArrayLike,
    *,
    price: Price,
    passable: Passable,
    around: ArrayLike | None = None,
    **options: Any,
) -> ClearPath:
    """Return the best path through vertices that are open and edges that are passable, exactly.

    Parameters
    ----------
    q, start, **options
        As in `shortest_path`; its method must be "exact".
    price : callable
        Given vertices (B,) int, rows of q: what each costs on top of its `vertex_cost`, (B,), not
        negative; infinite where it is closed. It must always answer the same.
    passable : callable
        Given vertices (B,) and vertices (B,) of the next layer: which edges may be used, (B,) bool.
    around : (N, 2) int, optional
        Neighbours of each vertex that are likely to be closed with it, -1 for none: they are looked
        at, too, outwards until one is open. It saves searches and changes nothing else.

    Raises
    ------
    NoFeasiblePath
        Proved: what is closed was found closed; the counts say how much.
    InputError
        As `shortest_path`; another method; a price that is negative or not a number.
    """
    return _Lazy(q, start, price, passable, around, options).run()


def clear_interval(
    q: ArrayLike,
    start: ArrayLike,
    *,
    price: Price,
    passable: Passable,
    around: ArrayLike | None = None,
    **limits: Any,
) -> LeastInterval:
    """Return the least node interval in which a clear path keeps the limits, exactly.

    Parameters
    ----------
    q, start, **limits
        As in `least_interval`.
    price, passable, around
        As in `clear_path`; only prices that are infinite matter.

    Raises
    ------
    NoFeasiblePath
        No speed is low enough, proved; the counts say what is closed.
    """
    lazy = _LazyInterval(q, start, price, passable, around, limits | {"dt": STANDSTILL})
    lazy.run()
    assert lazy.least is not None
    return lazy.least


class _Lazy:
    """What is known so far, by vertex and by edge."""

    def __init__(
        self,
        q: ArrayLike,
        start: ArrayLike,
        price: Price,
        passable: Passable,
        around: ArrayLike | None,
        options: dict[str, Any],
    ) -> None:
        self.q = floats(q, "q", (None, None), copy=False)
        N, n = self.q.shape
        self.start = offsets(start, N)
        if options.get("method", "exact") != "exact":
            raise InputError(
                f'method: only "exact" finds the best clear path, got {options["method"]!r}'
            )
        self.layers, self.periodic = len(self.start) - 1, options.get("closure") == "periodic"
        self.layer = np.searchsorted(self.start, np.arange(N), side="right") - 1
        self._price, self._passable, self.options = price, passable, options
        self.around = None if around is None else integers(around, "around", (N, 2))
        self.cost, self.known, self.asked = np.zeros(N), np.zeros(N, bool), 0
        self.passed: set[tuple[int, int]] = set()
        self.closed: set[tuple[int, int]] = set()
        self.limits = _limits(n, options)

    def run(self) -> ClearPath:
        searches = 0
        while True:
            path = self._search()
            searches += 1
            vertices = self.start[:-1] + path.index
            if self._look_at_vertices(vertices, 2**searches) or self._look_at_edges(vertices):
                continue
            return ClearPath(
                path=path,
                searches=searches,
                vertices_checked=self.asked,
                vertices_closed=int(np.isinf(self.cost).sum()),
                edges_checked=len(self.passed) + len(self.closed),
                edges_closed=len(self.closed),
            )

    def _search(self) -> LayeredPath:
        """Return the best path through what is not known to be closed."""
        open_ = np.flatnonzero(np.isfinite(self.cost))
        start = np.searchsorted(open_, self.start)
        gates = self._gates()
        dt, velocity, acceleration, weights = self.limits
        m = gates.shape[1]
        eta_v, eta_a = (float(self.options.get(eta, 1.0)) for eta in ("eta_v", "eta_a"))
        endless = self.options.get("endless")
        options = self.options | {
            "dt": dt,
            "velocity": np.append(velocity, np.full(m, GATE_LIMIT / (eta_v * dt))),
            "acceleration": np.append(acceleration, np.full(m, 1e3 / (eta_a * dt**2))),
            "weights": np.append(weights, np.zeros(m)),
            "endless": None if endless is None else np.append(endless, np.zeros(m, bool)),
            "vertex_cost": (self.cost + self.options.get("vertex_cost", 0.0))[open_],
            "posture": None,
        }
        try:
            found = shortest_path(np.hstack([self.q, gates])[open_], start, **options)
        except NoFeasiblePath as broken:
            raise self._told(broken) from None
        index = open_[start[:-1] + found.index] - self.start[:-1]
        return LayeredPath(index=freeze(index), cost=found.cost, optimal=found.optimal)

    def _look_at_vertices(self, vertices: Ints, steps: int) -> bool:
        """Ask for what is not known of a path's vertices; True where one costs something."""
        dearer = self._ask(vertices)
        closed = dearer[np.isinf(self.cost[dearer])]
        if self.around is not None:
            for side in range(2):
                front = closed
                for _ in range(steps):
                    front = self.around[front, side]
                    front = front[front >= 0]
                    if not front.size:
                        break
                    self._ask(front)
                    front = front[np.isinf(self.cost[front])]
        return bool(dearer.size)

    def _ask(self, vertices: Ints) -> Ints:
        """Learn the price of vertices; returns those now known to cost something."""
        new = np.unique(vertices[~self.known[vertices]])
        if not new.size:
            return new
        price = np.asarray(self._price(new), dtype=np.float64)
        if price.shape != new.shape or not (price >= 0).all():
            raise InputError(
                f"price: expected one number >= 0 for each of {len(new)} vertices, got "
                f"{'another shape' if price.shape != new.shape else 'a negative one or NaN'}"
            )
        self.known[new], self.cost[new] = True, price
        self.asked += len(new)
        if self.periodic:
            self.cost[self._twin(new)] = price[self._has_twin(new)]
            self.known[self._twin(new)] = True
        return new[price > 0]

    def _look_at_edges(self, vertices: Ints) -> bool:
        """Ask for what is not known of a path's edges; True where one is closed."""
        edges = list(zip(vertices[:-1].tolist(), vertices[1:].tolist(), strict=True))
        new = [edge for edge in edges if edge not in self.passed]
        if not new:
            return False
        ends = np.array(new, np.int64)
        passable = np.asarray(self._passable(ends[:, 0], ends[:, 1]), dtype=np.bool_)
        self.passed |= {e for e, ok in zip(new, passable, strict=True) if ok}
        closed = {e for e, ok in zip(new, passable, strict=True) if not ok}
        if closed and self.periodic and self.layers < FEWEST_CLOSED:
            raise InputError(
                f"closure: a periodic clear path needs {FEWEST_CLOSED} layers, got {self.layers}"
            )
        self.closed |= closed
        return bool(closed)

    def _gates(self) -> Array:
        """Return the gates (N, m): joints that closed edges cannot pass."""
        columns: dict[tuple[int, int], Array] = {}
        by_layer: dict[int, list[tuple[int, int]]] = {}
        for p, j in sorted(self.closed):
            by_layer.setdefault(int(self.layer[p]), []).append((p, j))
        for k, edges in by_layer.items():
            # Signs alternate, so that the ends of one layer's gate and of the one after next agree.
            kind, sign = k % 2, (-1.0) ** (k // 2)
            if self.periodic and k in (0, self.layers - 2):
                kind, sign = (2, 1.0) if k == 0 else (3, 1.0)
            for i, (froms, tos) in enumerate(_stars(edges)):
                gate = columns.setdefault((kind, i), np.zeros(len(self.q)))
                gate[froms], gate[tos] = -sign, sign
                for ends in (froms, tos) if self.periodic else ():
                    here = np.array(ends)
                    gate[self._twin(here)] = gate[here[self._has_twin(here)]]
        return np.array(list(columns.values())).reshape(-1, len(self.q)).T

    def _has_twin(self, vertices: Ints) -> Bools:
        return np.isin(self.layer[vertices], (0, self.layers - 1))

    def _twin(self, vertices: Ints) -> Ints:
        """Return the same vertices of the first or last layer in the other one."""
        ends = vertices[self._has_twin(vertices)]
        over = self.start[-2] if self.layers > 1 else 0
        return np.where(ends < self.start[1], ends + over, ends - over)

    def _told(self, broken: NoFeasiblePath) -> NoFeasiblePath:
        """Say of a break what collision has to do with it."""
        joints = {f"velocity, joint {i + 1}" for i in range(self.q.shape[1], 1000)}
        counts = {name: number for name, number in broken.counts.items() if name not in joints}
        there, closed = broken.node + 1, np.isinf(self.cost)
        ways = {
            "collision at the node": int(closed[self.layer == there].sum()),
            "collision on the way": sum(c for name, c in broken.counts.items() if name in joints),
        }
        message = f"no admissible way to node {there} that is clear"
        if not any(ways.values()):
            elsewhere = int(closed.sum()) + len(self.closed)
            if not elsewhere:
                return broken
            return NoFeasiblePath(
                f"{broken}, collision elsewhere: {elsewhere}",
                proved=broken.proved,
                node=broken.node,
                back=broken.back,
                counts=counts | {"collision elsewhere": elsewhere},
            )
        counts |= {name: number for name, number in ways.items() if number}
        told = ", ".join(f"{name}: {number}" for name, number in counts.items())
        return NoFeasiblePath(
            f"{message}; forbidden by {told}",
            proved=broken.proved,
            node=broken.node,
            back=broken.back,
            counts=counts,
        )


class _LazyInterval(_Lazy):
    """The same for the least node interval."""

    least: LeastInterval | None = None

    def _search(self) -> LayeredPath:
        open_ = np.flatnonzero(np.isfinite(self.cost))
        start = np.searchsorted(open_, self.start)
        names = ("velocity", "acceleration", "endless", "eta_v", "eta_a")
        limits = {name: self.options[name] for name in names if name in self.options}
        try:
            found = least_interval(self.q[open_], start, gates=self._gates()[open_], **limits)
        except NoFeasiblePath:
            super()._search()  # says where the way is closed
            raise
        index = open_[start[:-1] + found.index] - self.start[:-1]
        self.least = replace(found, index=freeze(index))
        return LayeredPath(index=freeze(index), cost=found.dt, optimal=True)


def _stars(edges: list[tuple[int, int]]) -> list[tuple[list[int], list[int]]]:
    """Return the edges as sets of edges that share one end, by the side that makes fewer."""
    out: dict[int, list[int]] = {}
    into: dict[int, list[int]] = {}
    for p, j in edges:
        out.setdefault(p, []).append(j)
        into.setdefault(j, []).append(p)
    if len(out) <= len(into):
        return [([p], js) for p, js in out.items()]
    return [(ps, [j]) for j, ps in into.items()]


def _limits(n: int, options: dict[str, Any]) -> tuple[float, Array, Array, Array]:
    """Return dt, velocity, acceleration and weights, defaults filled in as in `shortest_path`."""
    dt = scalar(options["dt"], "dt", unit="s", above=0.0)
    velocity = positive(options["velocity"], "velocity", (n,))
    acceleration = positive(options["acceleration"], "acceleration", (n,))
    given = options.get("weights")
    weights = 1.0 / (velocity * dt) if given is None else floats(given, "weights", (n,))
    return dt, velocity, acceleration, weights
