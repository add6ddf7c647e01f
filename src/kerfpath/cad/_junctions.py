"""Decide which ends of curves continue each other where more than two meet.

If an even number of ends meet at every place, the curves bound the regions that the even-odd rule
fills. An end is continued by the one across such a region, so that loops that touch at a place are
separated there: squares drawn side by side, each with all its sides, become squares again.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kerfpath._arrays import Array, Ints
from kerfpath.cad._curves import Curve
from kerfpath.cad._sample import sample_curve

__all__ = ["encloses", "inner_point", "partners"]

NEAR = 0.02
"""Distance from a place at which curves are ordered around it, as a share of the shortest curve."""
SAMPLED = 0.05
"""Chord error of curves for enclosed regions, as a share of that distance."""
LOOK = 257
"""Number of points on a curve among which the one at that distance is searched."""


def partners(
    strokes: Sequence[Sequence[Curve]], alike: Sequence[int], place: Ints
) -> dict[int, int]:
    """Return for each end (2 k: start of stroke k, 2 k + 1: its end) the end that continues it.

    Ends without continuation are left out. These are ends that are alone and, unless an even number
    meet at every place, ends where more than two meet.

    Parameters
    ----------
    strokes : sequence of sequence of Curve
        Connected strokes.
    alike : sequence of int
        A number for each stroke, the same for those that lie on each other.
    place : (2 K,)
        A number for each end, the same for those that meet.
    """
    at: dict[int, list[int]] = {}
    for end, where in enumerate(place.tolist()):
        at.setdefault(where, []).append(end)
    is_even = all(len(ends) % 2 == 0 for ends in at.values())
    crowded = is_even and any(len(ends) > 2 for ends in at.values())
    chords = _chords(strokes) if crowded else (np.empty((0, 3)), np.empty((0, 3)))
    found: dict[int, int] = {}
    for ends in at.values():
        if len(ends) == 2:
            pairs = [(ends[0], ends[1])]
        else:
            pairs = _across(strokes, alike, place, ends, chords) if is_even else []
        for a, b in pairs:
            found[a], found[b] = b, a
    return found


def _chords(strokes: Sequence[Sequence[Curve]]) -> tuple[Array, Array]:
    """Return the chords of all curves, from (K, 3) to (K, 3), which bound the regions."""
    curves = [curve for stroke in strokes for curve in stroke]
    chord = SAMPLED * NEAR * min(curve.length for curve in curves)
    lines = [sample_curve(curve, chord, np.pi)[1] for curve in curves]
    return np.vstack([line[:-1] for line in lines]), np.vstack([line[1:] for line in lines])


def _across(
    strokes: Sequence[Sequence[Curve]],
    alike: Sequence[int],
    place: Ints,
    ends: Sequence[int],
    chords: tuple[Array, Array],
) -> list[tuple[int, int]]:
    """Return the pairs of ends at a place that have a filled region between them."""
    curves = {end: strokes[end // 2][-1 if end % 2 else 0] for end in ends}
    at = np.mean([curve.ends[end % 2] for end, curve in curves.items()], axis=0)
    near = NEAR * min(curve.length for curve in curves.values())
    angle_of: dict[tuple[int, bool], float] = {}
    keys = {}
    for end, curve in curves.items():
        # Strokes that lie on each other have opposite orders at their two ends.
        starts_here = bool(place[end] < place[end ^ 1])
        line = alike[end // 2], starts_here
        angle = angle_of.setdefault(line, _angle(curve, end % 2, at, near))
        keys[end] = angle, end if starts_here else -end
    around = sorted(ends, key=keys.__getitem__)
    angles = np.array([keys[end][0] for end in around])
    wide = np.diff(np.append(angles, angles[0] + 2 * np.pi))
    widest, count = int(np.argmax(wide)), len(around)
    middle = angles[widest] + wide[widest] / 2
    point = at + near * np.array([np.cos(middle), np.sin(middle), 0.0])
    is_filled = _crossings(chords[0] - point, chords[1] - point) % 2 == 1
    first = widest if is_filled else widest + 1
    return [(around[k % count], around[(k + 1) % count]) for k in range(first, first + count, 2)]


def _angle(curve: Curve, is_end: int, at: Array, near: float) -> float:
    """Return the direction (rad) in which a curve leaves a place (3,), at distance `near` (mm)."""
    start, stop = (curve.end, curve.start) if is_end else (curve.start, curve.end)
    points = curve.at(np.linspace(start, stop, LOOK)) - at
    away = np.linalg.norm(points[:, :2], axis=1)
    k = max(1, int(np.argmax(away >= near)))
    part = np.clip((near - away[k - 1]) / max(away[k] - away[k - 1], 1e-300), 0.0, 1.0)
    x, y, _ = points[k - 1] + part * (points[k] - points[k - 1])
    return float(np.arctan2(y, x))


def encloses(polygon: Array, point: Array) -> bool:
    """Return whether a point (3,) lies within a polygon (K, 3), both seen from above."""
    around = polygon - point
    return _crossings(around, np.roll(around, -1, axis=0)) % 2 == 1


def inner_point(polygon: Array) -> Array:
    """Return a point (3,) well inside a polygon (K, 3), seen from above."""
    levels = np.unique(polygon[:, 1])
    if len(levels) < 2:
        return np.asarray(polygon[0])
    widest = int(np.argmax(np.diff(levels)))
    level = (levels[widest] + levels[widest + 1]) / 2
    p, q = polygon, np.roll(polygon, -1, axis=0)
    crosses = (p[:, 1] > level) != (q[:, 1] > level)
    part = (level - p[crosses, 1]) / (q[crosses, 1] - p[crosses, 1])
    x = np.sort(p[crosses, 0] + part * (q[crosses, 0] - p[crosses, 0]))
    k = 2 * int(np.argmax(x[1::2] - x[::2]))
    return np.array([(x[k] + x[k + 1]) / 2, level, polygon[0, 2]])


def _crossings(p: Array, q: Array) -> int:
    """Return how many of the segments p q (K, 3) the ray from 0 along x crosses."""
    crosses = (p[:, 1] > 0) != (q[:, 1] > 0)
    (x, y), (x1, y1) = p[crosses, :2].T, q[crosses, :2].T
    return int(np.count_nonzero(x - y * (x1 - x) / (y1 - y) > 0))
