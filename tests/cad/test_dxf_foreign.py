"""DXF as others write it: arrays, scales of 0, binary, torn; what is left out is said, and why."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from ezdxf.filemanagement import new
from ezdxf.layouts import Modelspace
from tests.cad.test_dxf import BAD, EXACT, bulges, drawn, mirrored_arcs, nested_blocks, splines

from kerfpath.cad import Part, read
from kerfpath.cli.drawing_output import drawing_entry
from kerfpath.errors import InputError

# --- blocks: any affine map ------------------------------------------------------------------


def turn(degrees: float) -> np.ndarray:
    a = np.radians(degrees)
    return np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]])


def test_blocks_that_shear_each_other_are_exact(tmp_path: Path) -> None:
    """A turned block in one scaled unevenly is sheared: composed here by hand."""

    def draw(space: Modelspace) -> None:
        inner = space.doc.blocks.new("INNER")
        inner.add_arc((5, 0), 3, 20, 200)
        outer = space.doc.blocks.new("OUTER", base_point=(1, 2))
        turned = {"xscale": 2, "yscale": 0.5, "rotation": 30}
        outer.add_blockref("INNER", (10, 0), dxfattribs=turned)
        where = {"rotation": -70, "xscale": 1.5, "yscale": 2}
        space.add_blockref("OUTER", (100, 0), dxfattribs=where)

    (loop,) = drawn(tmp_path, draw).loops
    t = np.radians(np.linspace(20, 200, 2000))
    arc = np.array([5 + 3 * np.cos(t), 3 * np.sin(t)])
    inner = turn(30) @ (np.array([[2], [0.5]]) * arc) + [[10], [0]]
    outer = turn(-70) @ (np.array([[1.5], [2]]) * (inner - [[1], [2]])) + [[100], [0]]
    points = loop.line(1e-6)[:, :2] * 1e3
    apart = np.linalg.norm(points[:, None] - outer.T[None], axis=2).min(axis=1)
    assert apart.max() < 0.02  # the distance of neighbours by hand
    np.testing.assert_allclose(points[[0, -1]], outer.T[[0, -1]], atol=1e-9)
    chords = np.linalg.norm(np.diff(outer, axis=1), axis=0).sum()
    assert loop.length * 1e3 == pytest.approx(chords, rel=1e-6)


@pytest.mark.parametrize("also", ["add_text", "add_mtext", "add_point", "add_linear_dim"])
@pytest.mark.parametrize("kind", ["rows", "turned", "one"])
@pytest.mark.parametrize("zscale", [1.0, 0.0])
def test_arrays_of_blocks_are_read_with_any_scale_in_z(
    tmp_path: Path, also: str, kind: str, zscale: float
) -> None:
    """Writers of flat drawings give 0 for the scale in z, which divides nothing here."""
    attributes = {
        "rows": {"row_count": 2, "column_count": 3, "row_spacing": 30, "column_spacing": 20},
        "turned": {"row_count": 2, "row_spacing": 30, "rotation": 90, "xscale": 2, "yscale": 2},
        "one": {"row_count": 5, "column_count": 4},  # no spacing: all in one place
    }[kind]

    def draw(space: Modelspace) -> None:
        block = space.doc.blocks.new("B")
        block.add_circle((3, 0), 2)
        if also == "add_linear_dim":
            block.add_linear_dim((0, 2), (0, 0), (5, 0)).render()
        else:
            getattr(block, also)(*(("note",) if "text" in also else ((0, 0),)))
        space.add_blockref("B", (10, 10), dxfattribs=attributes)

    drawn(tmp_path, draw)
    path = tmp_path / "drawing.dxf"
    text = path.read_text()
    at = max(text.rfind("AcDbMInsertBlock"), text.rfind("AcDbBlockReference"))
    place = text.index("\n 10\n", at)
    path.write_text(f"{text[:place]}\n 43\n{zscale}{text[place:]}")
    part = read(path)
    centres = {
        "rows": [(13 + 20 * c, 10 + 30 * r) for c in range(3) for r in range(2)],
        "turned": [(10, 16), (-20, 16)],
        "one": [(13, 10)],
    }[kind]
    found = [loop.bounding_box.mean(axis=0)[:2] * 1e3 for loop in part.loops]
    assert sorted(map(tuple, np.round(found, 6).tolist())) == sorted(map(tuple, centres))
    assert not any(each.may_cut for each in part.left_out)


def test_a_block_scaled_to_nothing_is_said(tmp_path: Path) -> None:
    def draw(space: Modelspace) -> None:
        space.doc.blocks.new("B").add_circle((3, 0), 2)
        space.add_blockref("B", (10, 10))
        space.add_circle((50, 50), 1)

    drawn(tmp_path, draw)
    path = tmp_path / "drawing.dxf"
    text = path.read_text()
    place = text.index("\n 10\n", text.rindex("AcDbBlockReference"))
    path.write_text(f"{text[:place]}\n 41\n0.0{text[place:]}")
    part = read(path)
    assert len(part.loops) == 1
    assert told(part) == [("INSERT", "it is scaled by 0", 1, True)]


# --- binary ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("version", "draw"),
    [
        ("R12", mirrored_arcs),
        ("R2000", splines),
        ("R2010", bulges),
        ("R2010", nested_blocks),
    ],
)
def test_binary_is_read_as_its_text_is(
    tmp_path: Path, version: str, draw: Callable[[Modelspace], None]
) -> None:
    document = new(version, units=4)
    draw(document.modelspace())
    document.saveas(tmp_path / "text.dxf")
    document.saveas(tmp_path / "binary.dxf", fmt="bin")
    assert (tmp_path / "binary.dxf").read_bytes().startswith(b"AutoCAD Binary DXF")
    text, binary = (read(tmp_path / f"{name}.dxf", "mm") for name in ("text", "binary"))
    assert [loop.name for loop in binary.loops] == [loop.name for loop in text.loops]
    for one, other in zip(text.loops, binary.loops, strict=True):
        assert one.length == pytest.approx(other.length, abs=EXACT)
        np.testing.assert_allclose(one.bounding_box, other.bounding_box, atol=EXACT)
    assert text.left_out == binary.left_out


# --- markers of classes that are missing ------------------------------------------------------


@pytest.mark.parametrize("ends", ["\n", "\r\n"])
@pytest.mark.parametrize("markers", ["AcDb(?!Entity)", "AcDb"])
def test_entities_without_their_class_are_read(tmp_path: Path, markers: str, ends: str) -> None:
    """Some writers leave the markers out: of the class alone, or of all that an entity has."""

    def draw(space: Modelspace) -> None:
        on = {"layer": "CUT", "color": 1}
        space.add_lwpolyline([(0, 0), (9, 0, 0, 0, 0.5), (9, 7)], close=True, dxfattribs=on)
        space.add_open_spline([(20, 0), (25, 5), (29, 0), (32, 3)], dxfattribs=on)
        space.add_line((40, 0), (49, 0), dxfattribs=on)
        space.add_ellipse((60, 0), (5, 0), 0.5, dxfattribs=on)

    whole = drawn(tmp_path, draw)
    path = tmp_path / "drawing.dxf"
    text = path.read_text()
    at = text.index("\nENTITIES\n")
    end = text.index("ENDSEC", at)
    bare = re.sub(rf"100\n{markers}\w+\n", "", text[at:end])
    assert bare.count("AcDb") == (4 if "Entity" in markers else 0)
    path.write_bytes((text[:at] + bare + text[end:]).replace("\n", ends).encode())
    part = read(path)
    assert part.left_out == ()
    assert [(loop.name, loop.layer, loop.colour, loop.length) for loop in part.loops] == [
        (loop.name, loop.layer, loop.colour, loop.length) for loop in whole.loops
    ]


# --- what is left out, and why ---------------------------------------------------------------


def told(part: Part) -> list[tuple[str, str, int, bool]]:
    return [(each.kind, each.reason, each.count, each.may_cut) for each in part.left_out]


def two_splines(space: Modelspace) -> None:
    space.add_circle((0, 0), 1)
    for x in (0, 50):
        space.add_open_spline([(x, 10), (x + 5, 20), (x + 10, 0), (x + 15, 10)])


@pytest.mark.parametrize(
    ("old", "new_", "reason"),
    [
        (r"\n 72\n8\n", "\n 72\n0\n", ""),  # the count of knots is not believed
        (r"(\n 40\n[\d.e+-]+){8}", "", "without valid geometry|knot value count"),
        (r"\n 71\n3\n", "\n 71\n-1\n", "invalid degree"),
        (r"\n 71\n3\n", "\n 71\n9\n", "control point count"),
        (r"(\n 40\n[\d.e+-]+){8}", "\n 40\n0.0" * 8, "cannot be read"),
    ],
)
def test_a_spline_that_cannot_be_read_is_said(
    tmp_path: Path, old: str, new_: str, reason: str
) -> None:
    drawn(tmp_path, two_splines)
    path = tmp_path / "drawing.dxf"
    text = path.read_text()
    at = text.index("AcDbSpline")
    spoilt, count = re.subn(old, new_, text[at:], count=1)
    assert count == 1
    path.write_text(text[:at] + spoilt)
    part = read(path)
    if not reason:
        assert (len(part.loops), part.left_out) == (3, ())
        return
    assert len(part.loops) == 2
    (only,) = part.left_out
    assert (only.kind, only.count, only.may_cut) == ("SPLINE", 1, True)
    assert re.search(reason, only.reason), only
    assert str(only) in part.notes
    assert drawing_entry(part)["left_out"] == [
        {"kind": "SPLINE", "reason": only.reason, "count": 1, "may_cut": True}
    ]


def test_lines_that_a_torn_file_loses_are_counted(tmp_path: Path) -> None:
    """What stands behind the end of its section belongs to no part of the file."""

    def draw(space: Modelspace) -> None:
        for y in (0, 1, 2):
            space.add_line((0, y), (1, y))

    drawn(tmp_path, draw)
    path = tmp_path / "drawing.dxf"
    text = path.read_text()
    second = text.index("\nLINE\n", text.index("\nLINE\n") + 1)
    at = text.rindex("\n", 0, second)
    path.write_text(f"{text[:at]}\n  0\nENDSEC{text[at:]}")
    part = read(path)
    assert len(part.loops) == 1
    assert told(part) == [("LINE", "the file is damaged there", 2, True)]


def test_every_kind_that_is_no_line_is_said_once(tmp_path: Path) -> None:
    def draw(space: Modelspace) -> None:
        space.add_circle((0, 0), 1)
        space.add_text("one")
        space.add_text("two")
        space.add_solid([(0, 0), (1, 0), (1, 1), (0, 1)])
        space.add_hatch().paths.add_polyline_path([(0, 0), (1, 0), (1, 1)])
        space.add_linear_dim((0, 2), (0, 0), (5, 0)).render()
        space.add_blockref("GONE", (0, 0))
        space.doc.blocks.new("XREF").block.dxf.flags = 4
        space.add_blockref("XREF", (0, 0))
        space.doc.layout("Layout1").add_circle((0, 0), 5)

    part = drawn(tmp_path, draw)
    assert len(part.loops) == 1
    found = [(kind, count, may_cut) for kind, _, count, may_cut in told(part)]
    assert ("TEXT", 2, False) in found
    assert ("SOLID", 1, True) in found
    assert ("HATCH", 1, False) in found
    assert ("DIMENSION", 1, False) in found
    assert ("CIRCLE", 1, False) in found  # on the sheet to print
    assert sum(count for kind, count, _ in found if kind == "INSERT") == 2
    assert [each.may_cut for each in part.left_out] == sorted(
        (each.may_cut for each in part.left_out), reverse=True
    )


def test_a_drawing_of_which_all_is_left_out_says_why(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"nothing to cut: .*1 TEXT \(not a line to cut\)"):
        drawn(tmp_path, BAD["nothing"][0])


def test_blocks_of_blocks_without_a_line_end(tmp_path: Path) -> None:
    """Each of ten levels holds the next a thousand times: too many, although nothing is drawn."""

    def draw(space: Modelspace) -> None:
        rows = {"row_count": 1000, "row_spacing": 1}
        for k in range(10):
            block = space.doc.blocks.new(f"B{k}")
            if k:
                block.add_blockref(f"B{k - 1}", (0, 0), dxfattribs=rows)
        space.add_blockref("B9", (0, 0))

    with pytest.raises(InputError, match=r"more than 100000 curves and blocks, .* save only what"):
        drawn(tmp_path, draw)
