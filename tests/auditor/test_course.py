"""Bounds of joint rates along a course: above every sample, near the largest, or infinite."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from conftest import rebuilt
from kerfpath import InputError, robot
from kerfpath.auditor import rates_along
from kerfpath.execution import ToolMotion
from kerfpath.post import CircularMove, Controller, LinearMove
from kerfpath.robots import ExternalAxis, base_in_part

ARMS = ("abb_irb4600_60_205", "ur_ur10e")
TOOL = np.eye(4)
LAWS = ("slerp", "two-angle")


def random_course(arm, seed, arcs, law="slerp"):
    """Return a course of zones of all widths near a pose of the arm, and the joints there."""
    rng = np.random.default_rng(seed)
    q = np.radians([10.0, -60.0, 80.0, 20.0, 50.0, 30.0]) + rng.uniform(-0.2, 0.2, 6)
    (home,) = arm.forward(q[None])
    count = 7
    T = np.tile(home, (count, 1, 1))
    T[:, :3, 3] += np.cumsum(rng.normal(scale=0.01, size=(count, 3)), axis=0)
    T[:, :3, :3] = (
        T[:, :3, :3]
        @ Rotation.from_rotvec(
            np.cumsum(rng.normal(scale=0.05, size=(count, 3)), axis=0)
        ).as_matrix()
    )
    moves = []
    for k in range(1, count):
        gap = np.linalg.norm(T[k, :3, 3] - T[k - 1, :3, 3])
        said = {"T_part_tip": T[k], "q": q, "speed": 0.2, "duration": 1.0}
        said["zone"] = 0.0 if k == count - 1 else gap * rng.uniform(0.1, 0.6)
        if arcs and k % 2:
            via = T[k].copy()
            via[:3, 3] = T[[k - 1, k], :3, 3].mean(axis=0) + 0.2 * gap * rng.normal(size=3)
            moves.append(CircularMove(**said, T_part_via=via, q_via=q))
        else:
            moves.append(LinearMove(**said))
    return ToolMotion.of(T[0], moves, Controller(orientation=law)), q


def middles(arm, course, q):
    time = (course.borders[1:] + course.borders[:-1]) / 2
    return arm.arm.nearest(course.poses(time), np.tile(q, (len(time), 1)))


@pytest.mark.slow
@pytest.mark.parametrize("arcs", [False, True])
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("name", ARMS)
@pytest.mark.parametrize("law", LAWS)
def test_no_sample_is_above_the_bounds_and_some_are_near(name, seed, arcs, law):
    arm = robot(name)
    course, q = random_course(arm, seed, arcs, law)
    borders, near = course.borders, middles(arm, course, q)
    bounds = rates_along(
        arm, course.pieces(), near, T_base_part=np.eye(4), T_flange_tip=TOOL,
        enough=(np.zeros(6), np.zeros(6)), deepest=7,
    )  # fmt: skip
    seen = np.zeros((2, *near.shape))
    for share in np.linspace(0.02, 0.98, 49):
        time = borders[:-1] + share * np.diff(borders)
        d = 1e-2 * np.diff(borders)[:, None]
        before, here, after = (
            arm.arm.nearest(course.poses(time + sign * d[:, 0]), near) for sign in (-1, 0, 1)
        )
        seen[0] = np.maximum(seen[0], np.abs(after - before) / (2 * d))
        seen[1] = np.maximum(seen[1], np.abs(after - 2 * here + before) / d**2)
    assert np.isfinite(bounds[1]).all()
    for order, (bound, found) in enumerate(zip(bounds, seen, strict=True), 1):
        # Samples are differences of joints that are good to 1e-12 rad.
        lost = 1e-12 / (1e-2 * np.diff(borders)[:, None]) ** order
        assert (found <= bound * (1 + 1e-6) + lost).all()
        assert bound.max() <= 1.01 * found.max()


@pytest.mark.parametrize("arcs", [False, True])
@pytest.mark.parametrize("law", LAWS)
def test_pieces_are_the_course(arcs, law):
    course, _ = random_course(robot(ARMS[0]), 5, arcs, law)
    pieces, borders = course.pieces(), course.borders
    for share in (0.0, 0.3, 1.0):
        t = (pieces.begin + share * (pieces.end - pieces.begin))[:, None]
        turned = pieces.rate[:, None] * t
        point = pieces.point[:, 0] + pieces.point[:, 1] * t + pieces.point[:, 2] * t**2 / 2
        point += np.cos(turned) * pieces.x + np.sin(turned) * pieces.y
        turn = pieces.turn[:, 0] + pieces.turn[:, 1] * t + pieces.turn[:, 2] * t**2 / 2
        T = course.poses(borders[:-1] + share * np.diff(borders))
        np.testing.assert_allclose(T[:, :3, 3], point, rtol=0, atol=1e-13)
        assert pieces.two_angles == (law == "two-angle")
        parts = [turn] if law == "slerp" else [turn * [1, 1, 0], turn * [0, 0, 1]]
        R = pieces.R
        for part in parts:
            R = R @ Rotation.from_rotvec(part).as_matrix()
        np.testing.assert_allclose(T[:, :3, :3], R, rtol=0, atol=1e-13)


def test_at_a_singularity_nothing_is_known():
    arm = robot(ARMS[0])
    q = np.radians([10.0, 10.0, 20.0, 20.0, 0.0, 30.0])  # axes 4 and 6 in line
    (home,) = arm.forward(q[None])
    T = np.tile(home, (3, 1, 1))
    T[:, 1, 3] += [-0.01, 0.0, 0.01]
    moves = [
        LinearMove(T_part_tip=pose, q=q, speed=0.1, duration=1.0, zone=zone)
        for pose, zone in zip(T[1:], (0.002, 0.0), strict=True)
    ]
    course = ToolMotion.of(T[0], moves)
    velocity, _ = rates_along(
        arm, course.pieces(), middles(arm, course, q), T_base_part=np.eye(4), T_flange_tip=TOOL,
        enough=(np.ones(6), np.ones(6)),
    )  # fmt: skip
    assert np.isinf(velocity[:, [3, 5]]).any()
    assert np.isfinite(velocity[:, :3]).all()


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("name", ARMS)
def test_bounds_hold_while_external_axes_move(name, law, seed):
    """A gantry of a rail and a column under the arm, a table on a shuttle under the part."""
    rng = np.random.default_rng(seed)
    arm = robot(name).with_limits(acceleration=np.ones(6))
    arm = rebuilt(arm, T_base_foot=turned(rng) @ arm.T_base_foot)
    course, q = random_course(arm, seed, False, law)
    axes = [("rail", "linear", "robot"), ("column", "rotary", "robot"), ("table", "rotary", "part")]
    picked = [axes[i] for i in rng.permutation(3)]
    moved = arm
    for axis, kind, carries in picked:
        moved = moved.with_external(
            ExternalAxis(
                name=axis, kind=kind, carries=carries, axis=rng.normal(size=3),
                point=rng.normal(size=3),
            ),
            lower=-1, upper=1, velocity=1, acceleration=1,
        )  # fmt: skip
    values = np.cumsum(rng.normal(scale=0.02, size=(len(course.T), 3)), axis=0)
    base, start = base_in_part(moved.externals, values[0]), values[:1]

    def joints(time, near):
        x = course.blended(values, time)
        # The arm stands at the first target where it would stand with all axes at zero.
        seen = np.linalg.inv(base_in_part(moved.externals, x)) @ base @ course.poses(time)
        return np.hstack([arm.arm.nearest(seen, near[:, :6]), x])

    borders = course.borders
    near = np.hstack([q, start[0]])
    near = joints((borders[1:] + borders[:-1]) / 2, np.tile(near, (len(borders) - 1, 1)))
    bounds = rates_along(
        moved, course.pieces(values), near, T_base_part=base, T_flange_tip=TOOL,
        enough=(np.zeros(9), np.zeros(9)), deepest=7,
    )  # fmt: skip
    seen = np.zeros((2, *near.shape))
    for share in np.linspace(0.02, 0.98, 49):
        time = borders[:-1] + share * np.diff(borders)
        d = 1e-2 * np.diff(borders)[:, None]
        before, here, after = (joints(time + by * d[:, 0], near) for by in (-1, 0, 1))
        seen[0] = np.maximum(seen[0], np.abs(after - before) / (2 * d))
        seen[1] = np.maximum(seen[1], np.abs(after - 2 * here + before) / d**2)
    assert np.isfinite(bounds[1]).all()
    for order, (bound, found) in enumerate(zip(bounds, seen, strict=True), 1):
        # As for the arm alone.
        lost = 1e-12 / (1e-2 * np.diff(borders)[:, None]) ** order
        assert (found <= bound * (1 + 1e-6) + lost).all()
        # Half of the spans would bring it to 1 %, as for the arm alone.
        assert bound.max() <= 1.02 * found.max()
    # What axes do themselves is known exactly, up to rounding.
    assert (bounds[0][:, 6:] <= 1.05 * seen[0][:, 6:].max(axis=0)).all()


def turned(rng):
    T = np.eye(4)
    T[:3, :3] = Rotation.from_rotvec(rng.normal(scale=0.3, size=3)).as_matrix()
    T[:3, 3] = rng.normal(size=3)
    return T


def test_values_of_other_axes_than_the_robots_are_refused():
    course, q = random_course(robot(ARMS[0]), 0, arcs=False)
    near = middles(robot(ARMS[0]), course, q)
    arm = robot(ARMS[0], acceleration_ratio="iontec_20_to_70kg")
    on_rail = arm.on_rail([0, 1, 0], lower=-1, upper=1, velocity=1, acceleration=1)
    with pytest.raises(InputError, match=r"expected values of 1 external axes .* got 0"):
        rates_along(
            on_rail, course.pieces(), near, T_base_part=np.eye(4), T_flange_tip=TOOL,
            enough=(np.ones(6), np.ones(6)),
        )  # fmt: skip
