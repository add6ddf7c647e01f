"""Programs of targets, simulated: their ways, stops and corners, and what is refused."""

import numpy as np
import pytest
from scipy.interpolate import BSpline

import kerfpath
from kerfpath import InputError, Response, Target, simulate
from kerfpath.execution import IDEAL
from kerfpath.execution.path_error import Polyline

TOOL = np.eye(4)
TOOL[:3, 3] = [0.1, 0.0, 0.4]
START = np.array([0.1, 0.2, 0.1, 0.3, 0.9, 0.2])


@pytest.fixture(scope="module")
def robot():
    return kerfpath.robot("abb_irb6640_180_255")


@pytest.fixture(scope="module")
def first(robot):
    return robot.forward(START) @ TOOL


def shifted(pose, *by):
    moved = pose.copy()
    moved[:3, 3] += by
    return moved


def square(first, zone, kind="linear"):
    ways = [(0, 0, 0), (0.1, 0, 0), (0.1, 0.1, 0), (0, 0.1, 0), (0, 0, 0)]
    targets = [Target(kind="start", pose=first)]
    for way in ways[1:]:
        targets.append(Target(kind=kind, pose=shifted(first, *way), speed=0.1, zone=zone))
    return targets


def run(targets, robot, response=IDEAL, language="rapid"):
    return simulate(targets, robot, tool=TOOL, language=language, start=START, response=response)


def tips(robot, q):
    return (robot.forward(q) @ TOOL)[:, :3, 3]


def distance_to_square(points, first):
    """Distance (m,) of points from the square with a corner at the first pose."""
    x, y, z = (points - first[:3, 3]).T
    side = 0.1
    gaps = [np.hypot(x - np.clip(x, 0, side), y - at) for at in (0, side)]
    gaps += [np.hypot(y - np.clip(y, 0, side), x - at) for at in (0, side)]
    return np.hypot(np.min(gaps, axis=0), z)


def test_with_stops_every_tip_is_on_the_way_and_every_target_is_reached(robot, first):
    found = run(square(first, 0.0), robot)
    points = tips(robot, found.q)
    # Joints between samples of the way, 20 ms apart at most, are cubics through their rates.
    assert distance_to_square(points, first).max() < 2e-6
    for target in square(first, 0.0)[1:]:
        assert np.linalg.norm(points - target.pose[:3, 3], axis=1).min() < 2e-6
    assert np.diff(found.time).max() <= 0.004
    np.testing.assert_allclose(found.q[0], START, rtol=0, atol=1e-9)
    np.testing.assert_allclose(found.q[-1], START, rtol=0, atol=1e-6)


def test_a_zone_leaves_a_corner_by_a_quarter_of_its_length(robot, first):
    points = tips(robot, run(square(first, 0.02), robot).q)
    away = np.linalg.norm(points - shifted(first, 0.1, 0, 0)[:3, 3], axis=1).min()
    # The vertex of the parabola lies a quarter of the zone inwards along both sides.
    assert away == pytest.approx(0.02 / 4 * np.sqrt(2), rel=0.01)


def test_corners_of_cnt100_follow_the_cubic_b_spline_over_even_targets(robot, first):
    """A circle in 24 moves of 50 ms; the ends, where the robot starts and stops, are left out."""
    radius, turn = 0.04, np.radians(15)
    length = 2 * radius * np.sin(turn / 2)
    ways = [(radius * np.sin(k * turn), radius * (1 - np.cos(k * turn)), 0) for k in range(25)]
    targets = [Target(kind="start", pose=first)]
    for way in ways[1:]:
        at = shifted(first, *way)
        targets.append(Target(kind="linear", pose=at, speed=length / 0.05, zone=0.01))
    points = tips(robot, run(targets, robot, language="fanuc").q) - first[:3, 3]
    spline = BSpline(np.arange(-2.0, 27.0), np.array(ways), 3)  # target k at k
    at_targets, between = spline(np.arange(6.0, 19.0)), spline(np.arange(6.0, 19.0, 0.01))
    inside = np.linalg.norm(np.array(ways)[6:19] - at_targets, axis=1)
    # A target is passed at a sixth of the second difference of the targets beside it.
    assert inside == pytest.approx(2 * radius * (1 - np.cos(turn)) / 6, rel=1e-6)
    way = Polyline.of(points)
    # The joints are averaged and not the tip: a hundredth of how far targets are passed, 0.45 mm.
    assert way.nearest(between)[2].max() < 5e-6
    plain = Polyline.of(tips(robot, run(targets, robot).q) - first[:3, 3])
    assert plain.nearest(between)[2].max() > 5e-5


def test_no_joint_exceeds_a_limit(robot, first):
    found = run(square(first, 0.02), robot)
    velocity, acceleration = robot.speed_limits()
    step = found.time[1]
    rate = np.diff(found.commanded, axis=0) / step
    change = np.diff(rate, axis=0) / step
    # Where the acceleration jumps within a step, differences of cubics overshoot a little.
    assert (np.abs(rate) / velocity).max() < 1.0
    assert (np.abs(change) / acceleration).max() < 1.1


