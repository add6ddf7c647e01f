"""The planner of COMPAS FAB, against the package itself: CI installs it in its own environment."""

import ast
import copy
import math
import os
import re
import subprocess
import sys
from importlib.util import find_spec
from itertools import pairwise

import numpy as np
import pytest

from conftest import ROOT

CLIENT = ROOT / "src" / "kerfpath" / "compas" / "client.py"
HERE = find_spec("compas_fab") is not None or os.environ.get("COMPAS") == "required"
with_compas = pytest.mark.skipif(not HERE, reason="COMPAS FAB is not installed")
UR = [0.3, -1.6, 1.7, -1.6, -1.5, 0.1]
ALONE = """
import importlib.util, sys
spec = importlib.util.spec_from_file_location("kerfpath_client", sys.argv[1])
client = importlib.util.module_from_spec(spec)
spec.loader.exec_module(client)
assert not any(name.split(".")[0] in ("kerfpath", "numba") for name in sys.modules)
from compas.geometry import Point, Vector
from compas_fab.robots import PointAxisWaypoints, RobotCellLibrary, TargetMode
cell, state = RobotCellLibrary.abb_irb4600_40_255(load_geometry=False)
line = [(Point(1.3, 0.1 + 0.01 * k, 0.9), Vector(0, 0, -1)) for k in range(12)]
with client.KerfpathClient(python=sys.argv[2], speed=0.1, acceleration=8.0) as asked:
    planner = client.KerfpathPlanner(asked)
    planner.set_robot_cell(cell, state)
    waypoints = PointAxisWaypoints(line, TargetMode.ROBOT)
    found = planner.plan_cartesian_motion(waypoints, state, options={"check_collision": False})
    print(len(found.attributes["waypoints"]), found.points[0].joint_values == [0.0] * 6)
    try:
        waypoints = PointAxisWaypoints([(Point(9, 0, 0), Vector(0, 0, -1))] * 2, TargetMode.ROBOT)
        planner.plan_cartesian_motion(waypoints, state, options={"check_collision": False})
    except client.MotionPlanningError as error:
        print(error)
"""


def test_the_client_is_of_python_3_9_and_needs_no_more_than_compas():
    tree = ast.parse(CLIENT.read_text(encoding="utf-8"), feature_version=(3, 9))
    at_top = [n for n in tree.body if isinstance(n, ast.Import | ast.ImportFrom)]
    names = {a.name if isinstance(n, ast.Import) else n.module for n in at_top for a in n.names}
    foreign = {n.split(".")[0] for n in names} - sys.stdlib_module_names
    assert foreign == {"compas", "compas_fab", "compas_robots"}


@pytest.fixture(scope="module")
def compas():
    """What the tests use of COMPAS FAB and of the planner."""
    import compas_fab.backends
    import compas_fab.robots
    from compas.geometry import Frame, Point, Vector

    import kerfpath.compas

    class Names:
        backends, robots = compas_fab.backends, compas_fab.robots

    for one in (Frame, Point, Vector):
        setattr(Names, one.__name__, one)
    Names.Client, Names.Planner = kerfpath.compas.KerfpathClient, kerfpath.compas.KerfpathPlanner
    return Names


def circle(compas, at, radius=0.1, count=40, scale=1.0):
    """Points and axes on a circle in the world, in units of `scale` m."""
    turn = np.linspace(0, 2 * np.pi, count)
    points = np.array(at) + radius * np.c_[np.cos(turn), np.sin(turn), 0 * turn]
    return [(compas.Point(*(p / scale)), compas.Vector(0, 0, -1)) for p in points]


def cell_in(compas, name, *, geometry, start=None):
    cell, state = getattr(compas.robots.RobotCellLibrary, name)(load_geometry=geometry)
    if start is not None:
        state.robot_configuration.joint_values = start
    planner = compas.Planner(compas.Client(speed=0.15, acceleration=8.0))
    planner.set_robot_cell(cell, state)
    return cell, state, planner


