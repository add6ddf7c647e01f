"""G code of LinuxCNC: times, switches, INI and HAL, and what the reader refuses."""

import configparser
import re
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.post.cases import CASES, CUT

from kerfpath.post import JointMove, build_program, preflight
from kerfpath.post.linuxcnc.controller import cruise_time, time_from
from kerfpath.post.linuxcnc.motion import stretch
from kerfpath.transfer import least_time
from programs import arc, changed, five_axis_program, hand_plan, with_steps

CASE = CASES["linuxcnc"]
NGC = CASE.golden[f"{CUT}.ngc"]


# Times.


@given(ramp=st.floats(1e-6, 10.0), share=st.floats(0.01, 1.0))
def test_a_ramped_move_takes_the_time_from_stop_to_stop(ramp, share):
    """A trapezoid of one joint that accelerates by 1: its way is `ramp`, its speed way / cruise."""
    took = 2 * np.sqrt(ramp) / share
    cruise = cruise_time(took, ramp)
    speed = ramp / cruise
    assert time_from(cruise, ramp) == pytest.approx(took, rel=1e-9)
    assert cruise + speed == pytest.approx(took, rel=1e-9)  # it speeds up and slows down in `speed`
    assert cruise >= speed * (1 - 1e-6)  # it reaches the speed


def test_joint_moves_take_the_planned_time_and_the_first_one_a_share_of_the_range(program):
    plans = [hand_plan(arc(name), *CASE.cell, speed=0.12) for name in ("one", "two")]
    two = build_program(plans)
    _, read = CASE.reads_back(two)
    for ours, before, back in zip(two.moves[1:], two.moves[:-1], read.moves[1:], strict=True):
        if isinstance(ours, JointMove) and ours.duration is not None:
            way = (ours.q - before.q)[None]
            least = least_time(way, *two.robot.speed_limits())[0]
            assert back.duration == pytest.approx(ours.duration, abs=1e-6)
            assert back.duration >= least
    starts = [section.moves[0] for section in read.sections]
    assert [start.speed for start in starts] == pytest.approx([0.1, 0.1], abs=1e-9)
    # The widest range of the arm, 800 deg of joint 4, at a tenth of 360 deg/s.
    assert "F1.875000000" in NGC


# Switches.


def test_a_switch_acts_as_the_next_move_begins_and_at_once_before_a_wait(program):
    rows = [line.strip() for line in NGC.splitlines()]
    wait = rows.index("G4 P0.3000")
    assert rows[wait - 2 : wait] == ["M64 P1", "M64 P0"]
    for flying in ("M63 P0", "M62 P0"):
        assert rows[rows.index(flying) + 1].startswith("G1 X")


def test_the_last_switch_of_a_contour_waits_for_no_move(program):
    """There is none after it, or one that goes nowhere."""
    steps = list(program.sections[0].steps)
    off = max(k for k, step in enumerate(steps) if getattr(step, "switches", ()))
    for rest in ([], [replace(steps[off], switches=())]):
        made = with_steps(program, [*steps[: off + 1], *rest])
        text = CASE.language.formatter(made, CASE.settings).files()[f"{CUT}.ngc"]
        assert text.count("M65 P0") == text.count("M65 P1") == 2  # at the start, and here


def test_lead_times_are_left_out_with_a_warning(program):
    assert CASE.codes(program, "warning") == ["lead-time", "look-ahead", "air-moves"]
    assert "lead-time" not in CASE.codes(build_program([CASE.small], lead_time=0.0))


# What its look-ahead holds.

A = np.full(6, np.radians(300))
"""Acceleration of each joint, rad/s^2."""


def even(count, step_time, speed):
    """How LinuxCNC runs moves in which joint 1 turns evenly, with targets at even times."""
    robot = CASE.cell[0].with_limits(acceleration=A, velocity=np.full(6, 10.0))
    q = np.outer(speed * step_time * np.arange(count + 1), np.eye(6)[0])
    return stretch((), q, np.full(count, step_time), robot, CASE.settings)


@pytest.mark.parametrize("share", [0.5, 0.99, 1.0, 1.1, 2.0])
def test_the_time_is_kept_up_to_the_speed_a_t_half(share):
    """Between the ramps at both ends, each of which adds half of speed / (a / 2)."""
    step_time, count = 0.1, 40
    speed = share * A[0] * step_time / 2
    run = even(count, step_time, speed)
    ramps = speed / (A[0] / 2)
    if share <= 1:
        assert run.time == pytest.approx(count * step_time + ramps, rel=1e-9)
    else:
        # Each move speeds up for half of it, at a / 2: as fast as sqrt(way a / 2).
        each = speed * step_time / np.sqrt(speed * step_time * A[0] / 2)
        assert run.time == pytest.approx((count + 1) * each, rel=1e-9)


