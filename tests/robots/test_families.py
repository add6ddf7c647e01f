"""Kinematic families beyond the ortho-parallel arm, and arms that stand or end elsewhere."""

import numpy as np
import pytest

from conftest import pose, rebuilt
from kerfpath import Contour, InputError, audit, fastest_speed, plan, robot
from kerfpath.auditor import chain_of
from kerfpath.graph import build, gamma_grid
from kerfpath.robots import Arm, Robot

UR = robot("ur_ur10e")


def turned(angle):
    return np.remainder(angle + np.pi, 2 * np.pi) - np.pi


def solved(r, q):
    """Solve FK(q); every row must give the pose back. Returns the solutions."""
    T = r.forward(q)
    found = r.inverse(T, within_limits=False)
    assert np.isfinite(found.q).all()
    np.testing.assert_allclose(r.forward(found.q), T[found.pose], atol=1e-9)
    return found


def test_all_postures_of_a_ur_give_the_pose_and_the_joints_are_among_them():
    q = np.random.default_rng(20).uniform(-np.pi, np.pi, (5000, 6))
    found = solved(UR, q)
    nearest = np.full(len(q), np.inf)
    np.minimum.at(nearest, found.pose, np.abs(turned(found.q - q[found.pose])).max(axis=1))
    assert nearest.max() < 1e-9
    assert set(np.bincount(found.pose)) <= {2, 4, 6, 8}
    # No two of a pose are the same.
    for mu in range(1, 8):
        a, b = (found.q[found.posture == p] for p in (0, mu))
        both, i, j = np.intersect1d(
            found.pose[found.posture == 0], found.pose[found.posture == mu], return_indices=True
        )
        assert len(both) > 0
        assert (np.abs(turned(a[i] - b[j])).max(axis=1) > 1e-6).all()


