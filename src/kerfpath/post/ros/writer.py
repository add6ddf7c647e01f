"""ROS trajectories as YAML: this module only formats.

One file is the message: joints, their velocities and accelerations over time, in rad and s. The
other lists, on the same clock, when each move and wait is done and what is switched.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, TypedDict

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from kerfpath.arrays import Array, Bools, Ints, freeze, short_repr
from kerfpath.auditor import Level
from kerfpath.errors import InputError
from kerfpath.plans import node_rates
from kerfpath.post.arcs import check_times, quaternions, timetable
from kerfpath.post.build import setup_remarks
from kerfpath.post.languages import (
    Formatter,
    LanguageSettings,
    LinesPerFile,
    Rules,
    number,
    plain,
    require_one_file,
    setting,
)
from kerfpath.post.program import CircularMove, JointMove, LinearMove, Program, ProgramIssue, Wait
from kerfpath.robots import Robot, base_in_part, joint_identifiers
from kerfpath.transfer import share_of_way

# -----------------------------------------------------------------------------
# A program as joints over time: sampled in moves from stop to stop, else node by node.

BRANCH = 0.5
"""Largest distance (rad) of joints from even motion on a straight move in one posture."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Trajectory:
    """Joints over time.

    Parameters
    ----------
    time : (K,) s
        Strictly increasing from 0.
    q : (K, n) rad
    stops : (K,) bool
        Whether the robot is stopped.
    done : (S,) int
        Index of the point at which each move or wait of the program ends.
    """

    time: Array
    q: Array
    stops: Bools
    done: Ints

    __repr__ = short_repr


def rates(time: Array, q: Array, stops: Bools) -> tuple[Array, Array]:
    """Return velocities and accelerations (K, n), rad/s and rad/s^2: 0 at stops.

    Elsewhere they are those of the parabola through a point and its two neighbours.
    """
    velocity, acceleration = node_rates(time, q)
    velocity[stops] = acceleration[stops] = 0.0
    return velocity, acceleration


def trajectory(program: Program, step_time: float) -> Trajectory:
    """Return the motion of a program.

    Joint moves, and path moves from stop to stop, have points every `step_time` (s) or less. Other
    path moves have one point, where they end: the nodes of the plan.

    Raises
    ------
    InputError
        A straight move leaves the robot's reach or its posture on the way.
    """
    steps = timetable(program)
    moves, tips = program.moves, program.tips(program.moves)
    time, q, stops, done = [np.zeros(1)], [moves[0].q[None]], [np.ones(1, np.bool_)], [0]
    number, standing = 0, True
    for (step, end), (_, start) in zip(steps[1:], steps, strict=False):
        before = moves[number].q
        if isinstance(step, Wait):
            share, way = np.ones(1), before[None]
        else:
            number += 1
            between_stops = standing and step.zone == 0
            count = int(np.ceil((end - start) / step_time - 1e-9)) if between_stops else 1
            share = np.arange(1, count + 1) / max(count, 1)
            if isinstance(step, JointMove):
                way = step.q - before
                far = share_of_way(np.abs(way), *program.robot.speed_limits(), share)
                way = before + far[:, None] * way
            else:
                way = _straight(program, step, before, tips[number - 1], share)
            way = np.vstack([way[:-1], step.q])
            standing = step.zone == 0
        done.append(done[-1] + (len(share) if end > start else 0))
        if end > start:
            time.append(start + (end - start) * share)
            q.append(way)
            stops.append(np.arange(len(share)) == (len(share) - 1 if standing else -1))
    return Trajectory(
        time=freeze(np.concatenate(time)),
        q=freeze(np.vstack(q)),
        stops=np.concatenate(stops),
        done=np.array(done),
    )


