"""KRL, the language of KUKA controllers: this module only formats.

Units of KRL: mm, deg, m/s, seconds, and milliseconds in triggers; A, B, C turn about Z, the new Y,
the new X. Speed and corner radius hold until they are changed; they are written where they change,
and at the start of each routine. ``TRIGGER WHEN PATH=0 DELAY=-ms`` switches an output that long
before the end of the linear or circular motion that follows it, or before the point of a rounded
corner that is nearest to that end (KUKA's mxAutomation manual, KRC_SetPathTrigger); a plain
assignment of an output would stop the advance run and with it the blending.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from kerfpath.arrays import Array
from kerfpath.errors import InputError
from kerfpath.post.arcs import euler
from kerfpath.post.build import carrier_frame
from kerfpath.post.krl.controller import (
    AXES,
    LONGEST_NAME,
    KrlSettings,
    axes_from_joints,
    coupled,
    external_fields,
    inherited,
    remarks,
    status_and_turn,
)
from kerfpath.post.languages import (
    Formatter,
    ask_again_lines,
    divide_program,
    handshakes,
    number,
    outputs,
    rename_sections,
    reset_lines,
)
from kerfpath.post.program import (
    Await,
    CircularMove,
    Handshake,
    JointMove,
    LinearMove,
    Move,
    Program,
    Request,
    Section,
    SetPower,
    Wait,
    targets_of,
)

HEAD = ("&ACCESS RVP", "&REL 1")
"""Attributes of every file."""
NEW_LINE = "\r\n"
"""The controllers run Windows."""
MOST_ROUTINES = 254
"""Local routines that a file may have, except the one that switches off."""
LINES_OF_A_FILE = 5
"""HEAD, DEF and END of its first routine, and the empty line at its end."""
FIRST = "first_contour"
"""Number of the contour at which the program begins, for a restart; in the .dat."""
PASSED = "first"
"""The same number, as the parameter of a called file."""
SWITCH_OFF = "switch_off"
"""The routine that switches everything off."""
POWER = "power_out"
"""The analogue output of the power in a routine where it follows the speed."""
INTERRUPT = 20
TIMER = 20
"""The interrupt and the timer that are used; KUKA's own programs use others."""
ANGLES: Final = "ZYX"
"""A, B, C turn about Z, the new Y, the new X."""


def opening_lines(settings: KrlSettings) -> list[str]:
    """Return the statements of a main routine before it calls others, except for frames."""
    numbered = (("TOOL", settings.tool_number), ("BASE", settings.base_number))
    return [
        f"INTERRUPT DECL {INTERRUPT} WHEN $STOPMESS==TRUE DO {SWITCH_OFF}()",
        f"INTERRUPT ON {INTERRUPT}",
        *reset_lines(inherited(settings)),
        *(f"BAS(#{kind},{n})" for kind, n in numbered if n is not None),
        f"{SWITCH_OFF}()",
    ]


def switch_off_lines(settings: KrlSettings) -> list[str]:
    """Return the lines that switch off everything that the settings name."""
    power = [] if settings.power_output is None else [f"$ANOUT[{settings.power_output}]=0"]
    return [*(f"$OUT[{output}]=FALSE" for output in outputs(settings)), *power]


def wait_lines(awaited: Await, asked: Sequence[Handshake], settings: KrlSettings) -> list[str]:
    """Return the lines that wait for an input, and what is done without an answer.

    Everything is switched off and the program halts. When it is continued, what was `asked` for
    before is asked for again.
    """
    ports = handshakes(settings)
    number = ports[awaited.partner, "input"]
    again = ask_again_lines([*asked, awaited], ports, "$OUT[{}]=TRUE", "WAIT FOR $IN[{}]")
    return [
        f"$TIMER[{TIMER}]={-round(awaited.timeout * 1e3)}",
        f"$TIMER_STOP[{TIMER}]=FALSE",
        f"WAIT FOR $IN[{number}] OR $TIMER_FLAG[{TIMER}]",
        f"$TIMER_STOP[{TIMER}]=TRUE",
        f"WHILE NOT $IN[{number}]",
        *switch_off_lines(settings),
        "HALT",
        *again,
        "ENDWHILE",
    ]


