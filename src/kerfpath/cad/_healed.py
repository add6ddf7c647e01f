"""The healed surface around a loop, which continues over holes and past the ends of faces."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.gp import gp_Pnt, gp_Vec
from OCP.ShapeAnalysis import ShapeAnalysis_Surface
from scipy.spatial import cKDTree

from kerfpath._arrays import Array
from kerfpath.cad._loops import OrientedEdge
from kerfpath.cad._units import MM

__all__ = ["HealedSurface"]

STEP = 0.5
"""Distance (mm) between the places on the loop from which the nearest face is found."""
PRECISION = 1e-6
"""Precision (mm) of a projection."""
BESIDE = 1e-3
"""A point farther than this (mm) from the normal at its foot is beyond the end of a surface."""
ENDS = 0.3
"""How far a surface may be from its tangent plane at the loop, as a share of the distance from the
loop plus `STEP`; beyond that, it counts as ended."""


class HealedSurface:
    """The untrimmed surfaces of the faces along a loop; each is valid nearest to its own edges.

    Where such a surface ends, the tangent plane at the nearest place of the loop continues it.

    Parameters
    ----------
    edges : sequence of OrientedEdge
        Edges of the loop.
    """

    def __init__(self, edges: Sequence[OrientedEdge]) -> None:
        self._surfaces = [_Untrimmed(edge) for edge in edges]
        counts = [int(edge.length / STEP) + 2 for edge in edges]
        along = [
            edge.evaluate(np.linspace(edge.start, edge.end, count))
            for edge, count in zip(edges, counts, strict=True)
        ]
        self._edge = np.repeat(np.arange(len(edges)), counts)
        self._points = np.vstack([points for points, _ in along])
        self._normals = np.vstack([normals for _, normals in along])
        self._tree = cKDTree(self._points)

    def project(self, points: Array) -> tuple[Array, Array]:
        asked = np.asarray(points, dtype=np.float64) / MM
        away, nearest = (np.asarray(found) for found in self._tree.query(asked))
        found, normals = np.empty_like(asked), np.empty_like(asked)
        for k, (point, far, place) in enumerate(zip(asked, away, nearest, strict=True)):
            on, normal = self._surfaces[self._edge[place]].nearest(point)
            at, flat = self._points[place], self._normals[place]
            foot = point - ((point - at) @ flat) * flat
            way = point - on
            ended = np.linalg.norm(way - (way @ normal) * normal) > BESIDE or np.linalg.norm(
                on - foot
            ) > ENDS * (far + STEP)
            found[k], normals[k] = (foot, flat) if ended else (on, normal)
        return found * MM, normals


class _Untrimmed:
    """The surface of an edge's face without its bounds."""

    def __init__(self, edge: OrientedEdge) -> None:
        self._edge = edge
        self._surface = ShapeAnalysis_Surface(BRep_Tool.Surface_s(edge.face))

    def nearest(self, point: Array) -> tuple[Array, Array]:
        """Return the nearest point (3,) mm and the outward normal (3,) there."""
        uv = self._surface.ValueOfUV(gp_Pnt(*point.tolist()), PRECISION)
        at, du, dv = gp_Pnt(), gp_Vec(), gp_Vec()
        self._edge.surface.D1(uv.X(), uv.Y(), at, du, dv)
        normal = du.Crossed(dv)
        way = np.array([normal.X(), normal.Y(), normal.Z()])
        size = float(np.linalg.norm(way))
        on = np.array([at.X(), at.Y(), at.Z()])
        return on, way * (self._edge.outward / size) if size > 0 else way
