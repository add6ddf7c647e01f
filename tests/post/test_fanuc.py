"""FANUC TP: the listings, the reader that checks them, and the controller's own measurements."""

import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from tests.post.cases import CASES

from conftest import rebuilt
from kerfpath import InputError, robot
from kerfpath.contour import KINDS
from kerfpath.post import (
    JointMove,
    LinearMove,
    ReadWait,
    Switch,
    build_program,
    post,
)
from kerfpath.post.arcs import euler, world
from kerfpath.post.fanuc import FanucSettings, axes_from_joints, joints_from_axes, posture
from kerfpath.robots import robot_ids
from programs import arc, arced, changed, codes, hand_plan, with_steps

CASE = CASES["fanuc"]
OPTIONS, golden = CASE.settings, CASE.golden
MAIN, CONTOUR, OFF = golden
ARMS = [name for name in robot_ids() if name.startswith("fanuc")]
REACH = np.array([6.0, 6.0, 6.0, 6.0, 6.0, 99.0])
WIDE = {"lower": -REACH, "upper": REACH}

MEASURED = """
      0   0   0    0 -90    0  N U T 0  0  0   965.000    0.000  965.000  -180   0    0
      0   0   0    0  90    0  F U T 0  0  0   965.000    0.000 1145.000     0   0 -180
      0   0   0    0 -30    0  N U T 0  0  0  1042.942    0.000 1010.000   180 -60    0
      0   0   0    0  30    0  F U T 0  0  0  1042.942    0.000 1100.000     0 -60  180
      0   0   0  185 -90    0  N U T 0  1  0   965.000    7.844 1144.657    -5   0    0
      0   0   0 -185 -90    0  N U T 0 -1  0   965.000   -7.844 1144.657     5   0    0
      0   0   0    0 -90  190  N U T 0  0  1   965.000    0.000  965.000   180   0 -170
      0   0   0    0 -90 -190  N U T 0  0 -1   965.000    0.000  965.000  -180   0  170
      0   0   0    0 -90  350  N U T 0  0  1   965.000    0.000  965.000   180   0  -10
      0  40  60    0 -90    0  N D T 0  0  0   951.688    0.000 1476.740   180 -60    0
      0  40 -60    0 -90    0  N U T 0  0  0  1168.195    0.000  -64.785  -180  60    0
      0 -60 -80    0 -90    0  N D B 0  0  0  -374.813    0.000 -434.773  -180  80    0
      0 -60  80    0 -90    0  N U B 0  0  0  -621.015    0.000 1318.185   180 -80    0
      0  60  80    0 -90    0  N D T 0  0  0   833.907    0.000 1318.185   180 -80    0
     90   0   0    0 -90    0  N U T 0  0  0     0.000  965.000  965.000  -180   0   90
   -150   0   0    0 -90    0  N U T 0  0  0  -835.714 -482.500  965.000  -180   0 -150
"""
"""Axes (deg), configuration, X Y Z (mm) and W P R (deg) of an M-20iD/25 on FANUC's simulated
controller, measured by others: source in kerfpath.post.fanuc.controller."""


def read(program, options=OPTIONS):
    """What the listings of a program say; post() has compared them with it."""
    return CASE.read(CASE.post(program, options), program.robot, options)


# The controller's conventions.


def test_axes_configurations_and_frames_are_those_measured_on_a_controller():
    rows = [row.split() for row in MEASURED.strip().splitlines()]
    axes_deg = np.array([row[:6] for row in rows], float)
    arm = robot("fanuc_m20id_25")
    q = joints_from_axes(arm, np.radians(axes_deg))
    np.testing.assert_allclose(np.degrees(axes_from_joints(arm, q)), axes_deg, atol=1e-9)
    expected = [(*row[6:9], *map(int, row[9:12])) for row in rows]
    assert posture(arm, q, OPTIONS) == expected
    T = np.linalg.inv(world(arm)) @ arm.forward(q)
    said = np.array([row[12:] for row in rows], float)
    np.testing.assert_allclose(T[:, :3, 3] * 1e3, said[:, :3], atol=6e-4)  # printed digits
    turned = Rotation.from_euler("xyz", said[:, 3:], degrees=True)
    back = (turned.inv() * Rotation.from_matrix(T[:, :3, :3])).magnitude()
    assert np.degrees(back).max() < 1e-6


