"""What the steps of a motion cost and may be, and the prices of (6)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kerfpath._arrays import Array, Bools
from kerfpath._repr import short_repr
from kerfpath.kernels.reduced import Step

__all__ = ["ROUNDED", "Steps"]

ROUNDED = 1e-14
"""Share of the largest term that a sum of one more may cost."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Steps:
    """What the steps of a motion cost and may be.

    Parameters
    ----------
    weight : (n,) 1/rad
    velocity, acceleration : (n,) rad
        Bounds (5) and (6) on an increment and on its change, tolerance included.
    metric : int
    endless : (n,) bool
    most : float
        What a step may cost at most; infinite where it may cost anything.
    """

    weight: Array
    velocity: Array
    acceleration: Array
    metric: int
    endless: Bools
    most: float = np.inf

    __repr__ = short_repr

    def over(self, intervals: int) -> Step:
        """Return the step over several intervals: no shorter than all of them together (14)."""
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
        """Return what the multipliers (K, n) take off: the most that they add where (6) holds."""
        if multipliers is None:
            return 0.0
        return float((np.abs(multipliers) @ self.acceleration).sum()) * (1 + ROUNDED)
