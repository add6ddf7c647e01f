"""Skins of smooth faces, sheets' sides, holes over seams and faces, IGES, assemblies, picking."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from OCP.BRepAlgoAPI import BRepAlgoAPI_Fuse
from OCP.BRepPrimAPI import BRepPrimAPI_MakeCylinder
from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt, gp_Trsf, gp_Vec
from OCP.Interface import Interface_Static
from OCP.STEPControl import STEPControl_Writer
from OCP.TopAbs import TopAbs_ShapeEnum
from OCP.TopLoc import TopLoc_Location
from tests.cad.test_part import box, compound, cut, cylinder, placed, tube, write_step

from kerfpath.cad import Part, read
from kerfpath.cad.shape import list_shapes
from kerfpath.errors import InputError

EXACT = 1e-9
"""m: STEP and IGES write 13 digits, and lines and circles are exact."""
SEWN = 1e-7
"""m: sewing moves edges by less than OCCT's own confusion, 1e-7 mm, here; lengths are integrals."""


@pytest.fixture(scope="module", params=["step", "iges"])
def bracket(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Part:
    script = request.getfixturevalue("examples")
    path = tmp_path_factory.mktemp("bracket") / f"bracket.{request.param}"
    (script.write_step if request.param == "step" else script.write_iges)(path, script.bracket())
    return read(path)


# --- a bent sheet ----------------------------------------------------------------------------


def test_the_trim_of_a_bent_sheet_is_one_contour_per_side(bracket: Part) -> None:
    for name, side, radius in (("skin1", "outer", 7.0), ("skin2", "inner", 5.0)):
        trim = bracket.loop(f"{name}/outer")
        assert (trim.side, trim.edges, trim.surface) == (side, 8, "skin")
        assert trim.length == pytest.approx(
            (2 * (58 + 43 + radius * np.pi / 2) + 80) * 1e-3, abs=SEWN
        )
        contour = bracket.contour(trim.name)
        assert contour.closed
        # Planes and the bend agree in their normals where they meet: no jump of the axis.
        assert np.linalg.norm(np.diff(contour.axes, axis=0), axis=1).max() <= 0.002
        # Travel keeps the skin on its left: as vector areas, rims go round the normals.
        normal = -contour.axes.mean(axis=0)
        area = np.cross(contour.points[:-1], contour.points[1:]).sum(axis=0) / 2
        assert area @ normal > 0
    assert bracket.pick(side="outer", kind="outer") == (bracket.loop("skin1/outer"),)


def test_a_hole_over_the_bend_is_one_loop_over_its_faces(bracket: Part) -> None:
    over_bend = bracket.loop("skin1/hole2")
    assert over_bend.edges > 2
    assert over_bend.closed
    contour = bracket.contour(over_bend.name)
    # A drill of 12 mm along (1, 0, -1) through (58, 20, 7): all points on its wall.
    off = contour.points - np.array([0.058, 0.02, 0.007])
    along = np.array([1.0, 0.0, -1.0]) / np.sqrt(2)
    radius = np.linalg.norm(off - np.outer(off @ along, along), axis=1)
    np.testing.assert_allclose(radius, 6e-3, atol=3e-6)  # the chord tolerance
    flat = bracket.loop("skin1/hole1")
    assert flat.diameter == pytest.approx(0.01, abs=SEWN)
    assert flat.kind == "inner"


def test_loops_of_single_faces_stay_and_name_their_skin(bracket: Part) -> None:
    pieces = [loop for loop in bracket.loops if loop.skin == "skin1"]
    # Two flats, and the bend, which its hole divides.
    assert len({loop.face for loop in pieces}) == 4
    # Together they have the rims of the skin, and twice both bend lines beside the hole.
    bend_line = 40 - 2 * np.sqrt(6**2 - 7**2 / 2)
    total = sum(loop.length for loop in pieces)
    skin = sum(loop.length for loop in bracket.loops if loop.face == "skin1")
    assert total - skin == pytest.approx(4 * bend_line * 1e-3, abs=1e-6)
    with pytest.raises(InputError, match="no loop among"):
        bracket.pick(face="nothing")
    assert bracket.pick(face=pieces[0].face)


def test_a_sheet_bent_sharply_has_two_sides(tmp_path: Path) -> None:
    script = cut(box(60, 40, 50), placed(box(80, 60, 60), 0.0, -22.0).Located(_shift(-22, -10, 2)))
    part = read(write_step(tmp_path / "sharp.step", script))
    sides = {loop.face: loop.side for loop in part.loops if not loop.face.startswith("skin")}
    assert sorted(sides.values()) == ["edge"] * 4 + ["inner"] * 2 + ["outer"] * 2
    # The outline of either side goes round both flats; the bend between them is not cut.
    outlines = part.pick(kind="outer")
    assert [(loop.name, loop.side) for loop in outlines] == [
        ("skin1/outer", "inner"),
        ("skin2/outer", "outer"),
    ]


def _shift(x: float, y: float, z: float) -> TopLoc_Location:
    move = gp_Trsf()
    move.SetTranslation(gp_Vec(x, y, z))
    return TopLoc_Location(move)


def test_a_block_has_no_sides(tmp_path: Path) -> None:
    part = read(write_step(tmp_path / "block.step", box(50, 50, 50)))
    assert {loop.side for loop in part.loops} == {""}
    assert len(part.pick(kind="outer")) == 6


# --- tubes: seams and halves -----------------------------------------------------------------


def test_holes_of_a_bulged_tube_are_holes_on_the_seam_and_off_it(
    tmp_path: Path, examples: object
) -> None:
    examples.write_step(tmp_path / "tube.step", examples.tube())
    part = read(tmp_path / "tube.step")
    holes = part.pick(side="outer", kind="inner")
    lengths = sorted(loop.length for loop in holes)
    # Fours cut by the same drill at +x, on the seam, and off it; the intersector's tolerance.
    assert lengths[:4] == pytest.approx([lengths[0]] * 4, abs=1e-6)
    assert lengths[4:] == pytest.approx([lengths[4]] * 4, abs=1e-6)
    assert len(holes) == 8
    rims = part.pick(side="outer", kind="outer")
    assert [rim.diameter for rim in rims] == pytest.approx([0.044, 0.044], abs=EXACT)
    # Beyond the end of the tube its surface goes on, however near: z is not brought back to 0.
    beyond = np.array([[0.022, 0.0, -0.0001], [0.0, 0.022, -0.003]])
    rim = min(rims, key=lambda loop: loop.bounding_box[0, 2])
    np.testing.assert_allclose(part.surface(rim.name).project(beyond)[0], beyond, atol=1e-5)


def test_a_tube_of_two_halves_is_one_skin(tmp_path: Path) -> None:
    half = [
        BRepPrimAPI_MakeCylinder(gp_Ax2(gp_Pnt(), gp_Dir(0, 0, 1), gp_Dir(x, 0, 0)), 30, 100, np.pi)
        for x in (1, -1)
    ]
    rod = BRepAlgoAPI_Fuse(half[0].Shape(), half[1].Shape()).Shape()
    drill = cylinder(8, 100, (0, 0, 30), "x")
    part = read(write_step(tmp_path / "tube.step", cut(rod, cylinder(28, 120, (0, 0, -10)), drill)))
    whole = read(write_step(tmp_path / "whole.step", tube(drill)))
    (hole,) = part.pick(side="outer", kind="inner")
    (expected,) = whole.pick(side="outer", kind="inner")
    assert hole.length == pytest.approx(expected.length, rel=1e-6)
    assert hole.edges >= 2
    rims = part.pick(side="outer", kind="outer")
    assert [rim.length for rim in rims] == pytest.approx([0.06 * np.pi] * 2, abs=EXACT)
    assert all(rim.diameter == pytest.approx(0.06, abs=EXACT) for rim in rims)


# --- IGES ------------------------------------------------------------------------------------


def test_iges_is_sewn_and_says_so(tmp_path: Path, examples: object) -> None:
    examples.write_iges(tmp_path / "box.igs", box(10, 20, 30))
    part = read(tmp_path / "box.igs")
    assert any("6 loose faces sewn within 0.05 mm" in note for note in part.notes)
    assert any("0 edges are free" in note for note in part.notes)
    np.testing.assert_allclose(part.bounding_box, [[0, 0, 0], [0.01, 0.02, 0.03]], atol=EXACT)
    for loop in part.loops:
        contour = part.contour(loop.name)
        centre = contour.points[:-1].mean(axis=0)
        # Sewn to a solid, its normals face outwards: tool axes point to the middle.
        assert contour.axes[0] @ (np.array([0.005, 0.01, 0.015]) - centre) > 0


@pytest.mark.parametrize(("written", "shown"), [("MM", "mm"), ("IN", "in"), ("M", "m")])
def test_iges_units_are_converted_and_overridden(
    tmp_path: Path, examples: object, written: str, shown: str
) -> None:
    examples.write_iges(tmp_path / "box.iges", box(10, 20, 30), written)
    part = read(tmp_path / "box.iges")
    assert part.unit == shown
    np.testing.assert_allclose(part.bounding_box[1], [0.01, 0.02, 0.03], atol=SEWN)
    numbers = np.array([10, 20, 30]) * {"MM": 1, "IN": 1 / 25.4, "M": 1e-3}[written]
    told = read(tmp_path / "box.iges", unit="cm")
    assert told.unit == "cm"
    np.testing.assert_allclose(told.bounding_box[1], numbers * 0.01, rtol=1e-6)


def test_loose_faces_of_a_step_are_sewn_and_gaps_over_the_tolerance_stay(tmp_path: Path) -> None:
    faces = list_shapes(box(10, 20, 30), TopAbs_ShapeEnum.TopAbs_FACE)
    for shift, free in ((0.03, 0), (0.2, 8)):
        loose = compound(faces[0].Moved(_shift(-shift, 0, 0)), *faces[1:])
        part = read(write_step(tmp_path / "loose.step", loose))
        (note,) = part.notes
        assert f"{free} edges are free" in note
    assert "widest gap" in note


def with_global(raw: bytes, values: dict[int, str]) -> bytes:
    """Return an IGES file with other values of its global section, by their number in IGES 5.3."""
    lines = raw.splitlines()
    section = b"".join(line[:72] for line in lines if line[72:73] == b"G").decode()
    fields = section.rstrip().rstrip(";").split(",")  # the first two say what separates: , and ;
    fields = [*fields[:2], *(field.strip() for field in fields[2:])]
    for number, value in values.items():
        fields[number - 1] = value
    text = (",".join(fields) + ";").encode()
    made = [text[k : k + 72].ljust(72) + b"G%7d" % (k // 72 + 1) for k in range(0, len(text), 72)]
    head = [line for line in lines if line[72:73] == b"S"]
    rest = [line for line in lines if line[72:73] in (b"D", b"P")]
    last = re.sub(rb"G\s*\d+", b"G%7d" % len(made), lines[-1])
    return b"\n".join([*head, *made, *rest, last]) + b"\n"


@pytest.mark.parametrize(
    "values",
    [
        {18: ""}, {18: "6H040101"}, {18: "15H2004-01-01 1000"}, {18: "13H1040101.10000"}, {25: ""},
        {25: "3H%d."}, {17: ""}, {19: ""}, {20: ""}, {16: "0"}, {15: ""}, {4: "4H%d.i"},
        {4: "5Ha$b.i"}, {21: "2H%s"}, {23: "99"}, {24: "9"}, {17: "", 18: "", 19: "", 25: ""},
    ],
)  # fmt: skip
def test_what_the_head_of_an_iges_file_says_beside_its_unit_does_not_matter(
    tmp_path: Path, examples: object, values: dict[int, str]
) -> None:
    path = tmp_path / "box.igs"
    examples.write_iges(path, box(10, 20, 30), "IN")
    whole = read(path)
    path.write_bytes(with_global(path.read_bytes(), values))
    part = read(path)
    assert part.unit == "in"
    np.testing.assert_allclose(part.bounding_box, whole.bounding_box, atol=EXACT)
    assert [loop.name for loop in part.loops] == [loop.name for loop in whole.loops]


def swapped(raw: bytes, i: int, k: int) -> bytes:
    """Return a file with two of its lines in each other's place."""
    lines = raw.splitlines()
    lines[i], lines[k] = lines[k], lines[i]
    return b"\n".join(lines)


BAD_IGES = {
    "not iges": (lambda raw: b"hello\n", "not an IGES file"),
    "truncated": (lambda raw: raw[: len(raw) // 2], "truncated"),
    "a line missing": (
        lambda raw: b"\n".join(raw.split(b"\n")[:40] + raw.split(b"\n")[41:]), "damaged: expected"
    ),
    "two lines swapped": (lambda raw: swapped(raw, -3, -4), r"expected P\d{7} in columns 73 to 80"),
    "a line astray": (
        lambda raw: raw.replace(b"0000001P0000001", b"0000002P0000001"), "belong to no entity"
    ),
    "sections mixed": (lambda raw: swapped(raw, 1, 7), r"expected G0000001 .*of line 2, got D"),
    "unknown unit": (lambda raw: raw.replace(b",2,2HMM,", b",3,2HXX,"), "unit flag is 3"),
    "no face": (lambda raw: raw, "no face"),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD_IGES)
def test_bad_iges_files_are_refused_in_one_line(
    tmp_path: Path, examples: object, case: str, capfd: pytest.CaptureFixture[str]
) -> None:
    spoil, expected = BAD_IGES[case]
    shape = box(1, 2, 3)
    if case == "no face":
        shape = list_shapes(shape, TopAbs_ShapeEnum.TopAbs_EDGE)[0]
    examples.write_iges(tmp_path / "bad.iges", shape)
    (tmp_path / "bad.iges").write_bytes(spoil((tmp_path / "bad.iges").read_bytes()))
    capfd.readouterr()
    with pytest.raises(InputError, match=expected) as caught:
        read(tmp_path / "bad.iges")
    assert "\n" not in str(caught.value)
    assert str(tmp_path) in str(caught.value)
    assert capfd.readouterr() == ("", "")


# --- assemblies and picking ------------------------------------------------------------------


def test_components_of_an_assembly_name_their_faces(tmp_path: Path) -> None:
    STEPControl_Writer()  # declares the setting
    Interface_Static.SetIVal_s("write.step.assembly", 1)
    try:
        shape = compound(placed(box(10, 10, 10), 0.0, 0.0), placed(box(5, 5, 5), 0.0, 950.0))
        path = write_step(tmp_path / "assembly.step", shape)
    finally:
        Interface_Static.SetIVal_s("write.step.assembly", 2)
    text = path.read_text("ascii")
    first, second = _products(text)[1:3]
    path.write_text(text.replace(f"'{first}'", "'base'").replace(f"'{second}'", "'lid'"))
    part = read(path)
    assert [loop.name for loop in part.loops][:2] == ["base/face1/outer", "base/face2/outer"]
    assert part.loop("lid/face1/outer").bounding_box[0, 0] > 0.9


def _products(text: str) -> list[str]:
    return re.findall(r"PRODUCT\('([^']*)'", text)


def test_picking_by_kind_size_and_place(tmp_path: Path) -> None:
    holes = (
        cylinder(10, 4, (70, 30, -1)),
        cylinder(5, 4, (20, 40, -1)),
        cylinder(4, 4, (20, 20, -1)),
    )
    part = read(write_step(tmp_path / "plate.step", cut(box(100, 60, 2), *holes)))
    top = part.pick(side="outer")
    assert all(loop.bounding_box[0, 2] == pytest.approx(0.002) for loop in top)
    assert [loop.kind for loop in top] == ["outer", "inner", "inner", "inner"]
    small = part.pick(side="outer", diameter=(0.008, 0.010))
    assert [round(loop.diameter, 6) for loop in small] == [0.008, 0.010]
    assert part.pick(side="outer", length=(0.1, float("inf"))) == top[:1]
    (nearest,) = part.pick(kind="inner", side="outer", near=(0.021, 0.041, 0.002))
    assert nearest.diameter == pytest.approx(0.01)
    assert len(part.pick()) == 8
    assert all(loop.side == "edge" for loop in part.pick(side="edge"))
    assert part.largest_gap < EXACT
    assert part.shortest_edge == pytest.approx(0.002, abs=EXACT)


@pytest.mark.parametrize(
    ("asked", "expected"),
    [
        ({"diameter": (0.02, 0.01)}, "diameter: expected"),
        ({"length": (0.1,)}, "length: expected shape"),
        ({"near": (1, 2)}, "near: expected shape"),
        ({"diameter": (1, 2)}, r"no loop among \d+ fits diameter=\(1, 2\)"),
    ],
)
def test_picks_that_make_no_sense_are_refused(
    tmp_path: Path, asked: dict[str, object], expected: str
) -> None:
    part = read(write_step(tmp_path / "box.step", box(10, 20, 30)))
    with pytest.raises(InputError, match=expected):
        part.pick(**asked)


def test_other_files_are_refused_by_their_suffix(tmp_path: Path) -> None:
    (tmp_path / "part.dwg").write_bytes(b"AC1032")
    with pytest.raises(InputError, match=r"expected a drawing \(.*by its suffix, got '\.dwg'"):
        read(tmp_path / "part.dwg")
    (tmp_path / "part.step").write_bytes(b"0\nSECTION\n")
    with pytest.raises(InputError, match="not a STEP file"):
        read(tmp_path / "part.step")
    with pytest.raises(InputError, match="gap: expected a number above 0 m"):
        read(tmp_path / "part.step", gap=0.0)
