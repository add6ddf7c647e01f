"""STEP files in: loops, orientation, sampling, units, names, the shipped part, and bad files."""

from __future__ import annotations

import functools
import importlib.util
import itertools
import re
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from OCP.BRep import BRep_Builder, BRep_Tool
from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut
from OCP.BRepBuilderAPI import (
    BRepBuilderAPI_MakeEdge,
    BRepBuilderAPI_MakeFace,
    BRepBuilderAPI_MakeWire,
)
from OCP.BRepClass3d import BRepClass3d_SolidClassifier
from OCP.BRepPrimAPI import (
    BRepPrimAPI_MakeBox,
    BRepPrimAPI_MakeCone,
    BRepPrimAPI_MakeCylinder,
    BRepPrimAPI_MakeSphere,
    BRepPrimAPI_MakeTorus,
)
from OCP.collections import Array2_gp_Pnt
from OCP.GeomAPI import GeomAPI_PointsToBSplineSurface, GeomAPI_ProjectPointOnSurf
from OCP.GeomLProp import GeomLProp_SLProps
from OCP.gp import gp_Ax1, gp_Ax2, gp_Dir, gp_Pnt, gp_Trsf, gp_Vec
from OCP.Interface import Interface_Static
from OCP.Message import Message, Message_PrinterOStream
from OCP.STEPConstruct import STEPConstruct
from OCP.STEPControl import STEPControl_StepModelType, STEPControl_Writer
from OCP.TCollection import TCollection_AsciiString, TCollection_HAsciiString
from OCP.TopAbs import TopAbs_ShapeEnum, TopAbs_State
from OCP.TopExp import TopExp_Explorer
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS_Compound, TopoDS_Shape

from conftest import ROOT
from kerfpath.cad import Loop, Part, read
from kerfpath.cad.build import loop_of
from kerfpath.cad.curves import EdgeChain
from kerfpath.errors import InputError

B_PILLAR = ROOT / "src" / "kerfpath" / "demo" / "b_pillar.step"

EXACT = 1e-9
"""m: STEP writes 13 digits, and lines and circles are exact."""


def write_step(
    path: Path, shape: TopoDS_Shape, *, unit: str = "MM", names: dict[int, str] | None = None
) -> Path:
    """Write `shape` (mm) as STEP in `unit`, faces called `names` by their 1-based number."""
    Message.DefaultMessenger_s().ChangePrinters().Clear()
    writer = STEPControl_Writer()
    Interface_Static.SetCVal_s("write.step.unit", unit)
    try:
        writer.Transfer(shape, STEPControl_StepModelType.STEPControl_AsIs)
    finally:
        Interface_Static.SetCVal_s("write.step.unit", "MM")
    explorer = TopExp_Explorer(shape, TopAbs_ShapeEnum.TopAbs_FACE)
    for number in itertools.count(1):
        if not explorer.More():
            break
        if names and number in names:
            process = writer.WS().TransferWriter().FinderProcess()
            entity = STEPConstruct.FindEntity_s(process, explorer.Current())
            entity.SetName(TCollection_HAsciiString(names[number]))
        explorer.Next()
    writer.Write(str(path))
    return path


def box(x: float, y: float, z: float) -> TopoDS_Shape:
    return BRepPrimAPI_MakeBox(x, y, z).Shape()


def cylinder(
    radius: float, height: float, at: tuple[float, float, float] = (0, 0, 0), along: str = "z"
) -> TopoDS_Shape:
    direction = {"x": (1, 0, 0), "y": (0, 1, 0), "z": (0, 0, 1)}[along]
    axes = gp_Ax2(gp_Pnt(*at), gp_Dir(*direction))
    return BRepPrimAPI_MakeCylinder(axes, radius, height).Shape()


def cut(shape: TopoDS_Shape, *tools: TopoDS_Shape) -> TopoDS_Shape:
    for tool in tools:
        shape = BRepAlgoAPI_Cut(shape, tool).Shape()
    return shape


