"""Planning scenes and goals of MoveIt: messages of rosbags, through bytes, in place of rclpy's."""

import ast
import configparser
import os
import re
import signal
import subprocess
import sys
from types import MappingProxyType, SimpleNamespace
from xml.etree import ElementTree

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from conftest import ROOT
from kerfpath import robot
from kerfpath.cell import Hull
from kerfpath.errors import InputError
from kerfpath.ros import Setting, around_robot, display_trajectory, plan_goal
from kerfpath.urdf import read_semantics
from ros_messages import made, through_cdr

EXAMPLE = ROOT / "examples" / "ros"
NODE = EXAMPLE / "kerfpath_ros" / "kerfpath_ros" / "planner.py"
ARM = robot("ur_ur10e")
HOME, DONE = np.radians([20, -80, 90, -100, -80, 10]), np.radians([60, -90, 90, -90, -90, 0])
BODY = "<collision><geometry><box size='0.08 0.08 0.08'/></geometry></collision>"
SRDF = """<robot name='{name}'>
<virtual_joint name='stand' type='fixed' parent_frame='world' child_link='base_link'/>
<group name='arm'><chain base_link='base_link' tip_link='tool0'/></group>
<group name='both'><group name='arm'/></group>
<group_state name='home' group='arm'>{home}</group_state>
<group_state name='done' group='arm'>{done}</group_state>
<end_effector name='laser' parent_link='tool0' group='both' parent_group='arm'/>
<disable_collisions link1='link_4' link2='link_6' reason='Never'/>{more}</robot>"""


def state(q):
    names = (f"joint_{i}" for i in range(1, 7))
    return "".join(
        f"<joint name='{n}' value='{v!r}'/>" for n, v in zip(names, q.tolist(), strict=True)
    )


@pytest.fixture
def setting(tmp_path):
    """A UR10e whose links are boxes of 80 mm at their joints, and its semantics."""
    text = ARM.to_urdf()
    for k in range(1, 7):
        text = re.sub(rf'<link name="link_{k}" ?/>', f'<link name="link_{k}">{BODY}</link>', text)
    assert text.count("<collision>") == 6
    (tmp_path / "arm.urdf").write_text(text)
    name = ElementTree.fromstring(text).get("name")
    semantic = SRDF.format(name=name, home=state(HOME), done=state(DONE), more="")
    (tmp_path / "arm.srdf").write_text(semantic)
    return Setting(
        urdf=tmp_path / "arm.urdf", srdf=tmp_path / "arm.srdf", acceleration=8.0,
        gamma_step=np.radians(20),
    )  # fmt: skip


def pose(xyz, rpy=(0, 0, 0)):
    x, y, z, w = Rotation.from_euler("xyz", rpy, degrees=True).as_quat()
    at = dict(zip("xyz", map(float, xyz), strict=True))
    return {"position": at, "orientation": {"x": x, "y": y, "z": z, "w": w}}


def box(name, xyz, size=(0.1, 0.1, 0.1), **more):
    shape = {"type": 1, "dimensions": list(size)}
    return {"id": name, "pose": pose(xyz), "primitives": [shape]} | more


def scene(*objects, **more):
    fields = {"world": {"collision_objects": list(objects)}} | more
    return through_cdr(made("moveit_msgs/msg/PlanningScene", fields))


def goal(*, count=24, at=(0.6, 0.2, 0.3), **more):
    turn = np.linspace(0, 2 * np.pi, count)
    points = np.array(at) + 0.1 * np.c_[np.cos(turn), np.sin(turn), 0 * turn]
    fields = {
        "header": {"frame_id": "world"},
        "points": [dict(zip("xyz", p, strict=True)) for p in points.tolist()],
        "axes": [{"z": -1.0}] * count,
        "tip": pose([0, 0, 0.1]),
        "speed": 0.15,
        "max_step": 0.05,
        "start_state": "home",
        "end_state": "done",
    }
    return through_cdr(made("kerfpath_msgs/action/Plan_Goal", fields | more))


