"""Cutter-location files in: cuts between rapid moves, axes, units, the line of every fault."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kerfpath.cad import Part, read
from kerfpath.contour import Contour
from kerfpath.errors import InputError

SQUARE = [(0, 0), (10, 0), (10, 20), (0, 20)]
NX = """\
TOOL PATH/TRIM_FLANGE,TOOL,BEAM
TLDATA/MILL,0.2000,0.0000,75.0000,0.0000,0.0000
MSYS/0.0000,0.0000,0.0000,1.0000000,0.0000000,0.0000000,0.0000000,1.0000000,0.0000000
$$ centerline data
PAINT/PATH
PAINT/COLOR,186
LOAD/TOOL,1
RAPID
GOTO/0.0000,0.0000,50.0000,0.0000000,0.0000000,1.0000000
RAPID
GOTO/0.0000,0.0000,5.0000
FEDRAT/MMPM,3000.0000
GOTO/0.0000,0.0000,0.0000
GOTO/10.0000,0.0000,0.0000
GOTO/10.0000,20.0000,0.0000,0.0000000,0.1736482,0.9848078
GOTO/0.0000,20.0000,0.0000
RAPID
GOTO/0.0000,20.0000,50.0000
PAINT/SPEED,10
END-OF-PATH
TOOL PATH/HOLE,TOOL,BEAM
RAPID
GOTO/5.0000,5.0000,0.0000,0.0000000,0.0000000,1.0000000
GOTO/6.0000,5.0000,0.0000
GOTO/6.0000,6.0000,0.0000
GOTO/5.0000,5.0000,0.0000
END-OF-PATH
"""
CATIA = """\
$$ -----------------------------------------------------------------
$$     CATIA APT VERSION 1.0
$$*CATIA0
$$     1.00000     0.00000     0.00000     0.00000
PARTNO  Flange / $ 2 by 3
UNITS/MM
MULTAX
CUTTER/  0.200000,  0.100000,  0.000000,  0.100000,  0.000000,$
         0.000000, 50.000000
TPRINT/T1 Beam,,
LOADTL/1
SPINDL/ 70.0000,RPM,CLW
PPRINT OPERATION : GOTO/1,2,3
RAPID
GOTO  /    0.00000,    0.00000,    5.00000, 0.000000,$
           0.000000, 1.000000
