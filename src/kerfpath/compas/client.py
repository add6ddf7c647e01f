"""The planner of COMPAS FAB: its objects as a request, and the answer as a trajectory.

This file needs COMPAS FAB 2 and the standard library, and no more: it may be copied to where
kerfpath is not installed, such as the Python 3.9 of Rhino 8, which then starts the Python that has
kerfpath as a process of its own (``python=``). Requests and answers are JSON, a line each.
"""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
import threading
from collections import deque

from compas.geometry import Frame, Transformation
from compas_fab.backends import (
    BackendTargetNotSupportedError,
    MotionPlanningError,
    MPNoIKSolutionError,
    MPNoPlanFoundError,
    MPStartStateInCollisionError,
)
from compas_fab.backends.interfaces import (
    ClientInterface,
    PlanCartesianMotion,
    PlannerInterface,
    SetRobotCell,
    SetRobotCellState,
)
from compas_fab.robots import (
    Duration,
    FrameWaypoints,
    JointTrajectory,
    JointTrajectoryPoint,
    PointAxisWaypoints,
    TargetMode,
)
from compas_robots.model import Joint, LinkGeometry

MOVING = (Joint.REVOLUTE, Joint.CONTINUOUS, Joint.PRISMATIC)
FOREIGN = ("PYTHONHOME", "PYTHONPATH", "LD_LIBRARY_PATH", "QT_PLUGIN_PATH", "SSL_CERT_FILE")
"""Variables by which programs such as Rhino would lead another Python astray."""
GAMMA_STEP = math.radians(10)
"""rad: step of the free rotation unless another one is asked for."""
LAST_LINES = 20
"""Lines of the errors of a process that a message may quote from."""


# -----------------------------------------------------------------------------
# Ask kerfpath: in this Python, or in another one over a pipe.


def in_process(request):
    """Return the answer to a request by the kerfpath that is installed in this Python."""
    from kerfpath.pipe import answer

    return answer(request)


class Process:
    """Another Python, in which kerfpath is installed, that answers requests over a pipe.

    It is started with the first request, and again where it has ended.

    Parameters
    ----------
    python : str
        Path of that Python, as ".venv/bin/python" or "C:/kerfpath/Scripts/python.exe".
    seconds : float s, optional
        Time limit of an answer; the process is ended beyond it. Default: none.
    """

    def __init__(self, python, seconds=None):
        self._command = [str(python), "-I", "-m", "kerfpath.pipe"]
        self._seconds, self._running, self._said = seconds, None, deque(maxlen=LAST_LINES)

    def __call__(self, request):
        """Return the answer to a request.

        Raises
        ------
        MotionPlanningError
            The process does not start, has ended or takes too long; with its last line.
        """
        running = self._started()
        timer = None
        if self._seconds is not None:
            timer = threading.Timer(self._seconds, running.kill)
            timer.start()
        try:
            running.stdin.write(json.dumps(request) + "\n")
            running.stdin.flush()
            line = running.stdout.readline()
        except OSError:
            line = ""
        finally:
            if timer is not None:
                timer.cancel()
        if not line:
            self.close()
            last = self._said[-1] if self._said else "it said nothing"
            raise MotionPlanningError(
                "kerfpath: the process {} ended without an answer: {}".format(
                    self._command[0], last
                )
            )
        return json.loads(line)

    def close(self):
        """End the process."""
        running, self._running = self._running, None
        if running is not None:
            running.kill()
            running.wait()
            running.stdin.close()
            running.stdout.close()

    def _started(self):
        if self._running is not None and self._running.poll() is None:
            return self._running
        self.close()
        self._said.clear()
        surroundings = {k: v for k, v in os.environ.items() if k not in FOREIGN}
        try:
            self._running = subprocess.Popen(
                self._command,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                universal_newlines=True,
                encoding="utf-8",
                env=surroundings,
                creationflags=0x08000000 if sys.platform == "win32" else 0,  # no window
            )
        except OSError as error:
            raise MotionPlanningError(
                "kerfpath: expected the path of a Python with kerfpath, got {} ({})".format(
                    self._command[0], error
                )
            ) from None
        threading.Thread(target=self._listen, args=(self._running.stderr,), daemon=True).start()
        return self._running

    def _listen(self, stream):
        with stream:
            for line in stream:
                if line.strip():
                    self._said.append(line.strip())


# -----------------------------------------------------------------------------
# The client and the planner of COMPAS FAB.