def plate() -> TopoDS_Shape:
    """A plate 100 x 60 x 2 with holes of 10 and 20 mm, the smaller one at smaller x."""
    holes = cylinder(10, 4, (70, 30, -1)), cylinder(5, 4, (20, 40, -1))
    return cut(box(100, 60, 2), *holes)


def tube(*holes: TopoDS_Shape) -> TopoDS_Shape:
    """A tube of radius 30 and 28, length 100 along z; its seams are at +x."""
    return cut(cylinder(30, 100), cylinder(28, 120, (0, 0, -10)), *holes)


def placed(shape: TopoDS_Shape, angle: float, x: float) -> TopoDS_Shape:
    move = gp_Trsf()
    move.SetRotation(gp_Ax1(gp_Pnt(), gp_Dir(1, 2, 3)), angle)
    move.SetTranslationPart(gp_Vec(x, 0, 0))
    return shape.Located(TopLoc_Location(move))


def compound(*shapes: TopoDS_Shape) -> TopoDS_Shape:
    whole = TopoDS_Compound()
    BRep_Builder().MakeCompound(whole)
    for shape in shapes:
        BRep_Builder().Add(whole, shape)
    return whole


def round_parts() -> dict[str, TopoDS_Shape]:
    return {
        "plate": plate(),
        "tube": tube(),
        "tube with holes on and off the seam": tube(
            cylinder(8, 100, (0, 0, 30), "x"), cylinder(6, 100, (0, 0, 70), "y")
        ),
        "cone with a tip": BRepPrimAPI_MakeCone(20.0, 0.0, 40.0).Shape(),
        "drilled ball": cut(BRepPrimAPI_MakeSphere(25.0).Shape(), cylinder(6, 80, (0, 0, -40))),
        "drilled ring": cut(
            BRepPrimAPI_MakeTorus(40.0, 10.0).Shape(), cylinder(4, 80, (40, 0, -40))
        ),
        "turned plate": placed(plate(), 1.1, 50.0),
        "tilted assembly": compound(placed(plate(), 0.4, 0.0), placed(tube(), 2.0, 300.0)),
    }


PARTS = list(round_parts())


@functools.cache
def solid(name: str) -> TopoDS_Shape:
    return round_parts()[name]


@pytest.fixture
def part(request: pytest.FixtureRequest, tmp_path: Path) -> Part:
    return read(write_step(tmp_path / "part.step", solid(request.param)))


each_part = pytest.mark.parametrize("part", PARTS, indirect=True)


def winding(points: np.ndarray, normals: np.ndarray) -> float:
    """Return the signed area of a closed polygon about its mean normal, mm^2 or m^2."""
    area = np.cross(points[:-1], points[1:]).sum(axis=0) / 2
    return float(area @ normals.mean(axis=0))


# --- worked examples -------------------------------------------------------------------------


def test_plate_has_its_loops_with_exact_lengths_and_diameters(tmp_path: Path) -> None:
    part = read(write_step(tmp_path / "plate.step", plate()))
    np.testing.assert_allclose(part.bounding_box, [[0, 0, 0], [0.1, 0.06, 0.002]], atol=EXACT)
    assert part.unit == "mm"
    assert part.faces == 8
    tops = [
        loop.face
        for loop in part.loops
        if loop.name.endswith("/outer") and loop.bounding_box[0, 2] > 0.002 - EXACT
    ]
    assert len(tops) == 1
    outer, first, second = (
        part.loop(f"{tops[0]}/{which}") for which in ("outer", "hole1", "hole2")
    )
    assert outer.length == pytest.approx(0.32, abs=EXACT)
    assert (outer.edges, outer.surface, outer.diameter) == (4, "plane", None)
    assert outer.shortest_edge == pytest.approx(0.06, abs=EXACT)
    # Holes are numbered by their centre's x, whatever the order in the file.
    assert first.length == pytest.approx(np.pi * 0.01, abs=EXACT)
    assert first.diameter == pytest.approx(0.01, abs=EXACT)
    assert second.diameter == pytest.approx(0.02, abs=EXACT)
    np.testing.assert_allclose(
        second.bounding_box, [[0.06, 0.02, 0.002], [0.08, 0.04, 0.002]], atol=EXACT
    )
    assert first.kind == second.kind == "inner"
    assert first.closed
    assert first.largest_gap < EXACT


