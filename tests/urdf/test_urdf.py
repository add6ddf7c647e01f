"""Robot descriptions: every library robot through a URDF and back, and what must be refused."""

import re
import warnings
from time import monotonic

import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial.transform import Rotation
from tests.robots.test_robot import joint_frames

from kerfpath import InputError, Robot, audit, plan, robot
from kerfpath.auditor import chain_of, checks
from kerfpath.job import read_plan_file
from kerfpath.job.plan_file import plan_document, plan_entry, plan_text
from kerfpath.robots import robot_ids
from kerfpath.urdf import read_urdf

LIMIT = '<limit lower="-3" upper="3" velocity="2" effort="1"/>'


def origin(T):
    rpy = pin.rpy.matrixToRpy(T[:3, :3])
    words = [" ".join(repr(float(v)) for v in values) for values in (T[:3, 3], rpy)]
    return f'<origin xyz="{words[0]}" rpy="{words[1]}"/>'


def joint(name, parent, child, T, axis=(0, 0, 1), kind="revolute", inside=LIMIT):
    axis = " ".join(repr(float(a)) for a in axis)
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'{origin(T)}<axis xyz="{axis}"/>{inside}</joint>'
    )


def urdf(tmp_path, joints, links=None, extra=""):
    names = links or ["base", *(f"link_{i}" for i in range(1, 7)), "tool0"]
    body = "".join(f'<link name="{name}"/>' for name in names if name)
    path = tmp_path / "arm.urdf"
    path.write_text(
        f'<?xml version="1.0"?><robot name="arm">{body}{"".join(joints)}{extra}</robot>'
    )
    return path


def frames_of(r):
    """Joint origins (6, 4, 4), axes (6, 3) and flange (4, 4) of a library robot."""
    axes, poses, flange = joint_frames(r)
    origins = [
        (pose * pin.SE3(pin.exp3(-r.offset[i] * axis), np.zeros(3))).homogeneous
        for i, (axis, pose) in enumerate(zip(axes, poses, strict=True))
    ]
    return np.array(origins), r.sign[:, None] * np.array(axes), flange.homogeneous


def described(tmp_path, r, *, gauge=None, inside=LIMIT):
    """Write a library robot as a URDF; with a generator, in joint frames chosen at random."""
    origins, axes, flange = frames_of(r)
    n = r.joints
    if gauge is not None:
        # A joint frame may be turned at will, and shifted along its axis.
        for i in range(n):
            G = np.eye(4)
            G[:3, :3] = Rotation.random(rng=gauge).as_matrix()
            G[:3, 3] = axes[i] * gauge.uniform(-1, 1)
            origins[i] = origins[i] @ G
            axes[i] = G[:3, :3].T @ axes[i]
            after = np.linalg.inv(G)
            if i < n - 1:
                origins[i + 1] = after @ origins[i + 1]
            else:
                flange = after @ flange
        foot, end = np.eye(4), np.eye(4)
        foot[:3, :3], end[:3, :3] = Rotation.random(2, rng=gauge).as_matrix()
        foot[:3, 3], end[:3, 3] = gauge.uniform(-1, 1, (2, 3))
        origins[0], flange = foot @ origins[0], flange @ end
    names = ["base", *(f"link_{i}" for i in range(1, n + 1)), "tool0"]
    joints = [
        joint(f"j{i + 1}", names[i], names[i + 1], origins[i], axes[i], inside=inside)
        for i in range(n)
    ]
    end = joint("end", f"link_{n}", "tool0", flange, kind="fixed", inside="")
    return urdf(tmp_path, [*joints, end], names)


@pytest.mark.parametrize("name", robot_ids())
def test_a_library_robot_comes_back_from_its_description(tmp_path, name):
    r = robot(name)
    back = Robot.from_urdf(described(tmp_path, r))
    assert back.kinematics == r.kinematics
    # The same lengths, and the model stands and ends where the library's does.
    for key, value in r.geometry.items():
        assert back.geometry[key] == pytest.approx(value, abs=1e-9)
    np.testing.assert_array_equal(back.T_base_foot, np.eye(4))
    np.testing.assert_array_equal(back.T_end_flange, np.eye(4))
    q = np.random.default_rng(30).uniform(-np.pi, np.pi, (50, r.joints))
    np.testing.assert_allclose(back.forward(q), r.forward(q), atol=1e-9)
    np.testing.assert_allclose(chain_of(back).forward(q), r.forward(q), atol=1e-9)
    given = r.arm.given_of(q)
    assert len(back.inverse(r.forward(q), given=given, within_limits=False)) == len(
        r.inverse(r.forward(q), given=given, within_limits=False)
    )


