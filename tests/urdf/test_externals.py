"""Descriptions with rails, gantries and positioners: their axes, against pinocchio."""

import re

import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial.transform import Rotation
from tests.urdf.test_urdf import frames_of, joint, urdf

from kerfpath import Contour, InputError, Robot, audit, plan, robot
from kerfpath.auditor import chain_of
from kerfpath.cell import cell_of, link_bodies

ARM = robot("abb_irb4600_60_205")
FAST = '<limit lower="-1.2" upper="1.4" velocity="1.5" acceleration="3" effort="1"/>'
FREE = '<limit velocity="2" acceleration="4" effort="1"/>'
ARM_LIMIT = '<limit lower="-3" upper="3" velocity="3" acceleration="9" effort="1"/>'
CUBE = '<collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision>'


def anywhere(rng):
    """A pose at random."""
    T = np.eye(4)
    T[:3, :3] = Rotation.random(rng=rng).as_matrix()
    T[:3, 3] = rng.uniform(-1, 1, 3)
    return T


def direction(rng):
    v = rng.normal(size=3)
    return v / np.linalg.norm(v)


def branch(rng, start, joints):
    """Joints (name, kind, limit) one on the other in frames at random, and the last link."""
    found, link = [], start
    for name, kind, limit in joints:
        child = f"{name}_link"
        found.append(joint(name, link, child, anywhere(rng), direction(rng), kind, limit))
        link = child
    return found, link


def arm_on(link, T=None):
    """The library's arm as joints j1 to j6, standing on a link at T."""
    origins, axes, flange = frames_of(ARM)
    names = [link, *(f"link_{i}" for i in range(1, 7))]
    origins[0] = (np.eye(4) if T is None else T) @ origins[0]
    joints = [
        joint(f"j{i + 1}", names[i], names[i + 1], origins[i], axes[i], inside=ARM_LIMIT)
        for i in range(6)
    ]
    return [*joints, joint("end", "link_6", "tool0", flange, kind="fixed", inside="")]


def written(tmp_path, before=(), under=(), seed=3, shapes=False, extra=""):
    """A cell: joints before the arm, joints under the part, on one link "world"."""
    rng = np.random.default_rng(seed)
    carriers, carriage = branch(rng, "world", before)
    positioner, table = branch(rng, "world", under)
    joints = [*carriers, *positioner, *arm_on(carriage, anywhere(rng))]
    path = urdf(tmp_path, joints, [None], extra)
    links = sorted(set(re.findall(r'link="(\w+)"', path.read_text())))
    inside = CUBE if shapes else ""
    body = "".join(f'<link name="{name}">{inside}</link>' for name in links)
    path.write_text(path.read_text().replace('<robot name="arm">', f'<robot name="arm">{body}'))
    return path, table


RAIL = ("rail", "prismatic", FAST)
CASES = [
    ((RAIL,), (), {}),
    ((RAIL, ("lift", "prismatic", FAST)), (), {}),
    ((RAIL, ("column", "revolute", FAST)), (), {"mount": "column_link"}),
    ((("turret", "continuous", FREE), RAIL), (), {}),
    ((), (("tilt", "revolute", FAST), ("table", "continuous", FREE)), {}),
    ((RAIL,), (("tilt", "revolute", FAST), ("table", "continuous", FREE)), {}),
    ((RAIL,), (("shuttle", "prismatic", FAST),), {}),
]


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize(("before", "under", "keys"), CASES)
def test_external_axes_of_a_description_move_as_it_does(before, under, keys, seed, tmp_path):
    path, table = written(tmp_path, before, under, seed)
    keys = keys | {"tip": "tool0"} | ({"part": table} if under else {})
    found = Robot.from_urdf(path, **keys)
    assert found.kinematics == "opw"
    assert [axis.name for axis in found.externals] == [name for name, *_ in (*before, *under)]
    for axis, (_, kind, _), carries in zip(
        found.externals,
        (*before, *under),
        ["robot"] * len(before) + ["part"] * len(under),
        strict=True,
    ):
        assert (axis.kind, axis.carries) == (
            "linear" if kind == "prismatic" else "rotary",
            carries,
        )
    free = [kind == "continuous" for _, kind, _ in (*before, *under)]
    np.testing.assert_array_equal(found.endless[6:], free)
    np.testing.assert_array_equal(found.lower[6:], np.where(free, -np.pi, -1.2))
    np.testing.assert_array_equal(found.velocity[6:], np.where(free, 2.0, 1.5))
    np.testing.assert_array_equal(found.acceleration[6:], np.where(free, 4.0, 3.0))
    model = pin.buildModelFromUrdf(str(path))
    data = model.createData()

    def frames(q):
        """Tip and part at joints by their names."""
        at = pin.neutral(model)
        for name, value in q.items():
            i = model.joints[model.getJointId(name)].idx_q
            if model.joints[model.getJointId(name)].nq == 2:
                at[i : i + 2] = np.cos(value), np.sin(value)
            else:
                at[i] = value
        pin.framesForwardKinematics(model, data, at)
        return [data.oMf[model.getFrameId(link)].homogeneous.copy() for link in ("tool0", table)]

    names = [*(f"j{i}" for i in range(1, 7)), *(axis.name for axis in found.externals)]
    q = np.random.default_rng(seed).uniform(-1, 1, (20, len(names)))
    _, part_at_zero = frames({})
    want = []
    for row in q:
        tip, part = frames(dict(zip(names, row, strict=True)))
        want.append(part_at_zero @ np.linalg.inv(part) @ tip)
    np.testing.assert_allclose(found.forward(q), want, atol=1e-9)  # as exact as the arm is
    np.testing.assert_allclose(chain_of(found).forward(q), want, atol=1e-9)


