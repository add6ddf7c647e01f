"""Robots: kinematics as laws and against pinocchio, limits and couplings, the library."""

import numpy as np
import pinocchio as pin
import pytest

from from_python import from_python
from kerfpath import InputError, robot
from kerfpath.kernels import turns
from kerfpath.kernels.frames import location
from kerfpath.robots import (
    FAMILIES,
    Arm,
    Coupling,
    Robot,
    RobotLimits,
    acceleration_ratios,
    posture_name,
    postures_named,
    robot_ids,
)

IDS = robot_ids()
SIX = [name for name in IDS if robot(name).joints == 6]
"""Seven axes: test_seven_axes.py."""


def random_joints(rng, count, near_singular=False, joints=6):
    q = rng.uniform(-np.pi, np.pi, (count, joints))
    if near_singular:
        # Wrist stretched (q5 = 0 or pi in the model), by amounts down to nothing at all.
        q[:, 4] = rng.choice([0.0, np.pi], count) + 10.0 ** rng.uniform(-16, -4, count)
    return q


def joint_frames(r):
    """Axis and pose of each joint in the frame of the joint before, and the flange in the last."""
    g, y, z = r.geometry, np.array([0, 1.0, 0]), np.array([0, 0, 1.0])
    if r.kinematics == "ur":
        links = [(0, g["d1"], 90), (g["a2"], 0, 0), (g["a3"], 0, 0)]
        links += [(0, g["d4"], 90), (0, g["d5"], -90), (0, g["d6"], 0)]
        poses = [
            pin.SE3(pin.exp3(np.radians(t) * np.eye(3)[0]), np.array([a, 0, d]))
            for a, d, t in links
        ]
        return [z] * 6, [pin.SE3.Identity(), *poses[:5]], poses[5]
    if r.kinematics == "srs":
        heights = [0, g["c1"], 0, g["c2"], 0, g["c3"], 0, g["c4"]]
        poses = [pin.SE3(np.eye(3), np.array([0, 0, h], dtype=float)) for h in heights]
        return [z, y, z, y, z, y, z], poses[:7], poses[7]
    places = [(0, 0, 0), (g["a1"], g["b"], g["c1"]), (0, 0, g["c2"]), (g["a2"], 0, g["c3"])]
    places += [(0, 0, 0), (0, 0, 0), (0, 0, g["c4"])]
    poses = [pin.SE3(np.eye(3), np.array(xyz, dtype=float)) for xyz in places]
    return [z, y, y, z, y, z], poses[:6], poses[6]


def pinocchio_pose(r, q):
    """Flange pose by pinocchio on a model built joint by joint from the robot's lengths."""
    model, parent = pin.Model(), 0
    axes, poses, flange = joint_frames(r)
    for i, (axis, pose) in enumerate(zip(axes, poses, strict=True)):
        joint = pin.JointModelRevoluteUnaligned(*(r.sign[i] * axis))
        origin = pose * pin.SE3(pin.exp3(-r.offset[i] * axis), np.zeros(3))
        parent = model.addJoint(parent, joint, origin, f"joint_{i + 1}")
    model.addFrame(pin.Frame("flange", parent, flange, pin.FrameType.OP_FRAME))
    data = model.createData()
    poses = []
    for row in q:
        pin.framesForwardKinematics(model, data, row)
        poses.append(data.oMf[model.getFrameId("flange")].homogeneous.copy())
    return np.array(poses)


def test_the_library_has_all_robots_with_sources():
    assert len(IDS) == 69
    for name in IDS:
        r = robot(name)
        assert r.id == name
        assert r.manufacturer
        assert r.sources["geometry_limits_velocity"]
        assert r.acceleration_ratio in acceleration_ratios() or r.joints == 7


@pytest.mark.parametrize("name", SIX)
def test_a_wrist_turned_over_brings_the_flange_to_the_same_pose(name):
    """All joints but one by a constant, that one mirrored, from one posture to its neighbour."""
    r = robot(name)
    if r.arm.flip is None:
        assert r.kinematics != "opw"
        return
    joint, middle = r.arm.flip
    q = random_joints(np.random.default_rng(5), 50)
    found = r.inverse(r.forward(q), within_limits=False)
    one, other = (found.q[found.posture % 2 == over] for over in (0, 1))
    assert len(one) == len(other) >= 50
    image = one + np.pi * np.isin(np.arange(6), (joint - 1, joint + 1))
    image[:, joint] = 2 * middle - one[:, joint]
    # Rounding, which the inverse enlarges beside singularities.
    np.testing.assert_allclose(np.sin((image - other) / 2), 0.0, atol=1e-9)


