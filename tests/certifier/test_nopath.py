"""No motion at any gamma: never said where a plan keeps the limits, and said where none can."""

from dataclasses import replace

import numpy as np
import pytest

from kerfpath import NoFeasiblePath, audit, fastest_speed, plan
from kerfpath.certifier import MotionTest, infeasibility
from kerfpath.certifier.stages import Steps
from kerfpath.contour import Contour
from kerfpath.effort import changed_effort
from kerfpath.errors import Closed
from kerfpath.kernels.metric import MANHATTAN
from kerfpath.limits import Limits
from kerfpath.tilt import Tilt

STEP = np.radians(10)
SEEDS = range(3)


def test_of(contour, arm, tool, placement):
    return MotionTest(arm, placement @ contour.frames("rotation-minimising"), tool)


test_of.__test__ = False  # it makes a test of motions


def drawn(seed):
    """Return a random short closed contour in front of the robot, on a curved surface."""
    rng = np.random.default_rng([2026, seed])
    t = np.linspace(0, 2 * np.pi, 33)
    r = 0.06 + 0.02 * rng.uniform(-1, 1) * np.cos(2 * t + rng.uniform(0, 6))
    lean = 0.3 * np.stack([np.cos(t + rng.uniform(0, 6)), np.sin(t + rng.uniform(0, 6))], axis=1)
    points = np.stack([r * np.cos(t), r * np.sin(t), 0.02 * np.cos(3 * t)], axis=1)
    points[-1] = points[0]
    axes = np.column_stack([lean, -np.ones(33)])
    axes[-1] = axes[0]
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    points[:, 1] += rng.uniform(-0.2, 0.2)
    return Contour(points, axes, closed=True).resample(count=25)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_contour_with_a_plan_is_never_closed_and_a_far_too_fast_one_is(
    seed, arm, tool, placement
):
    nodes, limits = drawn(seed), Limits.of(*arm.speed_limits())
    test = test_of(nodes, arm, tool, placement)
    speed = 0.4
    while True:
        try:
            made = plan(nodes, arm, tool=tool, placement=placement, speed=speed, gamma_step=STEP)
            break
        except NoFeasiblePath:
            speed *= 0.8
    # The very limits that the plan uses up, and not a hair more.
    assert audit(made) == []
    peak = max(made.criteria.peak_velocity.max(), made.criteria.peak_acceleration.max() ** 0.5)
    assert test.closed(limits, made.dt * min(peak, 1.0)) is None
    closed = test.closed(limits, made.dt / 20)
    assert closed is not None
    assert 0 <= closed.node < len(nodes) - 1
    assert test.closed(limits, made.dt / 20, closed.node, brief=True) is not None


def test_a_brief_test_ends_where_halving_rules_out_little(
    arm, tool, placement, monkeypatch, ceiling_at_work
):
    """It takes fewer rounds than the whole test to find nothing out."""
    test, limits = test_of(drawn(0), arm, tool, placement), Limits.of(*arm.speed_limits())
    rounds, forward = [], infeasibility.Elimination.forward
    monkeypatch.setattr(
        infeasibility.Elimination, "forward", lambda one: (rounds.append(one), forward(one))[1]
    )
    slow = 0.06
    assert test.closed(limits, slow, 12) is None
    whole = len(rounds)
    rounds.clear()
    assert test.closed(limits, slow, 12, brief=True) is None
    assert infeasibility.FROM_HALVING <= len(rounds) < whole


def test_a_refusal_says_that_it_holds_at_every_gamma(circle, arm, tool, placement):
    nodes = circle.resample(count=31)
    options = {"tool": tool, "placement": placement, "gamma_step": STEP}
    with pytest.raises(NoFeasiblePath, match="proved for every rotation: no motion") as caught:
        plan(nodes, arm, speed=5.0, **options)
    none = caught.value
    assert none.scope == "every gamma"
    assert none.proved
    assert f"from node {none.closed.node}" in str(none)
    assert f"the {none.closed.limit} limit of joint {none.closed.joint + 1}" in str(none)
    with pytest.raises(NoFeasiblePath) as caught:
        plan(nodes, arm, speed=5.0, method="exact", **options)
    assert caught.value.scope == "grid"
    assert caught.value.closed is None


def test_where_the_tip_alone_is_too_fast_one_step_tells(circle, arm, tool, placement):
    # 2 m in 10 ms: no joint at its limit for that long moves the tip as far.
    points = np.array([[0.0, -1.0, 0.0], [0.0, 1.0, 0.0]])
    line = Contour(points, np.tile([0.0, 0.0, -1.0], (2, 1)), closed=False)
    closed = test_of(line, arm, tool, placement).closed(Limits.of(*arm.speed_limits()), 0.01)
    assert (closed.node, closed.limit) == (0, "velocity")


def test_a_node_out_of_reach_has_no_pose(arm, tool, placement):
    points = np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [9.0, 0.0, 0.0]])
    line = Contour(points, np.tile([0.0, 0.0, -1.0], (3, 1)), closed=False)
    closed = test_of(line, arm, tool, placement).closed(Limits.of(*arm.speed_limits()), 100.0)
    assert (closed.node, closed.joint, closed.limit) == (1, None, "pose")
    assert str(closed) == "node 2 has no pose within the ranges of the joints"


