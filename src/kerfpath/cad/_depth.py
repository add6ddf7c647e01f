"""Depth of a side of a sheet inside the part, which distinguishes its outer and inner sides.

Seen along the outward normal, nothing of a channel lies beyond its outer side, and all of it lies
beyond its inner side. Holes, countersinks and flanges hardly change that, unlike the length of the
rims or the areas.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from OCP.BRepAdaptor import BRepAdaptor_Surface
from OCP.BRepGProp import BRepGProp
from OCP.BRepTools import BRepTools
from OCP.GeomAbs import GeomAbs_SurfaceType
from OCP.gp import gp_Pnt, gp_Pnt2d, gp_Vec
from OCP.GProp import GProp_GProps
from OCP.IntTools import IntTools_FClass2d
from OCP.TopAbs import TopAbs_State
from OCP.TopoDS import TopoDS_Face

from kerfpath._arrays import Array, Ints
from kerfpath.cad._loops import REVERSED

__all__ = ["depth_of", "joined", "patches_of", "weighed"]

GRID = 5
"""Number of patches in each direction of a face that is not plane."""
ACCURACY = 1e-2
"""Relative accuracy of areas, which only distinguish sheets from blocks and are not shown."""
EDGE = 1e-9
"""A point this close to an edge, in the parameters of the surface, is on it."""
CHUNK = 256
"""Points treated together: memory does not grow with the part, and BLAS starts no threads."""
DIRECTIONS = 512
"""Number of directions in which the ends of a sheet are searched, one within 5 deg of any."""


class Patches(NamedTuple):
    """Patches of a face: areas (K,) mm^2, middles (K, 3) mm, outward unit normals (K, 3)."""

    area: Array
    middle: Array
    normal: Array


def weighed(face: TopoDS_Face) -> tuple[float, gp_Pnt]:
    """Return the area of a face, mm^2, and its centre of mass."""
    props = GProp_GProps()
    BRepGProp.SurfaceProperties_s(face, props, ACCURACY)
    return abs(props.Mass()), props.CentreOfMass()  # negative for some damaged faces


def patches_of(face: TopoDS_Face, area: float, middle: gp_Pnt) -> Patches:
    """Return the patches of a face of known area and centre: one for a plane, else a grid."""
    surface = BRepAdaptor_Surface(face)
    out = -1.0 if face.Orientation() == REVERSED else 1.0
    if surface.GetType() == GeomAbs_SurfaceType.GeomAbs_Plane:
        normal = surface.Plane().Axis().Direction()
        if not surface.Plane().Direct():
            out = -out
        return Patches(
            np.array([area]),
            np.array([[middle.X(), middle.Y(), middle.Z()]]),
            out * np.array([[normal.X(), normal.Y(), normal.Z()]]),
        )
    u0, u1, v0, v1 = BRepTools.UVBounds_s(face)
    part, within = (np.arange(GRID) + 0.5) / GRID, IntTools_FClass2d(face, EDGE)
    middles, normals, inside = [], [], []
    point, du, dv = gp_Pnt(), gp_Vec(), gp_Vec()
    for u in (u0 + (u1 - u0) * part).tolist():
        for v in (v0 + (v1 - v0) * part).tolist():
            surface.D1(u, v, point, du, dv)
            across = du.Crossed(dv)
            middles.append((point.X(), point.Y(), point.Z()))
            normals.append((across.X(), across.Y(), across.Z()))
            inside.append(within.Perform(gp_Pnt2d(u, v)) != TopAbs_State.TopAbs_OUT)
    normal = np.array(normals)
    size = np.linalg.norm(normal, axis=1)
    kept = (size > 0) & (inside if any(inside) else True)  # a narrow strip may miss the grid
    size = size[kept]
    return Patches(
        size * (area / max(size.sum(), np.finfo(float).tiny)),
        np.array(middles)[kept],
        out * normal[kept] / size[:, None],
    )


def joined(parts: Sequence[Patches]) -> Patches:
    """Return the patches of several faces in one."""
    return Patches(*map(np.concatenate, zip(*parts, strict=True)))


def depth_of(patches: Patches, points: Array) -> float:
    """Return the mean distance (mm) that points (K, 3) mm reach beyond patches, along normals."""
    ends = points[_farthest(points)]
    beyond = (patches.normal @ ends.T).max(axis=1) - (patches.normal * patches.middle).sum(axis=1)
    return float(patches.area @ np.maximum(beyond, 0.0) / patches.area.sum())


def _farthest(points: Array) -> Ints:
    """Return the indices of points (K, 3) that lie farthest in one of many directions."""
    directions = _directions()
    best, which = np.full(len(directions), -np.inf), np.zeros(len(directions), dtype=np.int64)
    for first in range(0, len(points), CHUNK):
        along = directions @ points[first : first + CHUNK].T
        here = np.argmax(along, axis=1)
        farther = along[np.arange(len(directions)), here] > best
        which[farther] = here[farther] + first
        best[farther] = along[farther, here[farther]]
    return np.unique(which)


def _directions() -> Array:
    """Return unit vectors (D, 3) that are evenly spread, on a spiral."""
    z = 1 - (2 * np.arange(DIRECTIONS) + 1) / DIRECTIONS
    turn = np.pi * (3 - np.sqrt(5)) * np.arange(DIRECTIONS)
    r = np.sqrt(1 - z * z)
    return np.stack([r * np.cos(turn), r * np.sin(turn), z], axis=1)