@pytest.mark.parametrize("name", ARMS)
def test_every_arm_of_the_library_measures_joint_3_from_the_horizontal(name):
    """J2 upright and the other five axes are the library's joints; J3 is joint 3 - joint 2."""
    arm = robot(name)
    q = np.random.default_rng(4).uniform(-7, 7, (20, 6))
    axes = axes_from_joints(arm, q)
    expected = q.copy()
    expected[:, 2] -= q[:, 1]
    np.testing.assert_allclose(axes, expected, atol=1e-12)
    np.testing.assert_allclose(joints_from_axes(arm, axes), q, atol=1e-12)
    origin = arm.frames["controller_base_xyz_m"]
    np.testing.assert_allclose(world(arm)[:3, 3], origin, atol=1e-12)
    upper = arm.with_limits(**WIDE)
    raised = upper.forward(joints_from_axes(arm, np.radians([[0, 20, 30, 0, 0, 0]])))[0]
    np.testing.assert_allclose(raised[:3, 2], [np.cos(np.pi / 6), 0, 0.5], atol=1e-12)


@settings(max_examples=60, deadline=None)
@given(st.lists(st.floats(-6, 6), min_size=6, max_size=6))
def test_configurations_agree_with_a_construction_from_points(axes):
    """The lower arm's line and axis 1 drawn as points; the turns counted by subtraction."""
    arm = robot("fanuc_m20id_25")
    q = joints_from_axes(arm, [axes])
    flange = arm.forward(q)[0]
    a1, c1, c2, c4 = (arm.geometry[k] for k in ("a1", "c1", "c2", "c4"))
    wrist = flange[:3, 3] - c4 * flange[:3, 2]
    ahead = np.array([np.cos(axes[0]), np.sin(axes[0]), 0.0])
    shoulder = a1 * ahead + [0, 0, c1]
    lower = c2 * (np.sin(axes[1]) * ahead + [0, 0, np.cos(axes[1])])
    side = np.cross(lower, wrist - shoulder) @ [-ahead[1], ahead[0], 0.0]
    reach = wrist @ ahead
    assume(min(abs(side), abs(reach), abs(np.sin(axes[4]))) > 1e-5)
    expected = ["NF"[int(np.sin(axes[4]) > 0)], "UD"[int(side < 0)], "TB"[int(reach < 0)]]
    for k in (0, 3, 5):
        turn, rest = 0, np.degrees(axes[k])
        assume(abs(abs(rest) % 360 - 180) > 1e-4)
        while abs(rest) > 180:
            turn, rest = turn + int(np.sign(rest)), rest - 360 * np.sign(rest)
        expected.append(turn)
    assert posture(arm, q, OPTIONS) == [tuple(expected)]


def test_turns_begin_at_half_a_turn_and_the_axes_counted_are_a_setting():
    arm = robot("fanuc_m20id_25")
    axes = np.zeros((6, 6))
    axes[:, 5] = np.radians([179.9, 180, 539.9, 540, -180, -540])
    axes[:, 4] = np.radians(400)
    q = joints_from_axes(arm, axes)
    assert [words[5] for words in posture(arm, q, OPTIONS)] == [0, 1, 1, 2, -1, -2]
    other = posture(arm, q, FanucSettings(laser_output=1, turns="J4 J5 J6"))
    assert [words[3:] for words in other] == [(0, 1, n) for n in (0, 1, 1, 2, -1, -2)]


@pytest.mark.parametrize("more", [-2, -1, 1, 2])
def test_turns_of_axis_6_are_written_and_read(program, more):
    shift = 2 * np.pi * more * np.eye(6)[5]
    steps = [
        replace(step, q=step.q + shift) if isinstance(step, JointMove | LinearMove) else step
        for step in program.sections[0].steps
    ]
    wide = replace(program, robot=program.robot.with_limits(**WIDE))
    before, after = read(program).moves, read(with_steps(wide, steps)).moves
    np.testing.assert_allclose(after[0].q - before[0].q, shift, atol=1e-9)
    assert [m.posture[5] for m in after[1:]] == [m.posture[5] + more for m in before[1:]]


