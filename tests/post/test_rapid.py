"""ABB RAPID: what is written, how it reads back, and what is refused."""

import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from tests.post.cases import CASES

from conftest import rebuilt
from kerfpath import InputError, plan, robot
from kerfpath.post import (
    LinearMove,
    Switch,
    build_program,
    deviations,
    post,
    read_program,
)
from kerfpath.post.rapid import RapidSettings, axes_from_joints, confdata, joints_from_axes
from programs import arc, codes, edited, hand_plan, read_text, text_of

CASE = CASES["rapid"]
MODULE = "cut_skin_outer.mod"
GOLDEN = CASE.golden[MODULE]


def moves_of(section, kind):
    return [step for step in section.steps if isinstance(step, kind)]


# The law: what is read back is what was planned.


def reads_back(plans, program):
    """Check that the text says tool, placement, path, configuration, speeds and switches."""
    read = read_text(text_of(post(program)), program.robot)
    assert read.name == program.name
    assert deviations(program, read, CASE.language, CASE.settings) == []
    first = plans[0]
    # Four decimals of mm and eight of a unit quaternion.
    np.testing.assert_allclose(read.T_flange_tip, first.T_flange_tip, atol=1e-7)
    np.testing.assert_allclose(read.T_base_part, first.T_base_part, atol=1e-7)
    assert [section.name for section in read.sections] == [s.name for s in program.sections]
    for made, section in zip(plans, read.sections, strict=True):
        *_, joint = [move for move in section.moves if move.kind == "joint"]
        linear = [move for move in section.moves if move.kind == "linear"]
        assert len(linear) == len(made.q) + 1
        T_base_tip = read.T_base_part @ np.array([move.T_part_tip for move in linear[:-1]])
        planned = made.robot.forward(made.q) @ made.T_flange_tip
        off = np.linalg.norm(T_base_tip[:, :3, 3] - planned[:, :3, 3], axis=1)
        turned = np.swapaxes(T_base_tip[:, :3, :3], 1, 2) @ planned[:, :3, :3]
        assert off.max() < 1e-6  # 1e-3 mm
        assert np.degrees(Rotation.from_matrix(turned).magnitude()).max() < 1e-3
        # The joint move leads, through the robot's kinematics, to the backed-off start.
        T_in = made.robot.forward(joint.q) @ made.T_flange_tip
        back = T_in[:3, 3] - planned[0, :3, 3]
        np.testing.assert_allclose(back, -0.05 * planned[0, :3, 2], atol=2e-6)
        T_out = read.T_base_part @ linear[-1].T_part_tip
        back = T_out[:3, 3] - planned[-1, :3, 3]
        np.testing.assert_allclose(back, -0.05 * planned[-1, :3, 2], atol=2e-6)
        check_configurations(made, linear[:-1])
        check_motion(made, linear)
    return read


def check_configurations(made, linear):
    """cf1, cf4, cf6 by quarter turns; cfx from the posture that the kernels solved for."""
    q = made.q[0] + np.vstack([np.zeros(6), np.cumsum(made.increments, axis=0)])
    conf = np.array([move.posture for move in linear])
    quarters = np.floor(np.degrees(q[:, [0, 3, 5]]) / 90)
    np.testing.assert_array_equal(conf[:, :3], quarters)
    # For ABB arms every sign is +, so that axis 5 negative is the kernels' wrist "minus"; behind
    # axis 1 the elbow of the kernels changes its sense, the lower arm's bit does not.
    rear, down, minus = made.posture // 4, made.posture // 2 % 2, made.posture % 2
    np.testing.assert_array_equal(conf[:, 3], 4 * rear + 2 * (rear ^ down) + minus)


def check_motion(made, linear):
    speed = made.contour.length / made.time[-1]
    start, cut, out = linear[0], linear[1:-1], linear[-1]
    assert start.speed == out.speed == pytest.approx(0.1)
    assert all(move.speed == pytest.approx(speed, abs=1e-5) for move in cut)
    assert [move.zone for move in (start, cut[-1], out)] == [0, 0, 0]
    assert all(move.zone == pytest.approx(0.0003) for move in cut[:-1])
    assert start.switches == (Switch(signal="laser", on=True, lead_time=0.02),)
    assert cut[-1].switches == (Switch(signal="laser", on=False, lead_time=0.02),)
    assert not any(move.switches for move in (*cut[:-1], out))


