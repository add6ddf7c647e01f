"""Lines in space, of DXF, STEP and IGES, with a tool axis asked for; tables of any columns."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
import pytest
from ezdxf.filemanagement import new
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeEdge
from OCP.collections import Array1_gp_Pnt
from OCP.Geom import Geom_BezierCurve
from OCP.gp import gp_Ax2, gp_Circ, gp_Dir, gp_Elips, gp_Pnt
from OCP.IGESControl import IGESControl_Controller, IGESControl_Writer
from OCP.TopoDS import TopoDS_Shape
from tests.cad.test_part import box, compound, write_step

from kerfpath.cad import Part, read
from kerfpath.errors import InputError

EXACT = 1e-9
"""m: files keep 13 digits or more."""
AXIS = (0.3, -0.4, -0.8)


def rotation(seed: int) -> np.ndarray:
    q = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]
    return np.asarray(q * np.sign(np.linalg.det(q)))


def write_iges(path: Path, shape: TopoDS_Shape) -> Path:
    IGESControl_Controller.Init_s()
    writer = IGESControl_Writer("MM", 0)
    writer.AddShape(shape)
    writer.ComputeModel()
    writer.Write(str(path))
    return path


def line(p: Sequence[float], q: Sequence[float]) -> TopoDS_Shape:
    return BRepBuilderAPI_MakeEdge(gp_Pnt(*p), gp_Pnt(*q)).Edge()


def write_path(path: Path, corners: np.ndarray) -> Path:
    """Write lines from corner to corner, in another order and direction, as a file of any kind."""
    pairs = [(p.tolist(), q.tolist()) for p, q in itertools.pairwise(corners)]
    pairs = [pair[::-1] if k % 2 else pair for k, pair in enumerate(pairs)][::-1]
    if path.suffix == ".dxf":
        document = new("R2010", units=4)
        for p, q in pairs:
            document.modelspace().add_line(p, q)
        document.saveas(path)
        return path
    shape = compound(*(line(p, q) for p, q in pairs))
    return (write_step if path.suffix == ".step" else write_iges)(path, shape)


@pytest.mark.parametrize("suffix", ["dxf", "step", "iges"])
@pytest.mark.parametrize("seed", [1, 2])
def test_a_path_in_space_is_an_open_line_with_the_axis_asked_for(
    tmp_path: Path, suffix: str, seed: int
) -> None:
    corners = np.random.default_rng(seed).uniform(-200, 200, (6, 3)).round(3)
    part = read(write_path(tmp_path / f"path.{suffix}", corners), axis=AXIS)
    (loop,) = part.loops
    assert (loop.kind, loop.closed, loop.edges) == ("open", False, 5)
    steps = np.linalg.norm(np.diff(corners, axis=0), axis=1)
    assert loop.length == pytest.approx(steps.sum() * 1e-3, abs=EXACT)
    contour = part.contour(loop.name, closed=False)
    ends = np.array([contour.points[0], contour.points[-1]]) * 1e3
    wanted = corners[[0, -1]] if np.allclose(ends[0], corners[0]) else corners[[-1, 0]]
    np.testing.assert_allclose(ends, wanted, atol=1e-6)
    unit = np.array(AXIS) / np.linalg.norm(AXIS)
    np.testing.assert_allclose(contour.axes, np.tile(unit, (len(contour), 1)), atol=1e-12)
    (open_line,) = [note for note in part.notes if note.startswith("open line")]
    places = [str([float(v) for v in corner]) for corner in corners[[0, -1]]]
    assert any(place in open_line for place in places)


@pytest.mark.parametrize("suffix", ["dxf", "step", "iges"])
def test_a_closed_line_in_space_runs_about_its_axis(tmp_path: Path, suffix: str) -> None:
    """Two squares, one within the other, in a plane however it lies."""
    R = rotation(3)
    paths = []
    for size in (50.0, 20.0):
        square = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0], [-1, -1, 0]]) * size
        paths.append(square @ R.T)
    both = tmp_path / f"both.{suffix}"
    if suffix == "dxf":
        document = new("R2010", units=4)
        for corners in paths:
            document.modelspace().add_polyline3d(corners.tolist())
        document.saveas(both)
    else:
        edges = [line(p, q) for c in paths for p, q in itertools.pairwise(c.tolist())]
        (write_step if suffix == "step" else write_iges)(both, compound(*edges))
    part = read(both, axis=-R[:, 2])
    assert [loop.kind for loop in part.loops] == ["outer", "inner"]
    for loop, sign in zip(part.loops, (1, -1), strict=True):
        contour = part.contour(loop.name)
        area = np.cross(contour.points[:-1], contour.points[1:]).sum(axis=0) / 2
        size = 1e-3 * (100 if sign > 0 else 40)
        np.testing.assert_allclose(area, sign * size**2 * R[:, 2], atol=EXACT)


def curves() -> list[TopoDS_Shape]:
    poles = Array1_gp_Pnt(1, 4)
    for k, at in enumerate([(0, 0, 0), (10, 20, 5), (30, -20, 9), (40, 0, 3)], start=1):
        poles.SetValue(k, gp_Pnt(*at))
    across = gp_Ax2(gp_Pnt(0, 0, 50), gp_Dir(1, 2, 3))
    return [
        BRepBuilderAPI_MakeEdge(Geom_BezierCurve(poles)).Edge(),
        BRepBuilderAPI_MakeEdge(gp_Circ(across, 12.0), 0.2, 4.0).Edge(),
        BRepBuilderAPI_MakeEdge(gp_Elips(across, 40.0, 25.0)).Edge(),
    ]


@pytest.mark.parametrize("write", [write_step, write_iges])
def test_every_kind_of_curve_is_as_long_as_it_is_drawn(
    tmp_path: Path, write: Callable[[Path, TopoDS_Shape], Path]
) -> None:
    name = "curves.step" if write is write_step else "curves.iges"
    part = read(write(tmp_path / name, compound(*curves())), axis=(0, 0, -1))
    t = np.linspace(0, 1, 20001)[:, None]
    p = np.array([(0, 0, 0), (10, 20, 5), (30, -20, 9), (40, 0, 3)], dtype=float)
    bezier = sum(c * t**k * (1 - t) ** (3 - k) * p[k] for k, c in enumerate((1, 3, 3, 1)))
    around = 2 * np.pi * t
    ellipse = np.hstack([40 * np.cos(around), 25 * np.sin(around)])
    lengths = [np.linalg.norm(np.diff(x, axis=0), axis=1).sum() for x in (bezier, ellipse)]
    wanted = sorted([*lengths, 12 * 3.8])
    found = sorted(loop.length * 1e3 for loop in part.loops)
    np.testing.assert_allclose(found, wanted, rtol=1e-7)  # of 20 000 chords
    assert sorted(loop.kind for loop in part.loops) == ["open", "open", "outer"]


def test_an_axis_is_asked_for_where_there_is_none_and_only_there(tmp_path: Path) -> None:
    corners = np.array([[0.0, 0, 0], [10, 0, 5], [20, 5, 0]])
    for suffix in ("dxf", "step", "iges"):
        with pytest.raises(InputError, match="give the tool axis: axis = "):
            read(write_path(tmp_path / f"path.{suffix}", corners))
    with pytest.raises(InputError, match="axis: expected a drawing of lines, got one of faces"):
        read(write_step(tmp_path / "box.step", box(1, 2, 3)), axis=(0, 0, -1))
    with pytest.raises(InputError, match="axis: expected a direction"):
        read(tmp_path / "path.dxf", axis=(0, 0, 0))


# --- tables ----------------------------------------------------------------------------------

ROWS = np.array([[0, 0, 0, 0, 0, 1], [10, 0, 0, 0, 0, 1], [10, 5, 1, 0, 0, 1.0]])


def same_as_plain(tmp_path: Path, part: Part) -> None:
    plain = tmp_path / "plain.csv"
    rows = "\n".join(",".join(map(str, row)) for row in ROWS.tolist())
    plain.write_text("x_mm,y_mm,z_mm,nx,ny,nz\n" + rows)
    (loop,), (wanted,) = part.loops, read(plain).loops
    np.testing.assert_array_equal(loop._trace.around, wanted._trace.around)
    contour, other = (p.contour(p.loops[0].name, closed=False) for p in (part, read(plain)))
    np.testing.assert_allclose(contour.axes, other.axes, atol=1e-15)


NAMED = {"x": "Pos X [mm]", "y": "pos y [MM]", "z": "Höhe (mm)", "nx": "I", "ny": "J", "nz": "K"}


@pytest.mark.parametrize("separator", [",", ";", "\t", "|", " | "])
@pytest.mark.parametrize("seed", [1, 2])
def test_columns_may_have_any_name_and_order(tmp_path: Path, separator: str, seed: int) -> None:
    order = np.random.default_rng(seed).permutation(8)
    # Two columns more: one not used, and one that bears a name which another was given.
    heads = np.array([*NAMED.values(), "feed", "x"], dtype=object)[order]
    cells = np.column_stack([ROWS, 7 + ROWS[:, :1], -ROWS[:, 1:2]])[:, order]
    lines = [separator.join(heads), *(separator.join(map(str, row)) for row in cells.tolist())]
    path = tmp_path / "table.csv"
    path.write_text("\n".join(lines), encoding="utf-8")
    part = read(path, columns=NAMED)
    assert part.unit == "mm"
    assert any("columns not used: " in note and "feed" in note for note in part.notes)
    same_as_plain(tmp_path, part)


@pytest.mark.parametrize("header", ["", "a,b,c,d,e,f,g,h\n"])
def test_columns_are_said_in_order_where_no_header_does(tmp_path: Path, header: str) -> None:
    order = ["nx", "-", "z", "y", "x", "-", "ny", "nz"]
    at = {"x": 0, "y": 1, "z": 2, "nx": 3, "ny": 4, "nz": 5}
    cells = [[9.0 if n == "-" else row[at[n]] for n in order] for row in ROWS.tolist()]
    path = tmp_path / "table.csv"
    path.write_text(header + "\n".join(",".join(map(str, row)) for row in cells))
    same_as_plain(tmp_path, read(path, "mm", columns=order))


def test_points_without_axes_take_the_one_that_is_said(tmp_path: Path) -> None:
    rows = "\n".join(",".join(map(str, row)) for row in ROWS[:, :3].tolist())
    for header in ("", "x,y,z\n", "X [mm],Y [mm],Z [mm]\n"):
        path = tmp_path / "table.csv"
        path.write_text(header + rows)
        same_as_plain(tmp_path, read(path, "mm", axis=(0, 0, -2)))
        with pytest.raises(InputError, match=r"axis|columns"):
            read(path, "mm")


BAD: dict[str, tuple[Mapping[str, str] | Sequence[str], str]] = {
    "no such name": ({"v": "a"}, "expected names of x y z .*got 'v'"),
    "no such column": ({"x": "q"}, "line 1: expected one column 'q' for x, got x y z"),
    "too few": (["x", "y"], "expected columns x y z"),
    "an unknown one": (["x", "y", "z", "feed"], "got 'feed'"),
    "one twice": (["x", "y", "z", "x"], "twice"),
    "another width": (["x", "y", "z", "nx", "ny", "nz", "-"], "expected 7 columns, got 6"),
}


@pytest.mark.parametrize("case", BAD)
def test_columns_that_are_none_are_refused(tmp_path: Path, case: str) -> None:
    columns, match = BAD[case]
    path = tmp_path / "table.csv"
    path.write_text("x,y,z,nx,ny,nz\n0,0,0,0,0,1\n1,0,0,0,0,1\n")
    with pytest.raises(InputError, match=match):
        read(path, "mm", columns=columns)
    with pytest.raises(InputError, match="columns: expected a table"):
        read(write_step(tmp_path / "box.step", box(1, 2, 3)), columns=["x"])
