"""Yaskawa INFORM: the jobs that are written, how they read back, and what is refused."""

import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError
from scipy.spatial.transform import Rotation
from tests.post.cases import CASES

from kerfpath import InputError, robot
from kerfpath.post import (
    build_program,
    post,
)
from kerfpath.post.arcs import world
from kerfpath.post.inform import (
    Inform,
    InformSettings,
    axes_from_joints,
    joints_from_axes,
    manipulator_type,
)
from kerfpath.robots import robot_ids
from programs import arc, arced, changed, hand_plan, with_steps

CASE = CASES["inform"]
IN_PULSES, golden, found_codes = CASE.settings, CASE.golden, CASE.codes
BY_TYPE = IN_PULSES.model_copy(update={"pulses_per_deg": None})
MAIN, AIR, PATH, OFF = golden


def reads_back(program, options=IN_PULSES):
    """Write and read back, and look at the text alone."""
    files, read = CASE.reads_back(program, options)
    counts_what_it_holds(files)
    return files, read


ARMS = [name for name in robot_ids() if name.startswith("yaskawa")]


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


@pytest.mark.parametrize("options", [IN_PULSES, BY_TYPE])
def test_a_contour_is_a_job_for_the_way_to_it_and_one_for_its_path(program, options):
    _, read = reads_back(program, options)
    joint, start, first, *_, last, out = read.moves
    assert [m.zone for m in (joint, start, first, last, out)] == [0, 0, None, 0, 0]
    assert [section.name for section in read.sections] == ["SKIN_OUTER_AIR", "SKIN_OUTER"]


def test_pulses_are_degrees_times_those_of_the_robot(program):
    row = re.search(r"C00000=(.*)", golden[AIR])[1]
    axes_deg = np.degrees(axes_from_joints(program.robot, [program.moves[0].q]))[0]
    said = [int(value) for value in row.split(",")]
    np.testing.assert_allclose(said, axes_deg * IN_PULSES.pulses_per_deg, atol=0.5)


def test_without_pulses_the_start_is_a_position_with_its_type_which_is_said(program):
    files = post(program, "inform", BY_TYPE)
    assert "///PULSE" not in files[AIR]
    assert re.search(r"///RCONF (\d,){23}\d\r\nC00000=", files[AIR])
    assert "joint-targets" in found_codes(program, "warning", BY_TYPE)
    assert "joint-targets" not in found_codes(program)


def test_positions_are_rx_then_ry_then_rz_about_fixed_axes(program):
    """The orientation of a position, turned together by hand from its text."""
    row = re.search(r"C00000=(.*)", golden[PATH])[1]
    x, y, z = np.radians([float(value) for value in row.split(",")[3:]])
    Rx = [[1, 0, 0], [0, np.cos(x), -np.sin(x)], [0, np.sin(x), np.cos(x)]]
    Ry = [[np.cos(y), 0, np.sin(y)], [0, 1, 0], [-np.sin(y), 0, np.cos(y)]]
    Rz = [[np.cos(z), -np.sin(z), 0], [np.sin(z), np.cos(z), 0], [0, 0, 1]]
    expected = program.moves[1].T_part_tip[:3, :3]
    np.testing.assert_allclose(np.array(Rz) @ Ry @ Rx, expected, atol=3e-6)  # four decimals of deg


def test_outputs_are_switched_and_waits_begin_only_where_the_robot_stands():
    stands = False
    for row in golden[PATH].split("\r\n"):
        stands = row.endswith("PL=0") or (stands and not row.startswith("MOV"))
        assert stands or not row.startswith(("DOUT", "TIMER"))


def test_arcs_are_three_movc_and_parted_from_each_other(program):
    files, _ = reads_back(arced(program, [3, 5]))
    words = re.findall(r"^(MOV.) (C\d+)", files[PATH], re.MULTILINE)
    assert [word for word, _ in words[2:9]] == ["MOVC"] * 3 + ["MOVL"] + ["MOVC"] * 3
    assert words[5][1] == words[6][1]
    first, _ = reads_back(arced(program, [1]))
    assert "MOVC C00000" in first[PATH], "an arc may begin a job"


