"""Explain a collision: which bodies a motion brings too close together, where and by how much."""

from __future__ import annotations

import numpy as np

from kerfpath._arrays import Array
from kerfpath.cell import Cell

__all__ = ["explain_collision"]

SAMPLES = 65
"""Number of poses of a motion that are checked."""
PAIRS = 3
"""Number of pairs of bodies that are named."""


def explain_collision(cell: Cell, corners: Array) -> str:
    """Return which bodies come nearer than allowed on straight motions through corners (m, n) rad.

    The pair that is too near at the most poses comes first; each is given with its worst place.
    """
    steps = np.linspace(0, len(corners) - 1, SAMPLES)
    at = np.arange(len(corners))
    q = np.array([np.interp(steps, at, joint) for joint in corners.T]).T
    over = cell.distances(q) - cell.required
    hits = over <= 0
    worst = np.argsort(-hits.sum(axis=0), kind="stable")[:PAIRS]
    words = []
    for p in worst[hits[:, worst].any(axis=0)]:
        one, two = cell.pair_names[int(p)]
        k = int(np.argmin(over[:, p]))
        words.append(
            f"{one!r} and {two!r} come {-over[k, p] * 1e3:.3g} mm nearer than allowed "
            f"{100 * steps[k] / steps[-1]:.0f} % of the way"
        )
    if words:
        return "; ".join(words)
    k, p = (int(i) for i in np.unravel_index(np.argmin(over), over.shape))
    one, two = cell.pair_names[p]
    return (
        f"{one!r} and {two!r} keep {over[k, p] * 1e3:.3g} mm more than required where they are "
        "nearest, which is too little to prove clearance between the poses checked"
    )