def test_x_y_z_w_p_r_turn_about_fixed_axes_one_after_the_other():
    T = np.eye(4)[None].copy()
    w, p, r = np.radians([20, -35, 110])
    about = {axis: Rotation.from_rotvec(angle * np.eye(3)["xyz".index(axis)]).as_matrix()
             for axis, angle in (("x", w), ("y", p), ("z", r))}  # fmt: skip
    T[0, :3, :3] = about["z"] @ about["y"] @ about["x"]
    np.testing.assert_allclose(euler(T, "xyz")[0, 3:], [20, -35, 110], atol=1e-12)
    T[0, :3, :3] = Rotation.from_euler("xyz", [30, 90, 0], degrees=True).as_matrix()
    back = Rotation.from_euler("xyz", euler(T, "xyz")[0, 3:], degrees=True).as_matrix()
    np.testing.assert_allclose(back, T[0, :3, :3], atol=1e-9)  # at the lock, the same rotation


# The text.


def test_listings_are_numbered_counted_and_short():
    for name, text in golden.items():
        rows = text.split("\r\n")
        assert rows[0] == f"/PROG  {name.removesuffix('.ls')}"
        assert rows[-2:] == ["/END", ""]
        assert all(re.fullmatch(r"[\t -~]*", row) for row in rows)
        body = rows[rows.index("/MN") + 1 : rows.index("/POS")]
        assert [int(row[:4]) for row in body] == list(range(1, len(body) + 1))
        assert f"LINE_COUNT\t= {len(body)};" in rows
        remarks = [row for row in body if "!" in row]
        assert max(len(row[8:-2]) for row in remarks) <= 32
        used = set(re.findall(r"P\[\d+\]", "".join(body)))
        assert used == {row[:-1] for row in rows if row.startswith("P[")}


# The law: what is read back is what was planned.


def test_the_golden_listings_read_back_as_planned(program):
    back, small = CASE.read(golden), CASE.small
    T = back.T_base_part @ np.array([move.T_part_tip for move in back.moves[1:-1]])
    planned = small.robot.forward(small.q) @ small.T_flange_tip
    np.testing.assert_allclose(T, planned, atol=2e-6)  # 1e-3 mm, 1e-4 deg
    assert [move.zone for move in back.moves] == [0.0, 0.0, *[None] * 6, 0.0, 0.0]
    switched = [(k, move.switches) for k, move in enumerate(back.moves) if move.switches]
    assert switched == [
        (1, (Switch(signal="laser", on=True, lead_time=0.02),)),
        (8, (Switch(signal="laser", on=False, lead_time=0.02),)),
    ]


def test_frames_are_given_in_the_controllers_world(program):
    """A flange of its own and a foot turned and raised change what is to be entered."""
    foot, flange = np.eye(4), np.eye(4)
    foot[:3, :3] = Rotation.from_euler("z", 90, degrees=True).as_matrix()
    foot[:3, 3], flange[:3, 3] = (1, 2, 3), (0, 0, 0.01)
    arm = rebuilt(program.robot, T_base_foot=foot, T_end_flange=flange, chain=None)
    moved = replace(program, robot=arm, T_base_part=foot @ program.T_base_part)
    tool = np.linalg.inv(flange) @ program.T_flange_tip
    moved = replace(moved, T_flange_tip=tool)
    assert post(moved, "fanuc", OPTIONS) == post(program, "fanuc", OPTIONS)


