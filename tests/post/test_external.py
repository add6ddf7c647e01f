"""Programs with rails and positioners: what their texts mean in the world, said and read back."""

import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tests.post.cases import CASES
from tests.post.external_cells import CELLS, GOLDEN, SAYING, ExternalCase

from kerfpath import InputError
from kerfpath.post import (
    JointMove,
    LinearMove,
    build_program,
    differences,
    language,
    languages,
    post,
    preflight,
    read_program,
    with_tips,
)
from kerfpath.robots import carried
from kerfpath.transfer import back_off

ALL = [ExternalCase(cell, name) for name in SAYING for cell in CELLS]
TABLE = [case for case in ALL if case.cell == "rail+table"]
NUMBER = r"(-?\d+\.\d+)"


@cache
def made(case):
    """The program of a case, its files, and what is read back of them."""
    program = case.program()
    files = case.files(program)
    return program, files, case.read(files)


def issues(program, name, settings=None):
    found = preflight(program, name, settings or language(name).settings(**CASES[name].options))
    return [str(issue) for issue in found if issue.level == "error"]


@pytest.mark.parametrize("case", GOLDEN, ids=str)
def test_golden_programs_are_written_byte_for_byte(case):
    assert case.text() == case.golden.read_bytes().decode("ascii")


@pytest.mark.parametrize("case", ALL, ids=str)
def test_every_target_is_read_back_with_its_external_values(case):
    program, _, read = made(case)
    assert case.deviations(program, read) == []
    assert len(read.moves) == len(program.moves)
    # Half a pulse of INFORM (400 to the mm there), else digits.
    off = 2.1e-7 if case.name != "inform" else 1e-5
    for ours, back in zip(program.moves, read.moves, strict=True):
        values = back.external_of(read.externals)
        np.testing.assert_allclose(values, ours.q[6:], atol=off)


def pose_of(values):
    """A pose of mm and a quaternion, w first."""
    T = np.eye(4)
    T[:3, 3] = np.array(values[:3]) / 1e3
    T[:3, :3] = Rotation.from_quat(np.roll(values[3:7], -1)).as_matrix()
    return T


def world_tip(program, q):
    """Where the tip is in the world: the arm on what carries it."""
    robot = program.robot
    on = carried(robot.externals, q[6:], "robot")
    return on @ robot.alone().forward(q[:6]) @ program.T_flange_tip


@pytest.mark.parametrize("cell", CELLS)
def test_rapid_puts_the_tip_where_arm_and_axes_do(cell):
    """User frame moved by the unit, object frame in it, target in that: by hand, in the world."""
    program, files, _ = made(ExternalCase(cell, "rapid"))
    (text,) = files.values()
    wobj = re.search(r'wobjdata wPart:=\[FALSE,(TRUE|FALSE),"(\w*)",(.*)\];', text)
    numbers = [float(x) for x in re.findall(r"-?\d[\d.]*", wobj[3])]
    user, inner = pose_of(numbers[:7]), pose_of(numbers[7:])
    lines = [line for line in text.splitlines() if re.match(r"    (MoveL|TriggL)", line)]
    moves = [move for move in program.moves if isinstance(move, LinearMove)]
    part = [axis for axis in program.robot.externals if axis.carries == "part"]
    assert (wobj[1], wobj[2]) == (("FALSE", "STN_1") if part else ("TRUE", ""))
    for line, move in zip(lines, moves, strict=True):
        said = [float(x) for x in re.findall(r"-?\d[\d.]*", line.split("],v")[0].split(" ")[-1])]
        values = re.search(r",\[([^[\]]*)\]\],v", line)[1].split(",")
        assert values[len(CELLS[cell]) :] == ["9E9"] * (6 - len(CELLS[cell]))
        at = [float(value) for value in values[: len(CELLS[cell])]]
        x = [
            v / 1e3 if a == "rail" else np.radians(v) for v, a in zip(at, CELLS[cell], strict=True)
        ]
        if part:
            # The calibrated frame of the unit: at the axes' point, z along the last one, turned on.
            frame = np.eye(4)
            frame[:3, 3] = part[-1].point
            if CELLS[cell][-1] == "chuck":  # z along y, x as the base's
                frame[:3, :3] = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]], dtype=float)
            user = carried(program.robot.externals, x, "part") @ frame
        T = user @ inner @ pose_of(said[:7])
        np.testing.assert_allclose(T, world_tip(program, move.q), atol=2e-7)  # 4 decimals of mm


