"""Paths planned by COMPAS FAB's planners and by kerfpath's backend for it.

It needs an environment of its own: ``uv pip install -r requirements/dev.txt -r
requirements/compas.txt pybullet==3.2.7 --no-deps --editable .``, then ``python -m benchmarks
compas``.
"""

from __future__ import annotations

import copy
from collections.abc import Callable
from statistics import median
from time import process_time
from typing import Any, NamedTuple

import numpy as np

from benchmarks._figures import Report, Sheet
from kerfpath.arrays import Array

__all__ = ["run"]

SPEED, ACCELERATION = 0.15, 8.0
"""m/s along the path, and rad/s^2 of every joint."""
WAYPOINTS = 100
UR = [0.3, -1.6, 1.7, -1.6, -1.5, 0.1]
ROBOTS = {
    "ur5_cone_tool": ([0.45, 0.1, 0.25], UR),
    "ur10e": ([0.6, 0.2, 0.35], UR),
    "abb_irb4600_40_255": ([1.3, 0.2, 0.9], [0.0] * 6),
}
"""Cells of COMPAS FAB's library: middle of the circles, m, and a configuration far from them."""
SETTINGS = ("good start", "bad start", "in a cell")

HOW = f"""\
Circles of 60 to 120 mm about random places near the middle of the robot's reach, with the tool
pointing down, {WAYPOINTS} waypoints, at {SPEED} m/s; the same PointAxisWaypoints, start states and
robot cells (COMPAS FAB's library, its meshes) for both. Good start: where kerfpath's own path
begins from the bad start (PyBullet then gets the waypoints after the first: it fails where
the start is the first); bad start: a fixed one away from the circle; in a cell: from there,
collisions checked, with a post beside the circle. kerfpath: `kerfpath.compas`, in the same Python,
gamma in steps of 10 deg, compiled before. PyBullet: its planner with its defaults.
The analytical planner of COMPAS FAB raises NotImplementedError for PointAxisWaypoints, and fails
for FrameWaypoints (2.0.1). Errors inside PyBullet count as no path. Within limits: planned, and no
joint beyond its limit or its speed between waypoints. Speed: the largest share of a joint's speed
limit. Travel: sum of all joint movements from the first waypoint to the last. s: processor time,
median and longest."""


class _Found(NamedTuple):
    """One answer: joints (K, n) at the waypoints, None without a path, and processor time, s."""

    q: Array | None
    seconds: float


def run(*, quick: bool) -> list[Report]:
    """Plan the same circles by both planners."""
    import pybullet  # noqa: F401  # says early what is missing
    from compas_fab.backends import PyBulletClient, PyBulletPlanner

    circles, rows = (1 if quick else 2), list[list[str]]()
    with PyBulletClient("direct") as theirs:
        for name in ROBOTS:
            for setting in SETTINGS:
                found: dict[str, list[_Found]] = {"kerfpath": [], "PyBullet": []}
                steps, limits = list[float](), np.zeros(6)
                for seed in range(circles):
                    task = _Task(name, setting, seed, PyBulletPlanner(theirs))
                    limits = task.velocity
                    if not seed:
                        task.ours()  # compile
                    found["kerfpath"].append(task.ours())
                    found["PyBullet"].append(task.theirs())
                    steps.append(task.step)
                rows += [
                    [name, setting, who, *_judged(answers, steps, limits)]
                    for who, answers in found.items()
                ]
    heads = ("robot", "setting", "planner", "within limits", "speed", "travel rad", "s", "longest")
    title = f"COMPAS FAB: {circles * len(ROBOTS) * len(SETTINGS)} circles beside PyBullet"
    return [Report(title=title, how=HOW, sheets=[Sheet(columns=heads, rows=rows, words=3)])]