class KerfpathClient(ClientInterface):
    """The client of kerfpath: the values that COMPAS FAB has no place for, and where it runs.

    Parameters
    ----------
    python : str, optional
        Path of a Python in which kerfpath is installed, which is run as a process. Default: the
        kerfpath of this Python.
    acceleration : float rad/s^2, or one for each joint
        Acceleration limits of the joints, which robot models do not have: there is no default.
    speed : float m/s
        Speed along the waypoints, unless the options of a motion have another one.
    gamma_step : float rad
        Step of the free rotation about the tool axis, for `PointAxisWaypoints`.
    seconds : float s, optional
        Time limit of an answer of the process. Default: none.
    """

    def __init__(
        self, python=None, *, acceleration, speed=0.1, gamma_step=GAMMA_STEP, seconds=None
    ):
        super().__init__()
        self.speed, self.acceleration, self.gamma_step = speed, acceleration, gamma_step
        self.ask = in_process if python is None else Process(python, seconds)

    def close(self):
        """End the process, if there is one."""
        if isinstance(self.ask, Process):
            self.ask.close()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()


class KerfpathPlanner(SetRobotCell, SetRobotCellState, PlanCartesianMotion, PlannerInterface):
    """The planner: Cartesian motions along `PointAxisWaypoints` and `FrameWaypoints`.

    Along `PointAxisWaypoints` the rotation about the tool axis, the posture and the turns of the
    joints are chosen so that the joints move least within their velocity and acceleration limits.
    """

    def __init__(self, client):
        super().__init__()
        self._client = client

    def set_robot_cell(self, robot_cell, robot_cell_state=None, options=None):
        """Set the robot cell, and its state if one is given."""
        self.client._robot_cell = robot_cell
        if robot_cell_state is not None:
            self.set_robot_cell_state(robot_cell_state)

    def set_robot_cell_state(self, robot_cell_state, options=None):
        """Set the state of the robot cell, which must be of its tools and bodies."""
        self.client.robot_cell.assert_cell_state_match(robot_cell_state)
        self.client._robot_cell_state = robot_cell_state

    def plan_cartesian_motion(self, waypoints, start_state, group=None, options=None):
        """Return the trajectory from the start state to the first waypoint and along all.

        Its first point is the start configuration. The tool moves to the first waypoint as the
        joints need least time, around what is in the way, stops there, and follows the waypoints,
        straight from one to the next, at the speed of the client but for its start and its end.

        Parameters
        ----------
        waypoints : PointAxisWaypoints or FrameWaypoints
            In the world frame.
        start_state : RobotCellState
            With the full configuration of the robot, and names.
        group : str, optional
            Default: the main planning group.
        options : dict, optional
            ``speed`` (m/s), ``check_collision`` (default True; the meshes of the robot must be
            loaded) and ``max_step_distance`` (m, default 0.01), the largest distance of two points;
            others are ignored.

        Returns
        -------
        JointTrajectory
            With times, velocities and accelerations; ``attributes["waypoints"]`` has the numbers of
            the points at the waypoints, ``attributes["speed"]`` (m/s) and
            ``attributes["acceleration"]`` (rad/s^2) what was planned with.

        Raises
        ------
        MPStartStateInCollisionError, MPNoIKSolutionError, MPNoPlanFoundError, MotionPlanningError
            The robot collides at the start; a waypoint is out of reach; there is no motion; or the
            robot or a value is not as expected.
        BackendTargetNotSupportedError
            Other waypoints.
        """
        if not isinstance(waypoints, (PointAxisWaypoints, FrameWaypoints)):
            raise BackendTargetNotSupportedError(
                "kerfpath: expected PointAxisWaypoints or FrameWaypoints, got {}".format(
                    type(waypoints).__name__
                )
            )
        cell, options = self.client.robot_cell, options or {}
        group = group or cell.main_group_name
        start_state.assert_target_mode_match(waypoints.target_mode, group)
        configuration = start_state.robot_configuration
        if not configuration or not configuration.joint_names:
            raise ValueError("start_state.robot_configuration: expected values and joint_names")
        cell.assert_cell_state_match(start_state)
        request = request_of(self.client, waypoints.normalized_to_meters(), start_state, group)
        request["speed"] = options.get("speed", self.client.speed)
        request["max_step"] = options.get("max_step_distance", 0.01)
        check = options.get("check_collision", options.get("avoid_collisions", True))
        if check:
            request["cell"] = cell_of(cell, start_state, group, request)
        found = self.client.ask(request)
        if "error" in found:
            raise _error(found, waypoints, start_state)
        kept = {name: request[name] for name in ("speed", "acceleration")}
        return _trajectory(found | kept, cell, group, start_state)