def test_a_goal_is_planned_from_state_to_state_and_comes_back_over_the_wire(setting):
    asked = goal()
    fields = plan_goal(asked, setting)
    result = through_cdr(made("kerfpath_msgs/action/Plan_Result", fields))
    assert result.error_code.val == 1, result.message
    joints = result.trajectory.joint_trajectory
    assert joints.header.frame_id == "base_link"
    assert joints.joint_names == [f"joint_{i}" for i in range(1, 7)]
    q = np.array([p.positions for p in joints.points])
    np.testing.assert_allclose(q[[0, -1]], [HOME, DONE], atol=1e-12)
    time = np.array(
        [p.time_from_start.sec + 1e-9 * p.time_from_start.nanosec for p in joints.points]
    )
    assert time[0] == 0
    rate = np.diff(q, axis=0) / np.diff(time)[:, None]
    assert (np.abs(rate) <= ARM.velocity * (1 + 1e-6)).all()  # times are in whole ns
    assert not any(joints.points[k].velocities.any() for k in (0, -1))
    assert all(len(p.accelerations) == 6 for p in joints.points)
    tool = np.eye(4)
    tool[2, 3] = 0.1
    T = ARM.forward(q) @ tool
    for point in asked.points:  # each is passed, with the tool pointing down
        off = np.linalg.norm(T[:, :3, 3] - [point.x, point.y, point.z], axis=1)
        k = int(np.argmin(off))
        assert off[k] < 1e-8
        np.testing.assert_allclose(T[k, :3, 2], [0, 0, -1], atol=1e-8)
    shown = through_cdr(
        made("moveit_msgs/msg/DisplayTrajectory", display_trajectory(fields["trajectory"], "arm"))
    )
    assert shown.model_id == "arm"
    start = shown.trajectory_start.joint_state
    assert dict(zip(start.name, start.position, strict=True)) == dict(
        zip(joints.joint_names, HOME.tolist(), strict=True)
    )
    assert len(shown.trajectory[0].joint_trajectory.points) == len(q)


def test_a_start_may_be_that_of_the_goal_or_of_the_scene(setting):
    names = [f"joint_{i}" for i in (6, 1, 2, 3, 4, 5)]
    here = {"name": [*names, "finger"], "position": [HOME[5], *HOME[:5], 0.01]}
    for more in (
        {"start": here},
        {"scene": {"robot_state": {"joint_state": here}}},
    ):
        found = plan_goal(goal(start_state="", end_state="", **more), setting)
        assert found["error_code"]["val"] == 1, found["message"]
        points = found["trajectory"]["joint_trajectory"]["points"]
        assert points[0]["positions"] == HOME.tolist()
        assert points[-1]["positions"] != DONE.tolist()


IN_THE_WAY = box("crate", [0.6, 0.2, 0.3])


def planned(setting, *objects, **more):
    whole = made(
        "moveit_msgs/msg/PlanningScene", {"world": {"collision_objects": list(objects)}} | more
    )
    return plan_goal(goal(check_collisions=True, scene=whole), setting)


def test_objects_of_the_scene_are_kept_clear_of(setting):
    assert planned(setting)["error_code"]["val"] == 1
    held = {"link_name": "tool0", "object": box("head", [0, 0, 0.05], [0.02, 0.02, 0.09])}
    carried = {"robot_state": {"attached_collision_objects": [held]}}
    found = planned(setting, IN_THE_WAY, **carried)
    assert found["error_code"]["val"] == 1, found["message"]
    # A wide head cannot pass it; allowed, it can.
    held["object"] = box("head", [0, 0, 0.05], [0.16, 0.16, 0.09])
    found = planned(setting, IN_THE_WAY, **carried)
    assert found["error_code"]["val"] in (-1, -31)
    assert "crate and head" in found["message"]
    assert not found["trajectory"]
    names = {
        "entry_names": ["crate", "head"],
        "entry_values": [{"enabled": [0, 1]}, {"enabled": [1, 0]}],
    }
    found = planned(setting, IN_THE_WAY, **carried, allowed_collision_matrix=names)
    assert found["error_code"]["val"] == 1, found["message"]
    # Where the robot stands, and where it is to go.
    found = planned(setting, box("crate", ARM.forward(HOME)[:3, 3], [0.3] * 3))
    assert found["error_code"]["val"] == -10
    found = planned(setting, box("crate", ARM.forward(DONE)[:3, 3], [0.3] * 3))
    assert found["error_code"]["val"] == -12


