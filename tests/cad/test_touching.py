"""Flat loops that touch: sides that two share, corners in one place, lines on each other."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest
from ezdxf.layouts.layout import Modelspace
from tests.cad.test_dxf import EXACT, area, drawn

from kerfpath.cad import Part

Place = tuple[float, float]


def outline(x: float, y: float, dx: float, dy: float) -> list[Place]:
    return [(x, y), (x + dx, y), (x + dx, y + dy), (x, y + dy)]


def by_lines(space: Modelspace, corners: list[Place], rng: np.random.Generator) -> None:
    """Draw an outline by lines, in any order, either way round."""
    sides = list(itertools.pairwise([*corners, corners[0]]))
    for k in rng.permutation(len(sides)).tolist():
        space.add_line(*(sides[k] if rng.random() < 0.5 else sides[k][::-1]))


def by_polyline(space: Modelspace, corners: list[Place], rng: np.random.Generator) -> None:
    """Draw an outline by one polyline, from any corner, closed by its flag or by its last point."""
    k = int(rng.integers(len(corners)))
    around = corners[k:] + corners[:k]
    if rng.random() < 0.5:
        space.add_lwpolyline(around, close=True)
    else:
        space.add_lwpolyline([*around, around[0]])


def by_either(space: Modelspace, corners: list[Place], rng: np.random.Generator) -> None:
    (by_lines if rng.random() < 0.5 else by_polyline)(space, corners, rng)


WAYS = {"lines": by_lines, "polylines": by_polyline, "either": by_either}


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("way", WAYS)
def test_every_rectangle_of_a_grid_is_a_loop(tmp_path: Path, way: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    x, y = (np.cumsum(rng.uniform(5, 40, count)).round(3).tolist() for count in (4, 5))
    cells = [
        outline(x0, y0, x1 - x0, y1 - y0)
        for (x0, x1), (y0, y1) in itertools.product(itertools.pairwise(x), itertools.pairwise(y))
    ]

    def draw(space: Modelspace) -> None:
        for k in rng.permutation(len(cells)).tolist():
            WAYS[way](space, cells[k], rng)

    part = drawn(tmp_path, draw)
    assert {(loop.kind, loop.closed) for loop in part.loops} == {("outer", True)}
    found = sorted(area(part, loop.name) for loop in part.loops)
    wanted = sorted((c[2][0] - c[0][0]) * (c[2][1] - c[0][1]) * 1e-6 for c in cells)
    np.testing.assert_allclose(found, wanted, atol=EXACT)
    # Of 3 x 4 cells: 2 x 4 upright sides and 3 x 3 level ones.
    assert "layer 0, white: 17 sides shared by two loops, which are cut twice" in part.notes


def slots(space: Modelspace) -> None:
    """Two slots side by side, each of two lines and two arcs, which share one line."""
    for y in (0, 10):
        space.add_line((0, y), (50, y))
        space.add_line((0, y + 10), (50, y + 10))
        space.add_arc((0, y + 5), 5, 90, 270)
        space.add_arc((50, y + 5), 5, 270, 90)


def in_a_corner(space: Modelspace) -> None:
    by_lines(space, outline(0, 0, 50, 40), np.random.default_rng(1))
    by_lines(space, [(0, 0), (20, 5), (5, 20)], np.random.default_rng(2))


def chequered(space: Modelspace) -> None:
    for k, at in enumerate([(0, 0), (10, 10), (20, 0), (30, 10), (20, 20)]):
        by_lines(space, outline(*at, 10, 10), np.random.default_rng(k))


def tangent(space: Modelspace) -> None:
    """Four half circles that touch each other in one place, with one tangent there."""
    for radius in (10, 20):
        for way in (1, -1):
            space.add_arc((way * radius, 0), radius, 0, 180)
            space.add_arc((way * radius, 0), radius, 180, 360)


@pytest.mark.parametrize(
    ("draw", "kinds", "areas"),
    [
        (slots, ["outer"] * 2, [500 + 25 * np.pi] * 2),
        (in_a_corner, ["outer", "inner"], [-187.5, 2000]),
        (chequered, ["outer"] * 5, [100] * 5),
        (tangent, ["outer"] * 2 + ["inner"] * 2, [-100 * np.pi] * 2 + [400 * np.pi] * 2),
    ],
)
def test_loops_that_touch_part_there(
    tmp_path: Path, draw: object, kinds: list[str], areas: list[float]
) -> None:
    part = drawn(tmp_path, draw)  # type: ignore[arg-type]  # one of the above
    assert [loop.kind for loop in part.loops] == kinds
    assert all(loop.closed for loop in part.loops)
    found = sorted(area(part, loop.name) * 1e6 for loop in part.loops)
    np.testing.assert_allclose(found, sorted(areas), rtol=2e-4)  # chords of 2 um


def test_a_loop_by_one_polyline_stays_one_whatever_ends_at_it(tmp_path: Path) -> None:
    def draw(space: Modelspace) -> None:
        space.add_lwpolyline(outline(0, 0, 30, 20), close=True)
        space.add_line((30, 20), (60, 20))
        space.add_line((0, 0), (30, 0))  # upon a side of it
        space.add_circle((100, 0), 5)
        space.add_line((105, 0), (120, 0))  # where the circle begins

    part = drawn(tmp_path, draw)
    names = ["0/outer1", "0/outer2", "0/line1", "0/line2"]
    assert [loop.name for loop in part.loops] == names
    assert "layer 0, white: 1 curves drawn twice left out" in part.notes


def test_a_loop_drawn_twice_is_one_however_it_is_drawn(tmp_path: Path) -> None:
    def draw(space: Modelspace) -> None:
        rng = np.random.default_rng(1)
        for way in (by_lines, by_lines, by_polyline, by_polyline):
            way(space, outline(0, 0, 30, 20), rng)
        space.add_circle((10, 10), 4)
        space.add_arc((10, 10), 4, 30, 200)
        space.add_arc((10, 10), 4, 200, 30)

    part = drawn(tmp_path, draw)
    assert [loop.name for loop in part.loops] == ["0/outer", "0/hole1"]
    assert any("curves drawn twice left out" in note for note in part.notes)


def test_lines_on_each_other_in_two_layers_or_colours_are_said(tmp_path: Path) -> None:
    def draw(space: Modelspace) -> None:
        space.add_circle((10, 10), 4, dxfattribs={"layer": "CUT"})
        space.add_arc((10, 10), 4, 30, 200, dxfattribs={"layer": "OLD"})
        space.add_arc((10, 10), 4, 200, 30, dxfattribs={"layer": "OLD"})
        space.add_circle((10, 10), 4.01, dxfattribs={"layer": "NEAR"})  # gap: 0.05 mm
        space.add_circle((10, 10), 4.2, dxfattribs={"layer": "APART"})
        # Halves of one square: alike in size and length, but elsewhere.
        space.add_lwpolyline([(50, 0), (60, 0), (60, 10)], close=True, dxfattribs={"color": 1})
        space.add_lwpolyline([(50, 0), (50, 10), (60, 10)], close=True, dxfattribs={"color": 2})

    part = drawn(tmp_path, draw)
    said = [note for note in part.notes if "lie on each other" in note]
    pairs = itertools.combinations(["CUT/hole1", "OLD/hole1", "NEAR/hole1"], 2)
    words = "lie on each other: cut twice if both are picked"
    assert said == [f"{one} and {other} {words}" for one, other in pairs]
    assert part.loop("APART/outer").kind == "outer"


def hanging(part: Part) -> list[str]:
    return [note for note in part.notes if note.startswith("open line")]


def test_open_lines_say_where_they_hang_the_nearest_first(tmp_path: Path) -> None:
    def draw(space: Modelspace) -> None:
        for k in range(5):
            space.add_line((0, 10 * k), (100, 10 * k))
        by_polyline(space, outline(0, 100, 9, 9), np.random.default_rng(1))
        corners = [*outline(200, 0, 50, 50), (200, 0.3)]
        for start, end in itertools.pairwise(corners):
            space.add_line(start, end)

    part = drawn(tmp_path, draw)
    first, *others = hanging(part)
    assert first == (
        "open line: 0/line6 is open at [200.0, 0.0, 0.0] mm: the next end is 0.300 mm away; to "
        "close it, set gap_mm = 0.3 in [part] (--gap-mm) or mend the drawing"
    )
    assert len(others) == 3
    assert others[-1] == "open lines: 3 more"
    closed = drawn(tmp_path, lambda space: by_lines(space, outline(0, 0, 9, 9), _rng()))
    assert hanging(closed) == []


def _rng() -> np.random.Generator:
    return np.random.default_rng(0)