def test_corners_are_parabolas_that_keep_the_limits(program):
    """Targets on a curve: joints are continuous and pass from stop to stop within all limits.

    Moves of like length are meant: where one is short for the speed of the next, LinuxCNC itself
    exceeds the acceleration.
    """
    turn = np.linspace(0, 2, 61)[:, None]
    q = 0.3 * np.sin(turn + np.arange(6)) - 0.3 * np.sin(np.arange(6))
    run = stretch((), q, np.full(60, 0.05), program.robot, CASE.settings)
    time = np.arange(0, run.time + 2e-3, 1e-3)
    at = run.at(time)
    np.testing.assert_allclose(at[[0, -1]], q[[0, -1]], atol=1e-12)
    velocity, acceleration = program.robot.speed_limits()
    assert (np.abs(np.diff(at, axis=0)) <= velocity * 1e-3 * (1 + 1e-9)).all()
    bend = np.abs(np.diff(at, 2, axis=0)) / 1e-6 / acceleration
    assert 0.49 < bend.max() < 1.02
    # Rounded corners leave the lines between targets by a few hundredths of their length.
    line = np.vstack([np.linspace(a, b, 50) for a, b in pairwise(q)])
    off = [np.abs(line - one).max(axis=1).min() for one in at[::10]]
    assert max(off) < 0.05 * np.abs(np.diff(q, axis=0)).max()


def test_a_cut_that_is_too_fast_for_the_look_ahead_is_told_what_holds(program):
    (said,) = (i for i in preflight(program, "linuxcnc", CASE.settings) if i.code == "look-ahead")
    found = re.search(r"raise spacing_mm to ([\d.]+), or lower the speed to (\d+)%", said.message)
    spacing, share = float(found[1]) * 1e-3, int(found[2]) / 100
    # Both say the same: a spacing that is longer, or a speed that is lower, by its square root.
    longest = max(move.duration for move in program.moves[2:-1]) * 0.12
    assert spacing / longest == pytest.approx(1 / share**2, rel=0.05)
    held = hand_plan(CASE.small.contour, *CASE.cell, speed=0.12 * (share - 0.01))
    assert "look-ahead" not in CASE.codes(CASE.built([held]))
    still = hand_plan(CASE.small.contour, *CASE.cell, speed=0.12 * (share + 0.05))
    assert "look-ahead" in CASE.codes(CASE.built([still]))


def test_joints_that_the_interpreter_cannot_move_as_slowly_are_refused(program):
    """Joints 1 to 3 nearly stand while the wrist turns: LinuxCNC takes 0.1 deg/min for them."""
    steps = list(program.sections[0].steps)
    q = steps[4].q + np.array([1e-7, 0, 0, 0.1, 0, 0])
    made = with_steps(program, [*steps[:5], replace(steps[5], q=q), *steps[6:]])
    assert "slow" in CASE.codes(made, "error")


# INI and HAL.


def test_the_ini_has_the_limits_of_the_robot_and_begins_at_the_first_target(program):
    ini = configparser.ConfigParser(strict=False, comment_prefixes=("#",))
    ini.read_string(CASE.golden[f"{CUT}.ini"])
    velocity, acceleration = np.degrees(program.robot.speed_limits())
    limits = program.robot.joint_limits()
    for k in range(6):
        for section in (f"JOINT_{k}", f"AXIS_{'XYZABC'[k]}"):
            found = {key: float(v) for key, v in ini[section].items() if key.startswith("m")}
            assert found["max_velocity"] == pytest.approx(velocity[k], abs=1e-6)
            assert found["max_acceleration"] == pytest.approx(acceleration[k], abs=1e-6)
            assert found["min_limit"] == pytest.approx(np.degrees(limits.lower[k]), abs=1e-6)
            assert found["max_limit"] == pytest.approx(np.degrees(limits.upper[k]), abs=1e-6)
        home = np.degrees(program.moves[0].q[k])
        assert float(ini[f"JOINT_{k}"]["home"]) == pytest.approx(home, abs=1e-6)


def test_a_joint_without_end_has_no_limit_in_the_ini(program):
    endless = replace(program, robot=program.robot.with_limits(endless=np.arange(6) == 5))
    text = CASE.post(endless)[f"{CUT}.ini"]
    assert text.count("MIN_LIMIT = -1000000000.000000") == 2


