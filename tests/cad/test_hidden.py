"""Nothing hidden in a DXF is cut, and nothing shown is lost; and what APT files need not refuse."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import ezdxf
import numpy as np
import pytest
from ezdxf.document import Drawing

from kerfpath.cad import Part, read

EXACT = 1e-9
"""m: lines and circles are exact."""


def rectangle(x: float, y: float, width: float, height: float) -> list[tuple[float, float]]:
    return [(x, y), (x + width, y), (x + width, y + height), (x, y + height)]


@pytest.fixture
def drawing() -> Drawing:
    """A plate of 100 x 60 mm."""
    document = ezdxf.new("R2010", units=4)
    document.modelspace().add_lwpolyline(rectangle(0, 0, 100, 60), close=True)
    return document


def as_read(document: Drawing, folder: Path) -> Part:
    document.saveas(folder / "plate.dxf")
    return read(folder / "plate.dxf")


def holes(part: Part) -> list[float]:
    return sorted(
        round(1e3 * loop.length / np.pi, 6) for loop in part.loops if loop.kind == "inner"
    )


def test_invisible_entities_are_left_out_and_do_not_nest(drawing: Drawing, tmp_path: Path) -> None:
    space = drawing.modelspace()
    space.add_circle((50, 30), 6)
    space.add_lwpolyline(rectangle(40, 20, 20, 20), close=True, dxfattribs={"invisible": 1})
    part = as_read(drawing, tmp_path)
    assert holes(part) == [12]
    assert [(one.kind, one.reason, one.may_cut) for one in part.left_out] == [
        ("LWPOLYLINE", "invisible", False)
    ]


@pytest.mark.parametrize(
    ("state", "shown"), [("off", [10.0]), ("freeze", []), ("on", [10.0, 16.0])]
)
def test_a_block_on_a_layer_is_hidden_as_it_is_shown(
    drawing: Drawing, tmp_path: Path, state: str, shown: list[float]
) -> None:
    """A layer that is off hides what a block has on layer 0; a frozen one the whole block."""
    getattr(drawing.layers.add("Insert"), state)()
    drawing.layers.add("Other")
    block = drawing.blocks.new("B")
    block.add_circle((20, 30), 8)
    block.add_circle((60, 30), 5, dxfattribs={"layer": "Other"})
    drawing.modelspace().add_blockref("B", (0, 0), dxfattribs={"layer": "INSERT"})
    assert holes(as_read(drawing, tmp_path)) == shown


def test_layers_are_the_same_in_any_case(drawing: Drawing, tmp_path: Path) -> None:
    drawing.layers.add("Cut")
    space = drawing.modelspace()
    for k, (start, end) in enumerate(
        [((20, 20), (30, 20)), ((30, 20), (30, 30)), ((30, 30), (20, 20))]
    ):
        space.add_line(start, end, dxfattribs={"layer": ("CUT", "cut", "Cut")[k]})
    part = as_read(drawing, tmp_path)
    assert [(loop.name, loop.closed) for loop in part.pick(layer="Cut")] == [("Cut/hole1", True)]


def test_of_a_splined_polyline_the_curve_is_read(drawing: Drawing, tmp_path: Path) -> None:
    line = drawing.modelspace().add_polyline2d([(10, 10), (50, 50), (90, 10)])
    for vertex in line.vertices:
        vertex.dxf.flags |= 16
    line.append_formatted_vertices([(10, 10), (50, 30), (90, 10)], format="xy")
    for vertex in line.vertices[3:]:
        vertex.dxf.flags |= 8
    line.dxf.flags |= 4
    (found,) = as_read(drawing, tmp_path).pick(kind="open")
    assert found.length == pytest.approx(2 * np.hypot(40, 20) * 1e-3, abs=EXACT)


def test_the_width_of_a_polyline_may_have_been_to_cut(drawing: Drawing, tmp_path: Path) -> None:
    drawing.modelspace().add_lwpolyline(
        rectangle(20, 20, 20, 20), close=True, dxfattribs={"const_width": 2.0}
    )
    part = as_read(drawing, tmp_path)
    assert [(one.kind, one.may_cut) for one in part.left_out] == [("LWPOLYLINE", True)]


@pytest.mark.parametrize("points", [[(20, 30), (80, 30)], [(20, 30), (50, 40), (80, 30)]])
def test_an_open_line_drawn_twice_is_one(
    drawing: Drawing, tmp_path: Path, points: list[tuple[float, float]]
) -> None:
    for way in (points, points[::-1]):
        for start, end in pairwise(way):
            drawing.modelspace().add_line(start, end)
    part = as_read(drawing, tmp_path)
    (found,) = part.pick(kind="open")
    assert found.edges == len(points) - 1
    assert any("drawn twice" in note for note in part.notes)


@pytest.mark.parametrize("height", [0.02, 0.5, 12.0])
def test_a_hole_at_another_height_is_a_hole(
    drawing: Drawing, tmp_path: Path, height: float
) -> None:
    drawing.modelspace().add_circle((50, 30, height), 10)
    part = as_read(drawing, tmp_path)
    assert holes(part) == [20]
    assert any("several heights" in note for note in part.notes)


def test_polylines_without_classes_and_version_are_read(tmp_path: Path) -> None:
    points = "".join(f"10\n{x}\n20\n{y}\n" for x, y in rectangle(0, 0, 100, 60))
    for head in ("", "0\nSECTION\n2\nHEADER\n9\n$INSUNITS\n70\n4\n0\nENDSEC\n"):
        (tmp_path / "bare.dxf").write_text(
            f"{head}0\nSECTION\n2\nENTITIES\n0\nLWPOLYLINE\n8\n0\n90\n4\n70\n1\n{points}0\nENDSEC\n0\nEOF\n"
        )
        (loop,) = read(tmp_path / "bare.dxf", "mm").loops
        assert loop.length == pytest.approx(0.32, abs=EXACT)


@pytest.mark.parametrize("begins", ["TOOL PATH/TRIM,TOOL,T1", "LOADTL/1", "LOAD/TOOL,1"])
def test_units_after_the_start_of_an_operation_are_those_of_the_file(
    tmp_path: Path, begins: str
) -> None:
    (tmp_path / "a.cls").write_text(
        f"{begins}\nUNITS/MM\nMULTAX/ON\nGOTO/80,40,10,0,0,1\nGOTO/20,40,10,0,0,1\n"
    )
    part = read(tmp_path / "a.cls")
    assert (part.unit, round(part.loops[0].length, 9)) == ("mm", 0.06)


def test_a_comment_that_goes_on_is_a_comment(tmp_path: Path) -> None:
    (tmp_path / "a.cl").write_text(
        "$$-> CSYS / 1, 0, 0, $\n  0, 1, 0, $ \n  0, 0, 1\nUNITS / MM\n"
        "GOTO / 80, 40, 10, 0, 0, 1 $$ no $ here\nGOTO / 20, 40, 10\n"
    )
    (cut,) = read(tmp_path / "a.cl").loops
    assert cut.length == pytest.approx(0.06, abs=EXACT)