# -----------------------------------------------------------------------------
# The request.


def request_of(client, waypoints, state, group):
    """Return the request of a motion as plain data, without the bodies around: m, rad, s."""
    cell, configuration = client.robot_cell, state.robot_configuration
    model, base = cell.robot_model, cell.get_base_link_name(group)
    root = Transformation.from_frame(state.robot_base_frame)
    names = _chain(model, base, cell.get_end_effector_link_name(group))
    frame = model.forward_kinematics(configuration, link_name=base)
    if isinstance(waypoints, FrameWaypoints):
        frames = waypoints.target_frames
        points, axes = [f.point for f in frames], [f.zaxis for f in frames]
        x = [list(f.xaxis) for f in frames]
    else:
        points, axes = zip(*waypoints.target_points_and_axes)
        x = None
    return {
        "urdf": _text(model.to_urdf_string()),
        "base": base,
        "tip": cell.get_end_effector_link_name(group),
        "joints": names,
        "start": [configuration[name] for name in names],
        "acceleration": client.acceleration,
        "gamma_step": client.gamma_step,
        "T_world_base": _rows(root * Transformation.from_frame(frame)),
        "T_flange_tip": _rows(_tip(cell, state, waypoints.target_mode, group)),
        "points": [list(p) for p in points],
        "axes": [list(a) for a in axes],
        "x": x,
        "name": waypoints.name if waypoints.name != type(waypoints).__name__ else "waypoints",
    }


def cell_of(cell, state, group, request):
    """Return what the robot may collide with: meshes of links, tools and bodies, and their poses.

    Bodies that are attached to a link become meshes of this link in the description of `request`.
    """
    model = cell.robot_model
    meshes = {}
    for link in model.links:
        for item in link.collision:
            shape = item.geometry.shape
            if hasattr(shape, "filename") and shape.filename not in meshes:
                meshes[shape.filename] = _mesh(LinkGeometry._get_item_meshes(item) or [])
    if not meshes or not all(mesh["triangles"] for mesh in meshes.values()):
        raise MotionPlanningError(
            "kerfpath: the robot has no geometry to check collisions with; load it, or give the "
            "option check_collision False"
        )
    T_world_root = Transformation.from_frame(state.robot_base_frame)
    bodies = []
    for name, tool in cell.tool_models.items():
        of = state.tool_states[name]
        if of.is_hidden:
            continue
        held = of.attached_to_group == group
        if held:
            T = Transformation.from_frame(of.attachment_frame or Frame.worldXY())
        elif of.attached_to_group:
            T = T_world_root * _at_tip(cell, state, of.attached_to_group)
            T = T * Transformation.from_frame(of.attachment_frame or Frame.worldXY())
        else:
            T = Transformation.from_frame(of.frame)
        bodies += _bodies(name, _tool_meshes(tool, of), T, held, of.touch_links)
    for name, body in cell.rigid_body_models.items():
        of = state.rigid_body_states[name]
        if of.is_hidden:
            continue
        attached = Transformation.from_frame(of.attachment_frame or Frame.worldXY())
        held, tool = False, of.attached_to_tool
        if of.attached_to_link:
            frame = model.forward_kinematics(
                state.robot_configuration, link_name=of.attached_to_link
            )
            held = of.attached_to_link == request["tip"]
            if not held and of.attached_to_link in _moved(model, request):
                raise MotionPlanningError(
                    "kerfpath: {} is attached to link {}; expected the last link {}, a tool, or no "
                    "link that moves".format(name, of.attached_to_link, request["tip"])
                )
            T = attached if held else T_world_root * Transformation.from_frame(frame) * attached
        elif tool:
            of_group = state.tool_states[tool].attached_to_group
            T, held = cell.t_pcf_ocf(state, name), of_group == group
            T = T if held else T_world_root * _at_tip(cell, state, of_group) * T
        else:
            T = Transformation.from_frame(of.frame)
        touch = list(of.touch_links) + list(of.touch_bodies)
        found = [(mesh, None) for mesh in body.collision_meshes_in_meters]
        bodies += _bodies(name, found, T, held, touch)
    pairs = cell.robot_semantics.disabled_collisions or []
    return {"meshes": meshes, "bodies": bodies, "disabled": [list(pair) for pair in pairs]}


def _bodies(name, meshes, T, held, touch):
    """Return a body for each mesh, in the flange frame if it is held, else in the world."""
    return [
        {
            "name": name if k == 0 else "{} {}".format(name, k + 1),
            "of": name,
            "mesh": _mesh([mesh]),
            "T": _rows(T if own is None else T * own),
            "held": held,
            "touch": list(touch),
        }
        for k, (mesh, own) in enumerate(meshes)
    ]


