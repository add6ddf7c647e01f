"""KUKA KRL: what is written, how it reads back, and what is refused."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from tests.post.cases import CASES

from conftest import rebuilt
from kerfpath import Contour, InputError, plan, robot
from kerfpath.post import (
    build_program,
    post,
)
from kerfpath.post.krl import (
    Krl,
    KrlSettings,
    axes_from_joints,
    joints_from_axes,
    status_and_turn,
)
from programs import arc, arced, changed, edited, frames, hand_plan, with_steps

CASE = CASES["krl"]
OUTPUTS, golden, reads_back, found_codes = CASE.settings, CASE.golden, CASE.reads_back, CASE.codes


@pytest.fixture(scope="module")
def arm(cell):
    return cell[0]


# The text.


def test_positions_are_a_about_z_then_b_about_y_then_c_about_x(program):
    """The orientation of a LIN, turned together by hand from its text."""
    text = golden["cut_skin_outer.src"]
    fields = re.search(r"LIN \{X .*?A (.*?),B (.*?),C (.*?),", text).groups()
    a, b, c = (np.radians(float(field)) for field in fields)
    Rz = [[np.cos(a), -np.sin(a), 0], [np.sin(a), np.cos(a), 0], [0, 0, 1]]
    Ry = [[np.cos(b), 0, np.sin(b)], [0, 1, 0], [-np.sin(b), 0, np.cos(b)]]
    Rx = [[1, 0, 0], [0, np.cos(c), -np.sin(c)], [0, np.sin(c), np.cos(c)]]
    expected = program.moves[1].T_part_tip[:3, :3]
    np.testing.assert_allclose(np.array(Rz) @ Ry @ Rx, expected, atol=1e-7)  # six decimals of deg


def test_speed_and_zone_are_written_only_where_they_change(arm):
    made = hand_plan(arc(count=30), arm, *frames(), speed=0.12)
    text = post(build_program([made], zone=3e-4), "krl", OUTPUTS)["cut_skin_outer.src"]
    assert text.count("$VEL.CP=") == 3  # to the start, cut, back
    assert text.count("$APO.CDIS=") == 1
    assert text.count(" C_DIS") == 28  # all nodes but the first and the last


def test_tool_and_base_by_number_leave_the_frames_to_the_controller(program):
    numbered = KrlSettings(laser_output=5, gas_output=6, tool_number=3, base_number=12)
    files, read = reads_back(program, numbered)
    text = files["cut_skin_outer.src"]
    assert "BAS(#TOOL,3)\r\nBAS(#BASE,12)" in text
    assert "$TOOL" not in text
    assert "$BASE" not in text
    assert read.T_flange_tip is None
    assert read.T_base_part is None


def test_a_cut_straight_down_with_the_beam_ahead_reads_back(arm):
    """B is 90 deg there, so that A and C turn about the same axis: C is 0."""
    points = np.c_[np.zeros(8), np.zeros(8), np.linspace(0, -0.1, 8)]
    contour = Contour(points, np.tile([1.0, 0.0, 0.0], (8, 1)), name="skin/outer")
    placement, tool = np.eye(4), np.eye(4)
    placement[:3, 3] = 1.2, 0.1, 1.2
    tool[2, 3] = 0.2
    files, _ = reads_back(build_program([hand_plan(contour, arm, tool, placement)]))
    assert files["cut_skin_outer.src"].count(",B 90.000000,C 0.000000,S 2,") == 9


def test_arcs_are_written_as_circ(program):
    files, _ = reads_back(arced(program, [3]))
    assert re.search(r"CIRC \{X [^}ST]*\},\{X [^}]*,S 2,T \d+\} C_DIS", files["cut_skin_outer.src"])


# Axes, Status and Turn.


def test_the_home_of_the_manuals_has_status_and_turn_2(arm):
    home = np.radians([[0.0, -90, 90, 0, 0, 0]])
    assert status_and_turn(arm, joints_from_axes(arm, home)).tolist() == [[2, 2]]
    T = arm.forward(joints_from_axes(arm, home))[0]
    np.testing.assert_allclose(T[:3, :3] @ [0, 0, 1], [1, 0, 0], atol=1e-12)


def test_positive_a1_and_a6_turn_clockwise_seen_against_their_axes(arm):
    home = np.radians([0.0, -90, 90, 0, 0, 0])
    T = arm.forward(joints_from_axes(arm, home + np.radians(90) * np.eye(6)[[0, 5]]))
    np.testing.assert_allclose(T[0, :3, 2], [0, -1, 0], atol=1e-12)
    np.testing.assert_allclose(T[1, :3, 0], [0, -1, 0], atol=1e-12)  # it pointed down before


@pytest.mark.parametrize("posture", range(8))
def test_turn_has_a_bit_for_each_negative_axis_in_all_eight_postures(posture):
    made = CASE.in_posture(posture)
    _, read = reads_back(build_program([made], zone=3e-4))
    cut = [move for move in read.moves if move.kind == "linear"][:-1]
    assert [move.posture[1] for move in cut] == [
        sum(1 << i for i, joint in enumerate(q) if joint < 0)
        for q in made.q[0] + np.vstack([np.zeros(6), np.cumsum(made.increments, axis=0)])
    ]


@settings(max_examples=60, deadline=None)
@given(st.lists(st.floats(-1, 1), min_size=6, max_size=6))
def test_status_bits_agree_with_a_construction_from_points(share):
    """The lower arm's line and axis 1 drawn as points, on an arm with 145 mm at the elbow."""
    arm = robot("kuka_kr60_ha")
    q = (arm.lower + arm.upper) / 2 + np.array(share) * (arm.upper - arm.lower) / 2
    a1, c1, c2, c4 = (arm.geometry[k] for k in ("a1", "c1", "c2", "c4"))
    flange = arm.forward(q)
    wrist = flange[:3, 3] - c4 * flange[:3, 2]
    ahead = np.array([np.cos(q[0]), -np.sin(q[0]), 0.0])  # A1 turns clockwise
    shoulder = a1 * ahead + [0, 0, c1]
    lower = c2 * (np.cos(q[1]) * ahead - [0, 0, np.sin(q[1])])  # A2 = -90 deg: upright
    left = np.array([np.sin(q[0]), np.cos(q[0]), 0.0])
    side = np.cross(lower, wrist - shoulder) @ left  # positive: bent forward, nose down
    if min(abs(side), abs(wrist @ ahead), abs(np.degrees(q[4]))) < 1e-5:
        return
    expected = (wrist @ ahead < 0) + 2 * (side > 0) + 4 * (q[4] < 0)
    assert status_and_turn(arm, [q])[0, 0] == expected


