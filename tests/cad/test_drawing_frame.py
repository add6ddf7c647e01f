"""Drawing frames and title blocks of a DXF are left out or asked about, never cut in silence."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import ezdxf
import numpy as np
import pytest
from ezdxf.layouts import Modelspace

from commands import assert_refused, run
from kerfpath.cad import Part, read
from kerfpath.errors import InputError
from kerfpath.job import read_job

A3 = 420.0, 297.0


def plate(space: Modelspace, at: tuple[float, float] = (100, 120), holes: int = 2) -> None:
    """A plate of 180 x 90 with round corners and holes."""
    x, y = at
    arc = np.tan(np.pi / 8)
    corners = [
        (x + 10, y, 0), (x + 170, y, arc), (x + 180, y + 10, 0), (x + 180, y + 80, arc),
        (x + 170, y + 90, 0), (x + 10, y + 90, arc), (x, y + 80, 0), (x, y + 10, arc),
    ]  # fmt: skip
    space.add_lwpolyline(corners, format="xyb", close=True)
    for k in range(holes):
        space.add_circle((x + 40 + 60 * k, y + 45), 12)


def rectangle(space: Modelspace, low, high, *, lines: bool, **look: object) -> None:
    (x, y), (right, top) = low, high
    corners = [(x, y), (right, y), (right, top), (x, top)]
    if lines:
        for k in range(4):
            space.add_line(corners[k], corners[(k + 1) % 4], dxfattribs=look)
    else:
        space.add_lwpolyline(corners, close=True, dxfattribs=look)


def title_block(
    space: Modelspace,
    corner: tuple[float, float],
    scale: float,
    *,
    has_text: bool = True,
    **look: object,
) -> None:
    """Fields in a corner of a frame, with texts or without."""
    right, y = corner
    x = right - 120 * scale
    top = y + 40 * scale
    space.add_line((x, y), (x, top), dxfattribs=look)
    space.add_line((x, top), (right, top), dxfattribs=look)
    for k in (1, 2, 3):
        space.add_line((x, y + 10 * k * scale), (right, y + 10 * k * scale), dxfattribs=look)
    space.add_line((x + 60 * scale, y), (x + 60 * scale, top), dxfattribs=look)
    for k in range(4 if has_text else 0):
        at = (x + 3 * scale, y + (10 * k + 3) * scale)
        space.add_text("PLATE 4711", height=3 * scale, dxfattribs=look).set_placement(at)


def framed(
    folder: Path, draw: Callable[[Modelspace], None], name: str = "plate.dxf", **how: object
) -> Part:
    drawing = ezdxf.new(units=4)
    draw(drawing.modelspace())
    drawing.saveas(folder / name)
    return read(folder / name, **how)


def only_the_plate(part: Part, holes: int = 2) -> None:
    size = 1e3 * np.ptp(part.bounding_box, axis=0)
    assert size[:2] == pytest.approx([180, 90])
    assert sorted(loop.kind for loop in part.loops) == ["inner"] * holes + ["outer"]


@pytest.mark.parametrize("seed", range(12))
def test_a_frame_with_a_title_block_is_recognised(tmp_path: Path, seed: int) -> None:
    """At any scale, of lines or polylines, one rectangle or two, with marks between them."""
    random = np.random.default_rng(seed)
    scale = random.choice([1.0, 1.5, 2.0, 5.0])
    lines, twice = (bool(each) for each in random.integers(0, 2, 2))

    def draw(space: Modelspace) -> None:
        plate(space, (100 * scale, 120 * scale))
        inner = (20.0 * scale, 10.0 * scale), (410.0 * scale, 287.0 * scale)
        rectangle(space, *inner, lines=lines)
        if twice:
            rectangle(space, (0, 0), (420 * scale, 297 * scale), lines=bool(random.integers(0, 2)))
            for x in (100 * scale, 200 * scale, 300 * scale):
                space.add_line((x, 0), (x, 10 * scale))
        title_block(space, (410 * scale, 10 * scale), scale)

    part = framed(tmp_path, draw)
    only_the_plate(part)
    (asked,) = [one for one in part.left_out if one.may_cut]
    assert "with a title block: it seems to be a drawing frame" in asked.reason
    assert 'drawing_frame = "leave_out" in [part], or "cut"' in str(asked)
    told = framed(tmp_path, draw, drawing_frame="leave_out")
    only_the_plate(told)
    assert not any(one.may_cut for one in told.left_out)
    assert any("the drawing frame, around all else, with a title block" in n for n in told.notes)
    everything = framed(tmp_path, draw, drawing_frame="cut")
    assert np.ptp(everything.bounding_box[:, 0]) == pytest.approx(
        (420 if twice else 390) * scale / 1e3
    )


@pytest.mark.parametrize("lines", [False, True])
def test_a_title_block_without_text_is_recognised_in_a_corner(tmp_path: Path, lines: bool) -> None:
    """Around a plate without holes, which would be a hole in the frame."""

    def draw(space: Modelspace) -> None:
        plate(space, holes=0)
        rectangle(space, (0, 0), A3, lines=lines)
        title_block(space, (420, 0), 1.0, has_text=False)
        for k in range(5):  # a word drawn as lines
            space.add_line((303 + 4 * k, 3), (305 + 4 * k, 7))

    part = framed(tmp_path, draw)
    (asked,) = [one for one in part.left_out if one.may_cut]
    assert "with a title block: it seems to be a drawing frame" in asked.reason
    assert [loop.kind for loop in part.loops].count("outer") == 1
    assert 1e3 * np.ptp(part.bounding_box[:, 0]) < 300


def test_bend_lines_and_a_cross_are_no_title_block(tmp_path: Path) -> None:
    def draw(space: Modelspace) -> None:
        rectangle(space, (0, 0), A3, lines=False)
        space.add_circle((60, 60), 12)
        for x in (100, 320):
            space.add_line((x, 0), (x, 297))
        for y in (80, 200):
            space.add_line((0, y), (420, y))

    part = framed(tmp_path, draw)
    assert not any(one.may_cut for one in part.left_out)
    assert [loop.kind for loop in part.loops].count("open") == 4


def test_a_rectangle_around_outlines_is_asked_about(tmp_path: Path) -> None:
    """Two plates with holes in a blank: as a part, the plates would be holes."""

    def draw(space: Modelspace) -> None:
        plate(space, (20, 20))
        plate(space, (220, 20))
        rectangle(space, (0, 0), (420, 130), lines=False)

    part = framed(tmp_path, draw)
    assert sorted(loop.kind for loop in part.loops) == ["inner"] * 4 + ["outer"] * 2
    (asked,) = [one for one in part.left_out if one.may_cut]
    assert asked.reason.startswith("a rectangle around all else: it seems")
    cut = framed(tmp_path, draw, drawing_frame="cut")
    assert [loop.kind for loop in cut.loops].count("outer") == 5
    assert not cut.left_out


@pytest.mark.parametrize("name", ["TITLE_BLOCK", "Schriftfeld", "Zeichnungsrahmen", "sheet frame"])
def test_names_tell_a_frame(tmp_path: Path, name: str) -> None:
    def on_a_layer(space: Modelspace) -> None:
        plate(space)
        rectangle(space, (0, 0), A3, lines=True, layer=name)
        title_block(space, (420, 0), 1.0, layer=name)

    def in_a_block(space: Modelspace) -> None:
        plate(space)
        block = space.doc.blocks.new(name)
        block.add_lwpolyline([(0, 0), (420, 0), A3, (0, 297)], close=True)
        space.add_blockref(name, (0, 0))

    for draw in (on_a_layer, in_a_block):
        part = framed(tmp_path, draw)
        only_the_plate(part)
        assert not any(one.may_cut for one in part.left_out)
        assert any("a drawing frame by the name of its layer or block" in n for n in part.notes)
        assert np.ptp(framed(tmp_path, draw, drawing_frame="cut").bounding_box[:, 0]) > 0.4
        only_the_plate(framed(tmp_path, draw, drawing_frame="leave_out"))


def nameplate(space: Modelspace) -> None:
    rectangle(space, (0, 0), (120, 60), lines=True)
    for x in (8, 112):
        space.add_circle((x, 30), 3)
    space.add_text("MODEL X", height=8).set_placement((30, 25))


def test_what_is_a_part_stays_one(tmp_path: Path) -> None:
    part = framed(tmp_path, nameplate)
    assert [loop.kind for loop in part.loops].count("outer") == 1
    assert not any(one.may_cut for one in part.left_out)
    part = framed(tmp_path, lambda space: rectangle(space, (0, 0), (90, 60), lines=False))
    assert len(part.loops) == 1
    # A rectangle is left out where that is said, but not the plate around which there is none.
    outer = framed(tmp_path, nameplate, drawing_frame="leave_out")
    assert len(outer.loops) == 2
    with pytest.raises(InputError, match="drawing_frame: no rectangle is around all else"):
        framed(tmp_path, plate, drawing_frame="leave_out")
    (tmp_path / "p.csv").write_text("x_mm,y_mm,z_mm,nx,ny,nz\n0,0,0,0,0,1\n9,0,0,0,0,1\n")
    with pytest.raises(InputError, match="drawing_frame: expected a DXF drawing, got a table"):
        read(tmp_path / "p.csv", drawing_frame="cut")


def test_a_first_job_leaves_the_frame_out_and_says_so(tmp_path: Path) -> None:
    def draw(space: Modelspace) -> None:
        plate(space)
        rectangle(space, (0, 0), A3, lines=True)
        title_block(space, (420, 0), 1.0)

    framed(tmp_path, draw)
    made = run("new", "plate.dxf", cwd=tmp_path)
    assert made.returncode == 0, made.stderr
    text = (tmp_path / "plate.toml").read_text()
    line = 'drawing_frame = "leave_out"   # guess: the rectangle around all else is not cut\n'
    assert line in text
    assert text.count("[[contour]]") == 3
    assert run("check", "plate.toml", cwd=tmp_path).returncode == 0
    assert read_job(tmp_path / "plate.toml").drawing.drawing_frame == "leave_out"
    (tmp_path / "plate.toml").write_text(text.replace(line, ""))
    assert_refused(run("check", "plate.toml", cwd=tmp_path), "part.file", "write drawing_frame =")
