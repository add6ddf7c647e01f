"""TP, the language of FANUC controllers, as listings: this module only formats.

Units of TP: mm, deg, cm/min or mm/sec, per cent, seconds in hundredths. A listing is one
program: attributes, numbered lines, and the positions that they name. TB on the line of a
motion switches an output the given time before the tip reaches its end; a separate line after a
motion that stops switches it once the tip is there.

The layout is that of controllers' own listings: LeroyDu56/robconv, docs/fanuc_ls_format.md and
tests/fixtures/fanuc/roboguide_export, JuniorNatalin/VASC (TB).
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from itertools import count
from typing import Final

import numpy as np

from kerfpath.arrays import Ints
from kerfpath.post.arcs import TICK, euler, not_whole
from kerfpath.post.build import part_motion
from kerfpath.post.fanuc.controller import (
    FEWEST_TURNS,
    MOST_TURNS,
    FanucSettings,
    axes_from_joints,
    extended_rows,
    group_2_rows,
    groups,
    inherited,
    leads,
    posture,
    remarks,
    split_switches,
    turns,
    unit,
)
from kerfpath.post.harmless import LinePattern, compact
from kerfpath.post.languages import number, outputs, reset_lines
from kerfpath.post.line_reader import BLANK, LineReader, program_lines
from kerfpath.post.places import CalledFormatter
from kerfpath.post.program import (
    Await,
    CircularMove,
    JointMove,
    LinearMove,
    Program,
    ProgramIssue,
    Request,
    Section,
    SetPower,
    Switch,
    Wait,
    targets_of,
    warn_of_changed_postures,
)
from kerfpath.robots import Robot

# -----------------------------------------------------------------------------
# One listing of a FANUC controller: attributes, numbered lines, and what follows them.
#
# Attributes that controllers add when they list a program again are accepted.

_ATTRIBUTE = re.compile(
    r"(?:(?:OWNER|COMMENT|PROG_SIZE|CREATE|MODIFIED|FILE_NAME|VERSION|MEMORY_SIZE|PROTECT|"
    r"CONTROL_CODE|LOCAL_REGISTERS)[ \t]*=[^;]*;|"
    r"(?:TCD:)?[ \t]+(?:(?:STACK_SIZE|TIME_SLICE|BUSY_LAMP_OFF)[ \t]*= \d+|"
    r"TASK_PRIORITY[ \t]*= 50|(?:ABORT|PAUSE)_REQUEST[ \t]*= 0)[,;])",
    re.ASCII,
)
_GROUPS = re.compile(r"DEFAULT_GROUP[ \t]*= ([1*](?:,[1*]){4,7});")
_COUNT = re.compile(r"LINE_COUNT[ \t]*= (\d+);", re.ASCII)
_NUMBERED = re.compile(r" *(\d*):(.*?) *;", re.ASCII)
_VIA = re.compile(r" *\d*:C P\[\d+(?::[^\]]*)?\] *", re.ASCII)
_ITEM = re.compile(r"\b(P|DI|DO|UO|LBL)\[(\d+):[^\]]*\]", re.ASCII)
"""An item with a comment, which the pendant shows beside its number."""


class Listing(LineReader):
    """One program: attributes, then numbered lines."""

    settings: FanucSettings
    language = "fanuc"
    too_early = "the listing ends too early; /END is missing"

    def __init__(self, file: str, text: str, robot: Robot, settings: FanucSettings) -> None:
        rows = [(n, row.rstrip(BLANK)) for n, row in enumerate(program_lines(file, text), 1)]
        super().__init__(file, robot, settings)
        self.rows = [(n, row) for n, row in rows if row]
        self.name = ""

    def body(self, kinds: Mapping[str, LinePattern], group: str) -> None:
        """Read the attributes and the numbered lines, up to /POS.

        `group` has the motion groups that the program must have; controllers may list more.
        """
        match = re.fullmatch(r"/PROG +([A-Z][A-Z0-9_]*)", self.next_row())
        self.name = match[1] if match else ""
        if f"{self.name}.ls".lower() != self.file.rpartition("/")[2].lower():
            raise self.fault(f"expected /PROG and the name of the file, got {self.text[:60]!r}")
        if (row := self.next_row()) != "/ATTR":
            raise self.fault(f"expected /ATTR, got {row[:60]!r}")
        counted, grouped = None, False
        while (row := self.next_row()) != "/MN":
            if match := _COUNT.fullmatch(row):
                counted = int(match[1])
            elif match := _GROUPS.fullmatch(row):
                if match[1].rstrip("*,") != group.rstrip("*,"):
                    raise self.fault(f"expected DEFAULT_GROUP = {group}, got {match[1]}")
                grouped = True
            elif not _ATTRIBUTE.fullmatch(row) and row != "/APPL":
                raise self.fault(
                    f"not an attribute of a listing in English: {row[:60]!r}; set the controller "
                    "to English and list the program again"
                )
        if not grouped:
            raise self.fault(f"expected DEFAULT_GROUP = {group} before this line")
        number, numbers = 0, set[bool]()
        while (row := self.next_row()) != "/POS":
            number += 1
            if _VIA.fullmatch(row):
                row += self.next_row()
            if not row.endswith(";"):
                raise self.fault(
                    f"expected ; at the end of the line, got {row[-60:]!r}; write a statement that "
                    "goes on in the next line in one"
                )
            match = _NUMBERED.fullmatch(row)
            if not match or match[1] not in ("", str(number)):
                raise self.fault(f"expected line number {number}, got {self.text[:60]!r}")
            numbers.add(match[1] == "")
            self.read(match[2], kinds)
        if len(numbers) > 1:
            raise self.fault("expected either all lines to be numbered, or none")
        if counted != number:
            raise self.fault(f"LINE_COUNT is {counted}, but there are {number} lines")

    def plain(self, row: str) -> str:
        """Return a row as it is compared: without needless blanks and comments on items."""
        return row if self.is_remark(row) else compact(_ITEM.sub(r"\1[\2]", row))

    def is_remark(self, row: str) -> bool:
        return row.lstrip(BLANK).startswith("!")

    def require_next(
        self, lines: Iterable[str], flow_lines: Mapping[str, LinePattern] | None = None
    ) -> None:
        super().require_next((line.removesuffix(" ;").rstrip() for line in lines), flow_lines)

    def end(self) -> None:
        """Read the end of the listing."""
        self.require_complete()
        if self.next_row() != "/END" or self.row + 1 < len(self.rows):
            raise self.fault(f"expected /END and nothing after it, got {self.text[:60]!r}")

    def require_frames(self, user: str, tool: str) -> None:
        """Refuse frames whose numbers are not those of the settings."""
        expected = [self.settings.user_frame, self.settings.tool_frame]
        if [int(user), int(tool)] != expected:
            raise self.fault(
                f"expected user frame {expected[0]} and tool frame {expected[1]}, got {user} and "
                f"{tool}"
            )


# -----------------------------------------------------------------------------
# The formatter of programs.

ANGLES: Final = "xyz"
"""W turns about x, then P about y, then R about z, all axes fixed."""
WRIST = " Wjnt"
"""Option of path motions: the wrist moves evenly in its joints."""
NEW_LINE = "\r\n"
PADDING = "    "
REMARK = 32
"""Characters of a remark that every controller keeps."""
NO_GROUP = "*,*,*,*,*"
"""Motion groups of a program without motion, as background logic must be."""
NO_ANSWER = 1
"""The label to which a wait for an input jumps without an answer."""
JOINT_WORDS = tuple((f"J{k}=", "deg") for k in range(1, 7))
POSE_WORDS = tuple((f"{k} =", " mm") for k in "XYZ") + tuple((f"{k} =", "deg") for k in "WPR")
ATTRIBUTES = """/ATTR
OWNER\t\t= MNEDITOR;
COMMENT\t\t= "kerfpath";
PROG_SIZE\t= 0;
CREATE\t\t= DATE {day}  TIME {time};
MODIFIED\t= DATE {day}  TIME {time};
FILE_NAME\t= ;
VERSION\t\t= 0;
LINE_COUNT\t= {count};
MEMORY_SIZE\t= 0;
PROTECT\t\t= READ_WRITE;
TCD:  STACK_SIZE\t= 0,
      TASK_PRIORITY\t= 50,
      TIME_SLICE\t= 0,
      BUSY_LAMP_OFF\t= 0,
      ABORT_REQUEST\t= 0,
      PAUSE_REQUEST\t= 0;
