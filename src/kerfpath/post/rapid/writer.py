r"""RAPID, the language of ABB controllers: this module only formats.

Units of RAPID: mm, deg, mm/s, kg, seconds; quaternions w first. A linear target is written in
place, so that one line gives target, speed and zone. ``TriggIO x,t\Time`` and ``TriggL`` switch an
output t seconds before the tip reaches the end of that one move; a plain ``SetDO`` in its place
would act as soon as the program is read ahead.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Iterator
from functools import cache, cached_property
from itertools import count
from typing import TypeVar

import numpy as np

from kerfpath.arrays import Array
from kerfpath.names import identifiers
from kerfpath.post.arcs import SHORTEST_CRUISE, cruises, quaternions
from kerfpath.post.build import carrier_frame
from kerfpath.post.languages import (
    Formatter,
    divide_sections,
    gas_outputs,
    handshakes,
    number,
    outputs,
    rename_sections,
    reset_lines,
)
from kerfpath.post.program import (
    Await,
    CircularMove,
    JointMove,
    LinearMove,
    Move,
    Program,
    Request,
    Section,
    SetPower,
    Switch,
    Wait,
    switches_of,
    targets_of,
)
from kerfpath.post.rapid.controller import (
    NO_EXTERNAL,
    SWITCH_OFF,
    TURNING_SPEED,
    ExternalSpeeds,
    ExternalUnits,
    RapidSettings,
    axes_from_joints,
    confdata,
    inherited,
)

_Key = TypeVar("_Key", bound=Hashable)

FULL_AIR_SPEED = 1.0
"""Tip speed (m/s) that is written for a joint move at full speed, as RAPID has no shares."""
JOINT_TARGET = "[[" + ",".join(["%.6f"] * 6) + "],"
TARGET = "[[%.4f,%.4f,%.4f],[%.8f,%.8f,%.8f,%.8f],[%d,%d,%d,%d],"
NO_POSE = np.eye(4)
"""Placeholder for the pose of a joint move."""
FOLLOW_END = "trFollowEnd"
"""Trigger at the end of a cut whose power follows the speed."""
FIRST = "nFirst"
"""Number of the contour at which the program begins, for a restart."""


class Rapid(Formatter):
    """Formatter of a module: frames, speeds, zones, a main routine, and one for each section."""

    settings: RapidSettings
    around = 4  # first and last line, the empty one before, the call
    too_long = "warning"

    def __init__(self, program: Program, settings: RapidSettings) -> None:
        super().__init__(rename_sections(program, (FIRST, SWITCH_OFF)), settings)
        moves = program.moves
        joint = [move for move in moves if isinstance(move, JointMove)]
        self._cruise = cruises(self.program)
        self._units = ExternalUnits(self.program.robot, settings)
        self._fast = self._units.speeds
        self.air_speed = _number_names(
            "vAir", (air_speed_data(move.speed, self._fast) for move in joint)
        )
        self._laser_on = dict(_mark_laser(moves))
        fast = self._fast
        linear = [(on, linear_speed_data(m.speed, fast)) for m, on in self._laser_on.items()]
        self.linear_speed = _number_names("vApproach", (key for key in linear if not key[0]))
        self.linear_speed |= _number_names("vCut", (key for key in linear if key[0]))
        self.zone = _number_names(
            "zCorner", (zone_data(move.zone) for move in moves if move.zone > 0)
        )
        switches = [s for m in moves for s in switches_of(m) if not s.needs]
        self.trigger: dict[Switch, str] = {}
        prefixes = {"laser": "tr", "gas": "trGas", "gas_2": "trGas2", "power": "trPower"}
        for signal, prefix in prefixes.items():
            for on, suffix in ((True, "On"), (False, "Off")):
                keys = (s for s in switches if (s.signal, s.on) == (signal, on))
                self.trigger |= _number_names(f"{prefix}{suffix}", keys)

        self.follow = _number_names("trFollow", (p for s in self._powers() for p in s.values()))
        self._following = {m: self.follow[p] for s in self._powers() for m, p in s.items()}
        self._last = {[*moves][-1] for moves in self._powers() if moves}

    def _powers(self) -> Iterator[dict[LinearMove, SetPower]]:
        """Yield the moves of each section in which the power follows the speed."""
        for section in self.program.sections:
            found: dict[LinearMove, SetPower] = {}
            power: SetPower | None = None
            for step in section.steps:
                if isinstance(step, SetPower):
                    power = step if step.per_speed else None
                elif isinstance(step, LinearMove) and power is not None:
                    found[step] = power
            yield found

    def files(self) -> dict[str, str]:
        """Return one module, or a main module and those with the routines that it loads.

        Modules are loaded and unloaded between contours: the robot is stopped with the beam off.
        """
        name, sections = self.program.name, self.program.sections
        most, numbers = self.settings.lines_per_file, dict(zip(sections, count(1), strict=False))
        calls = [f"IF {FIRST}<={n} {section.name};" for section, n in numbers.items()]
        whole = list(self._module(calls, sections))
        if len(whole) <= most:
            return {f"{name}.mod": _text(whole)}
        files, calls = {}, []
        parts = divide_sections(sections, list(self.lengths().values()), most)
        for module, part in zip(self._modules(), parts, strict=False):
            place = f'"{self.settings.folder}/{module}.mod"'
            calls += [rf"Load \Dynamic,{place};"]
            for section in part:
                called = f'  %"{section.name}"%;'
                calls += [f"IF {FIRST}<={numbers[section]} THEN", called, "ENDIF"]
            calls += [f"UnLoad {place};"]
            body = (line for section in part for line in self._routine(section))
            files[f"{module}.mod"] = _text([f"MODULE {module}", *body, "ENDMODULE"])
        return {f"{name}.mod": _text(self._module(calls, ()))} | files

    def _modules(self) -> list[str]:
        """Return names for modules of routines, as many as there might be."""
        count = len(self.program.sections)
        return identifiers((f"{self.program.name}_part",) * count, taken=(self.program.name,))

    def _module(self, calls: Iterable[str], sections: Iterable[Section]) -> Iterator[str]:
        program, settings = self.program, self.settings
        tool = _pose(program.T_flange_tip)
        yield f"MODULE {program.name}"
        part = "The work object is the part in the robot's base, which is the world's, too."
        if self._units.coupled:
            part = (
                f"The work object moves with {self._units.coupled}; the base is the world's, too."
            )
        load = "Complete the load of the tool: mass -1 stands for not known."
        head = self.head(load, part, *self._units.remarks())
        yield from (f"  ! {remark}" for remark in head)
        yield f"  ! {SWITCH_OFF} is for the events STOP and QSTOP: enter it there. A stop switches"
        yield "  ! the laser off only then; the safety circuit of the cell has to, too."
        yield f"  ! To begin at a contour, set {FIRST} to its number and move PP to Main."
        load = "[-1,[0,0,0],[1,0,0,0],0,0,0]"
        yield f"  PERS tooldata {settings.tool_name}:=[TRUE,{tool},{load}];"
        yield f"  PERS wobjdata {settings.work_object}:={self._work_object()};"
        yield from (f"  CONST speeddata {name}:={value};" for value, name in self._speed_data())
        yield from (f"  CONST zonedata {name}:={value};" for value, name in self.zone.items())
        yield from (f"  VAR triggdata {name};" for name in self._trigger_names())
        yield f"  PERS num {FIRST}:=1;"
        yield ""
        yield "  PROC main()"
        yield from (f"    {line}" for line in self.begin())
        yield from (f"    {line}" for line in calls)
        yield from (f"    {line}" for line in self._units.deactivated())
        yield from (f"  {line}" for line in ending_lines())
        yield "  ENDPROC"
        yield ""
        yield f"  PROC {SWITCH_OFF}()"
        yield from (f"    {line}" for line in switch_off_lines(settings))
        yield "  ENDPROC"
        for section in sections:
            yield from self._routine(section)
        yield "ENDMODULE"

    def _routine(self, section: Section) -> Iterator[str]:
        yield ""
        yield f"  PROC {section.name}()"
        yield from (f"    {line}" for line in self.lines(section))
        yield "  ENDPROC"

    def begin(self) -> Iterator[str]:
        """Yield the lines of the main routine before it calls those of the sections."""
        yield from reset_lines(inherited(self.settings))
        for s in self.trigger:
            self.output(s.signal)
        yield f"{SWITCH_OFF};"
        yield from self._units.activated()
        for s, name in self.trigger.items():
            lead = number(s.lead_time, 4)
            to = rf"\DOp:={self.output(s.signal)},{int(s.on)}"
            if s.signal == "power":
                to = rf"\AOp:={self.output(s.signal)},{self.power_value(s.share)}"
            yield rf"TriggIO {name},{lead}\Time{to};"

        for power, name in self.follow.items():
            lead, slope = number(power.lead_time, 4), number(self.power_per_speed(power) * 1e-3, 6)
            lag = rf"{lead},{self.output('power')},{slope}\DipLag:={lead}"
            yield rf"TriggSpeed {name},0\Start,{lag};"
        if self.follow:
            lead = number(next(iter(self.follow)).lead_time, 4)
            yield f"TriggSpeed {FOLLOW_END},0,{lead},{self.output('power')},0;"

    def _trigger_names(self) -> list[str]:
        end = [FOLLOW_END] if self.follow else []
        return [*self.trigger.values(), *self.follow.values(), *end]

    def names(self) -> list[tuple[str, str]]:
        """Return every name in the module, with what it names."""
        settings = self.settings
        ports = handshakes(settings).items()
        power = settings.power_output
        return [
            (self.program.name, "the program"),
            (settings.tool_name, "the tool"),
            (settings.work_object, "the work object"),
            (settings.laser_output, "the output of the laser"),
            *((port, f"the output of the {gas}") for port, gas in gas_outputs(settings).items()),
            *([] if power is None else [(power, "the output of the power")]),
            *((name, f"the {way} of {who}") for (who, way), name in ports if name is not None),
            *((unit, "a mechanical unit") for unit in dict.fromkeys(self._units.units)),
            ("main", "the main routine"),
            (SWITCH_OFF, "the routine that switches off"),
            (FIRST, "the number of the first contour"),
            *((section.name, "a contour") for section in self.program.sections),
            *((name, "a speed") for _, name in self._speed_data()),
            *((name, "a zone") for name in self.zone.values()),
            *((name, "a switch") for name in self._trigger_names()),
            *((name[:-4], "a module") for name in list(self.files())[1:]),
        ]

    def joint_move(self, move: JointMove) -> Iterator[str]:
        """Yield a MoveAbsJ."""
        speed = self.air_speed[air_speed_data(move.speed, self._fast)]
        cruise = self._cruise.get(move, 0.0)
        timed = rf"\T:={number(cruise, 4)}" if cruise >= SHORTEST_CRUISE else ""
        yield f"MoveAbsJ {self.target[move][-1]},{speed}{timed},{self.end(move)};"

    def linear_move(self, move: LinearMove) -> Iterator[str]:
        """Yield a MoveL, or a TriggL where something is switched."""
        word, triggers = self._switched("L", move)
        target = self.target[move][-1]
        yield f"{word} {target},{self.speed(move)}{triggers},{self.end(move)};"
        for switch in move.switches:
            if switch.needs:
                needed = " AND ".join(f"DOutput({port})=1" for port in self.needed(switch))
                yield f"IF {needed} SetDO {self.output(switch.signal)},1;"

    def circular_move(self, move: CircularMove) -> Iterator[str]:
        """Yield a MoveC, or a TriggC where something is switched."""
        word, triggers = self._switched("C", move)
        via, target = self.target[move][-2:]
        yield f"{word} {via},{target},{self.speed(move)}{triggers},{self.end(move)};"

    def wait(self, wait: Wait) -> Iterator[str]:
        """Yield a WaitTime."""
        yield f"WaitTime {number(wait.time, 3)};"

    def power(self, power: SetPower) -> Iterator[str]:
        """Yield a SetAO; the robot is stopped. A power by the speed is a trigger of the moves."""
        if not power.per_speed:
            yield f"SetAO {self.output('power')},{self.power_value(power.share)};"

    def request(self, request: Request) -> Iterator[str]:
        """Yield a SetDO; the robot is stopped."""
        yield f"SetDO {self.port(request.partner, 'output')},{int(request.on)};"

    def wait_for(self, awaited: Await) -> Iterator[str]:
        r"""Yield a WaitDI; after its MaxTime the error handler of main switches off and stops."""
        name = self.port(awaited.partner, "input")
        yield rf"WaitDI {name},1\MaxTime:={number(awaited.timeout, 3)};"

    def comment(self, text: str) -> Iterator[str]:
        """Yield a comment."""
        yield f"! {text}"

    @cached_property
    def target(self) -> dict[Move, list[str]]:
        """Texts of the targets of each move; quaternions have no jumps of sign."""
        points, robot = targets_of(self.program.moves), self.program.robot
        q = np.array([point.q for point in points]).reshape(-1, robot.joints)
        axes_deg = (np.degrees(axes_from_joints(robot, q)).round(6) + 0.0).tolist()
        T = np.array([NO_POSE if T is None else T for _, _, T in points]).reshape(-1, 4, 4)
        point_mm = (T[:, :3, 3] * 1e3).round(4) + 0.0
        wxyz = quaternions(T).round(8) + 0.0
        rows = np.hstack([point_mm, wxyz, confdata(robot, q)]).tolist()
        texts: dict[Move, list[str]] = {move: [] for move in self.program.moves}
        external = self._units.values(q)
        for (move, _, _), axes, row, more in zip(points, axes_deg, rows, external, strict=True):
            joint = isinstance(move, JointMove)
            target = JOINT_TARGET % tuple(axes) if joint else TARGET % tuple(row)
            texts[move].append(f"{target}{more}]")
        return texts

    def _work_object(self) -> str:
        """Return the frame of the part: in the base, or in the unit that carries it."""
        here, part = _pose(np.eye(4)), _pose(self.program.T_base_part)
        if not self._units.coupled:
            return f'[FALSE,TRUE,"",{part},[[0,0,0],[1,0,0,0]]]'
        frame = carrier_frame(self.program.robot, self.settings.positioner_frame)
        inner = _pose(np.linalg.inv(frame) @ self.program.T_base_part)
        return f'[FALSE,FALSE,"{self._units.coupled}",{here},{inner}]'

    def _speed_data(self) -> list[tuple[str, str]]:
        linear = [(value, name) for (_, value), name in self.linear_speed.items()]
        return [*self.air_speed.items(), *linear]

    def speed(self, move: LinearMove) -> str:
        """Return the name of the speed data of a move."""
        return self.linear_speed[self._laser_on[move], linear_speed_data(move.speed, self._fast)]

    def _switched(self, path: str, move: LinearMove) -> tuple[str, str]:
        names = [self.trigger[s] for s in move.switches if not s.needs]
        names = [*([self._following[move]] if move in self._following else []), *names]
        names += [FOLLOW_END] if move in self._last else []
        later = "".join(rf"\T{i}:={name}" for i, name in enumerate(names[1:], 2))
        return (f"Trigg{path}", f",{names[0]}{later}") if names else (f"Move{path}", "")

    def end(self, move: Move) -> str:
        """Return the zone, tool and work object at the end of a move."""
        zone = self.zone[zone_data(move.zone)] if move.zone > 0 else "fine"
        return rf"{zone},{self.settings.tool_name}\WObj:={self.settings.work_object}"


def ending_lines() -> list[str]:
    """Return the end of main, which resets the first contour for the next time, and its handlers.

    These are for errors, and for leaving main before its end. Errors that routines do not handle
    end here: everything is switched off, the robot stops, and the error is shown.
    """
    off = f"  {SWITCH_OFF};"
    return [f"  {FIRST}:=1;", "ERROR", off, "  StopMove;", "  RAISE;", "UNDO", off]


def switch_off_lines(settings: RapidSettings) -> list[str]:
    """Return the lines that switch off everything that the settings name."""
    power = [] if settings.power_output is None else [f"SetAO {settings.power_output},0;"]
    return [*(f"SetDO {name},0;" for name in outputs(settings)), *power]


def _number_names(prefix: str, keys: Iterable[_Key]) -> dict[_Key, str]:
    distinct = list(dict.fromkeys(keys))
    if len(distinct) == 1:
        return {distinct[0]: prefix}
    return {key: f"{prefix}{n}" for n, key in enumerate(distinct, 1)}


def _mark_laser(moves: Iterable[Move]) -> list[tuple[LinearMove, bool]]:
    """Return the linear and circular moves, with whether each is made with the laser on."""
    on, found = False, []
    for move in moves:
        if isinstance(move, LinearMove):
            found.append((move, on))
            for switch in move.switches:
                on = switch.on if switch.signal == "laser" else on
    return found


def _pose(T: Array) -> str:
    return f"[{_list(T[:3, 3] * 1e3, 4)},{_list(quaternions(T[None])[0], 8)}]"


@cache
def linear_speed_data(speed: float, fast: ExternalSpeeds = NO_EXTERNAL) -> str:
    """Return the speed data of path moves at a speed of the tip (m/s)."""
    turning = number(np.degrees(TURNING_SPEED), 0)
    return f"[{number(speed * 1e3, 2)},{turning},{fast.said(1.0)}]"


@cache
def air_speed_data(share: float, fast: ExternalSpeeds = NO_EXTERNAL) -> str:
    """Return the speed data of joint moves at a share of the full speed."""
    speed_mm_s = round(share * FULL_AIR_SPEED * 1e3, 2)
    # From the speed as it is written, because a reader has no other.
    share = speed_mm_s / (FULL_AIR_SPEED * 1e3)
    turning = number(share * np.degrees(TURNING_SPEED), 0)
    return f"[{number(speed_mm_s, 2)},{turning},{fast.said(share)}]"


@cache
def zone_data(zone: float) -> str:
    """Return the zone data of a radius (m).

    ABB's own zones turn the tool within at most 1.5 times the path zone. Here the tool turns within
    the path zone, by 0.1 deg for each mm.
    """
    zone_mm = number(zone * 1e3, 3)
    zone_deg = number(float(zone_mm) * 0.1, 3)
    return f"[FALSE,{zone_mm},{zone_mm},{zone_mm},{zone_deg},{zone_mm},{zone_deg}]"


def _list(values: Array, decimals: int) -> str:
    return f"[{','.join(number(value, decimals) for value in values)}]"


def _text(lines: Iterable[str]) -> str:
    return "\n".join([*lines, ""])
