"""Relaxations for a graph without a path: the exact least one of each limit on its own."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from kerfpath.arrays import short_repr
from kerfpath.errors import NoFeasiblePath
from kerfpath.search.least_interval import (
    LeastInterval,
    aim_at_least_time,
    find_least_interval,
    quickest,
)
from kerfpath.search.problem import SearchProblem, change_table
from kerfpath.search.shortest import find_shortest

LARGEST_ETA_V = 2.0
"""Largest eta_v that is tried; no robot exceeds its velocity limits by more."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Relaxations:
    """The least change of each limit with which a path exists, with the other limits unchanged.

    Parameters
    ----------
    eta_v : float or None
        Least share of the velocity limits; None if no share up to 2 gives a path.
    eta_a : float or None
        Least share of the acceleration limits; None if the velocity limits alone leave no path.
    slower : LeastInterval
        Least node interval, and the limit that binds there.
    """

    eta_v: float | None
    eta_a: float | None
    slower: LeastInterval

    __repr__ = short_repr

    @property
    def dt(self) -> float:
        """Least node interval, s."""
        return self.slower.dt


def find_relaxations(problem: SearchProblem) -> Relaxations:
    """Return the least eta_v, eta_a and dt, each on its own, with which a path exists.

    Each is the exact solution of a second-order minimax problem on the graph.

    Parameters
    ----------
    problem : SearchProblem
        As in `find_least_interval`.

    Raises
    ------
    NoFeasiblePath
        A layer is empty, so no limit helps.
    InputError
        As `find_least_interval`.
    """
    slower = find_least_interval(problem)
    # Velocity limits unchanged; of all paths the one whose sharpest change needs the least time.
    velocity, limits = problem.aim.velocity, problem.limits
    changes = aim_at_least_time(
        np.zeros(len(velocity)), limits.acceleration.bound, change_table(limits)
    )
    sharpest = quickest(problem.layers, changes, velocity, np.inf)
    return Relaxations(
        eta_v=_least_eta_v(problem),
        eta_a=None if sharpest is None else (sharpest[1] / problem.dt) ** 2,
        slower=slower,
    )


def _least_eta_v(problem: SearchProblem) -> float | None:
    """Return the least eta_v with which a path exists; None if it is above `LARGEST_ETA_V`."""
    limits, tried = problem.limits, problem.limits.velocity.share
    while True:
        # Within the share tried, the share needed is a Chebychev distance to be minimised.
        asked = replace(
            problem,
            limits=replace(limits, velocity=replace(limits.velocity, share=tried)),
            weights=1.0 / (limits.velocity.bound * problem.dt),
            metric="chebychev",
            objective="max",
        )
        try:
            return find_shortest(asked).cost
        except NoFeasiblePath:
            if tried >= LARGEST_ETA_V:
                return None
            tried = min(2 * tried, LARGEST_ETA_V)
