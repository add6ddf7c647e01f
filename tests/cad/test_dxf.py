"""DXF in: entities, blocks, chains, nesting, layers, units, and bad drawings."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from ezdxf import path as ezpath
from ezdxf.document import Drawing
from ezdxf.filemanagement import new
from ezdxf.layouts import Modelspace

from kerfpath.cad import Part, read
from kerfpath.errors import InputError

EXACT = 1e-9
"""m: DXF keeps 16 digits."""


def drawn(
    folder: Path, draw: Callable[[Modelspace], object], *, units: int = 4, **options: object
) -> Part:
    """Return the part of a drawing made by `draw`."""
    document = new("R2010", units=units)
    draw(document.modelspace())
    document.saveas(folder / "drawing.dxf")
    return read(folder / "drawing.dxf", **options)


def lines(*corners: tuple[float, float], layer: str = "0") -> Callable[[Modelspace], None]:
    def draw(space: Modelspace) -> None:
        for start, end in zip(corners, corners[1:] + corners[:1], strict=True):
            space.add_line(start, end, dxfattribs={"layer": layer})

    return draw


def area(part: Part, name: str) -> float:
    """Return the signed area of a loop about +z, m^2."""
    x, y = part.contour(name).points[:-1, :2].T
    return float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2


# --- worked examples -------------------------------------------------------------------------


def test_a_square_of_lines_in_any_order_and_direction(tmp_path: Path) -> None:
    def draw(space: Modelspace) -> None:
        for start, end in (((0, 0), (100, 0)), ((0, 50), (0, 0)), ((100, 50), (100, 0))):
            space.add_line(start, end)
        space.add_line((0, 50), (100, 50))

    part = drawn(tmp_path, draw)
    (loop,) = part.loops
    assert (loop.name, loop.kind, loop.edges, loop.closed) == ("0/outer", "outer", 4, True)
    assert loop.length == pytest.approx(0.3, abs=EXACT)
    assert loop.shortest_edge == pytest.approx(0.05, abs=EXACT)
    assert area(part, loop.name) == pytest.approx(5e-3)
    contour = part.contour(loop.name)
    np.testing.assert_array_equal(contour.axes, np.tile([0.0, 0.0, -1.0], (len(contour), 1)))
    np.testing.assert_allclose(part.bounding_box, [[0, 0, 0], [0.1, 0.05, 0]], atol=EXACT)
    assert part.mesh()[0].shape == (0, 3)


def test_the_blank_has_its_loops(tmp_path: Path, examples: object) -> None:
    examples.write_blank(tmp_path / "blank.dxf")
    part = read(tmp_path / "blank.dxf")
    names = [loop.name for loop in part.loops]
    assert names == ["CUT/outer", *(f"CUT/hole{k}" for k in range(1, 6)), "MARK/line1"]
    outer = part.loop("CUT/outer")
    assert outer.length == pytest.approx(0.18 * 2 + 0.08 * 2 + 2 * np.pi * 0.01, abs=EXACT)
    assert [loop.colour for loop in part.loops] == ["red"] * 4 + ["blue", "red", "green"]
    # The block turned by 30 degrees, inserted at (40, 30): its third hole is 30 mm along y.
    turned = np.radians(30)
    middle = part.loop("CUT/hole1").bounding_box.mean(axis=0)
    np.testing.assert_allclose(
        middle[:2], np.array([40 - 30 * np.sin(turned), 30 + 30 * np.cos(turned)]) * 1e-3
    )
    rounds = part.pick(diameter=(0.0079, 0.0081))
    assert [loop.name for loop in rounds] == ["CUT/hole1", "CUT/hole2", "CUT/hole3"]
    assert any("1 TEXT" in note for note in part.notes)
    assert any("$INSUNITS" in note for note in part.notes)


def test_ellipse_length_agrees_with_the_elliptic_integral(tmp_path: Path) -> None:
    from scipy.special import ellipe

    part = drawn(tmp_path, lambda space: space.add_ellipse((5, 5), (20, 10), 0.3))
    a = np.hypot(20, 10)
    assert part.loops[0].length == pytest.approx(4 * a * ellipe(1 - 0.3**2) * 1e-3, rel=1e-8)
    # Half width of a turned ellipse: sqrt(major_x^2 + minor_x^2).
    half = np.hypot(20, 0.3 * 10)
    assert part.bounding_box[1, 0] == pytest.approx((5 + half) * 1e-3, abs=EXACT)


def test_nested_loops_alternate_between_outer_and_hole(tmp_path: Path) -> None:
    def draw(space: Modelspace) -> None:
        for radius in (10, 50, 30, 40, 20):
            space.add_circle((0, 0), radius)

    part = drawn(tmp_path, draw)
    kinds = {round(loop.diameter * 500): loop.kind for loop in part.loops}
    assert kinds == {50: "outer", 40: "inner", 30: "outer", 20: "inner", 10: "outer"}
    for loop in part.loops:
        assert np.sign(area(part, loop.name)) == (1 if loop.kind == "outer" else -1)


def test_layers_and_colours_keep_loops_apart(tmp_path: Path) -> None:
    def draw(space: Modelspace) -> None:
        space.doc.layers.add("MARK", color=3)
        lines((0, 0), (10, 0), (10, 10), (0, 10))(space)
        space.add_line((0, 0), (10, 10), dxfattribs={"layer": "MARK"})
        space.add_circle((5, 20), 2, dxfattribs={"color": 30})
        space.add_circle((5, 30), 2, dxfattribs={"true_color": 0xFF8000})

    part = drawn(tmp_path, draw)
    assert [loop.name for loop in part.pick(layer="MARK")] == ["MARK/line1"]
    assert part.pick(layer="MARK")[0].colour == "green"
    assert [loop.kind for loop in part.pick(colour="aci30")] == ["outer"]
    assert len(part.pick(colour="#ff8000")) == 1
    assert len(part.pick(colour="white", kind="outer")) == 1
    with pytest.raises(InputError, match="no loop among 4 fits layer='CUT', colour='red'"):
        part.pick(layer="CUT", colour="red")


# --- an oracle: ezdxf's own paths ------------------------------------------------------------


def mirrored_arcs(space: Modelspace) -> None:
    attributes = {"extrusion": (0, 0, -1)}
    space.add_arc((-100, 20), 10, 30, 250, dxfattribs=attributes)


def bulges(space: Modelspace) -> None:
    points = [(0, 0, 0.5), (10, 0, -0.8), (20, 5, 0), (10, 30, 0.4)]
    space.add_lwpolyline(points, format="xyb", close=True)


def mirrored_bulges(space: Modelspace) -> None:
    points = [(0, 0, 0.5), (10, 0, -0.2), (20, 5, 0), (10, 30, 0.3)]
    space.add_lwpolyline(
        points, format="xyb", close=True, dxfattribs={"extrusion": (0, 0, -1), "elevation": 3}
    )


def splines(space: Modelspace) -> None:
    space.add_spline([(0, 0), (10, 5), (20, 0), (25, 10)])


def nested_blocks(space: Modelspace) -> None:
    inner = space.doc.blocks.new("INNER")
    inner.add_arc((5, 0), 3, 20, 200)
    inner.add_lwpolyline([(0, 0, 0.7), (8, 0, 0), (8, 8, 0)], format="xyb")
    outer = space.doc.blocks.new("OUTER", base_point=(1, 2))
    outer.add_blockref("INNER", (10, 0), dxfattribs={"xscale": 2, "yscale": 0.5})
    outer.add_blockref("INNER", (0, 30), dxfattribs={"xscale": -1})
    space.add_blockref("OUTER", (100, 0), dxfattribs={"rotation": -70, "xscale": 1.5, "yscale": 2})


@pytest.mark.parametrize("draw", [mirrored_arcs, bulges, mirrored_bulges, splines, nested_blocks])
def test_points_lie_on_the_paths_that_ezdxf_makes(
    tmp_path: Path, draw: Callable[[Modelspace], None]
) -> None:
    part = drawn(tmp_path, draw)
    document = new("R2010", units=4)
    draw(document.modelspace())
    pieces = [
        np.array([tuple(p) for p in ezpath.make_path(entity).flattening(1e-4)])
        for entity in flat(document)
    ]
    start = np.vstack([piece[:-1] for piece in pieces]) * 1e-3
    step = np.vstack([np.diff(piece, axis=0) for piece in pieces]) * 1e-3
    for loop in part.loops:
        points = part.contour(loop.name, closed=False).points
        for p in points[:: max(1, len(points) // 200)]:
            along = np.clip(((p - start) * step).sum(1) / (step**2).sum(1), 0, 1)
            # ezdxf draws a quarter of a circle by one cubic: within 3e-4 of its radius.
            off = np.linalg.norm(start + along[:, None] * step - p, axis=1)
            assert off.min() < 1e-5
    total = sum(np.linalg.norm(np.diff(piece, axis=0), axis=1).sum() for piece in pieces) * 1e-3
    # Chords within 1e-4 mm of curves of some mm: shorter by a part of about 1e-4.
    assert sum(loop.length for loop in part.loops) == pytest.approx(total, rel=1e-3)


def test_a_rational_spline_that_is_a_quarter_circle_is_one(tmp_path: Path) -> None:
    def draw(space: Modelspace) -> None:
        space.add_rational_spline([(5, 0), (5, 5), (0, 5)], weights=[1, 0.5**0.5, 1], degree=2)

    part = drawn(tmp_path, draw)
    points = part.contour("0/line1", closed=False).points
    np.testing.assert_allclose(np.hypot(points[:, 0], points[:, 1]), 5e-3, atol=1e-15)
    # Gauss with 12 nodes on a quarter.
    assert part.loops[0].length == pytest.approx(2.5e-3 * np.pi, abs=EXACT)


def flat(document: Drawing) -> list[object]:
    from ezdxf.disassemble import recursive_decompose

    return list(recursive_decompose(document.modelspace()))


# --- gaps, duplicates, crossings -------------------------------------------------------------


def test_a_gap_is_bridged_within_the_tolerance_and_reported(tmp_path: Path) -> None:
    corners = ((0, 0), (100, 0), (100, 50), (0, 50))
    for gap, closed in ((0.04, True), (0.06, False)):

        def draw(space: Modelspace, gap: float = gap) -> None:
            for start, end in itertools.pairwise(corners):
                space.add_line(start, end)
            space.add_line(corners[-1], (0, gap))

        part = drawn(tmp_path, draw)
        (loop,) = part.loops
        assert loop.closed == closed
        if closed:
            assert loop.largest_gap == pytest.approx(gap * 1e-3)
            assert part.contour(loop.name).closed
            continue
        with pytest.raises(
            InputError, match=r"is open at \[.*next end is 0\.060 mm away.*0\.05 mm"
        ):
            part.contour(loop.name)
        assert not part.contour(loop.name, closed=False).closed
        wide = read(tmp_path / "drawing.dxf", gap=1e-4)
        assert wide.loops[0].closed
        assert wide.contour("0/outer").closed


def test_edges_shorter_than_the_gap_stay_in_their_chain(tmp_path: Path) -> None:
    part = drawn(tmp_path, lines((0, 0), (50, 0), (50, 0.02), (50, 30), (0, 30)))
    (loop,) = part.loops
    assert loop.closed
    assert loop.edges == 5
    assert loop.shortest_edge == pytest.approx(2e-5, abs=EXACT)


def test_edges_without_length_and_doubles_are_left_out_with_a_message(tmp_path: Path) -> None:
    def draw(space: Modelspace) -> None:
        lines((0, 0), (10, 0), (10, 10))(space)
        space.add_line((10, 0), (0, 0))
        space.add_line((3, 3), (3, 3))
        space.add_circle((3, 2), 1)
        space.add_circle((3, 2), 1)

    part = drawn(tmp_path, draw)
    assert [loop.name for loop in part.loops] == ["0/outer", "0/hole1"]
    assert "layer 0, white: 1 curves without length left out" in part.notes
    assert "layer 0, white: 2 curves drawn twice left out" in part.notes


def test_two_arcs_over_the_same_ends_are_no_doubles(tmp_path: Path) -> None:
    def draw(space: Modelspace) -> None:
        space.add_arc((0, 0), 5, 0, 180)
        space.add_arc((0, 0), 5, 180, 360)

    (loop,) = drawn(tmp_path, draw).loops
    assert loop.diameter == pytest.approx(0.01)
    assert loop.edges == 2


def test_a_fork_is_said_where_it_is(tmp_path: Path) -> None:
    def draw(space: Modelspace) -> None:
        lines((0, 0), (10, 0), (10, 10))(space)
        space.add_line((10, 10), (20, 10))

    part = drawn(tmp_path, draw)
    assert {loop.kind for loop in part.loops} == {"open"}
    with pytest.raises(InputError, match=r"at \[10\.0, 10\.0, 0\.0\] mm, where 3 curves meet"):
        part.contour("0/line1")


def test_an_open_line_may_cross_itself(tmp_path: Path) -> None:
    def draw(space: Modelspace) -> None:
        space.add_lwpolyline([(0, 0), (100, 50), (100, 0), (0, 50)])

    line = drawn(tmp_path, draw).contour("0/line1", closed=False)
    assert line.length == pytest.approx(0.05 + 2 * np.hypot(0.1, 0.05))


def test_a_loop_that_crosses_itself_is_refused_with_the_place(tmp_path: Path) -> None:
    part = drawn(tmp_path, lines((0, 0), (100, 50), (100, 0), (0, 50)))
    with pytest.raises(InputError, match=r"crosses or touches itself at \[50\.0, 25\.0, 0\.0\] mm"):
        part.contour("0/outer")


# --- units, planes, bad drawings -------------------------------------------------------------


@pytest.mark.parametrize(
    ("units", "unit", "size"), [(4, "mm", 0.001), (1, "in", 0.0254), (6, "m", 1)]
)
def test_insunits_is_taken_with_a_message(
    tmp_path: Path, units: int, unit: str, size: float
) -> None:
    part = drawn(tmp_path, lambda space: space.add_circle((0, 0), 1), units=units)
    assert part.unit == unit
    assert part.loops[0].diameter == pytest.approx(2 * size)
    assert any(f"unit {unit} taken from $INSUNITS" in note for note in part.notes)
    told = read(part.path, unit="cm")
    assert (told.unit, told.loops[0].diameter) == ("cm", pytest.approx(0.02))
    assert any(f"unit cm as given; $INSUNITS says {unit}" in note for note in told.notes)


def test_no_unit_is_refused_unless_told(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"\$INSUNITS is 0: states no length unit.*--unit mm"):
        drawn(tmp_path, lambda space: space.add_circle((0, 0), 1), units=0)
    assert read(tmp_path / "drawing.dxf", unit="mm").loops[0].diameter == pytest.approx(2e-3)


def test_hidden_layers_are_left_out_with_a_message(tmp_path: Path) -> None:
    def draw(space: Modelspace) -> None:
        space.doc.layers.add("HELP").off()
        space.add_circle((0, 0), 1)
        space.add_circle((0, 0), 2, dxfattribs={"layer": "HELP"})

    part = drawn(tmp_path, draw)
    assert [loop.kind for loop in part.loops] == ["outer"]
    assert [str(each) for each in part.left_out] == ["left out: 1 CIRCLE (on hidden layer HELP)"]
    assert str(part.left_out[0]) in part.notes


def block_in_itself(space: Modelspace) -> None:
    block = space.doc.blocks.new("SNAKE")
    block.add_line((0, 0), (1, 0))
    block.add_blockref("SNAKE", (1, 0))
    space.add_blockref("SNAKE", (0, 0))


def many_blocks(space: Modelspace) -> None:
    block = space.doc.blocks.new("DOT")
    block.add_circle((0, 0), 1)
    rows = {"row_count": 30000, "column_count": 30000, "row_spacing": 3, "column_spacing": 3}
    space.add_blockref("DOT", (0, 0), dxfattribs=rows)


BAD: dict[str, tuple[Callable[[Modelspace], object], str]] = {
    "nothing": (lambda space: space.add_text("hello"), "nothing to cut"),
    "out of plane": (lambda space: space.add_line((0, 0, 0), (1, 0, 5)), "z from 0 to 5 mm"),
    "tilted": (
        lambda space: space.add_circle((0, 0), 5, dxfattribs={"extrusion": (0, 1, 1)}),
        "a CIRCLE on layer 0 leaves the drawing plane",
    ),
    "far away": (lambda space: space.add_line((0, 0), (1e12, 0)), "further than 10 km"),
    "a block in itself": (block_in_itself, "one contains itself"),
    "many blocks": (many_blocks, "inserted 900000000 times"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_drawings_are_refused_in_one_line(tmp_path: Path, case: str) -> None:
    draw, expected = BAD[case]
    with pytest.raises(InputError, match=expected) as caught:
        drawn(tmp_path, draw)
    assert "\n" not in str(caught.value)
    assert str(tmp_path) in str(caught.value)


@pytest.mark.parametrize(
    "content", [b"hello\n", b"\0\1\2", b"AutoCAD Binary DXF\r\n\x1a\x00", b"0\nSECTION\n2\nENTI"]
)
def test_files_that_are_no_dxf_are_refused(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "bad.dxf").write_bytes(content)
    with pytest.raises(InputError, match=r"bad\.dxf: ") as caught:
        read(tmp_path / "bad.dxf")
    assert "\n" not in str(caught.value)


def test_user_coordinate_systems_are_those_of_the_part(tmp_path: Path) -> None:
    document = new(units=1)
    document.modelspace().add_circle((0, 0), 2)
    document.ucs.new(
        "BENCH", dxfattribs={"origin": (1, 2, 0), "xaxis": (0, 1, 0), "yaxis": (-1, 0, 0)}
    )
    document.saveas(tmp_path / "disc.dxf")
    frame = read(tmp_path / "disc.dxf").frame("BENCH")
    expected = [[0, -1, 0, 0.0254], [1, 0, 0, 0.0508], [0, 0, 1, 0], [0, 0, 0, 1]]
    np.testing.assert_allclose(frame, expected, atol=1e-12)