def test_limits_of_a_description_are_completed_and_replaced(tmp_path):
    bare = '<limit lower="0" upper="4" velocity="1.5" effort="1"/>'
    path, _ = written(tmp_path, [("rail", "prismatic", bare)])
    with pytest.raises(InputError, match=r"rail: its acceleration is not known from arm.urdf; "):
        Robot.from_urdf(path)
    given = {"acceleration": 2.0, "upper": 3.0, "name": "track"}
    found = Robot.from_urdf(path, externals={"rail": given})
    assert found.externals[0].name == "track"
    assert (found.lower[6], found.upper[6]) == (0.0, 3.0)
    assert (found.velocity[6], found.acceleration[6]) == (1.5, 2.0)
    with pytest.raises(InputError, match="track: it turns without end, but got upper=; remove it"):
        Robot.from_urdf(path, externals={"rail": given | {"endless": True}})
    alone = Robot.from_urdf(path, externals=None)
    assert alone.joints == 6
    q = np.full(7, 0.3)
    q[6] = 0.0
    np.testing.assert_allclose(found.forward(q), alone.forward(q[:6]), atol=1e-12)


LIMITS = [
    (None, "its lower is not known"),
    ('<limit lower="0" upper="4" effort="1"/>', "its velocity is not known"),
    ('<limit lower="0" upper="4" velocity="0" acceleration="1" effort="1"/>', "velocity is 0 m/s"),
    (
        '<limit lower="0" upper="4" velocity="1" acceleration="0" effort="1"/>',
        r"acceleration is 0 m/s\^2 in arm.urdf, so it cannot move",
    ),
    ('<limit lower="0" upper="0" velocity="1" acceleration="1" effort="1"/>', "are both 0 m"),
    ('<limit lower="2" upper="1" velocity="1" acceleration="1" effort="1"/>', "are reversed"),
]


@pytest.mark.parametrize(("limit", "message"), LIMITS)
def test_an_axis_that_cannot_move_is_refused(limit, message, tmp_path):
    path, _ = written(tmp_path, [("rail", "prismatic", limit or "")])
    with pytest.raises(InputError, match=f"^[^\n]*rail: [^\n]*{message}[^\n]*$"):
        Robot.from_urdf(path)


def test_what_no_external_axis_can_be_is_refused(tmp_path):
    four = [(f"slide_{i}", "prismatic", FAST) for i in range(4)]
    path, _ = written(tmp_path, four)
    with pytest.raises(InputError, match=r"at most 3 external axes, got 4: slide_0, .* slide_3"):
        Robot.from_urdf(path)
    two = [RAIL, ("lift", "prismatic", FAST)]
    path, _ = written(tmp_path, two)
    same = {"lift": {"name": "rail"}}
    with pytest.raises(InputError, match="two of its external axes are named 'rail'"):
        Robot.from_urdf(path, externals=same)
    with pytest.raises(InputError, match=r"has no external axis 'crane'; there are rail, lift"):
        Robot.from_urdf(path, externals={"crane": {"acceleration": 1.0}})
    with pytest.raises(InputError, match="mount: expected a link between base and tip, got 'top'"):
        Robot.from_urdf(path, mount="top")
    text = path.read_text()
    path.write_text(
        re.sub(r'(<joint name="rail".*?<axis xyz=")[^"]*', r"\g<1>0 0 0", text, count=1)
    )
    with pytest.raises(InputError, match="joint 'rail': its axis is nearly 0 0 0"):
        Robot.from_urdf(path)
    path.write_text(text.replace('name="rail" type="prismatic"', 'name="rail" type="planar"'))
    with pytest.raises(
        InputError, match="joint 'rail' is planar; an external axis slides or turns"
    ):
        Robot.from_urdf(path)
    path.write_text(text.replace("</joint>", '<mimic joint="lift"/></joint>', 1))
    with pytest.raises(InputError, match="joint 'rail' mimics 'lift'; an external axis"):
        Robot.from_urdf(path)


