"""Places in programs: called routines, contours that were read, and lines of the text."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from kerfpath.arrays import Array, short_repr
from kerfpath.names import identifier, identifiers
from kerfpath.post.arcs import Order, controller_frames, euler, timetable
from kerfpath.post.build import laser_start, waits_at_start
from kerfpath.post.checks import foresee
from kerfpath.post.languages import Formatter, number, plain
from kerfpath.post.languages import language as find_language
from kerfpath.post.options import ProgramOptions
from kerfpath.post.program import (
    Await,
    JointMove,
    LinearMove,
    Program,
    ProgramIssue,
    Request,
    Section,
    SetPower,
    Switch,
    Wait,
)
from kerfpath.post.read_program import (
    ReadHandshake,
    ReadMove,
    ReadPower,
    ReadProgram,
    ReadStep,
    ReadWait,
)
from kerfpath.robots import Robot

# -----------------------------------------------------------------------------
# A main program that calls the others and gives the frames to enter in its remarks.

OFF = "_OFF"
"""Suffix of the name of the program that switches everything off."""
MOST_REMARKS = 3
"""Largest number of lines of a comment."""
FRAME_DECIMALS = (4, 4, 4, 6, 6, 6)
"""Decimals of mm and deg in remarks that give a frame."""


def off_name(name: str, settings: Any) -> str:
    """Return the name of the program that switches everything off, from that of the main one."""
    return name[: settings.longest_name - len(OFF)] + OFF


class CalledFormatter(Formatter):
    """Formatter of a main program, one for each section and one that switches off, in capitals."""

    remark_width: int
    """Largest number of characters of a remark."""
    angles: Order
    frame_words: tuple[str, ...]
    """Names of the three lengths and three angles of a frame."""
    frame_line: str
    """Format of the remark that gives one of them: frame, name, value."""

    def __init__(self, program: Program, settings: Any) -> None:
        longest = settings.longest_name
        (name,) = identifiers([program.name], (), longest)
        taken = (name, off_name(name, settings))
        names = identifiers((section.name for section in program.sections), taken, longest)
        sections = tuple(
            replace(section, name=own.upper())
            for section, own in zip(program.sections, names, strict=True)
        )
        super().__init__(replace(program, name=name.upper(), sections=sections), settings)
        self.off_name = off_name(self.program.name, settings)

    def names(self) -> list[tuple[str, str]]:
        """Return the names of all programs."""
        sections = ((section.name, "a contour") for section in self.program.sections)
        off = (self.off_name, "the program that switches off")
        return [(self.program.name, "the program"), off, *sections]

    def heading(self, *about: str, frame: str, tool: str) -> Iterator[str]:
        """Yield the remarks of the main program: what is proved, `about`, and the two frames."""
        program = self.program
        clear = "proved clear in the planned cell"
        checked = clear if program.air_checked else "not checked for collisions"
        for_robot = f"kerfpath, for {plain(program.robot.model)}"
        moves = f"Transfer moves: {checked}."
        for remark in (for_robot, moves, *program.caveats, *about):
            yield from self.comment(remark)
        for name, T in zip((frame, tool), controller_frames(program), strict=True):
            yield from self._frame(name, T)

    def _frame(self, name: str, T: Array) -> Iterator[str]:
        """Yield a frame as remarks, to be entered at the controller and read back."""
        values = euler(T, self.angles)[0]
        for word, value, decimals in zip(self.frame_words, values, FRAME_DECIMALS, strict=True):
            yield self.frame_line % (name, word, number(value, decimals))

    def wrap(self, text: str) -> list[str]:
        """Return a comment as remarks, cut where there would be too many."""
        return textwrap.wrap(text, self.remark_width, max_lines=MOST_REMARKS, placeholder=" ...")


# -----------------------------------------------------------------------------
# The contours of a program that was read: joint moves, and the path after them.


@dataclass(slots=True)
class ReadGroup:
    """Joint moves and the moves of the path after them; no path after the last contour.

    Parameters
    ----------
    name : str
        Name of the routine in which its path begins.
    joint, path : list of ReadMove
    waits : list of (int, ReadWait)
        After how many moves of the path the robot waits, and how long.
    handshakes : list of (int, ReadHandshake)
        After how many moves of the path a partner is asked or awaited.
    powers : list of (int, ReadPower)
        After how many moves of the path the power is set while the robot stands.
    """

    name: str = ""
    joint: list[ReadMove] = field(default_factory=list)
    path: list[ReadMove] = field(default_factory=list)
    waits: list[tuple[int, ReadWait]] = field(default_factory=list)
    handshakes: list[tuple[int, ReadHandshake]] = field(default_factory=list)
    powers: list[tuple[int, ReadPower]] = field(default_factory=list)

    __repr__ = short_repr


def groups_of(read: ReadProgram) -> list[ReadGroup]:
    """Return the contours of a program, each of which may extend over several routines."""
    groups: list[ReadGroup] = []
    for section in read.sections:
        for step in section.steps:
            joint = isinstance(step, ReadMove) and step.kind == "joint"
            if not groups or (joint and groups[-1].path):
                groups.append(ReadGroup())
            if not groups[-1].path:
                groups[-1].name = section.name
            _add(groups[-1], step)
    return groups


def _add(group: ReadGroup, step: ReadStep) -> None:
    if isinstance(step, ReadWait):
        group.waits.append((len(group.path), step))
    elif isinstance(step, ReadHandshake):
        group.handshakes.append((len(group.path), step))
    elif isinstance(step, ReadPower):
        group.powers.append((len(group.path), step))
    elif step.kind == "joint":
        group.joint.append(step)
    else:
        group.path.append(step)


# -----------------------------------------------------------------------------
# Find the line of each move and wait in the text of a program, and when it runs.

_NUMBER = re.compile(r"(.*), (move|step) (\d+)")


class Line(NamedTuple):
    """A line of a text: the name of its file, and its number from 1 on."""

    file: str
    number: int


class TimedLine(NamedTuple):
    """A line that moves or waits, with its begin and end (s) on the program's clock."""

    line: Line
    begin: float
    end: float


