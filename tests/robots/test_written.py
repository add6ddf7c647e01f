"""Robots as descriptions (URDF): read back they are the same, by this package and by pinocchio."""

from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin
import pytest
from tests.robots.test_five_axes import ARM
from tests.urdf.test_urdf import described

from commands import assert_refused, run
from conftest import ROOT
from kerfpath import InputError, Robot, robot
from kerfpath.robots import ExternalAxis, joint_identifiers, robot_ids

SLOW = {"lower": -1.5, "upper": 1.2, "velocity": 0.8, "acceleration": 1.9}
SAME = 1e-9
"""m, and entries of a rotation: what a chain of angles read from text may be off, generously."""


def whole(name):
    """A library robot without couplings, and with limits where none are known."""
    known = robot(name).with_limits(couplings=())
    if known.lower is None:
        known = known.with_limits(
            lower=-3.0 * np.ones(6), upper=3.0 * np.ones(6), velocity=np.ones(6)
        )
    return known


def read_back(tmp_path, known, **given):
    path = tmp_path / "robot.urdf"
    path.write_text(known.to_urdf())
    return Robot.from_urdf(path, **given)


def random_joints(r, count=40, seed=5):
    rng = np.random.default_rng(seed)
    low, high = (np.where(r.endless, end, of) for end, of in ((-np.pi, r.lower), (np.pi, r.upper)))
    return rng.uniform(low, high, (count, r.joints))


def as_pinocchio_has_it(r, q):
    """Flange poses (B, 4, 4) in the part's frame, by the joints' names."""
    model = pin.buildModelFromXML(r.to_urdf())
    data, poses = model.createData(), []
    part = model.getFrameId("part") if model.existFrame("part") else 0
    for row in q:
        at = pin.neutral(model)
        for name, value in zip(joint_identifiers(r), row, strict=True):
            joint = model.joints[model.getJointId(name)]
            turn = joint.nq == 2
            at[joint.idx_q : joint.idx_q + joint.nq] = (
                (np.cos(value), np.sin(value)) if turn else value
            )
        pin.framesForwardKinematics(model, data, at)
        flange = data.oMf[model.getFrameId("tool0")]
        poses.append(data.oMf[part].actInv(flange).homogeneous)
    return np.array(poses)


@pytest.mark.parametrize("name", robot_ids())
def test_a_robot_of_the_library_is_the_same_again(tmp_path, name):
    known = whole(name)
    again = read_back(tmp_path, known)
    q = random_joints(known)
    T = known.forward(q)
    np.testing.assert_allclose(again.forward(q), T, atol=SAME)
    np.testing.assert_allclose(as_pinocchio_has_it(known, q), T, atol=SAME)
    assert (again.id, again.kinematics) == (name, known.kinematics)
    np.testing.assert_array_equal(again.endless, known.endless)
    for limit in ("lower", "upper"):  # those of endless joints do not apply
        ours, theirs = (getattr(r, limit)[~r.endless] for r in (known, again))
        np.testing.assert_array_equal(ours, theirs)
    np.testing.assert_array_equal(again.velocity, known.velocity)
    if known.acceleration is None:
        assert again.acceleration is None
    else:
        np.testing.assert_array_equal(again.acceleration, known.acceleration)


@pytest.mark.parametrize("name", ["abb_irb4600_60_205", "ur_ur10e"])
def test_a_described_robot_is_written_from_its_own_frames(tmp_path, name):
    gauge = np.random.default_rng(8)
    known = Robot.from_urdf(described(tmp_path, whole(name), gauge=gauge))
    again = read_back(tmp_path, known)
    np.testing.assert_allclose(again.chain.origins, known.chain.origins, atol=SAME)
    np.testing.assert_array_equal(again.chain.axes, known.chain.axes)
    q = random_joints(known)
    np.testing.assert_allclose(again.forward(q), known.forward(q), atol=SAME)


def test_a_five_axis_arm_is_written_though_only_others_read_it(tmp_path):
    q = random_joints(ARM)
    np.testing.assert_allclose(as_pinocchio_has_it(ARM, q), ARM.forward(q), atol=SAME)
    with pytest.raises(InputError, match="expected 6 or 7 joints"):
        read_back(tmp_path, ARM)


def test_jerks_and_torques_are_written_where_they_are_known(tmp_path):
    jerk = [1e3, 2e3, np.inf, 4e3, 5e3, 6e3]
    known = robot("abb_irb4600_60_205").with_limits(jerk=jerk, torque=100.0 + np.arange(6))
    again = read_back(tmp_path, known)
    np.testing.assert_array_equal(again.limits.jerk, jerk)
    np.testing.assert_array_equal(again.limits.torque, known.limits.torque)
    assert read_back(tmp_path, robot("abb_irb4600_60_205")).limits.torque is None


