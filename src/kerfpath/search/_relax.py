"""What would open a closed way: the least relaxation of each limit on its own, exactly."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from kerfpath._arrays import bools, floats, positive, scalar
from kerfpath._told import told
from kerfpath.errors import NoFeasiblePath
from kerfpath.search._fastest import LeastInterval, least_interval, quickest, timed
from kerfpath.search._problem import offsets
from kerfpath.search._shortest import shortest_path

__all__ = ["Relaxations", "least_relaxations"]

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

    __repr__ = told

    @property
    def dt(self) -> float:
        """Least node interval, s."""
        return self.slower.dt


def least_relaxations(
    q: ArrayLike,
    start: ArrayLike,
    *,
    dt: float,
    velocity: ArrayLike,
    acceleration: ArrayLike,
    endless: ArrayLike | None = None,
    eta_v: float = 1.0,
    eta_a: float = 1.0,
) -> Relaxations:
    """Return the least eta_v, eta_a and dt, each on its own, with which a path exists.

    Each is a second-order minimax problem on the graph and exact. Arguments as in `shortest_path`.

    Raises
    ------
    NoFeasiblePath
        An empty layer, which no limit opens.
    InputError
        As `shortest_path`.
    """
    q = floats(q, "q", (None, None), copy=False)
    start, n = offsets(start, len(q)), q.shape[1]
    dt = scalar(dt, "dt", unit="s", above=0.0)
    v = positive(velocity, "velocity", (n,))
    a = positive(acceleration, "acceleration", (n,))
    turning = bools(np.zeros(n, bool) if endless is None else endless, "endless", (n,))
    slower = least_interval(
        q, start, velocity=v, acceleration=a, endless=turning, eta_v=eta_v, eta_a=eta_a
    )
    # Velocity as it is, and of all paths the one whose sharpest change asks for the least time.
    changes = timed(q, start, turning, weight=np.zeros(n), acceleration=a)
    sharpest = quickest(changes, eta_v * v * dt, np.inf)
    return Relaxations(
        eta_v=_least_eta_v(q, start, dt, v, a, turning, eta_v, eta_a),
        eta_a=None if sharpest is None else (sharpest[1] / dt) ** 2,
        slower=slower,
    )


def _least_eta_v(
    q: ArrayLike,
    start: ArrayLike,
    dt: float,
    v: ArrayLike,
    a: ArrayLike,
    endless: ArrayLike,
    eta_v: float,
    eta_a: float,
) -> float | None:
    """Return the least largest share of the velocity limits over paths that keep (6)."""
    tried = eta_v
    while True:
        try:
            # Within the share tried, the share itself is a Chebychev distance to be minimised.
            return shortest_path(
                q,
                start,
                dt=dt,
                velocity=v,
                acceleration=a,
                endless=endless,
                metric="chebychev",
                objective="max",
                eta_v=tried,
                eta_a=eta_a,
            ).cost
        except NoFeasiblePath:
            if tried >= LARGEST_ETA_V:
                return None
            tried = min(2 * tried, LARGEST_ETA_V)