def test_the_golden_program_reads_back_as_planned(small, program):
    read = reads_back([small], program)
    speeds = {move.kind + str(k): move.speed for k, move in enumerate(read.moves[:3])}
    assert speeds == {"joint0": 0.1, "linear1": 0.1, "linear2": 0.12}
    assert read.moves[2].zone == pytest.approx(0.0003)


def test_a_planned_circle_with_endless_joints_reads_back(circle, arm, tool, placement):
    step = np.radians(10)
    made = plan(circle, arm, tool=tool, placement=placement, speed=0.1, gamma_step=step)
    program = build_program([made], zone=3e-4)
    reads_back([made], program)
    assert codes(program) == ["air-moves"]
    q = np.array([move.q for move in moves_of(program.sections[0], LinearMove)])
    assert np.abs(np.diff(q, axis=0)).max() < np.pi  # unrolled: no jump of a turn


def test_several_contours_become_routines_called_in_order(cell):
    plans = [
        hand_plan(arc(name), *cell)
        for name in ("skin/outer", "skin outer", "7. Bohrung ø12", "hole" * 12)
    ]
    program = build_program(plans, name="B-pillar 4711", zone=3e-4)
    names = ["skin_outer", "skin_outer_2", "c_7_Bohrung_12", ("hole" * 12)[:32]]
    assert program.name == "B_pillar_4711"
    assert [section.name for section in program.sections] == names
    reads_back(plans, program)
    text = text_of(post(program))
    assert text.index("IF nFirst<=1 skin_outer;") < text.index("IF nFirst<=2 skin_outer_2;")
    assert "! 7. Bohrung ?12: 8 nodes" in text


@pytest.mark.parametrize("posture", range(8))
def test_configurations_follow_the_posture_in_all_eight_postures(posture):
    """The kernels' postures are an independent account of front/rear, elbow and wrist."""
    made = CASE.in_posture(posture)
    reads_back([made], build_program([made], zone=3e-4))


def test_quaternions_do_not_jump_in_sign_along_the_path(cell):
    arm, tool, placement = cell
    made = hand_plan(arc(count=40), arm, tool, placement)
    text = text_of(post([made]))
    rows = re.findall(r"(?:MoveL|TriggL) \[\[[^]]*\],\[([^]]*)\]", text)
    wxyz = np.array([[float(x) for x in row.split(",")] for row in rows])
    assert ((wxyz[1:] * wxyz[:-1]).sum(axis=1) > 0).all()
    np.testing.assert_allclose(np.linalg.norm(wxyz, axis=1), 1, atol=2e-8)


@settings(max_examples=60, deadline=None)
@given(st.lists(st.floats(-6, 6), min_size=6, max_size=6))
def test_configuration_bits_agree_with_a_construction_from_points(q):
    """The lower arm's line and axis 1 drawn as points, on an arm without lateral offset."""
    arm = robot("abb_irb6700_200_260")
    a1, c1, c2 = (arm.geometry[k] for k in ("a1", "c1", "c2"))
    flange = arm.forward(np.array(q))
    wrist = flange[:3, 3] - arm.geometry["c4"] * flange[:3, 2]
    ahead = np.array([np.cos(q[0]), np.sin(q[0]), 0.0])
    shoulder = a1 * ahead + [0, 0, c1]
    lower = c2 * (np.sin(q[1]) * ahead + [0, 0, np.cos(q[1])])
    left = np.array([-np.sin(q[0]), np.cos(q[0]), 0.0])
    side = np.cross(lower, wrist - shoulder) @ left  # positive: in front, turning nose down
    reach, axis_5 = wrist @ ahead, np.degrees(q[4])
    if min(abs(side), abs(reach), abs(axis_5)) < 1e-5:
        return
    expected = 4 * (reach < 0) + 2 * (side < 0) + (axis_5 < 0)
    assert confdata(arm, [q])[0, 3] == expected


def test_the_elbow_bit_turns_over_at_the_stretched_arm():
    """IRB 6700 with 1392.5 mm and 200 mm: the elbow is singular at axis 3 = -81.83 deg."""
    arm = robot("abb_irb6700_200_260")
    arm = rebuilt(arm, geometry={**arm.geometry, "c3": 1.3925, "a2": -0.2})
    axis_3 = np.array([60, 0, -60, -81.5, -82.2, -90, -150])
    q = np.zeros((len(axis_3), 6))
    q[:, 2], q[:, 4] = np.radians(axis_3), np.radians(90)
    np.testing.assert_array_equal(confdata(arm, q)[:, 3] & 2, [0, 0, 0, 0, 2, 2, 2])


