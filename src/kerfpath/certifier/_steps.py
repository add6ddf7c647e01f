"""Costs and limits of the steps of a motion, and the prices of (6)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kerfpath._arrays import Array, Bools
from kerfpath._repr import short_repr
from kerfpath.kernels.reduced import Step

__all__ = ["ROUNDED", "Steps"]

ROUNDED = 1e-14
"""Relative rounding error of adding one term to a sum, as a share of the largest term."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Steps:
    """Costs and limits of the steps of a motion.

    Parameters
    ----------
    weight : (n,) 1/rad
    velocity, acceleration : (n,) rad
        Bounds (5) and (6) on an increment and on its change, tolerance included.
    metric : int
        Code of the metric.
    endless : (n,) bool
    most : float
        Largest cost of a step; infinite for no limit.
    """

    weight: Array
    velocity: Array
    acceleration: Array
    metric: int
    endless: Bools
    most: float = np.inf

    __repr__ = short_repr

    def over(self, intervals: int) -> Step:
        """Return the step over several intervals, which costs at most their sum (14)."""
        velocity = intervals * self.velocity
        tilt, most = np.zeros_like(velocity), intervals * self.most
        return Step(self.weight, tilt, velocity, self.metric, self.endless, most)

    def tilted(self, multipliers: Array | None, k: int) -> Step:
        """Return the step from node k to the next, tilted by the multipliers (K, n) of (6)."""
        step = self.over(1)
        if multipliers is None:
            return step
        return step._replace(tilt=multipliers[k] - multipliers[k + 1])

    def price(self, multipliers: Array | None) -> float:
        """Return the price of the multipliers (K, n): the most that they add where (6) holds."""
        if multipliers is None:
            return 0.0
        return float((np.abs(multipliers) @ self.acceleration).sum()) * (1 + ROUNDED)
