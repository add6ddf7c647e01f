"""Torques against pinocchio, against the law of energy, and what is refused."""

import re

import numpy as np
import pinocchio as pin
import pytest
from tests.arms import (
    EFFORTS,
    arm_with_masses,
    described_with_masses,
    inertial,
    random_inertial,
)

from kerfpath import InputError, Robot, robot
from kerfpath.dynamics import ArmDynamics, Load
from kerfpath.limits import TorqueLimit
from kerfpath.urdf import read_urdf

LOAD = Load(mass=25.0, centre=(0.05, -0.02, 0.12), tensor=np.diag((0.4, 0.5, 0.3)))
NAMES = ["abb_irb4600_60_205", "ur_ur10e", "staubli_tx60"]


def model_of(path, load=None, gravity=(0.0, 0.0, -9.81)):
    """The description as pinocchio reads it, with a load on tool0."""
    model = pin.buildModelFromUrdf(str(path))
    model.gravity.linear = np.array(gravity)
    if load is not None:
        end = model.frames[model.getFrameId("tool0")]
        body = pin.Inertia(load.mass, load.centre, load.tensor)
        model.appendBodyToJoint(end.parentJoint, body, end.placement)
    return model


def motions(seed, count=200):
    rng = np.random.default_rng(seed)
    scale = np.array([np.pi, 3.0, 10.0])[:, None, None]  # rad, rad/s, rad/s^2
    return scale * rng.uniform(-1, 1, (3, count, 6))


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("seed", range(4))
def test_torques_are_those_of_pinocchio(tmp_path, name, seed):
    # Frames at random, so that no axis and no inertia is along anything.
    path = described_with_masses(tmp_path, name, seed, gauge=np.random.default_rng(seed))
    gravity = (1.5, -3.0, -9.0)
    for load in (None, LOAD):
        found = read_urdf(path)
        inertia = found.inertia if load is None else load.on(found.inertia, found.chain.end)
        arm = ArmDynamics(chain=found.chain, inertia=inertia, gravity=gravity)
        q, dq, ddq = motions(seed)
        model = model_of(path, load, gravity)
        data = model.createData()
        want = [pin.rnea(model, data, *row) for row in zip(q, dq, ddq, strict=True)]
        # Both in double precision: 1e-12 of the largest torque, and its digits lost on the way.
        slack = 1e-11 * np.abs(want).max()
        np.testing.assert_allclose(arm.torque(q, dq, ddq), want, rtol=0, atol=slack)


@pytest.mark.parametrize("name", NAMES)
def test_power_is_the_change_of_energy(tmp_path, name):
    """tau . dq = d/dt of kinetic and potential energy, these by the bodies' own velocities."""
    found = read_urdf(described_with_masses(tmp_path, name))
    arm = ArmDynamics(chain=found.chain, inertia=found.inertia, gravity=(0.0, 0.0, -9.81))
    a, b, c = np.random.default_rng(5).uniform(-1, 1, (3, 6))

    def q(t):
        return a + b * np.sin(2 * t)[:, None] + c * np.cos(3 * t)[:, None]

    def energy(t):
        h = 1e-6  # s: velocities good to 1e-10 of their third derivatives
        ahead, here, behind = (found.chain.frames(q(t + s * h))[:, 1:] for s in (1, 0, -1))
        total = np.zeros(len(t))
        for i in range(6):
            mass, centre = found.inertia.mass[i], np.append(found.inertia.centre[i], 1.0)
            v = ((ahead[:, i] - behind[:, i]) @ centre / (2 * h))[:, :3]
            R = here[:, i, :3, :3]
            W = R.transpose(0, 2, 1) @ (ahead[:, i, :3, :3] - behind[:, i, :3, :3]) / (2 * h)
            w = np.stack([W[:, 2, 1], W[:, 0, 2], W[:, 1, 0]], axis=1)
            total += mass * (v**2).sum(1) / 2 + mass * 9.81 * (here[:, i] @ centre)[:, 2]
            total += np.einsum("bi,ij,bj->b", w, found.inertia.tensor[i], w) / 2
        return total

    t, h = np.linspace(0, 3, 40), 1e-3
    dq = (2 * b * np.cos(2 * t)[:, None]) - 3 * c * np.sin(3 * t)[:, None]
    ddq = (-4 * b * np.sin(2 * t)[:, None]) - 9 * c * np.cos(3 * t)[:, None]
    power = (arm.torque(q(t), dq, ddq) * dq).sum(axis=1)
    change = (energy(t + h) - energy(t - h)) / (2 * h)
    # The difference over 1 ms is good to h^2 / 6 of the third derivative, about 1e-5 of the power.
    np.testing.assert_allclose(power, change, rtol=0, atol=1e-4 * np.abs(power).max())