@pytest.mark.parametrize("name", ["staubli_tx60", "abb_irb2400_155", "fanuc_m10ia", "ur_ur10e"])
@pytest.mark.parametrize("seed", range(5))
def test_the_joint_frames_of_a_description_do_not_matter(tmp_path, name, seed):
    r = Robot.from_urdf(described(tmp_path, robot(name), gauge=np.random.default_rng(seed)))
    assert r.kinematics == robot(name).kinematics
    model = pin.buildModelFromUrdf(str(tmp_path / "arm.urdf"))
    data = model.createData()
    q = np.random.default_rng(31).uniform(-np.pi, np.pi, (20, 6))
    for row, T in zip(q, r.forward(q), strict=True):
        pin.framesForwardKinematics(model, data, row)
        want = data.oMf[model.getFrameId("tool0")].homogeneous
        np.testing.assert_allclose(T, want, atol=1e-9)
    found = r.inverse(r.forward(q), within_limits=False)
    np.testing.assert_allclose(r.forward(found.q), r.forward(q)[found.pose], atol=1e-9)


def test_limits_are_read_and_may_be_given(tmp_path):
    r = Robot.from_urdf(described(tmp_path, robot("staubli_tx60")))
    np.testing.assert_array_equal(r.lower, [-3.0] * 6)
    np.testing.assert_array_equal(r.velocity, [2.0] * 6)
    assert not r.endless.any()
    given = {"lower": [-1] * 6, "velocity": [5] * 6, "acceleration": [7] * 6}
    r = Robot.from_urdf(tmp_path / "arm.urdf", **given)
    np.testing.assert_array_equal(r.lower, [-1.0] * 6)
    np.testing.assert_array_equal(r.upper, [3.0] * 6)
    np.testing.assert_array_equal(r.speed_limits(), [[5.0] * 6, [7.0] * 6])


def test_accelerations_of_every_joint_are_read_the_smaller_of_both_ways(tmp_path):
    both = LIMIT.replace("/>", ' acceleration="9" deceleration="8" jerk="100"/>')
    path = described(tmp_path, robot("staubli_tx60"), inside=both)
    r = Robot.from_urdf(path)
    np.testing.assert_array_equal(r.acceleration, [8.0] * 6)
    assert r.acceleration_source == "URDF arm.urdf"
    given = Robot.from_urdf(path, acceleration=[7] * 6)
    np.testing.assert_array_equal(given.acceleration, [7.0] * 6)
    assert given.acceleration_source == "given by the user"
    # Of five joints they are no limits of an arm of six.
    path.write_text(path.read_text().replace(' acceleration="9" deceleration="8"', "", 1))
    assert Robot.from_urdf(path).acceleration is None
    still = path.read_text().replace('acceleration="9"', 'acceleration="0"', 1)
    path.write_text(still)
    with pytest.raises(InputError, match="the acceleration limit 0 rad/s"):
        Robot.from_urdf(path)


@pytest.mark.parametrize(
    ("limit", "message"),
    [
        ("", "joint 'j1' has no position limits; give lower and upper for all 6 joints"),
        ('<limit velocity="1"/>', "joint 'j1' has no position limits"),
        (
            '<limit lower="0" upper="0" velocity="1"/>',
            "has the lower limit 0 rad and the upper limit 0 rad",
        ),
        ('<limit lower="-3" upper="3"/>', "joint 'j1' has no velocity limit; give velocity"),
        ('<limit lower="-3" upper="3" velocity="0"/>', "the velocity limit 0 rad/s, so it"),
    ],
)
def test_limits_that_are_missing_or_zero_are_asked_for(tmp_path, limit, message):
    path = described(tmp_path, robot("staubli_tx60"), inside=limit)
    with pytest.raises(InputError, match=message):
        Robot.from_urdf(path)
    r = Robot.from_urdf(path, lower=[-1] * 6, upper=[1] * 6, velocity=[2] * 6)
    np.testing.assert_array_equal(r.upper, [1.0] * 6)


