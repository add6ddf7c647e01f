r"""RAPID, the language of ABB controllers: this module only formats.

Units of RAPID: mm, deg, mm/s, kg, seconds; quaternions w first. A linear target is written in
place, so that one line says where the tip goes, how fast and how closely. ``TriggIO x,t\Time`` and
``TriggL`` switch an output t seconds before the tip reaches the end of that one move; a plain
``SetDO`` in its place would act as soon as the program is read ahead.
"""

from __future__ import annotations

import re
from collections.abc import Hashable, Iterable, Iterator
from functools import cache, cached_property
from typing import Annotated, TypeVar

import numpy as np
from pydantic import StringConstraints

from kerfpath._arrays import Array
from kerfpath.post._divide import divided, in_files
from kerfpath.post._formatter import Formatter, number, plain
from kerfpath.post._names import identifiers
from kerfpath.post._orientations import quaternions
from kerfpath.post._program import (
    CircularMove,
    JointMove,
    LinearMove,
    Move,
    Program,
    Section,
    Switch,
    Wait,
)
from kerfpath.post._settings import Rules, Settings, setting
from kerfpath.post.rapid._axes import axes_from_joints, confdata

__all__ = ["Rapid", "RapidSettings", "is_reserved", "rules"]

_Key = TypeVar("_Key", bound=Hashable)

FULL_AIR_SPEED = 1.0
"""Tip speed (m/s) that a joint move at its full share is given: RAPID knows no share."""
TURNING_SPEED = np.radians(500.0)
"""v_ori of all speed data, rad/s: ABB's own for its predefined speeds."""
SLOWEST = 1e-5
"""Lowest speed (m/s) that two decimals of mm/s say to within half."""
SPEED_STEP = 1e-5
"""Speeds (m/s) have two decimals of mm/s."""
LONGEST_LEAD = 0.5
r"""Longest lead (s) that ``TriggIO \Time`` takes."""

NOT_CHECKED = "not been checked for collisions"
NO_EXTERNAL_AXES = "[9E9,9E9,9E9,9E9,9E9,9E9]"
JOINT_TARGET = "[[" + ",".join(["%.6f"] * 6) + "]," + NO_EXTERNAL_AXES + "]"
TARGET = "[[%.4f,%.4f,%.4f],[%.8f,%.8f,%.8f,%.8f],[%d,%d,%d,%d]," + NO_EXTERNAL_AXES + "]"
NO_POSE = np.eye(4)
"""Stands in for that of a joint move."""
AROUND = 60
"""Lines of a module beside those of its routines, where it declares few speeds and zones."""
EXTERNAL_SPEEDS = "5000,1000"
"""mm/s and deg/s of external axes; there are none, but speed data must say something."""

KEYWORDS = (
    "alias and backward case connect const default div do else elseif endfor endfunc endif "
    "endmodule endproc endrecord endtest endtrap endwhile error exit false for from func goto "
    "if inout local mod module nostepin not noview or pers proc raise readonly record retry "
    "return step sysmodule task test then to trap true trynext undo var viewonly while with xor "
)
"""Keywords of the language."""
MEANINGS = (
    "bool byte clock confdata dnum errnum extjoint intnum jointtarget loaddata num orient pos "
    "pose robjoint robtarget signaldi signaldo speeddata string tooldata triggdata wobjdata "
    "zonedata abs accset break calcjointt calcrobt cjointt confj confl crobt deactunit "
    "exitcycle fine incr load moveabsj movec movej movel moveldo offs pulsedo reltool reset "
    "round set setao setdo setgo singarea sqrt start stop stopmove tool0 tpwrite triggc triggio "
    "triggj triggl trunc unload velset waitdi waitdo waittime wobj0 load0 "
)
"""Types, instructions and data that every controller defines, where a contour may be named so."""
RESERVED = frozenset((KEYWORDS + MEANINGS).split())
PREDEFINED = re.compile(r"[vz]\d+|vmax|vrot\d+|vlin\d+", re.IGNORECASE)
"""Speeds and zones that every controller defines: v100, z10."""


Name = Annotated[str, StringConstraints(min_length=1, max_length=80)]
Folder = Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9_:/.\-]{1,60}$")]


class RapidSettings(Settings):
    """What the controller calls things."""

    laser_output: Annotated[Name, setting("the name of a digital output", '"doLaser"')] = "doLaser"
    gas_output: Annotated[Name | None, setting("the name of a digital output", '"doGas"')] = None
    tool_name: Annotated[Name, setting("a name for the tool", '"tLaser"')] = "tLaser"
    folder: Annotated[Folder, setting("a folder of the controller", '"HOME:"')] = "HOME:"
    work_object: Annotated[Name, setting("a name for the part's frame", '"wPart"')] = "wPart"


def rules(settings: RapidSettings) -> Rules:
    """Return what RAPID programs must keep to."""
    return Rules(
        longest_name=32,
        slowest=SLOWEST,
        speed_step=SPEED_STEP,
        turning_speed=float(TURNING_SPEED),
        longest_lead=LONGEST_LEAD,
    )