def require_met(cell, state, trajectory, waypoints, accuracy):
    """The kinematics of COMPAS put what the waypoints are for at every one of them."""
    at = trajectory.attributes["waypoints"]
    there = copy.deepcopy(state)
    group = cell.main_group_name
    axes = getattr(waypoints, "target_points_and_axes", None)
    for k, i in enumerate(at):
        there.robot_configuration = trajectory.points[i]
        frame = cell.forward_kinematics_target_frame(there, waypoints.target_mode, group)
        point, axis = axes[k] if axes else (waypoints.target_frames[k].point,) * 2
        off = (frame.point - point * waypoints.native_scale).length
        assert off <= accuracy
        if axes:
            assert (frame.zaxis - axis.unitized()).length <= 10 * accuracy
        else:
            assert (frame.xaxis - waypoints.target_frames[k].xaxis).length <= 10 * accuracy
    assert len(at) == len(axes or waypoints.target_frames)


@with_compas
def test_a_circle_with_a_tool_in_millimetres_from_a_moved_base(compas):
    cell, state, planner = cell_in(compas, "ur5_cone_tool", geometry=False, start=UR)
    state.robot_base_frame = compas.Frame([0.2, 0.1, 0.05], [0.8, 0.6, 0], [-0.6, 0.8, 0])
    waypoints = compas.robots.PointAxisWaypoints(
        circle(compas, (0.55, 0.45, 0.25), scale=0.001), compas.robots.TargetMode.TOOL, 0.001
    )
    found = planner.plan_cartesian_motion(waypoints, state, options={"check_collision": False})
    require_met(cell, state, found, waypoints, 1e-8)
    assert found.joint_names == cell.get_configurable_joint_names()
    assert found.points[0].joint_values == UR
    assert (found.attributes["speed"], found.attributes["acceleration"]) == (0.15, 8.0)
    assert not any(found.points[0].velocities)
    times = [p.time_from_start.seconds for p in found.points]
    assert times[0] == 0
    assert all(one < two for one, two in pairwise(times))
    q = np.array([p.joint_values for p in found.points])
    rate = np.abs(np.diff(q, axis=0)) / np.diff(times)[:, None]
    limit = [j.limit.velocity for j in cell.get_configurable_joints()]
    assert (rate <= np.array(limit) * (1 + 1e-6)).all()
    again = compas.robots.JointTrajectory.__from_data__(copy.deepcopy(found.__data__))
    assert len(again.points) == len(found.points)


@with_compas
def test_frames_are_followed_in_a_cell_with_geometry(compas):
    cell, state, planner = cell_in(compas, "abb_irb4600_40_255", geometry=True)
    frames = []
    for k, (point, _) in enumerate(circle(compas, (1.3, 0.2, 0.9))):
        x, y = math.cos(0.01 * k), math.sin(0.01 * k)
        frames.append(compas.Frame(point, [x, y, 0], [y, -x, 0]))  # z points down
    waypoints = compas.robots.FrameWaypoints(frames, compas.robots.TargetMode.ROBOT)
    found = planner.plan_cartesian_motion(waypoints, state)
    require_met(cell, state, found, waypoints, 1e-4)  # the description rounds its angles


@with_compas
def test_bodies_tools_and_the_start_are_checked(compas):
    _, state, planner = cell_in(compas, "ur5_cone_tool", geometry=True, start=UR)
    mode = compas.robots.TargetMode.TOOL
    above = compas.robots.PointAxisWaypoints(circle(compas, (0.45, 0.1, 0.2), count=20), mode)
    assert planner.plan_cartesian_motion(above, state).fraction == 1.0
    below = compas.robots.PointAxisWaypoints(circle(compas, (0.45, 0.1, -0.05), count=20), mode)
    with pytest.raises(compas.backends.MotionPlanningError, match="floor"):
        planner.plan_cartesian_motion(below, state)
    state.rigid_body_states["floor"].is_hidden = True
    assert planner.plan_cartesian_motion(below, state).fraction == 1.0
    state.rigid_body_states["floor"].is_hidden = False
    flat = copy.deepcopy(state)
    flat.robot_configuration.joint_values = [0.0] * 6
    with pytest.raises(compas.backends.MPStartStateInCollisionError, match="'floor'"):
        planner.plan_cartesian_motion(above, flat)