@pytest.mark.parametrize("cell", CELLS)
def test_fanuc_puts_the_tip_where_it_is_in_the_standing_user_frame(cell):
    program, files, _ = made(ExternalCase(cell, "fanuc"))
    rows = re.findall(
        r"X = +(\S+)  mm,\tY = +(\S+)  mm,\tZ = +(\S+)  mm,\r\n"
        r"\tW = +(\S+) deg,\tP = +(\S+) deg,\tR = +(\S+) deg",
        files["SKIN_OUTER.ls"],
    )
    moves = [move for move in program.moves if isinstance(move, LinearMove)]
    for row, move in zip(rows, moves, strict=True):
        values = [float(value) for value in row]
        T = np.eye(4)
        T[:3, :3] = Rotation.from_euler("xyz", values[3:], degrees=True).as_matrix()
        T[:3, 3] = np.array(values[:3]) / 1e3
        there = program.T_base_part @ T
        np.testing.assert_allclose(
            there, world_tip(program, move.q), atol=2e-6
        )  # 4 decimals of deg
    coordinated = "COORD" in files["SKIN_OUTER.ls"]
    assert coordinated == (cell != "rail") == ("DEFAULT_GROUP\t= 1,1," in files["SKIN_OUTER.ls"])


def test_krl_couples_the_base_to_what_carries_the_part():
    for cell in CELLS:
        program, files, _ = made(ExternalCase(cell, "krl"))
        (line,) = re.findall(r"\$BASE=.*", files["cut_skin_outer.src"])
        assert ("EK(MACHINE_DEF[2].ROOT,MACHINE_DEF[2].MECH_TYPE," in line) == (cell != "rail")
        x = np.array([float(v) for v in re.findall(rf"[XYZ] {NUMBER}", line)]) / 1e3
        offset = program.T_base_part[:3, 3].copy()
        if cell == "chuck":  # in the frame at its point, x as the base's, z along its axis y
            away = offset - program.robot.externals[0].point
            offset = np.array([away[0], -away[2], away[1]])
        elif cell != "rail":
            offset -= program.robot.externals[-1].point
        np.testing.assert_allclose(x, offset, atol=1e-7)


def test_a_frame_that_the_controller_has_otherwise_is_a_setting():
    """The same motion, said by another calibration of the unit, and read back by it."""
    case = ExternalCase("turn-tilt", "rapid")
    program, files, _ = made(case)
    frame = [900.0, 20.0, 100.0, 10.0, -20.0, 30.0]
    settings = case.settings.model_copy(update={"positioner_frame": frame})
    others = post(program, "rapid", settings)
    assert others != files
    read = replace(case, cell=case.cell).read(files)
    assert case.deviations(program, read) == []
    with pytest.raises(AssertionError):
        assert case.deviations(program, case.read(others)) == []


def test_speed_data_have_the_speeds_of_the_axes():
    _, files, _ = made(ExternalCase("rail+table", "rapid"))
    (text,) = files.values()
    turning = f"{np.degrees(2.5):.0f}"
    assert f"vCut:=[50.00,500,2000,{turning}];" in text
    # The first joint move has a quarter of every speed, that of the axes too.
    assert f"vAir:=[100.00,50,200,{np.degrees(2.5) / 10:.0f}];" in text
    lines = text.splitlines()
    active = [line.strip() for line in lines if "Unit " in line and "!" not in line]
    assert active == ["ActUnit TRACK_1;", "ActUnit STN_1;", "DeactUnit STN_1;"]