def is_reserved(name: str) -> bool:
    """Return whether RAPID or every ABB controller gives `name` another meaning."""
    return name.lower() in RESERVED or PREDEFINED.fullmatch(name) is not None


class Rapid(Formatter):
    """Writes one module: frames, speeds, zones, a main routine, and one for each section."""

    settings: RapidSettings

    def __init__(self, program: Program, settings: RapidSettings) -> None:
        super().__init__(divided(program, settings.lines_per_file - AROUND), settings)
        moves = program.moves
        joint = [move for move in moves if isinstance(move, JointMove)]
        self.air_speed = _numbered("vAir", (_air_speed(move.speed) for move in joint))
        self._laser_on = dict(_with_laser(moves))
        linear = [(on, _linear_speed(move.speed)) for move, on in self._laser_on.items()]
        self.linear_speed = _numbered("vApproach", (key for key in linear if not key[0]))
        self.linear_speed |= _numbered("vCut", (key for key in linear if key[0]))
        self.zone = _numbered("zCorner", (_zone(move.zone) for move in moves if move.zone > 0))
        switches = [s for m in moves if isinstance(m, LinearMove) for s in m.switches]
        self.trigger: dict[Switch, str] = {}
        for signal, prefix in (("laser", "tr"), ("gas", "trGas")):
            for on, suffix in ((True, "On"), (False, "Off")):
                keys = (s for s in switches if (s.signal, s.on) == (signal, on))
                self.trigger |= _numbered(f"{prefix}{suffix}", keys)

    def files(self) -> dict[str, str]:
        """Return one module, or a main one and those with its routines that it loads."""
        name, sections = self.program.name, self.program.sections
        lines = [len(section.steps) + 3 for section in sections]
        if sum(lines) + AROUND <= self.settings.lines_per_file:
            calls = [f"{section.name};" for section in sections]
            return {f"{name}.mod": _text(self._module(calls, sections))}
        files, calls = {}, []
        for module, part in zip(
            self._modules(), in_files(sections, lines, self.settings.lines_per_file), strict=False
        ):
            place = f'"{self.settings.folder}/{module}.mod"'
            calls += [rf"Load \Dynamic,{place};"]
            calls += [f'%"{section.name}"%;' for section in part]
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
        tool, part = _pose(program.T_flange_tip), _pose(program.T_base_part)
        checked = "been proved clear in the planned cell" if program.air_checked else NOT_CHECKED
        yield f"MODULE {program.name}"
        robot = f"{plain(program.robot.model)} ({plain(program.robot.id)})"
        yield f"  ! Written by kerfpath for {robot}."
        yield "  ! Complete the load of the tool: mass -1 stands for not known."
        yield "  ! The work object is the part in the robot's base, which is the world's, too."
        yield f"  ! Moves through the air have {checked}."
        yield from (f"  ! {said}" for said in program.caveats)
        yield "  ! A stop does not switch the laser off: the safety circuit of the cell has to."
        load = "[-1,[0,0,0],[1,0,0,0],0,0,0]"
        yield f"  PERS tooldata {settings.tool_name}:=[TRUE,{tool},{load}];"
        inner = "[[0,0,0],[1,0,0,0]]"
        yield f'  PERS wobjdata {settings.work_object}:=[FALSE,TRUE,"",{part},{inner}];'
        yield from (f"  CONST speeddata {name}:={value};" for value, name in self._speed_data())
        yield from (f"  CONST zonedata {name}:={value};" for value, name in self.zone.items())
        yield from (f"  VAR triggdata {name};" for name in self.trigger.values())
        yield ""
        yield "  PROC main()"
        yield from (f"    {line}" for line in self.begin())
        yield from (f"    {line}" for line in calls)
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
        yield r"ConfL\Off;"
        for signal in dict.fromkeys(["laser", *(s.signal for s in self.trigger)]):
            yield f"SetDO {self.output(signal)},0;"
        for s, name in self.trigger.items():
            lead = number(s.lead_time, 4)
            yield rf"TriggIO {name},{lead}\Time\DOp:={self.output(s.signal)},{int(s.on)};"

    def names(self) -> list[tuple[str, str]]:
        """Return every name in the module, with what it names."""
        settings = self.settings
        gas = settings.gas_output
        return [
            (self.program.name, "the program"),
            (settings.tool_name, "the tool"),
            (settings.work_object, "the work object"),
            (settings.laser_output, "the output of the laser"),
            *([] if gas is None else [(gas, "the output of the gas")]),
            ("main", "the main routine"),
            *((section.name, "a contour") for section in self.program.sections),
            *((name, "a speed") for _, name in self._speed_data()),
            *((name, "a zone") for name in self.zone.values()),
            *((name, "a switch") for name in self.trigger.values()),
            *((name[:-4], "a module") for name in list(self.files())[1:]),
        ]

    def joint_move(self, move: JointMove) -> Iterator[str]:
        """Yield a MoveAbsJ."""
        speed = self.air_speed[_air_speed(move.speed)]
        yield f"MoveAbsJ {self.target[move][-1]},{speed},{self.end(move)};"

    def linear_move(self, move: LinearMove) -> Iterator[str]:
        """Yield a MoveL, or a TriggL where something is switched."""
        word, triggers = self._switched("L", move)
        target = self.target[move][-1]
        yield f"{word} {target},{self.speed(move)}{triggers},{self.end(move)};"

    def circular_move(self, move: CircularMove) -> Iterator[str]:
        """Yield a MoveC, or a TriggC where something is switched."""
        word, triggers = self._switched("C", move)
        via, target = self.target[move][-2:]
        yield f"{word} {via},{target},{self.speed(move)}{triggers},{self.end(move)};"

    def wait(self, wait: Wait) -> Iterator[str]:
        """Yield a WaitTime."""
        yield f"WaitTime {number(wait.time, 3)};"

    def comment(self, text: str) -> Iterator[str]:
        """Yield a comment."""
        yield f"! {text}"

    @cached_property
    def target(self) -> dict[Move, list[str]]:
        """The targets of each move, all at once; quaternions without a jump of sign."""
        points: list[tuple[Move, Array, Array]] = []
        for move in self.program.moves:
            if isinstance(move, CircularMove):
                points.append((move, move.q_via, move.T_part_via))
            points.append((move, move.q, getattr(move, "T_part_tip", NO_POSE)))
        robot = self.program.robot
        q = np.array([q for _, q, _ in points]).reshape(-1, robot.joints)
        axes_deg = (np.degrees(axes_from_joints(robot, q)).round(6) + 0.0).tolist()
        T = np.array([T for _, _, T in points]).reshape(-1, 4, 4)
        point_mm = (T[:, :3, 3] * 1e3).round(4) + 0.0
        wxyz = quaternions(T).round(8) + 0.0
        rows = np.hstack([point_mm, wxyz, confdata(robot, q)]).tolist()
        texts: dict[Move, list[str]] = {move: [] for move in self.program.moves}
        for (move, _, _), axes, row in zip(points, axes_deg, rows, strict=True):
            texts[move].append(
                JOINT_TARGET % tuple(axes) if isinstance(move, JointMove) else TARGET % tuple(row)
            )
        return texts

    def _speed_data(self) -> list[tuple[str, str]]:
        linear = [(value, name) for (_, value), name in self.linear_speed.items()]
        return [*self.air_speed.items(), *linear]

    def speed(self, move: LinearMove) -> str:
        """Return the name of the speed data of a move."""
        return self.linear_speed[self._laser_on[move], _linear_speed(move.speed)]

    def _switched(self, path: str, move: LinearMove) -> tuple[str, str]:
        names = [self.trigger[s] for s in move.switches]
        later = "".join(rf"\T{i}:={name}" for i, name in enumerate(names[1:], 2))
        return (f"Trigg{path}", f",{names[0]}{later}") if names else (f"Move{path}", "")

    def end(self, move: Move) -> str:
        """Return the zone, tool and work object at the end of a move."""
        zone = self.zone[_zone(move.zone)] if move.zone > 0 else "fine"
        return rf"{zone},{self.settings.tool_name}\WObj:={self.settings.work_object}"


