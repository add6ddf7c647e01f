r"""RAPID, the language of ABB controllers: this module only formats.

Units of RAPID: mm, deg, mm/s, kg, seconds; quaternions w first. A linear target is written in
place, so that one line says where the tip goes, how fast and how closely. ``TriggIO x,t\Time`` and
``TriggL`` switch an output t seconds before the tip reaches the end of that one move; a plain
``SetDO`` in its place would act as soon as the program is read ahead.
"""

from __future__ import annotations

import re
from collections.abc import Hashable, Iterable, Iterator
from typing import TypeVar

import numpy as np
from scipy.spatial.transform import Rotation

from kerfpath._arrays import Array
from kerfpath.post._abb import axes_from_joints, confdata
from kerfpath.post._program import (
    Comment,
    JointMove,
    LaserOff,
    LaserOn,
    LinearMove,
    Program,
    Section,
    Step,
    Wait,
)

__all__ = ["LONGEST_LEAD", "SLOWEST", "TURNING_SPEED", "declared", "is_reserved", "rapid"]

_Key = TypeVar("_Key", bound=Hashable)

FULL_AIR_SPEED = 1.0
"""Tip speed (m/s) that a joint move at its full share is given: RAPID knows no share."""
TURNING_SPEED = np.radians(500.0)
"""v_ori of all speed data, rad/s: ABB's own for its predefined speeds."""
SLOWEST = 1e-5
"""Lowest speed (m/s) that two decimals of mm/s say to within half."""
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


def rapid(program: Program) -> str:
    """Return the text of a RAPID module; `preflight` has approved the program."""
    names = _Names(program)
    tool, part = _pose(program.T_flange_tip), _pose(program.T_base_part)
    lines = [
        f"MODULE {program.name}",
        f"  ! Written by kerfpath for {_plain(program.robot.model)} ({_plain(program.robot.id)}).",
        "  ! Complete the load of the tool: mass -1 stands for not known.",
        "  ! The work object is the part in the robot's base, with the world frame at that base.",
        "  ! Moves through the air have "
        f"{'been proved clear in the planned cell' if program.air_checked else NOT_CHECKED}.",
        "  ! A stop does not switch the laser off: the safety circuit of the cell has to.",
        f"  PERS tooldata {program.tool_name}:=[TRUE,{tool},[-1,[0,0,0],[1,0,0,0],0,0,0]];",
        f'  PERS wobjdata {program.work_object}:=[FALSE,TRUE,"",{part},[[0,0,0],[1,0,0,0]]];',
        *(f"  CONST speeddata {name}:={value};" for value, name in names.speeds()),
        *(f"  CONST zonedata {name}:={value};" for value, name in names.zone.items()),
        *(f"  VAR triggdata {name};" for name in names.trigger.values()),
        "",
        "  PROC main()",
        r"    ConfL\Off;",
        f"    SetDO {program.laser_output},0;",
        *(
            rf"    TriggIO {name},{lead}\Time\DOp:={program.laser_output},{value};"
            for (value, lead), name in names.trigger.items()
        ),
        *(f"    {section.name};" for section in program.sections),
        "  ENDPROC",
    ]
    targets = _targets(program)
    for section in program.sections:
        lines += ["", f"  PROC {section.name}()"]
        lines += [f"    {line}" for line in _section(program, section, names, targets)]
        lines += ["  ENDPROC"]
    return "\n".join([*lines, "ENDMODULE", ""])


def declared(program: Program) -> list[tuple[str, str]]:
    """Return every name in the module of `program`, with what it names."""
    names = _Names(program)
    return [
        (program.name, "the program"),
        (program.tool_name, "the tool"),
        (program.work_object, "the work object"),
        (program.laser_output, "the output of the laser"),
        ("main", "the main routine"),
        *((section.name, "a contour") for section in program.sections),
        *((name, "a speed") for _, name in names.speeds()),
        *((name, "a zone") for name in names.zone.values()),
        *((name, "a switch of the laser") for name in names.trigger.values()),
    ]


def is_reserved(name: str) -> bool:
    """Return whether RAPID or every ABB controller gives `name` another meaning."""
    return name.lower() in RESERVED or PREDEFINED.fullmatch(name) is not None


class _Names:
    """Names of the distinct speeds, zones and switches of a program, each by its text."""

    def __init__(self, program: Program) -> None:
        steps = program.steps
        moves = [step for step in steps if isinstance(step, JointMove | LinearMove)]
        self.air_speed = _numbered(
            "vAir", (_air_speed(move) for move in moves if isinstance(move, JointMove))
        )
        speeds = [
            (on, _linear_speed(step))
            for section in program.sections
            for step, on in _with_laser(section)
            if isinstance(step, LinearMove)
        ]
        self.linear_speed = _numbered("vApproach", (key for key in speeds if not key[0]))
        self.linear_speed |= _numbered("vCut", (key for key in speeds if key[0]))
        self.zone = _numbered("zCorner", (_zone(move) for move in moves if move.zone > 0))
        switches = [_switch(step) for step in steps if isinstance(step, LaserOn | LaserOff)]
        self.trigger = _numbered("trOn", (key for key in switches if key[0]))
        self.trigger |= _numbered("trOff", (key for key in switches if not key[0]))

    def speeds(self) -> list[tuple[str, str]]:
        linear = [(value, name) for (_, value), name in self.linear_speed.items()]
        return [*self.air_speed.items(), *linear]

    def end(self, move: LinearMove | JointMove) -> str:
        return self.zone[_zone(move)] if move.zone > 0 else "fine"


