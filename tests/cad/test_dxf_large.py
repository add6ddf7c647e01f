"""DXF drawings of many entities: nesting by the even-odd rule, crowds at one place, and limits."""

from __future__ import annotations

import struct
import tracemalloc
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from ezdxf.layouts import Modelspace
from tests.cad.test_dxf import drawn

from kerfpath.cad import read
from kerfpath.cad.chains import boxes_around
from kerfpath.cad.curves import Arc, Line, measure
from kerfpath.errors import InputError

HEAD = "0\nSECTION\n2\nENTITIES\n"
LINE = "0\nLINE\n8\n0\n10\n{}\n20\n0\n11\n{}\n21\n5\n"
END = "0\nENDSEC\n0\nEOF\n"


def squares(x: float, y: float, side: float, depth: int, rng: np.random.Generator) -> Iterator:
    """Yield squares (x, y, side, depth), each with up to four smaller ones inside, or one."""
    yield x, y, side, depth
    if depth == 6:
        return
    for i, j in [(0, 0)] if rng.random() < 0.3 else [(0, 0), (0, 1), (1, 0), (1, 1)]:
        if rng.random() < 0.8:
            inner = side * rng.uniform(0.2, 0.4)
            free = side / 2 - inner
            place = rng.uniform(0.1, 0.9, 2) * free
            yield from squares(
                x + i * side / 2 + place[0], y + j * side / 2 + place[1], inner, depth + 1, rng
            )


@pytest.mark.parametrize("seed", range(3))
def test_loops_within_an_odd_number_of_others_are_holes(tmp_path: Path, seed: int) -> None:
    tree = list(squares(0, 0, 1000, 0, np.random.default_rng(seed)))
    assert len(tree) > 50

    def draw(space: Modelspace) -> None:
        for x, y, side, _ in tree:
            space.add_lwpolyline(
                [(x, y), (x + side, y), (x + side, y + side), (x, y + side)], close=True
            )

    part = drawn(tmp_path, draw, drawing_frame="cut")
    found = {tuple(np.round(loop.bounding_box[0, :2] * 1e3, 6)): loop.kind for loop in part.loops}
    for x, y, _, depth in tree:
        assert found[round(x, 6), round(y, 6)] == ("inner" if depth % 2 else "outer")


@pytest.mark.slow
def test_many_ends_at_one_place_take_no_memory(tmp_path: Path) -> None:
    """Spokes from one point took a byte for every pair of them, and more."""
    spokes, path = 3000, tmp_path / "wheel.dxf"
    turn = np.linspace(0, 2 * np.pi, spokes, endpoint=False)
    ends = np.round(1e3 * np.stack([np.cos(turn), np.sin(turn)], axis=1), 4).tolist()
    text = "".join(LINE.replace("\n21\n5", f"\n21\n{y}").format(0, x) for x, y in ends)
    path.write_text(HEAD + text + END)
    tracemalloc.start()
    try:
        assert len(read(path, "mm").loops) == spokes
        assert tracemalloc.get_traced_memory()[1] < 60e6
    finally:
        tracemalloc.stop()


def test_too_many_lines_are_refused_before_they_are_read(tmp_path: Path) -> None:
    path = tmp_path / "large.dxf"
    path.write_text(HEAD + LINE.format(0, 1) * 520_000 + END)
    with pytest.raises(
        InputError, match=r"large\.dxf: holds 520000 lines, at most 100000 are read; save only what"
    ):
        read(path, "mm")


def test_too_many_values_are_refused_before_they_are_read(tmp_path: Path) -> None:
    path = tmp_path / "large.dxf"
    path.write_text(HEAD + "0\nTEXT\n" + "1\na\n" * 3_100_000 + END)
    said = r"holds 3\.1 million values, at most 3 million are read; save only what"
    with pytest.raises(InputError, match=said):
        read(path, "mm")
    sound = b"AutoCAD Binary DXF\r\n\x1a\0" + struct.pack("<H8s", 0, b"SECTION\0")
    path.write_bytes(sound + struct.pack("<Hd", 40, 1.0) * 3_100_000)
    with pytest.raises(InputError, match=said):
        read(path, "mm")


