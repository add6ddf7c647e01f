"""A goal of the action Plan, planned: its result and trajectories as fields of messages."""

from __future__ import annotations

import json
import os
import subprocess
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from kerfpath.arrays import Array, floats, scalar, short_repr
from kerfpath.errors import InputError
from kerfpath.isolated import clean_environment, python_command
from kerfpath.pipe import answer
from kerfpath.ros.scene import around_robot, pose
from kerfpath.urdf import Group, Semantics, read_semantics

SUCCESS, FAILURE, INVALID_GROUP_NAME, PREEMPTED = 1, 99999, -15, -7
CODES = {"start": -10, "end": -12, "reach": -31, "path": -1, "input": FAILURE}
"""Values of moveit_msgs/MoveItErrorCodes for the errors of `kerfpath.pipe.answer`."""
STEP = 0.01
"""m: largest distance of two points of a trajectory, unless the goal has another one."""
LOOK = 0.1
"""s between two looks whether a goal is cancelled."""
APART = (
    "from kerfpath.isolated import end_with; end_with({}); "
    "from kerfpath.pipe.__main__ import main; main()"
)
"""What a process runs that plans a goal; it ends with the process of this number."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Setting:
    """The robot, and what a goal does not say.

    Parameters
    ----------
    urdf, srdf : Path
        Its description and the semantic one.
    acceleration : float or (n,) rad/s^2
        Limits of the joints, which descriptions do not have.
    packages : mapping of str to str
        Folder of each ROS package that the description's meshes are in.
    gamma_step : float rad
        Step of the free rotation about the tool axis.
    """

    urdf: Path
    srdf: Path
    acceleration: float | Array
    packages: Mapping[str, str] = field(default_factory=dict)
    gamma_step: float = float(np.radians(10))

    __repr__ = short_repr


def plan_goal(
    goal: Any, setting: Setting, cancelled: Callable[[], bool] | None = None
) -> dict[str, Any]:
    """Return the fields of a result of the action Plan.

    Parameters
    ----------
    goal : kerfpath_msgs/action/Plan_Goal
        See ``examples/ros/kerfpath_msgs/action/Plan.action``.
    setting : Setting
    cancelled : callable, optional
        Says whether the goal is cancelled. The goal is then planned in a process of its own, which
        is ended when it is, and the error code is that of a goal that was preempted. Default: the
        goal is planned in this process, to its end.

    Returns
    -------
    dict
        "error_code" (moveit_msgs/MoveItErrorCodes), "message", and "trajectory"
        (moveit_msgs/RobotTrajectory; without points where there is none). It never raises for what
        a goal or a description says.
    """
    try:
        semantics = read_semantics(setting.srdf, setting.urdf)
    except InputError as error:
        return _result(FAILURE, str(error))
    try:
        group = semantics.group(goal.group)
    except InputError as error:
        return _result(INVALID_GROUP_NAME, str(error))
    try:
        request = _request(goal, setting, semantics, group)
    except InputError as error:
        return _result(FAILURE, str(error))
    found = answer(request) if cancelled is None else _answered_apart(request, cancelled)
    if found is None:
        return _result(PREEMPTED, "the goal was cancelled")
    if "error" in found:
        return _result(CODES[found["error"]], found["message"])
    said = f"cost {found['cost']:.6g}, planned in {found['seconds']:.2f} s"
    frame = next(name for name, T in semantics.frames.items() if np.array_equal(T, np.eye(4)))
    return _result(SUCCESS, said) | {"trajectory": robot_trajectory(found, frame)}


def _result(code: int, message: str) -> dict[str, Any]:
    return {"error_code": {"val": code}, "message": message, "trajectory": {}}


def _answered_apart(
    request: Mapping[str, Any], cancelled: Callable[[], bool]
) -> dict[str, Any] | None:
    """Return the answer of another process; None if that was ended as the goal was cancelled."""
    running = subprocess.Popen(
        python_command(APART.format(os.getpid())),
        env=clean_environment(),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        encoding="utf-8",
    )
    asked: str | None = json.dumps(request) + "\n"
    try:
        while not cancelled():
            with suppress(subprocess.TimeoutExpired):
                said, _ = running.communicate(asked, timeout=LOOK)
                if not said:
                    why = f"the planning process ended with exit code {running.returncode}"
                    return {"error": "input", "message": why}
                answered: dict[str, Any] = json.loads(said)
                return answered
            asked = None  # it is being sent
        return None
    finally:
        running.kill()
        running.communicate()


def _request(goal: Any, setting: Setting, semantics: Semantics, group: Group) -> dict[str, Any]:
    """Return the request of a goal: m, rad, s, in the root link of the description."""
    frames = semantics.frames
    for name, frame in (("frame of the points", goal.header.frame_id), ("base", group.base)):
        if frame not in frames:
            raise InputError(
                f"{name}: expected a link that no joint moves, or what the robot is fixed to "
                f"({', '.join(frames)}), got {frame!r}"
            )
    T, names = frames[goal.header.frame_id], list(group.joints)
    points = floats([(p.x, p.y, p.z) for p in goal.points], "points", (None, 3))
    axes = floats([(a.x, a.y, a.z) for a in goal.axes], "axes", (len(points), 3))
    request = {
        "file": str(setting.urdf),
        "packages": dict(setting.packages),
        "base": group.base,
        "tip": group.tip,
        "joints": names,
        "start": _start(goal, group),
        "end": _state(goal.end_state, group) if goal.end_state else None,
        "acceleration": np.asarray(setting.acceleration, float).tolist(),
        "gamma_step": setting.gamma_step,
        "T_world_base": frames[group.base].tolist(),
        "T_flange_tip": pose(goal.tip, "tip").tolist(),
        "points": (points @ T[:3, :3].T + T[:3, 3]).tolist(),
        "axes": (axes @ T[:3, :3].T).tolist(),
        "x": None,
        "name": "goal",
        "speed": goal.speed,
        "max_step": scalar(goal.max_step or STEP, "max_step", unit="m", above=0.0),
    }
    if goal.check_collisions:
        request["cell"] = around_robot(goal.scene, semantics, group)
    return request


def _start(goal: Any, group: Group) -> list[float]:
    """Return the joints at the start: a named state, else those of the goal, else of the scene."""
    if goal.start_state:
        return _state(goal.start_state, group)
    here = goal.start if len(goal.start.name) else goal.scene.robot_state.joint_state
    if len(here.name) != len(here.position):
        raise InputError("start: expected a position for each name")
    known = dict(zip(here.name, map(float, here.position), strict=True))
    if missing := [name for name in group.joints if name not in known]:
        raise InputError(f"start: expected a position of joint {missing[0]!r}, got none")
    return [known[name] for name in group.joints]


def _state(name: str, group: Group) -> list[float]:
    if name not in group.states:
        known = ", ".join(group.states) or "none"
        raise InputError(f"state: expected one of group {group.name!r} ({known}), got {name!r}")
    return [float(value) for value in group.states[name]]


# -----------------------------------------------------------------------------
# Trajectories.


def robot_trajectory(found: Mapping[str, Any], frame: str = "") -> dict[str, Any]:
    """Return an answer of `kerfpath.pipe` as the fields of a moveit_msgs/RobotTrajectory."""
    points = [
        {"positions": q, "velocities": v, "accelerations": a, "time_from_start": _duration(t)}
        for q, v, a, t in zip(found["q"], found["v"], found["a"], found["time"], strict=True)
    ]
    header = {"frame_id": frame}
    joints = list(found["joints"])
    return {"joint_trajectory": {"header": header, "joint_names": joints, "points": points}}


def display_trajectory(trajectory: Mapping[str, Any], model: str) -> dict[str, Any]:
    """Return the fields of a moveit_msgs/DisplayTrajectory, which RViz plays.

    Parameters
    ----------
    trajectory : mapping
        As of `robot_trajectory`.
    model : str
        Name of the robot in its description.
    """
    joints = trajectory["joint_trajectory"]
    first = {"name": joints["joint_names"], "position": joints["points"][0]["positions"]}
    return {
        "model_id": model,
        "trajectory": [trajectory],
        "trajectory_start": {"joint_state": first},
    }


def _duration(seconds: float) -> dict[str, int]:
    whole, nano = divmod(round(seconds * 1e9), 10**9)
    return {"sec": whole, "nanosec": nano}
