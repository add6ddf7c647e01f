"""ROS trajectories as YAML: this module only formats.

One file is the message: joints, their velocities and accelerations over time, in rad and s. The
other lists, on the same clock, when each move and wait is done and what is switched.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Annotated, TypedDict

import numpy as np

from kerfpath._arrays import Array, Ints
from kerfpath.post._divide import require_one_file
from kerfpath.post._external import setup_remarks
from kerfpath.post._formatter import Formatter, number, plain
from kerfpath.post._orientations import quaternions
from kerfpath.post._program import JointMove, LinearMove, Program, Wait
from kerfpath.post._settings import LanguageSettings, LinesPerFile, Rules, setting
from kerfpath.post.ros._trajectory import Trajectory, rates, trajectory
from kerfpath.robots import Robot, joint_identifiers

__all__ = ["Message", "Ros", "RosSettings", "head", "joint_names", "message", "rules"]

DECIMALS = {"positions": 10, "velocities": 6, "accelerations": 6}
SECOND = 1_000_000_000
"""One second in ns."""


class Time(TypedDict):
    """A time or a duration: builtin_interfaces/Time and Duration."""

    sec: int
    nanosec: int


class Header(TypedDict):
    """std_msgs/Header."""

    stamp: Time
    frame_id: str


class Point(TypedDict):
    """trajectory_msgs/JointTrajectoryPoint; rad, rad/s, rad/s^2; linear axes are in m."""

    positions: list[float]
    velocities: list[float]
    accelerations: list[float]
    effort: list[float]
    time_from_start: Time


class Message(TypedDict):
    """trajectory_msgs/JointTrajectory."""

    header: Header
    joint_names: list[str]
    points: list[Point]


class RosSettings(LanguageSettings):
    """Joint names of the robot's driver, and the time between points."""

    lines_per_file: LinesPerFile = 1_000_000
    joint_names: Annotated[
        list[str] | None, setting("a list of joint names", '["joint_1", "joint_2"]')
    ] = None
    step_ms: Annotated[float, setting("a number from 1 to 1000, in ms", "20", ge=1, le=1000)] = 20.0


def rules(settings: RosSettings) -> Rules:
    """Return the rules of trajectories."""
    return Rules(slowest=1e-6, angle_step=0.5e-9)


def joint_names(robot: Robot, settings: RosSettings) -> list[str]:
    """Return the names of all joints: those of the settings, or those of `Robot.to_urdf`."""
    return settings.joint_names or joint_identifiers(robot)


def head(names: list[str]) -> list[str]:
    """Return the lines of the message before its points."""
    return [
        "header:",
        "  stamp: {sec: 0, nanosec: 0}",
        '  frame_id: ""',
        f"joint_names: {json.dumps(names)}",
        "points:",
    ]


class Ros(Formatter):
    """Formatter of the message, and of its events."""

    settings: RosSettings

    def files(self) -> dict[str, str]:
        """Return the trajectory and its events."""
        program, most = self.program, self.settings.lines_per_file
        motion = trajectory(program, self.settings.step_ms * 1e-3)
        self._ends = iter((_ns(motion.time[motion.done]) / SECOND).tolist())
        name = program.name
        return require_one_file(f"{name}.yaml", [*self._message(motion)], most) | require_one_file(
            f"{name}.events.yaml", [*self._events()], most
        )

    def _message(self, motion: Trajectory) -> Iterator[str]:
        program, robot = self.program, self.program.robot
        message = (
            "A trajectory_msgs/JointTrajectory; rad and s. Bring the robot to its first point."
        )
        yield from (f"# {remark}" for remark in self.head(message))
        yield from (f"# {plain(remark)}" for remark in setup_remarks(robot, si=True))
        yield f"# What is switched when is in {program.name}.events.yaml."
        yield from head(joint_names(robot, self.settings))
        rows, ns = _rows(motion)
        fields = (
            f"{name}: [{', '.join([f'%.{decimals}f'] * robot.joints)}]"
            for name, decimals in DECIMALS.items()
        )
        text = f"- {{{', '.join(fields)}, effort: [], time_from_start: {{sec: %d, nanosec: %d}}}}"
        for row, time in zip(rows.tolist(), ns.tolist(), strict=True):
            yield text % (*row, *divmod(time, SECOND))

    def _events(self) -> Iterator[str]:
        program = self.program
        yield "# When, in s on the clock of the trajectory, moves and waits are done, and what is"
        yield "# switched. Frames: x, y, z in m, and a quaternion w, x, y, z."
        yield "# A stop does not switch the laser off: the safety circuit of the cell has to."
        yield f"trajectory: {program.name}.yaml"
        yield f"tip_in_flange: {_frame(program.T_flange_tip)}"
        yield f"part_in_base: {_frame(program.T_base_part)}"
        yield "events:"
        for section in program.sections:
            yield f'- {{section: "{section.name}"}}'
            yield from self.lines(section)

    def names(self) -> list[tuple[str, str]]:
        """Return the name of the files and those of the joints."""
        joints = joint_names(self.program.robot, self.settings)
        return [(self.program.name, "the program"), *((name, "a joint") for name in joints)]

    def joint_move(self, move: JointMove) -> Iterator[str]:
        """Yield the time when a joint move is done."""
        yield self._done("joint")

    def linear_move(self, move: LinearMove) -> Iterator[str]:
        """Yield the time when a linear move is done, and the switches by then."""
        end = next(self._ends)
        yield _event(end, "done: linear")
        for switch in move.switches:
            to = "true" if switch.on else "false"
            yield _event(end - switch.lead_time, f"set: {switch.signal}, to: {to}")

    def wait(self, wait: Wait) -> Iterator[str]:
        """Yield the time when a wait is done."""
        yield self._done("wait")

    def comment(self, text: str) -> Iterator[str]:
        """Yield a comment."""
        yield f"# {text}"

    def _done(self, kind: str) -> str:
        return _event(next(self._ends), f"done: {kind}")


def message(program: Program, settings: RosSettings) -> Message:
    """Return the fields of the message that `Ros` writes for a program."""
    rows, ns = _rows(trajectory(program, settings.step_ms * 1e-3))
    parts = [part.tolist() for part in np.split(rows, len(DECIMALS), axis=1)]
    return {
        "header": {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""},
        "joint_names": joint_names(program.robot, settings),
        "points": [
            {
                "positions": q,
                "velocities": velocity,
                "accelerations": acceleration,
                "effort": [],
                "time_from_start": {"sec": time // SECOND, "nanosec": time % SECOND},
            }
            for q, velocity, acceleration, time in zip(*parts, ns.tolist(), strict=True)
        ],
    }


def _rows(motion: Trajectory) -> tuple[Array, Ints]:
    """Return positions, velocities and accelerations of points (K, 3n), and times (K,) ns."""
    ns = _ns(motion.time)
    columns = zip(
        DECIMALS.values(), (motion.q, *rates(ns / SECOND, motion.q, motion.stops)), strict=True
    )
    return np.hstack([values.round(decimals) + 0.0 for decimals, values in columns]), ns


def _ns(time: Array) -> Ints:
    return np.round(time * SECOND).astype(np.int64)


def _event(time: float, what: str) -> str:
    return f"- {{time: {number(time, 9)}, {what}}}"


def _frame(T: Array) -> str:
    values = [*T[:3, 3], *quaternions(T[None])[0]]
    return f"[{', '.join(number(value, 9) for value in values)}]"
