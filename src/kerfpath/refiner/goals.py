"""Criteria of a motion that a refinement trades: each has a price, and a value it may not exceed.

Where they take the place of the objective, the sum of the prices times the criteria is minimised,
and none gets worse than its largest value. The least of such a sum is Pareto optimal (Benson, J.
Optim. Theory Appl. 26, 1978), whichever prices there are, so long as none is zero.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from kerfpath.arrays import Array, freeze, short_repr
from kerfpath.refiner.rates import RateLimits

GoalKind = Literal["way", "step", "span", "turn", "velocity", "acceleration", "interval"]
"""Weighted sum of the ways (7) of the joints; largest weighted increment (8); weighted sum of the
ranges (9); range of gamma; largest share of the usable velocity, and of the usable acceleration;
shortest interval between nodes, as a share of theirs, at which both would be kept."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Goal:
    """A criterion with its price.

    Parameters
    ----------
    kind : str
    most : float
        Largest value.
    weight : (n,)
        Weights of the joints, for the first three kinds.
    price : float
        Above 0.
    """

    kind: GoalKind
    most: float
    weight: Array = field(default_factory=lambda: freeze(np.zeros(0)))
    price: float = 1.0

    __repr__ = short_repr

    def value(self, gamma: Array, q: Array, rates: RateLimits) -> float:
        """Return the criterion of a motion with gamma (K,) and joints (K, n) rad, not wrapped."""
        if self.kind == "turn":
            return float(np.ptp(np.unwrap(gamma)))
        if self.kind == "span":
            return float(np.ptp(q, axis=0) @ self.weight)
        if self.kind in ("velocity", "acceleration", "interval"):
            fast, sharp = (float(share.max(initial=0.0)) for share in rates.shares(q))
            either = {"velocity": fast, "acceleration": sharp}
            return either.get(self.kind, max(fast, math.sqrt(sharp)))
        moved = np.abs(np.diff(q, axis=0)) * self.weight
        return float(moved.sum() if self.kind == "way" else moved.max())
