"""Robot programs in: kerfpath's own in every language, others' in plain styles, and refusals."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from tests.cad.test_nc import POINTS
from tests.post.cases import ARMS

from foreign import KRL, RAPID, TEXTS
from kerfpath import cad, robot
from kerfpath.contour import Contour
from kerfpath.errors import InputError
from kerfpath.post import Await, Request, build_program, language, post, with_arcs
from programs import arc, frames, hand_plan

MAIN = {"rapid": ".mod", "krl": ".src", "fanuc": ".ls", "urscript": ".script"}
PORTS = {
    "laser_output": 1, "gas_output": 2, "shutter_output": 3, "height_output": 4,
    "ready_input": 5, "interlock_input": 6,
}  # fmt: skip
BEAMS = {
    "rapid": "Doport1",
    "krl": "$out[1]",
    "fanuc": "DO[1]",
    "urscript": "standard_digital_out[1]",
}
"""The output of the laser as each language has it; letters may be small or large."""
ARC = 3e-5
"""m: how far the arcs of a program may leave the nodes; chords between them leave it by 27 um."""
ASKED = (
    Request(partner="shutter", on=True),
    Request(partner="height", on=True),
    Await(partner="ready", timeout=4.0),
    Await(partner="interlock", timeout=0.5),
)


def ring(name: str, count: int = 40, radius: float = 0.02, lean: float = 0.3) -> Contour:
    t = np.linspace(0, 2 * np.pi, count, endpoint=False)
    points = np.c_[radius * np.cos(t), radius * np.sin(t), 0.002 * np.sin(2 * t)]
    axes = np.c_[lean * np.cos(t), lean * np.sin(t), -np.ones_like(t)]
    return Contour(points + np.array([0.04, 0.03, 0]), axes, closed=True, name=name)


def written(
    folder: Path, name: str, contours: list[Contour], *, arcs: bool = False, **options: object
) -> Path:
    """Write the program of contours in a language; return its main file."""
    arm, place = ARMS[name]
    tool, placement = frames()
    placement[:3, 3] = place
    reach = np.array([4.0, 4.0, 4.0, 6.3, 6.3, 15.0])
    far = {"lower": -reach, "upper": reach, "couplings": ()}
    wide = robot(arm).with_limits(**far, acceleration=np.full(6, 10.0))
    plans = [hand_plan(each, wide, tool, placement) for each in contours]
    program = build_program(
        plans, gas_lead=0.2, pierce_time=0.1, lead_time=0.0, retract=0.01, **options
    )
    if arcs:
        program = with_arcs(program, tolerance=ARC)
    ports = {k: f"doPort{v}" if name == "rapid" else v for k, v in PORTS.items()}
    files = post(program, name, language(name).settings(**ports))
    for file, text in files.items():
        (folder / file).write_bytes(text.encode())
    return folder / next(iter(files)) if name != "krl" else folder / f"{program.name}.src"


@pytest.mark.parametrize("name", MAIN)
@pytest.mark.parametrize("asked", [(), ASKED])
def test_what_is_written_in_every_language_is_read_as_the_contours(
    tmp_path: Path, name: str, asked: tuple[object, ...]
) -> None:
    contours = [arc("one"), ring("two"), arc("three", count=5, radius=0.05)]
    main = written(tmp_path, name, contours, handshakes=asked)
    assert main.suffix == MAIN[name]
    part = cad.read(main, beam=BEAMS[name])
    assert [loop.name for loop in part.loops] == ["cut1", "cut2", "cut3"]
    assert [loop.closed for loop in part.loops] == [False, True, False]
    for loop, contour in zip(part.loops, contours, strict=True):
        found = part.contour(loop.name, closed=contour.closed)
        nodes = slice(0, len(contour))
        # Programs have 1e-4 mm; URScript 1e-4 mm in m.
        np.testing.assert_allclose(found.points[nodes], contour.points, atol=1.1e-7)
        # Quaternions have 8 digits, angles 6 (FANUC 4) of a degree, rotation vectors 9.
        np.testing.assert_allclose(found.axes[nodes], contour.axes, atol=3e-6)
    # The base of the program, seen from the part, is where the placement had it.
    (frame,) = part.frames.values()
    place = ARMS[name][1]
    expected = np.linalg.inv(frame)[:3, 3]
    np.testing.assert_allclose(expected[:2], place[:2], atol=1e-6)


@pytest.mark.parametrize("name", ["rapid", "krl", "fanuc"])
def test_arcs_of_a_program_are_arcs(tmp_path: Path, name: str) -> None:
    flat = ring("one", count=60, lean=0.0)
    round_one = Contour(flat.points * [1, 1, 0], flat.axes, closed=True, name="one")
    main = written(tmp_path, name, [round_one], arcs=True)
    part = cad.read(main, beam=BEAMS[name])
    (loop,) = part.loops
    assert loop.closed
    # Chords of 1 um instead of the nodes; how many depends on where the arcs of the plan end.
    assert len(part.contour("cut1")) > 2 * 60
    assert loop.diameter == pytest.approx(0.04, abs=ARC)


def read(folder: Path, name: str, text: str, **options: object) -> cad.Part:
    (folder / name).write_text(text)
    return cad.read(folder / name, **options)


def lean(degrees: float, about: int) -> list[float]:
    """The beam turned from straight down about x (0) or y (1)."""
    s, c = np.sin(np.radians(degrees)), np.cos(np.radians(degrees))
    return [[0.0, -s, -c], [s, 0.0, -c]][about]


@pytest.mark.parametrize(
    ("name", "output", "turned"),
    [
        ("trim.src", "$OUT[5]", lean(10, 0)),
        ("trim.mod", "doBeam", lean(10, 1)),
        ("trim.ls", "DO[5]", lean(10, 0)),
        ("trim.script", "digital_out[2]", lean(10, 1)),
    ],
)
def test_plain_programs_of_others(
    tmp_path: Path, name: str, output: str, turned: list[float]
) -> None:
    text = TEXTS[name]
    (tmp_path / "trim.dat").write_text(TEXTS["trim.dat"])
    part = read(tmp_path, name, text)
    contour = part.contour("cut1", closed=False)
    np.testing.assert_allclose(contour.points, POINTS, atol=1e-12)
    straight = [0.0, 0.0, -1.0]
    # The files have seven digits.
    np.testing.assert_allclose(contour.axes, [straight, straight, turned, turned], atol=3e-7)
    assert f"the beam is on while {output} is (beam in [part] says otherwise)" in part.notes
    if name == "trim.ls":  # where UFRAME 2 is, only the controller knows
        assert not part.frames
    else:
        (frame,) = part.frames.values()
        np.testing.assert_allclose(frame[:3, 3], [-0.8, 0, -0.4], atol=1e-12)
    # With the frame that the program names for the base, the part lies where the program has it.
    again = read(tmp_path, name, text, beam="50 mm/s")
    np.testing.assert_allclose(again.contour("cut1", closed=False).points, POINTS, atol=1e-12)


def test_statements_that_switch_the_beam(tmp_path: Path) -> None:
    text = KRL.replace("$OUT[5]=TRUE", "Laser_On( )").replace("$OUT[5]=FALSE", "LASER_OFF()")
    (tmp_path / "trim.dat").write_text(TEXTS["trim.dat"])
    with pytest.raises(InputError, match=r"line 11: 'Laser_On\( \)': it is not known"):
        read(tmp_path, "trim.src", text)
    part = read(tmp_path, "trim.src", text, beam=["Laser_On()", "Laser_Off()"])
    np.testing.assert_allclose(part.contour("cut1", closed=False).points, POINTS, atol=1e-12)


def test_a_program_that_switches_nothing(tmp_path: Path) -> None:
    text = re.sub(r"(?m)^.*DO\[5.*\n", "", TEXTS["trim.ls"]).replace("TB .02sec", "")
    (tmp_path / "trim.ls").write_text(text)
    text = TEXTS["trim.ls"].replace(" TB .02sec,DO[5]=OFF", "").replace("DO[5:beam]=ON", "R[1]=1")
    with pytest.raises(InputError, match=r"no output is switched on.*at 50, 100 mm/s.*100 mm/s"):
        read(tmp_path, "trim.ls", text)
    part = read(tmp_path, "trim.ls", text, beam="50 mm/s")
    assert part.loops[0].edges == 3
    part = read(tmp_path, "trim.ls", text.replace("100mm/sec", "50mm/sec"))
    assert any("every run of linear moves is taken as a cut" in note for note in part.notes)


def test_an_arc_of_a_script_goes_through_its_via(tmp_path: Path) -> None:
    down = "3.14159265359, 0, 0"
    way = f"movec(p[0.01, 0.01, 0, {down}], p[0, 0.02, 0, {down}], a=1.2, v=0.05)"
    text = f"movel(p[0, 0, 0, {down}], 1.2, 0.05)\nset_digital_out(2, True)\n{way}\n"
    part = read(tmp_path, "a.script", f"def a():\n{text}end\n")
    points = part.contour("cut1", closed=False).points
    np.testing.assert_allclose(np.linalg.norm(points - [0, 0.01, 0], axis=1), 0.01, atol=1e-9)
    assert np.abs(points - [0.01, 0.01, 0]).max(axis=1).min() < 2e-4  # a chord is 0.3 mm


def test_cuts_in_two_frames_are_joined_where_both_are_known(tmp_path: Path) -> None:
    second = 'PERS wobjdata wTwo:=[FALSE,TRUE,"",[[800,100,400],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];\n'
    text = RAPID.replace("  CONST speeddata", f"  {second}  CONST speeddata")
    text = text.replace(
        "MoveL p3,vBeam,fine,tBeam\\WObj:=wFix", "MoveL p3,vBeam,fine,tBeam\\WObj:=wTwo"
    )
    part = read(tmp_path, "trim.mod", text)
    np.testing.assert_allclose(
        part.contour("cut1", closed=False).points[3], [0, 0.12, 0], atol=1e-12
    )
    with pytest.raises(InputError, match="does not say where wTwo is"):
        read(tmp_path, "trim.mod", text.replace(second, ""))


REFUSED = {
    "trim.src": {
        "LIN XP2": ("LIN XP3", "line 15: 'XP3': no such position in the .dat"),
        "$OUT[5]=FALSE": ("", "a move of the joints while $OUT[5] is on"),
        "LIN {Z 50}": ("FOR I=1 TO 3\nLIN {Z 50}\nENDFOR", "moves under a condition"),
        "WAIT SEC 0.2": ("MoveTable()", "line 12: 'MoveTable()': it is not known"),
        "PTP HOME": ("$OUT[6]=TRUE", "switches $OUT[5], $OUT[6] on; say which"),
        "LIN {X 10} C_DIS": ("LIN_REL {X 10}", "line 14: 'LIN_REL {X 10}': it is not known"),
        "LIN {X 0,Y 0,Z 0,A 0,B 0,C 180}": (
            "PTP {A1 0,A2 -90,A3 90,A4 0,A5 45,A6 0}",
            "was not given before",
        ),
        "LIN {X 0,Y 20,Z 0,A 0,B 0,C 170}": (
            "LIN {A1 0,A2 -90,A3 90,A4 0,A5 45,A6 0}",
            "X is missing, and was not given before",
        ),
        "END\n": ("", "its end is missing"),
    },
    "trim.mod": {
        "MoveL p2,vBeam": ("MoveL p9,vBeam", "no robtarget of this module"),
        "[[0,20,0],": ("[[0,20],", "expected a position and a quaternion"),
        "Side;": ("WHILE x<3 DO Side; ENDWHILE", "moves under a condition"),
        "MoveL Offs(p1,10,0,0)": ("MoveL Offs(p1,10,0)", "expected a target and three numbers"),
        "  PROC Side()": ("  PROC Edge()", "'Side': it is not known"),
        "PROC main()": ("PROC First()", "expected PROC main(), or one routine, got 2"),
        "MoveJ Offs(p1,0,0,50)": ("CutL p1", "it is not known"),
        "wFix:=[FALSE": ("wFix:=[TRUE", "the robot holds the part"),
    },
    "trim.ls": {
        "L P[4] 50": ("L P[9] 50", "P[9] is missing under /POS"),
        "L P[3] 50mm/sec CNT50": ("L P[3] 50mm/sec CNT50 Offset,PR[2]", "may move the target"),
        "L P[4] 50mm/sec": ("L PR[4] 50mm/sec", "does not say where it is"),
        "!trim of a flange": ("IF R[1]=1,JMP LBL[2]", "it is not known"),
        "L P[5]": ("A P[5]", "an arc through its neighbours"),
        "DO[5:beam]=ON": ("CALL BEAM_ON", "'CALL BEAM_ON': it is not known"),
        "/POS": ("/POSITIONS", "expected a listing with /MN and /POS"),
    },
    "trim.script": {
        "movel(corner": ("movel(edge", "where it is is not said in the script"),
        "p[0.01, 0, 0, 3.14159265359, 0, 0]": ("p[0.01, 0, 0]", "a pose of 3 numbers"),
        "movel(corner, ": ("movel([0,0,0,0,0,0], ", "a cut to a target given by joints"),
        "set_digital_out(2, True)": ("force_mode(1)", "it is not known"),
        "end\n": ("", "its end is missing"),
    },
}


@pytest.mark.parametrize(
    ("name", "old"), [(name, old) for name, cases in REFUSED.items() for old in cases]
)
def test_every_fault_is_refused_in_one_line(tmp_path: Path, name: str, old: str) -> None:
    (tmp_path / "trim.dat").write_text(TEXTS["trim.dat"])
    text = TEXTS[name]
    assert old in text
    new, message = REFUSED[name][old]
    with pytest.raises(InputError, match=re.escape(message)) as caught:
        read(tmp_path, name, text.replace(old, new))
    assert "\n" not in str(caught.value)
    assert str(caught.value).startswith(str(tmp_path / name))


def test_what_does_not_go_with_a_program(tmp_path: Path) -> None:
    for options, message in (
        ({"axis": (0, 0, -1)}, "axis: expected a drawing of lines"),
        ({"beam": "$OUT[7]"}, "'$OUT[7]' switches nothing on here; outputs that do: $OUT[5]"),
        ({"beam": "7 mm/s"}, "no linear move at 7 mm/s (linear moves are at 50, 1000 mm/s)"),
        ({"beam": ["A()"]}, "beam: expected the name of an output"),
        ({"unit": "in"}, "a robot program is in mm, got in"),
    ):
        (tmp_path / "trim.dat").write_text(TEXTS["trim.dat"])
        with pytest.raises(InputError, match=re.escape(message)):
            read(tmp_path, "trim.src", KRL, **options)
    with pytest.raises(InputError, match="beam: expected a program of a robot, got a table"):
        read(tmp_path, "a.csv", "x_mm,y_mm,z_mm\n0,0,0\n", beam="DO[1]")


def test_routines_that_call_each_other_come_to_an_end(tmp_path: Path) -> None:
    calls = "\n".join(f"DEF r{k}()\n" + f"r{k + 1}()\n" * 9 + "END" for k in range(12))
    text = f"DEF trim()\nr0()\nEND\n{calls}\nDEF r12()\nWAIT SEC 0\nEND\n"
    with pytest.raises(InputError, match="runs more than"):
        read(tmp_path, "trim.src", text)
    with pytest.raises(InputError, match="calls itself"):
        read(tmp_path, "trim.src", "DEF trim()\ntrim()\nEND\n")