def test_quarter_turns_count_in_both_directions_and_ignore_rounding():
    arm = robot("abb_irb4600_60_205")
    q = np.zeros((5, 6))
    q[:, 5] = np.radians([0, 89.9, 90, -0.1, 750])
    np.testing.assert_array_equal(confdata(arm, q)[:, 2], [0, 0, 1, -1, 8])
    q[:, 5] = -1e-15
    assert (confdata(arm, q)[:, 2] == 0).all()


# The parallel rod.


def test_a_parallel_rod_converts_axis_3_both_ways():
    arm = robot("abb_irb2400_155")
    q = np.radians([[10.0, 40, -30, 5, 6, 7]])
    axes = axes_from_joints(arm, q)
    np.testing.assert_allclose(np.degrees(axes), [[10, 40, 10, 5, 6, 7]])
    np.testing.assert_allclose(joints_from_axes(arm, axes), q, atol=1e-15)
    plain = robot("abb_irb4600_60_205")
    np.testing.assert_array_equal(axes_from_joints(plain, q), q)


def test_a_program_for_a_parallel_rod_arm_reads_back(cell):
    arm, (_, tool, placement) = robot("abb_irb2400_155"), cell
    made = hand_plan(arc(), arm, tool, placement)
    program = build_program([made], zone=3e-4)
    reads_back([made], program)
    axis_3 = float(re.search(r"MoveAbsJ \[\[[^,]*,[^,]*,([^,]*),", text_of(post(program)))[1])
    q_in = program.sections[0].moves[0].q
    assert axis_3 == pytest.approx(np.degrees(q_in[1] + q_in[2]), abs=1e-6)


@pytest.mark.parametrize(
    ("settings", "code"),
    [
        ({"tool_name": "t-laser"}, "name-identifier"),
        ({"laser_output": "Reset"}, "name-reserved"),
        ({"work_object": "v100"}, "name-reserved"),
        ({"work_object": "TLASER"}, "name-collision"),
    ],
)
def test_preflight_refuses_names_of_the_settings(program, settings, code):
    assert codes(program, "error", settings=RapidSettings(**settings)) == [code]


def test_gas_flows_from_before_the_start_to_the_end_and_needs_an_output(small):
    program = build_program([small], gas_lead=0.3)
    assert codes(program, "error") == ["output"]
    settings = RapidSettings(gas_output="doGas")
    text = text_of(post(program, settings=settings))
    assert r"TriggIO trGasOn,0.3000\Time\DOp:=doGas,1;" in text
    assert r",trGasOn\T2:=trOn,fine" in text
    read = read_text(text, program.robot, settings=settings)
    assert [s.signal for s in read.moves[1].switches] == ["gas", "laser"]


def test_what_preflight_refuses_is_not_written(program):
    with pytest.raises(InputError, match="tool: 't-laser' is not a name in ABB RAPID"):
        post(program, settings=RapidSettings(tool_name="t-laser"))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("MODULE cut_skin_outer", "SYSMODULE x", "line 1: not expected here"),
        ("ENDMODULE", "", "ENDMODULE is missing"),
        ("ENDMODULE", "ENDMODULE\nx;", "nothing may follow"),
        (r"ConfL\Off;", r"ConfJ\On;", "line 20: expected"),
        ("IF nFirst<=1 skin_outer;", "", "do not match: skin_outer"),
        (
            "IF nFirst<=1 skin_outer;",
            "IF nFirst<=1 skin_outer;\nIF nFirst<=2 skin_outer;",
            "called twice",
        ),
        ("IF nFirst<=1 skin_outer;", "IF nFirst<=2 skin_outer;", "is contour 1, not 2"),
        ("IF nFirst<=1 skin_outer;", "skin_outer;", "not expected here"),
        ("PERS num nFirst:=1;", "PERS num nFirst:=2;", "must be the number of a contour"),
        ("PERS num nFirst:=1;", "", "must be the number of a contour"),
        ("    nFirst:=1;\n", "", "not expected here: 'ERROR'"),
        ("    RAISE;\n", "", "expected 'RAISE;'"),
        ("  UNDO\n    switchOff;\n", "", "expected 'UNDO'"),
        ("    SetDO doLaser,0;\n", "", "expected 'SetDO doLaser,0;'"),
        (",trOff,fine", ",trX,fine", "trX has not been set"),
        (",fine,tLaser", ",z10,tLaser", "z10 is not declared"),
        (r"fine,tLaser\WObj", r"fine,tool0\WObj", "not those of the module"),
        ("[FALSE,TRUE,", "[TRUE,TRUE,", "line 10: expected a fixed work object"),
        ("tLaser:=[TRUE,", "tLaser:=[FALSE,", "expected a tool held by the robot"),
        ("zCorner:=[FALSE,", "zCorner:=[TRUE,", "expected a zone"),
        ("vAir:=[100.00,", "vAir:=[", "expected 4 values"),
        ("vAir:=[100.00,", "vAir:=[TRUE,", "expected 4 numbers"),
        ("vAir:=[100.00,", "vAir:=[10O,", "not an aggregate"),
        ("speeddata vCut", "speeddata vAir", "vAir is declared twice"),
        ("speeddata vCut", "speeddata VAIR", "line 13: vAir is declared twice"),
        ("zonedata zCorner", "zonedata VCut", "line 14: vCut is declared twice"),
        ("PROC skin_outer()", "PROC vcut()", "line 48: vCut is declared twice"),
        ("SetDO doLaser", "SetDO doOther", "expected 'SetDO doLaser,0;'"),
        ("TriggIO trOff", "TriggIO trOn", "set once"),
        ("9E9]],vAir", "0]],vAir", "the robot has no such axis"),
        ("[0,-1,0,0]", "[0.5,-1,0,0]", "must be whole numbers"),
    ],
)
def test_the_reader_refuses_what_it_does_not_know(old, new, message):
    CASE.refuses(MODULE, old, new, message)