EDITS = {
    "rapid": (
        (",[20.000000,0.000000,9E9", ",[9E9,0.000000,9E9", "eax_a has no value for rail"),
        (",[20.000000,0.000000,9E9", ",[20.000000,0.000000,5", "eax_c = 5: the robot has no such"),
        ("    ActUnit TRACK_1;\n", "", "expected these lines for the mechanical units"),
        ('"STN_1"', '"STN_2"', "expected a work object moved by STN_1"),
        ("[FALSE,FALSE,", "[FALSE,TRUE,", "expected a work object moved by STN_1"),
        (",2000,143];", ",5000,143];", "speeds of v"),
    ),
    "krl": (
        (",E1 20.000000,E2", ",E2", "E1 is missing: the target has no value for rail"),
        (",E1 20.000000,", ",E1 20.000000,E3 1.0,", "E3 = 1: the robot has no such external axis"),
        (",E1 20.000000,", ",E1 20.000000,E1 2.0,", "gives an external axis twice"),
        ("MACHINE_DEF[2].ROOT", "MACHINE_DEF[3].ROOT", "expected a base that moves with MACHINE_D"),
        ("EK(MACHINE_DEF[2].ROOT,MACHINE_DEF[2].MECH_TYPE,", "EK(", "not expected here"),
    ),
    "fanuc": (
        (",\r\n\tE1=    20.000000  mm", "", "E1 is missing: the position has no value for rail"),
        ("\tE1=    20.000000  mm", "\tE1=    20.000000 deg", "E1: expected mm, got deg"),
        ("\tE1=    20.000000  mm", "\tE2=    20.000000  mm", "E2: the robot has no such external"),
        ("1,1,*,*,*", "1,*,*,*,*", "expected DEFAULT_GROUP = 1,1,*,*,*, got 1,*"),
        (" COORD", "", "expected COORD on this line"),
    ),
    "inform": (
        (" BC00000", "", "expected 'MOVJ C00000 BC00000"),
        (" +MOVJ EC00000 VJ=10.00", "", "expected 'MOVJ C00000 BC00000"),
        ("EC00000=0", "EC00000=0,0", "expected pulses of turn"),
        ("///GROUP2 ST1\r\n", "", "expected '///GROUP2 ST1'"),
        ("RB1,BS1", "RB1", "expected '///GROUP1 RB1,BS1'"),
    ),
    "csv": (
        ("e1_rail_mm", "e1_rail_deg", "e1_rail_mm"),
        (",20.000000000,0.000000000,", ",,0.000000000,", "expected a number with decimals"),
    ),
    "linuxcnc": (
        (" U20.00000000", "", "not expected here"),
        ("JOINTS = 8", "JOINTS = 7", "expected 'JOINTS = 8'"),
    ),
    "ros": (('"rail", "turn"', '"turn", "rail"', '"rail", "turn"'),),
}


@pytest.mark.parametrize("case", TABLE, ids=str)
def test_what_is_missing_or_too_much_is_refused_in_one_line(case):
    _, files, _ = made(case)
    for old, new, message in EDITS[case.name]:
        name = next(name for name, text in files.items() if old in text)
        with pytest.raises(InputError, match=re.escape(message)) as caught:
            case.read({**files, name: files[name].replace(old, new, 1)})
        assert "\n" not in str(caught.value)
        assert re.search(r"line \d+", str(caught.value))


@pytest.mark.parametrize("case", TABLE, ids=str)
def test_external_values_on_an_arm_that_has_none_are_refused(case):
    program, files, _ = made(case)
    arm = program.robot.alone()
    with pytest.raises(InputError) as caught:
        case.read(files, arm)
    assert "\n" not in str(caught.value)
    with pytest.raises(InputError) as caught:
        case.read(CASES[case.name].golden)
    assert "\n" not in str(caught.value)


def test_languages_without_external_kinematics_refuse_with_the_reason():
    known = {name for name, each in languages().items() if each.externals is not None}
    assert known == set(SAYING)
    for name in ("val3", "urscript"):
        case = ExternalCase("chuck", name)
        (said,) = {text for text in issues(case.program(), name) if "external" in text}
        assert f"language '{name}' is written here without external axes" in said
        assert "cannot move chuck" in said
        with pytest.raises(InputError, match="cannot move chuck"):
            read_program({"a program": ""}, name, case.plan().robot)


@pytest.mark.parametrize(
    ("name", "settings", "message"),
    [
        ("rapid", {}, "expected a mechanical unit for each external axis (rail, turn), got 0"),
        ("rapid", {"mechanical_units": ["ONE", "ONE"]}, "ONE cannot carry both robot and part"),
        (
            "rapid",
            {"mechanical_units": ["TRACK_1", "STN_1"], "external_letters": "bb"},
            "two external axes have the same letter",
        ),
        ("krl", {"external_numbers": [1]}, "expected a different number for each external axis"),
        ("krl", {"external_numbers": [2, 2]}, "expected a different number for each external axis"),
        ("krl", {"base_number": 3}, "leave base_number out"),
        ("inform", {}, "expected the pulses per mm or deg of each external axis (rail, turn)"),
        ("inform", {"pulses_per_deg": None, "external_pulses": [9.0, 9.0]}, "give pulses_per_deg"),
    ],
)
def test_settings_that_do_not_say_the_axes_are_refused(name, settings, message):
    program, _, _ = made(ExternalCase("rail+table", name))
    own = language(name).settings(**CASES[name].options | settings)
    (said,) = issues(program, name, own)
    assert message in said
    with pytest.raises(InputError, match=re.escape(message)):  # nor is a text read by them
        read_program({"a program": ""}, name, program.robot, own)