def test_the_postures_of_a_ur_are_told_apart_by_geometry():
    q = np.random.default_rng(21).uniform(-np.pi, np.pi, (500, 6))
    found = solved(UR, q)
    g, (_, q2, q3, q4, q5, _) = UR.geometry, found.q.T
    elbow = g["a2"] * np.array([np.cos(q2), np.sin(q2)])
    wrist = elbow + g["a3"] * np.array([np.cos(q2 + q3), np.sin(q2 + q3)])
    theta = q2 + q3 + q4
    radial = wrist[0] + g["d5"] * np.sin(theta)
    np.testing.assert_array_equal(found.posture // 4, radial > 0)  # at q2 = 0 it reaches to -x
    above = np.sign(radial) * (wrist[0] * elbow[1] - wrist[1] * elbow[0])
    clear = np.abs(above) > 1e-9
    np.testing.assert_array_equal((found.posture // 2 % 2)[clear], (above < 0)[clear])
    np.testing.assert_array_equal(found.posture % 2, np.sin(q5) < 0)


@pytest.mark.parametrize("name", ["abb_irb4600_60_205", "kuka_kr16_r1610_2", "ur_ur10e"])
def test_one_posture_is_solved_as_among_all_of_them(name):
    """Also of an arm that stands elsewhere; out of reach there are no joints."""
    rng = np.random.default_rng(22)
    arm = rebuilt(robot(name), T_base_foot=pose([0.3, -0.2, 0.5])).arm
    T = arm.forward(rng.uniform(-np.pi, np.pi, (300, 6))).copy()
    T[::3, :3, 3] *= rng.uniform(0.2, 2.0, (100, 1))
    q, reach = arm.inverse_all(T)
    assert 0 < reach.mean() < 1
    for mu in range(arm.postures):
        found = arm.follow(T, np.zeros((len(T), 6)), np.full(len(T), mu))
        np.testing.assert_array_equal(np.isfinite(found).all(axis=1), reach[:, mu])
        # Nearest to zero is within half a turn; the arithmetic is the same.
        np.testing.assert_allclose(turned(found - q[:, mu])[reach[:, mu]], 0, atol=1e-12)


@pytest.mark.parametrize("q5", [0.0, np.pi, 1e-13, 1e-9, 1e-6])
def test_a_ur_with_axes_four_and_six_in_line_is_solved(q5):
    q = np.random.default_rng(22).uniform(-np.pi, np.pi, (3000, 6))
    q[:, 4] = q5
    found = solved(UR, q)
    assert len(np.unique(found.pose)) == len(q)


def test_a_ur_with_a_straight_elbow_is_solved():
    q = np.random.default_rng(23).uniform(-np.pi, np.pi, (3000, 6))
    q[:, 2] = np.random.default_rng(24).choice([0.0, 1e-12, 1e-8, 1e-6], len(q))
    found = solved(UR, q)
    kept = np.bincount(found.pose, minlength=len(q))
    # At full stretch rounding may put a pose out of reach; its other postures remain.
    assert (kept > 0).mean() > 0.95


def test_a_ur_whose_wrist_touches_the_shoulder_cylinder_is_solved():
    # Axis 4 passes axis 1 at the distance d4: front and rear are one.
    g = UR.geometry
    T = np.eye(4)
    T[:3, 3] = [0.0, -g["d4"], g["d1"] + 0.7 + g["d6"]]
    found = UR.inverse(T, within_limits=False)
    assert len(found) == 8
    np.testing.assert_allclose(UR.forward(found.q), np.tile(T, (8, 1, 1)), atol=1e-9)
    T[:3, 3] = [0.0, -g["d4"] + 1e-6, g["d1"] + 0.7 + g["d6"]]
    assert len(UR.inverse(T, within_limits=False)) == 0
    T[:3, 3] = [3.0, 0.0, 0.0]
    assert len(UR.inverse(T, within_limits=False)) == 0


@pytest.mark.parametrize("name", ["ur_ur10e", "abb_irb4600_60_205"])
def test_an_arm_may_stand_and_end_elsewhere(name):
    rng = np.random.default_rng(25)
    foot, flange = robot(name).forward(rng.uniform(-3, 3, (2, 6)))
    own = robot(name)
    r = rebuilt(own, T_base_foot=foot, T_end_flange=flange)
    r = r.with_limits(endless=np.ones(6, bool))
    q = rng.uniform(-np.pi, np.pi, (50, 6))
    np.testing.assert_allclose(r.forward(q), foot @ own.forward(q) @ flange, atol=1e-14)
    np.testing.assert_allclose(chain_of(r).forward(q), r.forward(q), atol=1e-12)
    solved(r, q)
    gamma, tool = gamma_grid(1.0), pose([0.1, 0, 0.2])
    graph = build(r.forward(q) @ tool, r, T_flange_tip=tool, gamma=gamma)
    tip = r.forward(graph.q) @ tool
    want = np.repeat(r.forward(q) @ tool, np.diff(graph.start), axis=0)
    np.testing.assert_allclose(tip[:, :3, 2:], want[:, :3, 2:], atol=1e-9)
    assert (np.diff(graph.start) >= 2 * len(gamma)).any()


def test_signs_and_offsets_of_a_ur_are_kept():
    rng = np.random.default_rng(26)
    r = Robot(
        id="other",
        arm=Arm(
            kinematics="ur",
            geometry={"d1": 0.2, "a2": 0.5, "a3": 0.4, "d4": -0.1, "d5": 0.0, "d6": 0.1},
            sign=[1, -1, -1, 1, -1, 1],
            offset=rng.uniform(-np.pi, np.pi, 6),
        ),
    )
    q = rng.uniform(-np.pi, np.pi, (500, 6))
    found = solved(r, q)
    assert np.abs(found.q).max() <= np.pi
    np.testing.assert_allclose(chain_of(r).forward(q), r.forward(q), atol=1e-12)


@pytest.mark.slow
def test_a_ur_is_planned_and_audited_like_any_other():
    arm = robot("ur_ur10e", acceleration_ratio="cybertech_8_to_20kg")
    t = np.linspace(0, 2 * np.pi, 2001)
    points = np.c_[0.1 * np.cos(t), 0.1 * np.sin(t), 0.01 * np.cos(2 * t)]
    axes = np.c_[-0.2 * np.cos(t), -0.2 * np.sin(t), -np.ones_like(t)]
    contour = Contour(points, axes, closed=True).resample(count=81)
    c = np.sqrt(0.5)
    cell = {
        "tool": pose([0.05, 0, 0.15], [[c, 0, c], [0, 1, 0], [-c, 0, c]]),
        "placement": pose([-0.6, -0.2, 0.1]),
        "gamma_step": np.radians(5),
    }
    made = plan(contour, arm, speed=0.05, method="exact", refine=True, **cell)
    assert made.proof.optimal
    assert audit(made) == []
    assert fastest_speed(contour, arm, **cell).speed > 0.05


def test_unknown_families_and_lengths_are_refused():
    with pytest.raises(InputError, match=r"kinematics: expected one of opw, ur, .*, got 'scara'"):
        Arm(kinematics="scara", geometry={})
    with pytest.raises(InputError, match=r"geometry lacks d1, a3 \(m\)"):
        Arm(kinematics="ur", geometry={"a2": 1, "d4": 0, "d5": 0, "d6": 0})
    with pytest.raises(InputError, match=r"T_base_foot: the last row"):
        rebuilt(UR, T_base_foot=np.ones((4, 4)))
