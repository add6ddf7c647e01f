"""Programs in URScript: written, read back, and what only they must keep to."""

import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from tests.post.cases import CASES

from conftest import rebuilt
from kerfpath import InputError
from kerfpath.post import (
    Comment,
    Switch,
    build_program,
    post,
)
from kerfpath.post.urscript import URScriptSettings
from kerfpath.post.urscript.writer import distance_ahead, time_ahead
from programs import arc, arced, changed, codes, hand_plan, read_text, text_of, with_steps

CASE = CASES["urscript"]
URSCRIPT, GAS = CASE.language, CASE.settings
WIRED = URScriptSettings(laser_output=0)
SCRIPT = "cut_skin_outer.script"


def of(text):
    """The numbers of a list or pose in the text."""
    return np.array([float(word) for word in re.findall(r"-?\d+\.\d+", text)])


def script(source, settings=GAS):
    return text_of(post(source, "urscript", settings))


def reread(text, arm, settings=GAS):
    return read_text(text, arm, "urscript", settings)


def same(program, settings=GAS):
    return CASE.reads_back(program, settings)[1]


# The text.


def test_targets_are_the_planned_tips_in_the_controllers_base(program):
    """Numbers cut out of the text, multiplied as pose_trans does; digits: 0.1 um and 1e-9 rad."""
    text = script(program)

    def pose(numbers):
        T = np.eye(4)
        T[:3, :3] = Rotation.from_rotvec(numbers[3:]).as_matrix()
        T[:3, 3] = numbers[:3]
        return T

    part = pose(of(re.search(r"part_frame = (.*)", text)[1]))
    tool = pose(of(re.search(r"set_tcp(.*)", text)[1]))
    rows = [pose(of(row)) for row in re.findall(r"movel\(.*?p(\[[^]]*\])", text)[:-1]]
    planned = program.robot.forward(CASE.small.q) @ tool
    np.testing.assert_allclose(part @ np.array(rows), planned, atol=2e-6)
    q = of(re.search(r"movej\((\[[^]]*\])", text)[1])
    np.testing.assert_allclose(q, program.moves[0].q, atol=1e-8)


def test_rotation_vectors_do_not_jump_along_the_path(cell):
    made = hand_plan(arc(count=40), *cell)
    rows = re.findall(r"movel\(.*?p\[([^]]*)\]", script([made]))
    turns = np.array([of(row)[3:] for row in rows])
    # Consecutive tips turn by less than 0.2 rad; a jump would be one of about 2 pi.
    assert np.linalg.norm(np.diff(turns, axis=0), axis=1).max() < 0.3


def test_a_description_with_another_base_and_flange_gives_the_same_joints_and_poses(program):
    """ROS turns the base by 180 deg; the controller's base, flange and joints stay as they are."""
    arm, half = program.robot, np.diag([-1.0, -1.0, 1.0, 1.0])
    flange = np.eye(4)
    flange[:3, :3] = Rotation.from_euler("xyz", [90, 0, 90], degrees=True).as_matrix()
    turned = replace(
        program,
        robot=rebuilt(arm, T_base_foot=half, T_end_flange=flange),
        T_base_part=half @ program.T_base_part,
        T_flange_tip=flange.T @ program.T_flange_tip,
    )
    ours, theirs = script(program), script(turned)
    assert [line for line in ours.splitlines() if "p[" not in line] == [
        line for line in theirs.splitlines() if "p[" not in line
    ]
    for pattern in (r"set_tcp.*", r"part_frame = .*"):
        here, there = (of(re.search(pattern, text)[0]) for text in (ours, theirs))
        np.testing.assert_allclose(there, here, atol=1e-8)
    same(turned)


# The law: what is read back is what was planned.