def _numbered(prefix: str, keys: Iterable[_Key]) -> dict[_Key, str]:
    distinct = list(dict.fromkeys(keys))
    if len(distinct) == 1:
        return {distinct[0]: prefix}
    return {key: f"{prefix}{number}" for number, key in enumerate(distinct, 1)}


def _with_laser(section: Section) -> Iterator[tuple[Step, bool]]:
    """Yield each step with whether it is done with the laser on."""
    on = False
    for step in section.steps:
        yield step, on
        on = isinstance(step, LaserOn) or (on and not isinstance(step, LaserOff))


def _section(
    program: Program, section: Section, names: _Names, targets: Iterator[str]
) -> Iterator[str]:
    frames = rf"{program.tool_name}\WObj:={program.work_object};"
    following: tuple[Step | None, ...] = (*section.steps[1:], None)
    for (step, laser_on), after in zip(_with_laser(section), following, strict=True):
        if isinstance(step, Comment):
            yield f"! {_plain(step.text)}"
        elif isinstance(step, Wait):
            yield f"WaitTime {_number(step.time, 3)};"
        elif isinstance(step, JointMove):
            speed = names.air_speed[_air_speed(step)]
            yield f"MoveAbsJ {next(targets)},{speed},{names.end(step)},{frames}"
        elif isinstance(step, LinearMove):
            speed = names.linear_speed[laser_on, _linear_speed(step)]
            if isinstance(after, LaserOn | LaserOff):
                trigger = names.trigger[_switch(after)]
                yield f"TriggL {next(targets)},{speed},{trigger},{names.end(step)},{frames}"
            else:
                yield f"MoveL {next(targets)},{speed},{names.end(step)},{frames}"


def _targets(program: Program) -> Iterator[str]:
    """Yield the target of each move; solved for all at once, quaternions without a jump of sign."""
    moves = [step for step in program.steps if isinstance(step, JointMove | LinearMove)]
    q = np.array([move.q for move in moves])
    axes_deg = np.degrees(axes_from_joints(program.robot, q))
    before = np.array([1.0, 0.0, 0.0, 0.0])
    for move, axes, conf in zip(moves, axes_deg, confdata(program.robot, q), strict=True):
        if isinstance(move, JointMove):
            yield f"[{_list(axes, 6)},{NO_EXTERNAL_AXES}]"
        else:
            wxyz = _wxyz(move.T_part_tip)
            before = wxyz if wxyz @ before >= 0 else -wxyz
            point_mm = move.T_part_tip[:3, 3] * 1e3
            conf_text = ",".join(str(number) for number in conf)
            yield (f"[{_list(point_mm, 4)},{_list(before, 8)},[{conf_text}],{NO_EXTERNAL_AXES}]")


def _wxyz(T: Array) -> Array:
    return np.asarray(Rotation.from_matrix(T[:3, :3]).as_quat(canonical=True, scalar_first=True))


def _pose(T: Array) -> str:
    return f"[{_list(T[:3, 3] * 1e3, 4)},{_list(_wxyz(T), 8)}]"


def _linear_speed(move: LinearMove) -> str:
    speed_mm_s, turning_deg_s = move.speed * 1e3, np.degrees(TURNING_SPEED)
    return f"[{_number(speed_mm_s, 2)},{_number(turning_deg_s, 0)},{EXTERNAL_SPEEDS}]"


def _air_speed(move: JointMove) -> str:
    speed_mm_s = move.speed * FULL_AIR_SPEED * 1e3
    turning_deg_s = move.speed * np.degrees(TURNING_SPEED)
    return f"[{_number(speed_mm_s, 2)},{_number(turning_deg_s, 0)},{EXTERNAL_SPEEDS}]"


def _zone(move: LinearMove | JointMove) -> str:
    # ABB's own zones turn the tool within 1.5 times the path zone at most; here within the same,
    # and 0.1 deg for each mm.
    zone_mm = _number(move.zone * 1e3, 3)
    zone_deg = _number(move.zone * 1e3 * 0.1, 3)
    return f"[FALSE,{zone_mm},{zone_mm},{zone_mm},{zone_deg},{zone_mm},{zone_deg}]"


def _switch(step: LaserOn | LaserOff) -> tuple[int, str]:
    return int(isinstance(step, LaserOn)), _number(step.lead_time, 4)


def _number(value: float, decimals: int) -> str:
    # Adding zero turns a rounded -0.0 into 0.0.
    return f"{round(float(value), decimals) + 0.0:.{decimals}f}"


def _list(values: Array, decimals: int) -> str:
    return f"[{','.join(_number(value, decimals) for value in values)}]"


def _plain(text: str) -> str:
    """Return `text` on one line, in the characters that every controller reads."""
    return re.sub(r"[^ -~]", "?", text)