def call_lines(first: str, number: int, call: str) -> list[str]:
    """Return the lines that call a contour, or a file up to it, unless the program begins later."""
    return [f"IF {first}<={number} THEN", call, "ENDIF"]


def data_list(name: str, called: Sequence[str], first: int | None = None) -> list[str]:
    """Return the lines of the .dat of a file that calls others: it declares the other files.

    The .dat of the main file contains the number of the contour at which the program begins.
    """
    calls = (f"EXT {other}(INT :IN)" for other in called)
    begin = [] if first is None else [f"INT {FIRST}={first}"]
    bas = "EXT BAS(BAS_COMMAND :IN,REAL :IN)"
    return [*HEAD, f"DEFDAT {name}", bas, *calls, *begin, "ENDDAT", ""]


@dataclass(frozen=True, slots=True, kw_only=True)
class _File:
    """One .src: its first routine, named as the file is, and the local ones."""

    name: str
    first: Sequence[str]
    routines: Mapping[str, Sequence[str]]
    passed: str = ""

    def lines(self) -> list[str]:
        lines = [*HEAD, f"DEF {self.name}({self.passed})", *self.first, "END"]
        for name, routine in self.routines.items():
            lines += ["", f"DEF {name}()", *routine, "END"]
        return [*lines, ""]


