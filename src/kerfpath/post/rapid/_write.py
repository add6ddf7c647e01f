r"""RAPID, the language of ABB controllers: this module only formats.

Units of RAPID: mm, deg, mm/s, kg, seconds; quaternions w first. A linear target is written in
place, so that one line says where the tip goes, how fast and how closely. ``TriggIO x,t\Time`` and
``TriggL`` switch an output t seconds before the tip reaches the end of that one move; a plain
``SetDO`` in its place would act as soon as the program is read ahead.
"""

from __future__ import annotations

import re
from collections.abc import Hashable, Iterable, Iterator
from typing import Annotated, TypeVar

import numpy as np
from pydantic import StringConstraints
from scipy.spatial.transform import Rotation

from kerfpath._arrays import Array
from kerfpath.post._formatter import Formatter, number, plain
from kerfpath.post._program import (
    CircularMove,
    JointMove,
    LinearMove,
    Move,
    Program,
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


class RapidSettings(Settings):
    """What the controller calls things."""

    laser_output: Annotated[Name, setting("the name of a digital output", '"doLaser"')] = "doLaser"
    gas_output: Annotated[Name | None, setting("the name of a digital output", '"doGas"')] = None
    tool_name: Annotated[Name, setting("a name for the tool", '"tLaser"')] = "tLaser"
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
        super().__init__(program, settings)
        moves = program.moves
        joint = [move for move in moves if isinstance(move, JointMove)]
        self.air_speed = _numbered("vAir", (_air_speed(move) for move in joint))
        linear = [(on, _linear_speed(move)) for move, on in _with_laser(moves)]
        self.linear_speed = _numbered("vApproach", (key for key in linear if not key[0]))
        self.linear_speed |= _numbered("vCut", (key for key in linear if key[0]))
        self.zone = _numbered("zCorner", (_zone(move) for move in moves if move.zone > 0))
        switches = [s for m in moves if isinstance(m, LinearMove) for s in m.switches]
        self.trigger: dict[Switch, str] = {}
        for signal, prefix in (("laser", "tr"), ("gas", "trGas")):
            for on, suffix in ((True, "On"), (False, "Off")):
                keys = (s for s in switches if (s.signal, s.on) == (signal, on))
                self.trigger |= _numbered(f"{prefix}{suffix}", keys)
        self.target = self._target_texts()
        self._laser_on = dict(_with_laser(moves))

    def files(self) -> dict[str, str]:
        """Return the one module."""
        return {f"{self.program.name}.mod": "\n".join([*self._module(), ""])}

    def _module(self) -> Iterator[str]:
        program, settings = self.program, self.settings
        tool, part = _pose(program.T_flange_tip), _pose(program.T_base_part)
        checked = "been proved clear in the planned cell" if program.air_checked else NOT_CHECKED
        yield f"MODULE {program.name}"
        robot = f"{plain(program.robot.model)} ({plain(program.robot.id)})"
        yield f"  ! Written by kerfpath for {robot}."
        yield "  ! Complete the load of the tool: mass -1 stands for not known."
        yield "  ! The work object is the part in the robot's base, which is the world's, too."
        yield f"  ! Moves through the air have {checked}."
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
        yield from (f"    {line}" for line in self.main())
        yield "  ENDPROC"
        for section in program.sections:
            yield ""
            yield f"  PROC {section.name}()"
            yield from (f"    {line}" for line in self.lines(section))
            yield "  ENDPROC"
        yield "ENDMODULE"

    def main(self) -> Iterator[str]:
        """Yield the lines of the main routine."""
        yield r"ConfL\Off;"
        for signal in dict.fromkeys(["laser", *(s.signal for s in self.trigger)]):
            yield f"SetDO {self.output(signal)},0;"
        for s, name in self.trigger.items():
            lead = number(s.lead_time, 4)
            yield rf"TriggIO {name},{lead}\Time\DOp:={self.output(s.signal)},{int(s.on)};"
        yield from (f"{section.name};" for section in self.program.sections)

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
        ]

    def joint_move(self, move: JointMove) -> Iterator[str]:
        """Yield a MoveAbsJ."""
        speed = self.air_speed[_air_speed(move)]
        yield f"MoveAbsJ {self.target[move][-1]},{speed},{self._end(move)};"

    def linear_move(self, move: LinearMove) -> Iterator[str]:
        """Yield a MoveL, or a TriggL where something is switched."""
        word, triggers = self._switched("L", move)
        target = self.target[move][-1]
        yield f"{word} {target},{self._speed(move)}{triggers},{self._end(move)};"

    def circular_move(self, move: CircularMove) -> Iterator[str]:
        """Yield a MoveC, or a TriggC where something is switched."""
        word, triggers = self._switched("C", move)
        via, target = self.target[move]
        yield f"{word} {via},{target},{self._speed(move)}{triggers},{self._end(move)};"

    def wait(self, wait: Wait) -> Iterator[str]:
        """Yield a WaitTime."""
        yield f"WaitTime {number(wait.time, 3)};"

    def comment(self, text: str) -> Iterator[str]:
        """Yield a comment."""
        yield f"! {text}"

    def _target_texts(self) -> dict[Move, list[str]]:
        """Return the targets of each move, all at once; quaternions without a jump of sign."""
        points: list[tuple[Move, Array, Array | None]] = []
        for move in self.program.moves:
            if isinstance(move, CircularMove):
                points.append((move, move.q_via, move.T_part_via))
            points.append((move, move.q, getattr(move, "T_part_tip", None)))
        robot = self.program.robot
        q = np.array([q for _, q, _ in points]).reshape(-1, robot.joints)
        axes_deg = np.degrees(axes_from_joints(robot, q))
        texts: dict[Move, list[str]] = {move: [] for move in self.program.moves}
        before = np.array([1.0, 0.0, 0.0, 0.0])
        for (move, _, T), axes, conf in zip(points, axes_deg, confdata(robot, q), strict=True):
            if T is None:
                texts[move].append(f"[{_list(axes, 6)},{NO_EXTERNAL_AXES}]")
                continue
            wxyz = _wxyz(T)
            before = wxyz if wxyz @ before >= 0 else -wxyz
            quarters = ",".join(str(n) for n in conf)
            point = _list(T[:3, 3] * 1e3, 4)
            texts[move].append(f"[{point},{_list(before, 8)},[{quarters}],{NO_EXTERNAL_AXES}]")
        return texts

    def _speed_data(self) -> list[tuple[str, str]]:
        linear = [(value, name) for (_, value), name in self.linear_speed.items()]
        return [*self.air_speed.items(), *linear]

    def _speed(self, move: LinearMove) -> str:
        return self.linear_speed[self._laser_on[move], _linear_speed(move)]

    def _switched(self, path: str, move: LinearMove) -> tuple[str, str]:
        names = [self.trigger[s] for s in move.switches]
        later = "".join(rf"\T{i}:={name}" for i, name in enumerate(names[1:], 2))
        return (f"Trigg{path}", f",{names[0]}{later}") if names else (f"Move{path}", "")

    def _end(self, move: Move) -> str:
        zone = self.zone[_zone(move)] if move.zone > 0 else "fine"
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


