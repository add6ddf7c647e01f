"""Model example drawings: a bent bracket, a bulged tube, a long beam, and a flat blank.

    python examples/model_drawings.py [FOLDER]

It writes bracket.step, tube.step, beam.step and blank.dxf next to their jobs in examples/parts. All
lengths are in mm, as in the files.
"""

from __future__ import annotations

import sys
from pathlib import Path

from ezdxf.filemanagement import new
from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut
from OCP.BRepBuilderAPI import (
    BRepBuilderAPI_MakeEdge,
    BRepBuilderAPI_MakeFace,
    BRepBuilderAPI_MakeWire,
)
from OCP.BRepPrimAPI import (
    BRepPrimAPI_MakeBox,
    BRepPrimAPI_MakeCylinder,
    BRepPrimAPI_MakePrism,
    BRepPrimAPI_MakeRevol,
)
from OCP.collections import Array1_gp_Pnt
from OCP.GC import GC_MakeArcOfCircle
from OCP.Geom import Geom_BezierCurve
from OCP.gp import gp_Ax1, gp_Ax2, gp_Circ, gp_Dir, gp_Pnt, gp_Vec
from OCP.IGESControl import IGESControl_Controller, IGESControl_Writer
from OCP.Message import Message
from OCP.STEPControl import STEPControl_StepModelType, STEPControl_Writer
from OCP.TopoDS import TopoDS_Edge, TopoDS_Shape

FOLDER = Path(__file__).parent / "parts"

LEG, HEIGHT, WIDTH, WALL, BEND = 58.0, 43.0, 40.0, 2.0, 5.0
"""Of the bracket: flat lengths, width, sheet thickness, and inner radius of the bend."""


def line(a: tuple[float, float], b: tuple[float, float]) -> TopoDS_Edge:
    """Return a straight edge between two points (x, z)."""
    return BRepBuilderAPI_MakeEdge(gp_Pnt(a[0], 0, a[1]), gp_Pnt(b[0], 0, b[1])).Edge()


def bow(a: tuple[float, float], b: tuple[float, float], radius: float) -> TopoDS_Edge:
    """Return the quarter of the bend from a to b, (x, z)."""
    circle = gp_Circ(gp_Ax2(gp_Pnt(LEG, 0, WALL + BEND), gp_Dir(0, -1, 0)), radius)
    ends = gp_Pnt(a[0], 0, a[1]), gp_Pnt(b[0], 0, b[1])
    return BRepBuilderAPI_MakeEdge(GC_MakeArcOfCircle(circle, *ends, True).Value()).Edge()


def bracket() -> TopoDS_Shape:
    """Return an L of sheet: bent round y, a hole in its leg, one over the bend, a slot above."""
    outer, top = LEG + BEND + WALL, WALL + BEND + HEIGHT
    corner = WALL + BEND
    wire = BRepBuilderAPI_MakeWire()
    for edge in (
        line((0, 0), (LEG, 0)),
        bow((LEG, 0), (outer, corner), BEND + WALL),
        line((outer, corner), (outer, top)),
        line((outer, top), (outer - WALL, top)),
        line((outer - WALL, top), (outer - WALL, corner)),
        bow((LEG, WALL), (outer - WALL, corner), BEND),
        line((LEG, WALL), (0, WALL)),
        line((0, WALL), (0, 0)),
    ):
        wire.Add(edge)
    profile = BRepBuilderAPI_MakeFace(wire.Wire()).Face()
    shape = BRepPrimAPI_MakePrism(profile, gp_Vec(0, WIDTH, 0)).Shape()
    shape = drilled(shape, 10.0, (25, 12, -1), (0, 0, 1), 5.0)
    shape = drilled(shape, 12.0, (LEG, WIDTH / 2, corner), (1, 0, -1), 20.0)
    for y in (14.0, 26.0):  # the slot's round ends, and what is between them
        shape = drilled(shape, 8.0, (outer - WALL - 1, y, 35), (1, 0, 0), 4.0)
    between = BRepPrimAPI_MakeBox(gp_Pnt(outer - WALL - 1, 14, 31), 4.0, 12.0, 8.0).Shape()
    return BRepAlgoAPI_Cut(shape, between).Shape()


def tube() -> TopoDS_Shape:
    """Return a round tube bulged in its middle, holes on all four sides; its seam is at +x."""
    inside: list[tuple[float, float]] = []
    outside: list[tuple[float, float]] = []
    for offset, poles in ((0.0, inside), (2.0, outside)):
        poles += [(20 + offset, 0), (20 + offset, 60), (45 + offset, 80), (45 + offset, 120)]
        poles += [(20 + offset, 140), (20 + offset, 200)]
    wire = BRepBuilderAPI_MakeWire()
    curves = []
    for poles in (inside, outside):
        net = Array1_gp_Pnt(1, len(poles))
        for k, (x, z) in enumerate(poles, start=1):
            net.SetValue(k, gp_Pnt(x, 0, z))
        curves.append(BRepBuilderAPI_MakeEdge(Geom_BezierCurve(net)).Edge())
    ends = line(inside[0], outside[0]), line(inside[-1], outside[-1])
    for edge in (curves[0], ends[0], curves[1], ends[1]):
        wire.Add(edge)
    profile = BRepBuilderAPI_MakeFace(wire.Wire()).Face()
    shape = BRepPrimAPI_MakeRevol(profile, gp_Ax1(gp_Pnt(), gp_Dir(0, 0, 1))).Shape()
    for z, diameter in ((40, 12), (100, 16)):
        shape = drilled(shape, diameter, (-80, 0, z), (1, 0, 0), 160.0)
        shape = drilled(shape, diameter, (0, -80, z), (0, 1, 0), 160.0)
    return shape


