"""TP, the language of FANUC controllers, as listings: this module only formats.

Units of TP: mm, deg, cm/min or mm/sec, per cent, seconds in hundredths. A listing is one program:
attributes, numbered lines, and the positions that they name. TB on the line of a motion switches an
output the given time before the tip reaches its end; a separate line after a motion that stops
switches it once the tip is there.

The layout is that of controllers' own listings: LeroyDu56/robconv, docs/fanuc_ls_format.md and
tests/fixtures/fanuc/roboguide_export, JuniorNatalin/VASC (TB).
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import count
from typing import Final

import numpy as np

from kerfpath.post._called import CalledFormatter
from kerfpath.post._external import standing
from kerfpath.post._formatter import number
from kerfpath.post._frames import euler
from kerfpath.post._program import (
    Await,
    CircularMove,
    JointMove,
    LinearMove,
    Request,
    Section,
    Switch,
    Wait,
    targets_of,
)
from kerfpath.post._settings import outputs
from kerfpath.post.fanuc._axes import axes_from_joints, posture
from kerfpath.post.fanuc._external import extended_rows, group_2_rows, groups, leads, remarks
from kerfpath.post.fanuc._settings import FanucSettings, unit
from kerfpath.post.fanuc._switching import split_switches

__all__ = [
    "ANGLES", "WRIST", "Fanuc", "abort_lines", "selection_lines", "switch_off_lines", "watch_lines",
]  # fmt: skip

ANGLES: Final = "xyz"
"""W turns about x, then P about y, then R about z, all axes fixed."""
WRIST = " Wjnt"
"""Option of path motions: the wrist moves evenly in its joints."""
NEW_LINE = "\r\n"
PADDING = "    "
REMARK = 32
"""Characters of a remark that every controller keeps."""
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


def switch_off_lines(settings: FanucSettings) -> list[str]:
    """Return the lines that switch everything off."""
    return [f"  DO[{output}]=OFF ;" for output in outputs(settings)]


def abort_lines(settings: FanucSettings) -> list[str]:
    """Return the last lines of a program that waits for inputs: what is done without an answer."""
    return ["  END ;", f"  LBL[{NO_ANSWER}] ;", *switch_off_lines(settings), "  ABORT ;"]


def watch_lines(settings: FanucSettings) -> list[str]:
    """Return the lines that background logic runs: all is off while no program runs (UO[3])."""
    off = (f"  IF (!UO[3]),DO[{output}]=(OFF) ;" for output in outputs(settings))
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
        files[f"{off}.ls"] = _listing(off, watch_lines(settings), [], settings, "*,*,*,*,*")
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
        return [*lines, *selection_lines(settings), *switch_off_lines(settings), *calls]

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
        return f"DO[{self.output(switch.signal)}]={'ON' if switch.on else 'OFF'}"

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
            tips = standing(robot, self.program.T_base_part, external) @ tips
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