def _judged(answers: list[_Found], steps: list[float], velocity: Array) -> list[str]:
    good, speeds, travels = 0, list[float](), list[float]()
    for found, step in zip(answers, steps, strict=True):
        if found.q is None:
            continue
        dq = np.abs(np.diff(found.q, axis=0))
        share = float((dq / (step / SPEED) / velocity).max())
        good += share <= 1 + 1e-6
        speeds.append(share)
        travels.append(float(dq.sum()))
    seconds = [found.seconds for found in answers]
    return [
        f"{good} of {len(answers)}",
        f"{max(speeds):.2f}" if speeds else "-",
        f"{median(travels):.2f}" if travels else "-",
        f"{median(seconds):.2f}",
        f"{max(seconds):.2f}",
    ]


class _Task:
    """A circle in a robot cell, for both planners."""

    def __init__(self, name: str, setting: str, seed: int, planner: Any) -> None:
        from compas.datastructures import Mesh
        from compas.geometry import Box, Frame, Point, Vector
        from compas_fab.robots import (
            PointAxisWaypoints,
            RigidBody,
            RigidBodyState,
            RobotCellLibrary,
            TargetMode,
        )

        rng = np.random.default_rng(seed)
        middle, away = ROBOTS[name]
        self.cell, self.state = getattr(RobotCellLibrary, name)(load_geometry=True)
        self.state.robot_configuration.joint_values = away
        at, radius = np.array(middle) + rng.uniform(-0.05, 0.05, 3), rng.uniform(0.06, 0.12)
        turn = np.linspace(0, 2 * np.pi, WAYPOINTS)
        points = at + radius * np.c_[np.cos(turn), np.sin(turn), 0 * turn]
        self.step = float(np.linalg.norm(points[1] - points[0]))
        self.axes = [(Point(*p), Vector(0, 0, -1)) for p in points.tolist()]
        self.mode = TargetMode.TOOL if self.cell.tool_models else TargetMode.ROBOT
        self.waypoints = PointAxisWaypoints(self.axes, self.mode)
        self.checked = setting == "in a cell"
        if self.checked:
            post = Mesh.from_shape(Box(0.1, 0.1, 2 * float(at[2])))
            self.cell.rigid_body_models["post"] = RigidBody.from_mesh(post)
            where = Frame([float(at[0]), float(at[1] + radius + 0.25), 0], [1, 0, 0], [0, 1, 0])
            self.state.rigid_body_states["post"] = RigidBodyState(where)
        self.planner = planner
        planner.set_robot_cell(self.cell, self.state)
        self.velocity = np.array([j.limit.velocity for j in self.cell.get_configurable_joints()])
        self.is_there = setting == "good start"
        if self.is_there:
            self._start_at_the_first_waypoint()

    def _start_at_the_first_waypoint(self) -> None:
        found = self.ours().q
        assert found is not None, "the circles are within reach"
        self.state.robot_configuration.joint_values = found[0].tolist()

    def ours(self) -> _Found:
        from kerfpath.compas import KerfpathClient, KerfpathPlanner

        make_client: Any = KerfpathClient  # untyped, as what it handles
        planner: Any = KerfpathPlanner
        planner = planner(make_client(speed=SPEED, acceleration=ACCELERATION))
        planner.set_robot_cell(self.cell, self.state)
        return self._timed(planner)

    def theirs(self) -> _Found:
        return self._timed(self.planner, 1 if self.is_there else 0)

    def _timed(self, planner: Any, first: int = 0) -> _Found:
        import pybullet
        from compas_fab.backends import BackendError

        state, options = copy.deepcopy(self.state), {"check_collision": self.checked}
        waypoints = copy.deepcopy(self.waypoints)
        waypoints.target_points_and_axes = self.axes[first:]
        plan: Callable[..., Any] = planner.plan_cartesian_motion
        begun = process_time()
        try:
            trajectory = plan(waypoints, state, options=options)
        except (BackendError, pybullet.error):
            return _Found(None, process_time() - begun)
        seconds = process_time() - begun
        q = np.array([list(point.joint_values) for point in trajectory.points])
        at = trajectory.attributes.get("waypoints")
        return _Found(q[at] if at else q[-WAYPOINTS:], seconds)