def test_a_continuous_joint_is_endless_and_a_fixed_one_is_merged(tmp_path):
    r = robot("staubli_tx60")
    text = described(tmp_path, r).read_text()
    last = text.index('name="j6"')
    text = text[:last] + text[last:].replace('type="revolute"', 'type="continuous"', 1)
    # Axis 4 of the wrist behind a fixed joint that shifts and turns.
    text = text.replace('<parent link="link_3"/>', '<parent link="mount"/>')
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = Rotation.from_rotvec([0.1, 0.2, 0.3]).as_matrix(), [0.1, 0.0, -0.1]
    fixed = joint("m", "link_3", "mount", T, kind="fixed", inside="")
    origins, _, _ = frames_of(r)
    text = text.replace(origin(origins[3]), origin(np.linalg.inv(T) @ origins[3]), 1)
    path = tmp_path / "arm.urdf"
    path.write_text(text.replace("</robot>", f'<link name="mount"/>{fixed}</robot>'))
    back = Robot.from_urdf(path)
    assert back.endless.tolist() == [False] * 5 + [True]
    q = np.random.default_rng(32).uniform(-3, 3, (20, 6))
    assert [j.name for j in read_urdf(path).joints] == [f"j{i}" for i in range(1, 7)]
    np.testing.assert_allclose(back.forward(q), r.forward(q), atol=1e-9)


def rounded(path, digits):
    """Write the angles of a description with so many digits after the point."""

    def few(found):
        turn = Rotation.from_euler("xyz", [float(word) for word in found[1].split()])
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # where roll and yaw are one, all of it is roll
            words = [f"{angle:.{digits}f}" for angle in turn.as_euler("xyz")]
        return f'rpy="{" ".join(words)}"'

    path.write_text(re.sub(r'rpy="([^"]*)"', few, path.read_text()))
    return path


@pytest.mark.parametrize("digits", [2, 3, 4])
@pytest.mark.parametrize("name", ["staubli_tx60", "abb_irb2400_155", "fanuc_m10ia", "ur_ur10e"])
def test_angles_of_few_digits_are_taken_as_meant_only_when_asked(tmp_path, name, digits):
    # Joint frames turned by right angles, as descriptions have them.
    r, draw = robot(name), np.random.default_rng(digits)
    origins, axes, flange = frames_of(r)
    links, joints = ["base", *(f"link_{i}" for i in range(1, 7)), "tool0"], []
    back = np.eye(4)
    for i in range(6):
        turn = np.eye(4)
        quarters = draw.integers(0, 4, 3) * np.pi / 2
        turn[:3, :3] = Rotation.from_euler("xyz", quarters).as_matrix()
        here, back = back @ origins[i] @ turn, np.linalg.inv(turn)
        joints.append(joint(f"j{i}", links[i], links[i + 1], here, back[:3, :3] @ axes[i]))
    end = joint("end", "link_6", "tool0", back @ flange, kind="fixed", inside="")
    path = rounded(urdf(tmp_path, [*joints, end]), digits)
    begun = monotonic()
    with pytest.raises(InputError) as asked:
        Robot.from_urdf(path)
    assert monotonic() - begun < 10  # not the minutes of a solver
    said = re.search(
        r"\((\S+) rad\) rounds them, .* up to (\S+) mm and (\S+) deg; a snap of 0 keeps",
        str(asked.value),
    )
    snap, off, turned = (float(word) for word in said.groups())
    meant = Robot.from_urdf(path, snap=snap)
    assert meant.kinematics == r.kinematics
    q = draw.uniform(-3, 3, (200, 6))
    np.testing.assert_allclose(meant.forward(q), r.forward(q), atol=1e-9)
    # The model is the description within what was said.
    kept = Robot.from_urdf(path, snap=0)
    assert kept.kinematics == "general"
    apart = kept.forward(q)[:, :3, 3] - meant.forward(q)[:, :3, 3]
    assert 1e3 * np.linalg.norm(apart, axis=1).max() <= 1.1 * off + 1e-9
    between = Rotation.from_matrix(
        np.swapaxes(kept.forward(q)[:, :3, :3], 1, 2) @ meant.forward(q)[:, :3, :3]
    )
    assert np.degrees(between.magnitude().max()) <= 1.1 * turned + 1e-9


