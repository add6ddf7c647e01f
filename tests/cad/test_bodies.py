"""Bodies that touch, written as loose faces, are the same bodies as when they are written whole."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox
from OCP.gp import gp_Ax1, gp_Dir, gp_Pnt, gp_Trsf, gp_Vec
from OCP.IGESControl import IGESControl_Controller, IGESControl_Writer
from OCP.Message import Message
from OCP.TopAbs import TopAbs_ShapeEnum
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS, TopoDS_Shape
from tests.cad.test_part import compound, cut, cylinder, plate, tube, write_step

from kerfpath.cad import Part, read
from kerfpath.cad.loops import bounds_of
from kerfpath.cad.sewing import bodies_of
from kerfpath.cad.shape import list_shapes

EXACT = 1e-7
"""m: IGES writes 13 digits of places hundreds of mm off."""


def block(x: float, y: float, z: float, dx: float, dy: float, dz: float) -> TopoDS_Shape:
    return BRepPrimAPI_MakeBox(gp_Pnt(x, y, z), dx, dy, dz).Shape()


def rows_of_blocks() -> list[TopoDS_Shape]:
    return [block(60 * i, 40 * j, 0, 60, 40, 3) for i in range(3) for j in range(2)]


TOUCHING: dict[str, Callable[[], list[TopoDS_Shape]]] = {
    "end to end": lambda: [block(100 * k, 0, 0, 100, 50, 2) for k in range(3)],
    "one upon the other": lambda: [block(0, 0, 0, 100, 50, 2), block(0, 0, 2, 100, 50, 3)],
    "at a part of a side": lambda: [block(0, 0, 0, 200, 50, 2), block(20, 0, 2, 180, 50, 30)],
    "at an edge": lambda: [block(0, 0, 0, 200, 50, 2), block(0, 0, 2, 2, 50, 30)],
    "along a line": lambda: [block(0, 0, 0, 50, 30, 2), block(50, 30, 0, 50, 30, 2)],
    "side by side": rows_of_blocks,
    "with a pin in a hole": lambda: [plate(), cylinder(5, 2, (20, 40, 0))],
    "tube in tube": lambda: [
        tube(),
        cut(cylinder(28, 100), cylinder(26, 120, (0, 0, -10))),
    ],
    "nearly": lambda: [block(0, 0, 0, 100, 50, 2), block(100.03, 0, 0, 100, 50, 2)],
    "not at all": lambda: [plate(), block(0, 0, 50, 100, 60, 2)],
}


def write_faces(path: Path, shapes: list[TopoDS_Shape], seed: int) -> Path:
    """Write the faces of shapes as IGES, each by itself, in any order."""
    faces = [f for shape in shapes for f in list_shapes(shape, TopAbs_ShapeEnum.TopAbs_FACE)]
    IGESControl_Controller.Init_s()
    Message.DefaultMessenger_s().ChangePrinters().Clear()
    writer = IGESControl_Writer("MM", 0)
    for k in np.random.default_rng(seed).permutation(len(faces)).tolist():
        writer.AddShape(faces[k])
    writer.ComputeModel()
    writer.Write(str(path))
    return path


def tilted(shapes: list[TopoDS_Shape], seed: int) -> list[TopoDS_Shape]:
    rng = np.random.default_rng(seed)
    turn, move = gp_Trsf(), gp_Trsf()
    axis = gp_Dir(*rng.normal(size=3).tolist())
    turn.SetRotation(gp_Ax1(gp_Pnt(), axis), float(rng.uniform(0, 2 * np.pi)))
    move.SetTranslation(gp_Vec(*rng.uniform(-300, 300, 3).tolist()))
    return [shape.Moved(TopLoc_Location(move.Multiplied(turn))) for shape in shapes]


def facts(part: Part) -> list[tuple[str | bool | float, ...]]:
    """Return what the loops of a part are, whatever their faces are called."""
    return sorted(
        (
            loop.kind,
            bool(loop.side),
            loop.side == "edge",
            round(loop.length, 6),
            *(loop.bounding_box.ravel().round(5) + 0.0).tolist(),
        )
        for loop in part.loops
        if not loop.name.startswith("skin")
    )


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("case", TOUCHING)
def test_touching_bodies_stay_apart(tmp_path: Path, case: str, seed: int) -> None:
    shapes = tilted(TOUCHING[case](), seed)
    whole = read(write_step(tmp_path / "whole.step", compound(*shapes)))
    loose = read(write_faces(tmp_path / "loose.iges", shapes, seed))
    assert loose.faces == whole.faces
    assert loose.left_out == whole.left_out == ()
    assert loose.largest_gap <= EXACT
    assert facts(loose) == facts(whole)
    count = len(shapes)
    assert f"sewn to {count} bodies" in loose.notes[0]
    assert loose.notes[0].endswith("0 edges are free")


def test_faces_that_share_a_line_are_a_body_however_it_is_divided() -> None:
    """A long edge of one face against two short ones of others; a face far off is another body."""
    blocks = (
        block(0, 0, 0, 100, 50, 2), block(0, 50, 0, 40, 50, 2), block(40, 50, 0, 60, 50, 2),
        block(0, 300, 0, 10, 10, 2),
    )  # fmt: skip
    # Of each block the upper face alone: the first ends along the next two.
    top = []
    for each in blocks:
        faces = map(TopoDS.Face, list_shapes(each, TopAbs_ShapeEnum.TopAbs_FACE))
        top.append(max(faces, key=lambda face: float(bounds_of(face)[:, 2].sum())))
    assert bodies_of(top, 0.05) == [[0, 1, 2], [3]]
    assert bodies_of(top[1:2] + top[3:], 0.05) == [[0], [1]]
    assert bodies_of([], 0.05) == []
