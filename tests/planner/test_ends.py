"""Plans from where the robot stands to where it goes: the moves, and what they choose."""

import re
from dataclasses import replace

import numpy as np
import pytest

import kerfpath
from kerfpath import Contour, InputError, NoFeasiblePath, PlanOptions, audit, plan
from kerfpath.auditor import checks
from kerfpath.cell import box_between, cell_of
from kerfpath.job.plan_file import plan_document, plan_entry, plan_text
from kerfpath.post import build_program, preflight
from kerfpath.robots import posture_name
from kerfpath.sequence import order_plans
from kerfpath.transfer import back_off, least_times

HOME = np.radians([0, -20, 10, 0, 60, 0])
SLIT = Contour(
    np.c_[np.linspace(0, 0.03, 11), np.zeros((11, 2))],
    np.tile([0.0, 0.0, -1.0], (11, 1)),
    name="slit",
)


def turned(q, joint, degrees):
    q = np.array(q)
    q[joint] += np.radians(degrees)
    return q


def at(x, y, z):
    T = np.eye(4)
    T[:3, 3] = x, y, z
    return T


@pytest.fixture(scope="module")
def ask(arm, tool):
    """Plan the slit in front of the arm."""

    def planned(robot=arm, **more):
        asked = {"tool": tool, "placement": at(1.1, 0.1, 0.7), "speed": 0.04}
        return plan(SLIT, robot, **asked | {"gamma_step": np.radians(20)} | more)

    return planned


def two_ended(robot):
    """Return the robot with axes 4 and 6 limited to 400 deg either way."""
    lower, upper = robot.lower.copy(), robot.upper.copy()
    lower[[3, 5]], upper[[3, 5]] = np.radians(-400), np.radians(400)
    return robot.with_limits(lower=lower, upper=upper, endless=np.zeros(6, bool))


def test_the_moves_lead_from_where_the_robot_stands_and_to_where_it_goes(ask, arm):
    end = turned(turned(HOME, 0, 20), 4, 10)
    made = ask(start_q=HOME, end_q=end)
    np.testing.assert_array_equal(made.approach.q[0], HOME)
    np.testing.assert_allclose(made.approach.q[-1], made.q[0], atol=1e-12)
    np.testing.assert_allclose(made.retreat.q[0], made.unwrapped[-1], atol=1e-12)
    turns = (made.retreat.q[-1] - end) / (2 * np.pi)
    np.testing.assert_allclose(turns, np.where(arm.endless, np.round(turns), 0), atol=1e-12)
    np.testing.assert_allclose(made.approach.time, least_times(arm, made.approach.q), rtol=1e-12)
    assert not made.approach.clear  # no cell was given
    assert audit(made).passed
    alone = ask(start_q=HOME)
    assert alone.retreat is None
    assert ask().approach is None


@pytest.mark.parametrize("seed", range(3))
def test_no_turn_and_no_posture_that_costs_the_same_has_shorter_moves(ask, arm, seed):
    robot, rng = two_ended(arm), np.random.default_rng(seed)
    limits = robot.joint_limits()
    start = limits.lower + (limits.upper - limits.lower) * rng.uniform(0.1, 0.9, 6)
    made = ask(robot, start_q=start, tool=at(0.05, 0.02, 0.1))
    free = ask(robot, tool=at(0.05, 0.02, 0.1))
    # The other posture of the wrist, by its law: the same flange poses and the same steps.
    other = free.q + np.pi * np.array([0, 0, 0, 1, 0, 1])
    other[:, 4] *= -1
    np.testing.assert_allclose(robot.forward(other), robot.forward(free.q), atol=1e-9)
    assert made.cost <= 1.01 * free.cost
    shortest = np.inf
    for q in (free.q[0], other[0]):
        for four in range(-2, 3):
            for six in range(-2, 3):
                there = q + 2 * np.pi * np.array([0, 0, 0, four, 0, six])
                if ((there >= limits.lower) & (there <= limits.upper)).all():
                    took = least_times(robot, np.array([start, there]))[-1]
                    shortest = min(shortest, took)
    # The tool is off axis 6, so no rotation about the beam costs the same; refined again, the
    # motion may begin a little elsewhere.
    assert made.approach.duration <= 1.01 * shortest
    assert audit(made).passed