def test_the_reader_refuses_a_quaternion_that_is_none():
    text = re.sub(r"(TriggL \[\[[^]]*\],\[)[\d.-]+", r"\g<1>0.9", GOLDEN, count=1)
    with pytest.raises(InputError, match=r"line \d+: the quaternion .* must have length 1"):
        read_text(text, robot("abb_irb4600_60_205"))


def test_the_reader_refuses_a_module_without_a_tool():
    lines = [line for line in GOLDEN.splitlines() if "tooldata" not in line]
    with pytest.raises(InputError, match="tool tLaser, work object wPart: not those of the module"):
        read_text("\n".join(lines), robot("abb_irb4600_60_205"))


@pytest.fixture(scope="module")
def long_program(cell):
    plans = [hand_plan(arc(f"hole {k}", count=70), *cell) for k in range(3)]
    return build_program(plans, name="long")


def test_a_long_program_is_loaded_module_by_module(long_program):
    settings = RapidSettings(lines_per_file=100)
    files = post(long_program, settings=settings)
    assert list(files)[:3] == ["long.mod", "long_part.mod", "long_part_2.mod"]
    assert max(text.count("\n") for text in files.values()) <= 100
    main = files["long.mod"]
    assert main.count("Load \\Dynamic") == main.count("UnLoad ") == len(files) - 1
    read = read_program(files, "rapid", long_program.robot, settings)
    assert deviations(long_program, read, CASE.language, settings) == []
    assert post(long_program).keys() == {"long.mod"}


@pytest.mark.parametrize(
    ("file", "old", "new", "message"),
    [
        ("long.mod", "UnLoad", "Reload", "long.mod, line .*not expected here: 'Reload"),
        ("long.mod", '%"hole_0"%;', "", "expected here: 'ENDIF'"),
        ("long.mod", "ENDIF", "", "expected 'ENDIF'"),
        ("long.mod", "IF nFirst<=1 THEN", "", "without a condition"),
        ("long.mod", "IF nFirst<=1 THEN", "IF nFirst<=2 THEN", "hole_0 is contour 1, not 2"),
        ("long.mod", "HOME:/long_part.mod", "HOME:/other.mod", "the file 'other.mod' is missing"),
        ("long.mod", 'UnLoad "HOME:/long_part.mod', 'UnLoad "HOME:/x.mod', "x.mod is not loaded"),
        ("long_part.mod", "PROC hole_0()", "PROC main()", "main is declared twice"),
        ("long_part.mod", "ENDMODULE", "", "long_part.mod, line .*ENDMODULE is missing"),
    ],
)
def test_modules_that_do_not_fit_each_other_are_refused(long_program, file, old, new, message):
    settings = RapidSettings(lines_per_file=100)
    files = edited(post(long_program, settings=settings), file, old, new, count=-1)
    with pytest.raises(InputError, match=message):
        read_program(files, "rapid", long_program.robot, settings)


def test_a_folder_of_the_controller_cannot_carry_anything_else():
    with pytest.raises(ValueError, match="folder"):
        RapidSettings(folder='HOME:"; StopMove; !')