def test_torques_do_not_know_which_way_time_goes(tmp_path):
    """What lets paths be searched from either end."""
    limit = arm_with_masses(tmp_path).with_load(LOAD).torque_limit()
    q, dq, ddq = motions(3)
    np.testing.assert_allclose(
        limit.dynamics.torque(q, dq, ddq), limit.dynamics.torque(q, -dq, ddq), atol=1e-8
    )


def test_shares_are_of_central_differences(tmp_path):
    limit = arm_with_masses(tmp_path).with_load(LOAD).torque_limit()
    q = np.cumsum(np.random.default_rng(2).uniform(-0.01, 0.01, (9, 6)), axis=0)
    dt = 0.02
    v, a = (q[2:] - q[:-2]) / (2 * dt), (q[2:] - 2 * q[1:-1] + q[:-2]) / dt**2
    want = limit.dynamics.torque(q[1:-1], v, a) / limit.bound
    np.testing.assert_allclose(limit.shares(q, np.full(8, dt)), want, rtol=1e-12)
    closed = np.vstack([q, q[:1]])
    there = limit.shares(closed, np.full(9, dt), periodic=True)
    v0, a0 = (q[1] - q[-1]) / (2 * dt), (q[1] - 2 * q[0] + q[-1]) / dt**2
    want = limit.dynamics.torque(closed[-1:], v0[None], a0[None]) / limit.bound
    np.testing.assert_allclose(there[-1:], want, rtol=1e-12)


def test_a_robot_that_hangs_carries_as_much_the_other_way(tmp_path):
    arm = arm_with_masses(tmp_path)
    q, still = motions(4)[0], np.zeros((200, 6))
    up, down = (
        arm.with_load(LOAD, gravity=(0, 0, g)).torque_limit().dynamics.torque(q, still, still)
        for g in (-9.81, 9.81)
    )
    np.testing.assert_allclose(up, -down, rtol=0, atol=1e-9)
    assert np.abs(up[:, 0]).max() < 1e-9 < np.abs(up[:, 1]).max()  # axis 1 is along gravity


def test_a_held_positioner_takes_gravity_along(tmp_path):
    """Seen from the part the base is turned; the torques are the arm's own."""
    limits = {"lower": -3.0, "upper": 3.0, "velocity": 1.0, "acceleration": 1.0, "step": 0.1}
    loaded = arm_with_masses(tmp_path, ratio="iontec_20_to_70kg").with_load(LOAD)
    turned = loaded.with_positioner((0.3, 1.0, 0.2), (1.0, 0.0, 0.5), **limits)
    with pytest.raises(InputError, match="the effect of positioner on them is not known"):
        turned.torque_limit()
    q, dq, ddq = motions(6)
    want = loaded.torque_limit().dynamics.torque(q, dq, ddq)
    held = turned.held(0.7).torque_limit()
    np.testing.assert_allclose(held.dynamics.torque(q, dq, ddq), want, rtol=0, atol=1e-8)


def test_efforts_and_jerks_are_read(tmp_path):
    assert arm_with_masses(tmp_path).limits.torque == pytest.approx(EFFORTS)
    inside = (
        '<limit lower="-3" upper="3" velocity="2" acceleration="5" deceleration="4" '
        'jerk="{}" effort="{}"/>'
    )
    path = described_with_masses(tmp_path, "ur_ur10e", inside=inside.format(80, 150))
    found = Robot.from_urdf(path)
    np.testing.assert_array_equal(found.limits.jerk, np.full(6, 80.0))
    np.testing.assert_array_equal(found.limits.torque, np.full(6, 150.0))
    np.testing.assert_array_equal(found.acceleration, np.full(6, 4.0))
    # Many descriptions write an effort of 0 that nobody means.
    for effort in ("0", "-1", "inf", "nan", "many"):
        path = described_with_masses(tmp_path, "ur_ur10e", inside=inside.format(80, effort))
        assert Robot.from_urdf(path).limits.torque is None
    path = described_with_masses(tmp_path, "ur_ur10e", inside=inside.format(-1, 1))
    with pytest.raises(InputError, match="joint 'j1' has the jerk limit -1 rad/s\\^3"):
        Robot.from_urdf(path)


def test_a_jerk_may_be_known_of_some_joints(tmp_path):
    path = described_with_masses(tmp_path, "ur_ur10e")
    path.write_text(path.read_text().replace('effort="900.0"', 'effort="900" jerk="50"'))
    jerk = Robot.from_urdf(path).limits.jerk
    np.testing.assert_array_equal(jerk, [np.inf, np.inf, np.inf, 50, np.inf, np.inf])