def test_the_elbow_bit_turns_over_at_the_stretched_arm():
    """KR 60 HA with 820 mm and 145 mm: stretched at A3 = 10.03 deg."""
    arm = robot("kuka_kr60_ha")
    q = np.zeros((4, 6))
    q[:, 2] = np.radians([-60, 9.9, 10.2, 90])
    np.testing.assert_array_equal(status_and_turn(arm, q)[:, 0] & 2, [0, 0, 2, 2])


def test_turn_ignores_rounding_and_counts_endless_axes_once(arm):
    q = np.radians([[-1e-12, 0, 0, 0, -1e-12, 190], [0, 0, 0, 0, 0, -190], [0, 0, 0, 0, 0, 720]])
    np.testing.assert_array_equal(status_and_turn(arm, q)[:, 1], [0, 32, 0])
    endless = arm.with_limits(endless=np.arange(6) == 5)
    np.testing.assert_array_equal(status_and_turn(endless, q)[:, 1], [32, 0, 0])


def test_a_planned_circle_with_an_endless_axis_reads_back(circle, arm, tool, placement):
    endless = arm.with_limits(endless=np.arange(6) == 5, acceleration=np.full(6, 50.0))
    made = plan(
        circle, endless, tool=tool, placement=placement, speed=0.1, gamma_step=np.radians(10)
    )
    program = build_program([made], zone=3e-4)
    assert found_codes(program) == ["air-moves"]
    reads_back(program)


# Long programs.


@pytest.fixture(scope="module")
def long(arm):
    plans = [
        hand_plan(arc(name, count=count), arm, *frames())
        for name, count in (("a contour with a long name", 400), ("hole", 20), ("Hole", 30))
    ]
    return build_program(plans, name="a program with a very long name", gas_lead=0.3)


def test_long_programs_become_files_that_the_main_program_calls(long):
    tight = OUTPUTS.model_copy(update={"lines_per_file": 100})
    files, read = reads_back(long, tight)
    names = [name for name, _ in Krl(long, tight).names()]
    assert max(len(name) for name in names) == 24
    assert len({name.lower() for name in names}) == len(names)
    main = next(iter(files))
    assert main == "a_program_with_a_very_lo.src"
    assert "LIN" not in files[main]
    for name in files:
        if name.endswith(".src") and name != main:
            assert name.removesuffix(".src") in names
            assert f"EXT {name.removesuffix('.src')}(INT :IN)" in files[f"{main[:-4]}.dat"]
    # No contour is divided: longer than a file, it is the only one of its own, and is warned of.
    assert [s.name for s in read.sections] == [s.name for s in Krl(long, tight).program.sections]
    assert all(s.moves[0].kind == "joint" for s in read.sections)
    found = found_codes(long, "warning", tight)
    assert found.count("file-length") == sum(len(s.steps) > 100 for s in long.sections) > 0


