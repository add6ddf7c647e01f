"""Read back the listings that `Fanuc` writes; anything else is refused."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from kerfpath.arrays import Array, freeze
from kerfpath.errors import InputError
from kerfpath.post.arcs import faceplate, from_euler, world
from kerfpath.post.build import part_motion
from kerfpath.post.fanuc.controller import (
    EXTENDED,
    GROUP_2,
    UNITS,
    FanucSettings,
    groups,
    joints_from_axes,
    leads,
    read_values,
    time_before,
)
from kerfpath.post.fanuc.writer import (
    ANGLES,
    NO_ANSWER,
    NO_GROUP,
    WRIST,
    Listing,
    abort_lines,
    opening_lines,
    selection_lines,
    watch_lines,
)
from kerfpath.post.flow import section_of
from kerfpath.post.line_reader import numbers_in, only, patterns
from kerfpath.post.places import off_name
from kerfpath.post.program import Await, Switch
from kerfpath.post.read_program import (
    FlowStep,
    MoveKind,
    ReadHandshake,
    ReadMove,
    ReadProgram,
)
from kerfpath.robots import Robot


def read(main: str, files: Mapping[str, str], robot: Robot, settings: FanucSettings) -> ReadProgram:
    """Return the program in listings that `Fanuc` wrote; see `kerfpath.post.Reader`."""
    top = _Main(main, files[main], robot, settings)
    tool = faceplate(robot) @ top.frame("UTOOL")
    part = world(robot) @ top.frame("UFRAME")
    off = off_name(top.name, settings)
    _Watching(f"{off}.ls", files[f"{off}.ls"], robot, settings)
    sections = []
    for name in top.calls:
        listing = _Section(f"{name}.ls", files[f"{name}.ls"], robot, settings)
        steps = _time_early(listing.completed(part), listing.early, robot, part, tool)
        sections.append(section_of(listing.name, steps))
    return ReadProgram(name=top.name, sections=tuple(sections), T_flange_tip=tool, T_base_part=part)


def _time_early(
    steps: Sequence[FlowStep], early: Mapping[int, tuple[Switch, ...]], robot: Robot,
    part: Array, tool: Array,
) -> list[FlowStep]:  # fmt: skip
    """Return the steps; `early` switches get a lead before the end of the motion on their line."""
    found: list[FlowStep] = []
    start: Array | None = None
    for step in steps:
        if not isinstance(step, ReadMove):
            found.append(step)
            continue
        end = step.T_part_tip
        if (before := early.get(step.line)) is not None:
            assert start is not None
            assert end is not None
            if not step.speed:
                raise InputError(f"{step.place}: the motion has no speed")
            lead = time_before(start, end, step.speed)
            moved = tuple(replace(switch, lead_time=lead) for switch in before)
            step = replace(step, switches=(*moved, *step.switches))
        found.append(step)
        start = end
        if step.q is not None:
            start = np.asarray(np.linalg.solve(part, robot.forward(step.q) @ tool))
    return found


_NUMBER = r"(-?\d*\.\d+)"
_END = rf"(\d+)(cm/min|mm/sec) (?:(FINE)|CNT(\d+)|CR(\d+))({WRIST})?( COORD)?(?: ACC100)?"
_TB = r"((?: TB +\d*\.\d\dsec,(?:DO\[\d+\]=O(?:N|FF)|AO\[\d+\]=\d+))*)"
_SWITCH = re.compile(r" ?TB *(\d*\.\d\d)sec,([DA])O\[(\d+)\]=(ON|OFF|\d+)", re.ASCII)
_MAIN = patterns(
    {
        "frame_value": rf"  !(UFRAME|UTOOL) (\d+) ([XYZWPR]) {_NUMBER}",
        "remark": r"  !.*",
        "opening": r"  ((?:UFRAME_NUM|UTOOL_NUM|DO|AO|OVERRIDE)\b.*)",
        "call": r"  CALL ([A-Z][A-Z0-9_]*)",
    }
)
_SECTION = patterns(
    {
        "linear": rf"L P\[(\d+)\] {_END}{_TB}",
        "joint": r"J P\[(\d+)\] (\d+)% (?:(FINE)|CNT(\d+))(?: ACC100)?",
        "circular": rf"C P\[(\d+)\] *:  P\[(\d+)\] {_END}{_TB}",
        "remark": r"  !.*",
        "wait": r"  WAIT +(\d*\.\d\d)\(sec\)",
        "switch": r"  DO\[(\d+)\]=(ON|OFF)",
        "set_power": r"  AO\[(\d+)\]=(\d+)",
        "guarded": r"  IF \((DO\[\d+\](?: AND DO\[\d+\])*)\),DO\[(\d+)\]=\(ON\)",
        "timeout": r"  \$WAITTMOUT=(\d+)",
        "answer": r"  WAIT DI\[(\d+)\]=ON TIMEOUT,LBL\[1\]",
        "aborting": r"  END",
    }
)
_WITHOUT_ANSWER = patterns(
    {
        "label": r"  LBL\[(\d+)\]",
        "off": r"  DO\[(\d+)\]=OFF",
        "power_off": r"  AO\[(\d+)\]=0",
        "end_program": "  ABORT",
    }
)
_POSITION = re.compile(
    r"P\[(\d+)(?::[^\]\n]*)?\]\{\n\s*GP1:\n\s*UF : (\d+), UT : (\d+),\s*(?:"
    r"CONFIG : '([NF]) ([UD]) ([TB]), (-?\d+), (-?\d+), (-?\d+)',\s*"
    + r",\s*".join(rf"{k} = *{_NUMBER} +mm" for k in "XYZ")
    + r",\s*"
    + r",\s*".join(rf"{k} = *{_NUMBER} deg" for k in "WPR")
    + "|"
    + r",\s*".join(rf"J{k}= *{_NUMBER} deg" for k in range(1, 7))
    + rf"){EXTENDED}{GROUP_2}\n\}};\n",
    re.ASCII,
)


class _Main(Listing):
    """The main program: frames in remarks, and calls."""

    def __init__(self, file: str, text: str, robot: Robot, settings: FanucSettings) -> None:
        super().__init__(file, text, robot, settings)
        self.values: dict[tuple[str, str], float] = {}
        self.opened = [line.strip(" ;") for line in opening_lines(settings)]
        """Lines that must come before the first CALL, in any order."""
        self.calls: list[str] = []
        self.body(_MAIN, groups(robot))
        self.end()

    def frame_value(self, kind: str, number: str, letter: str, value: str) -> None:
        if self.calls:
            raise self.fault("frames must be given before the first CALL")
        if (kind, letter) in self.values:
            raise self.fault(f"{letter} of {kind} is given twice")
        self.require_frames(
            number if kind == "UFRAME" else str(self.settings.user_frame),
            number if kind == "UTOOL" else str(self.settings.tool_frame),
        )
        self.values[kind, letter] = float(value)

    def opening(self, row: str) -> None:
        found = next((line for line in self.opened if self.same(row, line)), None)
        if found is None:
            missing = f"{self.opened[0]!r}" if self.opened else "only calls"
            raise self.fault(f"expected {missing} here, got {row[:60]!r}")
        self.opened.remove(found)

    def call(self, name: str) -> None:
        if self.opened:
            raise self.fault(f"expected {self.opened[0]} before this line")
        if name in self.calls:
            raise self.fault(f"{name} is called twice")
        self.calls.append(name)

    def frame(self, kind: str) -> Array:
        """Return a frame that remarks give, (4, 4) m."""
        missing = [letter for letter in "XYZWPR" if (kind, letter) not in self.values]
        if missing:
            raise self.fault(f"no remark gives {', '.join(missing)} of {kind}")
        values = [self.values[kind, letter] for letter in "XYZWPR"]
        return freeze(from_euler(values, ANGLES)[0])


class _Watching(Listing):
    """The program that the background logic runs, which only switches off."""

    def __init__(self, file: str, text: str, robot: Robot, settings: FanucSettings) -> None:
        super().__init__(file, text, robot, settings)
        self.require_next(watch_lines(settings))
        self.body(only(_MAIN, "remark"), NO_GROUP)
        self.end()


class _Section(Listing):
    """A program that is called: motions, waits and switches, and then their positions."""

    def __init__(self, file: str, text: str, robot: Robot, settings: FanucSettings) -> None:
        super().__init__(file, text, robot, settings)
        self.named: dict[int, list[int]] = {}
        """Numbers of the targets of each motion, by its line."""
        self.targets: dict[int, tuple[str | None, ...]] = {}
        self.externals: dict[int, Array] = {}
        self.said_at: dict[int, str] = {}
        self.early: dict[int, tuple[Switch, ...]] = {}
        self.pending: tuple[Switch, ...] = ()
        self.timeout_s: float | None = None
        self.says_abort = False
        self.require_next(selection_lines(settings))
        self.body(_SECTION, groups(robot))
        if self.pending or self.timeout_s is not None:
            raise self.fault("expected a motion, or the wait of a timeout, before the end")
        asked = [step.what for step in self.steps if isinstance(step, ReadHandshake)]
        if self.says_abort != any(isinstance(what, Await) for what in asked):
            raise self.fault("expected timeout lines if and only if the program waits for inputs")
        self.positions()
        self.end()

    def joint(self, target: str, per_cent: str, fine: str | None, cnt: str | None) -> None:
        self.motion("joint", [target], int(per_cent) / 100, self.zone(fine, cnt, None), "")

    def linear(self, target: str, *end: str) -> None:
        self.motion("linear", [target], *self.path_end(*end))

    def circular(self, via: str, target: str, *end: str) -> None:
        self.motion("circular", [target, via], *self.path_end(*end))

    def path_end(
        self, speed: str, unit: str, fine: str | None, cnt: str | None, corner: str | None,
        wrist: str | None, coordinated: str | None, before: str,
    ) -> tuple[float, float | None, str]:  # fmt: skip
        """Return speed (m/s), zone and switches from the end of a line."""
        if (wrist is not None) != (self.settings.orientation == "wrist"):
            word = WRIST.strip()
            raise self.fault(f"expected no {word}" if wrist else f"expected {word}")
        if bool(coordinated) != leads(self.robot):
            raise self.fault(
                f"expected {'COORD' if leads(self.robot) else 'no COORD'} on this line"
            )
        if corner is not None and self.settings.corner != "CR":
            raise self.fault(f"expected CNT{self.settings.cnt_percent} or FINE, got CR{corner}")
        if cnt is not None and self.settings.corner != "CNT":
            raise self.fault(f"expected CR or FINE, got CNT{cnt}")
        return int(speed) * UNITS[unit], self.zone(fine, cnt, corner), before

    def zone(self, fine: str | None, cnt: str | None, corner: str | None) -> float | None:
        """Return the zone (m) at the end of a motion, None for CNT."""
        if cnt is not None and int(cnt) != self.settings.cnt_percent:
            raise self.fault(f"expected CNT{self.settings.cnt_percent}, got CNT{cnt}")
        if fine:
            return 0.0
        return None if corner is None else int(corner) * 1e-3

    def motion(
        self, kind: MoveKind, targets: list[str], speed: float, zone: float | None, before: str
    ) -> None:
        switches = tuple(
            Switch(signal=self.signal(int(output)), on=value == "ON", lead_time=float(lead))
            if sort == "D"
            else self.power_switch(int(output), value, float(lead))
            for lead, sort, output, value in _SWITCH.findall(before)
        )
        if self.pending and (kind == "joint" or not self.steps):
            raise self.fault("an output must not be switched before this motion")
        if self.pending:
            self.early[self.line], self.pending = self.pending, ()
        self.named[self.line] = [int(target) for target in targets]
        self.add_move(kind, speed, zone=zone, switches=switches)

    def switch(self, output: str, value: str) -> None:
        on = value == "ON"
        if not self.is_signal(int(output)):
            self.ask(int(output), on=on)
            return
        switch = Switch(signal=self.signal(int(output)), on=on)
        *_, before = [None, *(step for step in self.steps if isinstance(step, ReadMove))]
        if before is not None and before.kind == "joint" and before.zone == 0:
            self.pending += (switch,)
            return
        last = self.last_on_path()
        if last is None or last.zone != 0:
            raise self.fault("an output may only be switched here after a path motion with FINE")
        self.add_switch(last, switch, self.place)

    def set_power(self, output: str, value: str) -> None:
        if self.pending:
            raise self.fault("a power must not be set between an output and its motion")
        self.power(int(output), value)

    def guarded(self, needed: str, output: str) -> None:
        self.require_output(int(output), self.settings.laser_output)
        self.add_needing(numbers_in(needed))

    def timeout(self, hundredths: str) -> None:
        if self.timeout_s is not None:
            raise self.fault("a timeout must be followed by its wait")
        self.timeout_s = int(hundredths) / 100

    def answer(self, number: str) -> None:
        if self.timeout_s is None:
            raise self.fault("expected $WAITTMOUT before the wait")
        self.expect_answer(int(number), self.timeout_s, otherwise=str(NO_ANSWER))
        self.timeout_s = None

    def aborting(self) -> None:
        self.says_abort = True
        self.leave_routine()
        self.require_next(abort_lines(self.settings)[1:], _WITHOUT_ANSWER)

    def positions(self) -> None:
        """Read the positions, each a block of rows."""
        rows = [row for _, row in self.rows[self.row + 1 :]]
        last = rows.index("/END") if "/END" in rows else len(rows)
        text, at = "\n".join([*rows[:last], ""]), 0
        while at < len(text) and last:
            match = _POSITION.match(text, at)
            if not match:
                raise self.fault("expected a position after this line")
            number, user, tool, *said, extended, user_2, tool_2, leading = match.groups()
            self.said_at[int(number)] = f"{self.file}, line {self.rows[self.row + 1][0]}"
            self.row += match[0].count("\n")
            self.line = self.rows[self.row][0]
            self.require_frames(user, tool)
            self.require_frames(user_2 or user, tool_2 or tool)
            self.read_external(int(number), extended, leading or "")
            if int(number) in self.targets:
                raise self.fault(f"P[{number}] is given twice")
            self.targets[int(number)] = tuple(said)
            at = match.end()

    def read_external(self, number: int, extended: str, leading: str) -> None:
        try:
            self.externals[number] = read_values(self.robot, extended, leading)
        except InputError as error:
            raise self.fault(f"P[{number}]: {error}") from None

    def completed(self, T_base_part: Array) -> list[FlowStep]:
        """Return the steps with their targets in SI units."""
        values = np.array([_six(words) for words in self.targets.values()]).reshape(-1, 6)
        arm = joints_from_axes(self.robot, np.radians(values))
        external = np.array(list(self.externals.values())).reshape(len(arm), -1)
        T = from_euler(values, ANGLES)
        if leads(self.robot):
            T = np.linalg.inv(part_motion(self.robot, T_base_part, external)) @ T
        q = dict(zip(self.targets, freeze(np.hstack([arm, external])), strict=True))
        poses = dict(zip(self.targets, freeze(T), strict=True))
        steps = [
            self.with_targets(step, q, poses) if isinstance(step, ReadMove) else step
            for step in self.steps
        ]
        used = {number for numbers in self.named.values() for number in numbers}
        if unused := [number for number in self.targets if number not in used]:
            self.line = len(self.rows)
            raise self.fault(f"P[{unused[0]}] is used by no motion")
        return steps

    def with_targets(
        self, move: ReadMove, q: Mapping[int, Array], poses: Mapping[int, Array]
    ) -> ReadMove:
        """Return a move with its targets, from joints and poses by their numbers."""
        self.line, joint = move.line, move.kind == "joint"
        targets = self.named[move.line]
        if unknown := [n for n in targets if n not in self.targets]:
            raise self.fault(f"P[{unknown[0]}] is missing")
        if wrong := [n for n in targets if (self.targets[n][0] is None) != joint]:
            form = "J1 to J6" if joint else "X to R"
            raise self.fault(f"P[{wrong[0]}] must be given by {form}")
        at, *vias = targets
        elsewhere = {**move.elsewhere, "target": self.said_at[at]}
        if joint:
            return replace(move, q=q[at], elsewhere=elsewhere)
        return replace(
            move,
            T_part_tip=poses[at],
            external=self.externals[at] if self.robot.externals else None,
            T_part_via=poses[vias[0]] if vias else None,
            posture=_posture(self.targets[at]),
            elsewhere=elsewhere,
        )


def _six(words: tuple[str | None, ...]) -> list[float]:
    return [float(word) for word in words[6:] if word is not None]


def _posture(words: tuple[str | None, ...]) -> tuple[int | str, ...]:
    letters, numbers = words[:3], words[3:6]
    return (*map(str, letters), *(int(str(number)) for number in numbers))
