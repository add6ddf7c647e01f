"""The content of STEP and IGES files: a shape and its named faces.

OCCT crashes on some damaged files, so files are read in a separate process (`kerfpath.isolated`),
which returns OCCT's binary format. That process imports only this module and the translators.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from io import BytesIO
from typing import Any

import numpy as np
from OCP.BinTools import BinTools
from OCP.BRep import BRep_Builder, BRep_Tool
from OCP.BRepMesh import BRepMesh_IncrementalMesh
from OCP.BRepTools import BRepTools
from OCP.collections import IndexedMap_TopoDS_Shape_TopTools_ShapeMapHasher as ShapeMap
from OCP.Interface import Interface_CheckIterator
from OCP.Message import Message
from OCP.Standard import Standard_Failure
from OCP.TopAbs import TopAbs_Orientation, TopAbs_ShapeEnum
from OCP.TopExp import TopExp_Explorer
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import (
    TopoDS,
    TopoDS_Compound,
    TopoDS_Edge,
    TopoDS_Face,
    TopoDS_Iterator,
    TopoDS_Shape,
)

from kerfpath.arrays import Array, Ints, short_repr
from kerfpath.cad.left_out import LeftOut
from kerfpath.errors import InputError
from kerfpath.isolated import call_apart


@dataclass(frozen=True, slots=True, kw_only=True)
class NamedFace:
    """A face of a file.

    Parameters
    ----------
    face : TopoDS_Face
    name : str
        Name in the file, or "".
    component : str
        Component of an assembly that the face belongs to, "" if there is only one.
    layer, colour : str
        Layer and colour in the file, or "".
    """

    face: TopoDS_Face
    name: str = ""
    component: str = ""
    layer: str = ""
    colour: str = ""

    __repr__ = short_repr


@dataclass(frozen=True, slots=True, kw_only=True)
class NamedShape:
    """A shape and its named faces, oriented as in the shape.

    Parameters
    ----------
    unit : str
        Length unit of the numbers in the file; the shape is in mm.
    shape : TopoDS_Shape
    faces : sequence of NamedFace
    notes : sequence of str
    left_out : sequence of LeftOut
        What is in the file but not in the shape.
    curves : sequence of TopoDS_Edge
        Curves that bound no face, beside faces.
    frames : mapping of str to (4, 4) m
        T_part_frame of the named coordinate systems of the file.
    """

    unit: str
    shape: TopoDS_Shape
    faces: Sequence[NamedFace]
    notes: Sequence[str]
    left_out: Sequence[LeftOut] = ()
    curves: Sequence[TopoDS_Edge] = ()
    frames: Mapping[str, Array] = field(default_factory=dict)

    def __reduce__(self) -> tuple[Any, ...]:
        """Return what is needed to rebuild the shape in another process."""
        own: list[TopoDS_Shape] = [named.face for named in self.faces]
        stream = BytesIO()
        BinTools.Write_s(_compound(self.shape, _compound(*own), _compound(*self.curves)), stream)
        names = [(n.name, n.component, n.layer, n.colour) for n in self.faces]
        rest = tuple(self.notes), tuple(self.left_out), dict(self.frames)
        return _copy_with_names, (self.unit, stream.getvalue(), names, *rest)


def _compound(*shapes: TopoDS_Shape) -> TopoDS_Compound:
    compound, builder = TopoDS_Compound(), BRep_Builder()
    builder.MakeCompound(compound)
    for shape in shapes:
        builder.Add(compound, shape)
    return compound


def _copy_with_names(
    unit: str,
    stream: bytes,
    names: Sequence[tuple[str, str, str, str]],
    notes: Sequence[str],
    left_out: Sequence[LeftOut],
    frames: Mapping[str, Array],
) -> NamedShape:
    every = TopoDS_Shape()
    BinTools.Read_s(every, BytesIO(stream))
    shape, faces, curves = children(every)
    named = [
        NamedFace(
            face=TopoDS.Face(face), name=name, component=component, layer=layer, colour=colour
        )
        for face, (name, component, layer, colour) in zip(children(faces), names, strict=True)
    ]
    return NamedShape(
        unit=unit, shape=shape, faces=named, notes=notes, left_out=left_out,
        curves=[TopoDS.Edge(curve) for curve in children(curves)], frames=frames,
    )  # fmt: skip


def children(shape: TopoDS_Shape) -> list[TopoDS_Shape]:
    """Return the direct sub-shapes of a shape."""
    return list(_each(TopoDS_Iterator(shape)))


@contextmanager
def occt() -> Iterator[None]:
    """Keep OCCT's messages off the terminal, and turn its failures into one-line errors."""
    messenger = Message.DefaultMessenger_s()
    printers = list(messenger.Printers())
    messenger.ChangePrinters().Clear()
    try:
        yield
    except InputError:
        raise
    except (Standard_Failure, RuntimeError, UnicodeDecodeError) as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        raise InputError(f"the geometry cannot be read ({reason}); export the part again") from None
    finally:
        for printer in printers:
            messenger.AddPrinter(printer)


