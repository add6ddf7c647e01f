"""About how fast nodes can be passed over continuous gamma: by beams alone, without refinement."""

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
"""States of each layer that are kept: on nine placements of two contours of the demo paths were 0
to 6 % slower than the fastest motion found, and no nearer to it with eight times as many."""
LONGER, CLOSE = 1.3, 1.01
"""Steps up to a speed that is too high, and how close to it the answer is, as multiples."""
HELD = 1e-3
"""Share by which a path may be slower than the speed that it is to keep."""
MOST_SEARCHES = 10
"""Searches for a path that is clear at the samples that it is between."""


@dataclass(kw_only=True, eq=False)
class Beams:
    """The quickest of the paths that beams find, in a cell clear at the samples they are between.

    Parameters
    ----------
    graph : LayeredGraph
        Without an empty layer.
    limits : Limits
    endless : (n,) bool
    checker : CollisionChecker or None
        Of the vertices of the graph.
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
        """Return about the least interval between the nodes, s.

        Joints between two samples are interpolated, and no other start is looked at, so motions may
        be quicker or slower.

        Parameters
        ----------
        held : float s
            An interval that some path keeps.
        enough : float s, optional
            An interval that need not be undercut.
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
        """Return the interval that a path takes that is to keep another; infinite without one."""
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