def beam() -> TopoDS_Shape:
    """Return a channel 4 m long, its web up: a slot along it, a hole beyond each end of that."""
    length, width, height, wall = 4000.0, 120.0, 60.0, 3.0
    shape = BRepPrimAPI_MakeBox(length, width, height).Shape()
    hollow = BRepPrimAPI_MakeBox(
        gp_Pnt(-1, wall, -1), length + 2, width - 2 * wall, height + 1 - wall
    )
    shape = BRepAlgoAPI_Cut(shape, hollow.Shape()).Shape()
    for x, diameter in ((60.0, 20.0), (200.0, 30.0), (length - 200, 30.0), (length - 60, 20.0)):
        shape = drilled(shape, diameter, (x, width / 2, height - wall - 1), (0, 0, 1), 10.0)
    slot = BRepPrimAPI_MakeBox(
        gp_Pnt(200, width / 2 - 15, height - wall - 1), length - 400, 30.0, 10.0
    )
    return BRepAlgoAPI_Cut(shape, slot.Shape()).Shape()


def drilled(
    shape: TopoDS_Shape,
    diameter: float,
    start: tuple[float, float, float],
    along: tuple[float, float, float],
    depth: float,
) -> TopoDS_Shape:
    """Return `shape` with a round hole."""
    axes = gp_Ax2(gp_Pnt(*start), gp_Dir(*along))
    return BRepAlgoAPI_Cut(
        shape, BRepPrimAPI_MakeCylinder(axes, diameter / 2, depth).Shape()
    ).Shape()


def write_step(path: Path, shape: TopoDS_Shape) -> None:
    """Write a shape as STEP."""
    Message.DefaultMessenger_s().ChangePrinters().Clear()
    writer = STEPControl_Writer()
    writer.Transfer(shape, STEPControl_StepModelType.STEPControl_AsIs)
    writer.Write(str(path))


def write_iges(path: Path, shape: TopoDS_Shape, unit: str = "MM") -> None:
    """Write a shape as IGES: loose faces, each with edges of its own."""
    Message.DefaultMessenger_s().ChangePrinters().Clear()
    IGESControl_Controller.Init_s()
    writer = IGESControl_Writer(unit, 0)
    writer.AddShape(shape)
    writer.ComputeModel()
    writer.Write(str(path))


def write_blank(path: Path) -> None:
    """Write a flat blank as DXF: a trim, holes from a block, a spline, an open line, text."""
    document = new("R2010", units=4)
    document.layers.add("CUT", color=1)
    document.layers.add("MARK", color=3)
    document.layers.add("NOTES", color=8)
    space = document.modelspace()
    bulge = 0.41421356237309503  # tan(90 deg / 4): a quarter
    corners = [(10, 0), (190, 0, bulge), (200, 10), (200, 90, bulge), (190, 100), (10, 100, bulge)]
    corners += [(0, 90), (0, 10, bulge)]
    space.add_lwpolyline(corners, format="xyb", close=True, dxfattribs={"layer": "CUT"})
    hole = document.blocks.new("HOLE")
    hole.add_circle((0, 0), 4)
    pattern = document.blocks.new("PATTERN")
    for x, y in ((0, 0), (30, 0), (0, 30)):
        pattern.add_blockref("HOLE", (x, y))
    space.add_blockref("PATTERN", (40, 30), dxfattribs={"layer": "CUT", "rotation": 30.0})
    space.add_ellipse((140, 60), (20, 0), 0.5, dxfattribs={"layer": "CUT", "color": 5})
    bean = [(120, 20), (140, 14), (160, 20), (160, 30), (140, 26), (120, 30), (120, 20)]
    space.add_spline(bean, dxfattribs={"layer": "CUT"})
    mark = [(20, 75), (70, 75, bulge), (80, 85), (80, 92)]
    space.add_lwpolyline(mark, format="xyb", dxfattribs={"layer": "MARK"})
    space.add_text("blank 200 x 100", dxfattribs={"layer": "NOTES"}).set_placement((0, -15))
    document.saveas(path)


def write(folder: Path) -> None:
    """Write every drawing."""
    folder.mkdir(parents=True, exist_ok=True)
    write_step(folder / "bracket.step", bracket())
    write_step(folder / "tube.step", tube())
    write_step(folder / "beam.step", beam())
    write_blank(folder / "blank.dxf")


if __name__ == "__main__":
    target = Path(sys.argv[1]) if len(sys.argv) > 1 else FOLDER
    write(target)
    print(f"wrote {target}")
