"""Tables of points in: columns, units, decimal commas, repairs, a line number for every fault."""

from __future__ import annotations

import contextlib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kerfpath.cad import Part, read
from kerfpath.errors import InputError

SQUARE = "x_mm,y_mm,z_mm,nx,ny,nz\n0,0,0,0,0,1\n10,0,0,0,0,1\n10,20,0,0,0,1\n0,20,0,0,0,1\n"
ROWS = SQUARE.split("\n", 1)[1]


def table(folder: Path, text: str | bytes, *, name: str = "points.csv", **options: object) -> Part:
    path = folder / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return read(path, **options)


def test_rows_are_the_contour(tmp_path: Path) -> None:
    part = table(tmp_path, SQUARE)
    (loop,) = part.loops
    assert (loop.name, loop.kind, loop.closed, loop.edges) == ("contour", "open", False, 3)
    assert (loop.surface, loop.diameter, part.unit, part.faces) == ("points", None, "mm", 0)
    assert loop.length == pytest.approx(0.04)
    assert loop.shortest_edge == pytest.approx(0.01)
    contour = part.contour("contour", closed=False)
    np.testing.assert_allclose(contour.points[2], [0.01, 0.02, 0], atol=1e-15)
    np.testing.assert_array_equal(contour.axes, np.tile([0.0, 0.0, -1.0], (4, 1)))


def turn(about: int, deg: float) -> np.ndarray:
    """Return the rotation about x, y or z (0, 1, 2)."""
    c, s = np.cos(np.radians(deg)), np.sin(np.radians(deg))
    R = np.eye(3)
    i, j = (about + 1) % 3, (about + 2) % 3
    R[[i, j, i, j], [i, j, j, i]] = c, c, -s, s
    return R


@pytest.mark.parametrize("header", ["a_deg,b_deg,c_deg", "A [deg],B [deg],C [deg]", "w,p,r"])
def test_angles_of_poses_are_those_of_their_controller(tmp_path: Path, header: str) -> None:
    """KUKA turns about z, then the new y, then the new x; FANUC about fixed x, y and z."""
    rng = np.random.default_rng(2)
    angles = np.array([170.0, 10, 175]) + rng.uniform(-25, 25, (6, 3))
    rows = [f"{5 * k},{k},0,{x},{y},{z}\n" for k, (x, y, z) in enumerate(angles.tolist())]
    part = table(tmp_path, f"x_mm,y_mm,z_mm,{header}\n" + "".join(rows))
    axes = part.contour("contour", closed=False).axes
    for (one, two, three), axis in zip(angles.tolist(), axes, strict=True):
        z, x = (one, three) if header[0] in "aA" else (three, one)
        R = turn(2, z) @ turn(1, two) @ turn(0, x)
        assert axis == pytest.approx(R[:, 2], abs=1e-12)
    # An axis for all points is what is meant if it is given.
    given = table(tmp_path, f"x_mm,y_mm,z_mm,{header}\n" + "".join(rows), axis=(0, 0, -1))
    assert given.contour("contour", closed=False).axes[0].tolist() == [0, 0, -1]


@pytest.mark.parametrize("closed", [True, False])
@pytest.mark.parametrize("count", [30, 3000])
def test_points_in_no_order_are_said(tmp_path: Path, count: int, closed: bool) -> None:
    rng = np.random.default_rng(4)
    angle = np.linspace(0, 2 * np.pi if closed else 4, count, endpoint=False)
    rows = np.round(np.stack([60 * np.cos(angle), 40 * np.sin(angle), 9 * angle], axis=1), 6)
    for is_sorted in (True, False):
        order = np.arange(count) if is_sorted else rng.permutation(count)
        text = "".join(f"{x},{y},{z},0,0,1\n" for x, y, z in rows[order].tolist())
        part = table(tmp_path, "x_mm,y_mm,z_mm,nx,ny,nz\n" + text)
        assert any("in no order" in note for note in part.notes) != is_sorted


def probed(rows: np.ndarray) -> str:
    return "x_mm,y_mm,z_mm,nx,ny,nz\n" + "".join(
        f"{x},{y},{z},0,0,1\n" for x, y, z in rows.tolist()
    )