def test_several_contours_gas_waits_and_micro_joints(cell):
    contour = replace(
        arc(), kind=np.array([KINDS.index(k) for k in ["cut", "cut", "cut", "micro joint",
                                                      "micro joint", "cut", "cut", "cut"]])
    )  # fmt: skip
    plans = [hand_plan(replace(contour, name=name), *cell) for name in ("Loch ø8", "2. hole")]
    program = build_program(plans, gas_lead=0.3, pierce_time=0.4, name="Teil 4711")
    assert codes(program, "error", "fanuc", OPTIONS) == ["output"]
    options = FanucSettings(gas_output=7, laser_output=3, user_frame=4, tool_frame=5)
    files = post(program, "fanuc", options)
    assert list(files) == ["TEIL_4711.ls", "LOCH_8.ls", "C_2_HOLE.ls", "TEIL_4711_OFF.ls"]
    assert "  DO[3]=OFF ;" in files["TEIL_4711.ls"]
    assert "  DO[7]=OFF ;" in files["TEIL_4711.ls"]
    text = files["LOCH_8.ls"]
    assert re.search(
        r"DO\[7\]=ON ;\r\n +\d+:L P\[2\] 600cm/min FINE TB +\.02sec,DO\[3\]=ON +;", text
    )
    assert not re.search("TB.*TB", text), "controllers take one TB on a line"
    assert "  WAIT    .40(sec) ;" in text
    assert re.search(r"FINE TB +\.02sec,DO\[3\]=OFF +;\r\n  \d+:  DO\[7\]=OFF ;", text)
    assert "two-switches" in codes(program, "warning", "fanuc", options)
    steps = read(program, options).sections[1].steps
    assert sum(isinstance(step, ReadWait) for step in steps) == 1
    events = [(s.signal, s.on) for step in steps for s in getattr(step, "switches", ())]
    laser = [on for signal, on in events if signal == "laser"]
    assert laser == [True, False, True, False]
    assert [on for signal, on in events if signal == "gas"] == [True, False]
    leads = [s.lead_time for step in steps for s in getattr(step, "switches", ())]
    assert leads[0] == pytest.approx(0.5, abs=1e-3)  # 50 mm at 100 mm/s: gas as the tool sets out
    off = files["TEIL_4711_OFF.ls"]
    assert [row[5:] for row in off.split("\r\n") if "UO" in row] == [
        "  IF (!UO[3]),DO[3]=(OFF) ;",
        "  IF (!UO[3]),DO[7]=(OFF) ;",
    ]
    assert "DEFAULT_GROUP\t= *,*,*,*,*;" in off


@pytest.mark.parametrize(
    ("file", "groups"),
    [(OFF, "1,*,*,*,*"), (MAIN, "*,*,*,*,*"), (MAIN, "1,1,*,*,*"), (CONTOUR, "*,*,*,*,*")],
)
def test_motion_groups_are_those_of_the_listing(file, groups):
    """Background logic must have none, and a program that moves the robot must have group 1."""
    for row in (f"DEFAULT_GROUP\t= {groups};\r\n", ""):
        text = re.sub(r"DEFAULT_GROUP.*\r\n", row, golden[file])
        with pytest.raises(InputError, match=rf"{file}, line \d+: expected DEFAULT_GROUP"):
            CASE.read(golden | {file: text}, robot("fanuc_m20id_25"), OPTIONS)
    more = golden | {file: re.sub(r"(DEFAULT_GROUP.*);", r"\1,*,*,*;", golden[file])}
    CASE.read(more, robot("fanuc_m20id_25"), OPTIONS)


def test_what_cannot_be_switched_with_one_tb_is_refused(program):
    gas = Switch(signal="gas", on=True, lead_time=0.1)
    inside = changed(program, 4, switches=(gas, Switch(signal="gas", on=False, lead_time=0.02)))
    options = FanucSettings(laser_output=1, gas_output=2)
    assert "two-switches" in codes(inside, "error", "fanuc", options)


def test_arcs_are_one_line_in_two_rows(program):
    files, _ = CASE.reads_back(arced(program, [3]))
    rows = "   8:C P[4]    \r\n    :  P[5] 720cm/min CNT100    ;\r\n   9:L P[6]"
    assert rows in files[CONTOUR]


def test_a_contour_longer_than_a_program_is_refused_not_divided(cell):
    program = build_program([hand_plan(arc(count=250), *cell)], thin_tolerance=0)
    options = FanucSettings(laser_output=1, lines_per_file=100)
    assert codes(program, "error", "fanuc", options) == ["file-length"]
    with pytest.raises(InputError, match=r"256 lines.* not divided.* lines_per_file"):
        post(program, "fanuc", options)
    files = post(program, "fanuc", options.model_copy(update={"lines_per_file": 256}))
    assert list(files)[1:-1] == ["SKIN_OUTER.ls"]


def test_names_are_cut_for_older_controllers_and_stay_different(cell):
    plans = [hand_plan(arc(name), *cell) for name in ("skin/outer edge", "skin/outer rim")]
    files = post(build_program(plans), "fanuc", FanucSettings(laser_output=1, longest_name=8))
    assert list(files) == ["CUT_SKIN.ls", "SKIN_OUT.ls", "SKIN_O_2.ls", "CUT__OFF.ls"]