def test_box_loops_enclose_the_faces_areas(tmp_path: Path) -> None:
    part = read(write_step(tmp_path / "box.step", box(10, 20, 30)))
    areas = []
    for loop in part.loops:
        contour = part.contour(loop.name)
        areas.append(winding(contour.points, -contour.axes))
        assert contour.length == pytest.approx(loop.length, abs=EXACT)
    np.testing.assert_allclose(sorted(areas), [2e-4, 2e-4, 3e-4, 3e-4, 6e-4, 6e-4], atol=1e-12)


def test_tube_has_two_rims_and_no_loop_with_a_seam(tmp_path: Path) -> None:
    part = read(write_step(tmp_path / "tube.step", tube()))
    walls = [loop for loop in part.loops if loop.surface == "cylinder"]
    assert sorted(loop.name.split("/")[1] for loop in walls) == [
        "outer1",
        "outer1",
        "outer2",
        "outer2",
    ]
    for loop in walls:
        assert loop.edges == 1
        radius = 30 if loop.diameter == pytest.approx(0.06, abs=EXACT) else 28
        assert loop.length == pytest.approx(2 * np.pi * radius * 1e-3, abs=EXACT)
        assert loop.diameter == pytest.approx(2 * radius * 1e-3, abs=EXACT)


def test_hole_across_the_seam_is_a_loop_of_its_own(tmp_path: Path) -> None:
    bored = tube(cylinder(8, 60, (0, 0, 30), "x"), cylinder(8, 60, (0, 0, 70), "y"))
    part = read(write_step(tmp_path / "tube.step", bored))
    rims = [loop for loop in part.loops if loop.name.endswith("/outer1")]
    wall = next(loop.face for loop in rims if loop.diameter == pytest.approx(0.06))
    outside = [loop for loop in part.loops if loop.face == wall and loop.kind == "inner"]
    assert len(outside) == 2
    on_seam, off_seam = sorted(outside, key=lambda loop: loop.bounding_box[0, 2])
    # The same cutter makes both, so the seam must not show but in the number of edges.
    assert on_seam.length == pytest.approx(off_seam.length, rel=1e-6)
    assert on_seam.edges == 2
    assert on_seam.closed
    for loop in outside:
        contour = part.contour(loop.name)
        np.testing.assert_allclose(contour.points[0], contour.points[-1])
        assert winding(contour.points, -contour.axes) < 0
    assert part.loop(on_seam.name).kind == "inner"


def test_hole_in_a_curved_sheet_still_has_a_diameter(tmp_path: Path) -> None:
    part = read(write_step(tmp_path / "tube.step", tube(cylinder(5, 60, (0, 0, 50), "y"))))
    walls = [loop for loop in part.loops if loop.kind == "inner" and loop.surface == "cylinder"]
    diameters = [loop.diameter for loop in walls]
    assert len(diameters) == 2
    # Drilled along the mean normal it is round seen along it; OCCT intersects within 1e-7 mm.
    assert diameters == pytest.approx([0.01, 0.01], abs=1e-9)


def test_slot_has_no_diameter(tmp_path: Path) -> None:
    slotted = cut(box(100, 60, 2), cylinder(5, 4, (30, 30, -1)), cylinder(5, 4, (33, 30, -1)))
    part = read(write_step(tmp_path / "slot.step", slotted))
    holes = [loop for loop in part.loops if loop.kind == "inner"]
    assert len(holes) == 2
    assert all(loop.diameter is None for loop in holes)


def test_open_surface_uses_its_oriented_normal(tmp_path: Path) -> None:
    wire = BRepBuilderAPI_MakeWire()
    corners = [gp_Pnt(*p) for p in ((0, 0, 0), (40, 0, 0), (40, 30, 0), (0, 30, 0))]
    for start, end in zip(corners, corners[1:] + corners[:1], strict=True):
        wire.Add(BRepBuilderAPI_MakeEdge(start, end).Edge())
    face = BRepBuilderAPI_MakeFace(wire.Wire()).Face()
    for name, shape, up in (("up", face, 1.0), ("down", face.Reversed(), -1.0)):
        part = read(write_step(tmp_path / f"{name}.step", shape))
        contour = part.contour("face1/outer")
        np.testing.assert_allclose(
            contour.axes, np.tile([0, 0, -up], (len(contour), 1)), atol=1e-12
        )
        assert winding(contour.points, -contour.axes) == pytest.approx(1.2e-3)


