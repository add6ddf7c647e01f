"""Test whether points are inside a closed surface, by the triangles that an upward line crosses.

Triangles are sorted into columns along z, so that a line meets only a few of them. If it passes too
close to an edge, the winding number over all triangles decides: the solid angle of the surface is a
full one from inside and zero from outside (van Oosterom and Strackee 1983).
"""

from __future__ import annotations

import numpy as np

from kerfpath._arrays import Array, Ints

__all__ = ["TriangleColumns"]

CLOSE = 1e-9
"""Twice the area of a triangle that is too thin to count, as a share of the body's size squared."""
MOST = 256
"""Largest number of columns along x and along y."""
SPREAD = 64
"""Columns that a triangle may be in on average; with wide triangles there are fewer columns."""


class TriangleColumns:
    """Triangles with corners (F, 3, 3) m, sorted into columns by x and y."""

    def __init__(self, corners: Array) -> None:
        self._corners = corners
        self.low, self.high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
        size = self.high - self.low
        self._close = CLOSE * float(size.max()) ** 2
        n = int(np.clip(np.sqrt(len(corners)), 1, MOST))
        while True:
            self._n, self._step = n, np.maximum(size[:2] / n, 1e-300)
            first = self._column(corners[..., :2].min(axis=1))
            wide = self._column(corners[..., :2].max(axis=1)) - first + 1
            count = wide.prod(axis=1)
            if count.sum() <= SPREAD * len(corners):  # as it is with n = 1 at the latest
                break
            n //= 2
        triangle = np.repeat(np.arange(len(corners)), count)
        place = np.arange(len(triangle)) - np.repeat(np.cumsum(count) - count, count)
        x, y = first[triangle].T + np.divmod(place, wide[triangle, 1])
        key = x * n + y
        order = np.argsort(key, kind="stable")
        self._triangle = triangle[order]
        self._start = np.searchsorted(key[order], np.arange(n * n + 1))

    def contains(self, point: Array) -> bool:
        """Return whether a point (3,) m that is not on the surface lies inside."""
        if not ((point > self.low) & (point < self.high)).all():
            return False
        x, y = self._column(point[:2])
        a, b = self._start[x * self._n + y : x * self._n + y + 2]
        corners = self._corners[self._triangle[a:b]] - point
        (ax, ay, az), (bx, by, bz), (cx, cy, cz) = np.moveaxis(corners, 0, 2)
        areas = np.array([bx * cy - by * cx, cx * ay - cy * ax, ax * by - ay * bx])
        least, most = areas.min(axis=0), areas.max(axis=0)
        over, under = least > self._close, most < -self._close
        if (((least > -self._close) & ~over) | ((most < self._close) & ~under)).any():
            return self._winds(point)
        hit = over | under
        height = (areas * np.array([az, bz, cz])).sum(axis=0)[hit] / areas.sum(axis=0)[hit]
        return bool(np.where(over[hit], 1, -1)[height > 0].sum() != 0)

    def _column(self, xy: Array) -> Ints:
        column = ((xy - self.low[:2]) / self._step).astype(np.int64)
        return np.asarray(np.clip(column, 0, self._n - 1))

    def _winds(self, point: Array) -> bool:
        a, b, c = np.moveaxis(self._corners - point, 1, 0)
        la, lb, lc = (np.linalg.norm(x, axis=1) for x in (a, b, c))
        volume = (a * np.cross(b, c)).sum(1)
        base = la * lb * lc + (a * b).sum(1) * lc + (b * c).sum(1) * la + (c * a).sum(1) * lb
        turns = np.arctan2(volume, base).sum() / (2 * np.pi)
        return not abs(turns) < 0.5