FEDRAT/  300.0000,MMPM
GOTO  /    0.00000,    0.00000,    0.00000, 0.000000, 0.000000, 1.000000
GOTO  /   10.00000,    0.00000,    0.00000, 0.000000, 0.000000, 1.000000
GOTO  /   1.0D1,    2.0E+01,    -.00000, 0.000000, 0.1736482, 0.9848078
goto  /    0.00000,   20.00000,    0.00000, 0.000000, 0.1736482, 0.9848078
FINI
"""
PLAIN = """\
UNITS/INCHES
MULTAX/OFF
FROM/0,0,1
RAPID
GOTO/0,0,0
FEDRAT/20,IPM
GOTO/10,0,0
GOTO/10,20,0
GOTO/0,20,0
"""


def path(folder: Path, text: str | bytes, *, name: str = "cut.apt", **options: object) -> Part:
    file = folder / name
    file.write_bytes(text if isinstance(text, bytes) else text.encode())
    return read(file, **options)


def written(contours: Sequence[Contour], decimals: int = 9) -> str:
    """Write contours as a cutter-location file in mm, the tool axis towards the spindle."""
    lines = ["PARTNO TEST", "UNITS/MM", "MULTAX/ON"]
    for contour in contours:
        rows = np.hstack([contour.points * 1000, -contour.axes])
        for k, row in enumerate(rows):
            lines += ["RAPID"] if k == 0 else []
            lines.append("GOTO/" + ",".join(f"{value:.{decimals}f}" for value in row))
    return "\n".join([*lines, "FINI", ""])


def test_each_run_between_rapid_moves_is_a_contour(tmp_path: Path) -> None:
    part = path(tmp_path, NX, name="flange.cls", unit="mm")
    assert [(loop.name, loop.layer, loop.kind) for loop in part.loops] == [
        ("cut1", "TRIM_FLANGE", "open"),
        ("cut2", "HOLE", "outer"),
    ]
    trim = part.contour("cut1", closed=False)
    np.testing.assert_allclose(
        trim.points, [[x / 1000, y / 1000, 0] for x, y in SQUARE], atol=1e-15
    )
    # The file has seven decimals of the axis, which points from the tip towards the spindle.
    upright, leaning = [0.0, 0.0, -1.0], [0.0, -np.sin(np.pi / 18), -np.cos(np.pi / 18)]
    np.testing.assert_allclose(trim.axes, [upright, upright, leaning, leaning], atol=1e-7)
    assert part.contour("cut2").closed
    assert (part.unit, part.faces, part.left_out) == ("mm", 0, ())
    assert part.notes == (
        "words not used: FEDRAT, PAINT, TLDATA",
        "contour 'cut1': 5 mm along the tool axis at its start, lines 11 to 13, left out",
    )
    assert [loop.name for loop in part.pick(layer="HOLE")] == ["cut2"]


def test_the_same_path_as_other_systems_write_it(tmp_path: Path) -> None:
    expected = path(tmp_path, NX, unit="mm").contour("cut1", closed=False)
    catia = path(tmp_path, CATIA, name="flange.aptsource")
    assert "5 mm along the tool axis" in catia.notes[-1]
    np.testing.assert_array_equal(catia.contour("cut1", closed=False).points, expected.points)
    np.testing.assert_array_equal(catia.contour("cut1", closed=False).axes, expected.axes)
    windows = path(tmp_path, CATIA.replace("\n", "\r\n").encode() + b"$$ gepr\xfcft\r\n")
    np.testing.assert_array_equal(windows.contour("cut1", closed=False).points, expected.points)


def test_inches_and_an_upright_axis(tmp_path: Path) -> None:
    part = path(tmp_path, PLAIN, name="plate.cl")
    contour = part.contour("cut1", closed=False)
    np.testing.assert_allclose(contour.points[2], [0.254, 0.508, 0], atol=1e-15)
    np.testing.assert_array_equal(contour.axes, np.tile([0.0, 0.0, -1.0], (4, 1)))
    assert part.unit == "in"
    other = path(tmp_path, PLAIN, unit="mm")
    assert "unit mm as given; the file says in" in other.notes
    assert other.contour("cut1", closed=False).length == pytest.approx(0.04)


PATH = "RAPID\nGOTO/0,0,0,0,0,1\nGOTO/0,30,0\nGOTO/40,30,0\n"


@pytest.mark.parametrize("before", ["TOOL PATH/TRIM,TOOL,BEAM", "LOADTL/1", "LOAD/TOOL,1"])
def test_the_unit_may_come_after_words_without_points(tmp_path: Path, before: str) -> None:
    (tmp_path / "path.cls").write_text(f"{before}\nUNITS/MM\n{PATH}")
    assert read(tmp_path / "path.cls").loop("cut1").length == pytest.approx(0.07)
    (tmp_path / "path.cls").write_text(f"{PATH}UNITS/MM\n")
    with pytest.raises(InputError, match="line 5: UNITS after points without one"):
        read(tmp_path / "path.cls")


def test_a_comment_goes_on_in_lines_of_numbers_only(tmp_path: Path) -> None:
    creo = "$$-> CSYS / 1.0, 0.0, 0.0, 0.0, $\n 0.0, 1.0, 0.0, 0.0, $\n 0.0, -1.0E-02, 1.0, 0.0\n"
    (tmp_path / "path.cl").write_text(f"UNITS/MM\n{creo}{PATH}")
    assert read(tmp_path / "path.cl").loop("cut1").length == pytest.approx(0.07)
    # A statement after such a comment is one, and numbers that continue nothing are refused.
    (tmp_path / "path.cl").write_text(f"$$ in dollars: 5 $\nUNITS/INCHES\n{PATH}")
    assert read(tmp_path / "path.cl").loop("cut1").length == pytest.approx(0.07 * 25.4)
    (tmp_path / "path.cl").write_text(f"UNITS/MM\n{creo} 0.0, 1.0\n{PATH}")
    with pytest.raises(InputError, match="line 5"):
        read(tmp_path / "path.cl")


def test_the_axis_is_the_last_that_was_said(tmp_path: Path) -> None:
    text = PLAIN.replace("MULTAX/OFF", "MULTAX/ON\nTLAXIS/0,0.6,0.8")
    contour = path(tmp_path, text).contour("cut1", closed=False)
    np.testing.assert_allclose(contour.axes, np.tile([0.0, -0.6, -0.8], (4, 1)), atol=1e-15)
    said = path(tmp_path, PLAIN.replace("MULTAX/OFF\n", ""), axis=(0, 0, -2))
    np.testing.assert_array_equal(
        said.contour("cut1", closed=False).axes, np.tile([0.0, 0.0, -1.0], (4, 1))
    )


def test_a_path_from_anywhere_begins_at_its_first_point(tmp_path: Path) -> None:
    part = path(tmp_path, PLAIN.replace("FROM/0,0,1\nRAPID\n", ""))
    assert part.contour("cut1", closed=False).length == pytest.approx(1.016)
    assert "contour 'cut1' begins in line 3: no position before it" in part.notes
    # FROM is no move: the next GOTO is the rapid one.
    part = path(tmp_path, PLAIN.replace("FROM/0,0,1\nRAPID\n", "RAPID\nFROM/-5,0,0\n"))
    assert part.contour("cut1", closed=False).length == pytest.approx(1.016)
    # From a place that is said the first move belongs to the cut.
    part = path(tmp_path, PLAIN.replace("FROM/0,0,1\nRAPID\n", "FROM/-5,0,0\n"))
    assert part.contour("cut1", closed=False).length == pytest.approx(1.143)


def test_what_is_left_out_at_the_ends_is_said(tmp_path: Path) -> None:
    text = (
        "UNITS/MM\nRAPID\nGOTO/0,0,9,0,0,1\nGOTO/0,0,0\nGOTO/0,0,0,0,0.1736482,0.9848078\n"
        "GOTO/5,0,0\nGOTO/5,5,0\nGOTO/0,0,0\nGOTO/0,0.1736482,0.9848078\n"
    )
    part = path(tmp_path, text)
    (loop,) = part.loops
    assert (loop.closed, loop.edges) == (True, 3)
    assert part.notes == (
        "contour 'cut1': 9 mm along the tool axis and a turn of the axis by 10 deg at its start, "
        "lines 3 to 5, left out",
        "contour 'cut1': 1 mm along the tool axis at its end, lines 8 to 9, left out",
    )
    part = path(tmp_path, text + "RAPID\nGOTO/2,2,5,0,0,1\nGOTO/2,2,0\n")
    (drilled,) = part.left_out
    assert (drilled.kind, drilled.count, drilled.may_cut) == ("feed move", 1, True)
    assert str(drilled) in part.notes
    assert [loop.name for loop in part.loops] == ["cut1"]


def test_repeated_points_are_left_out_with_a_note(tmp_path: Path) -> None:
    part = path(tmp_path, PLAIN.replace("GOTO/10,20,0\n", "GOTO/10,20,0\n" * 3))
    assert part.loops[0].edges == 3
    assert part.notes[-1] == "contour 'cut1': 2 repeated points left out, the first in line 9"


@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.integers(0, 2**32 - 1), st.integers(1, 4), st.booleans())
def test_what_is_written_is_read(
    tmp_path_factory: pytest.TempPathFactory, seed: int, count: int, closed: bool
) -> None:
    random = np.random.default_rng(seed)
    contours = []
    for _ in range(count):
        size = int(random.integers(4, 30))
        steps = np.array([0.02, 0, 0]) + random.normal(size=(size, 3)) * 0.01
        axes = np.array([0, 0, -2]) + np.cumsum(random.normal(size=(size, 3)) * 0.05, axis=0)
        contours.append(Contour(np.cumsum(steps, axis=0), axes, closed=closed))
    part = path(tmp_path_factory.mktemp("apt"), written(contours))
    assert len(part.loops) == count
    for loop, contour in zip(part.loops, contours, strict=True):
        assert loop.closed == closed
        again = part.contour(loop.name, closed=closed)
        # Nine decimals of a mm, and of an axis, are what the file holds.
        np.testing.assert_allclose(again.points, contour.points, atol=1e-12)
        np.testing.assert_allclose(again.axes, contour.axes, atol=2e-9)


GOOD = "UNITS/MM\nRAPID\nGOTO/0,0,0,0,0,1\nGOTO/10,0,0\nGOTO/10,20,0\n"


@pytest.mark.parametrize("up", [1, -1])
def test_a_circle_turns_about_its_axis(tmp_path: Path, up: int) -> None:
    """As Creo writes it: counter-clockwise about 0,0,1, clockwise about 0,0,-1."""
    text = (
        "UNITS/MM\nRAPID\nGOTO/10,-5,0,0,0,1\nGOTO/10,0,0\n"
        f"CIRCLE/10,10,0,0,0,{up},10\nFEDRAT/9\nGOTO/20,10,0\nGOTO/25,10,0\n"
    )
    path = tmp_path / "a.ncl.cl"
    path.write_text(text)
    points = 1e3 * read(path).contour("cut1", closed=False).points
    on = points[1:-1] - [10, 10, 0]
    assert np.linalg.norm(on, axis=1) == pytest.approx(10, abs=1e-9)
    turned = np.degrees(np.unwrap(np.arctan2(on[:, 1], on[:, 0])))
    assert turned[-1] - turned[0] == pytest.approx(90 if up > 0 else -270, abs=1e-9)
    assert points[-1] == pytest.approx([25, 10, 0])


REFUSED = {
    "no unit": (GOOD.replace("UNITS/MM\n", ""), "states no length unit; give that"),
    "unknown unit": (GOOD.replace("MM", "PARSECS"), "line 1: UNITS: expected one of MM"),
    "two units": (GOOD + "UNITS/INCHES\n", "line 6: UNITS other than mm before"),
    "a late unit": (GOOD[9:] + "UNITS/MM\n", "line 5: UNITS after points without one"),
    "no axis": (GOOD.replace(",0,0,1", ""), "line 3: no tool axis is known here"),
    "no axis in the second operation": (
        GOOD + "TOOL PATH/B\nRAPID\nGOTO/0,0,0\nGOTO/9,9,0\n", "line 8: no tool axis is known"
    ),
    "an axis of no length": (GOOD.replace("0,0,1", "0,0,0"), "line 3: the tool axis is 0 0 0"),
    "angles for an axis": (GOOD.replace("0,0,1", "0,0,90"), "line 3: a tool axis of length 90"),
    "an axis under MULTAX/OFF": (
        "MULTAX/OFF\n" + GOOD + "GOTO/0,0,0,0,1,0\n", "line 7: a tool axis that is not 0,0,1"
    ),
    "five numbers": (GOOD + "GOTO/1,2,3,4,5\n", "line 6: GOTO: expected 3 or 6 numbers, got 5"),
    "a word for a number": (GOOD + "GOTO/P1,2,3\n", "line 6: GOTO: expected a number, got 'P1'"),
    "an underscore": (GOOD + "GOTO/1_0,2,3\n", "line 6: GOTO: expected a number, got '1_0'"),
    "infinity": (GOOD + "GOTO/inf,2,3\n", "line 6: GOTO: expected a number, got 'INF'"),
    "a circle of NX": (GOOD + "CIRCLE/0,0,0,0,0,1,5,.01,.5,10,0\n", "line 6: CIRCLE: expected 7"),
    "a circle without an end": (GOOD + "CIRCLE/0,0,0,0,0,1,5\n", "ends after a CIRCLE"),
    "a circle to a rapid move": (GOOD + "CIRCLE/0,0,0,0,0,1,5\nRAPID\n", "line 7: expected the G"),
    "a circle from a rapid move": (GOOD + "RAPID\nCIRCLE/0,0,0,0,0,1,5\n", "line 7: CIRCLE: exp"),
    "a circle beside its end": (
        GOOD + "CIRCLE/10,25,0,0,0,1,5\nGOTO/10,31,0\n", "line 7: an arc that begins"
    ),
    "an arc": (GOOD + "TLON,GOFWD/(CIRCLE/0,0,0,5),ON\n", "line 6: 'TLON,GOFWD/.*linear moves"),
    "another arc": (GOOD + "MOVARC/0,0,0,0,0,1,5,ANGLE,90\n", "line 6: 'MOVARC/.*linear moves"),
    "compensation": (GOOD + "CUTCOM/LEFT\n", "line 6: 'CUTCOM/LEFT': the controller would offset"),
    "a cycle": (GOOD + "CYCLE/DRILL,5\n", "line 6: 'CYCLE/DRILL,5': a motion that is not written"),
    "increments": (GOOD + "GODLTA/0,0,5\n", "line 6: 'GODLTA/0,0,5': a motion that is not"),
    "moved points": (GOOD + "TRACUT/M1\n", "line 6: 'TRACUT/M1': it moves the points"),
    "an origin": (GOOD + "ORIGIN/1,2,3\n", "line 6: 'ORIGIN/1,2,3': it moves the points"),
    "two systems": (
        f"MSYS/0,0,0,1,0,0,0,1,0\n{GOOD}MSYS/0,0,5,1,0,0,0,1,0\n", "line 7: another MSYS"
    ),
    "a word of the controller": (GOOD + "PREFUN/41\n", "line 6: 'PREFUN/41': text for the contr"),
    "an unknown word": (GOOD + "WARP/9\n", "line 6: 'WARP/9': the word is not known, and may"),
    "a modal rapid": (GOOD + "RAPID/ON\n", "line 6: 'RAPID/ON': the word is not known"),
    "a rapid feed rate": (GOOD + "FEDRAT/RAPID\n", "line 6: 'FEDRAT/RAPID': the word is not"),
    "geometry": (GOOD + "P1 = POINT/1,2,3\n", "line 6: .* defines geometry"),
    "a cut from home": (GOOD + "GOHOME\nGOTO/1,2,3\n", "line 7: a move at feed from a place"),
    "a move after the end": (GOOD + "FINI\nGOTO/1,2,3\n", "line 7: a move after the end .* line 6"),
    "an end in a statement": (GOOD + "GOTO/1,2,$\n", r"line 6: continues with \$, but the file"),
    "a plunge in a cut": (
        GOOD + "GOTO/10,20,5\nGOTO/0,20,5\n", "line 6: a move along the tool axis within"
    ),
    "a turn on the spot": (
        GOOD + "GOTO/10,20,0,0,0.6,0.8\nGOTO/0,20,0\n", "line 6: the same point as line 5"
    ),
    "a flip": (GOOD + "GOTO/0,20,0,0,0,-1\n", "line 6: the axis turns by 180 deg"),
    "an axis that changed on the way round": (
        GOOD + "GOTO/0,0,0,0,0.6,0.8\n", "line 6: ends where it began, line 3, but with another"
    ),
    "too far": (GOOD + "GOTO/1e9,0,0\n", "line 6: a point further than 10 km"),
    "rapid moves alone": ("UNITS/MM\nRAPID\nGOTO/0,0,0,0,0,1\n", "holds no cut; expected feed"),
    "a hole alone": (
        "UNITS/MM\nRAPID\nGOTO/0,0,5,0,0,1\nGOTO/0,0,0\n", "holds no cut .left out: 1 feed move"
    ),
}  # fmt: skip


@pytest.mark.parametrize("fault", REFUSED)
def test_every_fault_is_refused_in_one_line(tmp_path: Path, fault: str) -> None:
    text, message = REFUSED[fault]
    with pytest.raises(InputError, match=message) as error:
        path(tmp_path, text)
    assert str(error.value).startswith(str(tmp_path / "cut.apt: "))
    assert "\n" not in str(error.value)


def test_what_does_not_go_with_a_tool_path(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="axis: expected a tool path without tool axes"):
        path(tmp_path, GOOD, axis=(0, 0, -1))
    with pytest.raises(InputError, match="columns: expected a table, got a tool path file"):
        path(tmp_path, GOOD, columns={"x": "X"})
    with pytest.raises(InputError, match=r"outer_towards: expected .* sheets, got a tool path"):
        path(tmp_path, GOOD, outer_towards=(0, 0, 1))
    with pytest.raises(InputError, match="the file is empty"):
        path(tmp_path, "\n")


def test_a_system_of_its_own_is_said(tmp_path: Path) -> None:
    part = path(tmp_path, "MSYS/1,2,3,1,0,0,0,1,0\n" + GOOD)
    assert part.notes == ("points are in the system that MSYS in line 1 defines",)


def test_damaged_files_are_read_or_refused(tmp_path: Path) -> None:
    random = np.random.default_rng(20)
    source = CATIA.encode()
    for _ in range(300):
        spoilt = bytearray(source)
        for place in random.integers(0, len(spoilt), 3):
            spoilt[place] = random.integers(0, 256)
        with contextlib.suppress(InputError):  # nothing else may come out
            path(tmp_path, bytes(spoilt[: int(random.integers(1, len(spoilt)))]))