def test_a_sliding_joint_in_the_arm_is_refused_as_before(tmp_path):
    path, _ = written(tmp_path)
    path.write_text(
        path.read_text().replace('name="j3" type="revolute"', 'name="j3" type="prismatic"')
    )
    with pytest.raises(
        InputError, match="joint 'j3' between base and tip is prismatic; an arm must"
    ):
        Robot.from_urdf(path)
    # A turning joint before the arm is one of it, unless the arm is said to stand on it.
    path, _ = written(tmp_path, [("column", "revolute", FAST)])
    with pytest.raises(InputError, match="name the link that the arm is mounted on as mount"):
        Robot.from_urdf(path)
    assert Robot.from_urdf(path, mount="column_link").externals[0].name == "column"


def test_a_part_must_stand_on_a_branch_of_its_own(tmp_path):
    path, table = written(tmp_path, [RAIL], [("table", "continuous", FREE)])
    read = {"tip": "tool0"}
    for part, message in (
        ("bench", "part: there is no link 'bench'"),
        ("link_3", "expected a link that the robot does not move, got 'link_3'.*with 'j3'"),
        ("rail_link", "expected a link that the robot does not move, got 'rail_link'"),
        ("world", "part: no joint moves 'world'"),
    ):
        with pytest.raises(InputError, match=message):
            Robot.from_urdf(path, part=part, **read)
    with pytest.raises(
        InputError, match="is not connected to what base 'rail_link' is fixed to; ch"
    ):
        Robot.from_urdf(path, base="rail_link", part=table, **read)


def test_bodies_of_a_description_go_with_what_carries_them(tmp_path):
    before = [RAIL, ("lift", "prismatic", FAST)]
    path, table = written(tmp_path, before, [("table", "continuous", FREE)], shapes=True)
    found = Robot.from_urdf(path, tip="tool0", part=table)
    cell = cell_of(found, tool=np.eye(4), part=None)
    moves = {body.name: cell.chain.moves_with(body.frame) for body in cell.bodies}
    assert moves["world"] == "ground"
    assert moves["rail_link"] == "rail"
    assert moves["lift_link"] == "lift"
    assert moves["table_link"] == "table"
    assert moves["link_2"] == "joint 2"
    # Where each link is, by the whole chain, is where pinocchio has it.
    model = pin.buildModelFromUrdf(str(path))
    data = model.createData()
    names = [*(f"j{i}" for i in range(1, 7)), "rail", "lift", "table"]
    q = np.random.default_rng(8).uniform(-1, 1, (1, 9))
    at = pin.neutral(model)
    for name, value in zip(names, q[0], strict=True):
        one = model.joints[model.getJointId(name)]
        at[one.idx_q : one.idx_q + one.nq] = (
            [np.cos(value), np.sin(value)] if one.nq == 2 else [value]
        )
    pin.framesForwardKinematics(model, data, at)
    frames = cell.chain.frames(q)[0]
    for body in link_bodies(found):
        want = data.oMf[model.getFrameId(body.name)].homogeneous
        corners = body.shape.corners @ frames[body.frame, :3, :3].T + frames[body.frame, :3, 3]
        np.testing.assert_allclose(corners.mean(axis=0), want[:3, 3], atol=1e-9)
    alone = found.alone()
    assert {body.frame for body in link_bodies(alone) if body.name in ("world", table)} == {0}
    bare = Robot.from_urdf(path, tip="tool0", part=table, externals=None)
    with pytest.raises(InputError, match="moves with joint 'rail', which is not one of its ext"):
        link_bodies(bare)


def test_a_cut_along_the_rail_of_a_description_is_planned(tmp_path):
    slide = '<limit lower="-2" upper="2" velocity="2" acceleration="4" effort="1"/>'
    rail = joint("rail", "world", "carriage", np.eye(4), (0, 1, 0), "prismatic", slide)
    names = ["world", "carriage", *(f"link_{i}" for i in range(1, 7)), "tool0"]
    path = urdf(tmp_path, [rail, *arm_on("carriage")], names)
    found = Robot.from_urdf(path)
    y = np.linspace(-2.4, 2.4, 49)  # 4.8 m along the rail, farther than the arm reaches
    line = Contour(np.c_[0 * y, y, 0 * y], np.tile([0, 0, -1], (49, 1)))
    tool, placement = np.eye(4), np.eye(4)
    tool[:3, :3] = [[0.8, 0, 0.6], [0, 1, 0], [-0.6, 0, 0.8]]
    tool[:3, 3], placement[:3, 3] = [0.15, 0, 0.30], [1.2, 0, 0.5]
    options = {"tool": tool, "placement": placement, "speed": 0.05, "gamma_step": np.radians(30)}
    made = plan(line, found, **options)
    assert np.ptp(made.external[:, 0]) > 0.5
    # 100 mm from node to node are far: that joints are not bounded between them is a warning.
    assert {issue.code for issue in audit(made, path_tolerance=1e-3)} <= {"unbounded"}