@pytest.mark.slow
def test_a_polyline_of_too_many_sides_is_refused(tmp_path: Path) -> None:
    def draw(space: Modelspace) -> None:
        space.add_lwpolyline([(k, k * k % 7) for k in range(100_002)])

    with pytest.raises(InputError, match="more than 100000 curves and blocks, at most"):
        drawn(tmp_path, draw)


@pytest.mark.slow
@pytest.mark.parametrize(("apart", "said"), [(1e-5, "end within 0.05 mm of each other"), (0, "")])
def test_ends_too_crowded_to_tell_apart_are_refused(
    tmp_path: Path, apart: float, said: str
) -> None:
    """Ends 0.01 um apart may all be bridged; where they are one place, nothing is to bridge."""
    path, count = tmp_path / "crowd.dxf", 5000
    path.write_text(
        HEAD + "".join(LINE.format(f"{k * apart:.5f}", k + 1) for k in range(count)) + END
    )
    if not said:
        assert len(read(path, "mm").loops) == count
        return
    with pytest.raises(InputError, match=said):
        read(path, "mm")


def test_lines_drawn_a_hundred_times_over_are_refused(tmp_path: Path) -> None:
    """On a layer each, so that none is left out as drawn twice."""

    def draw(space: Modelspace) -> None:
        for k in range(150):
            space.add_circle((0, 0), 5, dxfattribs={"layer": f"L{k}"})

    with pytest.raises(InputError, match="more than 10000 pairs of lines lie on each other"):
        drawn(tmp_path, draw)


def test_curves_measured_together_are_as_each_alone() -> None:
    rng = np.random.default_rng(5)
    curves: list[Line | Arc] = [Line(*rng.uniform(-1e3, 1e3, (2, 3))) for _ in range(50)]
    for _ in range(200):
        start, turn = rng.uniform(-20, 20), rng.uniform(-2, 2) * np.pi
        curves.append(Arc(*rng.uniform(-1e3, 1e3, (3, 3)), start, start + turn))
    alone = [replace(curve) for curve in curves]
    measure(curves)
    for one, other in zip(curves, alone, strict=True):
        assert {"ends", "around", "mark", "_box"} <= vars(one).keys()
        assert not vars(other).keys() & {"ends", "around", "mark", "_box"}
        assert one.mark == other.mark
        # Sines of many angles at once may differ from those of one in their last bits.
        for found, expected in (
            (one.ends, other.ends), (one.around, other.around), (one.bounds(), other.bounds())
        ):  # fmt: skip
            np.testing.assert_allclose(found, expected, rtol=0, atol=1e-11)
        points = other.at(np.linspace(other.start, other.end, 10_001))
        low, high = one.bounds()
        assert (low - 1e-9 <= points).all()
        assert (points <= high + 1e-9).all()
        near = 1e3 * (4 * np.pi / 10_000) ** 2 if isinstance(one, Arc) else 1e-9
        np.testing.assert_allclose([low, high], [points.min(0), points.max(0)], atol=near)


@pytest.mark.parametrize("seed", range(4))
def test_boxes_around_boxes_are_found_at_all_sizes(seed: int) -> None:
    rng = np.random.default_rng(seed)
    size = 10.0 ** rng.uniform(-3, 3, (400, 2)) * (rng.random((400, 2)) > 0.1)
    low = np.round(rng.uniform(0, 1000, (400, 2)), seed)
    boxes = np.stack([low, low + size], axis=1)
    boxes[300:] = boxes[:100] + rng.uniform(-2e-3, 2e-3, (100, 2, 2))
    within = 1e-3
    larger = np.concatenate(
        [boxes[:, None, 0] - boxes[:, 0], boxes[:, 1] - boxes[:, None, 1]], axis=2
    )
    expected = (larger > -within).all(axis=2) & ~np.eye(400, dtype=bool)
    assert expected.sum() > 200
    found = np.zeros_like(expected, dtype=int)
    for inside, around in boxes_around(boxes, within):
        np.add.at(found, (inside, around), 1)
    assert np.array_equal(found, expected)
