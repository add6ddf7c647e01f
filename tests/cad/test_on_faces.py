"""Curves drawn on faces, as the trim lines of formed parts, are loops with the normals there."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from OCP.BRep import BRep_Builder
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeEdge, BRepBuilderAPI_MakeFace
from OCP.BRepLib import BRepLib
from OCP.Geom import Geom_CylindricalSurface
from OCP.Geom2d import Geom2d_Circle, Geom2d_Line
from OCP.gp import gp_Ax2d, gp_Ax3, gp_Dir, gp_Dir2d, gp_Pnt, gp_Pnt2d
from OCP.TopoDS import TopoDS_Compound, TopoDS_Edge, TopoDS_Face
from tests.cad.test_part import write_step

from kerfpath.cad import Part, read
from kerfpath.errors import InputError

R = 50.0
SURFACE = Geom_CylindricalSurface(gp_Ax3(gp_Pnt(), gp_Dir(0, 0, 1)), R)
EXACT = 1e-9
"""m: points are projected to the surface."""


def patch(low: float, high: float) -> TopoDS_Face:
    """Return the part of a cylinder between two angles (rad), 100 mm high."""
    return BRepBuilderAPI_MakeFace(SURFACE, low, high, 0.0, 100.0, 1e-6).Face()


def ring(angle: float, height: float, radius: float) -> TopoDS_Edge:
    """Return a closed curve on the cylinder: a circle in its parameters (rad, mm)."""
    circle = Geom2d_Circle(gp_Ax2d(gp_Pnt2d(angle, height), gp_Dir2d(1, 0)), radius)
    edge = BRepBuilderAPI_MakeEdge(circle, SURFACE).Edge()
    BRepLib.BuildCurve3d_s(edge)
    return edge


def line(start: tuple[float, float], length: float) -> TopoDS_Edge:
    """Return an open curve on the cylinder, around it."""
    way = Geom2d_Line(gp_Pnt2d(*start), gp_Dir2d(1, 0))
    edge = BRepBuilderAPI_MakeEdge(way, SURFACE, 0.0, length).Edge()
    BRepLib.BuildCurve3d_s(edge)
    return edge


def together(shapes: list[TopoDS_Edge | TopoDS_Face]) -> TopoDS_Compound:
    both, builder = TopoDS_Compound(), BRep_Builder()
    builder.MakeCompound(both)
    for shape in shapes:
        builder.Add(both, shape)
    return both


def require_on_cylinder(part: Part, name: str) -> None:
    contour = part.contour(name, closed=False)
    points = contour.points[:, :2]
    away = np.linalg.norm(points, axis=1)
    assert away == pytest.approx(R * 1e-3, abs=EXACT)
    radial = np.column_stack([points / away[:, None], np.zeros(len(points))])
    assert contour.axes == pytest.approx(-radial, abs=1e-6)
    # OCCT's curve nearly stands still at a knot: the places of nodes are known to some um there.
    assert part.departure(name, contour).chord_error < 1.2e-5


def test_closed_curves_are_trim_lines_and_holes_and_open_ones_are_lines(tmp_path: Path) -> None:
    drawn = [patch(0, 3), ring(1.5, 50, 0.8), ring(1.5, 50, 0.3), line((0.2, 20.0), 0.5)]
    for source in (drawn, write_step(tmp_path / "trim.step", together(drawn))):
        part = read(source)
        loops = {loop.name.rpartition("/")[2]: loop for loop in part.loops}
        assert {key: loop.kind for key, loop in loops.items()} == {
            "outer": "outer", "curve1": "outer", "curve2": "inner", "curve3": "open",
        }  # fmt: skip
        for key in ("curve1", "curve2", "curve3"):
            require_on_cylinder(part, loops[key].name)
            turns = np.sign(loops[key]._trace.area @ [np.cos(1.5), np.sin(1.5), 0])
            assert turns == {"curve1": 1, "curve2": -1}.get(key, turns)
        assert loops["curve3"].length == pytest.approx(0.5 * R * 1e-3, abs=EXACT)
        assert not part.left_out
        assert any("taken for trim lines" in note for note in part.notes)


def test_a_curve_over_several_faces_is_a_loop_of_their_skin() -> None:
    part = read([patch(0, 1.5), patch(1.5, 3), ring(1.5, 50, 0.6)])
    (loop,) = [loop for loop in part.loops if "curve" in loop.name]
    assert (loop.name, loop.kind) == ("skin1/curve1", "outer")
    require_on_cylinder(part, loop.name)
    along = part.surface(loop.name).project(np.array([[0.0, 0.06, 0.05]]))[0]
    assert along[0] == pytest.approx([0, 0.05, 0.05], abs=EXACT)  # leads go on over the scrap


def test_what_is_drawn_already_is_told_from_what_lies_nowhere() -> None:
    above = BRepBuilderAPI_MakeEdge(gp_Pnt(0, R + 1, 50), gp_Pnt(5, R + 1, 50)).Edge()
    rim = line((0.0, 0.0), 3.0)
    part = read([patch(0, 3), above, rim])
    assert [loop.name for loop in part.loops] == ["face1/outer"]
    assert [(each.count, each.may_cut) for each in part.left_out] == [(1, True), (1, False)]


def test_a_loop_with_a_gap_is_refused_and_the_gap_may_be_given() -> None:
    pieces = [line((0.5, 30.0), 1.0), line((0.5, 60.0), 1.0)]
    for angle in (0.5, 1.5):
        at = [R * np.cos(angle), R * np.sin(angle)]
        ends = gp_Pnt(*at, 30.03), gp_Pnt(*at, 60.0)
        pieces.append(BRepBuilderAPI_MakeEdge(*ends).Edge())
    part = read([patch(0, 3), *pieces])
    (loop,) = [loop for loop in part.loops if "curve" in loop.name]
    assert loop.closed
    assert loop.largest_gap == pytest.approx(0.03e-3, abs=EXACT)
    fine = read([patch(0, 3), *pieces], gap=1e-5)
    assert not any(loop.closed for loop in fine.loops if "curve" in loop.name)
    with pytest.raises(InputError, match=r"0\.030 mm"):
        fine.contour(next(loop.name for loop in fine.loops if "curve" in loop.name))
