"""Read back the two files that `Ros` writes; anything else is refused."""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np

from kerfpath.arrays import Array, freeze
from kerfpath.errors import InputError
from kerfpath.post.arcs import pose_of
from kerfpath.post.flow import section_of
from kerfpath.post.line_reader import BLANK, LineReader, patterns, program_lines
from kerfpath.post.program import SIGNALS, Switch
from kerfpath.post.read_program import FlowStep, ReadProgram
from kerfpath.post.ros.writer import SECOND, RosSettings, head, joint_names, rates
from kerfpath.robots import Robot

OFF_LINE = 1e-8
"""Largest error (rad) of points of a joint motion, and of points of a wait."""
TIP_OFF_LINE = 2e-6
"""Largest distance (m) of the tip from a straight move."""
DIGITS = 1e-9
"""Generous rounding error (rad) of a difference of positions."""

_WHOLE = r"(?:0|[1-9]\d*)"
"""A whole number; YAML may read one that begins with 0 as octal."""
_NUMBER = rf"-?{_WHOLE}(?:\.\d+)?"
_NUMBERS = rf"\[({_NUMBER}(?:, *{_NUMBER})*)\]"
_POINT = re.compile(
    rf"- {{positions: {_NUMBERS}, velocities: {_NUMBERS}, accelerations: {_NUMBERS}, effort: \[\], "
    rf"time_from_start: {{sec: ({_WHOLE}), nanosec: (0|[1-9]\d{{0,8}})}}}}",
    re.ASCII,
)
_TIME = rf"- {{time: (-?{_WHOLE}\.\d{{9}}), "
_NAME = re.compile(r"trajectory: ([A-Za-z]\w*)\.yaml", re.ASCII)
_FRAMES = {
    what: re.compile(rf"{what}: {_NUMBERS}", re.ASCII) for what in ("tip_in_flange", "part_in_base")
}
_EVENTS = patterns(
    {
        "section": r'- {section: "([A-Za-z]\w*)"}',
        "done": _TIME + "done: (joint|linear|wait)}",
        "switch": _TIME + "set: (laser|gas|gas_2), to: (true|false)}",
    }
)


def read(main: str, files: Mapping[str, str], robot: Robot, settings: RosSettings) -> ReadProgram:
    """Return the program in a trajectory and events that `Ros` wrote; see `Reader`."""
    points = _Points(main, files[main], robot, settings)
    events = f"{main.removesuffix('.yaml')}.events.yaml"
    return _Events(events, files[events], robot, settings, points).program()


def _lines(file: str, text: str) -> list[tuple[int, str]]:
    """Return lines with their numbers, without empty lines and comments, which follow a blank."""
    numbered = enumerate(program_lines(file, text), 1)
    plain = [(n, re.sub(r"(?:^|[ \t])#.*", "", line).rstrip(BLANK)) for n, line in numbered]
    return [(n, line) for n, line in plain if line]


def _numbers(text: str, count: int, place: str) -> list[float]:
    try:
        values = [float(word) for word in text.split(",")]
    except ValueError:
        values = []
    if len(values) != count:
        raise InputError(f"{place}: expected {count} numbers, got {text[:60]!r}")
    return values


class _Points:
    """The points of the trajectory, and their lines."""

    def __init__(self, file: str, text: str, robot: Robot, settings: RosSettings) -> None:
        self.file, self.step_time = file, settings.step_ms * 1e-3
        lines = _lines(file, text)
        n = robot.joints
        expected = head(joint_names(robot, settings))
        for (number, line), word in zip([*lines, (0, "nothing")], expected, strict=False):
            if line != word:
                raise InputError(f"{file}, line {number}: expected {word!r}, got {line[:60]!r}")
        rows, ns = [], []
        self.line = [number for number, _ in lines[len(expected) :]]
        for number, line in lines[len(expected) :]:
            place = f"{file}, line {number}"
            if (match := _POINT.fullmatch(line)) is None:
                raise InputError(f"{place}: not a point of a trajectory: {line[:60]!r}")
            rows.append([value for k in (1, 2, 3) for value in _numbers(match[k], n, place)])
            ns.append(int(match[4]) * SECOND + int(match[5]))
            if len(ns) > 1 and ns[-1] <= ns[-2]:
                raise InputError(f"{place}: expected a time after that of the point before")
        if not rows or ns[0] != 0:
            raise InputError(f"{file}: expected points from time 0 on")
        self.index = {time: k for k, time in enumerate(ns)}
        self.time = np.array(ns) / SECOND
        self.q, velocity, acceleration = np.split(np.array(rows), 3, axis=1)
        self.stops = (velocity == 0).all(axis=1) & (acceleration == 0).all(axis=1)
        self._require_rates(velocity, acceleration)

    def _require_rates(self, velocity: Array, acceleration: Array) -> None:
        """Require velocities and accelerations that follow from the positions, up to rounding."""
        if not self.stops[[0, -1]].all():
            raise InputError(f"{self.file}: the robot must be at rest at the first and last point")
        step = np.diff(self.time).min() if len(self.time) > 1 else 1.0
        left = 1e-6 + DIGITS / step, 1e-6 + 4 * DIGITS / step**2
        expected = rates(self.time, self.q, self.stops)
        words = ("velocities", "accelerations")
        for word, got, ours, most in zip(
            words, (velocity, acceleration), expected, left, strict=True
        ):
            if (bad := np.flatnonzero((np.abs(got - ours) > most).any(axis=1))).size:
                said = f"the {word} do not follow from the positions"
                raise InputError(f"{self.file}, line {self.line[bad[0]]}: {said}")