def timed_lines(program: Program, read: ReadProgram) -> tuple[TimedLine, ...]:
    """Return the line of every move and wait of a program with its times, in their order.

    The clock is that of `timetable`: the first target is at 0.

    Parameters
    ----------
    program : Program
    read : ReadProgram
        The program as read back from its text.

    Raises
    ------
    InputError
        The joint limits are not known.
    """
    lines = [
        line
        for step, line in zip(program.steps, _lines(program, read), strict=True)
        if isinstance(step, JointMove | LinearMove | Wait)
    ]
    found, begin = [], 0.0
    for (_, end), line in zip(timetable(program), lines, strict=True):
        if line is not None:
            found.append(TimedLine(line, begin, end))
        begin = end
    return tuple(found)


def issue_lines(
    issues: Sequence[ProgramIssue], program: Program, read: ReadProgram
) -> tuple[Line | None, ...]:
    """Return the line of each issue of a preflight, or None if it belongs to no line.

    Parameters
    ----------
    issues : sequence of ProgramIssue
        Issues of the program.
    program : Program
    read : ReadProgram
        The program as read back from its text.
    """
    lines = _lines(program, read)
    return tuple(_line_of(issue.place, program, lines) for issue in issues)


def _line_of(place: str, program: Program, lines: Sequence[Line | None]) -> Line | None:
    found = _NUMBER.fullmatch(place)
    name, what, number = found.groups() if found else (place, "step", "0")
    begin = 0
    for section in program.sections:
        steps = range(begin, begin + len(section.steps))
        begin += len(section.steps)
        if section.name == name:
            counted = [
                k
                for k in steps
                if what == "step" or isinstance(program.steps[k], LinearMove | JointMove)
            ]
            return next((lines[k] for k in counted[int(number) :] if lines[k] is not None), None)
    return None


def _lines(program: Program, read: ReadProgram) -> list[Line | None]:
    """Return the line of each step; a text has as many of a kind, in the same order.

    Steps that a language does not write have no line, for example waits.
    """
    found: list[Line | None] = [None] * len(program.steps)
    kinds: tuple[tuple[Any, type], ...] = (
        (JointMove | LinearMove, ReadMove),
        (Wait, ReadWait),
        (SetPower, ReadPower),
        (Request | Await, ReadHandshake),
    )
    for kind, read_kind in kinds:
        own = [k for k, step in enumerate(program.steps) if isinstance(step, kind)]
        said = [step for step in read.steps if isinstance(step, read_kind)]
        if len(own) == len(said):
            for k, step in zip(own, said, strict=True):
                found[k] = Line(step.file, step.line)
    return found


# -----------------------------------------------------------------------------
# Check the names, numbers and outputs of a program before there is a plan for it.

SOME_ZONE = 1.23456e-3
"""Zone (m) in place of those that depend on the spacing of nodes and are no round numbers."""


def issues_before_planning(
    cuts: Sequence[tuple[str, float]],
    robot: Robot,
    options: ProgramOptions,
) -> list[ProgramIssue]:
    """Return the errors that the program of some cuts will have, whatever its targets are.

    Parameters
    ----------
    cuts : sequence of (str, float m/s)
        Name and speed of each contour.
    robot : Robot
    options : ProgramOptions
        With a language and a name.
    """
    chosen = find_language(options.language)
    settings = chosen.settings() if options.settings is None else options.settings
    title = identifier(options.name)
    names = identifiers((cut for cut, _ in cuts), taken=(title,))
    here, q = np.eye(4), np.zeros(robot.joints)
    per_speed = float(options.power_follows == "controller")
    radius = SOME_ZONE if options.zone == "auto" else options.zone
    sections = []
    for section, (contour, speed) in zip(names, cuts, strict=True):
        own = options.of(contour)
        laser, wait = laser_start(own)
        on = [laser]
        off = [Switch(signal="laser", on=False, lead_time=options.lead_time)]
        if own.gas_lead is not None:
            on.insert(0, Switch(signal=own.gas, on=True, lead_time=own.gas_lead))
            off.append(Switch(signal=own.gas, on=False))
        steps = (
            JointMove(q=q, speed=1.0),
            *options.handshakes,
            *([] if own.power is None else [SetPower(share=0.0, per_speed=per_speed)]),
            LinearMove(
                T_part_tip=here,
                q=q,
                speed=options.approach_speed,
                duration=1.0,
                switches=tuple(on),
            ),
            *(Wait(time=time) for time in waits_at_start(own, wait)),
            LinearMove(T_part_tip=here, q=q, speed=speed, duration=1.0, zone=radius),
            LinearMove(T_part_tip=here, q=q, speed=speed, duration=1.0, switches=tuple(off)),
        )
        sections.append(Section(name=section, steps=steps))
    outline = Program(
        name=title, robot=robot, T_flange_tip=here, T_base_part=here, sections=tuple(sections)
    )
    return [issue for issue in foresee(outline, chosen, settings) if issue.level == "error"]