def test_a_circular_move_is_an_arc(robot, first):
    centre = shifted(first, 0, 0.05, 0)[:3, 3]
    arc = Target(
        kind="circular", pose=shifted(first, 0, 0.1, 0), via=shifted(first, 0.05, 0.05, 0),
        speed=0.1,
    )  # fmt: skip
    points = tips(robot, run([Target(kind="start", pose=first), arc], robot).q)
    np.testing.assert_allclose(np.linalg.norm(points - centre, axis=1), 0.05, rtol=0, atol=2e-6)


def test_joint_moves_are_straight_in_joints_and_stop_where_they_are_to(robot, first):
    to = START + np.array([0.1, -0.05, 0.08, 0.0, 0.1, -0.2])
    pose = robot.forward(to) @ TOOL
    found = run(
        [Target(kind="start", pose=first), Target(kind="joint", pose=pose, q=to, speed=0.2)], robot
    )
    moved = np.array([0, 1, 2, 4, 5])
    shares = (found.q - START)[:, moved] / (to - START)[moved]
    np.testing.assert_allclose(shares, shares[:, :1] * np.ones(5), rtol=0, atol=1e-9)
    np.testing.assert_allclose(found.q[-1], to, rtol=0, atol=1e-9)


def test_a_joint_move_goes_over_into_a_straight_one_within_its_zone(robot, first):
    to = START + np.array([0.06, 0.0, 0.0, 0.0, 0.0, 0.0])
    pose = robot.forward(to) @ TOOL
    targets = [
        Target(kind="start", pose=first),
        Target(kind="joint", pose=pose, q=to, speed=0.1, zone=0.02),
        Target(kind="linear", pose=shifted(pose, 0.1, 0, 0), speed=0.1),
    ]
    found = run(targets, robot)
    points = tips(robot, found.commanded)
    assert 1e-4 < np.linalg.norm(points - pose[:3, 3], axis=1).min() < 0.02
    _, acceleration = robot.speed_limits()
    change = np.diff(found.commanded, 2, axis=0) / found.time[1] ** 2
    assert (np.abs(change) / acceleration).max() < 1.1
    stop = run([targets[0], Target(kind="joint", pose=pose, q=to, speed=0.1), targets[2]], robot)
    assert np.linalg.norm(tips(robot, stop.commanded) - pose[:3, 3], axis=1).min() < 1e-6
    assert stop.time[-1] > found.time[-1]


def test_a_lag_shrinks_a_circle_by_what_a_low_pass_leaves_of_it(robot, first):
    radius, speed, sigma = 0.02, 0.1, 0.025
    turns = np.linspace(0, 4 * np.pi, 241)[1:]
    targets = [Target(kind="start", pose=first)]
    targets += [
        Target(
            kind="linear", speed=speed, zone=0.005,
            pose=shifted(first, radius * (np.cos(a) - 1), radius * np.sin(a), 0),
        )
        for a in turns
    ]  # fmt: skip
    centre = shifted(first, -radius, 0, 0)[:3, 3]
    found = run(targets, robot, Response(sigma=[sigma]))
    asked, done = (
        np.linalg.norm(tips(robot, q) - centre, axis=1) for q in (found.commanded, found.q)
    )
    inner = slice(len(asked) // 4, 3 * len(asked) // 4)
    share = np.exp(-((sigma * speed / radius) ** 2) / 2)
    assert done[inner].mean() == pytest.approx(share * asked[inner].mean(), rel=1e-4)


def test_the_executed_motion_ends_standing(robot, first):
    found = run(square(first, 0.02), robot, kerfpath.response(robot.id, "robotstudio"))
    np.testing.assert_allclose(found.q[[0, -1]], [START, START], rtol=0, atol=1e-6)
    np.testing.assert_allclose(found.q[-1], found.q[-3], rtol=0, atol=1e-9)


def test_what_is_refused(robot, first):
    start = Target(kind="start", pose=first)
    line = Target(kind="linear", pose=shifted(first, 0.1, 0, 0), speed=0.1)
    far = Target(kind="linear", pose=shifted(first, 9, 0, 0), speed=0.1)
    for targets, said in (
        ([], "got none"),
        ([start], "a start and the moves after it"),
        ([line, line], "the first 'linear'"),
        ([start, far], "target 1: expected a pose within reach"),
    ):
        with pytest.raises(InputError, match=said):
            run(targets, robot)
    with pytest.raises(InputError, match="language"):
        run([start, line], robot, language="basic")
    for about, said in (
        ({"kind": "spline"}, "kind"),
        ({"kind": "linear"}, "speed"),
        ({"kind": "linear", "speed": 0.0}, "speed"),
        ({"kind": "circular", "speed": 0.1}, "via"),
        ({"kind": "linear", "speed": 0.1, "zone": -1.0}, "zone"),
    ):
        with pytest.raises(InputError, match=said):
            Target(pose=first, **about)