def test_speeds_are_whole_numbers_of_the_finer_unit(cell):
    odd = build_program([hand_plan(arc(), *cell, speed=0.0504)])
    assert "302cm/min" in post(odd, "fanuc", OPTIONS)[CONTOUR]
    assert codes(odd, language="fanuc", settings=OPTIONS) == ["air-moves"]
    coarse = FanucSettings(laser_output=1, speed_unit="mm/sec")
    assert "50mm/sec" in post(odd, "fanuc", coarse)[CONTOUR]
    assert "speed-step" in codes(odd, "warning", "fanuc", coarse)
    slow = build_program([CASE.small], approach_speed=0.0001)
    assert codes(slow, "error", "fanuc", OPTIONS) == ["speed", "speed"]
    fast = FanucSettings(laser_output=1, fastest_mm_s=100.0)
    assert set(codes(odd, "error", "fanuc", fast)) == set()
    assert "speed" in codes(build_program([CASE.small]), "error", "fanuc", fast)


def test_corner_regions_say_the_zone_in_whole_mm():
    options = FanucSettings(laser_output=1, corner="CR")
    program = build_program([CASE.small], zone=0.002)
    assert " CR2    ;" in post(program, "fanuc", options)[CONTOUR]
    assert read(program, options).moves[3].zone == pytest.approx(0.002)
    assert codes(build_program([CASE.small]), "error", "fanuc", options) == ["corner-region"]


@pytest.mark.parametrize("decimals", [3, 6])
def test_targets_have_the_digits_asked_for(program, decimals):
    options = FanucSettings(laser_output=1, decimals=decimals, cnt_percent=30)
    text = post(program, "fanuc", options)[CONTOUR]
    digits = re.findall(r"\.(\d+)  ?(?:mm|deg)", text.partition("/POS")[2])
    assert {len(said) for said in digits} == {decimals}
    assert "cm/min CNT30    ;" in text


# What is refused.


def test_preflight_finds_what_only_this_language_cannot_say(program, cell):
    assert codes(program, language="fanuc", settings=OPTIONS) == ["air-moves"]
    early = changed(program, 2, switches=(Switch(signal="laser", on=True, lead_time=0.005),))
    assert codes(early, "error", "fanuc", OPTIONS) == ["time-step"]
    same = FanucSettings(laser_output=1, gas_output=1)
    assert codes(program, "error", "fanuc", same) == ["output"]
    wide = replace(program, robot=program.robot.with_limits(**WIDE))
    steps = [
        replace(step, q=step.q + 18 * np.pi * np.eye(6)[5]) if hasattr(step, "q") else step
        for step in program.sections[0].steps
    ]
    assert "turns" in codes(with_steps(wide, steps), "error", "fanuc", OPTIONS)
    bent = program.sections[0].steps[5].q * [1, 1, 1, 1, -1, 1]
    bent = changed(replace(program, robot=program.robot.with_limits(**WIDE)), 5, q=bent)
    assert codes(bent, "warning", "fanuc", OPTIONS).count("posture-change") == 2
    many = replace(program, sections=program.sections * 90)
    assert "file-length" in codes(
        many, "error", "fanuc", FanucSettings(laser_output=1, lines_per_file=100)
    )