def _numbered(prefix: str, keys: Iterable[_Key]) -> dict[_Key, str]:
    distinct = list(dict.fromkeys(keys))
    if len(distinct) == 1:
        return {distinct[0]: prefix}
    return {key: f"{prefix}{n}" for n, key in enumerate(distinct, 1)}


def _with_laser(moves: Iterable[Move]) -> list[tuple[LinearMove, bool]]:
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
def _linear_speed(speed: float) -> str:
    return f"[{number(speed * 1e3, 2)},{number(np.degrees(TURNING_SPEED), 0)},{EXTERNAL_SPEEDS}]"


@cache
def _air_speed(share: float) -> str:
    speed_mm_s = share * FULL_AIR_SPEED * 1e3
    turning_deg_s = share * np.degrees(TURNING_SPEED)
    return f"[{number(speed_mm_s, 2)},{number(turning_deg_s, 0)},{EXTERNAL_SPEEDS}]"


@cache
def _zone(zone: float) -> str:
    # ABB's own zones turn the tool within 1.5 times the path zone at most; here within the same,
    # and 0.1 deg for each mm.
    zone_mm = number(zone * 1e3, 3)
    zone_deg = number(zone * 1e3 * 0.1, 3)
    return f"[FALSE,{zone_mm},{zone_mm},{zone_mm},{zone_deg},{zone_mm},{zone_deg}]"


def _list(values: Array, decimals: int) -> str:
    return f"[{','.join(number(value, decimals) for value in values)}]"


def _text(lines: Iterable[str]) -> str:
    return "\n".join([*lines, ""])
