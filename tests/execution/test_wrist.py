"""A wrist that goes evenly from joints to joints: against an optimiser, one pose at a time."""

import numpy as np
import pytest
from scipy.optimize import least_squares

from kerfpath import InputError, plan
from kerfpath.execution import executed, from_stop_to_stop, run_along
from kerfpath.post import Controller, build_program
from kerfpath.robots import Arm, Robot, RobotLimits

WRIST = Controller(orientation="wrist")


@pytest.fixture(scope="module")
def made(circle, arm, tool, placement):
    step = np.radians(10)
    return plan(circle, arm, tool=tool, placement=placement, speed=0.3, gamma_step=step)


@pytest.fixture(scope="module")
def run(made):
    (run,) = executed(build_program([made]), controller=WRIST)
    return run


def placed(made, arm, q, point):
    """Joints with the wrist of q that put the tip to a point, found step by step."""

    def off(first):
        T = arm.forward(np.append(first, q[3:])[None])[0] @ made.T_flange_tip
        return (T[:3, 3] - point) * 1e3

    found = least_squares(off, q[:3], xtol=1e-15, ftol=1e-15, gtol=1e-15)
    return np.append(found.x, q[3:])


def test_the_wrist_goes_evenly_and_the_tip_stays_on_its_way(made, arm, run):
    planned = made.unwrapped
    even = run.tool_motion.blended(planned, run.time)
    np.testing.assert_array_equal(run.q[:, 3:], even[:, 3:])
    tip = made.T_base_part @ run.tool_motion.poses(run.time)
    for k in range(0, len(run.time), 37):
        # mm in the residual leave 1e-12 m.
        expected = placed(made, arm, even[k], tip[k, :3, 3])
        np.testing.assert_allclose(run.q[k], expected, rtol=0, atol=1e-9)
    T = arm.forward(run.q) @ made.T_flange_tip
    np.testing.assert_allclose(T[:, :3, 3], tip[:, :3, 3], rtol=0, atol=1e-10)
    np.testing.assert_allclose(made.T_base_part @ run.T, T, rtol=0, atol=1e-12)


def test_between_the_nodes_the_tool_is_turned_otherwise_than_by_poses(made, run):
    (plain,) = executed(build_program([made]))
    R = np.swapaxes(plain.T[:, :3, :3], 1, 2) @ run.T[:, :3, :3]
    turned = np.arccos(np.clip((np.trace(R, axis1=1, axis2=2) - 1) / 2, -1, 1))
    assert 1e-6 < turned.max() < 1e-2
    # At nodes that are far from each other's zones nothing differs; all are close to it here.
    np.testing.assert_allclose(run.T[:, :3, 3], plain.T[:, :3, 3], rtol=0, atol=1e-10)


def test_the_peaks_are_those_of_dense_sampling(made, arm, run):
    step = 1e-4
    time = np.arange(2 * step, run.tool_motion.time[-1] - 2 * step, 0.02)
    q = [
        np.array([
            placed(made, arm, joints, T[:3, 3])
            for joints, T in zip(
                run.tool_motion.blended(made.unwrapped, at),
                made.T_base_part @ run.tool_motion.poses(at), strict=True,
            )
        ])
        for at in (time - step, time, time + step)
    ]  # fmt: skip
    velocity, acceleration = arm.speed_limits()
    fast = np.abs((q[2] - q[0]) / (2 * step) / velocity).max()
    sharp = np.abs((q[2] - 2 * q[1] + q[0]) / step**2 / acceleration).max()
    # Few samples: a percent or three may lie beside them.
    assert run.peak_velocity.share == pytest.approx(fast, rel=0.02)
    assert run.peak_acceleration.share == pytest.approx(sharp, rel=0.05)


def test_it_is_said_to_be_sampled(run):
    assert "nothing is proved" in run.sampled
    assert np.isinf([run.velocity_bound, run.acceleration_bound]).all()


def test_an_arm_without_a_wrist_of_three_joints_is_refused(made):
    five = Robot(
        id="five",
        arm=Arm(
            kinematics="five",
            geometry={"a1": 0.3, "a2": -0.1, "b": 0.0, "c1": 0.7, "c2": 0.9, "c3": 0.8, "c4": 0.12},
        ),
        limits=RobotLimits(
            lower=np.full(5, -3.0),
            upper=np.full(5, 3.0),
            velocity=np.full(5, 2.0),
            acceleration=np.full(5, 8.0),
        ),
    )
    moves = from_stop_to_stop(build_program([made]).sections[0].moves)[0]
    with pytest.raises(InputError, match="'wrist' is modelled for six joints, got 5"):
        run_along(moves, five, T_base_part=np.eye(4), T_flange_tip=np.eye(4), controller=WRIST)
