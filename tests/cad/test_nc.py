"""Programs of 5-axis machines in: the tool axis as a vector, and all that is refused."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kerfpath.cad import Machine, Part, read
from kerfpath.contour import Contour
from kerfpath.errors import InputError

SIEMENS = """\
%_N_TRIM_MPF
; trim of a flange
N10 G40 G17 G710 G90 G94
N20 MSG("TRIM (1)")
N30 T="BEAM" D1
N40 M6
N50 G54 CYCLE832(0.01,3)
N60 TRAORI
N70 ORIWKS ORIVECT
N80 G0 X0 Y0 Z5 A3=0 B3=0 C3=1
N90 G1 Z0 F3000
N100 X10.
N110 X=10 Y20 B3=.1736482 C3=.9848078 (leaning)
N120 X-0 M8
N130 G0 Z50
N140 TRAFOOF
N150 G0 SUPA Z0 D0
N160 M30
"""
HEIDENHAIN = """\
0 BEGIN PGM TRIM MM
1 BLK FORM 0.1 Z X-10 Y-10 Z-1
2 ; trim of a flange
3 TOOL CALL 1 Z S100
4 CYCL DEF 32.0 TOLERANCE
5 CYCL DEF 32.1 T0.01
6 LN X+0 Y+0 Z+5 TX+0 TY+0 TZ+1 R0 FMAX M128
7 L Z+0 F3000 M3
8 L X+10 F3000
9 LN X+10,0 Y+20 Z+0 TX+0 TY+0.1736482 TZ+0.9848078 F3000
10 L X+0
11 L Z+50 FMAX M129
12 L Z-1 R0 FMAX M91
13 STOP M30
14 END PGM TRIM MM
"""
POINTS = [[0, 0, 0], [0.01, 0, 0], [0.01, 0.02, 0], [0, 0.02, 0]]
LEAN = [0.0, -np.sin(np.pi / 18), -np.cos(np.pi / 18)]
AXES = [[0.0, 0.0, -1.0], [0.0, 0.0, -1.0], LEAN, LEAN]


def program(folder: Path, text: str | bytes, *, name: str = "cut.nc", **options: object) -> Part:
    file = folder / name
    file.write_bytes(text if isinstance(text, bytes) else text.encode())
    return read(file, **options)


def siemens(contours: Sequence[Contour]) -> str:
    lines = ["G710 G90", "TRAORI"]
    for contour in contours:
        for k, row in enumerate(np.hstack([contour.points * 1000, -contour.axes])):
            words = zip(("X", "Y", "Z", "A3=", "B3=", "C3="), row, strict=True)
            lines.append(
                f"G{int(k > 0)} " + " ".join(f"{word}{value:.9f}" for word, value in words)
            )
    return "\n".join([*lines, "M30"])


def heidenhain(contours: Sequence[Contour]) -> str:
    lines = ["BEGIN PGM A MM", "M128"]
    for contour in contours:
        for k, row in enumerate(np.hstack([contour.points * 1000, -contour.axes])):
            words = zip(("X", "Y", "Z", "TX", "TY", "TZ"), row, strict=True)
            said = " ".join(f"{word}{value:+.9f}" for word, value in words)
            lines.append(f"LN {said} F{'3000' if k else 'MAX'}")
    return "\n".join(f"{k} {line}" for k, line in enumerate([*lines, "END PGM A MM"]))


@pytest.mark.parametrize(("name", "text"), [("trim.mpf", SIEMENS), ("trim.h", HEIDENHAIN)])
def test_the_cut_of_a_program(tmp_path: Path, name: str, text: str) -> None:
    part = program(tmp_path, text, name=name)
    (loop,) = part.loops
    assert (loop.name, loop.kind, part.unit) == ("cut1", "open", "mm")
    contour = part.contour("cut1", closed=False)
    np.testing.assert_allclose(contour.points, POINTS, atol=1e-15)
    # The file has seven decimals of the axis.
    np.testing.assert_allclose(contour.axes, AXES, atol=1e-7)
    assert "5 mm along the tool axis at its start" in part.notes[-1]
    assert part.notes[0].startswith("words not used: ")
    inches = {"G710": "G700", "TRIM MM": "TRIM INCH"}
    for metric, inch in inches.items():
        text = text.replace(metric, inch)
    again = program(tmp_path, text, name=name)
    assert again.unit == "in"
    np.testing.assert_allclose(
        again.contour("cut1", closed=False).points, 25.4 * np.array(POINTS), atol=1e-14
    )


@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.integers(0, 2**32 - 1), st.booleans(), st.sampled_from([siemens, heidenhain]))
def test_what_is_written_is_read(
    tmp_path_factory: pytest.TempPathFactory, seed: int, closed: bool, written: object
) -> None:
    random = np.random.default_rng(seed)
    contours = []
    for _ in range(int(random.integers(1, 4))):
        size = int(random.integers(4, 30))
        steps = np.array([0.02, 0, 0]) + random.normal(size=(size, 3)) * 0.01
        axes = np.array([0, 0, -2]) + np.cumsum(random.normal(size=(size, 3)) * 0.05, axis=0)
        contours.append(Contour(np.cumsum(steps, axis=0), axes, closed=closed))
    part = program(tmp_path_factory.mktemp("nc"), written(contours))
    assert len(part.loops) == len(contours)
    for loop, contour in zip(part.loops, contours, strict=True):
        assert loop.closed == closed
        again = part.contour(loop.name, closed=closed)
        # Nine decimals of a mm, and of an axis, are what the file holds.
        np.testing.assert_allclose(again.points, contour.points, atol=1e-12)
        np.testing.assert_allclose(again.axes, contour.axes, atol=2e-9)


def test_an_axis_where_the_program_says_none(tmp_path: Path) -> None:
    text = "G21\nG0 X0 Y0 Z0\nG1 X10\nY20\n"
    contour = program(tmp_path, text, name="cut.tap", axis=(0, 0, -1)).contour("cut1", closed=False)
    np.testing.assert_array_equal(contour.axes, [[0, 0, -1]] * 3)
    with pytest.raises(InputError, match="line 2: no tool axis is known here"):
        program(tmp_path, text)


ARCS = {
    "left, a quarter": ("G17\nG3 X20 Y10 J10", (10, 10, 0), (0, 0, 1), 90),
    "right, a quarter": ("G2 X20 Y-10 J-10", (10, -10, 0), (0, 0, -1), 90),
    "right, three quarters": ("G2 X20 Y10 J10", (10, 10, 0), (0, 0, -1), 270),
    "a full circle": ("G3 I5", (15, 0, 0), (0, 0, 1), 360),
    "left, by its radius": ("G3 X20 Y10 R10", (10, 10, 0), (0, 0, 1), 90),
    "left, more than a half": ("G3 X20 Y10 CR=-10", (20, 0, 0), (0, 0, 1), 270),
    "right, by its radius": ("G2 X20 Y10 R10", (20, 0, 0), (0, 0, -1), 90),
    "a half by its radius": ("G3 X10 Y20 R10", (10, 10, 0), (0, 0, 1), 180),
    "rising": ("G3 X20 Y10 Z3 J10", (10, 10, 0), (0, 0, 1), 90),
    "in ZX, from Z to X": ("G18\nG3 X20 Z-10 K-10", (10, 0, -10), (0, 1, 0), 90),
    "in YZ, from Y to Z": ("G19\nG2 Y10 Z-10 K-10", (10, 0, -10), (-1, 0, 0), 90),
}
"""The blocks from X10 Y0 Z0 on, and the centre, the normal and the turn (deg) of the arc."""


@pytest.mark.parametrize("case", ARCS)
def test_arcs_are_chords_within_a_micrometre(tmp_path: Path, case: str) -> None:
    text, centre, normal, turn = ARCS[case]
    text = f"G21 G90 G40 G49 G80 G64 P0.01\nG0 X10 Y0 Z0\n{text}\nM2\n"
    part = program(tmp_path, text, name="cut.ngc", axis=(0.6, 0.64, -0.48))
    points = 1e3 * part.contour("cut1", closed=False).points - centre
    rise = points @ normal
    flat = points - rise[:, None] * normal
    radius = np.linalg.norm(flat[0])
    assert np.linalg.norm(flat, axis=1) == pytest.approx(radius, abs=1e-9)
    steps = np.arctan2(np.cross(flat[:-1], flat[1:]) @ normal, (flat[:-1] * flat[1:]).sum(axis=1))
    assert steps == pytest.approx(np.radians(turn) / len(steps), abs=1e-9)
    assert np.diff(rise) == pytest.approx((3 if case == "rising" else 0) / len(steps), abs=1e-9)
    assert radius * (1 - np.cos(steps[0] / 2)) <= 1e-3


KLARTEXT_ARCS = {
    "left, a quarter": ("CC X+10 Y+10\nC X+20 Y+10 DR+ F500", (10, 10, 0), (0, 0, 1), 90),
    "right, three quarters": ("CC X+10 Y+10\nC X+20 Y+10 DR- R0", (10, 10, 0), (0, 0, -1), 270),
    "a full circle": ("CC X+15 Y+0\nC X+10 Y+0 DR+", (15, 0, 0), (0, 0, 1), 360),
    "left, by its radius": ("CR X+20 Y+10 R+10 DR+ F500", (10, 10, 0), (0, 0, 1), 90),
    "left, more than a half": ("CR X+20 Y+10 R-10 DR+", (20, 0, 0), (0, 0, 1), 270),
    "right, by its radius": ("CR X+20,0 Y+10 R+10,0 DR- M8", (20, 0, 0), (0, 0, -1), 90),
}


@pytest.mark.parametrize("case", KLARTEXT_ARCS)
def test_arcs_of_heidenhain_are_chords_within_a_micrometre(tmp_path: Path, case: str) -> None:
    text, centre, normal, turn = KLARTEXT_ARCS[case]
    text = f"BEGIN PGM A MM\nTOOL CALL 1 Z S100\nL X10 Y0 Z0 R0 FMAX\n{text}\nEND PGM A MM\n"
    part = program(tmp_path, text, name="cut.h", axis=(0.6, 0.64, -0.48))
    points = 1e3 * part.contour("cut1", closed=False).points
    flat = points - centre
    radius = np.linalg.norm(flat[0])
    assert np.linalg.norm(flat, axis=1) == pytest.approx(radius, abs=1e-9)
    steps = np.arctan2(np.cross(flat[:-1], flat[1:]) @ normal, (flat[:-1] * flat[1:]).sum(axis=1))
    assert steps == pytest.approx(np.radians(turn) / len(steps), abs=1e-9)
    assert radius * (1 - np.cos(steps[0] / 2)) <= 1e-3


def test_a_vector_of_iso_programs_is_the_tool_axis(tmp_path: Path) -> None:
    """Under G43.5, missing ones of I, J and K are 0; a block without any keeps the vector."""
    text = "G21\nG43.5 H1\nG0 X0 Y0 Z0 K1\nG1 X10\nX20 I3 K4\nG49\nM30\n"
    contour = program(tmp_path, text).contour("cut1", closed=False)
    assert contour.axes == pytest.approx(np.array([[0, 0, -1], [0, 0, -1], [-0.6, 0, -0.8]]))


def test_places_in_brackets_are_absolute(tmp_path: Path) -> None:
    plain = S + "G1 X15 Y30\nM30\n"
    words = plain.replace("X15", "X=AC(15)").replace("Y30", "Y = AC( 30. )")
    assert words != plain
    found, asked = (
        program(tmp_path, text).contour("cut1", closed=False) for text in (words, plain)
    )
    np.testing.assert_array_equal(found.points, asked.points)


S = "G710\nTRAORI\nG0 X0 Y0 Z0 A3=0 B3=0 C3=1\nG1 X10\nY20\n"
H = "BEGIN PGM A MM\nLN X0 Y0 Z0 TX0 TY0 TZ1 FMAX M128\nL X10 F9\nL Y20\n"
REFUSED = {
    "no unit": (S.replace("G710\n", ""), "states no length unit; give that"),
    "a late unit": (S + "G700\n", "line 6: G700 after moves in another unit"),
    "an arc without its centre": (S + "G2 X20\n", "line 6: an arc without its centre"),
    "an arc beside its end": (S + "G2 X20 Y20 I4\n", "line 6: an arc that begins 4 mm"),
    "an arc from nowhere": ("G21\nG0 X0 Y0\nG2 X9 I4.5 Z0\n", "line 3: an arc from a place"),
    "a centre across the plane": (S + "G2 X20 K5\n", "line 6: an arc: expected its centre"),
    "two centres": (S + "G2 X20 I5 R5\n", "line 6: an arc: expected its centre"),
    "a full circle by its radius": (S + "G2 X10 Y20 R5\n", "line 6: an arc of radius 5 between"),
    "too small a radius": (S + "G2 X30 R5\n", "line 6: an arc of radius 5 between places 20 apart"),
    "two kinds of moves": (S + "G2 G1 X20 I5\n", "line 6: G1 and G2 in one block"),
    "absolute centres": (S + "G90.1\n", r"line 6: 'G90\.1': absolute centres of arcs"),
    "an arc under G43.5": (
        "G21\nG43.5\nG0 X0 Y0 Z0 I0 J0 K1\nG1 X9\nG2 X5 I-2\n", r"line 5: an arc under G43\.5"
    ),
    "a vector after G49": (
        "G21\nG43.5\nG0 X0 Y0 Z0 I0 J0 K1\nG1 X9\nG49\nG0 X0 Y0 Z0 K1\n", "line 6: 'K': the word"
    ),
    "another arc": (S + "CIP X20 I1=5\n", "line 6: 'CIP': a curve"),
    "increments": (S + "G91 X5\n", "line 6: 'G91': increments; write absolute"),
    "an increment": (S + "X=IC(5)\n", r"line 6: X=: expected a number, or AC\( \) or DC\( \)"),
    "a way round of a slide": (S + "X=DC(5)\n", r"line 6: X=DC\( \): expected a rotary axis"),
    "an open bracket": (S + "X=AC(5\n", "line 6: X=: expected a number"),
    "a factor of a place": (S + "X=AC(5)*2\n", "line 6: X=: expected a number"),
    "a parameter": (S + "X=R1\n", "line 6: X=: expected a number"),
    "a sum": (S + "X=5+R1\n", "line 6: X=: expected a number"),
    "compensation": (S + "G41\n", "line 6: 'G41': the controller would offset the path"),
    "a rotary axis": (S + "G0 C90\n", "line 6: C: a rotary axis; say which axes carry the tool"),
    "another rotary axis": (S + "X5 A=5\n", "line 6: A: a rotary axis; say which axes carry"),
    "angles": (S + "X5 A2=5\n", "line 6: A2: the effect of this angle depends on the control"),
    "a moved origin": (S + "TRANS X10\n", "line 6: 'TRANS': it moves the points that follow"),
    "a turned plane": (S + 'CYCLE800(1,"A")\n', "line 6: 'CYCLE800': it moves the points"),
    "another offset": (S + "G55\n", "line 6: G55 after moves; write all of them in one system"),
    "axes of the machine": (S + "ORIMKS\n", "line 6: 'ORIMKS': tool axes in the machine"),
    "a vector without a transformation": (
        S.replace("TRAORI\n", ""), "line 2: A3 B3 C3 without TRAORI, which they need"
    ),
    "a vector of no length": (S + "X0 A3=0\n", "line 6: the tool axis is 0 0 0"),
    "no transformation any more": (
        S + "TRAFOOF\nG1 X5 Y5 Z5\n", "line 7: a move at feed from a place that is not known"
    ),
    "the machine's place": (S + "SUPA X5\n", "line 6: SUPA at feed: its position is in machine"),
    "another machine's place": (S + "G53 X5\n", "line 6: G53 at feed: its position is in machine"),
    "a cut from the tool change": (S + "M6\nX5 Y5 Z5\n", "line 7: a move at feed from a place"),
    "a program that is called": (S + "M98 P5\n", "line 6: 'P': the word is not known"),
    "a cycle called": (S + "M99\n", "line 6: M99: a program that is called is not read"),
    "another program that is called": (S + "PART_TWO(1)\n", "line 6: 'PART_TWO': the word is not"),
    "a loop": (S + "GOTOB A\n", "line 6: expected words such as X1.5 .*, got 'A'"),
    "an unknown G": (S + "G12.1\n", "line 6: 'G12.1': the word is not known"),
    "a skipped block": (S + "/X5\n", "line 6: a block that the machine may skip"),
    "no words": (S + "X5 ?\n", r"line 6: expected words such as X1\.5 or A3=0\.5, got ' \?'"),
    "a number of two points": (S + "X1.5.2\n", "line 6: expected words"),
    "X twice": (S + "X5 X6\n", "line 6: X twice in one block"),
    "two motions": (S + "G0 G1 X5\n", "line 6: G0 and G1 in one block"),
    "no motion": ("G710\nX5\n", "line 2: a position before any G0 or G1"),
    "Z too late": ("G21\nG0 X0 Y0\nG1 X9\nZ5\n", "line 3: a move at feed, but Z was"),
    "a dwell with X": (S + "G4 X5\n", "line 6: G4 with X, Y or Z"),
    "a block after the end": (S + "M30\nX5\n", "line 7: a block after the end .* in line 6"),
    "Heidenhain, no unit": (H.replace(" MM", ""), "line 1: expected one BEGIN PGM NAME MM or INCH"),
    "Heidenhain, an arc without a pole": (H + "C X5 Y5 DR+\n", "line 5: an arc without its centre"),
    "Heidenhain, an arc without its way": (H + "CC X0 Y0\nC X5 Y5\n", "line 6: expected C X Y DR"),
    "Heidenhain, an arc without a radius": (H + "CR X5 Y5 DR+\n", "line 5: expected C X Y DR"),
    "Heidenhain, half a pole": (H + "CC X5\n", "line 5: 'CC X5': expected CC X Y, absolute"),
    "Heidenhain, an increment of a pole": (H + "CC IX5 Y0\n", "line 5: 'CC IX5 Y0': expected CC X"),
    "Heidenhain, a rising arc": (H + "CC X0 Y0\nC X5 Y5 Z5 DR+\n", "line 6: an arc: expected X"),
    "Heidenhain, a polar arc": (H + "CP IPA+90 DR+\n", r"line 5: 'CP IPA\+90 DR\+': a curve, or"),
    "Heidenhain, another tool axis": (
        H + "TOOL CALL 2 Y S9\nL X0 Y0 Z0 FMAX\nCC X5 Y0\nC X0 Y0 DR+\n", "line 8: an arc about"
    ),
    "Heidenhain, a rounding": (H + "RND R5\n", "line 5: 'RND R5': a curve, or a move that"),
    "Heidenhain, increments": (H + "L IX+5\n", r"line 5: 'IX\+5': increments; write absolute"),
    "Heidenhain, compensation": (H + "L X5 RL\n", "line 5: 'RL': the controller would offset"),
    "Heidenhain, a rotary axis": (H + "L B+5 FMAX\n", "line 5: B: a rotary axis; say which"),
    "Heidenhain, a parameter": (H + "L X+Q5\n", r"line 5: 'X\+Q5': it is not known, and may"),
    "Heidenhain, a cycle": (H + "CYCL DEF 7.0 DATUM\n", "line 5: 'CYCL DEF 7.0 DATUM': it is not"),
    "Heidenhain, a plane": (H + "PLANE SPATIAL SPA5\n", "line 5: 'PLANE SPATIAL SPA5': it is not"),
    "Heidenhain, a cycle called": (H + "L X5 M99\n", "line 5: 'M99': it is not known"),
    "Heidenhain, half a vector": (H + "LN X5 TX0 TZ1\n", "line 5: TX, TY and TZ belong together"),
    "Heidenhain, no M128": (
        H.replace(" M128", ""), "line 2: TX TY TZ without M128, which they need"
    ),
    "Heidenhain, normals alone": (
        H + "LN X5 NX0 NY0 NZ1\n", "line 5: NX NY NZ without TX TY TZ; expected the tool axis"
    ),
    "Heidenhain, a length": (H + "LN X5 TX0 TY0 TZ9\n", "line 5: a tool axis of length 9"),
    "Heidenhain, the machine's place": (H + "L Z5 M91\n", "line 5: M91 at feed: its position is"),
    "Heidenhain, no tip any more": (
        H + "M129\nL X5 Y5 Z5\n", "line 6: a move at feed from a place that is not known"
    ),
    "Heidenhain, X twice": (H + "L X5 X6\n", "line 5: X twice in one block"),
    "Heidenhain, a block after the end": (H + "M30\nL X5\n", "line 6: a block after the end"),
    "Heidenhain, an end beside an arc": (H + "CT X5 Y5 M30\n", "line 5: 'CT X5 Y5 M30': a curve"),
}  # fmt: skip


@pytest.mark.parametrize("fault", REFUSED)
def test_every_fault_is_refused_in_one_line(tmp_path: Path, fault: str) -> None:
    text, message = REFUSED[fault]
    with pytest.raises(InputError, match=message) as error:
        program(tmp_path, text)
    assert str(error.value).startswith(str(tmp_path / "cut.nc: "))
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("source", [SIEMENS, HEIDENHAIN])
def test_damaged_programs_are_read_or_refused(tmp_path: Path, source: str) -> None:
    random = np.random.default_rng(21)
    for _ in range(200):
        spoilt = bytearray(source.encode())
        for place in random.integers(0, len(spoilt), 3):
            spoilt[place] = random.integers(0, 256)
        with contextlib.suppress(InputError):  # nothing else may come out
            program(tmp_path, bytes(spoilt[: int(random.integers(1, len(spoilt)))]))


FLAT = "G21\nG0 X10 Y0\nM3\nG1 X110 F3000\nY60\nG3 X100 Y70 I-10 J0\nG1 X10 Y0\nM5\n"


def test_a_program_without_z_is_flat(tmp_path: Path) -> None:
    file = tmp_path / "sheet.nc"
    file.write_text(FLAT)
    with pytest.raises(InputError, match=r"no tool axis.*--axis 0 0 -1"):
        read(file)
    part = read(file, axis=(0, 0, -1))
    assert "no move gives Z, which is taken as 0" in part.notes
    arc = np.pi / 2 * 0.01
    assert part.loops[0].length == pytest.approx(0.1 + 0.06 + arc + np.hypot(0.09, 0.07), abs=1e-6)
    file.write_text(f"{FLAT}G0 Z5\n")
    with pytest.raises(InputError, match="line 4: a move at feed, but Z was not given before"):
        read(file, axis=(0, 0, -1))


LINE = "G0 X0 Y0 Z5\nG1 Z0 F{}\nX100 F{}\nY50\nG0 Z5\nM30\n"
"""An approach along the tool axis, which is no cut, and a cut."""
FEEDS = {
    "mm": ("G21 G94\n" + LINE.format(200, 3000), {}, [3000]),
    "inches": ("G20\n" + LINE.format(10, 120), {}, [120 * 25.4]),
    "inches, with feeds": ("G700 G94\n" + LINE.format(10, 120), {}, [120 * 25.4]),
    "the unit is given": (LINE.format(10, 3000), {"unit": "mm"}, [3000]),
    "the approach has no feed": ("G21\n" + LINE.replace("F{}", "", 1).format(3000), {}, [3000]),
    "a feed stays": (
        "G21\nG0 X-50 Y0 Z0\nG1 X-9 F3000\n" + LINE.replace("F{}", ""), {}, [3000, 3000]
    ),
    "a dwell is no feed": ("G21\nG4 F1\n" + LINE.format(200, "3000\nG4 F2"), {}, [3000]),
    "back to a speed": ("G21 G95\nG94\n" + LINE.format(200, 3000), {}, [3000]),
    "several": ("G21\n" + LINE.format(200, "3000").replace("Y50", "Y50 F1500"), {}, [(3000, 1500)]),
    "several, as before": (
        "G21\n" + LINE.format(200, "3000").replace("Y50", "Y50 F1500\nX0 F3000"), {},
        [(3000, 1500)],
    ),
    "none": ("G21\n" + LINE.replace("F{}", ""), {}, [()]),
    "none at first": ("G21\n" + LINE.replace("F{}", "").replace("Y50", "Y50 F3000"), {}, [()]),
    "inverse time": ("G21 G93\n" + LINE.format(30, 30), {}, [()]),
    "per revolution": ("G21 G95\n" + LINE.format(0.1, 0.1), {}, [()]),
    "the unit of the control": ("G70\n" + LINE.format(10, 120), {}, [()]),
    "nothing": ("G21\n" + LINE.format(0, 0), {}, [()]),
    "Heidenhain": (HEIDENHAIN, {}, [3000]),
    "Heidenhain, in inches": (HEIDENHAIN.replace(" MM\n1", " INCH\n1"), {}, [()]),
    "Heidenhain, of the tool": (
        HEIDENHAIN.replace(" F3000", "").replace("S100", "S100 F2000"), {}, [2000]
    ),
    "Heidenhain, of plunging": (HEIDENHAIN.replace("M3\n", "M103 F20\n"), {}, [()]),
    "Heidenhain, per revolution": (HEIDENHAIN.replace("M3\n", "M136\n"), {}, [()]),
    "Heidenhain, of M128": (
        HEIDENHAIN.replace("F3000\n8", "F3000\n8", 1).replace("M128", "M128 F500"), {}, [3000]
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", FEEDS)
def test_the_feeds_along_a_cut(tmp_path: Path, case: str) -> None:
    text, options, feeds = FEEDS[case]
    if case.startswith("Heidenhain"):
        part = program(tmp_path, text, name="cut.h", **options)
    else:
        part = program(tmp_path, text, axis=(0, 0, -1), **options)
    expected = [one if isinstance(one, tuple) else (one,) for one in feeds]
    assert len(part.loops) == len(expected)
    for loop, each in zip(part.loops, expected, strict=True):
        assert loop.feeds == pytest.approx([feed / 60_000 for feed in each], rel=1e-9)
    is_no_speed = case in ("inverse time", "per revolution", "the unit of the control")
    assert any("F is no speed of the tip" in note for note in part.notes) == is_no_speed


def test_a_feed_while_a_table_turns_is_no_speed_of_the_tip(tmp_path: Path) -> None:
    text = "G21 G94\nG0 X0 Y0 Z0 A0\nG1 X20 F3000\nG0 X0 Y5\nG1 X20 A10 F3000\nM30\n"
    machine = Machine(table="A", centre=(0, 0, -0.03))
    part = program(tmp_path, text, machine=machine)
    assert [loop.feeds for loop in part.loops] == [(0.05,), ()]