def list_shapes(
    shape: TopoDS_Shape,
    kind: TopAbs_ShapeEnum,
    avoid: TopAbs_ShapeEnum = TopAbs_ShapeEnum.TopAbs_SHAPE,
) -> list[TopoDS_Shape]:
    """Return the sub-shapes of a `kind` in a shape, without those inside shapes to `avoid`."""
    return list(_each(TopExp_Explorer(shape, kind, avoid)))


MOST_FACES = 30_000
"""Most faces and loose curves of a part; what an assembly repeats counts each time."""
MOST_EDGES = 300_000
"""Most edges of a part, counted for each of its faces: one takes some kilobytes in loops."""


def require_few_faces(shape: TopoDS_Shape) -> None:
    """Raise InputError if there are too many faces or edges; repeated components take no longer."""
    edge = TopAbs_ShapeEnum.TopAbs_EDGE
    for what, kinds, most in (
        ("faces and loose curves", (TopAbs_ShapeEnum.TopAbs_FACE, edge), MOST_FACES),
        ("edges", (edge,), MOST_EDGES),
    ):
        if (found := _count(shape, kinds)) > most:
            raise InputError(
                f"contains {found} {what}, at most {most} are read; export the part to cut alone"
            )


def _count(shape: TopoDS_Shape, kinds: tuple[TopAbs_ShapeEnum, ...]) -> int:
    """Return the number of shapes of some kinds, without those that are inside others of them."""
    known = ShapeMap()
    counts: list[int] = []

    def count(shape: TopoDS_Shape) -> int:
        if shape.ShapeType() in kinds:
            return 1
        alone = shape.Located(TopLoc_Location())
        if not known.Contains(alone):
            found = sum(map(count, children(shape)))
            known.Add(alone)
            counts.append(found)
        return counts[known.FindIndex(alone) - 1]

    return count(shape)


def failures(checks: Interface_CheckIterator) -> Iterator[tuple[int, str]]:
    """Yield the number of each entity that fails a check, 0 for the file as a whole, and why."""
    checks.Start()
    while checks.More():
        number, check = checks.Number(), checks.Value()
        checks.Next()
        if check.HasFailed():
            yield number, " ".join(check.CFail(1).split())


def _each(shapes: TopExp_Explorer | TopoDS_Iterator) -> Iterator[TopoDS_Shape]:
    while shapes.More():
        yield shapes.Value()
        shapes.Next()


def unique(names: list[str]) -> list[str]:
    """Return `names` with a number appended to each repeated one."""
    taken, unique = set(names), []
    seen: set[str] = set()
    for name in names:
        number, chosen = 1, name
        if name in seen:
            while chosen in taken:
                number += 1
                chosen = f"{name}-{number}"
        seen.add(name)
        taken.add(chosen)
        unique.append(chosen)
    return unique


# -----------------------------------------------------------------------------
# Triangulate a shape for pictures.

Mesh = tuple[Array, Ints, Ints]
ANGLE = 0.35
"""Largest angle (rad) between neighbouring triangles: small holes still look round."""


def triangulate_apart(shape: TopoDS_Shape, deflection: float, *, size: int) -> Mesh:
    """Return what `triangulate` returns, made in another process, as OCCT may take for ever.

    Raises
    ------
    InputError
        It takes more time or memory than allowed for a file of `size` bytes.
    """
    stream = BytesIO()
    BinTools.Write_s(shape, stream)
    return call_apart(_triangulate_copy, stream.getvalue(), deflection, size=size)


def _triangulate_copy(stream: bytes, deflection: float) -> Mesh:
    shape = TopoDS_Shape()
    BinTools.Read_s(shape, BytesIO(stream))
    with occt():
        return triangulate(shape, deflection)


def triangulate(shape: TopoDS_Shape, deflection: float) -> Mesh:
    """Return vertices (V, 3) mm and outward triangles (F, 3), within `deflection` mm.

    The third array (f,) has the number of triangles of each face, in their order.
    """
    # OCCT keeps the finest mesh so far on the shape; the result must not depend on it.
    BRepTools.Clean_s(shape)
    BRepMesh_IncrementalMesh(shape, deflection, False, ANGLE, False)
    vertices, triangles, count = [np.empty((0, 3))], [np.empty((0, 3), dtype=np.int64)], 0
    sizes: list[int] = []
    for found in list_shapes(shape, TopAbs_ShapeEnum.TopAbs_FACE):
        face, location = TopoDS.Face(found), TopLoc_Location()
        mesh = BRep_Tool.Triangulation_s(face, location)
        sizes.append(0 if mesh is None else mesh.NbTriangles())
        if mesh is None:
            continue
        placed = location.Transformation()
        nodes = [mesh.Node(k).Transformed(placed) for k in range(1, mesh.NbNodes() + 1)]
        corners = np.array([mesh.Triangle(k).Get() for k in range(1, mesh.NbTriangles() + 1)])
        if face.Orientation() == TopAbs_Orientation.TopAbs_REVERSED:
            corners = corners[:, ::-1]
        vertices.append(np.array([[p.X(), p.Y(), p.Z()] for p in nodes]))
        triangles.append(corners.astype(np.int64) - 1 + count)
        count += len(nodes)
    return (
        np.vstack(vertices),
        np.ascontiguousarray(np.vstack(triangles)),
        np.array(sizes, dtype=np.int64),
    )
