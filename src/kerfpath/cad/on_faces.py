"""Curves drawn on faces, such as the trim lines of formed parts, as loops with their normals."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from OCP.BRep import BRep_Builder, BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve, BRepAdaptor_Surface
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeVertex
from OCP.BRepExtrema import BRepExtrema_DistShapeShape
from OCP.Geom import Geom_TrimmedCurve
from OCP.GeomAbs import GeomAbs_CurveType
from OCP.GeomConvert import GeomConvert
from OCP.gp import gp_Ax2, gp_Pnt, gp_Vec
from OCP.TopAbs import TopAbs_ShapeEnum
from OCP.TopoDS import TopoDS_Compound, TopoDS_Edge, TopoDS_Face, TopoDS_Shape
from scipy.interpolate import BSpline

from kerfpath.arrays import Array
from kerfpath.cad.chains import chains_against
from kerfpath.cad.curves import UP, Arc, Curve, EdgeChain, Line, Spline
from kerfpath.cad.laid import LaidEdge
from kerfpath.cad.left_out import LeftOut, counted
from kerfpath.cad.loops import UntrimmedSurface, bounds_of
from kerfpath.cad.part import Kind
from kerfpath.cad.shape import list_shapes
from kerfpath.cad.units import MM

AROUND_ALL = 0.1
"""Length of the mean normal below which curves run around all of a part and have no outside."""
LOOKS = 17
"""Number of points of a curve that are looked for on faces, evenly in its parameter."""


class LaidLoop(NamedTuple):
    """A loop of curves on faces: its kind, its curves, and the numbers of the faces."""

    kind: Kind
    chain: EdgeChain[LaidEdge]
    faces: tuple[int, ...]


class FoundCurves(NamedTuple):
    """The loops of curves on faces, notes on them, and the curves that are left out."""

    loops: list[LaidLoop]
    notes: list[str]
    left_out: list[LeftOut]


class _NearestFace:
    """A surface made of several: the nearest of them."""

    def __init__(self, faces: Sequence[TopoDS_Face]) -> None:
        self._surfaces = [UntrimmedSurface(face, BRepAdaptor_Surface(face)) for face in faces]

    def project(self, points: Array) -> tuple[Array, Array]:
        """Return the nearest points (B, 3) m, and the outward normals (B, 3)."""
        asked = np.asarray(points, dtype=np.float64) / MM
        found = [surface.nearest(asked) for surface in self._surfaces]
        away = np.array([np.linalg.norm(on - asked, axis=1) for on, _ in found])
        best, each = np.argmin(away, axis=0), np.arange(len(asked))
        on, normals = (np.array(values)[best, each] for values in zip(*found, strict=True))
        return on * MM, normals


def curves_on_faces(
    curves: Sequence[TopoDS_Edge],
    faces: Sequence[TopoDS_Face],
    sheet: Sequence[int],
    gap: float,
) -> FoundCurves:
    """Return the loops of curves that lie on faces within a gap.

    Curves on faces of one sheet are chained. Their closed loops nest and run as seen against the
    mean normal of the faces along them: those in an odd number of others are holes. Curves on the
    edges of faces are drawn there already.

    Parameters
    ----------
    curves : sequence of TopoDS_Edge
    faces : sequence of TopoDS_Face
    sheet : sequence of int
        A number for each face, the same for those over which a curve may run on.
    gap : float m
    """
    boxes = np.array([bounds_of(face) for face in faces])
    on: dict[int, list[tuple[Curve, set[int]]]] = {}
    left_out = Counter[tuple[str, str, bool]]()
    for edge in curves:
        adaptor = BRepAdaptor_Curve(edge)
        t = np.linspace(adaptor.FirstParameter(), adaptor.LastParameter(), LOOKS)
        # From the middle on: most curves that lie on no face leave it there.
        points = [adaptor.Value(one) for one in np.roll(t, -(LOOKS // 2)).tolist()]
        within = _faces_at(points, faces, boxes, gap / MM)
        if within is None:
            left_out["curve", "it bounds no face and lies on none", True] += 1
        elif _is_near(points, _edges_of([faces[f] for f in within]), gap / MM):
            left_out["curve", "it lies on edges of faces", False] += 1
        else:
            on.setdefault(sheet[min(within)], []).append((curve_of(edge), within))
    loops, notes = list[LaidLoop](), list[str]()
    for own in on.values():
        numbers = sorted(set.union(*(within for _, within in own)))
        surface = _NearestFace([faces[f] for f in numbers])
        strokes = [(curve,) for curve, _ in own]
        around = np.vstack([curve.around for curve, _ in own])
        normal = surface.project(around * MM)[1].mean(axis=0)
        is_around = np.linalg.norm(normal) < AROUND_ALL
        found, repaired = chains_against(strokes, np.array(UP) if is_around else -normal, gap=gap)
        notes += [f"curves on faces: {what}" for what in repaired]
        for kind, chain in found:
            points = [gp_Pnt(*p) for p in chain.around.tolist()]
            within = _faces_at(points, faces, boxes, gap / MM)
            line = EdgeChain(
                edges=[LaidEdge(curve, surface) for curve in chain.edges],
                is_closed=chain.is_closed, next_end=chain.next_end, next_away=chain.next_away,
            )  # fmt: skip
            told: Kind = "outer" if is_around and chain.is_closed else kind
            loops.append(LaidLoop(told, line, tuple(sorted(within or numbers))))
    if closed := sum(loop.kind == "outer" for loop in loops):
        notes.append(
            f"{closed} closed curves on faces are taken for trim lines: what is outside is scrap; "
            "write scrap for a hole"
        )
    return FoundCurves(loops, notes, counted(left_out))


def _faces_at(
    points: Sequence[gp_Pnt], faces: Sequence[TopoDS_Face], boxes: Array, gap: float
) -> set[int] | None:
    """Return the faces that points lie on within a gap (mm), None if one lies on none."""
    found = set[int]()
    for point in points:
        at = np.array([point.X(), point.Y(), point.Z()])
        inside = ((boxes[:, 0] - gap <= at) & (at <= boxes[:, 1] + gap)).all(axis=1)
        near = sorted(np.flatnonzero(inside).tolist(), key=lambda f: f not in found)
        here = next((f for f in near if _is_near([point], faces[f], gap)), None)
        if here is None:
            return None
        found.add(here)
    return found


def _is_near(points: Sequence[gp_Pnt], shape: TopoDS_Shape, gap: float) -> bool:
    """Return whether all points lie within a gap (mm) of a shape."""
    return all(
        BRepExtrema_DistShapeShape(BRepBuilderAPI_MakeVertex(point).Vertex(), shape).Value() <= gap
        for point in points
    )


def _edges_of(faces: Sequence[TopoDS_Face]) -> TopoDS_Shape:
    edges, builder = TopoDS_Compound(), BRep_Builder()
    builder.MakeCompound(edges)
    for face in faces:
        for edge in list_shapes(face, TopAbs_ShapeEnum.TopAbs_EDGE):
            builder.Add(edges, edge)
    return edges


# -----------------------------------------------------------------------------
# The curve of an edge that bounds no face.


def curve_of(edge: TopoDS_Edge) -> Curve:
    """Return the curve of an edge, in its own direction."""
    adaptor = BRepAdaptor_Curve(edge)
    first, last = adaptor.FirstParameter(), adaptor.LastParameter()
    kind = adaptor.GetType()
    if kind == GeomAbs_CurveType.GeomAbs_Line:
        return Line(_vector(adaptor.Value(first)), _vector(adaptor.Value(last)))
    if kind == GeomAbs_CurveType.GeomAbs_Circle:
        circle = adaptor.Circle()
        return _arc(circle.Position(), circle.Radius(), circle.Radius(), first, last)
    if kind == GeomAbs_CurveType.GeomAbs_Ellipse:
        ellipse = adaptor.Ellipse()
        radii = ellipse.MajorRadius(), ellipse.MinorRadius()
        return _arc(ellipse.Position(), *radii, first, last)
    trimmed = Geom_TrimmedCurve(BRep_Tool.Curve_s(edge, first, last), first, last)
    spline = GeomConvert.CurveToBSplineCurve_s(trimmed)
    poles = range(1, spline.NbPoles() + 1)
    weights = np.array([spline.Weight(k) for k in poles])
    points = np.array([_vector(spline.Pole(k)) for k in poles])
    net = np.column_stack([points * weights[:, None], weights])
    knots = [
        spline.Knot(k)
        for k in range(1, spline.NbKnots() + 1)
        for _ in range(spline.Multiplicity(k))
    ]
    return Spline(
        BSpline(np.array(knots), net, spline.Degree()),
        spline.FirstParameter(),
        spline.LastParameter(),
    )


def _arc(at: gp_Ax2, major: float, minor: float, first: float, last: float) -> Arc:
    x, y = gp_Vec(at.XDirection()), gp_Vec(at.YDirection())
    return Arc(_vector(at.Location()), major * _vector(x), minor * _vector(y), first, last)


def _vector(at: gp_Pnt | gp_Vec) -> Array:
    return np.array([at.X(), at.Y(), at.Z()])
