"""Read shapes in memory: those of OCP, bare or wrapped as by build123d."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from OCP.BRep import BRep_Builder, BRep_Tool
from OCP.BRepBuilderAPI import BRepBuilderAPI_Copy, BRepBuilderAPI_Transform
from OCP.gp import gp_Pnt, gp_Trsf
from OCP.TopAbs import TopAbs_ShapeEnum
from OCP.TopoDS import TopoDS, TopoDS_Compound, TopoDS_Shape

from kerfpath.cad.sewing import sewn_shape
from kerfpath.cad.shape import NamedFace, NamedShape, list_shapes
from kerfpath.cad.units import LARGEST, UNITS_MM
from kerfpath.errors import InputError

EXPECTED = (
    "expected a file, or a shape: a TopoDS_Shape of OCP, an object that has one as .wrapped "
    "(build123d, CadQuery), or a list of these; pass the .part of a builder, the .vals() of a "
    "Workplane"
)


def shape_in_memory(given: object, unit: str | None, gap: float) -> NamedShape:
    """Return a copy of the content of one or several shapes; numbers are in `unit`, or in mm.

    Raises
    ------
    InputError
        No shape, an empty one, a point that is not finite or too far away.
    """
    whole = _whole(given)
    if unit in (None, "mm"):
        shape = BRepBuilderAPI_Copy(whole).Shape()
    else:
        scale = gp_Trsf()
        scale.SetScale(gp_Pnt(), UNITS_MM[str(unit)])
        shape = BRepBuilderAPI_Transform(whole, scale, True).Shape()
    for vertex in list_shapes(shape, TopAbs_ShapeEnum.TopAbs_VERTEX):
        at = BRep_Tool.Pnt_s(TopoDS.Vertex(vertex))
        here = [at.X(), at.Y(), at.Z()]
        if not (np.abs(here) <= LARGEST).all():
            raise InputError(
                f"a point lies at {here} mm, further than {LARGEST / 1e6:g} km from the origin or "
                "not finite; check the shape and unit"
            )
    faces = list_shapes(shape, TopAbs_ShapeEnum.TopAbs_FACE)
    if not faces and not list_shapes(shape, TopAbs_ShapeEnum.TopAbs_EDGE):
        raise InputError("it is empty: it has neither faces nor edges")
    named = [NamedFace(face=TopoDS.Face(face)) for face in faces]
    return sewn_shape(unit or "mm", shape, named, gap=gap)


def _whole(given: object) -> TopoDS_Shape:
    """Return a shape, or several as one."""
    try:
        shape = getattr(given, "wrapped", given)
    except AssertionError:  # build123d's, of what is empty
        shape = None
    if isinstance(shape, TopoDS_Shape) and not shape.IsNull():
        return shape
    if isinstance(shape, TopoDS_Shape) or (shape is None and given is not None):
        raise InputError("it is empty: nothing has been built yet")
    if not isinstance(given, Sequence) or isinstance(given, str | bytes):
        raise InputError(f"{EXPECTED}; got {type(given).__name__}")
    compound, builder = TopoDS_Compound(), BRep_Builder()
    builder.MakeCompound(compound)
    for each in given:
        builder.Add(compound, _whole(each))
    return compound