class _Events(LineReader):
    """Reader of the events, and of the moves from the points between them."""

    def __init__(
        self, file: str, text: str, robot: Robot, settings: RosSettings, points: _Points
    ) -> None:
        super().__init__(file, robot, settings, _lines(file, text))
        self.points = points
        self.last = -1
        self.tips = np.empty((0, 3))
        self.sections: dict[str, list[FlowStep]] = {}
        self.advance()

    def program(self) -> ReadProgram:
        (name,) = self.take(_NAME, "trajectory")
        if f"{name}.yaml" != self.points.file:
            raise self.fault(f"expected the events of {self.points.file}, got those of {name}.yaml")
        tool, part = (self.frame(*self.take(pattern, what)) for what, pattern in _FRAMES.items())
        self.tips = (self.robot.forward(self.points.q) @ tool)[:, :3, 3]
        self.take(re.compile("events:"), "events")
        while self.row < len(self.rows):
            self.read(self.text, _EVENTS)
            self.advance()
        if self.last != len(self.points.time) - 1:
            raise self.fault("the trajectory goes on after the last event")
        sections = [section_of(word, s) for word, s in self.sections.items()]
        return ReadProgram(name=name, sections=tuple(sections), T_flange_tip=tool, T_base_part=part)

    def section(self, name: str) -> None:
        if name in self.sections:
            raise self.fault(f"a second section {name!r}")
        self.steps = self.sections[name] = []

    def admit(self, kind: str) -> None:
        if kind != "section" and not self.sections:
            raise self.fault("expected a section first")

    def done(self, time: str, kind: str) -> None:
        """Add the step that ends at a time, from the points before it."""
        ns = round(float(time) * SECOND)
        points, first = self.points, max(self.last, 0)
        end = points.index.get(ns)
        if end is None or end < first:
            raise self.fault("the trajectory has no point at this time, or the time is too early")
        if self.last < 0 and (kind != "joint" or end > 0):
            raise self.fault("expected a joint move that is done at time 0")
        took = float(points.time[end] - points.time[first])
        between = points.q[first : end + 1]
        if points.stops[first + 1 : end].any():
            raise self.fault("the robot stops before this is done")
        if kind != "linear" and not points.stops[end]:
            raise self.fault(f"the robot does not stop at the end of a {kind}")
        if kind == "wait":
            if np.abs(between - between[0]).max() > OFF_LINE:
                raise self.fault("the robot moves during a wait")
            self.wait(took)
            self.last = end
            return
        if points.stops[first] and points.stops[end] and end > first:
            self.require_dense(first, end)
        if kind == "joint":
            self.require_straight(between, OFF_LINE)
        else:
            self.require_straight(self.tips[first : end + 1], TIP_OFF_LINE)
        self.add_move(
            "joint" if kind == "joint" else "linear",
            None,
            duration=took if kind == "linear" or self.last >= 0 else None,
            zone=0.0 if points.stops[end] else None,
            q=freeze(points.q[end]),
            elsewhere={"target": f"{points.file}, line {points.line[end]}"},
        )
        self.last = end

    def require_dense(self, first: int, end: int) -> None:
        """Require that points from stop to stop are as close in time as the settings say."""
        step = float(np.diff(self.points.time[first : end + 1]).max())
        if step > self.points.step_time + 2e-9:  # times are whole ns
            raise self.fault(f"expected a point every {self.points.step_time:g} s, got {step:g} s")

    def require_straight(self, points: Array, most: float) -> None:
        """Require that points (m, k) lie on the line from the first to the last, one by one."""
        if len(points) < 3:
            return
        way = points[-1] - points[0]
        share = (points - points[0]) @ way / max(way @ way, 1e-300)
        off = np.linalg.norm(points - points[0] - share[:, None] * way, axis=1).max()
        if off > most or (np.diff(share) < -1e-9).any():
            raise self.fault("the points before it do not lie on a straight line")

    def switch(self, time: str, signal: str, to: str) -> None:
        move = self.last_on_path()
        if move is None:
            raise self.fault("a switch must follow a linear move")
        lead = float(self.points.time[self.last]) - float(time)
        switch = Switch(signal=SIGNALS[signal], on=to == "true", lead_time=lead)
        self.add_switch(move, switch, self.place)

    def frame(self, text: str) -> Array:
        values = _numbers(text, 7, self.place)
        T = pose_of(values[:3], values[3:])
        if T is None:
            raise self.fault("the quaternion must have length 1")
        return T
