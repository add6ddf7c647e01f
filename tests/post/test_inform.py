"""Yaskawa INFORM: the jobs that are written, how they read back, and what is refused."""

import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError
from scipy.spatial.transform import Rotation

from conftest import ROOT
from kerfpath import InputError, robot
from kerfpath.contour import KINDS
from kerfpath.post import (
    CircularMove,
    Comment,
    JointMove,
    LinearMove,
    ReadMove,
    ReadWait,
    Switch,
    build_program,
    deviations,
    language,
    post,
    read_program,
)
from kerfpath.post._frames import world
from kerfpath.post.inform import (
    Inform,
    InformSettings,
    axes_from_joints,
    joints_from_axes,
    manipulator_type,
)
from kerfpath.robots import robot_ids
from programs import arc, assert_at, changed, codes, edited, frames, hand_plan, with_steps

GOLDEN = ROOT / "tests" / "data" / "golden_inform"
JOBS = ("CUT_SKIN_OUTER.JBI", "SKIN_OUTER_AIR.JBI", "SKIN_OUTER.JBI", "CUT_SKIN_OUTER_OFF.JBI")
MAIN, AIR, PATH, OFF = JOBS
INFORM = language("inform")
PULSES = [1341.4, 1341.4, -1203.7, 1000.0, 980.1, 622.2]
IN_PULSES = InformSettings(laser_output=1, gas_output=2, pulses_per_deg=PULSES)
BY_TYPE = InformSettings(laser_output=1, gas_output=2)
ARMS = [name for name in robot_ids() if name.startswith("yaskawa")]


@pytest.fixture(scope="module")
def cell():
    tool, placement = frames()
    placement[:3, 3] = 1.0, -0.15, 0.55
    return robot("yaskawa_gp25"), tool, placement


@pytest.fixture(scope="module")
def small(cell):
    return hand_plan(arc(), *cell, speed=0.12)


@pytest.fixture(scope="module")
def program(small):
    return build_program([small], pierce_time=0.4, gas_lead=0.3)


def found_codes(program, level=None, settings=IN_PULSES):
    return codes(program, level, "inform", settings)


def golden():
    return {name: (GOLDEN / name).read_bytes().decode("ascii") for name in JOBS}


def reads_back(program, options=IN_PULSES):
    """Write and read back; check every target by the robot's forward kinematics."""
    files = post(program, "inform", options)
    read = read_program(files, "inform", program.robot, options)
    assert deviations(program, read, INFORM, options) == []
    counts_what_it_holds(files)
    q = np.array([move.q for move in program.moves])
    T_base_tip = program.robot.forward(q) @ program.T_flange_tip
    for expected, ours, move in zip(T_base_tip, program.moves, read.moves, strict=True):
        if move.q is not None:
            # Half a pulse of the coarsest axis.
            np.testing.assert_allclose(move.q, ours.q, atol=np.radians(0.51 / 622.2))
            continue
        T = program.T_base_part @ move.T_part_tip
        # Three decimals of mm, four of deg, the plan's own error.
        assert_at(T, expected, point=2e-6)
    return files, read


def counts_what_it_holds(files):
    """Check from the text alone: counts, names, jobs, and that every used position is there."""
    for name, text in files.items():
        rows = text.split("\r\n")
        assert rows[:3] == ["/JOB", f"//NAME {name.removesuffix('.JBI')}", "//POS"]
        held = [row[:6] for row in rows if re.match(r"C\d{5}=", row)]
        assert rows[3] == f"///NPOS {len(held)},0,0,0,0,0"
        assert held == [f"C{k:05d}" for k in range(len(held))]
        used = [found for row in rows for found in re.findall(r"^MOV. (C\d{5})", row)]
        assert sorted(set(used)) == held
        relative = "///ATTR SC,RW,RJ" in rows
        assert relative == ("///RECTAN" in rows) == ("////FRAME USER 1" in rows)
        assert not (relative and "///PULSE" in rows)
        assert rows[-2:] == ["END", ""]
        called = {f"{job}.JBI" for job in re.findall(r"CALL JOB:(\w+)", text)}
        assert called <= files.keys()
        assert max(map(len, (row for row in rows if row.startswith("' ")))) <= 32 if called else 1