def test_codes_and_messages_say_what_a_goal_lacks(setting):
    far = goal(at=(3.0, 0, 0))
    assert plan_goal(far, setting)["error_code"]["val"] == -31
    assert plan_goal(goal(speed=40.0), setting)["error_code"]["val"] == -1
    for asked, code, said in (
        (goal(group="hand"), -15, "'hand' is not in the SRDF; groups that are chains: arm"),
        (goal(group="both"), -15, "'both' is no chain of joints"),
        (goal(start_state="rest"), 99999, "expected one of group 'arm' (home, done), got 'rest'"),
        (goal(start_state=""), 99999, "expected a position of joint 'joint_1', got none"),
        (goal(header={"frame_id": "link_3"}), 99999, "frame of the points: expected a link"),
        (goal(axes=[{"z": 1.0}]), 99999, "axes: expected"),
        (goal(speed=0.0), 99999, "speed: "),
        (goal(tip=pose([0, 0, 0]) | {"orientation": {"w": 2.0}}), 99999, "tip: expected a unit"),
    ):
        found = plan_goal(asked, setting)
        assert found["error_code"]["val"] == code, found["message"]
        assert said in found["message"]
        assert not found["trajectory"]
    gone = Setting(urdf=setting.urdf, srdf=setting.srdf.with_name("no.srdf"), acceleration=8.0)
    assert plan_goal(goal(), gone)["error_code"]["val"] == 99999


# -----------------------------------------------------------------------------
# Scenes.


def around(setting, *objects, **more):
    semantics = read_semantics(setting.srdf, setting.urdf)
    return around_robot(scene(*objects, **more), semantics, semantics.group("arm"))


def hull_of(body):
    return Hull(np.array(body["mesh"]["vertices"]))


def inside(points, hull):
    """Which points (P, 3) are in a convex body, by the planes of its faces."""
    a, b, c = (hull.points[hull.triangles[:, i]] for i in range(3))
    across = np.cross(b - a, c - a)
    middle = hull.points.mean(axis=0)
    across *= np.sign(((a - middle) * across).sum(axis=1))[:, None]
    return ((points @ across.T - (a * across).sum(axis=1)) <= 1e-12).all(axis=1)


def test_bodies_hold_the_shapes_that_they_stand_for(setting):
    shapes = {
        "box": {"type": 1, "dimensions": [0.2, 0.3, 0.4]},
        "ball": {"type": 2, "dimensions": [0.2]},
        "can": {"type": 3, "dimensions": [0.4, 0.1]},
        "cone": {"type": 4, "dimensions": [0.4, 0.1]},
    }
    asked = [{"id": name, "primitives": [one]} for name, one in shapes.items()]
    bodies = {body["name"]: hull_of(body) for body in around(setting, *asked)["bodies"]}
    chance = np.random.default_rng(5)
    p = chance.uniform(-0.25, 0.25, (20_000, 3))
    wide, height = np.hypot(p[:, 0], p[:, 1]), p[:, 2]
    truth = {
        "box": (np.abs(p) <= [0.1, 0.15, 0.2]).all(axis=1),
        "ball": np.linalg.norm(p, axis=1) <= 0.2,
        "can": (wide <= 0.1) & (np.abs(height) <= 0.2),
        "cone": (np.abs(height) <= 0.2) & (wide <= 0.1 * (0.2 - height) / 0.4),
    }
    for name, true in truth.items():
        held = inside(p, bodies[name])
        assert held[true].all(), name
        assert held.sum() <= 1.08 * true.sum(), name  # and are hardly larger


def test_poses_of_shapes_objects_and_frames_are_joined(setting):
    shape = {"type": 1, "dimensions": [0.1, 0.1, 0.1]}
    asked = {
        "id": "pair", "header": {"frame_id": "table"}, "pose": pose([1, 0, 0], [0, 0, 90]),
        "primitives": [shape, shape], "primitive_poses": [pose([0, 0, 0]), pose([0.5, 0, 0])],
    }  # fmt: skip
    moved = {"translation": {"z": 2.0}, "rotation": {"w": 1.0}}
    frame = {"header": {"frame_id": "world"}, "child_frame_id": "table", "transform": moved}
    one, two = around(setting, asked, fixed_frame_transforms=[frame])["bodies"]
    assert (one["name"], two["name"], two["of"]) == ("pair", "pair 2", "pair")
    np.testing.assert_allclose(np.array(one["T"])[:3, 3], [1, 0, 2], atol=1e-12)
    np.testing.assert_allclose(np.array(two["T"])[:3, 3], [1, 0.5, 2], atol=1e-12)


