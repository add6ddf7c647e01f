"""plan(): the whole way from contour to plan, and its answers when there is none."""

import itertools
from contextlib import suppress
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from kerfpath import Contour, InputError, NoFeasiblePath, audit, plan, plan_in_pieces, robot
from kerfpath.limits import Limits
from kerfpath.planner import layered_graph, node_interval
from kerfpath.retime import retime

STEP = np.radians(5)
IN_LINE = 0.05  # sine of joint 5: nearer than this to its zero the wrist is all but singular


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
    with pytest.raises(
        NoFeasiblePath, match=r"contour 'circle': on this grid of the rotation no admissible edge"
    ) as caught:
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


def test_the_exact_method_is_proved_and_the_default_is_better_still(
    made, circle, arm, tool, placement
):
    assert made.settings.method == "continuous"
    options = {"tool": tool, "placement": placement, "speed": 0.1, "gamma_step": STEP}
    exact = plan(circle, arm, method="exact", **options)
    assert exact.proof.optimal
    assert made.cost < exact.cost
    greedy = plan(circle, arm, method="paper", **options)
    assert exact.cost <= greedy.cost * (1 + 1e-12)
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


def test_a_change_of_posture_that_no_path_can_make_is_named(circle, arm, tool, placement):
    """A graph that offers one posture in the first half and another in the second."""
    space = {"tool": tool, "placement": placement, "gamma_step": STEP}
    graph = layered_graph(circle, arm, postures=(0, 1), **space)
    node = np.repeat(np.arange(len(circle)), np.diff(graph.start))
    keep = np.where(node < 60, graph.posture == 0, graph.posture == 1)
    parted = replace(
        graph,
        q=graph.q[keep],
        start=np.concatenate([[0], np.cumsum(np.bincount(node[keep]))]),
        sample=graph.sample[keep],
        variant=graph.variant[keep],
        posture=graph.posture[keep],
        turn=graph.turn[keep],
    )
    with pytest.raises(NoFeasiblePath, match="change from front/up/plus to front/up/minus") as cut:
        plan(circle, arm, graph=parted, speed=0.1, **space)
    assert (cut.value.node, cut.value.back) == (59, 60)


@pytest.mark.slow
def test_where_the_grid_has_no_path_one_is_found_off_it(circle, arm, tool, placement):
    """A coarse grid quantises the acceleration: (6) fails on it and holds beside it."""
    options = {"tool": tool, "placement": placement, "speed": 0.6, "gamma_step": np.radians(4)}
    exact = options | {"method": "exact"}
    with pytest.raises(NoFeasiblePath) as broken:
        plan(circle, arm, **exact)
    assert broken.value.proved
    made = plan(circle, arm, refine=True, **exact)
    assert np.abs(made.acceleration_share).max() <= 1
    assert not made.proof.optimal
    assert "brought inside limits" in made.proof.statement
    assert audit(made) == []
    with pytest.raises(NoFeasiblePath, match="off the grid not refined: the "):
        plan(circle, arm, refine=True, **exact | {"speed": 0.7, "eta_a": 0.3})
    # Over continuous gamma it is found at once.
    found = plan(circle, arm, **options)
    assert found.cost <= made.cost * (1 + 1e-4)  # both are converged to that
    assert audit(found) == []


@pytest.fixture(scope="module")
def corner():
    """Two straight lines that meet at a right angle, the axis turning there too: 81 nodes."""
    along = np.linspace(0, 0.16, 81)
    points = np.stack([np.minimum(along, 0.08), np.maximum(along - 0.08, 0), 0 * along], axis=1)
    lean = 0.3 / (1 + np.exp((0.08 - along) / 0.004))
    return Contour(points, np.c_[lean, 0 * along, -np.ones(81)], name="corner")


@pytest.mark.slow
@pytest.mark.parametrize("refine", [False, True])
def test_the_feed_dips_where_the_limits_ask_for_it(corner, arm, tool, placement, refine):
    options = {"tool": tool, "placement": placement, "gamma_step": STEP, "speed": 0.4}
    with pytest.raises(NoFeasiblePath):
        plan(corner, arm, refine=refine, **options)
    made = plan(corner, arm, feed="dip", refine=refine, **options)
    assert audit(made) == []
    assert np.abs(made.velocity_share).max() <= 1 + 1e-9
    assert np.abs(made.acceleration_share).max() <= 1 + 1e-6
    tau, dt = np.diff(made.time), 0.002 / 0.4
    assert (tau >= dt * (1 - 1e-9)).all()
    at_speed = tau <= dt * (1 + 1e-9)
    assert made.feed.full == pytest.approx(at_speed.mean(), abs=1e-9)
    assert 0.2 < made.feed.full < 1
    assert made.feed.slowest == pytest.approx((dt / tau).min())
    assert abs(made.feed.node - 40) < 10  # at the corner
    assert f"joint {made.feed.joint + 1} binds" in str(made.feed)


def test_off_the_grid_the_feed_dips_less(corner, arm, tool, placement):
    options = {"tool": tool, "placement": placement, "gamma_step": STEP, "speed": 0.4}
    options |= {"method": "exact"}
    grid, off = (plan(corner, arm, feed="dip", refine=r, **options) for r in (False, True))
    assert off.time[-1] < grid.time[-1]


