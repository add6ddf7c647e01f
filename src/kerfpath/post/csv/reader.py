"""Read back the table that `Csv` writes; anything else is refused."""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np

from kerfpath.arrays import Array, freeze
from kerfpath.errors import InputError
from kerfpath.post.arcs import pose_of
from kerfpath.post.build import from_controller_units
from kerfpath.post.csv.writer import POSE, CsvSettings, columns
from kerfpath.post.flow import section_of
from kerfpath.post.line_reader import LineReader, program_lines
from kerfpath.post.program import SIGNALS, Switch
from kerfpath.post.read_program import MOVE_KINDS, FlowStep, ReadPower, ReadProgram
from kerfpath.robots import Robot

_NUMBER = re.compile(r"-?\d+\.\d+", re.ASCII)
_EVENT = re.compile(r"(?:(laser|gas|gas_2) (on|off)|power (\d\.\d+)) (\d+\.\d+) s ahead", re.ASCII)
_POWER = re.compile(r"power (\d\.\d+)", re.ASCII)
_NAME = re.compile(r"[A-Za-z]\w*", re.ASCII)
_KINDS = (*MOVE_KINDS, "via", "wait", "power")


def read(main: str, files: Mapping[str, str], robot: Robot, settings: CsvSettings) -> ReadProgram:
    """Return the program in a table that `Csv` wrote; see `kerfpath.post.Reader`."""
    header, *lines = program_lines(main, files[main]) or [""]
    if header != ",".join(columns(robot)):
        names, got = columns(robot), header.split(",")
        first = next(
            (k for k, (a, b) in enumerate(zip(names, got, strict=False)) if a != b), len(names)
        )
        raise InputError(
            f"{main}, line 1: expected the columns {','.join(names[: max(first + 1, 6)])},..., got "
            f"{header[:60]!r}"
        )
    reader = _Reader(main, robot, settings)
    for reader.line, line in enumerate(lines, 2):
        reader.read_row(line.split(","))
    if reader.via is not None:
        raise reader.fault("expected the target of the arc after its point on the way")
    name = main.removesuffix(".csv")
    sections = [section_of(name, s) for name, s in reader.sections.items()]
    return ReadProgram(name=name, sections=tuple(sections))


class _Reader(LineReader):
    """Reader of rows, which keeps the last time and the section."""

    time = 0.0
    section = ""
    via: Array | None = None

    def __init__(self, file: str, robot: Robot, settings: CsvSettings) -> None:
        super().__init__(file, robot, settings)
        self.line, self.columns = 1, columns(robot)
        self.sections: dict[str, list[FlowStep]] = {}

    def read_row(self, fields: list[str]) -> None:
        if len(fields) != len(self.columns):
            raise self.fault(f"expected {len(self.columns)} fields, got {len(fields)}")
        name, kind, time, *rest = fields
        target, (speed, share, zone, events) = rest[:-4], rest[-4:]
        if _NAME.fullmatch(name) is None:
            raise self.fault(f"section: expected letters, digits and _, got {name[:20]!r}")
        if kind not in _KINDS:
            raise self.fault(f"kind: expected {', '.join(_KINDS)}, got {kind[:20]!r}")
        if self.via is not None and kind != "circular":
            raise self.fault("a point on the way must be followed by the target of its arc")
        if name != self.section and name in self.sections:
            raise self.fault(f"the rows of section {name!r} are not consecutive")
        self.section = name
        self.steps = self.sections.setdefault(name, [])
        empty = {
            "joint": [speed, events],
            "linear": [share],
            "circular": [share],
            "via": [time, speed, share, zone, events],
            "wait": rest,
            "power": [time, *rest[:-1]],
        }[kind]
        if any(empty):
            raise self.fault(f"a row of kind {kind} must not have the value {max(empty)[:40]!r}")
        if kind == "power":
            if (match := _POWER.fullmatch(events)) is None:
                raise self.fault(f"expected a power, got {events[:40]!r}")
            self.add(ReadPower, share=self.share(match[1]))
            return
        if kind == "via":
            self.via = self.target(target)[1]
            return
        end = self.numbers([time])[0]
        took, self.time = end - self.time, end
        if took < 0:
            raise self.fault("the time runs backwards")
        if kind == "wait":
            if took == 0:
                raise self.fault("the wait takes no time")
            self.wait(took)
            return
        if (kind == "circular") != (self.via is not None):
            raise self.fault("an arc must follow the point on its way")
        q, T_part_tip = self.target(target)
        said, unit = (share, 100) if kind == "joint" else (speed, 1e3)
        self.add_move(
            MOVE_KINDS[kind],
            self.numbers([said])[0] / unit,
            duration=took,
            zone=self.numbers([zone])[0] * 1e-3,
            q=q,
            T_part_tip=T_part_tip,
            T_part_via=self.via,
            switches=self.switches(events),
        )
        self.via = None

    def target(self, fields: list[str]) -> tuple[Array, Array]:
        """Return the joints (n,) rad, external axes the last, and the tip's pose (4, 4) m."""
        values, n, arm = self.numbers(fields), self.robot.joints, self.robot.family.joints
        q, x, point, wxyz = np.split(values, [arm, n, n + len(POSE) - 4])
        T = pose_of(point * 1e-3, wxyz)
        if T is None:
            raise self.fault("the quaternion must have length 1")
        return freeze(np.append(np.radians(q), from_controller_units(self.robot, x))), T

    def switches(self, text: str) -> tuple[Switch, ...]:
        found = []
        for words in text.split(" and ") if text else ():
            if (match := _EVENT.fullmatch(words)) is None:
                raise self.fault(f"not an event: {words[:40]!r}")
            signal, state, power, lead = match.groups()
            if power is None:
                on = state == "on"
                found.append(Switch(signal=SIGNALS[signal], on=on, lead_time=float(lead)))
                continue
            share = self.share(power)
            found.append(Switch(signal="power", on=share > 0, lead_time=float(lead), share=share))
        return tuple(found)

    def share(self, text: str) -> float:
        """Return a share of the full power."""
        if float(text) > 1:
            raise self.fault(f"expected a power of at most 1, got {text}")
        return float(text)

    def numbers(self, fields: list[str]) -> Array:
        for field in fields:
            if _NUMBER.fullmatch(field) is None:
                raise self.fault(f"expected a number with decimals, got {field[:20]!r}")
        return np.array(fields, dtype=np.float64)
