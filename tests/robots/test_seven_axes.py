"""Seven axes with a spherical shoulder and wrist: kinematics as laws, recognised, and refused."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tests.urdf.test_urdf import described

from conftest import pose, rebuilt
from kerfpath import InputError, Robot, robot
from kerfpath.comfort import jacobian, measure
from kerfpath.dynamics import Load
from kerfpath.robots import Arm, chain_of
from kerfpath.robots.recognition import recognise
from kerfpath.urdf import KinematicChain

LBR = "kuka_lbr_iiwa14_r820"
RAIL = {"lower": -1.0, "upper": 1.0, "velocity": 1.0, "acceleration": 2.0}


@pytest.fixture(scope="module")
def lbr():
    return robot(LBR).with_limits(acceleration=[5.0] * 7)


def placed(arm, rng):
    """The arm on another foot, with another flange, other signs and offsets."""
    foot, end = (pose(rng.uniform(-1, 1, 3), Rotation.random(rng=rng).as_matrix()) for _ in "ab")
    sign, offset = rng.choice([-1.0, 1.0], 7), rng.uniform(-3, 3, 7)
    return rebuilt(arm, T_base_foot=foot, T_end_flange=end, sign=sign, offset=offset)


def off(a, b):
    """Largest angle between joint vectors, on whatever turn."""
    return np.abs(np.remainder(a - b + np.pi, 2 * np.pi) - np.pi).max(axis=-1)


def test_every_posture_brings_the_flange_there_and_one_is_the_seed(lbr):
    rng = np.random.default_rng(1)
    for arm in (lbr, *(placed(lbr, rng) for _ in range(5))):
        q = rng.uniform(-np.pi, np.pi, (2000, 7))
        T = arm.forward(q)
        found = arm.inverse(T, given=q[:, 2], within_limits=False)
        # All eight: whether there are any depends on distances alone, whatever the signs.
        every = np.tile(np.arange(8), (2000, 1))
        np.testing.assert_array_equal(found.posture.reshape(-1, 8), every)
        np.testing.assert_allclose(arm.forward(found.q), T[found.pose], atol=1e-12)
        np.testing.assert_array_equal(found.q[:, 2], q[found.pose, 2])
        assert (np.abs(np.delete(found.q, 2, axis=1)) <= np.pi).all()
        # Rounding, which the inverse enlarges beside singularities.
        assert off(found.q.reshape(-1, 8, 7), q[:, None]).min(axis=1).max() < 1e-9


def test_with_joint_3_at_zero_it_is_an_ortho_parallel_arm_posture_by_posture(lbr):
    g = lbr.geometry
    six = Arm(geometry={"a1": 0.0, "a2": 0.0, "b": 0.0} | g)
    upright = replace(lbr.arm, sign=np.ones(7))
    q = np.random.default_rng(2).uniform(-3, 3, (500, 6))
    T = six.forward(q)
    seven, (want, reach) = upright.inverse_all(T, np.zeros(len(T)))[0], six.inverse_all(T)
    assert reach.all()
    assert off(np.delete(seven, 2, axis=2), want).max() < 1e-9  # as above


def test_the_shoulder_turns_with_joint_3_and_the_wrist_stays(lbr):
    """What is left free: a circle of the elbow about the line from shoulder to wrist."""
    q = np.radians([20.0, 40.0, 0.0, -70.0, 10.0, 60.0, 30.0])
    T, given = lbr.forward(q), np.radians(np.arange(-150.0, 151.0, 10.0))
    at = np.repeat(T[None], len(given), axis=0)
    found = lbr.inverse(at, given=given, within_limits=False)
    chain = lbr.chain or chain_of(lbr)
    elbow, wrist = (chain.frames(found.q)[:, i, :3, 3] for i in (4, 6))
    np.testing.assert_allclose(wrist, np.tile(wrist[0], (len(wrist), 1)), atol=1e-12)
    shoulder = np.array([0.0, 0.0, 0.36])
    for point, length in ((shoulder, 0.42), (wrist[0], 0.40)):
        np.testing.assert_allclose(np.linalg.norm(elbow - point, axis=1), length, atol=1e-12)
    assert np.ptp(elbow, axis=0).max() > 0.3


@pytest.mark.parametrize(
    "angles",
    [
        [30, 40, 20, 0, 50, 60, 70],  # elbow straight
        [30, 40, 20, -80, 50, 0, 70],  # wrist straight
        [30, 0, 20, -80, 50, 60, 70],  # axes 1 and 3 in line
        [30, 0, 20, 0, 50, 0, 70],  # all three
        [30, 0, 0, 0, 0, 0, 0],  # upright
        [30, -50, 90, 60, 50, 60, 70],  # the elbow's plane square to that of the shoulder
    ],
)
def test_at_singularities_the_pose_is_reached(lbr, angles):
    q = np.radians(np.array(angles, dtype=float))
    for small in (0.0, 1e-15, 1e-11, 1e-8, 1e-5):
        near = q + small * np.array([0, 1, -1, 1, 1, -1, 1])
        T = lbr.forward(near)
        found = lbr.inverse(T, given=near[2], within_limits=False)
        assert len(found) >= 4
        # A square root of rounding is what the stretched arm leaves of its reach.
        np.testing.assert_allclose(lbr.forward(found.q), np.tile(T, (len(found), 1, 1)), atol=1e-9)


def test_the_wrist_above_the_shoulder_leaves_joint_1_free_and_it_is_solved(lbr):
    T = pose([0.0, 0.0, 0.36 + 0.6 + 0.152])
    for given in (0.0, np.pi):
        found = lbr.inverse(T, given=given, within_limits=False)
        assert len(found) == 8
        np.testing.assert_allclose(lbr.forward(found.q), np.tile(T, (8, 1, 1)), atol=1e-9)
    # With joint 3 elsewhere the bent forearm leads away from axis 1, wherever joint 2 stands.
    assert not len(lbr.inverse(T, given=0.8, within_limits=False))


def test_what_is_out_of_reach_has_no_solution_and_limits_are_kept(lbr):
    assert len(lbr.inverse(pose([1.5, 0, 0]), given=0.0)) == 0
    q = np.random.default_rng(4).uniform(lbr.lower, lbr.upper, (500, 7))
    T = lbr.forward(q)
    every, kept = (lbr.inverse(T, given=q[:, 2], within_limits=w) for w in (False, True))
    inside = ((every.q >= lbr.lower) & (every.q <= lbr.upper)).all(axis=1)
    np.testing.assert_array_equal(kept.q, every.q[inside])
    assert inside.sum() < len(inside)
    assert len(lbr.inverse(T, given=lbr.upper[2] + 1e-6)) == 0
    wide = lbr.with_limits(lower=lbr.lower * 3, upper=lbr.upper * 3)
    turned = wide.inverse(lbr.forward(np.full(7, 0.5)), given=0.5 + 2 * np.pi)
    # Joint 3 stays on the turn that is given; the others have all of theirs.
    assert (turned.q[:, 2] == 0.5 + 2 * np.pi).all()
    assert not turned.turn[:, 2].any()
    assert np.ptp(turned.turn[:, 0]) > 0


def test_the_joint_that_is_given_must_be(lbr):
    T = lbr.forward(np.zeros(7))
    with pytest.raises(InputError, match=r"infinitely many .*; give the value of joint 3"):
        lbr.inverse(T)
    with pytest.raises(InputError, match=r"given=: poses leave no joint free .ortho-parallel arm"):
        robot("staubli_tx60").inverse(T, given=0.0)
    with pytest.raises(InputError, match="leave no joint of this arm free"):
        robot("staubli_tx60").with_elbow_step(0.1)
    with pytest.raises(InputError, match="elbow_step: expected a number above 0 rad"):
        lbr.with_elbow_step(0.0)
    with pytest.raises(InputError, match="is for 6 joints, but robot 'kuka_lbr_iiwa14_r820' has 7"):
        robot(LBR, acceleration_ratio="iontec_20_to_70kg")
    rides = lbr.on_rail([1, 0, 0], **RAIL).on_rail([0, 1, 0], name="cross", **RAIL)
    assert rides.joint_names == (*(f"joint {i}" for i in range(1, 8)), "rail", "cross")
    np.testing.assert_array_equal(rides.free, [2, 7, 8])
    np.testing.assert_array_equal(rides.solved, [0, 1, 3, 4, 5, 6])
    with pytest.raises(InputError, match="at most 2 external axes, because the elbow of the arm"):
        rides.on_rail([0, 0, 1], name="lift", **RAIL)


def test_measures_of_comfort_are_zero_where_directions_are_lost(lbr):
    """The determinant of the six columns beside joint 3: c2 c3 sin(elbow) shoulder sin(wrist)."""
    q = np.random.default_rng(5).uniform(-3, 3, (200, 7))
    J = np.delete(jacobian(lbr, q), 2, axis=2)
    wrist, elbow, shoulder = (measure(name, lbr, q) for name in ("wrist", "elbow", "shoulder"))
    want = 0.42 * 0.40 * np.sin(elbow) * shoulder * np.sin(wrist)
    np.testing.assert_allclose(np.abs(np.linalg.det(J)), want, atol=1e-12)
    straight = np.radians([[30.0, 40.0, 20.0, 0.0, 50.0, 60.0, 70.0]])
    assert measure("manipulability", lbr, straight)[0] < 1e-9  # the root of a rounded zero


@pytest.mark.parametrize("seed", range(6))
def test_it_is_recognised_in_whatever_joint_frames(tmp_path, lbr, seed):
    path = described(tmp_path, lbr, gauge=np.random.default_rng(seed))
    back = Robot.from_urdf(path)
    assert back.kinematics == "srs"
    assert back.geometry["c2"] == pytest.approx(0.42, abs=1e-9)
    assert back.geometry["c3"] == pytest.approx(0.40, abs=1e-9)
    q = np.random.default_rng(6).uniform(-3, 3, (50, 7))
    np.testing.assert_allclose(back.forward(q), back.chain.forward(q), atol=1e-9)


def test_torques_of_an_arm_whose_elbow_is_free_are_refused(lbr):
    with pytest.raises(InputError, match="whose joint 3 is free are not supported yet"):
        lbr.with_load(Load(mass=2.0, centre=[0, 0, 0.1]))


def test_arms_of_seven_axes_that_are_not_of_this_kind_are_refused(lbr):
    chain = chain_of(lbr)

    def moved(joint, xyz, rotvec=(0, 0, 0)):
        origins = chain.origins.copy()
        origins[joint] = origins[joint] @ pose(xyz, Rotation.from_rotvec(rotvec).as_matrix())
        return KinematicChain(origins=origins, axes=chain.axes, end=chain.end)

    # 82.5 mm at the elbow of a Franka arm: not this kind, but another.
    for joint, other in ((3, "shoulder"), (6, "wrist"), (1, "shoulder")):
        assert recognise(moved(joint, [0.08, 0, 0]))[0].kinematics == f"offset_{other}"
    assert recognise(moved(4, [0, 0, 0], [0.1, 0, 0]))[0].kinematics == "offset_shoulder"
    chain = moved(1, [0.02, 0, 0])
    with pytest.raises(
        InputError, match=r"1, 2 and 3 miss.*5, 6 and 7 miss.*1, 2 and 3 miss.*other seven-axis"
    ):
        recognise(moved(5, [0.02, 0, 0]))
    chain = chain_of(lbr)
    with pytest.raises(InputError, match=r"nearly an arm of seven axes.*write.*more digits$"):
        recognise(moved(3, [2e-5, 0, 0]))