@pytest.mark.parametrize(
    ("share", "count", "longest"),
    [(0.5, 41, 1), (30, 41, 2), (60, 41, 3), (1e6, 41, 5), (1e6, 9, 1), (1e6, 2, 1)],
)
def test_layers_are_farther_apart_where_joints_take_long_to_reach_their_velocity(
    share, count, longest
):
    """From the first node to the last, at most the given number of intervals apart; and rotations
    of joints between them stay below half a turn."""
    steps = Steps(
        weight=np.ones(3), velocity=np.full(3, 0.3), acceleration=np.full(3, 0.3 / share),
        metric=MANHATTAN, endless=np.zeros(3, bool),
    )  # fmt: skip
    found = steps.layers(3, 2 + count)
    assert found[[0, -1]].tolist() == [3, 2 + count]
    assert np.diff(found).max() == longest
    fast = replace(steps, velocity=np.full(3, 1.4), acceleration=np.full(3, 1e-9))
    assert np.diff(fast.layers(0, 40)).max() == 2


def motion(arm, nodes, tool, placement, rng, wild):
    """Return the joints (K, n) of some motion along the nodes, gamma wandering; None where none."""
    frames = placement @ nodes.frames("rotation-minimising")
    gamma = rng.uniform(-3, 3) + np.cumsum(rng.normal(0, wild, len(nodes)))
    q = None
    for frame, angle in zip(frames, gamma, strict=True):
        c, s = np.cos(angle), np.sin(angle)
        spin = np.eye(4)
        spin[:2, :2] = [[c, -s], [s, c]]
        solutions = arm.inverse(frame @ spin @ np.linalg.inv(tool)).q
        if not len(solutions):
            return None
        # The first at random, then the nearest: often, not always, in one posture.
        pick = rng.integers(len(solutions))
        if q is not None:
            pick = np.argmin(np.abs(increments([q[-1], *solutions], arm, first=True)).max(axis=1))
        q = [solutions[pick]] if q is None else [*q, solutions[pick]]
    return np.array(q)


def increments(q, arm, *, first=False):
    """Return the increments of rows, or those from the first row; endless joints the short way."""
    q = np.asarray(q)
    dq = q[1:] - q[0] if first else np.diff(q, axis=0)
    return np.where(arm.endless, dq - 2 * np.pi * np.rint(dq / (2 * np.pi)), dq)


def test_where_both_limits_rule_a_node_out_no_joint_is_named():
    closed = Closed(node=3, joint=None, limit="both")
    assert str(closed) == "no motion within the velocity and acceleration limits passes node 4"


@pytest.mark.slow
@pytest.mark.usefixtures("ceiling_at_work")
@pytest.mark.parametrize(("wild", "stride"), [(0.0, 2), (0.01, 1), (0.1, 3)])
def test_no_motion_is_ruled_out_by_limits_that_it_keeps(
    arm, tool, placement, wild, stride, monkeypatch
):
    """Whether cells are at all nodes or at some."""
    monkeypatch.setattr(Steps, "layers", lambda _, a, b: np.append(np.arange(a, b, stride), b))
    done = 0
    for seed in range(6):
        rng = np.random.default_rng([7, seed, int(1000 * wild)])
        nodes = drawn(seed)
        q = motion(arm, nodes, tool, placement, rng, wild)
        if q is None:
            continue
        dq = increments(q, arm)
        # Just what it uses, at an interval of 1 s; a joint that stands still needs some limit.
        fast = np.maximum(np.abs(dq).max(axis=0), 1e-6)
        sharp = np.maximum(np.abs(np.diff(dq, axis=0)).max(axis=0), 1e-6)
        limits = Limits.of(fast, sharp)
        assert test_of(nodes, arm, tool, placement).closed(limits, 1.0) is None
        done += 1
    assert done >= 3


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2))
def test_no_plan_reaches_the_ceiling_of_the_speed(seed, arm, tool, placement):
    nodes = drawn(seed)
    options = {"tool": tool, "placement": placement, "gamma_step": STEP}
    told = fastest_speed(nodes, arm, refine=True, ceiling=True, **options)
    assert told.ceiling is not None
    # On a finer grid a path may be faster; none is as fast as what is impossible.
    fine = fastest_speed(nodes, arm, refine=True, **options | {"gamma_step": np.radians(2)})
    assert fine.ceiling is None
    assert max(told.speed, fine.speed) < told.ceiling
    with pytest.raises(NoFeasiblePath):
        plan(nodes, arm, speed=told.ceiling, **options)


def test_without_an_enclosure_nothing_is_said_of_other_gammas(circle, arm, tool, placement):
    options = {"tool": tool, "placement": placement, "gamma_step": STEP}
    tilt = Tilt(cone=0.05, steps=1)
    nodes = circle.resample(count=15)
    told = fastest_speed(nodes, arm, ceiling=True, tilt=tilt, **options)
    assert told.ceiling is None
    with pytest.raises(NoFeasiblePath) as caught:
        plan(nodes, arm, speed=20.0, tilt=tilt, **options)
    assert caught.value.scope == "grid"
    assert "rotation: no motion" not in str(caught.value)


@pytest.mark.slow
def test_what_is_undecided_is_said_to_be(circle, arm, tool, placement):
    nodes = circle.resample(count=31)
    options = {"tool": tool, "placement": placement, "gamma_step": STEP}
    told = fastest_speed(nodes, arm, refine=True, ceiling=True, **options)
    undecided = pytest.raises(
        NoFeasiblePath, match="whether there is a motion off the grid is undecided"
    )
    with changed_effort(infeasibility_tubes=1), undecided:
        plan(nodes, arm, speed=0.935 * told.ceiling, **options)
