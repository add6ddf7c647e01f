"""Sew loose faces together, body by body."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from OCP.BRep import BRep_Builder, BRep_Tool
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeSolid, BRepBuilderAPI_Sewing
from OCP.BRepLib import BRepLib
from OCP.collections import IndexedMap_TopoDS_Shape_TopTools_ShapeMapHasher as ShapeMap
from OCP.TopAbs import TopAbs_ShapeEnum
from OCP.TopoDS import TopoDS, TopoDS_Compound, TopoDS_Shape

from kerfpath.cad._bodies import bodies_of
from kerfpath.cad._left_out import LeftOut, nothing_drawn
from kerfpath.cad._shape import NamedFace, NamedShape, list_shapes
from kerfpath.cad._units import MM

__all__ = ["drawn_of"]

EDGE, FACE = TopAbs_ShapeEnum.TopAbs_EDGE, TopAbs_ShapeEnum.TopAbs_FACE


def drawn_of(
    unit: str,
    shape: TopoDS_Shape,
    faces: Sequence[NamedFace],
    *,
    gap: float,
    notes: Sequence[str] = (),
    left_out: Sequence[LeftOut] = (),
) -> NamedShape:
    """Return a shape and its faces, which are sewn within `gap` (m) if there is no solid.

    The shape may have lines instead of faces.

    Raises
    ------
    InputError
        Neither faces nor lines, or no face left after sewing.
    """
    lines = len(list_shapes(shape, EDGE, avoid=FACE))
    if not (faces or lines):
        raise nothing_drawn(left_out)
    if lines and faces:
        lost = LeftOut(kind="curve", reason="it bounds no face", count=lines, may_cut=False)
        left_out = [*left_out, lost]
    solids = list_shapes(shape, TopAbs_ShapeEnum.TopAbs_SOLID)
    if not solids and len(faces) > 1:
        loose = len(faces)
        shape, faces, note = _sewn(faces, gap)
        notes = [*notes, note]
        if gone := loose - len(faces):
            reason = f"it vanishes when sewn over {gap / MM:g} mm: try a smaller gap"
            vanished = LeftOut(kind="face", reason=reason, count=gone, may_cut=True)
            left_out = [*left_out, vanished]
        if not faces:
            raise nothing_drawn(left_out)
    return NamedShape(unit=unit, shape=shape, faces=faces, notes=notes, left_out=left_out)


def _sewn(faces: Sequence[NamedFace], gap: float) -> tuple[TopoDS_Shape, list[NamedFace], str]:
    """Return the sewn shape, its faces, and a note; edges within `gap` (m) are shared.

    Each body is sewn separately, so that bodies that touch stay apart.
    """
    bodies = bodies_of([named.face for named in faces], gap / MM)
    whole, builder = TopoDS_Compound(), BRep_Builder()
    builder.MakeCompound(whole)
    lying: dict[int, NamedFace] = {}
    joined = free = 0
    for body in bodies:
        sewing = BRepBuilderAPI_Sewing(gap / MM)
        for f in body:
            sewing.Add(faces[f].face)
        sewing.Perform()
        shape = sewing.SewedShape()
        if not sewing.NbFreeEdges() and shape.ShapeType() == TopAbs_ShapeEnum.TopAbs_SHELL:
            solid = BRepBuilderAPI_MakeSolid(TopoDS.Shell(shape)).Solid()
            BRepLib.OrientClosedSolid_s(solid)
            shape = solid
        builder.Add(whole, shape)
        joined, free = joined + sewing.NbContigousEdges(), free + sewing.NbFreeEdges()
        # Sewing reverses faces so that neighbours agree: take each as oriented in the result.
        sewn = ShapeMap()
        for face in list_shapes(shape, FACE):
            sewn.Add(face)
        for f in body:
            if place := sewn.FindIndex(sewing.ModifiedSubShape(faces[f].face)):
                lying[f] = replace(faces[f], face=TopoDS.Face(sewn.FindKey(place)))
    edges = list_shapes(whole, EDGE)
    widest = max((BRep_Tool.Tolerance_s(TopoDS.Edge(edge)) for edge in edges), default=0.0)
    apart = f" to {len(bodies)} bodies" if len(bodies) > 1 else ""
    note = (
        f"{len(faces)} loose faces sewn{apart} within {gap / MM:g} mm: {joined} edges "
        f"joined, the widest gap {np.round(widest, 4):g} mm; {free} edges are free"
    )
    shape = shape if len(bodies) == 1 else whole
    return shape, [lying[f] for f in sorted(lying)], note