def test_a_plane_is_a_plate_below_it(setting):
    plane = {
        "id": "floor",
        "planes": [{"coef": [0.0, 0.0, 2.0, 0.4]}],
        "plane_poses": [pose([0, 0, 0.1])],
    }
    (body,) = around(setting, plane)["bodies"]
    top = np.array(body["mesh"]["vertices"])[:, 2] + body["T"][2][3]
    assert top.max() == pytest.approx(-0.1, abs=1e-12)  # 2 z + 0.4 = 0, moved up by 0.1
    assert np.ptp(top) == pytest.approx(1e-3)
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    mesh = {
        "vertices": [dict(zip("xyz", p, strict=True)) for p in corners.tolist()],
        "triangles": [{"vertex_indices": t} for t in ([0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3])],
    }
    (body,) = around(setting, {"id": "wedge", "meshes": [mesh]})["bodies"]
    np.testing.assert_array_equal(body["mesh"]["vertices"], corners)


def test_what_may_touch_comes_from_matrix_defaults_and_semantics(setting):
    matrix = {
        "entry_names": ["link_1", "table", "link_5"],
        "entry_values": [{"enabled": row} for row in ([0, 1, 0], [1, 0, 0], [0, 0, 0])],
        "default_entry_names": ["mat", "link_2", "link_1"],
        "default_entry_values": [True, False, True],
    }
    found = around(
        setting, box("table", [1, 0, 0]), box("mat", [0, 1, 0]), allowed_collision_matrix=matrix
    )
    touch = {body["name"]: set(body["touch"]) for body in found["bodies"]}
    assert "link_1" in touch["table"]
    assert "link_5" not in touch["table"]  # the matrix itself says no
    assert touch["mat"] >= {"link_1", "link_5", "table"}
    assert "link_2" not in touch["mat"]  # of two defaults both must allow it
    assert ["link_4", "link_6"] in found["disabled"]  # of the SRDF
    assert ["link_1", "link_6"] in found["disabled"]  # by the default of link_1
    assert ["link_1", "link_5"] not in found["disabled"]
    held = {"link_name": "tool0", "object": box("head", [0, 0, 0]), "touch_links": ["link_6"]}
    (body,) = around(setting, robot_state={"attached_collision_objects": [held]})["bodies"]
    assert body["held"]
    assert body["touch"] == ["link_6", "tool0"]


PRISM = {"type": 5, "dimensions": [0.1]}
ON_A_LINK = {"link_name": "link_3", "object": box("a", [0, 0, 0])}
REFUSED = [
    ([], {"is_diff": True}, "expected a whole scene"),
    ([], {"world": {"octomap": {"octomap": {"data": [1]}}}}, "an octomap is not supported"),
    ([], {"link_padding": [{"link_name": "link_1", "padding": 0.01}]}, "padding and scaling"),
    ([], {"link_scale": [{"link_name": "link_1", "scale": 1.1}]}, "padding and scaling"),
    ([box("a", [0, 0, 0]), box("a", [1, 0, 0])], {}, "two bodies are called 'a'"),
    ([box("link_1", [0, 0, 0])], {}, "two bodies are called 'link_1'"),
    ([box("a", [0, 0, 0], header={"frame_id": "camera"})], {}, "object 'a': expected its frame"),
    ([box("a", [0, 0, 0], header={"frame_id": "tool0"})], {}, "got 'tool0'"),
    ([box("a", [0, 0, 0], operation=1)], {}, "got another operation"),
    ([box("a", [0, 0, 0], primitives=[])], {}, "object 'a' has no shape"),
    ([box("a", [0, 0, 0], primitives=[PRISM])], {}, "got shape 5"),
    ([box("a", [0, 0, 0], size=[1.0, 1.0])], {}, "object 'a': dimensions: expected"),
    ([box("a", [0, 0, 0], size=[1.0, 1.0, -1.0])], {}, "object 'a': dimensions"),
    ([box("a", [np.nan, 0, 0])], {}, "object 'a': position"),
    ([box("a", [0, 0, 0], primitives=[PRISM, PRISM])], {}, "a pose for each of its 2 shapes"),
    ([{"id": "a", "planes": [{"coef": [0.0] * 4}]}], {}, "normal of its plane has no length"),
    ([], {"robot_state": {"attached_collision_objects": [ON_A_LINK]}}, "a link that is fixed to"),
    ([], {"allowed_collision_matrix": {"entry_names": ["a"], "entry_values": []}}, "a row and"),
    ([], {"allowed_collision_matrix": {"default_entry_names": ["a"]}}, "a value for each default"),
]  # fmt: skip