# The text.


def test_the_golden_jobs_are_written_byte_for_byte(program):
    files = post(program, "inform", IN_PULSES)
    assert list(files) == list(JOBS)
    assert files == golden()


def test_the_golden_jobs_are_plain_text_in_windows_lines():
    for text in golden().values():
        assert text.count("\n") == text.count("\r\n")
        assert all(re.fullmatch(r"[ -~]{0,80}", line) for line in text.split("\r\n"))


@pytest.mark.parametrize("options", [IN_PULSES, BY_TYPE])
def test_the_golden_jobs_read_back_as_planned(program, options):
    _, read = reads_back(program, options)
    np.testing.assert_allclose(read.T_flange_tip, program.T_flange_tip, atol=1e-7)
    np.testing.assert_allclose(read.T_base_part, program.T_base_part, atol=1e-7)
    joint, start, first, *_, last, out = read.moves
    assert (joint.speed, start.speed, first.speed, out.speed) == (0.25, 0.1, 0.12, 0.1)
    assert [m.zone for m in (joint, start, first, last, out)] == [0, 0, None, 0, 0]
    assert start.switches == (Switch(signal="gas", on=True), Switch(signal="laser", on=True))
    waits = [step for step in read.steps if isinstance(step, ReadWait)]
    assert [wait.time for wait in waits] == [0.4]
    assert [section.name for section in read.sections] == ["SKIN_OUTER_AIR", "SKIN_OUTER"]


def test_pulses_are_degrees_times_those_of_the_robot(program):
    row = re.search(r"C00000=(.*)", golden()[AIR])[1]
    axes_deg = np.degrees(axes_from_joints(program.robot, [program.moves[0].q]))[0]
    said = [int(value) for value in row.split(",")]
    np.testing.assert_allclose(said, axes_deg * PULSES, atol=0.5)


def test_without_pulses_the_start_is_a_position_with_its_type_which_is_said(program):
    files = post(program, "inform", BY_TYPE)
    assert "///PULSE" not in files[AIR]
    assert re.search(r"///RCONF (\d,){23}\d\r\nC00000=", files[AIR])
    assert "joint-targets" in found_codes(program, "warning", BY_TYPE)
    assert "joint-targets" not in found_codes(program)


def test_positions_are_rx_then_ry_then_rz_about_fixed_axes(program):
    """The orientation of a position, turned together by hand from its text."""
    row = re.search(r"C00000=(.*)", golden()[PATH])[1]
    x, y, z = np.radians([float(value) for value in row.split(",")[3:]])
    Rx = [[1, 0, 0], [0, np.cos(x), -np.sin(x)], [0, np.sin(x), np.cos(x)]]
    Ry = [[np.cos(y), 0, np.sin(y)], [0, 1, 0], [-np.sin(y), 0, np.cos(y)]]
    Rz = [[np.cos(z), -np.sin(z), 0], [np.sin(z), np.cos(z), 0], [0, 0, 1]]
    expected = program.moves[1].T_part_tip[:3, :3]
    np.testing.assert_allclose(np.array(Rz) @ Ry @ Rx, expected, atol=3e-6)  # four decimals of deg


def test_outputs_are_switched_and_waits_begin_only_where_the_robot_stands():
    stands = False
    for row in golden()[PATH].split("\r\n"):
        stands = row.endswith("PL=0") or (stands and not row.startswith("MOV"))
        assert stands or not row.startswith(("DOUT", "TIMER"))


def with_arcs(program, numbers):
    """The program with some moves of the path made the way to an arc's end."""
    steps = list(program.sections[0].steps)
    for n in numbers:
        via, end = program.moves[n], program.moves[n + 1]
        fields = ("T_part_tip", "q", "speed", "duration", "zone")
        made = {name: getattr(end, name) for name in fields}
        made["switches"] = (*via.switches, *end.switches)
        steps.remove(via)
        steps[steps.index(end)] = CircularMove(T_part_via=via.T_part_tip, q_via=via.q, **made)
    return with_steps(program, steps)


