"""Seven axes with an offset shoulder or wrist: kinematics as laws on random arms, and plans."""

import numpy as np
import pytest
from benchmarks._seven_axis_arms import panda, panda_chain
from scipy.spatial.transform import Rotation
from tests.urdf.test_urdf import joint, urdf

from conftest import pose
from kerfpath import Contour, InputError, Robot, audit, plan
from kerfpath.refiner import refine
from kerfpath.robots import Arm
from kerfpath.robots.recognition import recognise
from kerfpath.urdf import KinematicChain

MEETING = {"offset_shoulder": ((1, 2), (4, 5, 6)), "offset_wrist": ((0, 1, 2), (4, 5))}
FREE = {"offset_shoulder": 0, "offset_wrist": 6}


def arm_of(family, rng):
    """An arm of the family with axes in random directions, that meet where they have to."""
    place, along = rng.uniform(-0.5, 0.5, (7, 3)), rng.normal(size=(7, 3))
    along /= np.linalg.norm(along, axis=1)[:, None]
    for group in MEETING[family]:
        point = rng.uniform(-0.5, 0.5, 3)
        place[list(group)] = point + along[list(group)] * rng.uniform(-0.2, 0.2, (len(group), 1))
    origins = np.tile(np.eye(4), (7, 1, 1))
    origins[:, :3, 3] = np.diff(place, axis=0, prepend=0.0)
    end = pose(rng.uniform(-0.3, 0.3, 3), Rotation.random(rng=rng).as_matrix())
    return recognise(KinematicChain(origins=origins, axes=along, end=end))[0]


def off(a, b):
    """Largest angle between joint vectors, on whatever turn."""
    return np.abs(np.remainder(a - b + np.pi, 2 * np.pi) - np.pi).max(axis=-1)


@pytest.mark.parametrize("family", MEETING)
@pytest.mark.parametrize("seed", range(8))
def test_every_posture_brings_the_flange_there_and_one_is_the_seed(family, seed):
    rng = np.random.default_rng(seed)
    arm = arm_of(family, rng)
    assert arm.kinematics == family
    q = rng.uniform(-np.pi, np.pi, (500, 7))
    T = arm.forward(q)
    # Another order of the same rotations, and its rounding.
    np.testing.assert_allclose(T, arm.chain.forward(q), atol=1e-14)
    free = FREE[family]
    found, reach = arm.inverse_all(T, q[:, free].copy())
    b, _ = np.nonzero(reach)
    solved = found[reach]
    # Beside singularities, angles are square roots of what rounding leaves.
    np.testing.assert_allclose(arm.forward(solved), T[b], atol=1e-9)
    np.testing.assert_array_equal(solved[:, free], q[b, free])
    assert (np.abs(solved) <= np.pi).all()
    apart = np.where(reach, off(found, q[:, None]), np.inf)
    assert apart.min(axis=1).max() < 1e-6
    # Two solutions of the shoulder, of joint 4 and of the wrist come together.
    assert not (reach.sum(axis=1) % 2).any()


@pytest.mark.parametrize("family", MEETING)
def test_a_posture_is_followed_until_two_solutions_are_one(family):
    rng = np.random.default_rng(20)
    for _ in range(20):
        arm = arm_of(family, rng)
        way = rng.uniform(-np.pi, np.pi, 7) + np.linspace(0, 0.5, 400)[:, None] * rng.normal(size=7)
        found, reach = arm.inverse_all(arm.forward(way), way[:, FREE[family]].copy())
        postures = np.where(reach, off(found, way[:, None]), np.inf).argmin(axis=1)
        for k in np.flatnonzero(np.diff(postures)):
            # Its neighbour is another solution of the same pose, and nearly the same one.
            one, two = found[k, postures[k]], found[k, postures[k + 1]]
            assert reach[k, postures[k + 1]]
            assert off(one, two) < 0.5


@pytest.mark.parametrize("angles", [[0] * 7, [0, 0, 0, -90, 0, 90, 0], [20, 0, 40, -60, 0, 0, 10]])
def test_at_singularities_the_pose_is_reached(angles):
    arm, _ = recognise(panda_chain())
    q = np.radians(np.array(angles, dtype=float))
    for small in (0.0, 1e-15, 1e-11, 1e-8, 1e-5):
        near = q + small * np.array([0, 1, -1, 1, 1, -1, 1])
        T = arm.forward(near)[None]
        found, reach = arm.inverse_all(T, near[6:])
        assert reach.sum() >= 2
        want = np.tile(T, (int(reach.sum()), 1, 1))
        np.testing.assert_allclose(arm.forward(found[reach]), want, atol=1e-8)


