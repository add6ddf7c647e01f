r"""Read back the RAPID that `Rapid` writes; anything else is refused."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from kerfpath.arrays import Array
from kerfpath.post.arcs import pose_of
from kerfpath.post.build import carrier_frame
from kerfpath.post.flow import section_of
from kerfpath.post.languages import reset_lines
from kerfpath.post.line_reader import SHOWN, LineReader, only, patterns, program_lines, statements
from kerfpath.post.program import Switch
from kerfpath.post.rapid.controller import (
    SWITCH_OFF,
    ExternalSpeeds,
    ExternalUnits,
    RapidSettings,
    inherited,
    joints_from_axes,
)
from kerfpath.post.rapid.writer import (
    FIRST,
    FOLLOW_END,
    FULL_AIR_SPEED,
    air_speed_data,
    ending_lines,
    linear_speed_data,
    switch_off_lines,
    zone_data,
)
from kerfpath.post.read_program import FlowStep, ReadMove, ReadProgram
from kerfpath.robots import Robot

# -----------------------------------------------------------------------------
# Read RAPID aggregates: values in brackets.


_AGGREGATE = re.compile(r'(?:[-+.,\[\] \t\dEe]|TRUE|FALSE|"\w*")*', re.ASCII | re.IGNORECASE)
_BARE_POINT = re.compile(r"(?<![-\w.])(?P<sign>-?)(?=\.\d)", re.ASCII)
_TRUTH = re.compile("TRUE|FALSE", re.ASCII | re.IGNORECASE)


class Aggregates(LineReader):
    """Reader of aggregates on the lines of a file."""

    language = "rapid"

    def values(self, text: str, count: int) -> list[Any]:
        """Return the `count` parts of an aggregate; RAPID writes it almost as JSON does."""
        if not _AGGREGATE.fullmatch(text):
            raise self.fault(f"not an aggregate: {text[:SHOWN]!r}")
        text = _BARE_POINT.sub(r"\g<sign>0", text)
        text = _TRUTH.sub(lambda found: found[0].lower(), text)
        try:
            values = json.loads(text)
        except (json.JSONDecodeError, RecursionError) as error:
            raise self.fault(f"not an aggregate: {error}") from None
        if not isinstance(values, list) or len(values) != count:
            raise self.fault(f"expected {count} values, got {text[:60]!r}")
        return values

    def numbers(self, values: Any, count: int) -> Array:
        """Return a list of `count` numbers as an array."""
        is_list = isinstance(values, list) and len(values) == count
        if not is_list or any(type(value) not in (int, float) for value in values):
            raise self.fault(f"expected {count} numbers, got {values!r}")
        return np.array(values, dtype=np.float64)

    def pose(self, value: Any) -> Array:
        """Return a pose (4, 4) m, written as a position and a quaternion."""
        if not isinstance(value, list) or len(value) != 2:
            raise self.fault(f"expected a position and a quaternion, got {value!r}")
        point_mm, wxyz = self.numbers(value[0], 3), self.numbers(value[1], 4)
        T = pose_of(point_mm * 1e-3, wxyz)
        if T is None:
            raise self.fault(f"the quaternion {value[1]} must have length 1")
        return T


# -----------------------------------------------------------------------------
# Patterns of the RAPID lines that are read, by their kind, and where each kind may occur.

_NAME = r"([A-Za-z]\w*)"
_POSE = r"(\[\[.*?9E\+?0?9\]\])"
_TRIGGERS = r"([A-Za-z]\w*(?:\\T\d:=[A-Za-z]\w*)*)"
_FRAMES = rf"{_NAME}\\WObj:={_NAME}"
_LINES = patterns(
    {
        "module": rf"MODULE {_NAME}",
        "end_module": "ENDMODULE",
        "tool": rf"PERS tooldata {_NAME}:=(\[.*\]);",
        "work_object": rf"PERS wobjdata {_NAME}:=(\[.*\]);",
        "speed": rf"CONST speeddata {_NAME}:=(\[.*\]);",
        "zone": rf"CONST zonedata {_NAME}:=(\[.*\]);",
        "trigger": rf"VAR triggdata {_NAME};",
        "routine": rf"PROC {_NAME}\(\)",
        "end_routine": "ENDPROC",
        "first": rf"PERS num {FIRST}:=(\d+);",
        "request": rf"SetDO {_NAME},([01]);",
        "guarded": rf"IF (DOutput\(\w+\)=1(?: AND DOutput\(\w+\)=1)*) SetDO {_NAME},1;",
        "wait_for": rf"WaitDI {_NAME},1\\MaxTime:=([\d.]+);",
        "set_trigger": rf"TriggIO {_NAME},([\d.]+)\\Time\\DOp:={_NAME},([01]);",
        "set_power_trigger": rf"TriggIO {_NAME},([\d.]+)\\Time\\AOp:={_NAME},([\d.]+);",
        "set_follow": rf"TriggSpeed {_NAME},0(\\Start)?,([\d.]+),{_NAME},([\d.]+)"
        r"(?:\\DipLag:=([\d.]+))?;",
        "power": rf"SetAO {_NAME},([\d.]+);",
        "wait": r"WaitTime ([\d.]+);",
        "load": r'Load \\Dynamic,"([^"]*)/([^"/]*)";',
        "activate": rf"(Act|Deact)Unit {_NAME};",
        "condition": rf"IF {FIRST}<=(\d+) THEN",
        "late_call": rf'%"{_NAME}"%;',
        "unload": r'UnLoad "([^"]*)/([^"/]*)";',
        "call": rf"IF {FIRST}<=(\d+) {_NAME};",
        "joint_move": rf"MoveAbsJ (\[.*\]),{_NAME}(?:\\T:=(\d+\.\d+))?,{_NAME},{_FRAMES};",
        "linear_move": rf"MoveL (\[.*\]),{_NAME},{_NAME},{_FRAMES};",
        "circular_move": rf"MoveC {_POSE},{_POSE},{_NAME},{_NAME},{_FRAMES};",
        "switching_move": rf"TriggL (\[.*\]),{_NAME},{_TRIGGERS},{_NAME},{_FRAMES};",
        "switching_arc": rf"TriggC {_POSE},{_POSE},{_NAME},{_TRIGGERS},{_NAME},{_FRAMES};",
    },
    caseless=True,
)
DECLARED = ("tool", "work_object", "speed", "zone", "trigger", "first")

MODULE = only(_LINES, "module")
OUTSIDE = only(_LINES, *DECLARED, "routine", "end_module")
IN_PART = only(_LINES, "routine", "end_module")
IN_MAIN = only(
    _LINES,
    "activate",
    "set_trigger",
    "set_power_trigger",
    "set_follow",
    "load",
    "condition",
    "late_call",
    "unload",
    "call",
    "end_routine",
)
IN_ROUTINE = only(
    _LINES,
    "joint_move", "linear_move", "circular_move", "switching_move", "switching_arc", "wait",
    "request", "guarded", "wait_for", "power", "end_routine",
)  # fmt: skip

_ON_ERROR = patterns(
    {
        "off": r"SetDO (\w+),0;",
        "power_off": r"SetAO (\w+),0;",
        "": rf"{SWITCH_OFF};|StopMove;|UNDO|ENDPROC|ERROR",
        "end_program": "RAISE;",
    },
    caseless=True,
)
"""What is done at an error: main calls the routine that switches off, and stops."""
ERROR = "ERROR"
"""Name of the handler of errors in main, which is the exit of a wait without an answer."""


# -----------------------------------------------------------------------------
# The reader of modules.

_T = TypeVar("_T")


def read(main: str, files: Mapping[str, str], robot: Robot, settings: RapidSettings) -> ReadProgram:
    """Return the program in a RAPID module that `Rapid` wrote; see `kerfpath.post.Reader`."""
    reader = _Reader(main, files, robot, settings)
    reader.read_module(main)
    for file in dict.fromkeys(reader.called_in.values()):
        if file != main:
            reader.read_module(file)
    return reader.program()


class _Reader(Aggregates):
    """Reader of modules, line by line."""

    settings: RapidSettings
    words = ("main", "fine", "Act", "Deact", FIRST, SWITCH_OFF)

    def __init__(
        self, main: str, files: Mapping[str, str], robot: Robot, settings: RapidSettings
    ) -> None:
        super().__init__(main, robot, settings)
        self.main, self.files = main, files
        self.name = ""
        self.modules: dict[str, str] = {}
        self.loaded = ""
        self.routine_name: str | None = None
        self.ended = False
        self.frames: dict[str, tuple[str, Array]] = {}
        self.speeds: dict[str, Array] = {}
        self.said_at: dict[str, str] = {}
        self.zones: dict[str, float] = {"fine": 0.0}
        self.triggers: dict[str, Switch | None] = {}
        self.follows: dict[str, tuple[float, float]] = {}
        """Value of the power output for each m/s, and lead time, by the name of a trigger."""
        self.following = ""
        self.called_in: dict[str, str] = {}
        self.routines: dict[str, list[FlowStep]] = {}
        self.switch_off: list[FlowStep] = []
        self.on_error: list[FlowStep] = []
        self.homes: dict[str, str] = {}
        self.names = {"fine", FIRST.lower()}
        """Names of data and routines, in lower case."""
        self.first_number = 0
        self.number: str | None = None
        self.units = ExternalUnits(robot, settings)
        self.active: list[str] = []

    def read_module(self, file: str) -> None:
        self.file, self.ended, self.begun, self.name = file, False, False, ""
        lines = program_lines(file, self.files[file])
        for self.line, line in statements(lines, "!"):
            self.read_line(line)
        self.line = len(lines) + 1
        if not self.ended:
            raise self.fault("ENDMODULE is missing")

    def read_line(self, line: str) -> None:
        if self.ended:
            raise self.fault("nothing may follow ENDMODULE")
        in_main = self.routine_name == "main"
        ends = in_main and not self.required and not self.number
        if ends and self.same(line, ending_lines()[0]):
            rows = (row.strip() for row in ending_lines()[1:])
            self.steps = self.on_error
            self.require_next([*rows, "ENDPROC"], _ON_ERROR)
            self.routine_name = None
        elif not self.name:
            self.read(line, MODULE)
        elif self.routine_name is None:
            self.read(line, OUTSIDE if self.file == self.main else IN_PART)
        else:
            self.read(line, IN_MAIN if in_main else IN_ROUTINE)

    def admit(self, kind: str) -> None:
        if self.following and kind not in ("switching_move", "switching_arc"):
            raise self.fault(f"expected a move with {self.following}, or {FOLLOW_END} before")
        if kind in DECLARED and self.routines:
            raise self.fault("data must be declared before the first routine")

    def program(self) -> ReadProgram:
        for kind in ("tool", "work_object"):
            if kind not in self.frames:
                raise self.fault(f"the module declares no {kind.replace('_', ' ')}")
        unknown = {*self.called_in.items(), (SWITCH_OFF, self.main)} ^ set(self.homes.items())
        if unknown or "main" not in self.routines:
            names = ", ".join(sorted({name for name, _ in unknown}))
            raise self.fault(f"main and routines do not match: {names}")
        if self.active != [*self.units.activated(), *self.units.deactivated()]:
            expected = " ".join([*self.units.activated(), *self.units.deactivated()]) or "none"
            raise self.fault(f"expected these lines for the mechanical units: {expected}")
        if not 1 <= self.first_number <= len(self.called_in):
            raise self.fault(f"{FIRST} must be the number of a contour")
        return ReadProgram(
            name=self.modules[self.main],
            T_flange_tip=self.frames["tool"][1],
            T_base_part=self.frames["work_object"][1],
            sections=tuple(
                section_of(name, self.routines[name])
                for name in list(self.called_in)[self.first_number - 1 :]
            ),
            exits={ERROR: (*self.switch_off, *self.on_error)},
        )

    def module(self, name: str) -> None:
        self.name = self.modules[self.file] = name

    def end_module(self) -> None:
        self.ended = True

    def tool(self, name: str, text: str) -> None:
        held, pose, load = self.values(text, 3)
        if held is not True or not isinstance(load, list) or len(load) != 6:
            raise self.fault("expected a tool held by the robot, with its load")
        mass, centre, axes, *inertia = load
        said = self.numbers([mass, *inertia], 4)
        if said[0] < 0 and said[0] != -1:  # which stands for a load not known
            raise self.fault(f"expected a load of 0 kg or more, got {said[0]:g}")
        self.require_load(float(said[0]))
        self.numbers(centre, 3)
        self.numbers(axes, 4)
        self.declare("tool", name, self.pose(pose))

    def work_object(self, name: str, text: str) -> None:
        held, fixed, unit, pose, inner = self.values(text, 5)
        here = [[0, 0, 0], [1, 0, 0, 0]]
        coupled = self.units.coupled
        if coupled:
            if [held, fixed, unit] != [False, False, coupled] or pose != here:
                raise self.fault(f"expected a work object moved by {coupled}, without user frame")
            frame = carrier_frame(self.robot, self.settings.positioner_frame)
            self.declare("work_object", name, frame @ self.pose(inner))
            return
        if [held, fixed, unit] != [False, True, ""] or inner != here:
            raise self.fault("expected a fixed work object without an object frame")
        self.declare("work_object", name, self.pose(pose))

    def declare(self, kind: str, name: str, T: Array) -> None:
        if kind in self.frames:
            raise self.fault(f"a second {kind.replace('_', ' ')} is declared")
        self.define(name)
        self.frames[kind] = (name, T)

    def speed(self, name: str, text: str) -> None:
        self.define(name)
        self.speeds[name] = self.numbers(self.values(text, 4), 4)
        self.said_at[name] = self.place

    def zone(self, name: str, text: str) -> None:
        stop, *sizes = self.values(text, 7)
        if stop is not False:
            raise self.fault("expected a zone without a stop, FALSE first")
        self.define(name)
        values = self.numbers(sizes, 6)
        self.zones[name] = float(values[0]) * 1e-3
        self.require_same(values, zone_data(self.zones[name]), "sizes of the zone")
        self.said_at[name] = self.place

    def trigger(self, name: str) -> None:
        self.define(name)
        self.triggers[name] = None

    def routine(self, name: str) -> None:
        self.define(name)
        if name == SWITCH_OFF and self.file == self.main:
            self.steps = self.switch_off
            self.require_next([*switch_off_lines(self.settings), "ENDPROC"], _ON_ERROR)
            self.homes[name] = self.main
            return
        self.routine_name = name
        self.steps = self.routines[name] = []
        if name == "main":
            self.require_next([*reset_lines(inherited(self.settings)), f"{SWITCH_OFF};"])
        if name != "main":
            self.homes[name] = self.file
        elif self.file != self.main:
            raise self.fault("a second main is declared")

    def end_routine(self) -> None:
        if self.routine_name == "main":
            raise self.fault(f"expected {ending_lines()[0].strip()}, ERROR and UNDO before its end")
        self.routine_name = None

    def first(self, number: str) -> None:
        if self.first_number:
            raise self.fault(f"a second {FIRST} is declared")
        self.first_number = int(number)

    def request(self, output: str, value: str) -> None:
        self.ask(output, on=value == "1")

    def guarded(self, needed: str, output: str) -> None:
        ports = re.findall(r"DOutput\((\w+)\)", needed, re.ASCII | re.IGNORECASE)
        self.require_output(output, self.settings.laser_output)
        self.add_needing(self.spelled(port) for port in ports)

    def wait_for(self, name: str, timeout: str) -> None:
        self.expect_answer(name, float(timeout), otherwise=ERROR)

    def set_trigger(self, name: str, lead_time: str, output: str, value: str) -> None:
        lead, on = float(lead_time), value == "1"
        self.add_trigger(name, Switch(signal=self.signal(output), on=on, lead_time=lead))

    def set_power_trigger(self, name: str, lead_time: str, output: str, value: str) -> None:
        self.add_trigger(name, self.power_switch(output, value, float(lead_time)))

    def add_trigger(self, name: str, switch: Switch) -> None:
        if self.called_in:
            raise self.fault("triggers must be set before the first contour is called")
        if name not in self.triggers or self.triggers[name] is not None:
            raise self.fault(f"{name} must be declared once and set once")
        self.said_at[name] = self.place
        self.triggers[name] = switch

    def set_follow(
        self, name: str, start: str | None, lead: str, output: str, slope: str, dip: str | None
    ) -> None:
        """Read a trigger by which the power follows the speed, or the end of that."""
        per_speed = float(slope)
        if name not in self.triggers or name in self.follows or self.called_in:
            raise self.fault(f"{name} must be declared once and set once, before any contour")
        if bool(start) != (per_speed > 0) or bool(dip) != bool(start) or (dip or lead) != lead:
            raise self.fault(r"expected 0\Start, a scale and the same \DipLag, or 0 and scale 0")
        self.require_power_output(output)
        self.follows[name] = per_speed * 1e3, float(lead)

    def activate(self, state: str, unit: str) -> None:
        if (state == "Act") == bool(self.called_in):
            raise self.fault(
                "units must be activated before the first contour and deactivated after the last"
            )
        self.active.append(f"{state}Unit {unit};")

    def load(self, folder: str, file: str) -> None:
        if self.loaded or folder != self.settings.folder:
            raise self.fault(f"expected one module at a time, from {self.settings.folder}")
        self.loaded = file

    def unload(self, folder: str, file: str) -> None:
        if (folder, file) != (self.settings.folder, self.loaded):
            raise self.fault(f"{folder}/{file} is not loaded")
        self.loaded = ""

    def condition(self, number: str) -> None:
        if self.number is not None:
            raise self.fault("a condition must have one call")
        self.number = number

    def late_call(self, name: str) -> None:
        if not self.loaded or self.number is None:
            raise self.fault(f"{name} is called while no module is loaded, or without a condition")
        self.call(self.number, name)
        self.number = None
        self.require_next(["ENDIF"])

    def call(self, number: str, name: str) -> None:
        if name in self.called_in:
            raise self.fault(f"{name} is called twice")
        if int(number) != len(self.called_in) + 1:
            raise self.fault(f"{name} is contour {len(self.called_in) + 1}, not {number}")
        self.called_in[name] = self.loaded or self.main

    def joint_move(
        self, text: str, speed: str, timed: str | None, zone: str, tool: str, work_object: str
    ) -> None:
        axes_deg, external = self.values(text, 2)
        self.require_frames(tool, work_object)
        axes, said = np.radians(self.numbers(axes_deg, 6)), self.speed_of(speed, air_speed_data)
        joints = joints_from_axes(self.robot, axes[None])[0]
        self.add_move(
            "joint",
            said if timed is None else None,
            q=np.append(joints, self.external(external)),
            cruise=None if timed is None else float(timed),
            zone=self.named(zone, self.zones),
            elsewhere=self.elsewhere(speed=speed, zone=zone),
        )

    def linear_move(self, text: str, speed: str, zone: str, tool: str, work_object: str) -> None:
        T_part_tip, quarters, external = self.target(text, tool, work_object)
        self.add_move(
            "linear",
            self.speed_of(speed, linear_speed_data),
            T_part_tip=T_part_tip,
            external=external if len(external) else None,
            posture=quarters,
            zone=self.named(zone, self.zones),
            elsewhere=self.elsewhere(speed=speed, zone=zone),
        )

    def circular_move(
        self, via: str, text: str, speed: str, zone: str, tool: str, work_object: str
    ) -> None:
        self.linear_move(text, speed, zone, tool, work_object)
        T_part_via, *_ = self.target(via, tool, work_object)
        self.steps[-1] = replace(self.last(), kind="circular", T_part_via=T_part_via)

    def switching_move(
        self, text: str, speed: str, triggers: str, zone: str, tool: str, work_object: str
    ) -> None:
        self.linear_move(text, speed, zone, tool, work_object)
        self.add_triggers(triggers)

    def switching_arc(
        self, via: str, text: str, speed: str, triggers: str, zone: str, tool: str, work: str
    ) -> None:
        self.circular_move(via, text, speed, zone, tool, work)
        self.add_triggers(triggers)

    def target(
        self, text: str, tool: str, work_object: str
    ) -> tuple[Array, tuple[int, ...], Array]:
        point, wxyz, conf, external = self.values(text, 4)
        self.require_frames(tool, work_object)
        quarters = self.numbers(conf, 4)
        if (quarters != np.round(quarters)).any():
            raise self.fault(f"configuration {conf} must be whole numbers")
        words = tuple(quarters.astype(int).tolist())
        return self.pose([point, wxyz]), words, self.external(external)

    def external(self, values: Any) -> Array:
        """Return the values (E,) m and rad of the external axes of a target."""
        found = self.units.read(self.numbers(values, 6).tolist())
        if isinstance(found, str):
            raise self.fault(found)
        return found

    def last(self) -> ReadMove:
        last = self.last_on_path()
        assert last is not None
        return last

    def add_triggers(self, text: str) -> None:
        """Add the switches of the triggers of a move; `text` names the triggers."""
        words = re.split(r"\\T\d:=", text, flags=re.IGNORECASE)
        names = [self.spelled(word) for word in words]
        found = [name for name in names if name in self.follows]
        if found or self.following:
            self.add_follow(found)
            names = [name for name in names if name not in self.follows]
        first = names[0] if names else ""
        for name in names:
            switch = self.triggers.get(name)
            if switch is None:
                raise self.fault(f"{name} has not been set")
            self.add_switch(self.last(), switch, self.said_at[first])

    def add_follow(self, names: list[str]) -> None:
        """Add that the power follows the speed from the last move on, or up to its end."""
        name, *end = [*names, ""] if len(names) < 2 else names
        per_speed, lead = self.follows.get(name, (0.0, 0.0))
        if not per_speed or (self.following or name) != name:
            raise self.fault(f"expected the trigger {self.following or 'of a power by the speed'}")
        if not self.following:
            move = self.steps.pop()
            before = [step for step in self.steps if isinstance(step, ReadMove)][-1:]
            if not before or before[0].zone != 0:
                raise self.fault("a power may follow the speed only from a stop on")
            self.follow_speed(self.settings.power_output, per_speed, lead)
            self.steps.append(move)
        self.following = "" if end == [FOLLOW_END] else name
        if any(end) and (end != [FOLLOW_END] or self.follows.get(FOLLOW_END) != (0.0, lead)):
            raise self.fault(f"expected {FOLLOW_END} alone beside {name}")

    def require_frames(self, tool: str, work_object: str) -> None:
        known = [self.frames[kind][0] for kind in ("tool", "work_object") if kind in self.frames]
        if [tool, work_object] != known:
            raise self.fault(f"tool {tool}, work object {work_object}: not those of the module")

    def require_same(self, values: Array, data: str, what: str) -> None:
        """Require the values after the first (in zones, the second) as they are written."""
        expected = np.array(self.values(data.replace("FALSE,", ""), len(values)), dtype=np.float64)
        if not np.array_equal(values[1:], expected[1:]):
            raise self.fault(f"{what}: expected {data}, got {values.tolist()}")

    def speed_of(self, name: str, data: Callable[[float, ExternalSpeeds], str]) -> float:
        """Return the speed of declared data; the other values must be as `data` writes them."""
        values = self.named(name, self.speeds)
        speed = float(values[0]) * 1e-3 / (FULL_AIR_SPEED if data is air_speed_data else 1.0)
        self.require_same(values, data(speed, self.units.speeds), f"speeds of {name}")
        return speed

    def named(self, name: str, known: Mapping[str, _T]) -> _T:
        if name not in known:
            raise self.fault(f"{name} is not declared")
        return known[name]

    def define(self, name: str) -> None:
        """Refuse a name that is used already; case makes no difference."""
        if name.lower() in self.names:
            raise self.fault(f"{name} is declared twice")
        self.names.add(name.lower())

    def elsewhere(self, **named: str) -> dict[str, str]:
        """Return file and line where the data named by a move are declared or set."""
        return {what: self.said_at[name] for what, name in named.items() if name in self.said_at}