def test_arcs_are_three_movc_and_parted_from_each_other(program):
    files, read = reads_back(with_arcs(program, [3, 5]))
    words = re.findall(r"^(MOV.) (C\d+)", files[PATH], re.MULTILINE)
    assert [word for word, _ in words[2:9]] == ["MOVC"] * 3 + ["MOVL"] + ["MOVC"] * 3
    assert words[5][1] == words[6][1]
    circles = [move for move in read.moves if move.kind == "circular"]
    np.testing.assert_allclose(circles[0].T_part_via, program.moves[3].T_part_tip, atol=2e-6)


def test_an_arc_may_begin_a_job(program):
    files, _ = reads_back(with_arcs(program, [1]))
    assert "MOVC C00000" in files[PATH]


def test_several_contours_become_jobs_called_in_order(cell):
    names = ("skin/outer", "skin outer", "7. Bohrung ø12", "hole" * 12)
    program = build_program([hand_plan(arc(name), *cell) for name in names], name="B-pillar 4711")
    files, _ = reads_back(program)
    calls = re.findall(r"CALL JOB:(\w+)", files["B_PILLAR_4711.JBI"])
    assert calls[:3] == ["B_PILLAR_4711_OFF", "SKIN_OUTER_AIR", "SKIN_OUTER"]
    assert calls[3:5] == ["SKIN_OUTER_2_AIR", "SKIN_OUTER_2"]
    assert max(map(len, calls)) == 32
    short = IN_PULSES.model_copy(update={"longest_name": 8})
    files, _ = reads_back(program, short)
    assert {len(name) for name in files} == {12}


def test_older_controllers_have_fewer_values_of_rconf(program):
    files, _ = reads_back(program, IN_PULSES.model_copy(update={"rconf_values": 6}))
    assert re.search(r"///RCONF (\d,){5}\d\r\n", files[PATH])


# What INFORM cannot say.


def test_a_lead_time_is_left_out_and_said(program, small):
    assert found_codes(program, "warning") == ["lead-time", "air-moves"]
    assert found_codes(build_program([small], lead_time=0.0)) == ["air-moves"]


def test_the_robot_stops_at_micro_joints_which_is_said(cell):
    words = {"i": "lead-in", "c": "cut", "m": "micro joint", "o": "lead-out"}
    kinds = np.array([KINDS.index(words[letter]) for letter in "iccmmcoo"])
    program = build_program([hand_plan(replace(arc(), kind=kinds), *cell)], lead_time=0.0)
    assert found_codes(program) == ["stop-to-switch", "air-moves"]
    _, read = reads_back(program)
    on, switched = False, []
    for move in read.moves:
        switched.append(on)
        on = move.switches[-1].on if move.switches else on
        assert move.zone == 0 or not move.switches
    assert switched == [False, False, True, True, True, False, False, True, True, False]


@pytest.mark.parametrize("turns", [-2, -1, 1, 2])
def test_turns_are_said_by_pulses_and_up_to_360_deg_by_the_type(program, turns):
    far = np.array([6.0, 6.0, 6.0, 6.0, 6.0, 20.0])
    arm = program.robot.with_limits(lower=-far, upper=far)
    by = 2 * np.pi * turns * np.eye(6)[5]
    steps = [replace(s, q=s.q + by) if hasattr(s, "q") else s for s in program.sections[0].steps]
    turned = with_steps(replace(program, robot=arm), steps)
    beyond = [abs(np.degrees(move.q[5])) > 360 for move in turned.moves]
    assert found_codes(turned, "error", BY_TYPE) == ["turns"] * sum(beyond)
    assert found_codes(turned, "error") == ["turns"] * sum(beyond[1:])
    if not any(beyond):
        reads_back(turned, BY_TYPE)
    reads_back(with_steps(turned, steps[:2]))


def test_waits_are_whole_hundredths_of_a_second(program):
    assert found_codes(changed(program, 3, time=0.405), "error") == ["time-step"]


# Axes and types.


