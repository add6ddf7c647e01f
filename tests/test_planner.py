"""plan(): the whole way from contour to plan, and its answers when there is none."""

import numpy as np
import pytest

from kerfpath import Contour, InputError, NoFeasiblePath, audit, plan, robot
from kerfpath.planner import layered_graph, node_interval

STEP = np.radians(5)


@pytest.fixture(scope="module")
def made(circle, arm, tool, placement):
    return plan(circle, arm, tool=tool, placement=placement, speed=0.1, gamma_step=STEP)


def test_the_tool_is_on_the_contour_at_every_node(made, circle, tool):
    T = made.robot.forward(made.q) @ tool
    np.testing.assert_allclose(T[:, :3, 3], made.points, atol=1e-9)
    np.testing.assert_allclose(T[:, :3, 2], made.axes, atol=1e-9)
    np.testing.assert_allclose(
        made.points - circle.points, np.tile([1.2, 0, 0.4], (121, 1)), atol=1e-12
    )


def test_gamma_is_the_angle_from_the_task_frame(made, circle, tool, placement):
    H = placement @ circle.frames("rotation-minimising")
    x = (made.robot.forward(made.q) @ tool)[:, :3, 0]
    angle = np.arctan2((x * H[:, :3, 1]).sum(1), (x * H[:, :3, 0]).sum(1))
    np.testing.assert_allclose(np.cos(angle - made.gamma), 1, atol=1e-12)


def test_limits_hold_and_time_runs_at_the_speed(made):
    criteria = made.criteria
    assert criteria.peak_velocity.max() <= 1 + 1e-9
    assert criteria.peak_acceleration.max() <= 1 + 1e-9
    np.testing.assert_allclose(np.diff(made.time), made.dt, rtol=1e-9)
    assert made.contour.length / made.time[-1] == pytest.approx(0.1, rel=1e-9)
    assert made.velocity_share.shape == (len(made.q) - 1, 6)
    assert made.acceleration_share.shape == (len(made.q) - 2, 6)
    assert sum(made.counts.values()) == len(made.q) * 72 * 8


def test_turns_and_postures_belong_to_the_joints(made):
    base = made.q - 2 * np.pi * made.turn
    assert ((base > -np.pi - 1e-9) & (base <= np.pi + 1e-9)).all()
    found = made.robot.inverse(made.robot.forward(made.q))
    same = np.abs(found.q - made.q[found.pose]).max(axis=1) < 1e-9
    np.testing.assert_array_equal(found.posture[same], made.posture[found.pose[same]])
    assert same.sum() == len(made.q)


def test_a_kept_graph_gives_the_same_plan(made, circle, arm, tool, placement):
    graph = layered_graph(circle, arm, tool=tool, placement=placement, gamma_step=STEP)
    again = plan(
        circle, arm, tool=tool, placement=placement, speed=0.1, gamma_step=STEP, graph=graph
    )
    np.testing.assert_array_equal(again.q, made.q)
    with pytest.raises(InputError, match="has 121 layers, but the contour has 61 nodes"):
        plan(circle.resample(count=61), arm, tool=tool, placement=placement, speed=0.1, graph=graph)


def test_the_choice_of_objective_shows_in_the_criteria(circle, arm, tool, placement):
    options = {"tool": tool, "placement": placement, "speed": 0.1, "gamma_step": STEP, "eta_a": 9}
    smooth = plan(circle, arm, objective="sum", **options)
    even = plan(circle, arm, objective="max", **options)
    weight = smooth.settings.weights
    largest = [np.abs(p.increments * weight).sum(1).max() for p in (smooth, even)]
    total = [np.abs(p.increments * weight).sum() for p in (smooth, even)]
    assert total[0] <= total[1]
    assert largest[1] <= largest[0]
    assert smooth.cost == pytest.approx(total[0])
    assert even.cost == pytest.approx(largest[1])


def test_times_of_the_contour_are_used_and_a_second_speed_refused(circle, arm, tool, placement):
    timed = circle.resample(dt=0.05, speed=0.1)
    made = plan(timed, arm, tool=tool, placement=placement, gamma_step=STEP)
    assert made.dt == pytest.approx(timed.time[1])
    with pytest.raises(InputError, match="carries its own times"):
        node_interval(timed, 0.1)
    with pytest.raises(InputError, match="give a speed"):
        node_interval(circle, None)


def test_uneven_nodes_are_refused_with_what_to_do(arm, tool, placement):
    c = Contour([[0, 0, 0], [0.01, 0, 0], [0.03, 0, 0]], np.tile([0, 0, -1.0], (3, 1)))
    with pytest.raises(InputError, match=r"steps run from 0.01 to 0.02 m.*resample"):
        plan(c, arm, tool=tool, placement=placement, speed=0.1)