def _tool_meshes(tool, state):
    """Return the meshes of a tool, each with its pose in the frame of the tool's base."""
    found = []
    for link in tool.links:
        configuration = state.configuration or tool.zero_configuration()
        frame = tool.forward_kinematics(configuration, link_name=link.name)
        T = Transformation.from_frame(frame)
        for item in link.collision:
            own = T * Transformation.from_frame(item.origin) if item.origin else T
            found += [(mesh, own) for mesh in LinkGeometry._get_item_meshes(item)]
    return found


def _tip(cell, state, mode, group):
    """Return the pose of what the waypoints are for, in the frame of the group's last link."""
    if mode == TargetMode.TOOL:
        return cell.t_pcf_tcf(state, state.get_attached_tool_id(group))
    if mode == TargetMode.WORKPIECE:
        return cell.t_pcf_ocf(state, state.get_attached_workpiece_ids(group)[0])
    return Transformation()


def _at_tip(cell, state, group):
    link = cell.get_end_effector_link_name(group)
    frame = cell.robot_model.forward_kinematics(state.robot_configuration, link_name=link)
    return Transformation.from_frame(frame)


def _path(model, base, tip):
    """Return the joints from link `base` to link `tip`."""
    parents = {joint.child.link: joint for joint in model.joints}
    path, link = [], tip
    while link != base:
        if link not in parents:
            raise MotionPlanningError(
                "kerfpath: no joints lead from link {} to link {}".format(base, tip)
            )
        path.append(parents[link])
        link = parents[link].parent.link
    return path[::-1]


def _chain(model, base, tip):
    """Return the names of the moving joints from link `base` to link `tip`."""
    return [joint.name for joint in _path(model, base, tip) if joint.type in MOVING]


def _moved(model, request):
    """Return the links that the joints of a request move."""
    path, moving = _path(model, request["base"], request["tip"]), set()
    for k, joint in enumerate(path):
        if any(one.type in MOVING for one in path[: k + 1]):
            moving.add(joint.child.link)
    return moving


def _mesh(meshes):
    """Return the vertices and triangles of meshes together."""
    vertices, triangles = [], []
    for mesh in meshes:
        points, faces = mesh.to_vertices_and_faces(triangulated=True)
        triangles += [[i + len(vertices) for i in face] for face in faces]
        vertices += [list(p) for p in points]
    return {"vertices": vertices, "triangles": triangles}


def _rows(T):
    return [list(row) for row in T.matrix]


def _text(said):
    return said.decode("utf-8") if isinstance(said, bytes) else said


# -----------------------------------------------------------------------------
# The answer.


def _error(found, waypoints, state):
    """Return the error of COMPAS FAB for an answer without a motion."""
    said = "kerfpath: {}".format(found["message"])
    if found["error"] == "start":
        return MPStartStateInCollisionError(said, start_state=state)
    if found["error"] == "reach":
        every = (
            waypoints.target_frames
            if isinstance(waypoints, FrameWaypoints)
            else waypoints.target_points_and_axes
        )
        return MPNoIKSolutionError(said, target=every[found["waypoint"]])
    return (MPNoPlanFoundError if found["error"] == "path" else MotionPlanningError)(said)


def _trajectory(found, cell, group, state):
    names = cell.get_configurable_joint_names(group)
    types = cell.get_configurable_joint_types(group)
    every, configuration = found["joints"], state.robot_configuration

    def of_group(values, rest):
        known = dict(zip(every, values))
        return [known[name] if name in known else rest(name) for name in names]

    points = []
    for q, v, a, t in zip(found["q"], found["v"], found["a"], found["time"]):
        seconds = int(t)
        points.append(
            JointTrajectoryPoint(
                joint_values=of_group(q, lambda name: configuration[name]),
                joint_types=types,
                velocities=of_group(v, lambda name: 0.0),
                accelerations=of_group(a, lambda name: 0.0),
                time_from_start=Duration(seconds, round((t - seconds) * 1e9)),
                joint_names=names,
            )
        )
    return JointTrajectory(
        trajectory_points=points,
        joint_names=names,
        start_state=state,
        fraction=1.0,
        attributes={
            "planner": "kerfpath",
            "planning_time": found["seconds"],
            "waypoints": found["waypoints"],
            "cost": found["cost"],
            "speed": found["speed"],
            "acceleration": found["acceleration"],
        },
    )