def test_a_program_that_fits_is_one_file(long):
    files, _ = reads_back(long)
    assert list(files) == ["a_program_with_a_very_lo.src", "a_program_with_a_very_lo.dat"]


def test_more_files_than_a_main_program_can_call_are_refused(program):
    (section,) = program.sections
    many = replace(program, sections=tuple(replace(section, name=f"c{k}") for k in range(300)))
    with pytest.raises(InputError, match="can call; raise lines_per_file"):
        Krl(many, OUTPUTS.model_copy(update={"lines_per_file": 100}))


# Settings and preflight.


def test_preflight_refuses_a_speed_beyond_that_of_the_machine_data(program):
    slow = OUTPUTS.model_copy(update={"largest_speed_m_s": 0.11})
    assert set(found_codes(program, "error", slow)) == {"speed"}


def test_preflight_refuses_frames_that_are_not_the_controllers(program, arm):
    turned = np.eye(4)
    turned[:3, :3] = Rotation.from_euler("z", 90, degrees=True).as_matrix()
    for other in (rebuilt(arm, T_end_flange=turned), rebuilt(arm, T_base_foot=turned)):
        issues = list(CASE.language.check(replace(program, robot=other), OUTPUTS))
        assert [(i.level, i.code) for i in issues] == [("error", "frames")]
        assert "[1173.0, 0.0, 1650.0] mm" in issues[0].message


def test_preflight_refuses_axes_beyond_a_turn_that_are_not_endless(program):
    arm = program.robot.with_limits(upper=np.full(6, 9.0), lower=np.full(6, -9.0))
    turned = [
        replace(s, q=s.q + 5.0 * np.eye(6)[3]) if hasattr(s, "q") else s
        for s in program.sections[0].steps
    ]
    far = with_steps(replace(program, robot=arm), turned)
    assert set(found_codes(far, "error")) == set()
    farther = [replace(s, q=s.q + 2.0 * np.eye(6)[3]) if hasattr(s, "q") else s for s in turned]
    assert set(found_codes(with_steps(far, farther), "error")) == {"turn"}


def test_preflight_tells_where_an_endless_axis_would_turn_the_short_way(program):
    arm = program.robot.with_limits(endless=np.arange(6) == 5)
    steps = program.sections[0].steps
    back = replace(steps[1], q=steps[-1].q - np.radians(200) * np.eye(6)[5])
    program = with_steps(replace(program, robot=arm), [*steps, back])
    assert found_codes(program, "warning") == ["short-way", "air-moves"]
    assert found_codes(replace(program, air_checked=True), "error") == ["short-way"]


def test_preflight_refuses_a_joint_move_that_rounds_its_corner(program):
    assert found_codes(changed(program, 1, zone=0.01), "error") == ["zone"]