def test_a_part_out_of_reach_is_an_answer_with_node_and_counts(circle, arm, tool, placement):
    far = placement.copy()
    far[0, 3] = 2.3
    with pytest.raises(NoFeasiblePath, match="no admissible pose at node") as caught:
        plan(circle, arm, tool=tool, placement=far, speed=0.1, gamma_step=STEP)
    broken = caught.value
    assert broken.proved
    assert sum(broken.counts.values()) == 72 * 8
    assert broken.counts["unreachable"] > 0
    assert f"node {broken.node + 1} " in str(broken)


def test_too_fast_is_an_answer_with_the_joint(circle, arm, tool, placement):
    with pytest.raises(NoFeasiblePath, match=r"contour 'circle': no admissible edge") as caught:
        plan(circle, arm, tool=tool, placement=placement, speed=20.0, gamma_step=STEP)
    assert any(reason.startswith("velocity, joint") for reason in caught.value.counts)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"speed": -0.1}, "speed: expected a number above 0 m/s"),
        ({"gamma_step": 0}, "gamma_step"),
        ({"frames": "frenet"}, "frames: expected one of"),
        ({"metric": "taxi"}, "metric"),
        ({"weights": [1, 2]}, "weights: expected shape"),
        ({"eta_v": -1}, "eta_v"),
        ({"tool": np.eye(3)}, r"tool: expected shape \(4, 4\)"),
        ({"tool": 2 * np.eye(4)}, "tool: the last row must be 0 0 0 1"),
        ({"placement": np.diag([1.0, 1, -1, 1])}, "placement: .* right-handed rotation"),
    ],
)
def test_bad_input_is_refused(change, message, circle, arm, tool, placement):
    options = {"tool": tool, "placement": placement, "speed": 0.1, "gamma_step": STEP} | change
    with pytest.raises(InputError, match=message):
        plan(circle, arm, **options)


def test_a_robot_without_accelerations_is_refused(circle, tool, placement):
    with pytest.raises(InputError, match="joint accelerations are not known"):
        plan(circle, robot("abb_irb4600_60_205"), tool=tool, placement=placement, speed=0.1)


def test_the_default_is_the_proved_optimum(made, circle, arm, tool, placement):
    assert made.proof.optimal
    assert made.settings.method == "exact"
    options = {"tool": tool, "placement": placement, "speed": 0.1, "gamma_step": STEP}
    greedy = plan(circle, arm, method="paper", **options)
    assert made.cost <= greedy.cost * (1 + 1e-12)
    known = plan(circle, arm, method="known", **options)
    assert not known.proof.optimal
    assert "tests neither velocity nor acceleration" in known.proof.statement


def test_a_periodic_plan_returns_to_where_it_began(made, circle, arm, tool, placement):
    options = {"tool": tool, "placement": placement, "speed": 0.1, "gamma_step": STEP}
    closed = plan(circle, arm, closure="periodic", **options)
    turns = (closed.q[-1] - closed.q[0]) / (2 * np.pi)
    np.testing.assert_allclose(turns, np.round(turns) * closed.robot.endless, atol=1e-9)
    assert closed.cost >= made.cost * (1 - 1e-12)
    seam = (closed.increments[0] - closed.increments[-1]) / closed.dt**2
    assert (np.abs(seam) <= closed.robot.acceleration * (1 + 1e-6)).all()
    with pytest.raises(InputError, match="is open and cannot be periodic"):
        plan(
            Contour(circle.points[:60], circle.axes[:60], name="half").resample(count=60),
            arm,
            closure="periodic",
            **options,
        )


def test_where_the_grid_has_no_path_one_is_found_off_it(circle, arm, tool, placement):
    """A coarse grid quantises the acceleration: (6) fails on it and holds beside it."""
    options = {"tool": tool, "placement": placement, "speed": 0.6, "gamma_step": np.radians(4)}
    with pytest.raises(NoFeasiblePath) as broken:
        plan(circle, arm, **options)
    assert broken.value.proved
    made = plan(circle, arm, refine=True, **options)
    assert np.abs(made.acceleration_share).max() <= 1
    assert not made.proof.optimal
    assert "brought inside limits" in made.proof.statement
    assert audit(made) == []
    with pytest.raises(NoFeasiblePath, match="off the grid not refined: the "):
        plan(circle, arm, refine=True, **options | {"speed": 0.7, "eta_a": 0.3})