def test_jobs_are_called_in_order_by_names_as_short_as_asked_for(cell):
    names = ("skin/outer", "skin outer", "7. Bohrung ø12", "hole" * 12)
    program = build_program([hand_plan(arc(name), *cell) for name in names], name="B-pillar 4711")
    files, _ = reads_back(program)
    calls = re.findall(r"CALL JOB:(\w+)", files["B_PILLAR_4711.JBI"])
    assert calls[:3] == ["B_PILLAR_4711_OFF", "SKIN_OUTER_AIR", "SKIN_OUTER"]
    assert calls[3:5] == ["SKIN_OUTER_2_AIR", "SKIN_OUTER_2"]
    assert max(map(len, calls)) == 32
    files, _ = reads_back(program, IN_PULSES.model_copy(update={"longest_name": 8}))
    assert {len(name) for name in files} == {12}


def test_older_controllers_have_fewer_values_of_rconf(program):
    files, _ = reads_back(program, IN_PULSES.model_copy(update={"rconf_values": 6}))
    assert re.search(r"///RCONF (\d,){5}\d\r\n", files[PATH])


# What INFORM cannot say.


def test_a_lead_time_is_left_out_and_said(program):
    assert found_codes(program, "warning") == ["lead-time", "air-moves"]
    assert found_codes(build_program([CASE.small], lead_time=0.0)) == ["air-moves"]


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
def test_types_follow_the_posture_in_all_eight_postures(number):
    """By both rules of flip, and by the turns of R, T and S."""
    made = CASE.in_posture(number)
    program = build_program([made], lead_time=0.0)
    for options in (IN_PULSES, BY_TYPE, BY_TYPE.model_copy(update={"flip": "R"})):
        _, read = reads_back(program, options)
        cut = [move.posture for move in read.moves if move.kind == "linear"]
        q = np.array([move.q for move in program.moves[1:]])
        r, b, t, s = (np.degrees(axes_from_joints(made.robot, q))[:, k] for k in (3, 4, 5, 0))
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
    with pytest.raises(InputError, match="but lines_per_file allows 100; raise it"):
        Inform(many, IN_PULSES.model_copy(update={"lines_per_file": 100})).files()


# Settings and preflight.


@pytest.mark.parametrize("pulses", [[1.0] * 5, [0.0, 1, 1, 1, 1, 1], [float("nan")] * 6, "1"])
def test_pulses_are_six_numbers_that_are_not_zero(pulses):
    with pytest.raises(ValidationError):
        InformSettings(pulses_per_deg=pulses)


def test_preflight_refuses_a_speed_beyond_that_of_the_settings(program):
    slow = IN_PULSES.model_copy(update={"fastest_mm_s": 110.0})
    assert set(found_codes(program, "error", slow)) == {"speed"}


# The reader.


