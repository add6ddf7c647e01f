"""Recognise round holes among loops."""

from __future__ import annotations

import numpy as np

from kerfpath._arrays import Array

__all__ = ["diameter", "may_be_round"]

ROUND = 5e-5
"""Largest deviation (m) of a round hole from a circle."""
FLAT = 0.1
"""Largest deviation of a round hole from its mean plane, as a share of its diameter; a hole drilled
into a curved sheet deviates."""


LONG = 1.2
"""Largest ratio of the area of a circle as long as a loop to that of the loop; a square: 1.27."""


def may_be_round(length: float, area: float) -> bool:
    """Return whether a loop encloses nearly as much as a circle of the same length."""
    return length * length <= LONG * 4 * np.pi * area


def diameter(points: Array) -> float | None:
    """Return the diameter (m) of the circle through `points` (K, 3) m, or None if there is none."""
    centred = points - points.mean(axis=0)
    axes = np.linalg.svd(centred, full_matrices=False)[2]
    x, y, height = (centred @ axes.T).T
    # A circle about (a, b): x^2 + y^2 = 2 a x + 2 b y + c, linear in its three unknowns.
    a, b, c = np.linalg.lstsq(
        np.stack([2 * x, 2 * y, np.ones_like(x)], axis=1), x**2 + y**2, rcond=None
    )[0]
    radius = float(np.sqrt(max(c + a**2 + b**2, 0.0)))
    off = np.abs(np.hypot(x - a, y - b) - radius).max()
    is_round = off <= min(ROUND, radius / 20) and np.ptp(height) <= FLAT * 2 * radius
    return 2 * radius if is_round else None