@settings(max_examples=40, deadline=None, derandomize=True)
@given(st.integers(0, 2**32 - 1), st.booleans(), st.integers(12, 300))
def test_points_in_no_order_are_sorted_along_their_curve(
    tmp_path_factory: pytest.TempPathFactory, seed: int, closed: bool, count: int
) -> None:
    rng = np.random.default_rng(seed)
    # Steps differ by less than a half from the mean: neighbours stay nearest.
    steps = np.arange(count) + rng.uniform(-0.2, 0.2, count)
    angle = steps / count * (2 * np.pi if closed else 4.0)
    rows = np.stack([60 * np.cos(angle), 40 * np.sin(angle), 9 * np.sin(2 * angle)], axis=1)
    rows = np.round(rows, 6)
    mixed = rng.permutation(count)
    folder = tmp_path_factory.mktemp("sort")
    part = table(folder, probed(rows[mixed]), sort="closed" if closed else "open")
    found = part.contour("contour", closed=closed).points * 1e3
    assert part.loops[0].kind == ("outer" if closed else "open")
    assert any("points sorted along the cut" in note for note in part.notes)
    if closed:  # counter-clockwise, from the first point listed
        expected = np.roll(rows, -int(mixed[0]), axis=0)
    else:
        place = np.argsort(mixed)
        expected = rows if place[0] < place[-1] else rows[::-1]
    np.testing.assert_allclose(found[:count], expected, atol=1e-9)


def test_points_whose_order_is_not_clear_are_refused(tmp_path: Path) -> None:
    t = np.arange(20.0)[:, None]
    line = np.hstack([t, 0 * t, 0 * t])
    ring = 10 * np.hstack([np.cos(t * np.pi / 10), np.sin(t * np.pi / 10), 0 * t])
    near = np.vstack([line, [[19.5, 0.5, 0]], line[:4:-1] + np.array([0, 1.1, 0])])
    for rows, sort, message in (
        (np.vstack([line, [[10, 1, 0], [10, 2, 0], [10, 3, 0]]]), "open", "branch at 10, 0, 0 mm"),
        (near, "open", "two stretches are as close as neighbours at"),
        (line, "closed", "the ends of the curve, 0, 0, 0 mm and 19, 0, 0 mm, are 19 mm apart"),
        (ring, "open", 'are 3.129 mm apart, as close as neighbours; write sort = "closed"'),
        (
            np.vstack([line, line + np.array([500, 0, 0])]),
            "open",
            r"a group of points at \d+, 0, 0 mm lies apart",
        ),
        (line[:3], "open", "expected at least 4 points apart, got 3"),
    ):
        text = probed(rows[np.random.default_rng(1).permutation(len(rows))])
        with pytest.raises(InputError, match=message) as caught:
            table(tmp_path, text, sort=sort)
        assert "\n" not in str(caught.value)
    with pytest.raises(InputError, match="sort: expected one of open, closed, got 'ring'"):
        table(tmp_path, probed(line), sort="ring")
    (tmp_path / "a.mpf").write_text("G71 G1 X0")
    with pytest.raises(InputError, match="sort: expected a table, got a NC program file"):
        read(tmp_path / "a.mpf", sort="open")


def line_of_points(x: float, count: int = 5) -> str:
    """Return rows of points 1 mm apart in y, at x mm."""
    return "".join(f"{x},{k},0,0,0,1\n" for k in range(count))


HEADER = "x_mm,y_mm,z_mm,nx,ny,nz\n"


@pytest.mark.parametrize("between", ["\n", "\n\n", "# second\n"])
def test_runs_with_an_empty_line_or_a_comment_before_a_jump_are_contours(
    tmp_path: Path, between: str
) -> None:
    part = table(tmp_path, HEADER + between.join(line_of_points(x) for x in (0, 50, 90)))
    assert [loop.name for loop in part.loops] == ["run1", "run2", "run3"]
    assert [loop.length for loop in part.loops] == pytest.approx([0.004] * 3)
    assert "3 runs of points, separated by empty lines or comments" in part.notes


def test_an_empty_line_without_a_jump_says_nothing(tmp_path: Path) -> None:
    rows = line_of_points(0).splitlines(keepends=True)
    part = table(tmp_path, HEADER + "".join(rows[:2]) + "\n" + "".join(rows[2:]))
    assert [loop.name for loop in part.loops] == ["contour"]
    # Nor do empty lines everywhere, where a long edge is one.
    twice = HEADER + (line_of_points(0) + line_of_points(50)).replace("\n", "\n\n")
    part = table(tmp_path, twice)
    assert [loop.name for loop in part.loops] == ["contour"]


def test_a_jump_that_is_cut_is_said_with_its_line(tmp_path: Path) -> None:
    part = table(tmp_path, HEADER + line_of_points(0) + line_of_points(50))
    assert [loop.name for loop in part.loops] == ["contour"]
    (note,) = part.notes
    assert note.startswith(
        "line 7: 50.16 mm from the point before, 50 times the usual step, is cut"
    )
    # A corner to corner table has no usual step that is much shorter.
    assert table(tmp_path, SQUARE).notes == ()


