"""The tool's motion: a quadratic B-spline where zones meet half way, smooth everywhere."""

import numpy as np
import pytest
from scipy.interpolate import BSpline
from scipy.spatial.transform import Rotation

from kerfpath.execution import ToolMotion
from kerfpath.post import CircularMove, Controller, LinearMove

SPEED = 0.1


def poses_through(points, vectors):
    T = np.tile(np.eye(4), (len(points), 1, 1))
    T[:, :3, 3] = points
    T[:, :3, :3] = Rotation.from_rotvec(vectors).as_matrix()
    return T


def moves_through(T, zones):
    pairs = zip(T[1:], [*zones, 0.0], strict=True)
    return [
        LinearMove(T_part_tip=pose, q=np.zeros(6), speed=SPEED, duration=1.0, zone=zone)
        for pose, zone in pairs
    ]


def random_way(seed, count=8):
    """Return points 10 mm apart on average, and how the tool is turned there."""
    rng = np.random.default_rng(seed)
    points = np.cumsum(rng.normal(scale=0.01, size=(count, 3)), axis=0)
    return poses_through(points, np.cumsum(rng.normal(scale=0.1, size=(count, 3)), axis=0))


def test_where_zones_meet_half_way_the_tip_follows_the_quadratic_spline_of_the_nodes():
    at = np.linspace(0, 0.4, 9)
    # On a regular polygon chords are equal, so that nodes are evenly spaced in time.
    points = np.c_[np.cos(at), np.sin(at), 0 * at]
    chord = np.linalg.norm(points[1] - points[0])
    T = poses_through(points, np.zeros_like(points))
    motion = ToolMotion.of(T[0], moves_through(T, [chord / 2] * 7))
    step = chord / SPEED
    knots = (np.arange(len(points) + 3) - 1.5) * step  # control point k acts around k steps
    spline = BSpline(knots, points, 2)
    time = np.linspace(0.5 * step, (len(points) - 1.5) * step, 101)
    np.testing.assert_allclose(motion.poses(time)[:, :3, 3], spline(time), rtol=0, atol=1e-12)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("share", [0.2, 0.5, 1.0])
@pytest.mark.parametrize("orientation", ["slerp", "two-angle"])
def test_the_motion_is_smooth_through_every_zone(seed, share, orientation):
    T = random_way(seed)
    gaps = np.linalg.norm(np.diff(T[:, :3, 3], axis=0), axis=1)
    zones = share * np.minimum(gaps[:-1], gaps[1:]) / 2
    motion = ToolMotion.of(T[0], moves_through(T, zones), Controller(orientation=orientation))
    d = 1e-6
    for border in motion.borders[1:-1]:
        before, here, after = motion.poses(border + np.array([-d, 0.0, d]))
        for old, new in ((before, here), (here, after)):
            assert np.linalg.norm(new[:3, 3] - old[:3, 3]) < 2 * SPEED * d
        # Rates before and after agree: what differs is the acceleration times the step.
        jump = (after[:3, 3] - 2 * here[:3, 3] + before[:3, 3]) / d
        assert np.linalg.norm(jump) < 1e-3 * SPEED
        turns = Rotation.from_matrix(
            [here[:3, :3].T @ after[:3, :3], before[:3, :3].T @ here[:3, :3]]
        )
        rates = turns.as_rotvec() / d
        # 1e-10 of rounding in a rotation, over the step.
        assert np.linalg.norm(rates[0] - rates[1]) < 1e-3 * max(np.linalg.norm(rates[0]), 1.0)


def test_the_tip_passes_a_corner_by_a_quarter_of_the_zone_times_the_turn():
    T = poses_through([[0, 0, 0], [0.01, 0, 0], [0.01, 0.01, 0]], np.zeros((3, 3)))
    motion = ToolMotion.of(T[0], moves_through(T, [0.002]))
    passed = motion.poses(motion.time[1:2])[0, :3, 3]
    assert np.linalg.norm(passed - T[1, :3, 3]) == pytest.approx(0.002 * np.sqrt(2) / 4, rel=1e-12)


def test_outside_zones_it_is_the_straight_move_at_its_speed():
    T = random_way(3)
    gaps = np.linalg.norm(np.diff(T[:, :3, 3], axis=0), axis=1)
    motion = ToolMotion.of(T[0], moves_through(T, np.full(6, 0.1 * gaps.min())))
    np.testing.assert_allclose(motion.duration, gaps / SPEED, rtol=1e-12)
    middle = (motion.time[:-1] + motion.time[1:]) / 2
    found = motion.poses(middle)
    np.testing.assert_allclose(
        found[:, :3, 3], (T[:-1, :3, 3] + T[1:, :3, 3]) / 2, rtol=0, atol=1e-12
    )
    half = Rotation.from_matrix(T[:-1, :3, :3].transpose(0, 2, 1) @ T[1:, :3, :3]).as_rotvec() / 2
    turned = T[:-1, :3, :3] @ Rotation.from_rotvec(half).as_matrix()
    np.testing.assert_allclose(found[:, :3, :3], turned, rtol=0, atol=1e-12)


def test_a_tool_that_turns_much_slows_the_move_down():
    T = poses_through([[0, 0, 0], [0.01, 0, 0]], [[0, 0, 0], [0, 0, 1.0]])
    moves = moves_through(T, [])
    assert ToolMotion.of(T[0], moves).time[-1] == pytest.approx(0.1)
    assert ToolMotion.of(T[0], moves, Controller(turning_speed=2.0)).time[-1] == pytest.approx(0.5)


