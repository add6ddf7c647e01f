"""What would open a closed way: the least relaxation of each limit on its own, exactly."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from kerfpath._repr import short_repr
from kerfpath.errors import NoFeasiblePath
from kerfpath.search._fastest import LeastInterval, aim_at_least_time, find_least_interval, quickest
from kerfpath.search._problem import SearchProblem
from kerfpath.search._shortest import find_shortest

__all__ = ["Relaxations", "find_relaxations"]

LARGEST_ETA_V = 2.0
"""Velocity limits are not raised further than this: beyond it no robot goes."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Relaxations:
    """The least change of each limit with which a path exists, the other limits as they are.

    Parameters
    ----------
    eta_v : float or None
        Least share of the velocity limits; None where no share up to 2 opens the way.
    eta_a : float or None
        Least share of the acceleration limits; None where velocity alone closes the way.
    slower : LeastInterval
        Least node interval, and what binds there.
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

    Each is a second-order minimax problem on the graph and exact.

    Parameters
    ----------
    problem : SearchProblem
        As in `find_least_interval`.

    Raises
    ------
    NoFeasiblePath
        An empty layer, which no limit opens.
    InputError
        As `find_least_interval`.
    """
    slower = find_least_interval(problem)
    # Velocity as it is, and of all paths the one whose sharpest change asks for the least time.
    velocity, limits = problem.aim.velocity, problem.limits
    changes = aim_at_least_time(np.zeros(len(velocity)), limits.acceleration.bound)
    sharpest = quickest(problem.layers, changes, velocity, np.inf)
    return Relaxations(
        eta_v=_least_eta_v(problem),
        eta_a=None if sharpest is None else (sharpest[1] / problem.dt) ** 2,
        slower=slower,
    )


def _least_eta_v(problem: SearchProblem) -> float | None:
    """Return the least largest share of the velocity limits over paths that keep (6)."""
    limits, tried = problem.limits, problem.limits.velocity.share
    while True:
        # Within the share tried, the share itself is a Chebychev distance to be minimised.
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