@pytest.mark.equation(3)
@pytest.mark.parametrize("name", IDS)
def test_forward_kinematics_agree_with_pinocchio(name):
    r = robot(name)
    q = random_joints(np.random.default_rng(1), 50, joints=r.joints)
    # Both multiply a dozen rotations in double precision.
    np.testing.assert_allclose(r.forward(q), pinocchio_pose(r, q), atol=1e-12)


@pytest.mark.equation(4)
@pytest.mark.parametrize("near_singular", [False, True])
@pytest.mark.parametrize("name", SIX)
def test_inverse_kinematics_return_the_pose_and_find_the_joints(name, near_singular):
    r = robot(name)
    q = random_joints(np.random.default_rng(2), 300, near_singular)
    T = r.forward(q)
    found = r.inverse(T, within_limits=False)
    error = np.abs(r.forward(found.q) - T[found.pose])
    assert error[:, :3, 3].max() < 1e-9
    assert error[:, :3, :3].max() < 1e-9
    assert (np.bincount(found.pose, minlength=len(q)) >= 2).all()
    assert np.abs(found.q).max() <= np.pi
    if not near_singular:
        # The seed itself is among the solutions; close to a singularity only its pose is.
        gap = np.abs(np.remainder(found.q - q[found.pose] + np.pi, 2 * np.pi) - np.pi).max(axis=1)
        nearest = np.full(len(q), np.inf)
        np.minimum.at(nearest, found.pose, gap)
        assert np.median(nearest) < 1e-9
        assert nearest.max() < 1e-5