@pytest.mark.parametrize(("objects", "more", "said"), REFUSED, ids=[said for *_, said in REFUSED])
def test_what_a_scene_says_and_is_not_understood_is_refused(setting, objects, more, said):
    with pytest.raises(InputError, match=re.escape(said)):
        around(setting, *objects, **more)


def test_an_operation_is_a_byte_in_rclpy():
    from kerfpath.ros.scene import _bodies

    for value, refused in ((b"\x00", False), (b"\x01", True)):
        one = SimpleNamespace(**vars(made("moveit_msgs/msg/CollisionObject", box("a", [0, 0, 0]))))
        one.operation = value
        if refused:
            with pytest.raises(InputError, match="another operation"):
                list(_bodies(one, np.eye(4), held=False))
        else:
            assert len(list(_bodies(one, np.eye(4), held=False))) == 1


# -----------------------------------------------------------------------------
# The example packages, as far as they can be read without ROS.


def test_the_packages_of_the_example_are_whole():
    for folder in EXAMPLE.iterdir():
        manifest = ElementTree.parse(folder / "package.xml").getroot()
        assert manifest.findtext("name") == folder.name
    tree = ast.parse(NODE.read_text())
    imported = {n.module.split(".")[0] for n in ast.walk(tree) if isinstance(n, ast.ImportFrom)}
    needed = {
        e.text
        for e in ElementTree.parse(EXAMPLE / "kerfpath_ros" / "package.xml").iter("exec_depend")
    }
    assert needed - {"rclpy"} <= imported | {"rclpy"}
    config = configparser.ConfigParser()
    config.read(EXAMPLE / "kerfpath_ros" / "setup.cfg")
    assert "kerfpath_ros" in config["install"]["install_scripts"]


def test_the_example_of_the_page_runs(tmp_path, monkeypatch, capsys):
    page = (ROOT / "docs" / "ros.md").read_text(encoding="utf-8")
    (block,) = re.findall(r"^```python\n(.*?)^```", page, re.MULTILINE | re.DOTALL)
    monkeypatch.chdir(tmp_path)
    names = {}
    exec(compile(block, "ros.md", "exec"), names)
    assert names["result"]["error_code"] == {"val": 1}
    assert "'val': 1" in capsys.readouterr().out
    ends = [names["points"][k]["positions"] for k in (0, -1)]
    np.testing.assert_allclose(*ends, atol=1e-12)


class Unset(Exception):
    """As ParameterUninitializedException of rclpy."""


class Node:
    """A stand-in for that of rclpy: a parameter that is only declared with its type is not set."""

    parameters = MappingProxyType({})

    def __init__(self, name):
        self.declared, self.published, self.warned = {}, [], []

    def declare_parameter(self, name, kind):
        self.declared[name] = kind

    def get_parameter(self, name):
        if name not in self.parameters:
            raise Unset(name)
        assert self.declared[name] == ("double[]" if name == "acceleration" else "string")
        return SimpleNamespace(value=self.parameters[name])

    def create_publisher(self, *_):
        return SimpleNamespace(publish=self.published.append)

    def get_logger(self):
        return SimpleNamespace(warning=self.warned.append)