@pytest.mark.parametrize(
    ("file", "old", "new", "message"),
    [
        (MAIN, "/PROG  CUT", "/PROG  PUT", "line 1: expected /PROG and the name of the file"),
        (MAIN, "/ATTR", "/APPL", "line 2: expected /ATTR"),
        (MAIN, "VERSION", "VISION", "line 9: not an attribute of a listing in English: 'VIS"),
        (MAIN, "PROG_SIZE", "PROG_GR\u00d6\u00dfE", "'PROG_GR\u00d6\u00dfE"),
        (MAIN, "PROG_SIZE", "PROG_GR\u00d6\u00dfE", "set the controller to English and list"),
        (MAIN, "CALL SKIN_OUTER    ;", "CALL\r\n    :  SKIN_OUTER    ;", "in the next line in one"),
        (MAIN, "1,*,*,*,*", "1,1,*,*,*", "expected DEFAULT_GROUP"),
        (MAIN, "LINE_COUNT\t= 28", "LINE_COUNT\t= 27", "LINE_COUNT is 27, but there are 28"),
        (MAIN, "  11:", "  12:", "expected line number 11"),
        (MAIN, "/END\r\n", "", "/END is missing"),
        (MAIN, "/END", "/END\r\nx", "nothing after it"),
        (MAIN, "!UFRAME 1 X", "! UFRAME 1 X", "no remark gives X of UFRAME"),
        (MAIN, "!UFRAME 1 X", "!UFRAME 1 Y", "Y of UFRAME is given twice"),
        (MAIN, "!UTOOL 1 X", "!UTOOL 2 X", "expected user frame 1 and tool frame 1, got 1 and 2"),
        (MAIN, "UFRAME_NUM=1", "UFRAME_NUM=0", "expected 'UFRAME_NUM=1' here, got 'UFRAME_NUM=0'"),
        (MAIN, "UFRAME_NUM=1", "UTOOL_NUM=1", "expected 'UFRAME_NUM=1' here, got 'UTOOL_NUM=1'"),
        (MAIN, "UTOOL_NUM=1", "! nothing", "expected UTOOL_NUM=1 before"),
        (MAIN, "DO[1]=OFF", "DO[1]=ON", "expected 'DO[1]=OFF' here"),
        (MAIN, "DO[1]=OFF", "DO[2]=OFF", "expected 'DO[1]=OFF' here"),
        (OFF, "DO[1]=(OFF)", "DO[2]=(OFF)", "expected '  IF (!UO[3]),DO[1]=(OFF)'"),
        (OFF, "!UO[3]", "UO[3]", "expected '  IF (!UO[3]),DO[1]=(OFF)'"),
        (CONTOUR, "UFRAME_NUM=1", "UFRAME_NUM=2", "expected '  UFRAME_NUM=1'"),
        (CONTOUR, "  ! skin", "  DO[9]=ON ;! skin", "not expected here"),
        (MAIN, "DO[1]=OFF", "CALL SKIN_OUTER", "expected DO[1]=OFF before"),
        (MAIN, "CALL SKIN_OUTER", "CALL OTHER", "the file 'OTHER.ls' is missing"),
        (CONTOUR, "cm/min CNT100", "inch/min CNT100", "line 28: not expected here"),
        (CONTOUR, "CNT100 ", "CNT100 ACC50 ", "not expected here"),
        (CONTOUR, "L P[3]", "L P[99]", "P[99] is missing"),
        (CONTOUR, "L P[3]", "L P[4]", "P[3] is used by no motion"),
        (CONTOUR, "L P[3]", "L P[1]", "P[1] must be given by X to R"),
        (CONTOUR, "J P[1]", "J P[2]", "P[2] must be given by J1 to J6"),
        (CONTOUR, "P[3]{", "P[2]{", "P[2] is given twice"),
        (CONTOUR, "UF : 1", "UF : 2", "tool frame 1, got 2 and 1"),
        (CONTOUR, "'N U T", "'N L T", "expected a position after this line"),
        (CONTOUR, "  ! skin", "  DO[1]=ON ; ! skin", "not expected here"),
        (CONTOUR, "! skin/outer: 8 nodes, 155.7 mm,", "DO[1]=ON", "only be switched here after"),
    ],
)  # fmt: skip
def test_the_reader_refuses_what_it_does_not_know(file, old, new, message):
    CASE.refuses(file, old, new, message)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("L P[10] 600cm/min FINE", "L P[10] 600cm/min CNT100", "a rounded corner, expected a stop"),
        ("720cm/min", "7200cm/min", "the speed is 1200 mm/s, expected 120"),
        ("DO[1]=OFF", "DO[1]=ON", "switches laser on 0.02 s ahead, expected laser off"),
        ("'N U T, 0, 0, 1'", "'F U T, 0, 0, 1'", "the posture is F U T 0 0 1, expected N U T"),
        ("J6=  109.1367", "J6=  109.2367", "joint 6 is 0.1000 deg off"),
        ("X =   78.7485", "X =   78.7585", "the tip is 0.0100 mm"),
    ],
)
def test_an_edited_listing_is_read_as_edited(old, new, message):
    CASE.finds(CONTOUR, old, new, message)


def test_a_listing_that_a_controller_lists_again_is_read(program):
    """It fills in sizes and dates, adds attributes, and prints numbers below 1 its own way."""
    files = {
        name: text.replace("PROG_SIZE\t= 0;", "PROG_SIZE\t= 1446;\r\nCREATE\t\t= DATE 26-09-18  "
                           "TIME 13:33:06;").replace("/MN", "LOCAL_REGISTERS\t= 0,0,0;\r\n/MN")
        for name, text in golden.items()
    }  # fmt: skip
    files[CONTOUR] = files[CONTOUR].replace(" -0.0687 deg", "  -.0687 deg")
    assert CASE.deviations(program, files) == []
