"""Turn a sheet that is drawn as a surface into a closed solid."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from kerfpath._arrays import Array, Ints, floats, freeze, integers, scalar
from kerfpath.errors import InputError

__all__ = ["edges_of", "thicken"]


def edges_of(triangles: Ints) -> tuple[Ints, Ints]:
    """Return the edges (E, 2) of triangles (F, 3), and how often (E,) each is left open.

    That is how many more triangles use the edge in its given direction than in the opposite one;
    a closed surface leaves no edge open.
    """
    edges = np.vstack([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    forward = edges[:, 0] < edges[:, 1]
    keys, place = np.unique(np.sort(edges, axis=1), axis=0, return_inverse=True)
    balance = np.bincount(place.ravel(), np.where(forward, 1, -1), len(keys)).astype(np.int64)
    keys = np.where(balance[:, None] < 0, keys[:, ::-1], keys)
    return freeze(keys), freeze(np.abs(balance))


def thicken(vertices: ArrayLike, triangles: ArrayLike, thickness: float) -> tuple[Array, Ints]:
    """Return the closed mesh of a sheet, with the material behind the given surface.

    Parameters
    ----------
    vertices : (V, 3) m
    triangles : (F, 3) int
        Counter-clockwise about the normals of the drawn side.
    thickness : float m
        Distance of the other side, along the mean normal of the triangles of each vertex; at sharp
        bends, the sheet is therefore thinner.

    Raises
    ------
    InputError
        A thickness that is not positive; triangles at a vertex that face each other.
    """
    front = floats(vertices, "vertices", (None, 3))
    corners = integers(triangles, "triangles", (None, 3))
    depth = scalar(thickness, "thickness", unit="m", above=0.0)
    a, b, c = (front[corners[:, i]] for i in range(3))
    normal = np.zeros_like(front)
    for i in range(3):
        np.add.at(normal, corners[:, i], np.cross(b - a, c - a))
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    used = np.unique(corners)
    if not (length[used] > 0).all():
        raise InputError("sheet: its triangles face each other at a vertex; repair the surface")
    back = front - depth * normal / np.where(length > 0, length, 1.0)
    V = len(front)
    start, end = np.repeat(*edges_of(corners), axis=0).T
    walls = [np.c_[end, start, start + V], np.c_[end, start + V, end + V]]
    return freeze(np.vstack([front, back])), freeze(
        np.vstack([corners, corners[:, ::-1] + V, *walls])
    )