def _straight(
    program: Program, move: LinearMove, before: Array, T_before: Array, share: Array
) -> Array:
    """Return joints (m, n) along a straight move, after each share of its time.

    The tip speeds up and slows down as a cubic: 3 s^2 - 2 s^3 of its way after the share s.
    """
    if len(share) == 1:
        return move.q[None]
    way = (share**2 * (3 - 2 * share))[:, None]
    T = np.tile(T_before, (len(share), 1, 1))
    T[:, :3, 3] += way * (move.T_part_tip[:3, 3] - T_before[:3, 3])
    ends = Rotation.from_matrix(np.array([T_before[:3, :3], move.T_part_tip[:3, :3]]))
    T[:, :3, :3] = Slerp([0.0, 1.0], ends)(way[:, 0]).as_matrix()
    evenly = before + way * (move.q - before)
    robot, n = program.robot, program.robot.family.joints
    # Free joints move evenly; the arm sees the tip from where external axes carry it.
    seen = np.linalg.inv(base_in_part(robot.externals, evenly[:, n:])) @ program.T_base_part @ T
    # The tool's rotation about its axis counts only for arms that can choose it.
    arm = robot.alone()
    given = arm.arm.given_of(evenly)
    solved, reach = arm.arm.inverse_nodes(seen, np.zeros(1), program.T_flange_tip, given)
    apart = solved[:, 0] - evenly[:, None, :n]
    apart -= 2 * np.pi * np.round(apart / (2 * np.pi))
    off = np.where(reach[:, 0], np.abs(apart).max(axis=2), np.inf)
    if not (off.min(axis=1) < BRANCH).all():
        raise InputError("a straight move leaves the robot's reach, or its posture, on the way")
    q = evenly[:, :n] + apart[np.arange(len(share)), off.argmin(axis=1)]
    return np.hstack([q, evenly[:, n:]])


# -----------------------------------------------------------------------------
# ROS trajectories as YAML: this module only formats.

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


# -----------------------------------------------------------------------------
# Issues that only trajectories have.

NOISE = 1e-3
"""Share of a limit that rounding, and the parabola through uneven points, may add."""


def check(program: Program, settings: RosSettings) -> Iterator[ProgramIssue]:
    """Yield what a trajectory cannot express, and where it exceeds limits of the joints."""
    issues = [*check_times(program), *_check_shape(program, settings)]
    yield from issues
    if not issues:
        yield from _check_limits(program, settings)


def _check_shape(program: Program, settings: RosSettings) -> Iterator[ProgramIssue]:
    count, joints = len(joint_names(program.robot, settings)), program.robot.joints
    if count != joints:
        message = f"expected {joints} names in joint_names, got {count}"
        yield ProgramIssue("error", "joint-names", message, "program")
    steps = [(section.name, step) for section in program.sections for step in section.moves]
    for (name, move), (_, after) in zip(steps, [*steps[1:], ("", None)], strict=True):
        if isinstance(move, CircularMove):
            message = "a trajectory has no arcs; leave arcs_mm out of the job"
            yield ProgramIssue("error", "arc", message, name)
        if move.zone > 0 and not (isinstance(move, LinearMove) and isinstance(after, LinearMove)):
            message = "a corner can only be rounded between linear moves; expected a stop"
            yield ProgramIssue("error", "zone", message, name)


def _check_limits(program: Program, settings: RosSettings) -> Iterator[ProgramIssue]:
    try:
        motion = trajectory(program, settings.step_ms * 1e-3)
    except InputError as error:
        yield ProgramIssue("error", "straight", str(error), "program")
        return
    found = rates(motion.time, motion.q, motion.stops)
    words: tuple[tuple[Level, str], ...] = (("error", "velocity"), ("warning", "acceleration"))
    robot = program.robot
    limits = (robot.velocity_limits(), robot.acceleration_at(motion.q))
    for values, limit, (level, what) in zip(found, limits, words, strict=True):
        share = np.abs(values) / limit
        if share.max() > 1 + NOISE:
            k, joint = np.unravel_index(int(share.argmax()), share.shape)
            yield ProgramIssue(
                level,
                f"joint-{what}",
                f"{program.robot.joint_names[int(joint)]} needs {share.max():.0%} of its "
                f"{what} limit {motion.time[k]:.3f} s after the start",
                "program",
            )