@pytest.mark.parametrize("name", ARMS)
def test_every_arm_of_the_library_counts_joints_as_the_controller_does(name):
    """At zero pulses the tool points ahead, as controllers show it: Rx 180, Ry -90, Rz 0 deg."""
    arm = robot(name)
    q = np.random.default_rng(3).uniform(-2, 2, (5, 6))
    np.testing.assert_allclose(axes_from_joints(arm, q), q, atol=1e-14)
    np.testing.assert_allclose(joints_from_axes(arm, q), q, atol=1e-14)
    T = np.linalg.inv(world(arm)) @ arm.forward(np.zeros(6))
    g = arm.geometry
    home = Rotation.from_euler("xyz", [180, -90, 0], degrees=True).as_matrix()
    np.testing.assert_allclose(T[:3, :3], home, atol=1e-12)
    expected = [g["a1"] + g["c3"] + g["c4"], g["b"], g["c2"] - g["a2"]]
    np.testing.assert_allclose(T[:3, 3], expected, atol=1e-12)
    np.testing.assert_allclose(world(arm)[:3, 3], arm.frames["controller_base_xyz_m"], atol=1e-12)
    lifted = arm.forward(np.radians([0, 0, 10, 0, 0, 0]))
    assert lifted[2, 3] > arm.forward(np.zeros(6))[2, 3]


def test_an_arm_described_otherwise_has_the_same_axes(cell):
    arm = cell[0]
    turned = np.eye(4)
    turned[:3, :3] = Rotation.from_euler("z", 40, degrees=True).as_matrix()
    other = replace(arm, sign=-arm.sign, offset=arm.offset + 0.3, T_end_flange=turned)
    q = np.random.default_rng(5).uniform(-1, 1, (5, 6))
    same = joints_from_axes(other, axes_from_joints(arm, q))
    np.testing.assert_allclose(other.forward(same), arm.forward(q) @ turned, atol=1e-12)
    np.testing.assert_array_equal(manipulator_type(other, same), manipulator_type(arm, q))


@pytest.mark.parametrize(
    ("r_deg", "no_flip", "beyond"),
    [
        *[(-90, 1, 0), (-89.9, 0, 0), (0, 0, 0), (90, 0, 0), (90.1, 1, 0), (180, 1, 0)],
        *[(180.1, 1, 1), (270, 1, 1), (270.1, 0, 1), (360, 0, 1), (-180, 1, 1), (-179.9, 1, 0)],
        *[(-269.9, 1, 1), (-270, 0, 1), (-1e-9, 0, 0)],
    ],
)
def test_flip_and_the_angle_of_r_are_those_of_the_manuals_table(r_deg, no_flip, beyond):
    """NX100 149235-1CD, 3.9: flip -90 < R <= 90, 270 < R <= 360, -360 < R <= -270."""
    arm = robot("yaskawa_gp25")
    q = joints_from_axes(arm, np.radians([[0.0, 0, 0, r_deg, -30, 0]]))
    np.testing.assert_array_equal(manipulator_type(arm, q, "R")[0, [0, 3]], [no_flip, beyond])


@pytest.mark.parametrize("number", range(8))
def test_types_follow_the_posture_in_all_eight_postures(cell, number):
    """The kernels' postures are an independent account of front/rear and elbow."""
    arm, tool, _ = cell
    placement = np.eye(4)
    placement[:3, 3] = 0.45, 0.1, 0.7
    free = arm.with_limits(lower=np.full(6, -6.28), upper=np.full(6, 6.28))
    made = hand_plan(arc(count=20, radius=0.03), free, tool, placement, posture=number)
    program = build_program([made], lead_time=0.0)
    rear, down = number // 4, number // 2 % 2
    for options in (IN_PULSES, BY_TYPE, BY_TYPE.model_copy(update={"flip": "R"})):
        _, read = reads_back(program, options)
        cut = [move.posture for move in read.moves if move.kind == "linear"]
        assert {bits[1:3] for bits in cut[:-1]} == {(rear ^ down, rear)}
        q = np.array([move.q for move in program.moves[1:]])
        r, b, t, s = (np.degrees(axes_from_joints(free, q))[:, k] for k in (3, 4, 5, 0))
        no_flip = np.cos(np.radians(r)) < 0 if options.flip == "R" else b < 0
        assert [bits[0] for bits in cut] == no_flip.astype(int).tolist()
        for place, angle in ((3, r), (4, t), (5, s)):
            assert [bits[place] for bits in cut] == (np.abs(angle) > 180).astype(int).tolist()