@with_compas
def test_errors_are_those_of_the_interface(compas):
    backends, robots = compas.backends, compas.robots
    cell, state, planner = cell_in(compas, "abb_irb4600_40_255", geometry=False)
    far = robots.PointAxisWaypoints(circle(compas, (9, 0, 1)), robots.TargetMode.ROBOT)
    free = {"check_collision": False}
    with pytest.raises(backends.MPNoIKSolutionError) as none:
        planner.plan_cartesian_motion(far, state, options=free)
    assert none.value.target == far.target_points_and_axes[0]
    with pytest.raises(backends.MotionPlanningError, match="no geometry to check collisions"):
        planner.plan_cartesian_motion(far, state)
    near = robots.PointAxisWaypoints(circle(compas, (1.3, 0.2, 0.9)), robots.TargetMode.ROBOT)
    with pytest.raises(backends.MotionPlanningError, match="kerfpath: speed: "):
        planner.plan_cartesian_motion(near, state, options=free | {"speed": -1})
    with pytest.raises(backends.MPNoPlanFoundError):
        planner.plan_cartesian_motion(near, state, options=free | {"speed": 50.0})
    with pytest.raises(backends.BackendTargetNotSupportedError, match="got list"):
        planner.plan_cartesian_motion([], state)
    with pytest.raises(backends.BackendFeatureNotSupportedError):
        planner.plan_motion(None, state)
    beyond = copy.deepcopy(state)
    beyond.robot_configuration.joint_values = [9.0, 0, 0, 0, 0, 0]
    with pytest.raises(backends.MotionPlanningError, match="start_q: expected"):
        planner.plan_cartesian_motion(near, beyond, options=free)
    nameless = copy.deepcopy(state)
    nameless.robot_configuration = type(nameless.robot_configuration)([0.0] * 6, [0] * 6)
    with pytest.raises(ValueError, match="joint_names"):
        planner.plan_cartesian_motion(near, nameless, options=free)
    with pytest.raises(TypeError, match="'acceleration'"):
        compas.Client()
    with compas.Client(python="/no/such/python", acceleration=8.0) as client:
        planner = compas.Planner(client)
        planner.set_robot_cell(cell, state)
        with pytest.raises(backends.MotionPlanningError, match="expected the path of a Python"):
            planner.plan_cartesian_motion(near, state, options=free)


@with_compas
def test_another_python_plans_with_the_client_file_alone():
    """COMPAS_PYTHON is a Python with COMPAS FAB and without kerfpath, such as one of Rhino."""
    python = os.environ.get("COMPAS_PYTHON", sys.executable)
    done = subprocess.run(
        [python, "-W", "ignore", "-c", ALONE, str(CLIENT), sys.executable],
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    first, second = done.stdout.splitlines()
    assert first == "12 True"
    assert "0 and 1 are at the same point" in second


def page_blocks():
    page = (ROOT / "docs" / "compas.md").read_text(encoding="utf-8")
    return re.findall(r"^```python\n(.*?)^```", page, re.MULTILINE | re.DOTALL)


@with_compas
def test_the_example_of_the_page_runs(capsys):
    exec(compile(page_blocks()[0], "compas.md", "exec"), {})
    points, seconds, cost = map(float, capsys.readouterr().out.split())
    assert points > 100
    assert 4 < seconds < 8
    assert cost > 0


def test_the_component_for_grasshopper_is_python_3_9():
    ast.parse(page_blocks()[1], feature_version=(3, 9))