def placed(arm):
    """An arm that slides, turns and slides again; its part on a turn-tilt table beside it."""
    gantry = arm.on_rail([0.0, 1.0, 0.2], name="long way", **SLOW)
    column = ExternalAxis(
        name="column", kind="rotary", carries="robot", axis=[0.1, 0, 1], point=[-0.4, 0.3, 0]
    )
    return gantry.with_external(column, **SLOW).on_rail([0, 0, 1], name="lift", **SLOW)


def on_table(arm):
    tilted = arm.with_positioner([1, 0.1, 0], [1.5, 0.2, 0.6], name="tilt", **SLOW)
    turned = tilted.with_positioner([0, 0, 1], [1.4, 0.1, 0.7], name="table", endless=True, **SLOW)
    return turned.on_rail([0, 1, 0], **SLOW)


@pytest.mark.parametrize("build", [placed, on_table])
def test_external_axes_are_joints_of_the_description(tmp_path, arm, build):
    known = build(arm)
    part = {"part": "part"} if build is on_table else {}
    again = read_back(tmp_path, known, tip="tool0", mount="base_link", **part)
    q = random_joints(known)
    T = known.forward(q)
    np.testing.assert_allclose(as_pinocchio_has_it(known, q), T, atol=SAME)
    # Read back, the axes of the robot come first.
    order = [joint_identifiers(known).index(name) for name in joint_identifiers(again)]
    np.testing.assert_allclose(again.forward(q[:, order]), T, atol=SAME)
    np.testing.assert_array_equal(again.endless, known.endless[order])
    for limit in ("lower", "upper", "velocity", "acceleration"):
        ours, theirs = getattr(known, limit)[order], getattr(again, limit)
        bounded = ~again.endless if limit in ("lower", "upper") else slice(None)
        np.testing.assert_array_equal(theirs[bounded], ours[bounded])


def test_names_of_joints_are_identifiers_and_none_is_there_twice(arm):
    known = arm
    for name in ("joint_1", "base", "<a & b>"):
        known = known.on_rail([0, 1, 0], name=name, **SLOW)
    root = ElementTree.fromstring(known.to_urdf())
    joints = [joint.get("name") for joint in root.findall("joint")]
    links = [link.get("name") for link in root.findall("link")]
    assert joints[:3] == ["joint_1_2", "base", "a_b"]
    assert len(set(joints)) == len(joints) == len(links) - 1
    assert len(set(links)) == len(links)


def test_what_a_urdf_cannot_say_is_refused_in_one_line():
    coupled = [name for name in robot_ids() if robot(name).couplings]
    page = (ROOT / "docs" / "interoperability.md").read_text(encoding="utf-8")
    assert f"{len(coupled)} of the {len(robot_ids())} in the library" in page
    for name in coupled:
        with pytest.raises(InputError, match=r"joint 2 \+ joint 3, but a URDF"):
            robot(name).to_urdf()
    with pytest.raises(InputError, match=r"joint limits are not known .*with_limits\(lower="):
        robot("kuka_kr120_r2500_pro").to_urdf()
    unknown = robot("abb_irb4600_60_205")
    unknown = replace(unknown, limits=replace(unknown.limits, velocity=None))
    with pytest.raises(InputError, match="joint velocities are not known"):
        unknown.to_urdf()


def test_the_command_writes_a_file_or_nothing(tmp_path):
    path = tmp_path / "arm.urdf"
    assert "wrote" in run("robots", "kuka_lbr_iiwa14_r820", "--urdf", str(path)).stdout
    assert path.read_text() == robot("kuka_lbr_iiwa14_r820").to_urdf()
    for arguments, said in (
        (("fanuc_m10ia", "--urdf", str(tmp_path / "x.urdf")), "only limits of single joints"),
        (("--urdf", str(tmp_path / "x.urdf")), "expected the id of a robot, got none"),
        (("kuka_dkp400", "--urdf", str(tmp_path / "x.urdf")), "got kuka_dkp400"),
        (("kuka_kr60_ha", "--urdf", str(tmp_path / "no" / "x.urdf")), "cannot write"),
    ):
        assert_refused(run("robots", *arguments), said)
    assert [file.name for file in tmp_path.iterdir()] == ["arm.urdf"]


def test_a_robot_of_seven_joints_is_shown_with_all_of_them():
    shown = run("robots", "kuka_lbr_iiwa14_r820").stdout
    assert "joint 7" in shown
    assert "-175" in shown
