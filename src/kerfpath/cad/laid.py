"""Curves laid on surfaces: trim curves drawn beside a face, and bores seen from outside."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from kerfpath.arrays import Array
from kerfpath.cad.curves import AROUND, Edge
from kerfpath.cad.units import MM
from kerfpath.errors import InputError
from kerfpath.operations import Surface

ITERATIONS = 30
"""Most steps along a direction until a point lies on the surface; a plane takes one."""
ON_SURFACE = 1e-7
"""Distance (mm) from the surface at which they end."""
ASKEW = 0.3
"""Least cosine between the direction and a normal of the surface."""
CHORDS, LEAST = 128, 8
"""Number of chords along an edge, and along each smooth stretch at least, from which the length is
extrapolated: to 1e-9 of it for a circle."""


class LaidEdge:
    """An edge (see `kerfpath.cad.curves.Edge`) whose points are moved onto a surface.

    Parameters
    ----------
    edge : Edge
    surface : Surface
        It projects points in m.
    way : (3,), optional
        Unit vector along which points are moved; default: to the nearest point of the surface.
    is_backward : bool
        Whether it runs the other way round than `edge`.
    """

    def __init__(
        self, edge: Edge, surface: Surface, way: Array | None = None, *, is_backward: bool = False
    ) -> None:
        self._edge, self.surface, self._way, self._is_backward = edge, surface, way, is_backward
        ends = edge.start, edge.end
        self.start, self.end = ends[::-1] if is_backward else ends

    def evaluate(self, t: Array) -> tuple[Array, Array]:
        """Return points (K, 3) mm on the surface and its outward normals (K, 3) at `t` (K,).

        Raises
        ------
        InputError
            A surface that is not met along the direction.
        """
        points = self._edge.evaluate(t)[0]
        if self._way is None:
            found, normals = self.surface.project(points * MM)
            return found / MM, normals
        for _ in range(ITERATIONS):
            foot, normals = self.surface.project(points * MM)
            facing = normals @ self._way
            if facing.min() < ASKEW:
                break
            off = ((foot / MM - points) * normals).sum(1) / facing
            points = points + off[:, None] * self._way
            if np.abs(off).max() <= ON_SURFACE:
                return points, normals
        raise InputError("the surface around a hole is not met along its axis")

    def breaks(self) -> Array:
        breaks = self._edge.breaks()
        return breaks[::-1] if self._is_backward else breaks

    @cached_property
    def _spread(self) -> Array:
        """Points (B, 4 n + 1, 3) mm along each smooth stretch, evenly in the parameter."""
        breaks = self.breaks()
        part = np.linspace(0.0, 1.0, 4 * (max(LEAST, CHORDS // (len(breaks) - 1)) // 4) + 1)
        t = breaks[:-1, None] + np.diff(breaks)[:, None] * part
        t[:, -1] = breaks[1:]
        return self.evaluate(t.ravel())[0].reshape(*t.shape, 3)

    @cached_property
    def ends(self) -> Array:
        return self._spread[[0, -1], [0, -1]]

    @cached_property
    def around(self) -> Array:
        t = np.linspace(self.start, self.end, AROUND, endpoint=False)
        return self.evaluate(t)[0]

    @cached_property
    def length(self) -> float:
        """Arc length, mm: chords of halved steps, extrapolated (Romberg)."""
        chords = [np.diff(self._spread[:, ::every], axis=1) for every in (4, 2, 1)]
        a, b, c = (float(np.linalg.norm(each, axis=2).sum()) for each in chords)
        return (64 * c - 20 * b + a) / 45

    def bounds(self) -> Array:
        points = self._spread.reshape(-1, 3)
        return np.stack([points.min(axis=0), points.max(axis=0)])
