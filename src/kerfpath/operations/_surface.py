"""Sides of a contour, and the surface that leads are laid on."""

from __future__ import annotations

from typing import Literal, Protocol, get_args

import numpy as np

from kerfpath._arrays import Array
from kerfpath.contour import Contour, unit
from kerfpath.errors import InputError

__all__ = ["Ribbon", "Side", "Surface", "lateral", "nearest"]

Side = Literal["left", "right"]
"""Seen from the nozzle along the travel."""


class Surface(Protocol):
    """A sheet's surface, healed: there also where the part has a hole or ends."""

    def project(self, points: Array) -> tuple[Array, Array]:
        """Return the nearest points (B, 3) m of the surface, and its outward normals (B, 3)."""


class Ribbon:
    """The surface as a contour tells it: the plane across the tool axis at the nearest node."""

    def __init__(self, contour: Contour) -> None:
        self._contour = contour

    def project(self, points: Array) -> tuple[Array, Array]:
        """Return the feet (B, 3) m of points on those planes, and their normals (B, 3)."""
        where, k = nearest(self._contour, points)
        axis = self._contour.axes[k]
        return points - ((points - where) * axis).sum(1, keepdims=True) * axis, -axis


def lateral(axes: Array, along: Array, side: Side) -> Array:
    """Return unit directions (K, 3) across the travel `along`, to one side.

    Raises
    ------
    InputError
        Another side than left or right.
    """
    if side not in get_args(Side):
        raise InputError(f"side: expected left or right, got {side!r}")
    across = unit(np.cross(axes, along), "side")
    return across if side == "right" else -across


def nearest(contour: Contour, points: Array) -> tuple[Array, Array]:
    """Return for points (B, 3) the nearest points (B, 3) of a contour, and the node before each."""
    start, step = contour.points[:-1], np.diff(contour.points, axis=0)
    off = points[:, None] - start
    part = np.clip((off * step).sum(2) / (step**2).sum(1), 0.0, 1.0)
    apart = np.linalg.norm(off - part[..., None] * step, axis=2)
    k = np.argmin(apart, axis=1)
    rows = np.arange(len(points))
    return start[k] + part[rows, k, None] * step[k], k