def test_two_units_cannot_carry_one_part():
    program, _, _ = made(ExternalCase("turn-tilt", "rapid"))
    own = language("rapid").settings(mechanical_units=["STN_1", "STN_2"])
    (said,) = issues(program, "rapid", own)
    assert "the part is carried by STN_1 and STN_2" in said


def test_letters_and_numbers_are_the_controllers():
    program, _, _ = made(ExternalCase("rail+table", "rapid"))
    units = ["TRACK_1", "STN_1"]
    own = language("rapid").settings(mechanical_units=units, external_letters="fb")
    (text,) = post(program, "rapid", own).values()
    assert ",[9E9,0.000000,9E9,9E9,9E9,20.000000]" in text
    program, _, _ = made(ExternalCase("rail+table", "krl"))
    own = language("krl").settings(laser_output=5, external_numbers=[4, 2])
    assert ",E4 20.000000,E2 0.000000" in post(program, "krl", own)["cut_skin_outer.src"]


@pytest.mark.parametrize("case", TABLE, ids=str)
def test_a_changed_value_is_a_difference(case):
    program, _, read = made(case)
    steps = list(program.sections[0].steps)
    k = next(k for k, step in enumerate(steps) if isinstance(step, JointMove))
    q = steps[k].q.copy()
    q[6] += 0.004
    steps[k] = replace(steps[k], q=q)
    moved = replace(program, sections=(replace(program.sections[0], steps=tuple(steps)),))
    files = language(case.name).formatter(moved, case.settings).files()
    own = (program.robot, program.T_flange_tip, program.T_base_part)
    found = differences(with_tips(read, *own), with_tips(case.read(files), *own))
    found = {each.code: each for each in found}
    assert found["external"].message == "rail moved at 1 target, by up to 4.0000 mm"
    assert not {"joints", "speeds", "zones"} & set(found)
    assert any("rail is 4.0" in str(issue) for issue in case.deviations(program, case.read(files)))


def test_values_beyond_the_range_are_refused_before_writing():
    case = ExternalCase("rail+table", "csv")
    program, _, _ = made(case)
    steps = list(program.sections[0].steps)
    q = steps[-1].q.copy()
    q[6] = 3.2
    steps[-1] = replace(steps[-1], q=q)
    beyond = replace(program, sections=(replace(program.sections[0], steps=tuple(steps)),))
    (said,) = issues(beyond, "csv")
    assert "rail high: 200.000 mm beyond its limit" in said


def test_an_endless_chuck_turns_the_short_way_on_a_kuka():
    case = ExternalCase("chuck", "krl")
    program, _, _ = made(case)
    steps = list(program.sections[0].steps)
    q = steps[-1].q.copy()
    q[6] -= 4.0
    steps.append(JointMove(q=q, speed=0.3))
    turned = replace(program, sections=(replace(program.sections[0], steps=tuple(steps)),))
    found = [str(issue) for issue in preflight(turned, "krl", case.settings)]
    assert any("chuck is endless and would turn the short way" in text for text in found)


def test_plans_on_other_axes_make_no_program_together():
    one = ExternalCase("chuck", "rapid").plan()
    (chuck,) = one.robot.externals
    shifted = replace(chuck, point=chuck.point + np.array([0, 0, 0.01]))
    other = replace(one, robot=replace(one.robot, externals=(shifted,)))
    with pytest.raises(InputError, match="differ in robot"):
        build_program([one, other])


@pytest.mark.parametrize("cell", CELLS)
def test_the_tool_backs_off_while_the_external_axes_stand_still(cell):
    plan = ExternalCase(cell, "rapid").plan()
    for end, node in (("start", 0), ("end", -1)):
        q = back_off(plan, end, 0.05)
        np.testing.assert_allclose(q[6:], plan.q[node, 6:], atol=1e-15)  # a sum of steps
        away = plan.robot.forward(q) @ plan.T_flange_tip
        there = plan.robot.forward(plan.q[node]) @ plan.T_flange_tip
        np.testing.assert_allclose(away[:3, :3], there[:3, :3], atol=1e-9)
        np.testing.assert_allclose(away[:3, 3], there[:3, 3] - 0.05 * there[:3, 2], atol=1e-9)


@pytest.mark.parametrize("case", TABLE, ids=str)
def test_an_arm_alone_is_written_as_ever_with_settings_of_external_axes(case):
    bare = CASES[case.name]
    files = post(bare.program, case.name, case.settings)
    assert files == bare.golden
    assert bare.deviations(bare.program, files, case.settings) == []