def test_turns_of_the_wrist_stay_as_planned(cell):
    arm, tool, placement = cell
    arm = arm.with_limits(endless=[False] * 5 + [True])
    made = hand_plan(arc(), arm, tool, placement)
    for turns in (-1, 0, 1, 3):
        wound = build_program([replace(made, q=made.q + 2 * np.pi * turns * np.eye(6)[5])])
        steps = wound.sections[0].steps
        read = same(wound, WIRED)
        np.testing.assert_allclose(read.moves[0].q, steps[1].q, atol=1e-8)
        beyond = max(abs(move.q).max() for move in wound.moves) > 2 * np.pi
        assert ("turns" in codes(wound, "warning", "urscript", WIRED)) == beyond


def test_arcs_are_written_as_movec(program):
    made = arced(program, [3])
    text = script(made)
    assert text.count("movec(") == 1
    assert ", mode=0)" in text
    wrong = re.sub(r"(movec\(pose_trans\(part_frame, p\[)-?\d", r"\g<1>7", text)
    assert CASE.deviations(made, {SCRIPT: wrong})


# Switching.


@settings(max_examples=60, deadline=None)
@given(st.floats(0, 0.5), st.floats(0.01, 1), st.floats(0.1, 20), st.booleans())
def test_the_distance_ahead_is_where_the_tip_is_at_that_time(lead, speed, acceleration, stops):
    """Against a braking motion run backwards in small steps: 1e-4 of the way."""
    near = distance_ahead(lead, speed, acceleration, stops=stops)
    t = np.linspace(0, lead, 20_001)
    v = np.minimum(acceleration * t, speed) if stops else np.full_like(t, speed)
    assert near == pytest.approx(np.trapezoid(v, t), rel=1e-4, abs=1e-12)
    assert time_ahead(near, speed, acceleration, stops=stops) == pytest.approx(lead, abs=1e-9)


def test_every_switch_is_written_ahead_of_its_move_and_at_its_end(program):
    lines = [line.strip() for line in script(program).splitlines()]
    start = lines.index("def skin_outer():")
    words = [re.match(r"\w+", line)[0] for line in lines[start:] if not line.startswith("#")]
    said = [word for word in words if re.match(r"(laser|gas)_|mov|sleep", word)]
    ends = said[: said.index("laser_run")][:-1]
    assert ends == [
        *("movej", "gas_ahead", "laser_ahead", "movel", "gas_set", "laser_set", "sleep"),
        *("movel", "movel", "laser_ahead", "movel", "laser_set"),  # into the micro joint
        *("movel", "laser_ahead", "movel", "laser_set"),  # out of it
        *("movel", "laser_ahead", "movel", "laser_set", "gas_set", "movel"),
    ]


def test_a_switch_without_lead_needs_no_thread(cell):
    made = hand_plan(arc(), *cell)
    text = script(build_program([made], lead_time=0.0), WIRED)
    assert "laser_ahead(p" not in text
    assert text.count("    laser_set(True)\n") == text.count("    laser_set(False)\n") == 1


def test_a_signal_is_switched_once_at_the_end_of_a_move(program):
    steps = program.sections[0].steps
    number = next(k for k, step in enumerate(steps) if len(getattr(step, "switches", ())) == 2)
    on, off = (Switch(signal="laser", on=value) for value in (True, False))
    twice = changed(program, number, switches=(on, off, on))
    assert codes(twice, "error", "urscript", GAS) == ["switches"]


# What the preflight refuses.


def test_blends_that_meet_are_refused():
    """The controller would leave the move out, so that a warning is not enough."""
    wide = build_program([CASE.small])
    for number in range(3, 9):
        wide = changed(wide, number, zone=0.02)
    assert codes(wide, "error", "urscript", WIRED) == ["blend-overlap"]
    with pytest.raises(InputError, match=r"lower zone_mm or use fewer nodes"):
        post(wide, "urscript", WIRED)
    assert (
        codes(build_program([CASE.small], zone=0.1), "error", "urscript", WIRED) == []
    )  # halved to fit


@pytest.mark.parametrize("name", ["path_1", "hole_3", "skin", "part", "list_of_holes", "tool_slot"])
def test_common_names_of_contours_are_not(name):
    assert not URSCRIPT.is_reserved(name)


