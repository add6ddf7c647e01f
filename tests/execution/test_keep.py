"""Plans that keep the limits between the nodes: the proof against dense sampling."""

import re
from dataclasses import replace

import numpy as np
import pytest
from benchmarks._random_contours import cut

import kerfpath
from conftest import ROOT
from kerfpath import InputError, PlanOptions, plan, plan_in_pieces
from kerfpath.execution import executed, keep_limits
from kerfpath.post import build_program

DENSER = 50
"""Samples to the interval between nodes."""


@pytest.fixture(scope="module")
def tight(circle, arm, tool, placement):
    """A plan at its limits: the acceleration of the circle at twice the speed of others."""
    made = plan(circle, arm, tool=tool, placement=placement, speed=0.3, certify=None)
    share = made.criteria.peak_acceleration.max()
    # The same motion on a robot that can just do it at the nodes.
    _, acceleration = arm.speed_limits()
    return replace(made, robot=arm.with_limits(acceleration=acceleration * share * 1.0001))


def densely(run, program):
    """Return the largest shares of velocity and acceleration by many poses, all solutions."""
    robot, end = program.robot, run.tool_motion.time[-1]
    step = end / (len(run.tool_motion.T) * DENSER)
    time = np.arange(2 * step, end - 2 * step, step)
    flange = np.linalg.inv(program.T_flange_tip)
    d = step / 10
    near = np.stack([np.interp(time, run.time, joint) for joint in run.q.T], axis=1)
    q = [
        robot.arm.nearest(
            program.T_base_part @ run.tool_motion.poses(time + sign * d) @ flange, near
        )
        for sign in (-1, 0, 1)
    ]
    velocity, acceleration = robot.speed_limits()
    return (
        np.abs((q[2] - q[0]) / (2 * d) / velocity).max(),
        np.abs((q[2] - 2 * q[1] + q[0]) / d**2 / acceleration).max(),
    )


def test_what_is_needed_between_the_nodes_is_brought_within_the_limits(tight):
    before = longest(tight)
    assert before.peak_acceleration.share > 1.001
    kept = keep_limits(tight)
    assert kept.done
    assert kept.rounds > 0
    fewer = keep_limits(tight, rounds=kept.rounds - 1)
    assert (fewer.done, fewer.rounds) == (False, kept.rounds - 1)
    assert fewer.plan is tight
    run = longest(kept.plan)
    assert max(run.velocity_bound, run.acceleration_bound) <= 1
    velocity, acceleration = densely(run, build_program([kept.plan]))
    # Second differences over a tenth of a sample lose digits.
    assert velocity <= run.velocity_bound * (1 + 1e-6)
    assert acceleration <= run.acceleration_bound * (1 + 1e-4)
    np.testing.assert_array_equal(kept.plan.time, tight.time)
    assert tight.cost * (1 - 1e-3) <= kept.plan.cost <= tight.cost * 1.05


def longest(made, **options):
    (run,) = executed(build_program([made], **options))
    return run


def test_a_plan_that_keeps_them_is_left_as_it_is(circle, arm, tool, placement):
    made = plan(circle, arm, tool=tool, placement=placement, speed=0.1, certify=None)
    kept = keep_limits(made)
    assert (kept.done, kept.rounds) == (True, 0)
    assert kept.plan is made


def test_zones_that_are_too_narrow_are_said_with_what_would_help(tight):
    kept = keep_limits(tight, lambda one: build_program([one], zone_error=1e-6))
    assert not kept.done
    assert kept.plan is tight
    assert "zone error" in kept.statement
    assert "mm apart" in kept.statement
    slower = float(kept.statement.partition("; at ")[2].partition("%")[0]) / 100
    run = longest(replace(tight, time=tight.time / slower), zone_error=1e-6)
    assert run.peak_acceleration.share <= 1
    faster = slower + 0.02
    run = longest(replace(tight, time=tight.time / faster), zone_error=1e-6)
    assert run.peak_acceleration.share > 1


def test_where_the_robot_stops_at_every_node_there_is_nothing_to_keep(tight):
    kept = keep_limits(tight, lambda one: build_program([one], zone=0.0))
    assert (kept.done, kept.run, kept.plan) == (True, None, tight)


def kept_of(name, number):
    """What comes of keeping the limits of a random contour, the tip as free as the nodes let it."""
    drawn = cut(name, number)
    made = plan(
        drawn.contour, drawn.robot, tool=drawn.tool, placement=np.eye(4), speed=drawn.speed,
        certify=None,
    )  # fmt: skip
    limits = drawn.robot.joint_limits()
    wider = drawn.robot.with_limits(lower=limits.lower - 0.2, upper=limits.upper + 0.2)
    return keep_limits(
        replace(made, robot=wider), lambda one: build_program([one], zone_error=0.01)
    )


def test_nodes_are_held_where_more_is_needed_though_a_run_is_ahead_of_its_plan():
    kept = kept_of("staubli_tx2_90xl", 1)
    time, plan_time = kept.run.tool_motion.time, kept.plan.time - kept.plan.time[0]
    # Chords are shorter than the path: by a tenth of an interval at its end.
    assert plan_time[-1] - time[-1] > 0.1 * plan_time[1]
    assert kept.done
    assert kept.rounds <= 4


def test_what_a_straight_stretch_takes_is_said_to_be_that():
    kept = kept_of("abb_irb2400_155", 0)
    assert not kept.done
    assert "the straight stretch between two zones needs that" in kept.statement


def test_plan_itself_says_which_call_does_it(circle, arm, tool, placement):
    assert PlanOptions().between_nodes == "reported"
    assert kerfpath.keep_limits is keep_limits
    with pytest.raises(TypeError, match=r"between_nodes.*kerfpath\.keep_limits\(plan\)"):
        plan(circle, arm, tool=tool, placement=placement, speed=0.1, between_nodes="kept")


@pytest.mark.parametrize("by", [plan, plan_in_pieces])
def test_a_guarantee_is_refused_by_what_cannot_give_it(by, circle, arm, tool, placement):
    asked = PlanOptions(between_nodes="guaranteed")
    with pytest.raises(InputError, match=rf"{by.__name__} holds .* kerfpath\.keep_limits\(plan\)"):
        by(circle, arm, tool=tool, placement=placement, speed=0.1, options=asked)


@pytest.mark.slow
def test_the_example_of_the_page_runs(capsys):
    page = (ROOT / "docs" / "programs.md").read_text()
    (code,) = [c for c in re.findall(r"```python\n(.*?)```", page, re.DOTALL) if "keep_limits" in c]
    made = {}
    exec(compile(code, "programs.md", "exec"), made)
    assert capsys.readouterr().out.startswith("True it keeps the limits between the nodes")
    before, after = (
        executed(made["program"](one), controller=made["controller"])[0].acceleration_bound
        for one in (made["plan"], made["kept"].plan)
    )
    assert after <= 1 < before