DEFAULT_GROUP\t= {group};
CONTROL_CODE\t= 00000000 00000000;
"""
"""Controllers count sizes themselves; the date comes from the settings, so that bytes repeat."""


def selection_lines(settings: FanucSettings) -> list[str]:
    """Return the lines that select the frames; each program has them and can start alone."""
    return [f"  UFRAME_NUM={settings.user_frame} ;", f"  UTOOL_NUM={settings.tool_frame} ;"]


def opening_lines(settings: FanucSettings) -> list[str]:
    """Return the lines of the main program before it calls the others."""
    resets = (f"  {line} ;" for line in reset_lines(inherited(settings)))
    return [*selection_lines(settings), *resets, *switch_off_lines(settings)]


def switch_off_lines(settings: FanucSettings) -> list[str]:
    """Return the lines that switch everything off."""
    power = [] if settings.power_output is None else [f"  AO[{settings.power_output}]=0 ;"]
    return [*(f"  DO[{output}]=OFF ;" for output in outputs(settings)), *power]


def abort_lines(settings: FanucSettings) -> list[str]:
    """Return the last lines of a program that waits for inputs: what is done without an answer."""
    return ["  END ;", f"  LBL[{NO_ANSWER}] ;", *switch_off_lines(settings), "  ABORT ;"]


def watch_lines(settings: FanucSettings) -> list[str]:
    """Return the lines that background logic runs: all is off while no program runs (UO[3])."""
    off = [f"  IF (!UO[3]),DO[{output}]=(OFF) ;" for output in outputs(settings)]
    if settings.power_output is not None:
        off.append(f"  IF (!UO[3]),AO[{settings.power_output}]=(0) ;")
    return ["  ! Run this as BG logic (SETUP) ;", *off]


class Fanuc(CalledFormatter):
    """Formatter of one listing for each section, and of a main program that calls them."""

    settings: FanucSettings
    too_long = "error"

    remark_width = REMARK - 1
    angles = ANGLES
    frame_words = tuple("XYZWPR")
    frame_line = "  !%s %s %s ;"

    def files(self) -> dict[str, str]:
        """Return the main program and those that it calls."""
        name, settings = self.program.name, self.settings
        own = groups(self.program.robot)
        files = {f"{name}.ls": _listing(name, self.main(), [], settings, own)}
        for section in self.program.sections:
            lines = list(self.lines(section))
            positions = self._positions(section)
            files[f"{section.name}.ls"] = _listing(section.name, lines, positions, settings, own)
        off = self.off_name
        files[f"{off}.ls"] = _listing(off, watch_lines(settings), [], settings, NO_GROUP)
        return files

    def main(self) -> list[str]:
        """Return the lines of the main program."""
        program, settings = self.program, self.settings
        lines = self.heading(
            f"{self.off_name} as BG logic switches off at a stop.",
            "The cell's safety has to switch the laser off, too.",
            *remarks(program.robot),
            "Enter these frames (mm, deg). World: on J1, at the height of J2.",
            frame=f"UFRAME {settings.user_frame}",
            tool=f"UTOOL {settings.tool_frame}",
        )
        calls = [f"  CALL {section.name}{PADDING};" for section in program.sections]
        return [*lines, *opening_lines(settings), *calls]

    def lines(self, section: Section) -> Iterator[str]:
        """Yield the lines of all steps of a section, its targets numbered from 1."""
        self._target = count(1)
        yield from selection_lines(self.settings)
        yield from super().lines(section)
        if any(isinstance(step, Await) for step in section.steps):
            yield from abort_lines(self.settings)

    def joint_move(self, move: JointMove) -> Iterator[str]:
        """Yield a J motion, which has no corner region."""
        end = "FINE" if move.zone == 0 else f"CNT{self.settings.cnt_percent}"
        yield f"J P[{next(self._target)}] {number(move.speed * 100, 0)}% {end}{PADDING};"

    def linear_move(self, move: LinearMove) -> Iterator[str]:
        """Yield an L motion with the switches before and after it."""
        yield from self._before(move)
        yield f"L P[{next(self._target)}] {self._path_end(move)}{PADDING};"
        yield from self._after(move)

    def circular_move(self, move: CircularMove) -> Iterator[str]:
        """Yield a C motion, in two rows under one number, with the switches before and after it."""
        yield from self._before(move)
        via, end = next(self._target), next(self._target)
        row = f"C P[{via}]{PADDING}{NEW_LINE}    :  P[{end}]"
        yield f"{row} {self._path_end(move)}{PADDING};"
        yield from self._after(move)

    def wait(self, wait: Wait) -> Iterator[str]:
        """Yield a WAIT."""
        yield f"  WAIT {_seconds(wait.time)}(sec) ;"

    def power(self, power: SetPower) -> Iterator[str]:
        """Yield an analogue output; the robot is stopped."""
        yield f"  AO[{self.output('power')}]={self.power_value(power.share, 0)} ;"

    def request(self, request: Request) -> Iterator[str]:
        """Yield an output; the robot is stopped."""
        yield f"  DO[{self.port(request.partner, 'output')}]={'ON' if request.on else 'OFF'} ;"

    def wait_for(self, awaited: Await) -> Iterator[str]:
        """Yield a WAIT for an input; without an answer the program aborts with all off."""
        yield f"  $WAITTMOUT={round(awaited.timeout * 100)} ;"
        number = self.port(awaited.partner, "input")
        yield f"  WAIT DI[{number}]=ON TIMEOUT,LBL[{NO_ANSWER}] ;"

    def comment(self, text: str) -> Iterator[str]:
        """Yield remarks; a semicolon would end them, and remarks with frames have no space."""
        yield from (f"  ! {line} ;" for line in self.wrap(text.replace(";", ",")))

    def _path_end(self, move: LinearMove) -> str:
        """Return the speed of a move, its end, and the switches on the way there."""
        settings = self.settings
        end = "FINE"
        if move.zone > 0 and settings.corner == "CNT":
            end = f"CNT{settings.cnt_percent}"
        elif move.zone > 0:
            end = f"CR{number(move.zone * 1e3, 0)}"
        end += WRIST if settings.orientation == "wrist" else ""
        end += " COORD" if leads(self.program.robot) else ""
        timed = split_switches(move).timed
        before = "".join(f" TB {_seconds(s.lead_time)}sec,{self._set(s)}" for s in timed)
        return f"{number(move.speed / unit(settings), 0)}{settings.speed_unit} {end}{before}"

    def _before(self, move: LinearMove) -> Iterator[str]:
        yield from (f"  {self._set(switch)} ;" for switch in split_switches(move).before)

    def _after(self, move: LinearMove) -> Iterator[str]:
        yield from (f"  {self._set(switch)} ;" for switch in split_switches(move).after)

    def _set(self, switch: Switch) -> str:
        output, state = self.output(switch.signal), "ON" if switch.on else "OFF"
        if switch.signal == "power":
            return f"AO[{output}]={self.power_value(switch.share, 0)}"
        needed = " AND ".join(f"DO[{port}]" for port in self.needed(switch))
        return f"IF ({needed}),DO[{output}]=({state})" if needed else f"DO[{output}]={state}"

    def _positions(self, section: Section) -> list[str]:
        """Return the targets of a section in the order in which its lines number them."""
        targets = targets_of(section.moves)
        if not targets:
            return []
        robot, settings = self.program.robot, self.settings
        q = np.array([target.q for target in targets])
        axes_deg = np.degrees(axes_from_joints(robot, q)).tolist()
        tips = np.array([np.eye(4) if T is None else T for _, _, T in targets])
        if leads(robot):
            external = q[:, robot.family.joints :]
            tips = part_motion(robot, self.program.T_base_part, external) @ tips
        poses = euler(tips, ANGLES).tolist()
        configurations = posture(robot, q, settings)
        frames = f"\tUF : {settings.user_frame}, UT : {settings.tool_frame},\t"
        texts = []
        for n, (_, joints, T) in enumerate(targets):
            if T is None:
                rows = [frames, *self._values(JOINT_WORDS, axes_deg[n])]
            else:
                *letters, first, second, third = configurations[n]
                words = f"{' '.join(map(str, letters))}, {first}, {second}, {third}"
                rows = [f"{frames}\tCONFIG : '{words}',", *self._values(POSE_WORDS, poses[n])]
            if extended := extended_rows(robot, joints):
                rows = [*rows[:-1], f"{rows[-1]},", *extended]
            rows += group_2_rows(robot, joints, frames)
            texts.append(NEW_LINE.join([f"P[{n + 1}]{{", "   GP1:", *rows, "};"]))
        return texts

    def _values(self, words: tuple[tuple[str, str], ...], values: list[float]) -> list[str]:
        """Return six values in two rows."""
        decimals = self.settings.decimals
        said = [
            f"{word}{number(value, decimals):>{6 + decimals}} {measure}"
            for (word, measure), value in zip(words, values, strict=True)
        ]
        return ["\t" + ",\t".join(said[:3]) + ",", "\t" + ",\t".join(said[3:])]


def _seconds(time: float) -> str:
    """Return a time as controllers write it, without a zero before the point."""
    said = number(time, 2)
    return f"{said.removeprefix('0') if time >= 0.005 else said:>6}"


def _listing(
    name: str, lines: list[str], positions: list[str], settings: FanucSettings, group: str
) -> str:
    """Return a program as a listing; one without motions has "*" for all groups."""
    numbered = [f"{n:4d}:{line}" for n, line in enumerate(lines, 1)]
    day, time = settings.date.split(" ")
    head = ATTRIBUTES.format(count=len(lines), day=day, time=time, group=group).splitlines()
    rows = [f"/PROG  {name}", *head, "/MN", *numbered, "/POS", *positions, "/END", ""]
    return NEW_LINE.join(rows)


# -----------------------------------------------------------------------------
# Issues that only FANUC controllers have.

ROUNDED_SPEED = 0.005
"""Share of a speed that the step of speeds may change without a warning."""
LARGEST_CORNER = 1.0
"""Largest corner region, m."""
CORNER_STEP = 1e-3
"""Corner regions are written in whole numbers of this (m)."""
CORNER_NOISE = 1e-6
"""Largest difference (m) of a zone from a whole number of them."""


def check(program: Program, settings: FanucSettings) -> Iterator[ProgramIssue]:
    """Yield the issues that only this language has."""
    lines, most = len(Fanuc(program, settings).main()), settings.lines_per_file
    if lines > most:
        message = (
            f"the main program would have {lines} lines, but lines_per_file allows {most}; raise it"
        )
        yield ProgramIssue("error", "file-length", message, "program")
    for section in program.sections:
        yield from _check_times(section)
        if settings.corner == "CR":
            yield from _check_corners(section)
        yield from _check_speeds(section, unit(settings))
        q = np.array([move.q for move in section.moves]).reshape(-1, program.robot.joints)
        yield from _check_turns(section, turns(program.robot, q, settings), settings)
        letters = [words[:3] for words in posture(program.robot, q, settings)]
        yield from warn_of_changed_postures(section, letters)


def _check_times(section: Section) -> Iterator[ProgramIssue]:
    stands = False
    for index, step in enumerate(section.steps):
        place = f"{section.name}, step {index}"
        times = [step.time] if isinstance(step, Wait) else []
        times += [step.timeout] if isinstance(step, Await) else []
        if isinstance(step, LinearMove):
            before, timed, _ = split_switches(step)
            times = [switch.lead_time for switch in timed]
            if before:
                yield from _check_early(before, stands, place)
        for time in times:
            if not_whole(time):
                message = f"expected times in steps of {TICK * 1e3:g} ms, got {time * 1e3:g} ms"
                yield ProgramIssue("error", "time-step", message, place)
        if isinstance(step, JointMove | LinearMove):
            stands = step.zone == 0


def _check_early(before: tuple[Switch, ...], stands: bool, place: str) -> Iterator[ProgramIssue]:
    """Check the switches before a motion, whose line has its one TB for another switch."""
    signals = " and ".join(switch.signal for switch in before)
    if not stands or any(switch.signal == "laser" for switch in before):
        message = (
            f"the {signals} cannot be switched here: the line of a motion has only one TB, and "
            "before it the robot does not stop, or the laser would be on"
        )
        yield ProgramIssue("error", "two-switches", message, place)
    else:
        message = (
            f"the {signals} is switched when the motion begins, earlier than planned, because the "
            "line of a motion has only one TB"
        )
        yield ProgramIssue("warning", "two-switches", message, place)


def _check_corners(section: Section) -> Iterator[ProgramIssue]:
    zones = [move.zone for move in section.moves if isinstance(move, LinearMove)]
    whole = [abs(z - CORNER_STEP * round(z / CORNER_STEP)) <= CORNER_NOISE for z in zones]
    wrong = [z for z, w in zip(zones, whole, strict=True) if not w or z > LARGEST_CORNER]
    if wrong:
        yield ProgramIssue(
            "error",
            "corner-region",
            f"expected corner regions in whole mm up to {LARGEST_CORNER * 1e3:g}, got "
            f"{wrong[0] * 1e3:g} mm; change the zone, or write corners as CNT",
            section.name,
        )


def _check_speeds(section: Section, step: float) -> Iterator[ProgramIssue]:
    speeds = np.array([move.speed for move in section.moves if isinstance(move, LinearMove)])
    off = np.abs(np.round(speeds / step) * step / speeds - 1)
    if (off > ROUNDED_SPEED).any():
        yield ProgramIssue(
            "warning",
            "speed-step",
            f"speeds are written in steps of {step * 1e3:.3g} mm/s, which changes "
            f"{speeds[off.argmax()] * 1e3:g} mm/s by {off.max():.1%}",
            section.name,
        )


def _check_turns(
    section: Section, counted: Ints, settings: FanucSettings
) -> Iterator[ProgramIssue]:
    """Check that the turns (K, 3) of targets can be written."""
    for k, move in enumerate(section.moves):
        beyond = counted[k].min() < FEWEST_TURNS or counted[k].max() > MOST_TURNS
        if beyond and isinstance(move, LinearMove):
            message = f"turns must lie between {FEWEST_TURNS} and {MOST_TURNS}, got "
            found = f"{', '.join(map(str, counted[k]))} of {settings.turns}"
            yield ProgramIssue("error", "turns", message + found, f"{section.name}, move {k}")
            return
