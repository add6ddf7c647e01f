"""Sides of a contour, and the surface that leads are laid on."""

from __future__ import annotations

from typing import Literal, Protocol, get_args

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from kerfpath._arrays import Array
from kerfpath.contour import KINDS, Contour, unit
from kerfpath.errors import InputError

__all__ = [
    "IN_SCRAP",
    "Ribbon",
    "Side",
    "Surface",
    "edge",
    "lateral",
    "lay_on",
    "lean_axes",
    "nearest",
    "require_in_scrap",
]

TOUCH = 1e-5
"""m: how far a path in the scrap may lie on the part's side; a lead that is tangent to a curve
deviates from the curve's first chord by some micrometres."""
SURFACE_ENDS = 1e-3
"""m: a point farther than this from the surface has left it."""
SAME_PLACE = 1e-9
"""m: points closer than this are the same."""

IN_SCRAP = [KINDS.index(word) for word in ("pierce", "lead-in", "lead-out", "loop")]
"""Kinds of the stretches that run in the scrap."""

Side = Literal["left", "right"]
"""Side of a contour, seen from the nozzle along the direction of travel."""


class Surface(Protocol):
    """The healed surface of a sheet: it extends over holes and past the edges of the part."""

    def project(self, points: Array) -> tuple[Array, Array]:
        """Return the nearest points (B, 3) m of the surface, and its outward normals (B, 3)."""


class Ribbon:
    """A surface made from a contour: the plane across the tool axis at the nearest node."""

    def __init__(self, contour: Contour) -> None:
        self._contour = contour

    def project(self, points: Array) -> tuple[Array, Array]:
        """Return points projected onto those planes (B, 3) m, and the outward normals (B, 3)."""
        where, k = nearest(self._contour, points)
        axis = self._contour.axes[k]
        return points - ((points - where) * axis).sum(1, keepdims=True) * axis, -axis


def lay_on(surface: Surface, flat: Array, contour: Contour, what: str) -> tuple[Array, Array]:
    """Return points (B, 3) m laid on a surface, and its outward normals (B, 3).

    Raises
    ------
    InputError
        A point too far from the surface.
    """
    points, normals = surface.project(flat)
    far = float(np.linalg.norm(points - flat, axis=1).max())
    if far > SURFACE_ENDS:
        raise InputError(
            f"{what} of {contour.name!r} leaves the surface by {far * 1e3:.3g} mm; make it smaller"
        )
    return points, normals


def lean_axes(normals: Array, normal: Array, axis: Array) -> Array:
    """Return tool axes (B, 3) that lean from the normals as `axis` (3,) does from `normal` (3,)."""
    tilt, _ = Rotation.align_vectors(axis[None], -normal[None])
    return np.asarray(tilt.apply(-normals))


def lateral(axes: Array, along: Array, side: Side) -> Array:
    """Return unit directions (K, 3) across the travel `along`, to one side.

    Raises
    ------
    InputError
        Another side than left or right.
    """
    if side not in get_args(Side):
        raise InputError(f"side: expected left or right, got {side!r}")
    # Steps may be very short: only travel along the tool axis has no side.
    along = along / np.linalg.norm(along, axis=-1, keepdims=True)
    across = unit(np.cross(axes, along), "side")
    return across if side == "right" else -across


def nearest(contour: Contour, points: Array) -> tuple[Array, Array]:
    """Return the points (B, 3) m of a contour nearest to `points`, and the node before each."""
    start, step = contour.points[:-1], np.diff(contour.points, axis=0)
    # Segments whose middle is farther than the nearest node by at most half the longest segment.
    bound, _ = cKDTree(contour.points).query(points)
    size = np.linalg.norm(step, axis=1)
    near = cKDTree(start + step / 2).query_ball_point(points, bound + 0.5001 * size.max())
    many = np.array([len(segments) for segments in near])
    row, k = np.repeat(np.arange(len(points)), many), np.concatenate(near).astype(np.int64)
    part = np.clip(((points[row] - start[k]) * step[k]).sum(1) / size[k] ** 2, 0.0, 1.0)
    foot = start[k] + part[:, None] * step[k]
    order = np.lexsort((k, np.linalg.norm(points[row] - foot, axis=1), row))
    best = order[np.cumsum(many) - many]
    return foot[best], k[best]


def edge(contour: Contour) -> Contour:
    """Return the part's edge: the contour without its leads and loops in the scrap."""
    on = ~np.isin(contour.kind[:-1], IN_SCRAP)
    keep = np.append(on, False) | np.append(False, on)
    points, axes = contour.points[keep], contour.axes[keep]
    new = np.append(np.linalg.norm(np.diff(points, axis=0), axis=1) > SAME_PLACE, True)
    return Contour(points[new], axes[new], closed=contour.closed, name=contour.name)


def require_in_scrap(contour: Contour, points: Array, side: Side, what: str) -> None:
    """Raise InputError if one of the points (B, 3) m lies on the part's side of the contour."""
    where, k = nearest(contour, points)
    across = lateral(contour.axes[:-1], np.diff(contour.points, axis=0), side)
    last, nodes = len(across) - 1, contour.points
    ring = np.linalg.norm(nodes[0] - nodes[-1]) <= SAME_PLACE
    before = np.where(k > 0, k - 1, last if ring else 0)
    after = np.where(k < last, k + 1, 0 if ring else last)
    # Close to a corner, one of its segments alone may give the wrong side.
    at_start, at_end = (np.linalg.norm(where - nodes[i], axis=1) <= SAME_PLACE for i in (k, k + 1))
    other = np.where(at_start, before, np.where(at_end, after, k))
    depth = ((points - where) * (across[k] + across[other]) / 2).sum(1)
    if (depth < -TOUCH).any():
        i = int(np.argmin(depth))
        raise InputError(
            f"{what} of {contour.name!r} hits the part near {(points[i] * 1e3).round(2).tolist()} "
            f"mm, {-depth[i] * 1e3:.3g} mm deep; make it smaller, place it elsewhere, or change "
            "side"
        )
