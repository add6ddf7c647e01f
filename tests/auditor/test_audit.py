"""The audit: its kinematics against pinocchio, and every fault it must find."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from tests.robots.test_robot import pinocchio_pose, random_joints

import naive
from kerfpath import Contour, InputError, audit, plan, robot
from kerfpath.auditor import chain_of, checks
from kerfpath.auditor.motion import joint_increments
from kerfpath.robots import Coupling, robot_ids

STEP = np.radians(5)


@pytest.fixture(scope="module")
def drawn():
    """The drawing of the circle, far finer than the nodes."""
    t = np.linspace(0, 2 * np.pi, 4001)
    points = np.c_[0.15 * np.cos(t), 0.15 * np.sin(t), 0.02 * np.cos(2 * t)]
    axes = np.c_[-0.2 * np.cos(t), -0.2 * np.sin(t), -np.ones_like(t)]
    return Contour(points, axes, closed=True, name="circle")


@pytest.fixture(scope="module")
def good(drawn, arm, tool, placement):
    return plan(
        drawn.resample(count=121), arm, tool=tool, placement=placement, speed=0.1, gamma_step=STEP
    )


def row(table, code):
    return next(check for check in table if check.code == code)


def test_half_a_turn_goes_the_way_that_the_values_go():
    rng = np.random.default_rng(12)
    for _ in range(200):
        q = np.pi / rng.integers(1, 5) * rng.integers(-6, 7, (8, 6))
        endless = rng.random(6) < 0.7
        moved = SimpleNamespace(q=q, robot=SimpleNamespace(endless=endless))
        np.testing.assert_allclose(
            joint_increments(moved), naive.difference(q[:-1], q[1:], endless), atol=1e-12
        )


@pytest.mark.parametrize("name", robot_ids())
def test_the_chain_agrees_with_pinocchio(name):
    q = random_joints(np.random.default_rng(11), 20, joints=robot(name).joints)
    np.testing.assert_allclose(
        chain_of(robot(name)).forward(q), pinocchio_pose(robot(name), q), atol=1e-12
    )


def test_the_jacobian_agrees_with_finite_differences():
    chain = chain_of(robot("fanuc_m10ia"))
    q = np.random.default_rng(12).uniform(-2, 2, (20, 6))
    T, J = chain.jacobian(q)
    h = 1e-6
    for i in range(6):
        step = np.zeros(6)
        step[i] = h
        dT = (chain.forward(q + step) - chain.forward(q - step)) / (2 * h)
        spin = dT[:, :3, :3] @ T[:, :3, :3].transpose(0, 2, 1)
        # Central differences: error h^2 plus rounding over h.
        np.testing.assert_allclose(J[:, :3, i], dT[:, :3, 3], atol=1e-8)
        np.testing.assert_allclose(J[:, 3, i], spin[:, 2, 1], atol=1e-8)
        np.testing.assert_allclose(J[:, 5, i], spin[:, 1, 0], atol=1e-8)


@pytest.mark.parametrize("interpolation", ["linear", "joint"])
def test_a_good_plan_passes(good, drawn, interpolation):
    assert audit(good, reference=drawn, interpolation=interpolation, path_tolerance=2e-4) == []


def test_the_chord_error_is_measured_against_the_drawing(good, drawn):
    # Circle of radius R sampled at angle a: sagitta R (1 - cos(a / 2)); the dome adds little.
    sagitta = 0.15 * (1 - np.cos(np.pi / 120))
    measured = row(checks(good, reference=drawn), "tip-between-nodes").value
    assert measured == pytest.approx(sagitta, rel=0.25)
    assert row(checks(good), "tip-between-nodes").value < 1e-9
    (issue,) = audit(good, reference=drawn, path_tolerance=2e-5)
    assert issue.code == "tip-between-nodes"
    assert "sample the contour more finely" in str(issue)
    assert "allowed 0.02 mm" in str(issue)


def test_finer_nodes_are_no_advice_for_a_target_that_was_moved(good, drawn):
    points = good.contour.points.copy()
    points[40, 0] += 5e-4
    moved = replace(good, contour=replace(good.contour, points=points))
    q = good.robot.arm.follow(
        moved.T_base_part @ moved.T_part_tip @ np.linalg.inv(moved.T_flange_tip), good.q,
        good.posture,
    )  # fmt: skip
    found = audit(replace(moved, q=q), reference=drawn, path_tolerance=2e-4)
    issue = next(i for i in found if i.code == "tip-between-nodes")
    assert issue.node in (39, 40)
    assert "the target itself is off the path there" in str(issue)
    assert "more finely" not in str(issue)


def spoilt(good, **change):
    return {issue.code for issue in audit(replace(good, **change))}


def test_a_wrong_tool_or_placement_is_found(good):
    T = good.T_flange_tip.copy()
    T[0, 3] += 2e-6
    assert "tip-at-nodes" in spoilt(good, T_flange_tip=T)
    T = good.T_base_part.copy()
    T[:3, :3] = [[1, 0, 0], [0, np.cos(1e-4), -np.sin(1e-4)], [0, np.sin(1e-4), np.cos(1e-4)]]
    assert {"tip-at-nodes", "axis-at-nodes"} <= spoilt(good, T_base_part=T)


def test_a_joint_moved_at_one_node_is_found(good):
    q = good.q.copy()
    q[40, 2] += 1e-4
    assert "tip-at-nodes" in spoilt(good, q=q)
    issue = next(i for i in audit(replace(good, q=q)) if i.code == "tip-at-nodes")
    assert issue.node == 40


def test_joint_limits_are_checked_at_and_between_the_nodes(good):
    # Endless axes have no limits: the tightest box around the other joints, cut a little.
    highest = good.q[:, 1].max()
    upper = good.robot.upper.copy()
    upper[1] = highest - 1e-6
    assert "joint-limits" in spoilt(good, robot=good.robot.with_limits(upper=upper))
    upper[1] = highest + 1e-3
    assert "joint-limits" not in spoilt(good, robot=good.robot.with_limits(upper=upper))
    rod = Coupling(row=[0, 1, 1, 0, 0, 0], lower=-9.0, upper=good.q[:, 1:3].sum(1).max() - 1e-6)
    assert "coupled-limits" in spoilt(good, robot=good.robot.with_limits(couplings=(rod,)))


def test_velocity_and_acceleration_are_checked(good):
    peak = np.abs(good.velocity_share).max()
    slow = good.robot.with_limits(velocity=good.robot.velocity * peak * 0.999)
    assert {"velocity", "velocity-between"} <= spoilt(good, robot=slow)
    peak = np.abs(good.acceleration_share).max()
    weak = good.robot.with_limits(acceleration=good.robot.acceleration * peak * 0.999)
    assert "acceleration" in spoilt(good, robot=weak)
    assert "velocity" in spoilt(
        good, settings=replace(good.settings, eta_v=float(np.abs(good.velocity_share).max() * 0.99))
    )


def test_a_change_of_posture_cannot_be_a_straight_move(good):
    q = good.q.copy()
    found = good.robot.inverse(good.robot.forward(q[60]))
    other = found.q[found.posture != good.posture[60]]
    q[60:] = [
        min(good.robot.inverse(good.robot.forward(x)).q, key=lambda y: np.abs(y - other[0]).sum())
        for x in q[60:]
    ]
    assert {"velocity", "velocity-between"} <= spoilt(good, q=q)


def test_a_half_turn_between_nodes_is_found(good):
    q = good.q.copy()
    q[50:, 0] += 3.3
    assert "joint-step" in spoilt(good, q=q)


def test_bad_arguments_are_refused(good, drawn):
    with pytest.raises(InputError, match="expected linear or joint, got 'spline'"):
        audit(good, interpolation="spline")
    with pytest.raises(InputError, match="parts"):
        audit(good, parts=0)
    with pytest.raises(InputError, match="path_tolerance"):
        audit(good, path_tolerance=-1.0)
    half = Contour(drawn.points[:2000], drawn.axes[:2000])
    with pytest.raises(InputError, match=r"reference: .* as long as the plan's"):
        audit(good, reference=half)
