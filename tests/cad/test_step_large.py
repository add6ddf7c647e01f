"""STEP files of kilobytes that hold, or would take, what no part does: refused in one line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from OCP.BRepBuilderAPI import (
    BRepBuilderAPI_MakeEdge,
    BRepBuilderAPI_MakeFace,
    BRepBuilderAPI_MakeWire,
)
from OCP.collections import Array1_double, Array1_int, Array2_gp_Pnt
from OCP.Geom import Geom_BSplineSurface
from OCP.gp import gp_Ax2, gp_Circ, gp_Dir, gp_Pln, gp_Pnt, gp_Trsf, gp_Vec
from OCP.Interface import Interface_Static
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS, TopoDS_Shape
from tests.cad.test_part import box, compound, write_step

from kerfpath.cad import read
from kerfpath.errors import InputError


def repeated(shape: TopoDS_Shape, count: int, levels: int) -> TopoDS_Shape:
    """Return an assembly of assemblies ... of a shape, each `count` times."""
    apart = 2.0
    for _ in range(levels):
        moves = [gp_Trsf() for _ in range(count)]
        for k, move in enumerate(moves):
            move.SetTranslation(gp_Vec(k * apart, 0, 0))
        shape, apart = compound(*(shape.Located(TopLoc_Location(m)) for m in moves)), apart * count
    return shape


def wild(count: int, height: float) -> TopoDS_Shape:
    """Return a face over `count` by `count` poles that toss about by `height` mm."""
    rng, poles = np.random.default_rng(0), Array2_gp_Pnt(1, count, 1, count)
    for i in range(count):
        for j in range(count):
            x, y, z = (10 * i, 10 * j, 0) + height * rng.normal(size=3)
            poles.SetValue(i + 1, j + 1, gp_Pnt(x, y, z))
    knots, times = Array1_double(1, count - 2), Array1_int(1, count - 2)
    for k in range(1, count - 1):
        knots.SetValue(k, float(k))
        times.SetValue(k, 4 if k in (1, count - 2) else 1)
    surface = Geom_BSplineSurface(poles, knots, knots, times, times, 3, 3)
    return BRepBuilderAPI_MakeFace(surface, 1e-6).Face()


def test_an_assembly_of_too_many_faces_is_refused(tmp_path: Path) -> None:
    """Five levels of eight: 196 608 faces in tens of kilobytes."""
    Interface_Static.SetIVal_s("write.step.assembly", 1)
    try:
        path = write_step(tmp_path / "many.step", repeated(box(1, 1, 1), 8, 5))
    finally:
        Interface_Static.SetIVal_s("write.step.assembly", 0)
    assert path.stat().st_size < 100_000
    said = f"many.step: contains {6 * 8**5} faces and loose curves, at most 30000 are read; export"
    with pytest.raises(InputError, match=said):
        read(path)


def test_an_assembly_of_too_many_edges_is_refused(tmp_path: Path) -> None:
    """A face with many holes, 1600 times: each edge would take memory in loops."""
    sheet = BRepBuilderAPI_MakeFace(gp_Pln(), 0, 50, 0, 50)
    for k in range(200):
        circle = gp_Circ(gp_Ax2(gp_Pnt(2 + k % 20 * 2, 2 + k // 20 * 2, 0), gp_Dir(0, 0, 1)), 0.5)
        wire = BRepBuilderAPI_MakeWire(BRepBuilderAPI_MakeEdge(circle).Edge()).Wire()
        sheet.Add(TopoDS.Wire(wire.Reversed()))
    Interface_Static.SetIVal_s("write.step.assembly", 1)
    try:
        path = write_step(tmp_path / "holes.step", repeated(sheet.Face(), 40, 2))
    finally:
        Interface_Static.SetIVal_s("write.step.assembly", 0)
    said = f"holes.step: contains {204 * 1600} edges, at most 300000 are read; export"
    with pytest.raises(InputError, match=said):
        read(path)


@pytest.mark.slow
def test_a_mesh_that_takes_too_much_is_refused_and_the_loops_are_read(tmp_path: Path) -> None:
    part = read(write_step(tmp_path / "wild.step", wild(60, 1000)))
    assert len(part.loops) == 1
    with pytest.raises(InputError, match=r"wild\.step: .*(takes more than|too much memory)"):
        part.mesh(1e-5)


def test_a_mesh_is_the_same_in_another_process(tmp_path: Path) -> None:
    """Of a file, whose mesh is made in another process, and of its shape in memory."""
    shape = wild(5, 1)
    vertices, triangles = read(write_step(tmp_path / "tame.step", shape)).mesh()
    expected, same = read(shape).mesh()
    np.testing.assert_allclose(vertices, expected, atol=1e-9)
    assert np.array_equal(triangles, same)


def test_a_very_long_word_is_refused_at_once(tmp_path: Path) -> None:
    """The time for it grew with the square of its length: minutes for a megabyte."""
    path = write_step(tmp_path / "word.step", box(1, 1, 1))
    path.write_text(path.read_text("ascii").replace("DIRECTION(", "x" * 1_000_000, 1), "ascii")
    with pytest.raises(InputError, match=r"word\.step: .*Incorrect syntax"):
        read(path)