def test_a_line_that_ends_where_it_began_is_closed(tmp_path: Path) -> None:
    part = table(tmp_path, SQUARE + "0,0.04,0,0,0,1\n")
    assert part.loops[0].kind == "outer"
    contour = part.contour("contour")
    assert contour.closed
    assert len(contour) == 5
    turned = table(tmp_path, SQUARE.replace(",1\n", ",-1\n") + "0,0,0,0,0,-1\n")
    assert turned.loops[0].kind == "inner"
    with pytest.raises(InputError, match=r"ends 0\.060 mm from its start.*0\.05 mm"):
        table(tmp_path, SQUARE + "0,0.06,0,0,0,1\n").contour("contour")


WRITTEN = {
    "plain, with unit": (ROWS, {"unit": "mm"}),
    "byte-order mark": ("\ufeff" + SQUARE, {}),
    "semicolons and decimal commas": (SQUARE.replace(",", ";").replace("10;0;", "10,0;0,00;"), {}),
    "tabs": (SQUARE.replace(",", "\t"), {}),
    "spaces": (SQUARE.replace(",", "   "), {}),
    "comments and empty lines": (
        "# made by hand\n\n" + SQUARE.replace("10,20", "\n% half\n10,20"), {}
    ),
    "Windows lines": (SQUARE.replace("\n", "\r\n"), {}),
    "quoted": ('"x_mm"' + SQUARE[4:], {}),
    "units in brackets": (SQUARE.replace("_mm", " [mm]"), {}),
    "another order": (
        "nx,ny,nz,z_cm,x_cm,y_cm\n0,0,1,0,0,0\n0,0,1,0,1,0\n0,0,1,0,1,2\n0,0,1,0,0,2\n", {}
    ),
    "tool axes": (SQUARE.replace("nx,ny,nz", "axis_x,axis_y,axis_z").replace(",1\n", ",-2\n"), {}),
    "poses": (
        SQUARE.replace("nx,ny,nz", "qx,qy,qz,qw").replace("0,0,1\n", "1,0,0,0\n"), {}
    ),
    "poses without header": (ROWS.replace("0,0,1\n", "0.7071,0.7071,0,0\n"), {"unit": "mm"}),
    "inches": (SQUARE.replace("_mm", ""), {"unit": "mm"}),
}  # fmt: skip


@pytest.mark.parametrize("way", WRITTEN)
def test_the_same_points_however_they_are_written(tmp_path: Path, way: str) -> None:
    text, options = WRITTEN[way]
    part = table(tmp_path, text, **options)
    expected = table(tmp_path, SQUARE, name="plain.csv").contour("contour", closed=False)
    contour = part.contour("contour", closed=False)
    np.testing.assert_allclose(contour.points, expected.points, atol=1e-15)
    np.testing.assert_allclose(contour.axes, expected.axes, atol=1e-15)
    if "\ufeff" in text:
        table(tmp_path, SQUARE.encode("utf-16")).contour("contour", closed=False)


def test_the_tool_axis_is_the_z_of_the_pose(tmp_path: Path) -> None:
    from scipy.spatial.transform import Rotation

    turns = Rotation.random(20, rng=7)
    # Neighbours far apart in angle would be refused as flips: blend from one to the next.
    turns = Rotation.from_rotvec(0.05 * turns.as_rotvec())
    rows = np.column_stack([np.arange(20), np.zeros((20, 2)), turns.as_quat()])
    text = "\n".join(" ".join(map(str, row)) for row in rows.tolist())
    axes = table(tmp_path, text, unit="mm").contour("contour", closed=False).axes
    np.testing.assert_allclose(axes, turns.as_matrix()[:, :, 2], atol=1e-12)


def test_one_table_may_hold_several_contours_and_columns_that_are_not_used(tmp_path: Path) -> None:
    text = "contour,node," + SQUARE.split("\n")[0] + "\n"
    text += "".join(f"trim,{k},{row}\n" for k, row in enumerate(ROWS.split()))
    text += "".join(f"slot,{k},{row}\n" for k, row in enumerate(ROWS.split()[:3]))
    part = table(tmp_path, text)
    assert [(loop.name, loop.edges) for loop in part.loops] == [("trim", 3), ("slot", 2)]
    assert part.notes == ("columns not used: node",)
    again = text + "trim,9,5,5,5,0,0,1\n"
    with pytest.raises(InputError, match="line 9: rows of contour 'trim' are separated"):
        table(tmp_path, again)


def test_repeated_points_are_left_out_with_a_message(tmp_path: Path) -> None:
    text = SQUARE.replace("10,20,0,0,0,1\n", "10,20,0,0,0,1\n" * 3)
    part = table(tmp_path, text)
    assert part.loops[0].edges == 3
    assert part.notes == ("contour 'contour': 2 repeated points left out, the first in line 5",)


