"""Places at which a closed or open polyline meets itself."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from kerfpath._arrays import Array, Ints

__all__ = ["find_crossing"]

APART = 20.0
"""Stretches closer than this along the line, in tolerances, are neighbours and may be close."""


def find_crossing(points: Array, tolerance: float) -> Array | None:
    """Return a point (3,) where two distant stretches of a polyline meet, None if they never do.

    Parameters
    ----------
    points : (K, 3)
        Nodes; a closed polyline repeats the first at the end.
    tolerance : float
        Stretches that are this close meet.
    """
    a, b = points[:-1], points[1:]
    length = np.linalg.norm(b - a, axis=1)
    s = np.concatenate([[0.0], np.cumsum(length)])
    total = s[-1]
    is_closed = bool(np.linalg.norm(points[0] - points[-1]) <= tolerance)
    i, j = _near(points, s, tolerance)
    keep = i < j
    i, j = i[keep], j[keep]
    between = s[j] - s[i + 1]
    if is_closed:
        between = np.minimum(between, total - (s[j + 1] - s[i]))
    keep = between > APART * tolerance
    i, j = i[keep], j[keep]
    distance, place = _distance(a[i], b[i], a[j], b[j])
    if not (distance <= tolerance).any():
        return None
    return np.asarray(place[int(np.argmin(distance))])


def _near(points: Array, s: Array, tolerance: float) -> tuple[Ints, Ints]:
    """Return pairs of segments that may meet, found by cells of equal length along the line."""
    count = max(8, (len(points) - 1) // 2)
    cell = s[-1] / count
    middle = (np.arange(count) + 0.5) * cell
    middles = np.stack([np.interp(middle, s, x) for x in points.T], axis=1)
    pairs = cKDTree(middles).query_pairs(cell + tolerance, output_type="ndarray")
    same = np.arange(count)
    pairs = np.vstack([pairs, np.stack([same, same], axis=1)])
    # Segments of each cell, including those that its start and end cut.
    first = np.maximum(np.searchsorted(s, same * cell, side="right") - 1, 0)
    last = np.minimum(np.searchsorted(s, (same + 1) * cell, side="left"), len(s) - 1)
    sizes = last - first
    n, m = sizes[pairs[:, 0]], sizes[pairs[:, 1]]
    which = np.repeat(np.arange(len(pairs)), n * m)
    inside = np.arange(len(which)) - np.repeat(np.cumsum(n * m) - n * m, n * m)
    i = first[pairs[which, 0]] + inside // m[which]
    j = first[pairs[which, 1]] + inside % m[which]
    return np.minimum(i, j), np.maximum(i, j)


def _distance(p0: Array, p1: Array, q0: Array, q1: Array) -> tuple[Array, Array]:
    """Return the distances between segments, row by row, and the closest points on the first.

    Closest points of two segments: C. Ericson, Real-Time Collision Detection, section 5.1.9.
    """
    u, v, r = p1 - p0, q1 - q0, p0 - q0
    a, e, b = (u * u).sum(1), (v * v).sum(1), (u * v).sum(1)
    c, f = (u * r).sum(1), (v * r).sum(1)
    across = a * e - b * b
    parallel = across <= 1e-12 * a * e
    s = np.clip((b * f - c * e) / np.where(parallel, 1.0, across), 0.0, 1.0)
    s[parallel] = 0.0
    t = np.clip((b * s + f) / e, 0.0, 1.0)
    s = np.clip((b * t - c) / a, 0.0, 1.0)
    on_p = p0 + s[:, None] * u
    return np.asarray(np.linalg.norm(on_p - q0 - t[:, None] * v, axis=1)), on_p