@pytest.mark.slow
@pytest.mark.parametrize("moved", [True, False])
def test_a_dip_is_never_slower_than_on_the_grid(monkeypatch, corner, arm, tool, placement, moved):
    if not moved:  # off the grid nothing is gained
        monkeypatch.setattr("kerfpath.refiner.reduce_excess", lambda plan, **_: plan)
        monkeypatch.setattr("kerfpath.refiner.refine", lambda plan: SimpleNamespace(plan=plan))
    options = {"tool": tool, "placement": placement, "gamma_step": STEP, "feed": "dip"}
    options["method"] = "exact"
    for speed in (0.2, 0.4):
        grid, off = (plan(corner, arm, speed=speed, refine=r, **options) for r in (False, True))
        assert (off.time[-1], off.cost) <= (grid.time[-1], grid.cost)
        assert moved == (off.time[-1] < grid.time[-1])
        # The best path without acceleration limits, slowed down, is a plan on the grid, too.
        easy = arm.with_limits(acceleration=np.full(6, 1e6))
        with suppress(NoFeasiblePath):
            path = plan(corner, easy, speed=speed, **{**options, "feed": "constant"})
            times = retime(path.increments, path.dt, Limits.of(*arm.speed_limits()))
            assert grid.time[-1] <= times.sum() * (1 + 1e-9)


def require_clean(made, **options):
    """Assert an audit without issues, or where joints 4 and 6 are nearly in line, with that one."""
    in_line = np.abs(np.sin(made.q[:, 4])).min() < IN_LINE
    assert [i.code for i in audit(made, **options)] == ["unbounded"] * bool(in_line)


def test_the_pieces_of_an_interrupted_cut(corner, arm, tool, placement):
    options = {"tool": tool, "placement": placement, "gamma_step": STEP, "speed": 0.1}
    freely = plan_in_pieces(corner, arm, **options)
    options |= {"method": "exact"}
    pieces = plan_in_pieces(corner, arm, **options)
    assert len(pieces) > 1
    assert pieces[0].name == f"corner, piece 1 of {len(pieces)}"
    for p in pieces:
        require_clean(p, reference=corner.between(p.contour.s[0], p.contour.s[-1]))
        assert p.proof.optimal
        # Gamma still counts from the frames of the whole contour.
        H = p.T_base_part @ p.contour.frames("rotation-minimising")
        x = (p.robot.forward(p.q) @ tool)[:, :3, 0]
        angle = np.arctan2((x * H[:, :3, 1]).sum(1), (x * H[:, :3, 0]).sum(1))
        np.testing.assert_allclose(np.cos(angle - p.gamma), 1, atol=1e-9)
    for before, after in itertools.pairwise(pieces):
        np.testing.assert_array_equal(before.contour.points[-1], after.contour.points[0])
    assert pieces[0].contour.s[0] == corner.s[0]
    assert pieces[-1].contour.s[-1] == corner.s[-1]
    refined = plan_in_pieces(corner, arm, refine=True, **options)
    assert all(r.cost <= p.cost for r, p in zip(refined, pieces, strict=True))
    # Over continuous gamma each piece is at least as good, and as long.
    assert all(f.cost <= r.cost * (1 + 1e-9) for f, r in zip(freely, refined, strict=True))
    assert [f.name for f in freely] == [p.name for p in pieces]
    for p in freely:
        require_clean(p)
    whole = plan_in_pieces(corner, arm, **options | {"speed": 0.05})
    assert [p.name for p in whole] == ["corner"]
    shortest = min(float(np.ptp(p.contour.s)) for p in pieces)
    longer = plan_in_pieces(corner, arm, least_piece=shortest + 0.004, **options)
    assert min(float(np.ptp(p.contour.s)) for p in longer) >= shortest + 0.004 - 1e-9
    for p in longer:
        require_clean(p)
    with pytest.raises(NoFeasiblePath, match=r"no division into pieces of 150 mm or more"):
        plan_in_pieces(corner, arm, least_piece=0.15, **options)
    with pytest.raises(InputError, match=r"least_piece: expected a number above 0 m"):
        plan_in_pieces(corner, arm, least_piece=0.0, **options)
    with pytest.raises(InputError, match='method: expected "continuous" or "exact" with inter'):
        plan_in_pieces(corner, arm, **options | {"method": "paper"})
    turned = np.where(arm.endless, 1.0, np.inf)
    for wrong in ({"closure": "periodic"}, {"rotation": turned}):
        with pytest.raises(InputError, match=r"^(closure|rotation): expected"):
            plan_in_pieces(corner, arm, **options, **wrong)
    with pytest.raises(NoFeasiblePath, match="no number of interruptions helps"):
        plan_in_pieces(corner, arm, **options | {"speed": 20})


def test_a_hose_limits_how_far_an_endless_joint_turns(circle, arm, tool, placement):
    options = {"tool": tool, "placement": placement, "speed": 0.1, "gamma_step": STEP}
    free = plan(circle, arm, **options)
    turned = np.abs(np.cumsum(free.increments, axis=0)).max(axis=0)
    limit = np.full(6, np.inf)
    limit[5] = 0.9 * turned[5]
    held = plan(circle, arm, rotation=limit, refine=True, **options)
    assert np.abs(np.cumsum(held.increments, axis=0)).max(axis=0)[5] <= limit[5]
    assert audit(held) == []
    assert audit(replace(free, settings=held.settings))[0].code == "rotation"
    with pytest.raises(InputError, match="rotation: joint 1 is not endless"):
        plan(circle, arm, rotation=np.ones(6), **options)


def test_a_feed_that_need_not_dip_is_constant(circle, arm, tool, placement, made):
    same = plan(circle, arm, tool=tool, placement=placement, speed=0.1, gamma_step=STEP, feed="dip")
    np.testing.assert_array_equal(same.q, made.q)
    assert same.feed is None
    for wrong in ({"feed": "dips"}, {"feed": "dip", "objective": "max"}):
        with pytest.raises(InputError, match="feed"):
            plan(circle, arm, tool=tool, placement=placement, speed=0.1, **wrong)
