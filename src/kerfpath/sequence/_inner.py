"""Which contours lie inside which: what is cut out must not fall before its holes are cut."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kerfpath._arrays import Array, Bools
from kerfpath.contour import Contour

__all__ = ["inner_first"]

COMMON = 0.1
"""Length of a mean of unit vectors from which on they have a direction in common."""


def inner_first(contours: Sequence[Contour]) -> list[tuple[int, int]]:
    """Return the pairs (i, j) of contours of which i lies inside the closed contour j.

    Seen along the mean tool axis of j; both must lie on one side of the part, their mean axes less
    than 90 deg apart. Open contours hold nothing: ask for the loops of the drawing, before their
    leads. Neither does a loop around a tube, whose axes have no common direction.
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
            # For most the first point is enough: they lie far beside.
            if faces and _inside(ring, at[:1])[0] and _inside(ring, at).all():
                pairs.append((i, j))
    return pairs


def _inside(ring: Array, points: Array) -> Bools:
    """Say which points (B, 2) lie inside a ring (K, 2): a ray to the right crosses it oddly."""
    a, b = ring[:-1], ring[1:]
    above = a[:, 1] > points[:, None, 1], b[:, 1] > points[:, None, 1]
    rise = np.where(b[:, 1] == a[:, 1], 1.0, b[:, 1] - a[:, 1])
    at = a[:, 0] + (points[:, None, 1] - a[:, 1]) / rise * (b[:, 0] - a[:, 0])
    crossed = (above[0] != above[1]) & (points[:, None, 0] < at)
    return np.asarray(crossed.sum(axis=1) % 2 == 1)
