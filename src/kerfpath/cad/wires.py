"""Read lines of STEP and IGES files that bound no face, as a drawing of lines."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.collections import IndexedMap_TopoDS_Shape_TopTools_ShapeMapHasher as ShapeMap
from OCP.Geom import Geom_TrimmedCurve
from OCP.GeomAbs import GeomAbs_CurveType
from OCP.GeomConvert import GeomConvert
from OCP.gp import gp_Ax2, gp_Pnt, gp_Vec
from OCP.TopAbs import TopAbs_ShapeEnum
from OCP.TopoDS import TopoDS, TopoDS_Edge
from scipy.interpolate import BSpline

from kerfpath.arrays import Array
from kerfpath.cad.chains import part_of_strokes
from kerfpath.cad.curves import Arc, Curve, Line, Spline
from kerfpath.cad.part import Part
from kerfpath.cad.shape import NamedShape, list_shapes

WIRE_STYLE = ("curves", "")
"""Layer and colour of these lines, by which loops are named."""


def part_of_wires(path: Path, drawn: NamedShape, gap: float, axis: Array) -> Part:
    """Return the part that the lines of a file make up.

    Parameters
    ----------
    path : Path
    drawn : NamedShape
        A shape without faces.
    gap : float m
        Distance between ends that a loop bridges.
    axis : (3,)
        The tool axis of all lines.
    """
    edges = ShapeMap()
    for edge in list_shapes(drawn.shape, TopAbs_ShapeEnum.TopAbs_EDGE):
        edges.Add(edge)
    numbers = range(1, edges.Extent() + 1)
    strokes = [(_curve(TopoDS.Edge(edges.FindKey(number))),) for number in numbers]
    part = part_of_strokes(
        path, drawn.unit, {WIRE_STYLE: strokes}, gap=gap, notes=drawn.notes,
        left_out=drawn.left_out, axis=axis,
    )  # fmt: skip
    return replace(part, frames=drawn.frames)


def _curve(edge: TopoDS_Edge) -> Curve:
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