@pytest.mark.parametrize(
    ("file", "old", "new", "message"),
    [
        (MAIN, "//NAME CUT_SKIN_OUTER", "//NAME OTHER", "line 2: expected '//NAME CUT_SKIN_OUTER'"),
        (MAIN, "///NPOS 0,", "///NPOS 1,", "line 4: the main job must have no positions"),
        (MAIN, "NOP", "NOP\r\nPAUSE", "line 10: not expected here: 'PAUSE'"),
        (MAIN, "'UFRAME 1 X", "'UFRAME 2 X", "UFRAME 1 is not complete"),
        (MAIN, "'UFRAME 1 Y", "'UFRAME 1 X", "UFRAME 1 X is given twice"),
        (MAIN, "'TOOL 0 RZ", "' TOOL 0 RZ", "TOOL 0 is not complete"),
        (OFF, "DOUT OT#(1) OFF", "DOUT OT#(1) ON", "expected 'DOUT OT#(1) OFF'"),
        (OFF, "DOUT OT#(1) OFF", "DOUT OT#(3) OFF", "expected 'DOUT OT#(1) OFF'"),
        (OFF, "DOUT OT#(2) OFF\r\n", "", "'DOUT OT#(2) OFF' is missing"),
        (MAIN, "CALL JOB:CUT_SKIN_OUTER_OFF\r\n", "", "expected CUT_SKIN_OUTER_OFF to be called"),
        (MAIN, "CALL JOB:SKIN_OUTER\r\n", "CALL JOB:SKIN_OUTER_AIR\r\n", "is called twice"),
        (MAIN, "END\r\n", "END\r\nNOP", "nothing may follow END"),
        (MAIN, "END\r\n", "", "the job ends too early; END is missing"),
        (MAIN, "CALL JOB:SKIN_OUTER\r\n", "CALL JOB:HOLE\r\n", "the file 'HOLE.JBI' is missing"),
        (AIR, "///NPOS 1,", "///NPOS 2,", "expected position C00001, got '//INST'"),
        (AIR, "///NPOS 1,", "///NPOS x,", "line 4: expected the number of positions"),
        (AIR, "///TOOL 0", "///TOOL 1", "line 5: expected '///TOOL 0', got '///TOOL 1'"),
        (AIR, "C00000=", "C00001=", "expected position C00000"),
        (AIR, "SC,RW", "SC,RW,RJ", "expected '///ATTR SC,RW'"),
        (AIR, "VJ=10.00", "VJ=10,0", "not expected here: 'MOVJ"),
        (AIR, "MOVJ C00000", "MOVJ C00001", "C00001 is missing"),
        (AIR, "MOVJ C00000 VJ=10.00", "MOVL C00000 V=10.0", "needs a position in the user frame"),
        (AIR, "PL=0", "PL=2", "expected PL=0 or PL=1, got PL=2"),
        (PATH, "///RCONF 1", "///RCONF 2", "expected position C00000"),
        (PATH, "///RCONF 1,", "///RCONF ", "expected 6, 8, 24 values, 0 from the seventh on"),
        (PATH, ",0\r\nC00000", ",1\r\nC00000", "expected 6, 8, 24 values, 0 from the seventh on"),
        (PATH, "////FRAME USER 1", "////FRAME USER 2", "expected '////FRAME USER 1'"),
        (PATH, "///USER 1", "///USER 2", "line 5: expected '///USER 1'"),
        (PATH, "PL=0\r\nDOUT", "PL=1\r\nDOUT", "a switch must follow a move of the path with PL=0"),
        (PATH, "TIMER T=0.40", "TIMER T=0.40\r\nDOUT OT#(1) ON", "a switch must follow a move"),
        (PATH, "MOVL C00001 V=120.0 PL=1", "MOVL C00001 V=120.0 PL=1\r\nTIMER T=0.10",
         "a wait must follow a move with PL=0"),
        (PATH, "MOVL C00002", "MOVC C00002", "an arc must begin where the move before it ends"),
        (PATH, "MOVL C00002", "MOVC C00001 V=120.0\r\nMOVL C00002", "an arc needs three MOVC"),
        (PATH, "MOVL C00002", "MOVC C00001 V=120.0 PL=1\r\nMOVL C00002", "at its third MOVC"),
        (PATH, "MOVL C00002 V=120.0 PL=1", "MOVL C00002 V=120.0", "an arc must begin where"),
        (PATH, "MOVL C00002", "MOVS C00002", "not expected here: 'MOVS"),
        (PATH, "END", "JUMP *A\r\nEND", "not expected here: 'JUMP *A'"),
    ],
)  # fmt: skip
def test_the_reader_refuses_what_it_does_not_know(file, old, new, message):
    CASE.refuses(file, old, new, message)


def test_pulses_cannot_be_read_without_those_of_the_robot():
    with pytest.raises(InputError, match=r"SKIN_OUTER_AIR.JBI, line \d+: .*give pulses_per_deg"):
        CASE.read(golden, settings=BY_TYPE)


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
        (AIR, "VJ=10.00", "VJ=35.00"),
        (AIR, "C00000=", "C00000=1"),
        (MAIN, "'TOOL 0 X 51.3000", "'TOOL 0 X 51.4000"),
    ],
)
def test_an_edited_program_is_read_as_edited(file, old, new):
    CASE.finds(file, old, new)