def test_a_panda_stands_where_franka_says():
    arm, notes = recognise(panda_chain())
    assert (arm.kinematics, notes) == ("offset_wrist", ())
    # Upright: 333 + 316 + 384 mm high, down again by 107, and 88 ahead.
    np.testing.assert_allclose(arm.forward(np.zeros(7))[:3, 3], [0.088, 0, 0.926], atol=1e-15)
    far = pose([0.9, 0, 0.333])
    assert not arm.inverse_all(far[None], np.zeros(1))[1].any()


@pytest.mark.parametrize("seed", range(4))
def test_it_is_read_from_a_description_in_whatever_joint_frames(tmp_path, seed):
    chain, rng = panda_chain(), np.random.default_rng(seed)
    origins, axes, end = chain.origins.copy(), chain.axes.copy(), chain.end
    for i in range(7):
        G = pose(axes[i] * rng.uniform(-1, 1), Rotation.random(rng=rng).as_matrix())
        origins[i], axes[i] = origins[i] @ G, G[:3, :3].T @ axes[i]
        if i < 6:
            origins[i + 1] = np.linalg.inv(G) @ origins[i + 1]
        else:
            end = np.linalg.inv(G) @ end
    names = ["base", *(f"link_{i}" for i in range(1, 8)), "tool0"]
    joints = [joint(f"j{i + 1}", names[i], names[i + 1], origins[i], axes[i]) for i in range(7)]
    last = joint("end", "link_7", "tool0", end, kind="fixed", inside="")
    path = urdf(tmp_path, [*joints, last], names)
    back = Robot.from_urdf(path, acceleration=[5.0] * 7)
    assert back.kinematics == "offset_wrist"
    np.testing.assert_array_equal(back.free, [6])
    q = np.random.default_rng(6).uniform(-3, 3, (50, 7))
    # Digits of the file.
    np.testing.assert_allclose(back.forward(q), chain.forward(q), atol=1e-9)
    with pytest.raises(InputError, match="give the value of joint 7"):
        back.inverse(back.forward(q[0]))
    with pytest.raises(InputError, match=r"this does not support .*: poses leave joint 7"):
        back.require_no_free_joint("this")


def test_axes_that_do_not_meet_are_refused_with_their_names():
    chain = panda_chain()
    for moved, said in (
        (1, r"axes 1, 2 and 3 miss a common point by 40 mm"),
        (5, r"axes 5 and 6 miss a common point by 40 mm"),
    ):
        origins = chain.origins.copy()
        origins[moved] = origins[moved] @ pose([0.04, 0, 0])
        with pytest.raises(InputError, match=said + ".*other seven-axis arms"):
            recognise(KinematicChain(origins=origins, axes=chain.axes, end=chain.end))
    with pytest.raises(InputError, match="needs the chain of its seven joints"):
        Arm(kinematics="offset_wrist", geometry={}).forward(np.zeros(7))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_a_plan_is_no_worse_than_the_best_of_a_grid_even_refined(seed):
    rng = np.random.default_rng(seed)
    arm, tool, placement = panda(), pose([0, 0, 0.1]), np.eye(4)
    placement[:3, 3] = rng.uniform([0.35, -0.2, 0.2], [0.5, 0.2, 0.4])
    y, (a, b, c) = np.linspace(-0.06, 0.06, 7), rng.uniform(-0.6, 0.6, 3)
    axes = np.c_[a * np.sin(8 * y), b + 2 * c * y, -np.ones(7)]
    cut = Contour(np.c_[0 * y, y, 0.5 * y**2], axes, name="cut")
    options = {"tool": tool, "placement": placement, "speed": 0.1}
    made = plan(cut, arm, gamma_step=np.radians(5), **options)
    issues = audit(made, interpolation="joint", path_tolerance=5e-3)
    # A warning is due where a straight move passes near a singularity.
    assert {issue.code for issue in issues} <= {"unbounded"}
    step = np.radians(15)
    best = plan(cut, arm.with_elbow_step(step), gamma_step=step, method="exact", **options)
    assert made.cost <= best.cost
    # A hundredth: what valleys that the courses do not lead to may be worth.
    assert made.cost <= 1.01 * refine(best).cost_after