# --- laws ------------------------------------------------------------------------------------


@each_part
def test_tool_axis_points_into_the_material(part: Part, request: pytest.FixtureRequest) -> None:
    name = request.node.callspec.params["part"]
    classify = BRepClass3d_SolidClassifier(solid(name))
    for loop in part.loops:
        contour = part.contour(loop.name)
        # A hair beside the edge on the face, then a hair below and above it. Beside the edge is to
        # the left of travel seen with the outward normal up, so this checks the direction too.
        k = len(contour) // 3
        step = contour.points[k + 1] - contour.points[k]
        left = np.cross(-contour.axes[k], step / np.linalg.norm(step))
        beside = (contour.points[k] + contour.points[k + 1]) / 2 + 2e-4 * left
        states = []
        for depth in (5e-5, -5e-5):
            classify.Perform(gp_Pnt(*((beside + depth * contour.axes[k]) * 1e3)), 1e-7)
            states.append(classify.State())
        assert states == [TopAbs_State.TopAbs_IN, TopAbs_State.TopAbs_OUT], loop.name


@each_part
def test_loops_close_and_measure_as_their_contours(part: Part) -> None:
    assert len({loop.name for loop in part.loops}) == len(part.loops)
    for loop in part.loops:
        contour = part.contour(loop.name)
        assert contour.closed
        assert contour.name == loop.name
        np.testing.assert_array_equal(contour.points[0], contour.points[-1])
        # Chords are shorter than arcs by (8/3) (chord error)^2 / chord: below a hundredth here.
        assert contour.length == pytest.approx(loop.length, rel=1e-3)
        assert contour.length <= loop.length * (1 + 1e-9)
        low, high = loop.bounding_box
        assert (contour.points >= low - 1e-6).all()
        assert (contour.points <= high + 1e-6).all()


@each_part
@pytest.mark.parametrize(("chord", "angle"), [(2e-6, 0.002), (1e-5, 0.05), (1e-3, 0.01)])
def test_chords_and_axes_keep_their_tolerances(part: Part, chord: float, angle: float) -> None:
    for loop in part.loops:
        contour = part.contour(loop.name, chord_tolerance=chord, axis_tolerance=angle)
        worst = worst_chord(part, loop, contour.points)
        assert worst <= chord, loop.name
        # At a joint two edges of one face meet, their normals are the same; so no exception there.
        turned = np.linalg.norm(np.diff(contour.axes, axis=0), axis=1)
        assert 2 * np.arcsin(turned.max() / 2) <= angle * (1 + 1e-9), loop.name


