"""Shave solids: remove material from their surface to a depth."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy.optimize import linprog
from scipy.spatial import ConvexHull, HalfspaceIntersection, QhullError

from kerfpath._arrays import Array
from kerfpath.cell._mesh import Mesh
from kerfpath.cell._shapes import Capsule, Hull, Shape
from kerfpath.errors import InputError

__all__ = ["shave"]

DEEPEST = 8e-3
"""m: a mesh is not shaved deeper, as its walls may be thin."""
EVEN = 3e-3
"""Regularisation: it keeps a vertex from sliding if its triangles hardly differ in direction."""
FARTHEST = 2.0
"""Largest motion of a vertex at a sharp corner, in multiples of the depth."""
CORE = 1e-4
"""m: radius of the ball that must be left of a convex solid."""


def shave(shape: Shape, depth: float) -> Shape | None:
    """Return what is left of a solid when its faces are moved inwards by `depth` (m).

    This is exact for capsules and convex solids: every point deeper behind all faces stays. The
    triangles of a mesh move as well as its vertices allow, no vertex by more than twice the depth.
    None if nothing would be left, or if the depth is too large for a mesh.
    """
    if isinstance(shape, Capsule):
        left = shape.radius - depth
        return Capsule(start=shape.start, end=shape.end, radius=left) if left > CORE else None
    if isinstance(shape, Hull):
        return _core(shape, depth)
    if depth > DEEPEST:
        return None
    return Mesh(
        vertices=shape.vertices + depth * _inward(shape),
        triangles=shape.triangles,
        deviation=shape.deviation,
        name=shape.name,
    )


def _inward(mesh: Mesh) -> Array:
    """Return vertex motions (V, 3) that move the triangles about each vertex inwards by about 1."""
    corners = mesh.vertices[mesh.triangles]
    a, b, c = np.moveaxis(corners, 1, 0)
    normal = np.cross(b - a, c - a)
    if (a * normal).sum() > 0:  # six times the volume: positive where they point outwards
        normal = -normal
    area = np.linalg.norm(normal, axis=1)
    held = area > 0
    unit = normal[held] / area[held, None]
    # At each vertex, solve n . x = 1 by least squares, each triangle weighted by its angle there.
    planes, pull = np.zeros((len(mesh.vertices), 3, 3)), np.zeros((len(mesh.vertices), 3))
    for i in range(3):
        one, two = (corners[held, (i + k) % 3] - corners[held, i] for k in (1, 2))
        angle = np.arctan2(area[held], (one * two).sum(axis=1))
        at = mesh.triangles[held, i]
        np.add.at(planes, at, angle[:, None, None] * unit[:, :, None] * unit[:, None, :])
        np.add.at(pull, at, angle[:, None] * unit)
    planes += (EVEN * np.trace(planes, axis1=1, axis2=2) + 1e-12)[:, None, None] * np.eye(3)
    move = np.linalg.solve(planes, pull[..., None])[..., 0]
    length = np.linalg.norm(move, axis=1, keepdims=True)
    return np.asarray(move * np.minimum(1.0, FARTHEST / np.maximum(length, 1e-12)))


def _core(hull: Hull, depth: float) -> Hull | None:
    """Return the points of a convex solid that are `depth` (m) or more behind each of its faces."""
    planes, heart, radius = _centre_and_planes(hull)
    if radius - depth <= CORE:
        return None
    try:
        return Hull(
            HalfspaceIntersection(planes + np.array([0.0, 0.0, 0.0, depth]), heart).intersections
        )
    except (QhullError, InputError):
        return None


@lru_cache(maxsize=64)
def _centre_and_planes(hull: Hull) -> tuple[Array, Array, float]:
    """Return the planes (F, 4) of a convex solid, and centre (3,) m and radius (m) of a ball in it.

    It is the largest such ball: its centre stays the deepest point at any depth of shaving.
    """
    planes = np.unique(ConvexHull(hull.points).equations, axis=0)
    found = linprog(
        [0.0, 0.0, 0.0, -1.0],
        A_ub=np.c_[planes[:, :3], np.ones(len(planes))],
        b_ub=-planes[:, 3],
        bounds=[(None, None)] * 4,
    )
    if found.x is None:
        return planes, hull.points.mean(axis=0), 0.0
    return planes, found.x[:3], float(found.x[3])