def test_of_two_angles_the_slower_one_counts():
    T = poses_through([[0, 0, 0], [0.01, 0, 0]], np.zeros((2, 3)))
    both = Rotation.from_rotvec([0.6, 0, 0]) * Rotation.from_rotvec([0, 0, 1.0])
    T[1, :3, :3] = both.as_matrix()
    moves = moves_through(T, [])
    two = ToolMotion.of(T[0], moves, Controller(turning_speed=2.0, orientation="two-angle"))
    assert two.time[-1] == pytest.approx(0.5)  # 1 rad about z, 0.6 rad of the axis


def test_an_arc_is_followed_at_its_speed_and_left_along_its_tangent():
    T = poses_through([[1, 0, 0], [0, 1, 0], [-1, 1, 0]], np.zeros((3, 3)))
    via = np.eye(4)
    via[:2, 3] = np.sqrt(0.5)
    arc = CircularMove(
        T_part_tip=T[1], q=np.zeros(6), speed=SPEED, duration=1.0, zone=0.1,
        T_part_via=via, q_via=np.zeros(6),
    )  # fmt: skip
    motion = ToolMotion.of(T[0], [arc, *moves_through(T[1:], [])])
    assert motion.duration[0] == pytest.approx(np.pi / 2 / SPEED)
    time = np.linspace(0, motion.duration[0] - motion.half[1], 50)
    np.testing.assert_allclose(np.linalg.norm(motion.poses(time)[:, :3, 3], axis=1), 1, rtol=1e-12)
    # The line goes on where the arc points to: nothing to round, and the target is met.
    assert motion.poses(motion.time[1:2])[0, :3, 3] == pytest.approx([0, 1, 0], abs=1e-12)


def least_turn(a, b):
    """The rotation that takes unit vector a to b and turns no more than that."""
    v, c = np.cross(a, b), a @ b
    cross = np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
    return np.eye(3) + cross + cross @ cross / (1 + c)


def two_angles(R0, R1, share):
    """Where the law of two angles has the tool: its axis on the great circle, turned evenly."""
    a, b = R0[:, 2], R1[:, 2]
    angle = np.arccos(np.clip(a @ b, -1, 1))
    on_circle = (np.sin((1 - share) * angle) * a + np.sin(share * angle) * b) / np.sin(angle)
    carried = least_turn(a, b) @ R0
    about = Rotation.from_matrix(carried.T @ R1).as_rotvec()
    assert np.abs(about[:2]).max() < 1e-12  # the axes agree
    return least_turn(a, on_circle) @ R0 @ Rotation.from_rotvec(share * about).as_matrix()


@pytest.mark.parametrize("seed", range(5))
def test_with_two_angles_the_axis_swings_in_a_plane_and_the_tool_turns_evenly_about_it(seed):
    rng = np.random.default_rng(seed)
    T = poses_through(rng.normal(size=(2, 3)), rng.uniform(-1, 1, size=(2, 3)))
    motion = ToolMotion.through(T, [None], "two-angle")
    back = ToolMotion.through(T[::-1], [None], "two-angle")
    for share in np.linspace(0, 1, 11):
        R = motion.poses(np.array([share]))[0, :3, :3]
        np.testing.assert_allclose(R, two_angles(*T[:, :3, :3], share), rtol=0, atol=1e-12)
        # There and back the tool goes the same way.
        other = back.poses(np.array([1 - share]))[0, :3, :3]
        np.testing.assert_allclose(R, other, rtol=0, atol=1e-12)


def test_the_two_laws_are_one_where_the_axis_stands_still_or_the_tool_does_not_turn_about_it():
    spin = poses_through(np.eye(3)[:2], [[0, 0, 0.2], [0, 0, 1.4]])
    tilt = poses_through(np.eye(3)[:2], [[0, 0, 0], [0.7, -0.4, 0]])
    time = np.linspace(0, 1, 11)
    for T in (spin, tilt):
        one, two = (
            ToolMotion.through(T, [None], law).poses(time) for law in ("slerp", "two-angle")
        )
        np.testing.assert_allclose(one, two, rtol=0, atol=1e-12)


def test_values_at_the_targets_are_blended_as_the_tip_is():
    T = random_way(4)
    gaps = np.linalg.norm(np.diff(T[:, :3, 3], axis=0), axis=1)
    motion = ToolMotion.of(T[0], moves_through(T, np.full(6, 0.3 * gaps.min())))
    time = np.linspace(0, motion.time[-1], 301)
    found = motion.blended(T[:, :3, 3], time)
    np.testing.assert_allclose(found, motion.poses(time)[:, :3, 3], rtol=0, atol=1e-13)


def test_a_controller_with_a_measure_of_its_own_rounds_by_it():
    T = poses_through([[0, 0, 0], [0.1, 0, 0], [0.1, 0.1, 0], [0.2, 0.1, 0]], np.zeros((4, 3)))
    moves = moves_through(T, [0.001, 0.001])
    by_time = ToolMotion.of(T[0], moves, Controller(corner_time=0.05))
    np.testing.assert_allclose(by_time.half, [0, 0.05, 0.05, 0], rtol=1e-12)
    by_length = ToolMotion.of(T[0], moves, Controller(corner=0.02))
    np.testing.assert_allclose(by_length.half, [0, 0.2, 0.2, 0], rtol=1e-12)
    # More than there is room for: half way to the next corner.
    wide = ToolMotion.of(T[0], moves, Controller(corner=1.0))
    np.testing.assert_allclose(wide.half, [0, 0.5, 0.5, 0], rtol=1e-12)
