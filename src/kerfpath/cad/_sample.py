"""Dense points and normals along a chain of edges, no further apart than the tolerances allow."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.collections import Array1_double
from OCP.GeomAbs import GeomAbs_Shape

from kerfpath._arrays import Array
from kerfpath.cad._loops import OrientedEdge
from kerfpath.errors import InputError

__all__ = ["breaks", "chain"]

FIRST_CELLS = 4
"""Cells per smooth stretch to begin with: one could hide an S whose middle lies on its chord."""
MARGIN = 0.8
"""Share of the tolerance allowed at the middle of a cell; a curve may stray more beside it."""
SHORTEST = 1e-3
"""Cells below this (mm) are not divided: a crease of the surface turns its normal in no length."""

MOST = 500_000
"""Nodes on one edge; a broken edge would ask for them without end."""


def chain(
    edges: Sequence[OrientedEdge], chord_tolerance: float, axis_tolerance: float
) -> tuple[Array, Array]:
    """Return points (K, 3) mm and outward normals (K, 3) around a closed chain of `edges`.

    The end of an edge and the start of the next become one node, halfway; the first node is not
    repeated at the end.

    Parameters
    ----------
    edges : sequence of OrientedEdge
        In the order of travel, the last ending where the first starts.
    chord_tolerance : float mm
        Largest distance between the chord of two nodes and the edge.
    axis_tolerance : float rad
        Largest angle between the normals of two nodes that follow each other.
    """
    sampled = [_edge(edge, chord_tolerance, axis_tolerance) for edge in edges]
    points, normals = [], []
    for (before_p, before_n), (p, n) in zip(sampled[-1:] + sampled[:-1], sampled, strict=True):
        joint = before_n[-1] + n[0]
        points += [(before_p[-1:] + p[:1]) / 2, p[1:-1]]
        normals += [(joint / np.linalg.norm(joint))[None], n[1:-1]]
    return np.vstack(points), np.vstack(normals)


def breaks(edge: OrientedEdge) -> Array:
    """Return the parameters, in the direction of travel, between which the edge is smooth."""
    curve = BRepAdaptor_Curve(edge.edge, edge.face)
    count = curve.NbIntervals(GeomAbs_Shape.GeomAbs_C2)
    ends = Array1_double(1, count + 1)
    curve.Intervals(ends, GeomAbs_Shape.GeomAbs_C2)
    low, high = sorted((edge.start, edge.end))
    inside = [t for t in ends if low < t < high]
    t = np.unique([low, *inside, high])
    return t if edge.start < edge.end else t[::-1]


def _edge(edge: OrientedEdge, chord_tolerance: float, axis_tolerance: float) -> tuple[Array, Array]:
    """Return points and normals along one edge, both ends included, by halving cells."""
    stretch = breaks(edge)
    t = np.concatenate(
        [
            *(np.linspace(a, b, FIRST_CELLS, endpoint=False) for a, b in pairwise(stretch)),
            stretch[-1:],
        ]
    )
    points, normals = edge.evaluate(t)
    open_cells = np.arange(len(t) - 1)
    while open_cells.size:
        middle = (t[open_cells] + t[open_cells + 1]) / 2
        mid_points, mid_normals = edge.evaluate(middle)
        p0, p1 = points[open_cells], points[open_cells + 1]
        chord = np.linalg.norm(p1 - p0, axis=1)
        coarse = _off_chord(p0, p1, mid_points) > MARGIN * chord_tolerance
        coarse |= _angle(normals[open_cells], normals[open_cells + 1]) > axis_tolerance
        coarse &= chord > SHORTEST
        split = open_cells[coarse]
        t = np.insert(t, split + 1, middle[coarse])
        points = np.insert(points, split + 1, mid_points[coarse], axis=0)
        normals = np.insert(normals, split + 1, mid_normals[coarse], axis=0)
        if len(t) > MOST:
            raise InputError(
                f"an edge needs more than {MOST} nodes near {points[split[0]].tolist()} mm; relax "
                "the tolerances, or repair the edge in CAD"
            )
        left = split + np.arange(split.size)
        open_cells = np.sort(np.concatenate([left, left + 1]))
    return points, normals


def _off_chord(p0: Array, p1: Array, p: Array) -> Array:
    """Return the distances of `p` from the segments p0 p1, row by row."""
    d = p1 - p0
    along = ((p - p0) * d).sum(1) / np.maximum((d * d).sum(1), np.finfo(float).tiny)
    return np.asarray(np.linalg.norm(p0 + np.clip(along, 0, 1)[:, None] * d - p, axis=1))


def _angle(n0: Array, n1: Array) -> Array:
    """Return the angles between unit vectors, exact also where they are tiny."""
    return np.asarray(2 * np.arcsin(np.minimum(np.linalg.norm(n1 - n0, axis=1) / 2, 1.0)))