def test_a_job_with_a_home_has_the_same_moves(ask):
    made = ask(start_q=HOME, end_q=HOME, options=PlanOptions(retract=0.02))
    part = order_plans([[replace(made, approach=None, retreat=None)]], home=HOME, retract=0.02)
    for own, of_part in zip((made.approach, made.retreat), part.moves, strict=True):
        np.testing.assert_allclose(own.q, of_part.q, atol=1e-12)
        np.testing.assert_allclose(own.time, of_part.time, rtol=1e-12)
    np.testing.assert_array_equal(made.q, part.plans[0].q)


def test_with_a_retract_the_moves_lead_to_where_the_tool_has_backed_off(ask, arm, tool):
    made = ask(start_q=HOME, end_q=HOME, options=PlanOptions(retract=0.02))
    T = arm.forward(np.array([made.approach.q[-1], made.q[0]])) @ tool
    np.testing.assert_allclose(T[0, :3, 3], T[1, :3, 3] - 0.02 * T[1, :3, 2], atol=1e-9)
    np.testing.assert_allclose(made.approach.q[-1], back_off(made, "start", 0.02), atol=1e-12)
    assert audit(made).passed
    program = build_program([made], retract=0.02)
    moves = program.moves
    np.testing.assert_array_equal(moves[0].q, HOME)
    np.testing.assert_array_equal(moves[-1].q, made.retreat.q[-1])
    assert not [issue for issue in preflight(program) if issue.level == "error"]
    with pytest.raises(InputError, match="mm off the point where the tool is backed off by 50 mm"):
        build_program([made])
    with pytest.raises(InputError, match="has an approach or a retreat of its own"):
        build_program([made, replace(made, contour=replace(SLIT, name="two"))], retract=0.02)


@pytest.fixture(scope="module")
def lane(arm, tool):
    """A lane too narrow to turn in: an arm that is folded behind itself stays so."""
    placement = at(0.9, 0.0, 0.6)
    walls = {
        "left": box_between([-1.2, 0.34, -0.2], [1.3, 0.39, 3]),
        "right": box_between([-1.2, -0.39, -0.2], [1.3, -0.34, 3]),
    }
    cell = cell_of(arm, tool=tool, placement=placement, fixtures=walls)
    return {"placement": placement, "cell": cell}


@pytest.mark.slow
def test_another_posture_is_taken_where_only_it_can_be_reached(ask, lane, monkeypatch):
    monkeypatch.setattr("kerfpath.planner.ends.SECONDS", 0.5)
    ahead, folded = ask(**lane, postures=(0,)), ask(**lane, postures=(4,))
    assert ask(**lane, postures=(0, 4)).cost == pytest.approx(min(ahead.cost, folded.cost), rel=0.1)
    behind = folded.q[0] - [0, 0.3, 0, 0, 0, 0]
    for start, side in ((HOME, "front"), (behind, "rear")):
        made = ask(**lane, start_q=start)
        assert posture_name(int(made.posture[0])).startswith(side)
        assert made.approach.clear
        assert audit(made, cell=lane["cell"], interpolation="joint").passed
    with pytest.raises(NoFeasiblePath, match="from start_q to the start of contour 'slit'") as no:
        ask(**lane, start_q=behind, postures=(0,))
    assert not no.value.proved
    assert re.search("'(left|right)' and '.*' come .* nearer than allowed", str(no.value))


def test_the_way_leads_around_what_stands_between(ask, arm, tool):
    there = at(1.1, 0.1, 0.7)
    post = box_between([0.75, 0.35, 0], [0.95, 0.45, 1.6])
    cell = cell_of(arm, tool=tool, placement=there, fixtures={"post": post})
    start = turned(HOME, 0, 60)
    made = ask(start_q=start, cell=cell)
    assert len(made.approach.q) > 2
    assert made.approach.clear
    assert audit(made, cell=cell, interpolation="joint").passed
    straight = replace(made.approach, q=made.approach.q[[0, -1]], time=made.approach.time[[0, -1]])
    codes = {i.code for i in audit(replace(made, approach=straight), cell=cell)}
    assert "approach-collision" in codes