def test_an_arm_of_five_axes_reads_back():
    made = five_axis_program()
    files, _ = CASE.reads_back(made)
    (ini,) = (text for name, text in files.items() if name.endswith(".ini"))
    assert "trivkins coordinates=XYZAB\n" in ini


# What the preflight refuses.


def test_what_the_joints_cannot_say_is_refused(program):
    assert CASE.codes(changed(program, 1, zone=0.01), "error") == ["zone"]
    limits = replace(program.robot.limits, acceleration=None)
    unknown = replace(program, robot=replace(program.robot, limits=limits))
    assert CASE.codes(unknown, "error") == ["joint-speed"]


# What the reader refuses.


@pytest.mark.parametrize(
    ("file", "old", "new", "message"),
    [
        (".ngc", "G93", "G94", "expected 'G93', got 'G94'"),
        (".ngc", "M50 P0", "M50 P1", "expected 'M50 P0'"),
        (".ngc", "M65 P1\n", "", "expected 'M65 P1', got 'o<skin_outer> sub'"),
        (".ngc", "  G61.1\n  G53", "  G53", "expected G61.1 before this move"),
        (".ngc", "G64 P0.01 Q0", "G64 P0.02 Q0", "expected 'G64 P0.01 Q0'"),
        (".ngc", "  G53 G1", "  G0", "not expected here: 'G0 X7."),
        (".ngc", " F120.000000000", " F0.0", "expected F above 0, got 0"),
        (".ngc", " F120.000000000", "", "not expected here"),
        (".ngc", " C74.11122402", "", "not expected here"),
        (".ngc", "G53 G1 X7.", "G53 G1 X8.Y7.", "not expected here"),
        (".ngc", "  M64 P1\n", "  M64 P7\n", "the settings name no partner with the output 7"),
        (".ngc", "  M63 P0\n", "  M65 P0\n", "a switch must follow a move of the path, which"),
        (".ngc", "  G4 P0.3000\n", "  G4 P0.3000\n  M62 P0\n", "a switch must follow a move of"),
        (".ngc", "  G4 P0.3", "  o<await_input> call [1] [2.0]\n  G4 P0.3", "does not define how"),
        (".ngc", "  G4 P0.3", "  o<laser_with> call [1] [1] [1] [1]\n  G4 P0.3", "does not define"),
        (".ngc", "  ; skin", "  ;abort, skin", "a remark that does something: 'abort, skin"),
        (".ngc", "  ; skin", "  ; py,skin", "a remark that does something: ' py,skin"),
        (".ngc", "  G4", "  (MSG,x)\n  G4", "not expected here: '(MSG,x)'"),
        (".ngc", "o<skin_outer> call", "o<skin> call", "must be called once each, in their order"),
        (".ngc", "o<skin_outer> call\n", "", "must be called once each, in their order"),
        (".ngc", "call\nM2", "call\nM30", "expected 'M2', got 'M30'"),
        (".ngc", "\nM2\n", "\nM2\nG0 X0\n", "expected 'the end of the file', got 'G0 X0'"),
        (".ini", "MAX_VELOCITY = 175.0", "MAX_VELOCITY = 275.0", "expected 'MAX_VELOCITY = 175."),
        (".ini", "[JOINT_1]", "[JOINT_1] # elbow", "expected '[JOINT_1]', got '[JOINT_1] # elbow'"),
        (".hal", " laser-gate.in0", "", "expected 'net output-0 motion.digital-out-00 => "),
    ],
)  # fmt: skip
def test_the_reader_refuses_what_it_does_not_know(file, old, new, message):
    CASE.refuses(f"{CUT}{file}", old, new, message)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("F323.771665369", "F323.7", "takes"),
        ("X7.00343086", "X7.01343086", "deg off"),
        ("  M62 P0\n", "", "switches nothing"),
        ("G4 P0.3000", "G4 P0.4000", "waits 0.4 s"),
        ("F1.875000000", "F18.75", "the speed is"),
    ],
)
def test_what_differs_from_the_plan_is_found(old, new, message):
    CASE.finds(f"{CUT}.ngc", old, new, message)


def test_remarks_blanks_and_case_are_nobodys_business(program):
    lowered = NGC.lower().replace("g53 g1", "\tg53  G1").replace("o<skin", "O<Skin", 1)
    text = lowered.replace("\nm2\n", "\n\n  ; the end\nM2 ; of the program\n")
    ini = CASE.golden[f"{CUT}.ini"].replace("[KINS]", "# trivial\n\n  [KINS]")
    files = {**CASE.golden, f"{CUT}.ngc": text, f"{CUT}.ini": ini}
    assert CASE.deviations(program, files) == []
