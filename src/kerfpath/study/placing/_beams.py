"""Estimate how fast nodes can be cut over continuous gamma, by beams without refinement."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from kerfpath._arrays import Array, Bools
from kerfpath._repr import short_repr
from kerfpath.cell import CollisionChecker
from kerfpath.graph import LayeredGraph
from kerfpath.kernels.metric import increments
from kerfpath.limits import Limits, rates_of
from kerfpath.planner import samples_of
from kerfpath.search import (
    ContinuousPath,
    ContinuousSearch,
    Effort,
    SearchProblem,
)

__all__ = ["Beams"]

EFFORT = Effort(200, (0.5, 0.5))
"""States kept in each layer. On nine placements of two contours of the demo, paths were 0 to 6 %
slower than the fastest motion found, and eight times as many states did not improve that."""
LONGER, CLOSE = 1.3, 1.01
"""Factor between speeds tried until one is too high, and factor by which the answer may be off."""
HELD = 1e-3
"""Share by which a path may be slower than the speed asked for."""
MOST_SEARCHES = 10
"""Number of searches for a path that is clear at the samples next to it."""


@dataclass(kw_only=True, eq=False)
class Beams:
    """A search for the fastest path by beams; in a cell it is clear at the samples next to it.

    Parameters
    ----------
    graph : LayeredGraph
        A graph without empty layers.
    limits : Limits
    endless : (n,) bool
    checker : CollisionChecker or None
        Checks the vertices of the graph.
    """

    graph: LayeredGraph
    limits: Limits
    endless: Bools
    checker: CollisionChecker | None = None
    cost: Array = field(init=False)

    __repr__ = short_repr

    def __post_init__(self) -> None:
        self.cost = np.zeros(len(self.graph.q))

    def least_interval(self, held: float, enough: float | None = None) -> float:
        """Return an estimate of the least interval between the nodes, s.

        Joints between two samples are interpolated and no other starts are tried, so true motions
        may be faster or slower.

        Parameters
        ----------
        held : float s
            An interval for which there is a path.
        enough : float s, optional
            An interval that is short enough.
        """
        best = held
        if enough is not None and enough < held:
            best = min(best, self._interval(enough))
            if best <= enough * (1 + HELD):
                return best
        missed = enough
        while missed is None or best > CLOSE * missed:
            tried = best / LONGER if missed is None else np.sqrt(best * missed)
            found = self._interval(tried)
            if found > tried * (1 + HELD):
                missed = tried
            best = min(best, found)
        return best

    def _interval(self, asked: float) -> float:
        """Return the interval needed by a path searched for `asked`; infinite without a path."""
        path = self._path(asked)
        if path is None:
            return np.inf
        v, a = rates_of(increments(path.q, self.endless), np.ones(len(path.q) - 1))
        fast = (np.abs(v) / self.limits.velocity.usable).max(initial=0.0)
        sharp = (np.abs(a) / self.limits.acceleration.usable).max(initial=0.0)
        return float(max(fast, np.sqrt(sharp)))

    def _path(self, dt: float) -> ContinuousPath | None:
        problem = SearchProblem(
            q=self.graph.q, start=self.graph.start, dt=dt, limits=self.limits,
            endless=self.endless, weights=1 / self.limits.velocity.bound, metric="manhattan",
        )  # fmt: skip
        samples = samples_of(self.graph)
        for _ in range(MOST_SEARCHES):
            search = ContinuousSearch(replace(problem, vertex_cost=self.cost.copy()), samples)
            path = next(search.paths(EFFORT), None)
            if path is None or self.checker is None:
                return path
            ends = np.unique(np.concatenate([path.one, path.other]))
            blocked = ends[~np.isfinite(self.checker.price(ends))]
            if not blocked.size:
                return path
            self.cost[blocked] = np.inf
        return None