# The reader.


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("&ACCESS RVP\r\n", "$OUT[5]=TRUE\r\n", "cut_skin_outer.src, line 1: not expected here"),
        ("DEF cut_skin_outer()", "DEF other()", "line 3: the first routine must have the name"),
        ("END\r\n\r\nDEF", "END\r\n\r\nHALT\r\nDEF", "not expected here: 'HALT'"),
        ("BAS(#INITMOV,0)\r\n", "", "line 13: not expected here: '$OV_PRO=100'"),
        (
            "INTERRUPT ON 20\r\n",
            "INTERRUPT ON 20\r\n$BASE={X 0,Y 0,Z 0,A 0,B 0,C 0}\r\n",
            "expected BAS(#INITMOV,0) before this line",
        ),
        (
            "DEF switch_off()\r\n$OUT[5]=FALSE\r\n",
            "DEF switch_off()\r\n",
            "expected '$OUT[5]=FALSE'",
        ),
        ("INTERRUPT ON 20\r\n", "", "not expected here: 'BAS(#INITMOV,0)'"),
        ("first_contour=1\r\n", "", "expected first_contour=1 before"),
        ("first_contour<=1", "first_contour<=2", "called for contours up to 2, not 1"),
        ("IF first_contour<=1 THEN\r\n", "", "must be called alone under a condition"),
        ("ENDIF\r\n", "", "must be set once, after all calls"),
        ("$ADVANCE=5", "$ADVANCE=3", "line 16: not expected here"),
        ("$CIRC_TYPE=#BASE", "$CIRC_TYPE=#PATH", "not expected here"),
        ("$TOOL={", "; $TOOL={", "expected $TOOL before"),
        ("$BASE={", "$TOOL={", "expected no tool here"),
        ("$BASE={X", "$BASE={FRAME: X", "not expected here"),
        ("IF first_contour<=1 THEN\r\nskin_outer()\r\nENDIF\r\n", "", "set once, after all calls"),
        ("skin_outer()\r\nEND", "skin_outer()\r\nskin_outer()\r\nEND", "called twice"),
        (
            "first_contour=1\r\n",
            "IF first_contour<=2 THEN\r\nhole()\r\nENDIF\r\nfirst_contour=1\r\n",
            "dat, line 5: expected 'EXT hole(INT :IN)'",
        ),
        ("$VEL.CP=0.100000\r\n", "", "$VEL.CP has not been set in this routine"),
        ("$APO.CDIS=0.300\r\n", "", "$APO.CDIS has not been set"),
        ("BAS(#VEL_PTP,10)\r\n", "", "BAS(#VEL_PTP,...) has not been set"),
        ("DO $OUT[5]=TRUE", "DO $OUT[7]=TRUE", "expected the output 5 to be switched, got 7"),
        ("DELAY=-20", "DELAY=20", "must not have a positive DELAY"),
        ("=TRUE\r\nLIN", "=TRUE\r\nWAIT SEC 1.0\r\nLIN", "must come right before its motion"),
        ("PATH=0", "PATH=-5", "not expected here: 'TRIGGER WHEN PATH=-5"),
        ("} C_DIS", "} C_ORI", "not expected here: 'LIN"),
        ("LIN {X", "LIN_REL {X", "not expected here"),
        ("PTP {A1", "PTP {X 0,A1", "not expected here"),
        ("WAIT SEC 0.400", "WAIT FOR $IN[1]", "not expected here"),
        ("WAIT SEC 0.400", "$OUT[5]=TRUE", "no partner with the output 5"),
        ("\r\nEND\r\n\r\nDEF skin", "\r\n\r\nDEF skin", "expected 'END'"),
    ],
)
def test_the_reader_refuses_what_it_does_not_know(old, new, message):
    CASE.refuses("cut_skin_outer.src", old, new, message)


def test_the_reader_refuses_what_ends_too_early():
    short = golden["cut_skin_outer.src"].rpartition("END")[0]
    with pytest.raises(InputError, match="END is missing"):
        CASE.read(golden | {"cut_skin_outer.src": short})


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("DEFDAT cut_skin_outer", "DEFDAT other", "line 3: expected 'DEFDAT cut_skin_outer'"),
        ("ENDDAT", "EXT other()\r\nENDDAT", "line 6: expected 'ENDDAT'"),
        ("INT first_contour=1\r\n", "", "line 5: expected 'INT first_contour=0'"),
        ("ENDDAT", "ENDDAT\r\nDECL INT x=1", "line 7: nothing may follow ENDDAT"),
        ("ENDDAT", "", "line 6: expected 'ENDDAT'"),
    ],
)
def test_the_reader_refuses_another_dat(old, new, message):
    CASE.refuses("cut_skin_outer.dat", old, new, f"cut_skin_outer.dat, {message}")


def test_a_program_begins_at_the_contour_that_its_dat_names(long):
    files = post(long, "krl", OUTPUTS)
    data = "a_program_with_a_very_lo.dat"
    begun = edited(files, data, "first_contour=1", "first_contour=2")
    names = [s.name for s in CASE.read(files).sections]
    assert [s.name for s in CASE.read(begun).sections] == names[1:]
    for wrong in ("0", "4"):
        with pytest.raises(InputError, match=f"must be the number of a contour, got {wrong}"):
            CASE.read(edited(files, data, "first_contour=1", f"first_contour={wrong}"))


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("S 2,T 35", "S 6,T 35"),
        ("$VEL.CP=0.12", "$VEL.CP=0.13"),
        ("A6 -81.5", "A6 -82.5"),
        ("Y 17.3041", "Y 17.4041"),
        ("DELAY=-300", "DELAY=-200"),
    ],
)
def test_an_edited_program_is_read_as_edited(old, new):
    CASE.finds("cut_skin_outer.src", old, new)


def test_all_shipped_kuka_arms_count_joints_as_the_controller_does():
    library = Path("src/kerfpath/robots/library").glob("kuka_*.toml")
    names = [path.stem for path in library if robot(path.stem).joints == 6]
    assert len(names) > 5
    q = np.radians([[10.0, -80, 70, 20, 30, 40]])
    for name in names:
        np.testing.assert_allclose(axes_from_joints(robot(name), q), q, atol=1e-14)