@settings(max_examples=60, deadline=None)
@given(st.lists(st.floats(-2, 2), min_size=6, max_size=6))
def test_arm_and_side_agree_with_a_construction_from_points(q):
    """The lower arm's line and axis S drawn as points, on an arm with 200 mm at the elbow."""
    arm = robot("yaskawa_gp25")
    a1, c1, c2, c4 = (arm.geometry[k] for k in ("a1", "c1", "c2", "c4"))
    flange = arm.forward(np.array(q))
    wrist = flange[:3, 3] - c4 * flange[:3, 2]
    ahead = np.array([np.cos(q[0]), np.sin(q[0]), 0.0])
    shoulder = a1 * ahead + [0, 0, c1]
    lower = c2 * (np.sin(q[1]) * ahead + [0, 0, np.cos(q[1])])
    left = np.array([-np.sin(q[0]), np.cos(q[0]), 0.0])
    side = np.cross(lower, wrist - shoulder) @ left
    if min(abs(side), abs(wrist @ ahead)) < 1e-5:
        return
    found = manipulator_type(arm, [q])[0]
    np.testing.assert_array_equal(found[1:3], [side < 0, wrist @ ahead < 0])


# Long programs.


@pytest.fixture(scope="module")
def long(cell):
    plans = [
        hand_plan(arc(name, count=count), *cell)
        for name, count in (("a contour with a long name", 300), ("hole", 20), ("Hole", 30))
    ]
    return build_program(plans, name="long", lead_time=0.0)


def test_a_contour_longer_than_a_job_is_refused_not_divided(long):
    tight = IN_PULSES.model_copy(update={"lines_per_file": 100, "longest_name": 12})
    assert "file-length" in found_codes(long, "error", tight)
    with pytest.raises(InputError, match=r"not divided.* lines_per_file"):
        post(long, "inform", tight)
    names = [name for name, _ in Inform(long, tight).names()]
    assert max(map(len, names)) == 12
    assert len(set(names)) == len(names)
    files, _ = reads_back(long, tight.model_copy(update={"lines_per_file": 1000}))
    assert len(files) == 8  # main, two for each contour, and the one that switches off


def test_more_jobs_than_a_main_job_can_call_are_refused(program):
    (section,) = program.sections
    many = replace(program, sections=tuple(replace(section, name=f"c{k}") for k in range(100)))
    with pytest.raises(InputError, match="lines_per_file allows 100; raise it"):
        Inform(many, IN_PULSES.model_copy(update={"lines_per_file": 100})).files()


# Settings and preflight.


def test_every_setting_says_what_it_expects():
    for name, field in InformSettings.model_fields.items():
        assert field.description, name
        assert field.examples, name
        with pytest.raises(ValidationError):
            InformSettings(**{name: -1})


@pytest.mark.parametrize("pulses", [[1.0] * 5, [0.0, 1, 1, 1, 1, 1], [float("nan")] * 6, "1"])
def test_pulses_are_six_numbers_that_are_not_zero(pulses):
    with pytest.raises(ValidationError):
        InformSettings(pulses_per_deg=pulses)


@pytest.mark.parametrize(
    ("update", "code"),
    [
        ({"gas_output": None}, "output"),
        ({"gas_output": 1}, "output"),
        ({"fastest_mm_s": 110.0}, "speed"),
    ],
)
def test_preflight_refuses_by_the_settings(program, update, code):
    assert set(found_codes(program, "error", IN_PULSES.model_copy(update=update))) == {code}


def test_preflight_refuses_a_reserved_name_and_warns_of_other_makers(program):
    named = replace(program, sections=(replace(program.sections[0], name="master"),))
    assert found_codes(named, "error") == ["name-reserved"]
    other = replace(program, robot=replace(program.robot, manufacturer="KUKA"))
    assert "wrong-robot" in found_codes(other, "warning")