def test_postures_are_told_apart_by_geometry():
    r = robot("staubli_tx60")
    q = random_joints(np.random.default_rng(3), 500)
    found = r.inverse(r.forward(q), within_limits=False)
    model = r.sign * found.q - r.offset
    wrist = np.sign(np.sin(model[:, 4]))
    np.testing.assert_array_equal(found.posture % 2, np.where(wrist >= 0, 0, 1))
    # Front: the wrist centre lies ahead of axis 1 in the arm's own plane.
    g = r.geometry
    ahead = (
        g["a1"]
        + g["c2"] * np.sin(model[:, 1])
        + np.hypot(g["a2"], g["c3"]) * np.sin(model[:, 1:3].sum(1) + np.arctan2(g["a2"], g["c3"]))
    )
    np.testing.assert_array_equal(found.posture // 4, np.where(ahead >= 0, 0, 1))
    assert posture_name(0) == "front/up/plus"
    assert posture_name(7) == "rear/down/minus"


@pytest.mark.parametrize("kinematics", FAMILIES)
@pytest.mark.parametrize("words", ["", "front/up", "rear", "fourth", "minus/down"])
def test_postures_named_are_those_of_the_family_whose_names_have_the_words(kinematics, words):
    names = FAMILIES[kinematics].postures
    fitting = [mu for mu in range(len(names)) if set(words.split("/")) - {""} <= named(mu)]
    if fitting:
        assert postures_named(words, kinematics) == tuple(fitting)
    else:
        assert (words, len(names)) == ("fourth", 8)
        with pytest.raises(InputError, match=r"minus, such as .* got 'fourth'"):
            postures_named(words, kinematics)


def named(mu):
    return set(posture_name(mu).split("/"))


def test_a_pose_out_of_reach_has_no_solution():
    r = robot("abb_irb2400_155")
    T = np.eye(4)
    T[:3, 3] = [5, 0, 0]
    assert len(r.inverse(T)) == 0


def test_the_stretched_arm_is_still_solved():
    r = robot("abb_irb2400_155")
    elbow = np.arctan2(r.geometry["a2"], r.geometry["c3"])
    q = np.array([0.3, 0.4, -(elbow + np.pi / 2), 0.5, 0.6, 0.7])
    q[2] = r.sign[2] * (-elbow + r.offset[2])
    T = r.forward(q)
    found = r.inverse(T, within_limits=False)
    np.testing.assert_allclose(
        r.forward(found.q), np.broadcast_to(T, (len(found), 4, 4)), atol=1e-9
    )


def test_the_wrist_centre_on_axis_one_is_solved():
    # With b = 0 and the wrist straight above the base, axis 1 is free and set to zero.
    r = robot("kuka_kr6_r900_sixx")
    T = np.eye(4)
    T[2, 3] = 0.9
    found = r.inverse(T, within_limits=False)
    assert len(found) >= 4
    np.testing.assert_allclose(
        r.forward(found.q), np.broadcast_to(T, (len(found), 4, 4)), atol=1e-9
    )


@pytest.mark.equation(2)
def test_the_location_turns_about_the_tool_axis():
    rng = np.random.default_rng(4)
    H = robot("staubli_tx60").forward(rng.uniform(-1, 1, 6))
    L = np.eye(4)
    location(H, np.cos(0.7), np.sin(0.7), L)
    Rz = np.eye(4)
    Rz[:3, :3] = pin.exp3(np.array([0, 0, 0.7]))
    np.testing.assert_allclose(L, H @ Rz, atol=1e-15)
    np.testing.assert_allclose(L[:, 2:], H[:, 2:], atol=1e-15)


def test_every_turn_inside_the_limits_is_a_solution_of_its_own():
    r = robot("abb_irb4600_60_205")  # axes 4 and 6 reach +-400 degrees
    q = np.array([0.1, 0.2, 0.3, 0.5, 0.6, 0.7])
    found = r.inverse(r.forward(q))
    mine = found.q[(np.abs(np.remainder(found.q - q + np.pi, 2 * np.pi) - np.pi) < 1e-6).all(1)]
    expected = {
        (a, b) for a in 0.5 + 2 * np.pi * np.array([-1, 0, 1]) for b in (0.7, 0.7 - 2 * np.pi)
    }
    assert {(round(a, 6), round(b, 6)) for a, b in mine[:, [3, 5]]} == {
        (round(a, 6), round(b, 6)) for a, b in expected
    }
    np.testing.assert_allclose(
        r.forward(found.q), np.broadcast_to(r.forward(q), (len(found), 4, 4)), atol=1e-9
    )
    assert ((found.q >= r.lower - 1e-9) & (found.q <= r.upper + 1e-9)).all()
    base = found.q - 2 * np.pi * found.turn
    assert ((base > -np.pi - 1e-9) & (base <= np.pi + 1e-9)).all()


def test_a_joint_of_a_thousand_turns_has_each_of_them():
    r = robot("staubli_tx60")
    upper = np.array([*r.upper[:5], 1000 * 2 * np.pi])
    found = r.with_limits(lower=np.array([*r.lower[:5], 0.0]), upper=upper).inverse(
        r.forward(np.full(6, 0.3))
    )
    assert found.turn[:, 5].max() > 900
    base = found.q - 2 * np.pi * found.turn
    assert ((base > -np.pi - 1e-9) & (base <= np.pi + 1e-9)).all()


def test_turns_agree_with_trying_them_all():
    rng = np.random.default_rng(5)
    every = np.indices([7] * 6).reshape(6, -1).T - 3
    room = np.empty((turns.MOST_TURNS, 6), np.int64)
    admissible_turns = from_python(turns.admissible_turns)
    empty = 0
    for _ in range(60):
        lower = rng.uniform(-12, -2, 6)
        rows = np.round(rng.normal(0, 1, (2, 6)))
        r = Robot(
            id="any",
            arm=Arm(geometry=robot("staubli_tx60").geometry),
            limits=RobotLimits(
                lower=lower,
                upper=lower + rng.uniform(4, 14, 6),
                endless=rng.random(6) < 0.3,
                couplings=tuple(Coupling(row=row, lower=-6.0, upper=8.0) for row in rows),
            ),
        )
        q = rng.uniform(-np.pi, np.pi, 6)
        full = q + 2 * np.pi * every
        inside = np.where(r.endless, every == 0, (full >= r.lower) & (full <= r.upper)).all(1)
        for c in r.couplings:
            inside &= (c.lower <= full @ c.row) & (full @ c.row <= c.upper)
        count, reason = admissible_turns(q, r.joint_limits(), room)
        assert {tuple(t) for t in room[:count]} == {tuple(t) for t in every[inside]}
        assert (reason == 0) == (count > 0)
        empty += count == 0
    assert 0 < empty < 60


def test_the_parallel_rod_bounds_the_sum_of_joints_two_and_three():
    r = robot("abb_irb2400_155")
    (rod,) = r.couplings
    assert rod.name == "joint 2 + joint 3"
    q = np.radians([0, 60, 10, 0, 30, 0])
    assert len(r.inverse(r.forward(np.radians([0, 50, 10, 0, 30, 0])))) > 0
    kept = r.inverse(r.forward(q))
    total = np.degrees(kept.q[:, 1] + kept.q[:, 2])
    assert ((total >= -60 - 1e-6) & (total <= 65 + 1e-6)).all()
    assert not (np.abs(kept.q - q).max(axis=1) < 1e-6).any()  # 60 + 10 is over 65


def test_fanuc_bounds_joint_three_against_the_horizontal():
    (horizontal,) = robot("fanuc_m10ia").couplings
    np.testing.assert_array_equal(horizontal.row, [0, -1, 1, 0, 0, 0])
    # Tilting the upper arm with the pendant's J3 held keeps the forearm's direction.
    r = robot("fanuc_m10ia")
    a, b = (r.forward(np.radians(q)) for q in ([0, 0, 20, 0, 0, 0], [0, 30, 50, 0, 0, 0]))
    np.testing.assert_allclose(a[:3, :3], b[:3, :3], atol=1e-12)


def test_an_endless_joint_has_one_vertex_and_no_limits():
    r = robot("abb_irb4600_60_205").with_limits(endless=[0, 0, 0, 1, 0, 1])
    q = np.array([0.1, 0.2, 0.3, 0.5, 0.6, 0.7])
    found = r.inverse(r.forward(q))
    assert (found.turn[:, [3, 5]] == 0).all()
    assert len(found) < len(robot("abb_irb4600_60_205").inverse(r.forward(q)))


def test_accelerations_that_nobody_publishes_must_be_named():
    r = robot("abb_irb4600_60_205")
    with pytest.raises(InputError, match=r"joint accelerations are not known.*acceleration_ratio="):
        r.speed_limits()
    assumed = robot("abb_irb4600_60_205", acceleration_ratio="iontec_20_to_70kg")
    np.testing.assert_allclose(
        assumed.speed_limits()[1] / r.velocity, acceleration_ratios()["iontec_20_to_70kg"]
    )
    assert "assumed" in assumed.acceleration_source


def test_a_robot_without_limits_is_refused_until_they_are_given():
    r = robot("kuka_kr120_r2500_pro")
    with pytest.raises(InputError, match=r"joint limits are not known .*copy error"):
        r.inverse(np.eye(4))
    other = robot("kuka_kr120_r2700_2")
    given = r.with_limits(lower=other.lower, upper=other.upper, velocity=other.velocity)
    assert len(given.inverse(given.forward(np.radians([10, -60, 90, 20, 30, 40])))) > 0
    with pytest.raises(InputError, match="acceleration_ratio cannot be applied"):
        robot("kuka_kr120_r2500_pro", acceleration_ratio="quantec_120_to_300kg")


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: robot("abb_irb4600"), "the library of 69 robots; nearest: .*abb_irb4600_60_205"),
        (lambda: robot("zzz"), "no id there is similar"),
        (lambda: robot("staubli_tx60", acceleration_ratio="fast"), "one of .*, got 'fast'"),
        (lambda: robot("staubli_tx60").with_limits(lower=np.full(6, 9.0)), "joint 1 are reversed"),
        (
            lambda: robot("staubli_tx60").with_limits(velocity=[1, 1, 1, 1, 1, 0]),
            "must be positive",
        ),
        (lambda: robot("staubli_tx60").with_limits(endless=[2] * 6), "true or false"),
        (lambda: Arm(geometry={"a1": 0.1}), "lacks a2, b, c1"),
        (lambda: robot("staubli_tx60").forward([1, 2, 3]), r"expected shape \(any, 6\)"),
        (lambda: robot("staubli_tx60").inverse(np.eye(3)), r"expected shape \(any, 4, 4\)"),
        (lambda: Coupling(row=np.ones(6), lower=1.0, upper=0.0), "must be below the upper bound"),
    ],
)
def test_bad_input_is_refused(call, message):
    with pytest.raises(InputError, match=message):
        call()


def test_limits_with_more_turns_than_can_be_told_apart_are_refused():
    """Truncated in silence, they would lose solutions."""
    arm = robot("abb_irb4600_60_205")
    wide = np.full(6, 4 * np.pi - 1e-6)  # 4 turns each: 4096 combinations
    q = np.array([0.3, 0.2, -0.1, 0.4, 0.5, 0.6])
    none = np.zeros(6, bool)
    found = arm.with_limits(lower=-wide, upper=wide, endless=none).inverse(arm.forward(q))
    assert len(found) > 4096
    wider = arm.with_limits(lower=-wide - 1e-3, upper=wide + 1e-3, endless=none)
    with pytest.raises(InputError, match=r"at most 4096 combinations of turns, got 15625"):
        wider.inverse(arm.forward(q))
    endless = arm.with_limits(lower=-wide - 1e-3, upper=wide + 1e-3, endless=np.arange(6) > 2)
    assert len(endless.inverse(arm.forward(q)))