def test_the_audit_finds_moves_that_do_not_meet_the_cut_or_are_too_quick(ask):
    made = ask(start_q=HOME, end_q=HOME)

    def codes(**changed):
        return {issue.code for issue in audit(replace(made, **changed))}

    assert codes() == set()
    off = made.approach.q + np.array([0, 0, 0, 0, 0, 1e-3])
    assert codes(approach=replace(made.approach, q=off)) == {"approach-ends"}
    quick = replace(made.retreat, time=0.9 * made.retreat.time)
    assert codes(retreat=quick) == {"retreat-time"}
    late = replace(made.approach, time=made.approach.time + 1)
    assert codes(approach=late) == {"approach-begins"}
    far = made.approach.q.copy()
    far[0, 1] += 10
    slow = replace(made.approach, q=far, time=100 * made.approach.time)
    assert codes(approach=slow) == {"approach-limits"}
    assert kerfpath.refine(made).plan.approach is None


def test_ends_that_cannot_be_are_refused_in_a_line(ask, arm, lane):
    for q, said in (
        (HOME[:5], r"start_q: expected shape \(6\), got \(5,\).*the value of every joint"),
        (np.where(np.arange(6) == 2, np.nan, HOME), r"start_q\[2\] is nan"),
        ("home", "start_q: expected"),
        (turned(HOME, 1, 500), r"start_q: expected .* from -?\d+ deg to \d+ deg, got 480 d"),
    ):
        with pytest.raises(InputError, match=said) as bad:
            ask(start_q=q)
        assert "\n" not in str(bad.value)
    with pytest.raises(InputError, match="end_q: expected"):
        ask(end_q=turned(HOME, 1, 500))
    with pytest.raises(NoFeasiblePath, match=r"start_q: '.*' and '.*' come .* robot stands") as no:
        ask(**lane, start_q=turned(HOME, 0, 90))
    assert no.value.proved


def test_a_bound_is_that_of_the_motion_that_is_returned(ask):
    made = ask(start_q=HOME, certify=kerfpath.Certify(seconds=2, keep=True))
    assert made.proof.gap == pytest.approx((made.cost - made.proof.bound) / made.cost)
    assert made.approach is not None
    assert audit(made).passed


def test_plan_json_keeps_the_moves(ask, arm, tool, tmp_path):
    made = ask(start_q=HOME, end_q=HOME, options=PlanOptions(retract=0.02))
    path, rows = tmp_path / "plan.json", checks(made)
    entry = plan_entry(made, "slit", rows)
    assert {"approach-ends", "retreat-ends"} <= {row["code"] for row in entry["audit"]["checks"]}
    path.write_text(plan_text(plan_document(arm, tool, made.T_base_part, [entry], {})))
    (read,) = kerfpath.read_plan_file(path).plans
    for own, back in ((made.approach, read.approach), (made.retreat, read.retreat)):
        np.testing.assert_array_equal(own.q, back.q)
        np.testing.assert_array_equal(own.time, back.time)
    assert audit(read).passed


def test_external_axes_come_along(ask, arm):
    railed = arm.on_rail([0, 1, 0], lower=-1.0, upper=1.2, velocity=0.8, acceleration=1.5)
    start = np.append(HOME, -0.8)
    made = ask(railed, start_q=start, external=np.zeros((11, 1)), feed="dip")
    np.testing.assert_array_equal(made.approach.q[0], start)
    np.testing.assert_allclose(made.approach.q[-1], made.q[0], atol=1e-12)
    assert audit(made).passed
    with pytest.raises(InputError, match="start_q: expected rail from -1000 mm to 1200 mm, got 13"):
        ask(railed, start_q=np.append(HOME, 1.3))
