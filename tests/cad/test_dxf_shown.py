"""DXF in: what is hidden is not cut, what is shown is not lost, and each line is cut once."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from ezdxf.layouts import Modelspace
from tests.cad.test_dxf import EXACT, drawn

from kerfpath.cad import Part, read


def rectangle(space: Modelspace, dx: float = 100, dy: float = 60, **style: object) -> None:
    space.add_lwpolyline([(0, 0), (dx, 0), (dx, dy), (0, dy)], close=True, dxfattribs=style)


def names(part: Part) -> list[str]:
    return [loop.name for loop in part.loops]


# --- hidden and shown ------------------------------------------------------------------------


@pytest.mark.parametrize("is_in_block", [False, True])
def test_invisible_entities_are_put_aside(tmp_path: Path, is_in_block: bool) -> None:
    def draw(space: Modelspace) -> None:
        to = space.doc.blocks.new("STATES") if is_in_block else space
        rectangle(to)
        to.add_circle((70, 30), 6)
        to.add_circle((70, 30), 10, dxfattribs={"invisible": 1})
        if is_in_block:
            space.add_blockref("STATES", (0, 0))
            space.add_blockref("STATES", (300, 0), dxfattribs={"invisible": 1})

    part = drawn(tmp_path, draw)
    assert names(part) == ["0/outer", "0/hole1"]
    assert part.loop("0/hole1").diameter == pytest.approx(0.012)
    (circle, *blocks) = sorted(part.left_out, key=lambda one: one.kind)
    assert (circle.kind, circle.count, circle.may_cut) == ("CIRCLE", 1, False)
    assert [block.kind for block in blocks] == ["INSERT"] * is_in_block


def test_layer_names_are_the_same_in_any_case(tmp_path: Path) -> None:
    def draw(space: Modelspace) -> None:
        space.doc.layers.add("Old").off()
        space.add_circle((50, 30), 20, dxfattribs={"layer": "OLD"})
        corners = [(0, 0), (100, 0), (100, 60), (0, 60)]
        for k, layer in enumerate(["Cut", "CUT", "cut", "cUT"]):
            space.add_line(corners[k], corners[(k + 1) % 4], dxfattribs={"layer": layer})

    part = drawn(tmp_path, draw)
    assert names(part) == ["Cut/outer"]
    assert [(one.kind, one.may_cut) for one in part.left_out] == [("CIRCLE", False)]


@pytest.mark.parametrize("how", ["constant", "by vertex", "old"])
def test_a_wide_polyline_may_have_to_be_cut_around(tmp_path: Path, how: str) -> None:
    def draw(space: Modelspace) -> None:
        rectangle(space)
        if how == "constant":
            space.add_lwpolyline([(20, 20), (60, 20)], dxfattribs={"const_width": 3})
        elif how == "by vertex":
            space.add_lwpolyline([(20, 20, 0, 3), (60, 20, 0, 0)], format="xyse")
        else:
            wide = {"default_start_width": 3, "default_end_width": 3}
            space.add_polyline2d([(20, 20), (60, 20)], dxfattribs=wide)

    part = drawn(tmp_path, draw)
    assert names(part) == ["0/outer", "0/line1"]
    (wide,) = part.left_out
    assert wide.may_cut
    assert "only its width" in wide.reason


# --- each line once --------------------------------------------------------------------------


@pytest.mark.parametrize("times", [2, 3])
@pytest.mark.parametrize("off", [0.0, 0.004, 0.03])
def test_an_open_line_drawn_again_is_one(tmp_path: Path, times: int, off: float) -> None:
    def draw(space: Modelspace) -> None:
        rectangle(space)
        for k in range(times):
            line = (20, 30 + k * off / times), (80, 30 + k * off / times)
            space.add_line(*(line[::-1] if k % 2 else line))

    part = drawn(tmp_path, draw)
    assert names(part) == ["0/outer", "0/line1"]
    assert part.loop("0/line1").length == pytest.approx(0.06, abs=1e-6)
    assert f"layer 0, white: {times - 1} curves drawn twice left out" in part.notes


@pytest.mark.parametrize("seed", range(3))
def test_an_outline_drawn_again_beside_itself_is_one(tmp_path: Path, seed: int) -> None:
    rng = np.random.default_rng(seed)
    corners = np.array([(0, 0), (100, 0), (100, 60), (0, 60)], dtype=float)

    def draw(space: Modelspace) -> None:
        for _ in range(2):
            moved = corners + rng.uniform(-0.01, 0.01, 2)  # less than the gap of 0.05 mm
            for k in rng.permutation(4).tolist():
                space.add_line(moved[k], moved[(k + 1) % 4])
        space.add_circle((50, 30), 10)

    part = drawn(tmp_path, draw)
    assert names(part) == ["0/outer", "0/hole1"]
    assert part.loop("0/outer").length == pytest.approx(0.32, abs=1e-5)


# --- files of small exporters ----------------------------------------------------------------


@pytest.mark.parametrize("header", ["", "AC1009", "AC1015"])
def test_polylines_without_markers_are_read_in_files_of_any_version(
    tmp_path: Path, header: str
) -> None:
    version = f"  9\n$ACADVER\n  1\n{header}\n" if header else ""
    start = f"  0\nSECTION\n  2\nHEADER\n{version}  0\nENDSEC\n" if header else ""
    corners = "".join(f" 10\n{x}\n 20\n{y}\n" for x, y in [(0, 0), (100, 0), (100, 60), (0, 60)])
    (tmp_path / "small.dxf").write_text(
        f"{start}  0\nSECTION\n  2\nENTITIES\n  0\nLWPOLYLINE\n  8\nCUT\n 90\n4\n 70\n1\n{corners}"
        "  0\nENDSEC\n  0\nEOF\n"
    )
    (loop,) = read(tmp_path / "small.dxf", unit="mm").loops
    assert (loop.name, loop.edges) == ("CUT/outer", 4)
    assert loop.length == pytest.approx(0.32, abs=EXACT)