def _wxyz(T: Array) -> Array:
    return np.asarray(Rotation.from_matrix(T[:3, :3]).as_quat(canonical=True, scalar_first=True))


def _pose(T: Array) -> str:
    return f"[{_list(T[:3, 3] * 1e3, 4)},{_list(_wxyz(T), 8)}]"


def _linear_speed(move: LinearMove) -> str:
    speed_mm_s, turning_deg_s = move.speed * 1e3, np.degrees(TURNING_SPEED)
    return f"[{number(speed_mm_s, 2)},{number(turning_deg_s, 0)},{EXTERNAL_SPEEDS}]"


def _air_speed(move: JointMove) -> str:
    speed_mm_s = move.speed * FULL_AIR_SPEED * 1e3
    turning_deg_s = move.speed * np.degrees(TURNING_SPEED)
    return f"[{number(speed_mm_s, 2)},{number(turning_deg_s, 0)},{EXTERNAL_SPEEDS}]"


def _zone(move: Move) -> str:
    # ABB's own zones turn the tool within 1.5 times the path zone at most; here within the same,
    # and 0.1 deg for each mm.
    zone_mm = number(move.zone * 1e3, 3)
    zone_deg = number(move.zone * 1e3 * 0.1, 3)
    return f"[FALSE,{zone_mm},{zone_mm},{zone_mm},{zone_deg},{zone_mm},{zone_deg}]"


def _list(values: Array, decimals: int) -> str:
    return f"[{','.join(number(value, decimals) for value in values)}]"