class Krl(Formatter):
    """Formatter of a main .src with a routine for each section, and of more files if too long."""

    settings: KrlSettings
    around = 6  # DEF, END, the empty line before them, the call with its condition
    too_long = "warning"

    def __init__(self, program: Program, settings: KrlSettings) -> None:
        named = replace(program, name=program.name[:LONGEST_NAME])
        super().__init__(
            rename_sections(named, (FIRST, PASSED, SWITCH_OFF, POWER), longest_name=LONGEST_NAME),
            settings,
        )
        self._held: dict[str, str] = {}
        self._follows = False
        self._target = self._target_texts()
        self._files = self._in_one_file() or self._in_more_files()

    def files(self) -> dict[str, str]:
        """Return the .src and the .dat of each file, the main program first."""
        others = [file.name for file in self._files[1:]]
        texts: dict[str, str] = {}
        for file in self._files:
            texts[f"{file.name}.src"] = NEW_LINE.join(file.lines())
            is_main = file is self._files[0]
            data = data_list(file.name, others, 1) if is_main else data_list(file.name, [])
            texts[f"{file.name}.dat"] = NEW_LINE.join(data)
        return texts

    def names(self) -> list[tuple[str, str]]:
        """Return every name of a routine or file, with what it names."""
        main, *others = self._files
        return [
            (main.name, "the program"),
            *((file.name, "a file") for file in others),
            (FIRST, "the number of the first contour"),
            (PASSED, "the number of the first contour"),
            (SWITCH_OFF, "the routine that switches off"),
            (POWER, "the output of the power"),
            *((section.name, "a contour") for section in self.program.sections),
        ]

    def lines(self, section: Section) -> Iterator[str]:
        """Yield the lines of a section, which uses no values from the one before."""
        self._held.clear()
        self._follows = False
        if any(isinstance(step, SetPower) and step.per_speed for step in section.steps):
            yield f"SIGNAL {POWER} $ANOUT[{self.output('power')}]"
        yield from super().lines(section)

    def joint_move(self, move: JointMove) -> Iterator[str]:
        """Yield a PTP to axes."""
        yield from self._hold("share", f"BAS(#VEL_PTP,{max(round(move.speed * 100), 1)})")
        yield f"PTP {self._target[move]}"

    def linear_move(self, move: LinearMove) -> Iterator[str]:
        """Yield a LIN, after the triggers of what is switched at its end."""
        yield from self._path_move("LIN", move)

    def circular_move(self, move: CircularMove) -> Iterator[str]:
        """Yield a CIRC, after the triggers of what is switched at its end."""
        yield from self._path_move("CIRC", move)

    def wait(self, wait: Wait) -> Iterator[str]:
        """Yield a WAIT SEC."""
        yield f"WAIT SEC {number(wait.time, 3)}"

    def power(self, power: SetPower) -> Iterator[str]:
        """Yield an assignment; the robot is stopped.

        A power that follows the speed is set by the controller until the next assignment.
        """
        if power.per_speed:
            slope, ahead = number(self.power_per_speed(power), 6), number(power.lead_time, 3)
            yield f"ANOUT ON {POWER}={slope}*$VEL_ACT DELAY=-{ahead}"
            self._follows = True
            return
        if self._follows:
            yield f"ANOUT OFF {POWER}"
        self._follows = False
        yield f"$ANOUT[{self.output('power')}]={self.power_value(power.share, 5)}"

    def request(self, request: Request) -> Iterator[str]:
        """Yield an assignment; the robot is stopped."""
        state = "TRUE" if request.on else "FALSE"
        yield f"$OUT[{self.port(request.partner, 'output')}]={state}"

    def wait_for(self, awaited: Await) -> Iterator[str]:
        """Yield a wait for an input with its timer."""
        yield from wait_lines(awaited, self.asked, self.settings)

    def comment(self, text: str) -> Iterator[str]:
        """Yield a comment; a bar keeps the word FOLD in it from folding the program."""
        yield f"; | {text}"

    def _path_move(self, word: str, move: LinearMove) -> Iterator[str]:
        yield from self._hold("speed", f"$VEL.CP={number(move.speed, 6)}")
        if move.zone > 0:
            yield from self._hold("zone", f"$APO.CDIS={number(move.zone * 1e3, 3)}")
        for switch in move.switches:
            if switch.needs:
                continue
            ahead_ms, state = round(switch.lead_time * 1e3), "TRUE" if switch.on else "FALSE"
            to = f"$OUT[{self.output(switch.signal)}]={state}"
            if switch.signal == "power":
                to = f"$ANOUT[{self.output('power')}]={self.power_value(switch.share, 5)}"
            yield f"TRIGGER WHEN PATH=0 DELAY={-ahead_ms} DO {to}"
        yield f"{word} {self._target[move]}{' C_DIS' if move.zone > 0 else ''}"
        for switch in move.switches:
            if switch.needs:
                needed = " AND ".join(f"$OUT[{port}]" for port in self.needed(switch))
                yield f"$OUT[{self.output(switch.signal)}]={needed}"

    def _hold(self, what: str, line: str) -> Iterator[str]:
        """Yield a line that sets a value from there on, if the value changes."""
        if self._held.get(what) != line:
            self._held[what] = line
            yield line

    def _in_one_file(self) -> list[_File]:
        """Return the program as one file; nothing if it is too long."""
        sections = self.program.sections
        routines = {section.name: list(self.lines(section)) for section in sections}
        calls = (call_lines(FIRST, n, f"{name}()") for n, name in enumerate(routines, 1))
        file = self._main([line for call in calls for line in call], routines)
        fits = len(file.lines()) <= self.settings.lines_per_file
        return [file] if fits and len(sections) <= MOST_ROUTINES else []

    def _in_more_files(self) -> list[_File]:
        """Return a main program and the files it calls between contours, with the beam off."""
        room = self.settings.lines_per_file - LINES_OF_A_FILE
        share = -(-room // MOST_ROUTINES)
        counts = [max(count, share) for count in self.lengths().values()]
        others, calls, number = [], [], 0
        for name, group in divide_program(self.program, counts, room, LONGEST_NAME).items():
            first = [f"INT {PASSED}"]
            for section in group:
                number += 1
                first += call_lines(PASSED, number, f"{section.name}()")
            own = {section.name: list(self.lines(section)) for section in group}
            others.append(_File(name=name, first=first, routines=own, passed=f"{PASSED} :IN"))
            calls += call_lines(FIRST, number, f"{name}({FIRST})")
        main = self._main(calls, {})
        if len(main.lines()) > self.settings.lines_per_file:
            raise InputError(
                f"program {self.program.name!r}: {len(others)} files of "
                f"{self.settings.lines_per_file} lines are more than its main program can call; "
                "raise lines_per_file"
            )
        return [main, *others]

    def _main(self, calls: Sequence[str], routines: Mapping[str, Sequence[str]]) -> _File:
        every = {SWITCH_OFF: switch_off_lines(self.settings), **routines}
        first = [*self._start(), *calls, f"{FIRST}=1"]
        return _File(name=self.program.name, first=first, routines=every)

    def _start(self) -> Iterator[str]:
        program, settings = self.program, self.settings
        load = ["Complete the load of the tool: $LOAD."] * (settings.tool_number is None)
        base = ["$BASE is the part in the robot's base, which is $WORLD, too."]
        base *= settings.base_number is None and not coupled(program.robot)
        axes = remarks(program.robot, settings)
        yield from (f"; {remark}" for remark in self.head(*load, *base, *axes))
        yield f"; {SWITCH_OFF}() runs at a stop message; the safety circuit of the cell has to"
        yield "; switch the laser off, too."
        yield f"; To begin at a contour set {FIRST} in the .dat to its number, and reset."
        yield from opening_lines(settings)
        if settings.tool_number is None:
            yield f"$TOOL={{{_frames(program.T_flange_tip[None])[0]}}}"
        if coupled(program.robot):
            frame = carrier_frame(program.robot, settings.positioner_frame)
            part = _frames((np.linalg.inv(frame) @ program.T_base_part)[None])[0]
            machine = f"MACHINE_DEF[{settings.machine_number}]"
            yield f"$BASE=EK({machine}.ROOT,{machine}.MECH_TYPE,{{{part}}})"
        elif settings.base_number is None:
            yield f"$BASE={{{_frames(program.T_base_part[None])[0]}}}"

    def _target_texts(self) -> dict[Move, str]:
        """Return the targets of each move, all at once."""
        robot, points = self.program.robot, targets_of(self.program.moves)
        q = np.array([point.q for point in points]).reshape(-1, robot.joints)
        axes_deg = np.degrees(axes_from_joints(robot, q)).tolist()
        words = status_and_turn(robot, q).tolist()
        frames = iter(_frames([T for _, _, T in points if T is not None]))
        external = external_fields(robot, q, self.settings)
        texts: dict[Move, str] = {}
        for (move, _, T), axes, (status, turn), more in zip(
            points, axes_deg, words, external, strict=True
        ):
            if T is None:
                texts[move] = f"{{{_fields(AXES, axes, 6)}{more}}}"
            elif isinstance(move, CircularMove) and T is move.T_part_via:
                texts[move] = f"{{{next(frames)}}},"
            else:
                via = texts[move] if isinstance(move, CircularMove) else ""
                texts[move] = f"{via}{{{next(frames)},S {status},T {turn}{more}}}"
        return texts


def _frames(T: Array | Sequence[Array]) -> list[str]:
    """Return the fields of poses (K, 4, 4) m: mm, and deg about Z, the new Y, the new X."""
    return [
        f"{_fields('XYZ', values[:3], 4)},{_fields('ABC', values[3:], 6)}"
        for values in euler(T, ANGLES).tolist()
    ]


def _fields(names: Sequence[str], values: Sequence[float], decimals: int) -> str:
    pairs = zip(names, values, strict=True)
    return ",".join(f"{name} {number(value, decimals)}" for name, value in pairs)
