"""What STEP and IGES have in common: OCCT kept quiet, and loose faces sewn together."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeSolid, BRepBuilderAPI_Sewing
from OCP.BRepLib import BRepLib
from OCP.Message import Message
from OCP.Standard import Standard_Failure
from OCP.TopAbs import TopAbs_ShapeEnum
from OCP.TopExp import TopExp_Explorer
from OCP.TopoDS import TopoDS, TopoDS_Shape

from kerfpath.cad._faces import NamedFace, part_of
from kerfpath.cad._part import Part
from kerfpath.cad._units import MM
from kerfpath.errors import InputError

__all__ = ["explored", "occt", "part_of_shape"]


@contextmanager
def occt(path: Path) -> Iterator[None]:
    """Keep OCCT's own messages off the terminal, and put its failures in one line."""
    messenger = Message.DefaultMessenger_s()
    printers = list(messenger.Printers())
    messenger.ChangePrinters().Clear()
    try:
        yield
    except InputError as error:
        told = str(error)
        raise InputError(told if told.startswith(str(path)) else f"{path}: {told}") from None
    except (Standard_Failure, RuntimeError, UnicodeDecodeError) as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        raise InputError(
            f"{path}: the geometry cannot be read ({reason}); export the part again"
        ) from None
    finally:
        for printer in printers:
            messenger.AddPrinter(printer)


def part_of_shape(
    path: Path,
    unit: str,
    shape: TopoDS_Shape,
    faces: Sequence[NamedFace],
    *,
    gap: float,
    notes: Sequence[str] = (),
) -> Part:
    """Return the part of a shape, faces that belong to no solid sewn together within `gap` (m)."""
    if not faces:
        raise InputError("the file holds no face; export the part as a solid or a surface")
    solids = explored(shape, TopAbs_ShapeEnum.TopAbs_SOLID)
    if not solids and len(faces) > 1:
        shape, faces, told = _sewn(faces, gap)
        notes = [*notes, told]
    return part_of(path, unit, shape, faces, gap=gap, notes=notes)


def explored(shape: TopoDS_Shape, kind: TopAbs_ShapeEnum) -> list[TopoDS_Shape]:
    """Return the faces, edges, ... of a shape."""
    found, explorer = [], TopExp_Explorer(shape, kind)
    while explorer.More():
        found.append(explorer.Current())
        explorer.Next()
    return found


def _sewn(faces: Sequence[NamedFace], gap: float) -> tuple[TopoDS_Shape, list[NamedFace], str]:
    """Return the faces with edges shared where they lie within `gap`, and what was done."""
    sewing = BRepBuilderAPI_Sewing(gap / MM)
    for named in faces:
        sewing.Add(named.face)
    sewing.Perform()
    shape = sewing.SewedShape()
    if not sewing.NbFreeEdges() and shape.ShapeType() == TopAbs_ShapeEnum.TopAbs_SHELL:
        solid = BRepBuilderAPI_MakeSolid(TopoDS.Shell(shape)).Solid()
        BRepLib.OrientClosedSolid_s(solid)
        shape = solid
    # Sewing turns faces round so that neighbours agree: each is taken as it lies in the result.
    sewn = explored(shape, TopAbs_ShapeEnum.TopAbs_FACE)
    lying = []
    for named in faces:
        made = sewing.ModifiedSubShape(named.face)
        lies = [face for face in sewn if face.IsSame(made)]
        lying += [replace(named, face=TopoDS.Face(face)) for face in lies[:1]]
    if len(lying) != len(faces):
        raise InputError(
            f"{len(faces) - len(lying)} of {len(faces)} loose faces vanish when sewn over "
            f"{gap / MM:g} mm; give a smaller gap"
        )
    edges = explored(shape, TopAbs_ShapeEnum.TopAbs_EDGE)
    widest = max((BRep_Tool.Tolerance_s(TopoDS.Edge(edge)) for edge in edges), default=0.0)
    told = (
        f"{len(faces)} loose faces sewn within {gap / MM:g} mm: {sewing.NbContigousEdges()} edges "
        f"joined, the widest gap {np.round(widest, 4):g} mm; {sewing.NbFreeEdges()} edges are free"
    )
    return shape, lying, told
