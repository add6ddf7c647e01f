"""Leave a local optimum: change gamma smoothly at random and refine again."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kerfpath import refiner
from kerfpath._arrays import Array
from kerfpath.planner._clear import ClearSearch
from kerfpath.plans import Plan

__all__ = ["shaken"]

SHAKES = (0.05, 0.1, 0.2, 0.4)
"""Largest change of gamma of each shake, rad, in this order."""
WAVES = 4
"""Number of cosines in a shake; the slower ones are larger."""
SEED = 16
"""Fixed, so that the same motion always gets the same shakes."""


def shaken(begun: Plan, finder: ClearSearch) -> Plan:
    """Return the best of a motion and its refinements from random changes of its gamma.

    If (6) binds at many nodes, there are many narrow local optima. Each shake starts from the best
    motion so far. The result keeps every limit and is clear.
    """
    rng, best = np.random.default_rng(SEED), begun
    for size in SHAKES:
        change = _smooth(rng, len(best.q), size)
        if best.settings.closure == "periodic":
            change -= np.linspace(change[0], change[-1], len(change))
        again = refiner.refine(replace(best, gamma=best.gamma + change), first=size)
        if again.done and again.plan.cost < best.cost and finder.is_clear(again.plan):
            claim = f"refined again from a change of gamma at random: cost {again.plan.cost:.6g}"
            statement = f"{begun.proof.statement}; {claim}"
            best = replace(again.plan, proof=replace(begun.proof, statement=statement))
    return best


def _smooth(rng: np.random.Generator, nodes: int, size: float) -> Array:
    """Return a random sum of slow cosines (K,) whose largest absolute value is `size`."""
    t, change = np.linspace(0, np.pi, nodes), np.zeros(nodes)
    for m in range(WAVES):
        change += rng.normal() / (1 + m) * np.cos(m * t + rng.uniform(0, 2 * np.pi))
    return np.asarray(size * change / np.abs(change).max())
