"""Find contours that lie inside others: a piece must not fall out before its holes are cut."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kerfpath._arrays import Array, Bools
from kerfpath.contour import Contour

__all__ = ["inner_first"]

COMMON = 0.1
"""Length of the mean tool axis from which on the axes have a common direction."""


def inner_first(contours: Sequence[Contour]) -> list[tuple[int, int]]:
    """Return the pairs (i, j) of contours where i lies inside the closed contour j.

    The contours are seen along the mean tool axis of j. Both must be on the same side of the part:
    their mean axes differ by less than 90 deg. Open contours contain nothing, so pass the loops of
    the drawing without their leads. A loop around a tube, whose axes have no common direction,
    contains nothing either.
    """
    pairs = []
    for j, outer in enumerate(contours):
        if not outer.closed:
            continue
        n = outer.axes.mean(axis=0)
        if np.linalg.norm(n) < COMMON:
            continue
        x = np.cross(n, np.eye(3)[np.argmin(np.abs(n))])
        plane = np.array([x / np.linalg.norm(x), np.cross(n, x) / np.linalg.norm(np.cross(n, x))]).T
        ring = outer.points @ plane
        for i, inner in enumerate(contours):
            faces = i != j and float(inner.axes.mean(axis=0) @ n) > 0
            at = inner.points @ plane
            # The first point is enough for most contours, which are far outside.
            if faces and _inside(ring, at[:1])[0] and _inside(ring, at).all():
                pairs.append((i, j))
    return pairs


def _inside(ring: Array, points: Array) -> Bools:
    """Return which points (B, 2) are inside a ring (K, 2), by the parity of ray crossings."""
    a, b = ring[:-1], ring[1:]
    above = a[:, 1] > points[:, None, 1], b[:, 1] > points[:, None, 1]
    rise = np.where(b[:, 1] == a[:, 1], 1.0, b[:, 1] - a[:, 1])
    at = a[:, 0] + (points[:, None, 1] - a[:, 1]) / rise * (b[:, 0] - a[:, 0])
    crossed = (above[0] != above[1]) & (points[:, None, 0] < at)
    return np.asarray(crossed.sum(axis=1) % 2 == 1)
