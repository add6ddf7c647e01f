"""The preflight: what no language may run, whatever it says."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tests.post.cases import CASES

from kerfpath import InputError, robot
from kerfpath.post import (
    Comment,
    Switch,
    Wait,
    build_program,
    post,
    preflight,
)
from programs import arc, changed, codes, hand_plan, with_steps

CASE = CASES["rapid"]


def test_a_good_program_has_only_the_warning_about_air_moves(program):
    assert [(i.level, i.code) for i in preflight(program)] == [("warning", "air-moves")]


@pytest.mark.parametrize(
    ("change", "code"),
    [
        ({"name": "a" * 33}, "name-length"),
        ({"name": "main"}, "name-collision"),
        ({"sections": ()}, "empty"),
    ],
)
def test_preflight_refuses_what_concerns_the_whole_program(program, change, code):
    assert codes(replace(program, **change), "error") == [code]


@pytest.mark.parametrize(
    ("number", "change", "code"),
    [
        (2, {"speed": 0.0}, "speed"),
        (2, {"speed": -0.1}, "speed"),
        (2, {"speed": float("nan")}, "speed"),
        (1, {"speed": 1.5}, "speed"),
        (2, {"zone": -1e-3}, "zone"),
        (2, {"switches": (Switch(signal="laser", on=True, lead_time=0.6),)}, "lead-time"),
    ],
)
def test_preflight_refuses_numbers_out_of_range(program, number, change, code):
    assert codes(changed(program, number, **change), "error") == [code]


def test_preflight_refuses_a_joint_step_of_half_a_turn(program):
    q = program.sections[0].steps[4].q + 3.5 * np.eye(6)[3]
    bad = changed(program, 4, q=q)
    issues = [i for i in preflight(bad) if i.code == "joint-step"]
    assert [i.place for i in issues] == ["skin_outer, move 3", "skin_outer, move 4"]
    assert "joint 4 turns 2" in issues[0].message


def test_preflight_refuses_a_turn_of_the_tool_by_a_right_angle(program):
    T = program.sections[0].steps[-1].T_part_tip.copy()
    T[:3, :3] = T[:3, :3] @ Rotation.from_euler("z", 91, degrees=True).as_matrix()
    assert codes(changed(program, -1, T_part_tip=T), "error") == ["orientation-step"]


def test_preflight_refuses_axes_beyond_their_limits(program):
    upper = program.robot.upper.copy()
    upper[1] = program.sections[0].steps[2].q[1] - 0.01
    tight = replace(program, robot=program.robot.with_limits(upper=upper))
    issues = [i for i in preflight(tight) if i.code == "axis-limit"]
    assert issues[0].place.startswith("skin_outer, move")
    assert all("joint 2 high" in i.message for i in issues)


def test_preflight_checks_the_sum_that_a_parallel_rod_bounds(cell):
    _, tool, placement = cell
    program = build_program([hand_plan(arc(), robot("abb_irb2400_155"), tool, placement)])
    q = program.sections[0].steps[1].q.copy()
    q[1:3] = np.radians([50, 40])
    issues = [i for i in preflight(changed(program, 1, q=q)) if i.code == "axis-limit"]
    assert "joint 2 + joint 3 high: 25.000 deg" in issues[0].message


def test_preflight_refuses_a_laser_that_is_not_switched_in_turn(program):
    steps = list(program.sections[0].steps)
    start, end = steps[2], steps[-2]
    orders = {
        "still on": [*steps[:-2], replace(end, switches=()), steps[-1]],
        "twice on": [*steps[:5], replace(steps[5], switches=start.switches), *steps[6:]],
        "joint move": [*steps[:5], steps[1], *steps[5:]],
    }
    for order in orders.values():
        assert "laser-order" in codes(with_steps(program, order), "error")
    assert codes(with_steps(program, [*steps[:3], Comment("x"), *steps[3:]]), "error") == []


def test_preflight_warns_of_zones_that_overlap(program):
    wide = program
    for number in range(3, 9):
        wide = changed(wide, number, zone=0.02)
    found = [i for i in preflight(wide) if i.code == "zone-overlap"]
    assert len(found) == 1
    assert found[0].level == "warning"
    assert "at 6 of 10 targets" in found[0].message  # all inner nodes, none of the stops


def test_preflight_warns_of_a_lead_longer_than_its_move(small):
    found = [i for i in preflight(build_program([small], lead_time=0.4)) if i.code == "short-lead"]
    assert [i.place for i in found] == ["skin_outer, move 8"]
    assert "400 ms ahead" in found[0].message


def test_preflight_warns_where_turning_the_tool_would_slow_it_down(cell):
    quick = hand_plan(arc(), *cell, speed=2.0)
    assert "turning-speed" in codes(build_program([quick], lead_time=0.0), "warning")


def test_an_unknown_language_lists_those_known(small):
    with pytest.raises(InputError, match=r"'basic' is not known; expected .*rapid"):
        post([small], "basic")


def test_preflight_refuses_waits_on_the_fly_or_without_an_end(program):
    steps = list(program.sections[0].steps)
    assert "wait" in codes(with_steps(program, [*steps[:6], Wait(time=1.0), *steps[6:]]), "error")
    for time in (0.0, np.inf, 400.0):
        odd = with_steps(program, [*steps[:3], Wait(time=time), *steps[3:]])
        assert "wait" in codes(odd, "error")