def test_a_described_robot_is_planned_and_audited(tmp_path, circle, tool, placement):
    r = Robot.from_urdf(
        described(tmp_path, robot("abb_irb4600_60_205"), gauge=np.random.default_rng(7)),
        acceleration=np.radians([320, 270, 420, 1300, 1400, 2000]),
        endless=[0, 0, 0, 1, 0, 1],
    )
    back = np.linalg.inv(r.T_end_flange) @ tool
    made = plan(
        circle,
        r,
        tool=back,
        placement=r.T_base_foot @ placement,
        speed=0.05,
        gamma_step=np.radians(5),
        method="exact",
    )
    assert audit(made) == []
    # The plan file keeps what the audit needs: where the model stands, and the chain.
    entry = plan_entry(made, made.name, checks(made))
    text = plan_text(plan_document(r, made.T_flange_tip, made.T_base_part, [entry], {}))
    (tmp_path / "plan.json").write_text(text)
    (read,) = read_plan_file(tmp_path / "plan.json").plans
    np.testing.assert_array_equal(read.robot.chain.origins, r.chain.origins)
    np.testing.assert_array_equal(read.robot.forward(made.q), r.forward(made.q))
    assert audit(read) == []


def test_bodies_are_where_the_links_are(tmp_path):
    (tmp_path / "my_robot" / "meshes").mkdir(parents=True)
    (tmp_path / "my_robot" / "meshes" / "arm.stl").write_bytes(b"solid")
    path = described(tmp_path, robot("staubli_tx60"))
    shapes = {
        "link_1": '<mesh filename="package://my_robot/meshes/arm.stl" scale="0.001 0.001 0.001"/>',
        "link_2": '<cylinder radius="0.1" length="0.5"/>',
        "link_3": '<box size="0.1 0.2 0.3"/>',
        "tool0": '<sphere radius="0.05"/>',
    }
    text = path.read_text()
    for link, shape in shapes.items():
        held = f'<collision><origin xyz="0 0 0.25"/><geometry>{shape}</geometry></collision>'
        text = text.replace(f'<link name="{link}"/>', f'<link name="{link}">{held}</link>')
    path.write_text(text)
    bodies = {b.link: b for b in Robot.from_urdf(path).bodies}
    assert {b.link: (b.joint, b.kind) for b in bodies.values()} == {
        "link_1": (1, "mesh"),
        "link_2": (2, "cylinder"),
        "link_3": (3, "box"),
        "tool0": (6, "sphere"),
    }
    assert bodies["link_1"].path == tmp_path / "my_robot" / "meshes" / "arm.stl"
    np.testing.assert_array_equal(bodies["link_2"].size, [0.1, 0.5])
    c4 = robot("staubli_tx60").geometry["c4"]
    np.testing.assert_allclose(bodies["tool0"].pose[:3, 3], [0, 0, c4 + 0.25], atol=1e-12)
    (tmp_path / "my_robot" / "meshes" / "arm.stl").unlink()
    with pytest.raises(InputError, match=r"link 'link_1': the mesh .* was not found; .*packages"):
        Robot.from_urdf(path)
    assert Robot.from_urdf(path, meshes=False).bodies == ()


def moved(path, old, new, count=1):
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, count))


def put(shape):
    held = f'<link name="link_2"><collision><geometry>{shape}</geometry></collision></link>'
    return lambda p: moved(p, '<link name="link_2"/>', held)


def swap(old, new):
    return lambda p: moved(p, old, new)


def add(text):
    return lambda p: moved(p, "</robot>", text + "</robot>")


def whole(text):
    return lambda p: p.write_text(text)


BOMB = '<!DOCTYPE a [<!ENTITY b "ha"><!ENTITY c "&b;&b;">]><robot>&c;</robot>'
XACRO = '<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:a/></robot>'
TWICE = '<link name="link_2"/><link name="link_2"/>'