def test_a_unit_that_is_asked_for_wins_with_a_message(tmp_path: Path) -> None:
    part = table(tmp_path, SQUARE, unit="in")
    assert part.bounding_box[1, 1] == pytest.approx(20 * 0.0254)
    assert part.notes == ("unit in as given; the header says mm",)


BAD = {
    "empty": ("", "the file is empty"),
    "only comments": ("# x y z\n", "holds no rows"),
    "only a header": (SQUARE.split("\n")[0], "a header but no rows"),
    "no unit": (ROWS, "states no length unit"),
    "no axes": ("x_mm,y_mm,z_mm\n0,0,0\n", "expected columns x y z, then nx ny nz .*got x y z"),
    "three columns": ("0,0,0\n1,1,1\n", "line 1: has points without tool axes"),
    "unknown unit": (SQUARE.replace("_mm", "_yd"), "units are yd, yd, yd; expected one"),
    "two units": (SQUARE.replace("z_mm", "z_in"), "units are mm, mm, in; expected one"),
    "a column twice": (SQUARE.replace("ny", "nx"), "names the column 'nx' twice"),
    "a column too few": (SQUARE.replace("10,20,0", "10,20"), "line 4: expected 6 columns, got 5"),
    "a column too many": (SQUARE + "1,2,3,0,0,1,9\n", "line 6: expected 6 columns, got 7"),
    "not a number": (SQUARE.replace("10,20", "1o,20"), "line 4, column x: .*a number, got '1o'"),
    "two commas": (SQUARE.replace("10,20", "10,5,20"), "line 4: expected 6 columns"),
    "thousands": (SQUARE.replace(",", ";").replace("20;", "1.020,5;"), "got '1.020,5'"),
    "NaN": (SQUARE.replace("10,20", "10,nan"), "line 4, column y: expected a number, got 'nan'"),
    "infinity": (SQUARE.replace("10,20", "10,1e999"), "line 4, column y: .*finite"),
    "far away": (SQUARE.replace("10,20", "10,1e12"), "line 4: a point further than 10 km"),
    "no direction": (SQUARE.replace("20,0,0,0,1", "20,0,0,0,0", 1), "line 4: nx ny nz are all 0"),
    "flips": (SQUARE.replace("20,0,0,0,1", "20,0,0,0,-1", 1), "line 4: the axis turns by 180 deg"),
    "turns on the spot": (
        SQUARE.replace("10,20,0,0,0,1", "10,0,0,0,1,1"), "line 4: the same point as line 3"
    ),
    "one point": (SQUARE.split("\n10")[0], "at least 2 points, got 1"),
    "another axis at the end": (SQUARE + "0,0,0,0,1,1\n", "line 6: ends where it began, line 2"),
    "no quaternion": (
        SQUARE.replace("nx,ny,nz", "qx,qy,qz,qw").replace("0,0,1\n", "1,1,0,0\n"),
        r"line 2: a quaternion of length 1\.41",
    ),
    "a cell over lines": (SQUARE.replace("10,20", '"10\n",20'), "over several lines"),
    "bytes": (SQUARE.encode() + b"\xff\n", "line 6: expected text in UTF-8"),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD)
def test_bad_tables_are_refused_in_one_line(tmp_path: Path, case: str) -> None:
    text, expected = BAD[case]
    with pytest.raises(InputError, match=expected) as caught:
        table(tmp_path, text)
    assert "\n" not in str(caught.value)
    assert str(tmp_path) in str(caught.value)


SPECIAL = [
    "0",
    "1",
    "1,5",
    "-2.5",
    "nan",
    "1e400",
    "",
    '"',
    "x",
    "nx_mm",
    "#",
    "\t",
    ";",
    ",",
    "\0",
]
CELLS = st.sampled_from(SPECIAL) | st.text(max_size=4)


@settings(max_examples=300, derandomize=True, deadline=None, database=None)
@given(
    rows=st.lists(st.lists(CELLS, max_size=8), max_size=6),
    delimiter=st.sampled_from([",", ";", "\t", " "]),
    header=st.sampled_from(["", "x_mm,y_mm,z_mm,nx,ny,nz\n", "x,y,z,qx,qy,qz,qw,contour\n"]),
)
def test_any_text_gives_a_part_or_an_input_error(
    rows: list[list[str]], delimiter: str, header: str, tmp_path_factory: pytest.TempPathFactory
) -> None:
    text = header.replace(",", delimiter) + "\n".join(delimiter.join(row) for row in rows)
    folder = tmp_path_factory.mktemp("table")
    with contextlib.suppress(InputError):
        part = table(folder, text.encode("utf-8", "surrogatepass"), unit="mm")
        for loop in part.loops:
            part.contour(loop.name, closed=False)