# The reader.


@pytest.mark.parametrize(
    ("file", "old", "new", "message"),
    [
        (MAIN, "//NAME CUT_SKIN_OUTER", "//NAME OTHER", "line 2: expected '//NAME CUT_SKIN_OUTER'"),
        (MAIN, "///NPOS 0,", "///NPOS 1,", "line 4: the main job must have no positions"),
        (MAIN, "NOP", "NOP\r\nPAUSE", "line 10: not expected here: 'PAUSE'"),
        (MAIN, "'UFRAME 1 X", "'UFRAME 2 X", "UFRAME 1 is not given whole"),
        (MAIN, "'UFRAME 1 Y", "'UFRAME 1 X", "UFRAME 1 X is given twice"),
        (MAIN, "'TOOL 0 RZ", "' TOOL 0 RZ", "TOOL 0 is not given whole"),
        (OFF, "DOUT OT#(1) OFF", "DOUT OT#(1) ON", "expected 'DOUT OT#(1) OFF'"),
        (OFF, "DOUT OT#(1) OFF", "DOUT OT#(3) OFF", "expected 'DOUT OT#(1) OFF'"),
        (OFF, "DOUT OT#(2) OFF\r\n", "", "'DOUT OT#(2) OFF' is missing"),
        (MAIN, "CALL JOB:CUT_SKIN_OUTER_OFF\r\n", "", "expected CUT_SKIN_OUTER_OFF to be called"),
        (MAIN, "CALL JOB:SKIN_OUTER\r\n", "CALL JOB:SKIN_OUTER_AIR\r\n", "is called twice"),
        (MAIN, "END\r\n", "END\r\nNOP", "nothing may follow END"),
        (MAIN, "END\r\n", "", "the job ends too early; END is missing"),
        (MAIN, "CALL JOB:SKIN_OUTER\r\n", "CALL JOB:HOLE\r\n", "the file 'HOLE.JBI' is not there"),
        (AIR, "///NPOS 1,", "///NPOS 2,", "expected position C00001, got '//INST'"),
        (AIR, "///NPOS 1,", "///NPOS x,", "line 4: expected the number of positions"),
        (AIR, "///TOOL 0", "///TOOL 1", "line 5: expected '///TOOL 0', got '///TOOL 1'"),
        (AIR, "C00000=", "C00001=", "expected position C00000"),
        (AIR, "SC,RW", "SC,RW,RJ", "expected '///ATTR SC,RW'"),
        (AIR, "VJ=25.00", "VJ=25", "not expected here: 'MOVJ"),
        (AIR, "MOVJ C00000", "MOVJ C00001", "C00001 is not there"),
        (AIR, "MOVJ C00000 VJ=25.00", "MOVL C00000 V=25.0", "needs a position in the user frame"),
        (AIR, "PL=0", "PL=2", "expected PL=0 or PL=1, got PL=2"),
        (PATH, "///RCONF 1", "///RCONF 2", "expected position C00000"),
        (PATH, "///RCONF 1,", "///RCONF ", "expected 24 values, 0 from the seventh on"),
        (PATH, ",0\r\nC00000", ",1\r\nC00000", "expected 24 values, 0 from the seventh on"),
        (PATH, "////FRAME USER 1", "////FRAME USER 2", "expected '////FRAME USER 1'"),
        (PATH, "///USER 1", "///USER 2", "line 5: expected '///USER 1'"),
        (PATH, "PL=0\r\nDOUT", "PL=1\r\nDOUT", "a switch must follow a move of the path with PL=0"),
        (PATH, "TIMER T=0.40", "TIMER T=0.40\r\nDOUT OT#(1) ON", "a switch must follow a move"),
        (PATH, "MOVL C00001 V=120.0 PL=1", "MOVL C00001 V=120.0 PL=1\r\nTIMER T=0.10",
         "a wait must follow a move with PL=0"),
        (PATH, "MOVL C00002", "MOVC C00002", "an arc must begin where the move before it ends"),
        (PATH, "MOVL C00002", "MOVC C00001 V=120.0\r\nMOVL C00002", "an arc needs three MOVC"),
        (PATH, "MOVL C00002", "MOVC C00001 V=120.0 PL=1\r\nMOVL C00002", "at the third MOVC"),
        (PATH, "MOVL C00002 V=120.0 PL=1", "MOVL C00002 V=120.0", "an arc must begin where"),
        (PATH, "MOVL C00002", "MOVS C00002", "not expected here: 'MOVS"),
        (PATH, "END", "JUMP *A\r\nEND", "not expected here: 'JUMP *A'"),
    ],
)  # fmt: skip
def test_the_reader_refuses_what_it_does_not_know(cell, file, old, new, message):
    files = edited(golden(), file, old, new)
    with pytest.raises(InputError, match=re.escape(message)) as caught:
        read_program(files, "inform", cell[0], IN_PULSES)
    assert "\n" not in str(caught.value)