BAD = {
    "no file": (lambda p: p.unlink(), "cannot be read"),
    "not XML": (whole("hello"), "expected an XML robot description"),
    "cut short": (lambda p: p.write_text(p.read_text()[:300]), "expected an XML robot description"),
    "another format": (whole("<sdf/>"), "first element is <robot>, got <sdf>"),
    "a bomb": (whole(BOMB), "a document type .* is refused"),
    "xacro": (whole(XACRO), "expand them first"),
    "mimic": (swap(LIMIT, LIMIT + '<mimic joint="j2"/>'), "'j1' .* mimics 'j2'"),
    "sliding": (swap('"revolute"', '"prismatic"'), "is prismatic; an arm must have revolute"),
    "unknown type": (swap('"revolute"', '"screw"'), "expected a type of .*, got 'screw'"),
    "no axis": (
        swap('<axis xyz="0.0 0.0 1.0"/>', '<axis xyz="0 0 0"/>'),
        "0 0 0 and has no direction",
    ),
    "words": (swap('velocity="2"', 'velocity="fast"'), "velocity= as a finite number, got 'fast'"),
    "NaN": (swap('lower="-3"', 'lower="nan"'), "lower= as a finite number"),
    "two numbers": (swap('xyz="0.0 0.0 1.0"', 'xyz="0 1"'), "as 3 finite numbers"),
    "reversed": (swap('lower="-3"', 'lower="4"'), "joint 'j1' has the lower limit 4 rad"),
    "a loop": (add(joint("back", "link_6", "base", np.eye(4))), "form a closed loop"),
    "two parents": (
        add(joint("back", "base", "link_4", np.eye(4))),
        "link 'link_4' is the child of two joints, 'j4' and 'back': a closed loop",
    ),
    "no such link": (swap('<link name="link_2"/>', ""), "the link 'link_2', which is missing"),
    "a link twice": (swap('<link name="link_2"/>', TWICE), "two links are called 'link_2'"),
    "a joint twice": (swap('name="j2"', 'name="j1"'), "two joints are called 'j1'"),
    "no child": (swap('<child link="link_1"/>', ""), "has no <child link"),
    "two tips": (
        add(joint("x", "base", "y", np.eye(4)) + '<link name="y"/>'),
        "2 links can be the tip .tool0, y.; say which with tip=",
    ),
    "an odd shape": (put("<cone/>"), "expected one of mesh, box, cylinder, sphere, got <cone>"),
    "a flat box": (put('<box size="1 0 1"/>'), "a box with positive size"),
    "a mesh of a long name": (put(f'<mesh filename="{"x" * 5000}"/>'), "was not found"),
    "a box of no thickness": (put('<box size="1 5e-324 1"/>'), "of 1e-06 m or more"),
    "a mesh elsewhere": (put('<mesh filename="http://a/b.stl"/>'), "is not a local file"),
    "a mesh without a name": (put("<mesh/>"), "the mesh '' was not found"),
}


@pytest.mark.parametrize("fault", BAD)
def test_a_bad_description_is_refused_in_one_clear_line(tmp_path, fault):
    path = described(tmp_path, robot("staubli_tx60"))
    spoil, message = BAD[fault]
    spoil(path)
    with pytest.raises(InputError, match=message) as caught:
        Robot.from_urdf(path)
    assert "arm" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_links_and_chains_that_do_not_fit_are_refused(tmp_path):
    path = described(tmp_path, robot("staubli_tx60"))
    with pytest.raises(InputError, match="tip: there is no link 'gripper'; there are base, link_1"):
        Robot.from_urdf(path, tip="gripper")
    with pytest.raises(
        InputError, match="no chain of joints leads from base 'link_3' to tip 'link_1'"
    ):
        Robot.from_urdf(path, base="link_3", tip="link_1")
    with pytest.raises(InputError, match="no joint moves between 'link_6' and 'tool0'"):
        Robot.from_urdf(path, base="link_6")
    with pytest.raises(InputError, match="expected 6 or 7 joints between base and tip, got 5"):
        Robot.from_urdf(path, tip="link_5")


def test_a_link_without_length_is_refused(tmp_path):
    origins, axes, flange = frames_of(robot("staubli_tx60"))
    origins[2, :3, 3] = 0
    names = ["base", *(f"link_{i}" for i in range(1, 7)), "tool0"]
    joints = [joint(f"j{i + 1}", names[i], names[i + 1], origins[i], axes[i]) for i in range(6)]
    joints.append(joint("end", "link_6", "tool0", flange, kind="fixed", inside=""))
    with pytest.raises(InputError, match="'j2' and 'j3' turn about the same line: link 'link_2'"):
        Robot.from_urdf(urdf(tmp_path, joints))
