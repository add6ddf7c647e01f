"""Motions found from many starts, to compare a plan with where there are many local optima."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from benchmarks._certified import Task
from kerfpath import refine
from kerfpath.arrays import Array
from kerfpath.plans import Plan

__all__ = ["from_grids", "shaken"]

GRIDS = ((2.0, 0.0), (2.0, 1 / 3), (1.0, 0.0), (1.0, 1 / 3), (0.5, 0.0))
"""Steps of gamma, deg, and the share of a step by which the samples are moved."""
SHAKES = (0.02, 0.05, 0.1, 0.2, 0.4)
"""Largest change of gamma, rad."""
WAVES = 4
"""Number of cosines in the sum of a random change."""


def from_grids(task: Task) -> Iterator[Plan]:
    """Yield the refined plans of several grids."""
    for step, moved in GRIDS:
        angle = np.radians(step)
        grid = task.on_grid(gamma_step=angle)
        found = replace(grid, tool=grid.tool @ _about_beam(moved * angle)).made().plan
        if found is not None:
            yield found


def shaken(plan: Plan, rng: np.random.Generator) -> Iterator[Plan]:
    """Yield better plans, refined from smooth random changes of gamma of the best so far."""
    for size in SHAKES:
        moved = replace(plan, gamma=plan.gamma + _smooth(rng, len(plan.q), size))
        found = refine(moved, first=size)
        if found.done and found.plan.cost < plan.cost:
            plan = found.plan
            yield plan


def _smooth(rng: np.random.Generator, nodes: int, size: float) -> Array:
    """Return a sum of slow cosines (K,), at most `size` in absolute value."""
    t = np.linspace(0, np.pi, nodes)
    waves = sum(
        rng.normal() / (1 + m) * np.cos(m * t + rng.uniform(0, 2 * np.pi)) for m in range(WAVES)
    )
    return np.asarray(size * waves / np.abs(waves).max())


def _about_beam(angle: float) -> Array:
    """Return a rotation about z."""
    c, s = np.cos(angle), np.sin(angle)
    T = np.eye(4)
    T[:2, :2] = [[c, -s], [s, c]]
    return T