def worst_chord(part: Part, loop: Loop, points: np.ndarray) -> float:
    """Return the largest distance (m) from dense points of the loop's edges to the polyline."""
    worst = 0.0
    start, step = points[:-1], np.diff(points, axis=0)
    for edge in loop._trace.edges:
        t = np.concatenate([np.linspace(a, b, 200) for a, b in itertools.pairwise(edge.breaks())])
        for p in edge.evaluate(t[:: max(1, len(t) // 400)])[0] * 1e-3:
            along = np.clip(((p - start) * step).sum(1) / (step**2).sum(1), 0, 1)
            worst = max(worst, np.linalg.norm(start + along[:, None] * step - p, axis=1).min())
    return worst


def test_mesh_is_closed_and_encloses_the_volume(tmp_path: Path) -> None:
    part = read(write_step(tmp_path / "part.step", placed(tube(), 0.7, 100.0)))
    vertices, triangles = part.mesh(1e-5)
    corners = vertices[triangles]
    volume = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6
    # Triangles inscribed within 10 um of walls 2 mm thick.
    assert volume == pytest.approx(np.pi * (0.03**2 - 0.028**2) * 0.1, rel=1e-2)
    np.testing.assert_allclose(
        [vertices.min(axis=0), vertices.max(axis=0)], part.bounding_box, atol=2e-5
    )
    coarse = part.mesh(1e-3)[1]
    assert len(coarse) < len(triangles)
    np.testing.assert_array_equal(part.mesh(1e-5)[1], triangles)


def test_a_ball_has_no_loop_but_faces(tmp_path: Path) -> None:
    part = read(write_step(tmp_path / "ball.step", BRepPrimAPI_MakeSphere(5.0).Shape()))
    assert (part.faces, part.loops) == (1, ())
    with pytest.raises(InputError, match="no face has an edge"):
        part.loop("face1/outer")


# --- units, placements, names ----------------------------------------------------------------


@pytest.mark.parametrize(
    ("written", "shown"),
    [("MM", "mm"), ("M", "m"), ("INCH", "in"), ("CM", "cm"), ("FT", "ft"), ("UM", "um")],
)
def test_header_units_are_converted(tmp_path: Path, written: str, shown: str) -> None:
    part = read(write_step(tmp_path / "part.step", plate(), unit=written))
    assert part.unit == shown
    np.testing.assert_allclose(part.bounding_box[1], [0.1, 0.06, 0.002], atol=EXACT)


@pytest.mark.parametrize("written", ["MM", "M", "INCH"])
@pytest.mark.parametrize(("unit", "size"), [("mm", 1e-3), ("m", 1.0), ("in", 0.0254)])
def test_unit_overrides_the_header(tmp_path: Path, written: str, unit: str, size: float) -> None:
    numbers = {"MM": 1.0, "M": 1e-3, "INCH": 1 / 25.4}[written] * np.array([100, 60, 2])
    path = write_step(tmp_path / "part.step", plate(), unit=written)
    part = read(path, unit=unit)
    np.testing.assert_allclose(part.bounding_box[1], numbers * size, rtol=1e-9)
    assert read(path).bounding_box[1, 0] == pytest.approx(0.1)


def test_assembly_placements_are_applied(tmp_path: Path) -> None:
    STEPControl_Writer()  # declares the setting
    Interface_Static.SetIVal_s("write.step.assembly", 1)
    try:
        shape = compound(placed(box(10, 10, 10), 0.0, 0.0), placed(box(10, 10, 10), 0.0, 950.0))
        path = write_step(tmp_path / "assembly.step", shape)
    finally:
        Interface_Static.SetIVal_s("write.step.assembly", 2)
    assert "NEXT_ASSEMBLY_USAGE_OCCURRENCE" in path.read_text("ascii")
    part = read(path)
    np.testing.assert_allclose(part.bounding_box, [[0, 0, 0], [0.96, 0.01, 0.01]], atol=EXACT)
    assert part.faces == 12


def test_faces_are_called_by_their_names_and_numbered_when_they_have_none(tmp_path: Path) -> None:
    names = {2: "skin", 4: "skin", 5: "NONE", 6: "Ober fl. (1)"}
    part = read(write_step(tmp_path / "box.step", box(1, 2, 3), names=names))
    faces = [loop.face for loop in part.loops]
    assert faces == ["face1", "skin", "face3", "skin-2", "face5", "Ober fl. (1)"]
    again = read(part.path)
    assert [loop.name for loop in again.loops] == [loop.name for loop in part.loops]


def test_unknown_loop_lists_close_names(tmp_path: Path) -> None:
    part = read(write_step(tmp_path / "plate.step", plate(), names={1: "skin"}))
    with pytest.raises(
        InputError, match=r"no loop 'skin/outr' among its \d+; did you mean skin/outer"
    ):
        part.loop("skin/outr")
    with pytest.raises(InputError, match="face2/outer"):
        part.contour("zzzzzzzzz")


@pytest.mark.parametrize("argument", ["chord_tolerance", "axis_tolerance"])
@pytest.mark.parametrize("value", [0.0, -1.0, float("nan"), float("inf")])
def test_tolerances_must_be_positive(tmp_path: Path, argument: str, value: float) -> None:
    part = read(write_step(tmp_path / "box.step", box(1, 2, 3)))
    with pytest.raises(InputError, match=argument):
        part.contour("face1/outer", **{argument: value})


# --- bad files -------------------------------------------------------------------------------


@functools.cache
def plate_text(directory: Path) -> str:
    return write_step(directory / "plate.step", plate()).read_text("ascii")


@pytest.fixture(scope="module")
def text(tmp_path_factory: pytest.TempPathFactory) -> str:
    return plate_text(tmp_path_factory.mktemp("plate"))


def without_unit(text: str) -> str:
    """Return the STEP text with a context that assigns angles but no length."""
    return re.sub(r"(GLOBAL_UNIT_ASSIGNED_CONTEXT\s*\(\()#\d+,", r"\1", text)


BAD: dict[str, tuple[Callable[[str], str], str]] = {
    "empty": (lambda text: "", "is empty"),
    "blank": (lambda text: " \n\n", "is empty"),
    "other format": (lambda text: "solid part\nfacet normal 0 0 1\n", "not a STEP file"),
    "truncated": (lambda text: text[: len(text) // 2], "truncated"),
    "syntax": (
        lambda text: text.replace("CARTESIAN_POINT('',(0.", "CARTESIAN_POINT('',((0.", 1),
        r"damaged \(.*Line \d+: Incorrect syntax",
    ),
    "no data": (lambda text: text.replace("DATA;", "", 1), "cannot be parsed"),
    "number out of range": (
        lambda text: text.replace("#12 =", "#2147483648 ="),
        "2147483648 is more",
    ),
    "a number twice": (lambda text: text.replace("#12 =", "#13 ="), "#13 is defined 2 times"),
    "a number cut": (lambda text: text.replace("(100.,", "(1,5.D,", 1), r"Line \d+: Incorrect"),
    "an empty list in a list": (
        lambda text: text.replace("NAL_REPRESENTATION('',(#38)", "NAL_REPRESENTATION('',(())"),
        "damaged",
    ),
    "unresolved reference": (
        lambda text: text.replace("EDGE_LOOP('',(#", "EDGE_LOOP('',(#99", 1),
        r"damaged .*Unresolved Reference",
    ),
    "astray": (
        lambda text: text.replace("CARTESIAN_POINT('',(100.,", "CARTESIAN_POINT('',(1.E+200,"),
        "a point lies at .* further than 10 km",
    ),
    "header only": (
        lambda text: text[: text.index("DATA;")] + "DATA;\nENDSEC;\nEND-ISO-10303-21;\n",
        "it has no DATA",
    ),
}


@pytest.fixture
def chatty(capfd: pytest.CaptureFixture[str]) -> Iterator[None]:
    """Let OCCT print, as it does in a fresh process."""
    messenger, printer = Message.DefaultMessenger_s(), Message_PrinterOStream()
    messenger.AddPrinter(printer)
    messenger.SendFail(TCollection_AsciiString("heard"))
    assert "heard" in "".join(capfd.readouterr())
    yield
    messenger.RemovePrinter(printer)


@pytest.mark.parametrize("case", BAD)
def test_bad_files_are_refused_in_one_line(
    tmp_path: Path, text: str, case: str, chatty: None, capfd: pytest.CaptureFixture[str]
) -> None:
    spoil, expected = BAD[case]
    path = tmp_path / "bad.step"
    path.write_text(spoil(text), "ascii")
    with pytest.raises(InputError, match=expected) as caught:
        read(path)
    assert "\n" not in str(caught.value)
    assert str(path) in str(caught.value)
    assert capfd.readouterr() == ("", "")


def test_missing_file_and_directory_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"none\.step: no such file"):
        read(tmp_path / "none.step")
    with pytest.raises(InputError, match="is a directory"):
        read(tmp_path)


def test_curves_alone_are_refused(tmp_path: Path) -> None:
    edge = BRepBuilderAPI_MakeEdge(gp_Pnt(0, 0, 0), gp_Pnt(1, 0, 0)).Edge()
    with pytest.raises(InputError, match="holds no face"):
        read(write_step(tmp_path / "curve.step", BRepBuilderAPI_MakeWire(edge).Wire()))


def test_unknown_unit_is_refused_with_the_known_ones(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"unit: expected one of um, mm, .*got 'furlong'"):
        read(tmp_path / "none.step", unit="furlong")


def test_file_without_a_unit_is_refused_unless_told(tmp_path: Path, text: str) -> None:
    path = tmp_path / "unitless.step"
    path.write_text(without_unit(text), "ascii")
    with pytest.raises(InputError, match=r"not known; give that of its numbers.*--unit mm"):
        read(path)
    assert read(path, unit="mm").bounding_box[1, 0] == pytest.approx(0.1)


def test_good_files_are_read_in_silence(
    tmp_path: Path, text: str, chatty: None, capfd: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "plate.step"
    path.write_text(text, "ascii")
    part = read(path)
    part.contour(part.loops[0].name)
    part.mesh()
    assert capfd.readouterr() == ("", "")


def test_gap_in_a_loop_is_reported_with_its_place(tmp_path: Path) -> None:
    part = read(write_step(tmp_path / "box.step", box(10, 20, 30)))
    edges = part.loop("face1/outer")._trace.edges
    # OCCT widens the vertices of a gap in the file and calls it closed, so it is opened here.
    edges[1].ends[1] += (0.0, 0.0, 0.2)
    chain = EdgeChain(edges=edges)
    gappy = loop_of(
        name="face1/outer", face="face1", kind="outer", trace=chain, surface="plane", gap=5e-5
    )
    assert not gappy.closed
    assert gappy.largest_gap == pytest.approx(2e-4)
    object.__setattr__(part, "loops", (gappy, *part.loops[1:]))
    with pytest.raises(InputError, match=r"gap of 0\.200 mm after its edge 2, at \["):
        part.contour("face1/outer")


# --- the shipped part ------------------------------------------------------------------------


@pytest.fixture(scope="module")
def b_pillar() -> Part:
    return read(B_PILLAR)


def test_b_pillar_has_its_skin_trim_line_and_holes(b_pillar: Part) -> None:
    skin = [loop for loop in b_pillar.loops if loop.face == "skin"]
    assert [loop.name for loop in skin] == ["skin/outer"] + [f"skin/hole{k}" for k in range(1, 25)]
    assert all(loop.closed and loop.surface == "bspline" for loop in skin)
    assert b_pillar.loop("skin/outer").length == pytest.approx(2.9, abs=0.1)
    found = sorted(round(loop.diameter * 1e3, 1) for loop in skin if loop.diameter)
    assert found == sorted([*[8] * 4, *[10] * 3, 11, 11, 12, 12, 14, 14, 16, 16, 20, 25, 30, 30])
    np.testing.assert_allclose(
        b_pillar.bounding_box[1] - b_pillar.bounding_box[0], [1.2, 0.33, 0.12], atol=0.01
    )


def test_b_pillar_contours_keep_their_tolerances_and_face_outwards(b_pillar: Part) -> None:
    for loop in b_pillar.loops:
        if loop.face == "skin":
            contour = b_pillar.contour(loop.name)
            # On the flanks the sheet stands at up to 55 deg.
            assert (contour.axes[:, 2] < -0.57).all()
            turned = np.linalg.norm(np.diff(contour.axes, axis=0), axis=1)
            assert turned.max() <= 0.002
            if loop.name != "skin/outer":
                assert worst_chord(b_pillar, loop, contour.points) <= 2e-6
            # The cuts meet the next loop's direction rules: outer left, holes right about z.
            assert np.sign(winding(contour.points, -contour.axes)) == (
                1 if loop.kind == "outer" else -1
            )


def test_b_pillar_axes_are_normals_of_its_faces(b_pillar: Part) -> None:
    edge = b_pillar.loop("skin/outer")._trace.edges[0]
    surface = BRep_Tool.Surface_s(edge.face)
    contour = b_pillar.contour("skin/outer")
    for k in range(0, len(contour), 400):
        projected = GeomAPI_ProjectPointOnSurf(gp_Pnt(*(contour.points[k] * 1e3)), surface)
        assert projected.LowerDistance() < 1e-6
        at = GeomLProp_SLProps(surface, *projected.LowerDistanceParameters(), 1, 1e-9)
        normal = at.Normal()
        across = np.cross(contour.axes[k], [normal.X(), normal.Y(), normal.Z()])
        # The joint of the loop averages the normals of its two ends, which agree to their digits.
        assert np.linalg.norm(across) < 1e-6


def test_b_pillar_file_is_what_its_script_writes(tmp_path: Path) -> None:
    spec = importlib.util.spec_from_file_location(
        "model_b_pillar", ROOT / "examples" / "model_b_pillar.py"
    )
    assert spec is not None
    assert spec.loader is not None
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    for name in ("first.step", "second.step"):
        script.write(tmp_path / name)
        assert (tmp_path / name).read_bytes() == B_PILLAR.read_bytes()


def test_the_healed_surface_goes_on_over_a_hole(tmp_path: Path) -> None:
    bored = tube(cylinder(5, 60, (0, 0, 50), "y"))
    part = read(write_step(tmp_path / "tube.step", bored))
    holes = [loop.name for loop in part.loops if loop.kind == "inner" and loop.diameter]
    contours = [part.contour(name) for name in holes]
    outside = int(np.argmax([np.hypot(*c.points[0, :2]) for c in contours]))
    contour, surface = contours[outside], part.surface(holes[outside])
    # The loop lies on it.
    on, normals = surface.project(contour.points)
    np.testing.assert_allclose(on, contour.points, atol=1e-9)
    np.testing.assert_allclose(normals, -contour.axes, atol=1e-6)
    # Amid the hole, where there is no material, it is still the tube's outside.
    amid = contour.points[:-1].mean(axis=0)
    assert np.hypot(*amid[:2]) < 0.03 - 1e-4
    on, normals = surface.project(amid[None])
    assert np.hypot(*on[0, :2]) == pytest.approx(0.03, abs=1e-9)
    np.testing.assert_allclose(normals[0, :2], on[0, :2] / 0.03, atol=1e-9)


def test_where_a_surface_ends_the_healed_one_goes_on_straight(tmp_path: Path) -> None:
    # A spline patch z = x^2 / 200 over 100 x 60 mm knows nothing beyond its own edges.
    grid = Array2_gp_Pnt(1, 12, 1, 8)
    for i, x in enumerate(np.linspace(0, 100, 12), 1):
        for j, y in enumerate(np.linspace(0, 60, 8), 1):
            grid.SetValue(i, j, gp_Pnt(x, y, x * x / 200))
    face = BRepBuilderAPI_MakeFace(GeomAPI_PointsToBSplineSurface(grid).Surface(), 1e-6).Face()
    part = read(write_step(tmp_path / "patch.step", face))
    surface = part.surface(part.loops[0].name)
    asked = np.array([[0.105, 0.03, 0.055], [0.05, 0.03, 0.0125]])
    on, normals = surface.project(asked)
    # At x = 100 mm the patch rises one to one: beyond it goes on at that slope.
    assert on[0, 2] - 0.05 == pytest.approx(on[0, 0] - 0.1, abs=1e-6)
    assert abs(normals[0] @ [-1, 0, 1]) == pytest.approx(np.sqrt(2), abs=1e-6)
    np.testing.assert_allclose(on[1], asked[1], atol=1e-6)  # what splines leave of a parabola


def test_a_drawing_of_points_is_healed_by_planes(tmp_path: Path) -> None:
    file = tmp_path / "ring.csv"
    t = np.linspace(0, 2 * np.pi, 60, endpoint=False)
    rows = [f"{30 * np.cos(a)},{30 * np.sin(a)},5,0,0,-1" for a in t]
    file.write_text("\n".join(["x,y,z,nx,ny,nz", *rows, rows[0]]) + "\n")
    part = read(file, unit="mm")
    on, _ = part.surface(part.loops[0].name).project(np.array([[0.01, 0.0, 0.02]]))
    np.testing.assert_allclose(on, [[0.01, 0.0, 0.005]], atol=1e-12)