@pytest.fixture
def node_of(setting, monkeypatch):
    """The node of the example with given parameters, and what it has filled messages with."""
    filled = []
    Plan = SimpleNamespace(Feedback=SimpleNamespace, Result=SimpleNamespace)
    kinds = SimpleNamespace(STRING="string", DOUBLE_ARRAY="double[]")
    accept = SimpleNamespace(ACCEPT="accept")
    for name, values in {
        "rclpy": {},
        "rclpy.action": {"ActionServer": lambda *_, **more: more, "CancelResponse": accept},
        "rclpy.callback_groups": {"ReentrantCallbackGroup": object},
        "rclpy.exceptions": {"ParameterUninitializedException": Unset},
        "rclpy.executors": {"MultiThreadedExecutor": object},
        "rclpy.node": {"Node": Node},
        "rclpy.parameter": {"Parameter": SimpleNamespace(Type=kinds)},
        "ament_index_python.packages": {"get_package_share_directory": str},
        "kerfpath_msgs.action": {"Plan": Plan},
        "moveit_msgs.msg": {"DisplayTrajectory": SimpleNamespace},
        "rosidl_runtime_py": {"set_message_fields": lambda _, fields: filled.append(fields)},
    }.items():
        monkeypatch.setitem(sys.modules, name, SimpleNamespace(**values))
    names = {}
    exec(compile(NODE.read_text(), str(NODE), "exec"), names)
    whole = {
        "robot_description": setting.urdf.read_text(),
        "robot_description_semantic": setting.srdf.read_text(),
        "acceleration": [8.0],
    }

    def made_with(**changed):
        merged = {**whole, **changed}
        given = {name: value for name, value in merged.items() if value is not None}
        monkeypatch.setattr(Node, "parameters", given)
        folder = setting.urdf.parent / "node"
        folder.mkdir()
        return names["Planner"](folder), filled

    return made_with


class Handle:
    """A stand-in for a goal handle; `cancelled` says whether it is to be cancelled."""

    def __init__(self, request, cancelled=lambda: False):
        self.request, self.cancelled, self.ended = request, cancelled, []

    def publish_feedback(self, feedback):
        assert feedback.state == "planning"

    @property
    def is_cancel_requested(self):
        return self.cancelled()

    def succeed(self):
        self.ended.append("succeed")

    def abort(self):
        self.ended.append("abort")

    def canceled(self):
        self.ended.append("canceled")


def planning():
    """The numbers of the processes that plan goals of this one."""
    asked = ["ps", "-ww", "-o", "pid=,args=", "--ppid", str(os.getpid())]
    lines = subprocess.run(asked, capture_output=True, text=True, check=True).stdout.splitlines()
    return [int(line.split()[0]) for line in lines if "kerfpath.pipe" in line]


def test_the_node_plans_and_publishes_with_stand_ins_for_ros(node_of):
    """The lines of the node run; what rclpy itself does with them is not tried here."""
    node, filled = node_of()
    handle = Handle(goal(check_collisions=True, scene=scene(box("far", [3, 3, 3]))))
    node.execute(handle)
    assert handle.ended == ["succeed"]
    assert len(node.published) == 1
    assert filled[0]["error_code"] == {"val": 1}
    made("kerfpath_msgs/action/Plan_Result", filled[0])
    made("moveit_msgs/msg/DisplayTrajectory", filled[1])
    refused = Handle(goal(group="hand"))
    node.execute(refused)
    assert refused.ended == ["abort"]
    assert "'hand' is not in the SRDF" in node.warned[0]
    assert len(node.published) == 1


@pytest.mark.parametrize(
    "name", ["robot_description", "robot_description_semantic", "acceleration"]
)
def test_the_node_asks_for_what_is_not_set(node_of, name):
    with pytest.raises(SystemExit, match=f"parameter {name} is not set: give the .+$"):
        node_of(**{name: None})


def test_a_goal_that_is_cancelled_is_planned_no_further(node_of):
    node, filled = node_of()
    assert node.server["cancel_callback"](None) == "accept"
    pids = []

    def cancelled():
        pids.extend(planning())
        return bool(pids)

    handle = Handle(goal(count=400, max_step=0.001), cancelled)
    node.execute(handle)
    assert handle.ended == ["canceled"]
    assert filled[0]["error_code"] == {"val": -7}
    made("kerfpath_msgs/action/Plan_Result", filled[0])
    assert not node.published
    with pytest.raises(ProcessLookupError):
        os.kill(pids[0], 0)


def test_a_goal_whose_process_dies_is_aborted(node_of):
    node, filled = node_of()

    def cancelled():
        for pid in planning():
            os.kill(pid, signal.SIGKILL)
        return False

    handle = Handle(goal(), cancelled)
    node.execute(handle)
    assert handle.ended == ["abort"]
    assert filled[0]["message"] == "the planning process ended with exit code -9"