def test_joint_speeds_must_be_known(program):
    limits = replace(program.robot.limits, velocity=None)
    slow = replace(program, robot=replace(program.robot, limits=limits))
    assert codes(slow, "error", "urscript", GAS) == ["joint-speed"]


def test_a_program_longer_than_a_file_may_be_is_refused(program):
    with pytest.raises(InputError, match=r"lines_per_file allows 100 and this language cannot"):
        script(
            with_steps(program, [*program.sections[0].steps, *[Comment("x")] * 60]),
            GAS.model_copy(update={"lines_per_file": 100}),
        )


# What the reader refuses.


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("def cut_skin_outer", "sec cut_skin_outer", "expected def NAME():"),
        ("set_tcp(p[0.05", "set_tcp(p[x0.05", "expected set_tcp"),
        ("_out(0, on)", "_out(3, on)", "expected 'set_standard_digital_out(0, on)', got"),
        ("_out(1, value)", "_out(0, value)", "line 62: expected 'set_standard"),
        ("enter_critical", "enter_limbo", "expected 'enter_critical'"),
        ("movel(", "movep(", "not expected here: 'movep(pose"),
        ("sleep(0.300)", "sleep(0.300)\n    stopl(1)", "not expected here: 'stopl(1)'"),
        ("a=1.200000, v=0.1", "a=0.000000, v=0.1", "must be above 0"),
        ("    laser_set(True)\n", "", "the laser is switched ahead of a move, but not at its end"),
        ("    laser_set(True)", "    laser_set(False)", "to True ahead, but to False here"),
        ("laser_ahead(p[0.08", "laser_ahead(p[0.18", "ahead of another point"),
        ("sleep(0.300)", "sleep(0.300)\n    laser_set(False)", "must follow a linear or circ"),
        ("  laser_run = run laser_thread()\n", "", "expected 'laser_run = run laser_thread()'"),
        ("    skin_outer()", "", "expected the call of a contour"),
        ("first_contour <= 1", "first_contour <= 2", "must be the number of a contour"),
        ("global first_contour = 1", "global first_contour = 2", "must be the number of a contour"),
        ("output_to_value(0, 1)", "output_to_value(0, 0)", "expected 'set_runstate_standard"),
        ("  kill gas_run\nend\n", "  kill gas_run\n", "expected 'end'"),
        ("  kill gas_run\nend\n", "  kill gas_run\nend\nx()\n", "expected 'the end of the file'"),
        ("  gas_set(False)\n  gas_run", "  gas_set(True)\n  gas_run", "expected 'gas_set(False)'"),
    ],
)
def test_the_reader_refuses_what_it_does_not_know(old, new, message):
    CASE.refuses(SCRIPT, old, new, message)


def test_the_reader_refuses_a_signal_that_is_not_defined(cell):
    text = script([hand_plan(arc(), *cell)], WIRED)
    bad = text.replace("    laser_set(True)", "    gas_set(True)\n    laser_set(True)", 1)
    with pytest.raises(InputError, match="does not define how it switches the gas"):
        reread(bad, cell[0], WIRED)
    more = CASE.golden[SCRIPT].replace(
        "  set_runstate_standard_digital_output_to_value(1, 1)\n", ""
    )
    with pytest.raises(InputError, match="name its output with gas_output"):
        reread(more, cell[0], WIRED)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("p[0.0787485", "p[0.0797485"),
        ("v=0.120000", "v=0.130000"),
        ("r=0.0003000", "r=0.0004000"),
        ("sleep(0.300)", "sleep(0.400)"),
        ("0.000240000, True", "0.000940000, True"),
        ("movej([-2.9", "movej([-2.8"),
        ("set_tcp(p[0.0513", "set_tcp(p[0.0523"),
    ],
)
def test_an_edited_program_is_read_as_edited(old, new):
    CASE.finds(SCRIPT, old, new)