SPOILT = {
    "no inertial, nor has any link fixed to it": ("link_3", ""),
    "link 'link_3' has a shape but no <inertial>": (
        "link_3", '<visual><geometry><sphere radius="0.1"/></geometry></visual>',
    ),
    "link 'link_3': expected a positive mass, got 0 kg": (
        "link_3", inertial(0.0, (0, 0, 0), np.eye(3)),
    ),
    "link 'link_3': expected a positive mass, got -2 kg": (
        "link_3", inertial(-2.0, (0, 0, 0), np.eye(3)),
    ),
    "link 'link_5': its inertia is not positive definite (least principal moment -0.1 kg m^2)": (
        "link_5", inertial(2.0, (0, 0, 0), np.diag((0.2, 0.3, -0.1))),
    ),
    "link 'link_5': its inertia is not positive definite (least principal moment 0 kg m^2)": (
        "link_5", inertial(2.0, (0, 0, 0), np.zeros((3, 3))),
    ),
    "link 'link_2': its <inertial> lacks <mass value=...> or <inertia>": (
        "link_2", '<inertial><mass value="2"/></inertial>',
    ),
    "link 'tool0': expected value= as a finite number, got 'heavy'": (
        "tool0", inertial(2.0, (0, 0, 0), np.eye(3)).replace("2.0", "heavy"),
    ),
    "link 'link_4' <origin>: expected xyz= as 3 finite numbers, got '0 0'": (
        "link_4", '<inertial><origin xyz="0 0"/><mass value="1"/><inertia ixx="1" iyy="1" '
        'izz="1"/></inertial>',
    ),
}  # fmt: skip


@pytest.mark.parametrize("why", SPOILT)
def test_masses_that_are_missing_or_impossible_are_refused_where_torques_are_asked_for(
    tmp_path, why
):
    link, element = SPOILT[why]
    path = described_with_masses(tmp_path, "ur_ur10e", tool=link == "tool0")
    text = path.read_text()
    text = re.sub(rf'<link name="{link}">.*?</link>', f'<link name="{link}">{element}</link>', text)
    path.write_text(text)
    found = Robot.from_urdf(path)  # kinematics need no masses
    assert found.dynamics.inertia is None
    with pytest.raises(InputError, match="its torques cannot be computed: ") as fault:
        found.with_load(LOAD)
    said = why.replace("no inertial", "link 'link_3' has no <inertial>")
    assert said in str(fault.value)
    assert "\n" not in str(fault.value)


def test_a_frame_needs_no_mass_and_a_link_on_a_foreign_joint_is_refused(tmp_path):
    path = described_with_masses(tmp_path, "ur_ur10e", tool=False)
    assert Robot.from_urdf(path).dynamics.inertia is not None
    finger = (
        f'<link name="finger">{random_inertial(np.random.default_rng(1), 0.2)}</link>'
        '<joint name="grip" type="prismatic"><parent link="tool0"/><child link="finger"/></joint>'
    )
    path.write_text(path.read_text().replace("</robot>", f"{finger}</robot>"))
    found = Robot.from_urdf(path, tip="tool0")
    with pytest.raises(
        InputError, match="link 'finger' is attached to the chain by a joint outside it"
    ):
        found.with_load(LOAD)


def test_what_is_not_known_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"the masses of its links come only from a description"):
        robot("ur_ur10e").with_load(LOAD)
    path = described_with_masses(tmp_path, "ur_ur10e")
    path.write_text(re.sub(r' effort="[^"]*"', "", path.read_text()))
    unlimited = Robot.from_urdf(path)
    with pytest.raises(InputError, match=r"joint torques are not known; give them with .*torque="):
        unlimited.with_load(LOAD)
    with pytest.raises(InputError, match=r"torque: expected shape \(6\), got \(5,\)"):
        unlimited.with_limits(torque=np.ones(5))
    with pytest.raises(InputError, match="torque: must be positive"):
        unlimited.with_limits(torque=[1, 1, 1, 1, 1, 0])
    with pytest.raises(InputError, match="jerk: must be positive"):
        unlimited.with_limits(jerk=[1, 1, 1, 1, 1, -1])
    assert (
        unlimited.with_limits(torque=np.ones(6)).with_load(Load(mass=0.0)).dynamics.load.mass == 0
    )


def test_loads_are_checked():
    with pytest.raises(InputError, match="load centre: expected the centre of mass of 3 kg"):
        Load(mass=3.0)
    with pytest.raises(InputError, match="load mass: must not be negative"):
        Load(mass=-3.0, centre=(0, 0, 0))
    for tensor in (-np.eye(3), np.zeros((3, 3)), np.triu(np.ones((3, 3))) + 3 * np.eye(3)):
        with pytest.raises(InputError, match="load tensor: its inertia is not positive definite"):
            Load(mass=3.0, centre=(0, 0, 0), tensor=tensor)


def test_limits_of_another_number_of_joints_are_refused(tmp_path):
    found = read_urdf(described_with_masses(tmp_path, "ur_ur10e"))
    arm = ArmDynamics(chain=found.chain, inertia=found.inertia, gravity=(0, 0, -9.81))
    with pytest.raises(InputError, match=r"torque: expected shape \(6\), got \(7,\)"):
        TorqueLimit(bound=np.ones(7), dynamics=arm)
    five = Load(mass=0.0).on(found.inertia, found.chain.end)
    assert five is found.inertia