def test_pulses_cannot_be_read_without_those_of_the_robot(cell):
    with pytest.raises(InputError, match=r"SKIN_OUTER_AIR.JBI, line \d+: .*give pulses_per_deg"):
        read_program(golden(), "inform", cell[0], BY_TYPE)


@pytest.mark.parametrize(
    ("file", "old", "new"),
    [
        (PATH, "///RCONF 1", "///RCONF 0"),
        (PATH, "V=120.0", "V=121.0"),
        (PATH, "C00001=", "C00001=1"),
        (PATH, "OT#(2) ON", "OT#(2) OFF"),
        (PATH, "TIMER T=0.40", "TIMER T=0.50"),
        (PATH, "MOVL C00001", "MOVL C00002"),
        (PATH, "V=100.0 PL=0\r\nEND", "V=100.0 PL=1\r\nEND"),
        (AIR, "VJ=25.00", "VJ=35.00"),
        (AIR, "C00000=", "C00000=1"),
        (MAIN, "'TOOL 0 X 51.3000", "'TOOL 0 X 51.4000"),
    ],
)
def test_an_edited_program_is_read_as_edited(program, file, old, new):
    files = edited(golden(), file, old, new)
    read = read_program(files, "inform", program.robot, IN_PULSES)
    assert deviations(program, read, INFORM, IN_PULSES)


NASTY = st.text(max_size=60) | st.sampled_from(
    ["x\nEND", "'UFRAME 1 X 0.0000", "a 'UFRAME 1 X 0.0000 b" * 3, "\r\nDOUT OT#(1) ON", "/JOB"]
)


@settings(max_examples=60, deadline=None)
@given(name=NASTY, robot_id=NASTY, remark=NASTY)
def test_no_text_of_a_person_becomes_a_line_of_a_job(small, name, robot_id, remark):
    try:
        odd = build_program([replace(small, contour=replace(small.contour, name=name))])
    except InputError:
        return
    first, *rest = odd.sections[0].steps
    odd = replace(
        with_steps(odd, [first, Comment(remark), *rest]),
        robot=replace(odd.robot, id=robot_id, model=robot_id),
    )
    if {"name-reserved", "name-collision"} & set(found_codes(odd)):
        return
    files = post(odd, "inform", IN_PULSES)
    plain = post(build_program([small]), "inform", IN_PULSES)
    assert len(files) == len(plain)
    for text, expected in zip(files.values(), plain.values(), strict=True):
        rows = [row for row in text.splitlines() if not row.startswith("' ")]
        theirs = [row for row in expected.splitlines() if not row.startswith("' ")]
        assert len(rows) == len(theirs)
        differing = [a for a, b in zip(rows, theirs, strict=True) if a != b]
        assert all(row.startswith(("//NAME ", "CALL JOB:")) for row in differing)
        assert max(map(len, text.splitlines())) <= 100
    kinds = [type(step) for step in read_program(files, "inform", odd.robot, IN_PULSES).steps]
    assert kinds == [ReadMove] * len(odd.moves)


def test_moves_are_joint_moves_and_moves_of_the_path(program):
    """What the law above compares is there: one joint move, then the path."""
    assert [type(move) for move in program.moves] == [JointMove] + [LinearMove] * 9
