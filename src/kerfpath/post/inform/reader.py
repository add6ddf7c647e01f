"""Read back the jobs that `Inform` writes; anything else is refused."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import PurePosixPath
from typing import Any

import numpy as np

from kerfpath.arrays import Array, freeze
from kerfpath.errors import InputError
from kerfpath.post.arcs import faceplate, from_euler, world
from kerfpath.post.flow import section_of
from kerfpath.post.harmless import LinePattern, compact, without_remark
from kerfpath.post.inform.controller import (
    ExternalPulses,
    InformSettings,
    inherited,
    joints_at,
    joints_from_axes,
)
from kerfpath.post.inform.writer import (
    ANGLES,
    FRAME_WORDS,
    SUFFIX,
    head,
    middle,
    switch_off_lines,
    wait_lines,
)
from kerfpath.post.languages import reset_lines
from kerfpath.post.line_reader import BLANK, LineReader, only, patterns, program_lines
from kerfpath.post.places import off_name
from kerfpath.post.program import Await, Handshake, Switch
from kerfpath.post.read_program import MoveKind, ReadProgram
from kerfpath.robots import Robot

RCONF_VALUES = (6, 8, 24)
"""How many values controllers write for the type of a position; from the seventh on they are 0."""
_NUMBER, _WHOLE = r"(-?\d+\.\d+)", r"(-?\d+)"
_POSE = re.compile(rf"C(\d{{5}})={','.join([_NUMBER] * 6)}", re.ASCII)
_PULSES = re.compile(rf"C(\d{{5}})={','.join([_WHOLE] * 6)}", re.ASCII)
_TYPE = re.compile(r"///RCONF ([01](?:,[01])*)", re.ASCII)
_DATE = re.compile(r"///DATE \d{4}/\d\d/\d\d \d\d:\d\d", re.ASCII)
_COUNT = re.compile(r"///NPOS ((\d+)(?:,\d+){5})", re.ASCII)
_MAIN = patterns(
    {
        "frame_value": rf"'(UFRAME|TOOL) (\d+) (R?[XYZ]) {_NUMBER}",
        "remark": r"'.*",
        "reset": "SFTOF",
        "call": r"CALL JOB:([A-Z][A-Z0-9_]*)",
    }
)
_JOB = patterns(
    {
        "linear": r"MOVL C(\d{5}) V=(\d+(?:\.\d)?) PL=(\d)",
        "arc": r"MOVC C(\d{5}) V=(\d+(?:\.\d)?)(?: PL=(\d))?",
        "part": r"MOVL C(\d{5}) V=(\d+(?:\.\d)?)",
        "joint": r"MOVJ C(\d{5}) VJ=(\d+(?:\.\d+)?) PL=(\d)",
        "switch": r"DOUT OT#\((\d+)\) (ON|OFF)",
        "wait": r"TIMER T=(\d+\.\d\d)",
        "aration": r"ARATION AO#\((\d+)\) BV=(\d+\.\d+) V=(\d+\.\d) OFV=0\.00",
        "aratiof": r"ARATIOF AO#\((\d+)\)",
        "set_power": r"AOUT AO#\((\d+)\) (\d+\.\d+)",
        "remark": r"'.*",
        "wait_for": r"\*WAIT(\d+)",
    }
)
_WITHOUT_ANSWER = patterns(
    {
        "": r"WAIT IN#\(\d+\)=ON T=\d+\.\d\d|ARATIOF AO#\(\d+\)",
        "power_off": r"AOUT AO#\((\d+)\) 0\.00",
        "jump_if_on": r"JUMP \*(\w+) IF IN#\((\d+)\)=ON",
        "off": r"DOUT OT#\((\d+)\) OFF",
        "pause": "PAUSE",
        "ask_again": r"DOUT OT#\((\d+)\) ON",
        "wait_again": r"WAIT IN#\((\d+)\)=ON",
        "jump": r"JUMP \*(\w+)",
        "label": r"\*(\w+)",
    }
)


def read(
    main: str, files: Mapping[str, str], robot: Robot, settings: InformSettings
) -> ReadProgram:
    """Return the program in jobs that `Inform` wrote; see `kerfpath.post.Reader`."""
    top = _Main(main, files[main], robot, settings)
    tool = faceplate(robot) @ top.frame(f"TOOL {settings.tool_number}")
    part = world(robot) @ top.frame(f"UFRAME {settings.user_frame}")
    off, *calls = top.calls
    _Off(f"{off}{SUFFIX}", files[f"{off}{SUFFIX}"], robot, settings)
    sections, last = [], None
    asked: Sequence[Handshake] = ()
    for name in calls:
        file = f"{name}{SUFFIX}"
        job = _Job(file, files[file], robot, settings, last, asked, part, tool)
        sections.append(section_of(name, job.steps))
        last, asked = job.last, job.asked()
    return ReadProgram(
        name=top.name,
        sections=tuple(sections),
        T_flange_tip=tool,
        T_base_part=part,
    )


class _Text(LineReader):
    """The lines of one job."""

    settings: InformSettings
    language = "inform"
    too_early = "the job ends too early; END is missing"

    def __init__(self, file: str, text: str, robot: Robot, settings: InformSettings) -> None:
        rows = [(n, row.rstrip(BLANK)) for n, row in enumerate(program_lines(file, text), 1)]
        super().__init__(file, robot, settings, rows)
        self.name = PurePosixPath(file).stem
        self.external = ExternalPulses(robot, settings)

    def plain(self, row: str) -> str:
        """Return a row as it is compared: without needless blanks."""
        return row if self.is_remark(row) else compact(row)

    def is_remark(self, row: str) -> bool:
        return row.startswith("'")

    def same(self, row: str, expected: str) -> bool:
        """Return whether two rows are the same for the controller, which sets dates itself."""
        if _DATE.fullmatch(expected):
            return bool(_DATE.fullmatch(row))
        if expected.startswith("///ATTR "):
            words, known = (each.removeprefix("///ATTR ").split(",") for each in (row, expected))
            return sorted(words) == sorted(known)
        return super().same(row, expected)

    def require_rows(self, expected: Sequence[str]) -> None:
        """Require these rows to come next, and read them."""
        for line in expected:
            self.require_line(self.next_row(), line)

    def begin(self) -> int:
        """Read the first lines; return the number of positions that they give."""
        *known, _ = head(self.name, "")
        self.require_rows(known)
        match = _COUNT.fullmatch(self.next_row())
        if match is None or match[1] != self.external.counts(int(match[2])):
            expected = self.external.counts(1).replace("1", "n")
            raise self.fault(f"expected the number of positions, ///NPOS {expected}")
        return int(match[2])

    def instructions(self, kinds: Mapping[str, LinePattern]) -> None:
        """Read instructions to END."""
        while (row := self.next_row().lstrip(BLANK)) != "END":
            if re.match("S?MOV|IMOV", row):
                row = without_remark(row, "//").rstrip(BLANK)
            try:
                row = self.external.plain(row)
            except InputError as error:
                raise self.fault(str(error)) from None
            self.read(row, kinds)
        self.require_complete()
        if any(row for _, row in self.rows[self.row + 1 :]):
            self.advance()
            raise self.fault("nothing may follow END")


class _Off(_Text):
    """The job that switches everything off, and does nothing else."""

    def __init__(self, file: str, text: str, robot: Robot, settings: InformSettings) -> None:
        super().__init__(file, text, robot, settings)
        if self.begin():
            raise self.fault("this job must have no positions")
        self.require_rows(middle("main", settings, self.external)[1])
        self.require_next(switch_off_lines(settings))
        self.instructions(only(_MAIN, "remark"))


class _Main(_Text):
    """The main job: frames in remarks, and calls."""

    def __init__(self, file: str, text: str, robot: Robot, settings: InformSettings) -> None:
        super().__init__(file, text, robot, settings)
        self.frames: dict[tuple[str, str], float] = {}
        self.calls: list[str] = []
        self.is_reset = False
        if self.begin():
            raise self.fault("the main job must have no positions")
        self.require_rows(middle("main", settings, self.external)[1])
        self.instructions(_MAIN)
        if self.calls[:1] != [off_name(self.name, settings)]:
            raise self.fault(f"expected {off_name(self.name, settings)} to be called first")

    def frame_value(self, frame: str, number: str, word: str, value: str) -> None:
        if self.calls:
            raise self.fault("frames must be given before the first job is called")
        if (f"{frame} {number}", word) in self.frames:
            raise self.fault(f"{frame} {number} {word} is given twice")
        self.frames[f"{frame} {number}", word] = float(value)

    def reset(self) -> None:
        if self.calls or self.is_reset:
            raise self.fault("states must be reset once, before the first job is called")
        first, *others = reset_lines(inherited(self.settings))
        self.require_line(self.text, first)
        self.require_next(others)
        self.is_reset = True

    def call(self, name: str) -> None:
        if not self.is_reset:
            raise self.fault(f"expected {' '.join(reset_lines(inherited(self.settings)))} before")
        if name in self.calls:
            raise self.fault(f"{name} is called twice")
        self.calls.append(name)

    def frame(self, name: str) -> Array:
        """Return a frame (4, 4) m that remarks give."""
        values = [self.frames.get((name, word)) for word in FRAME_WORDS]
        if None in values:
            raise self.fault(f"{name} is not complete")
        return freeze(from_euler(np.array(values, dtype=np.float64), ANGLES)[0])


class _Job(_Text):
    """One job that is called: its positions, then its instructions."""

    def __init__(
        self, file: str, text: str, robot: Robot, settings: InformSettings, last: Array | None,
        asked_before: Sequence[Handshake], T_base_part: Array, T_flange_tip: Array,
    ) -> None:  # fmt: skip
        super().__init__(file, text, robot, settings)
        self.asked_before = asked_before
        self.last = last
        self.T_base_part, self.T_tip_flange = T_base_part, np.linalg.inv(T_flange_tip)
        self.arc_poses: list[Array] = []
        self.stands = False
        count = self.begin()
        pulses = "///POSTYPE PULSE" in [row for _, row in self.rows[self.row + 2 : self.row + 3]]
        if robot.externals and not pulses:
            raise self.fault("with external axes positions must be in pulses")
        before, after = middle("pulse" if pulses else "user", settings, self.external)
        self.require_rows(before)
        self.said_at: list[str] = []
        self.target_at = ""
        self.arc_speed = ""
        self.q = np.empty((0, 6))
        self.T = np.empty((0, 4, 4))
        self.types: list[tuple[int, ...]] = []
        if pulses:
            self._read_pulses(count)
        else:
            self._read_poses(count)
        self.require_rows(after)
        self.require_next(reset_lines(inherited(settings)))
        self.follows = False
        self.instructions(_JOB)
        if self.follows:
            raise self.fault("expected ARATIOF before the end")
        if self.arc_poses:
            raise self.fault("an arc needs three MOVC, one after the other")

    def _read_pulses(self, count: int) -> None:
        if self.settings.pulses_per_deg is None:
            raise self.fault("positions are in pulses: give pulses_per_deg")
        rows = [self._position(_PULSES, self.next_row(), k) for k in range(count)]
        pulses = np.array(rows, dtype=np.float64).reshape(-1, 6)
        axes = np.radians(pulses / np.array(self.settings.pulses_per_deg))
        more = np.zeros((count, len(self.robot.externals)))
        for word in self.external.kinds():
            for k in range(count):
                try:
                    self.external.read(self.next_row(), word, k, more[k])
                except InputError as error:
                    raise self.fault(str(error)) from None
        self.q = np.hstack([joints_from_axes(self.robot, axes), self.external.values(more)])

    def _read_poses(self, count: int) -> None:
        rows: list[tuple[str, ...]] = []
        bits: tuple[int, ...] | None = None
        while len(rows) < count:
            row = self.next_row()
            if match := _TYPE.fullmatch(row):
                bits = tuple(int(bit) for bit in match[1].split(","))
                if len(bits) not in RCONF_VALUES or any(bits[6:]):
                    counts = ", ".join(map(str, RCONF_VALUES))
                    raise self.fault(f"expected {counts} values, 0 from the seventh on")
                continue
            rows.append(self._position(_POSE, row, len(rows)))
            if bits is None:
                raise self.fault("expected ///RCONF before the first position")
            self.types.append(bits[:6])
        self.T = from_euler(np.array(rows, dtype=np.float64), ANGLES)

    def _position(self, pattern: re.Pattern[str], row: str, number: int) -> tuple[str, ...]:
        match = pattern.fullmatch(row)
        self.said_at.append(self.place)
        if match is None or int(match[1]) != number:
            raise self.fault(f"expected position C{number:05d}, got {row[:60]!r}")
        return match.groups()[1:]

    def joint(self, target: str, share: str, level: str) -> None:
        k = self.number(target)
        in_pulses = len(self.q) > 0
        self.last = None if in_pulses else self.T[k]
        self.move(
            "joint",
            float(share) * 1e-2,
            level,
            q=freeze(self.q[k]) if in_pulses else self.joints_at(k),
            T_part_tip=None if in_pulses else freeze(self.T[k]),
            posture=() if in_pulses else self.types[k],
        )

    def joints_at(self, k: int) -> Array | None:
        """Return the joints of position k by its type."""
        T_base_flange = self.T_base_part @ self.T[k] @ self.T_tip_flange
        return joints_at(self.robot, T_base_flange, self.types[k], self.settings.flip)

    def linear(self, target: str, speed: str, level: str) -> None:
        self.path("linear", target, speed, level)

    def path(
        self, kind: MoveKind, target: str, speed: str, level: str, via: Array | None = None
    ) -> None:
        if self.robot.externals:
            self.last = None
            q = freeze(self.q[self.number(target)])
            self.move(kind, float(speed) * 1e-3, level, q=q)
            return
        T, posture = self.pose(target)
        self.last = T
        said = {"T_part_tip": T, "T_part_via": via, "posture": posture}
        self.move(kind, float(speed) * 1e-3, level, **said)

    def part(self, target: str, speed: str) -> None:
        """Check a move to where the tip is already, which separates two arcs."""
        self.require_here(self.pose(target)[0])
        self.arc_speed = speed

    def arc(self, target: str, speed: str, level: str | None) -> None:
        T, _ = self.pose(target)
        if not self.arc_poses:
            self.require_here(T)
            self.arc_speed = self.arc_speed or speed
        if speed != self.arc_speed:
            raise self.fault(f"the speed of an arc changes from V={self.arc_speed} to V={speed}")
        if (level is None) != (len(self.arc_poses) < 2):
            raise self.fault("an arc must have a position level at its third MOVC only")
        self.arc_poses.append(T)
        if level is None:
            self.stands = False
            return
        via, self.arc_poses, self.arc_speed = self.arc_poses[1], [], ""
        self.path("circular", target, speed, level, via)

    def switch(self, output: str, state: str) -> None:
        on = state == "ON"
        if not self.is_signal(int(output)):
            self.ask(int(output), on=on)
            return
        last = self.last_on_path()
        if not self.stands or last is None:
            raise self.fault("a switch must follow a move of the path with PL=0")
        self.add_switch(last, Switch(signal=self.signal(int(output)), on=on), self.place)

    def set_power(self, output: str, value: str) -> None:
        if self.follows:
            raise self.fault("expected ARATIOF before this line")
        self.power(int(output), value)

    def aration(self, output: str, value: str, speed_mm_s: str) -> None:
        if self.follows or float(speed_mm_s) <= 0:
            raise self.fault("expected one ARATION at a time, with a speed above 0")
        self.follow_speed(int(output), float(value) / (1e-3 * float(speed_mm_s)))
        self.follows = True

    def aratiof(self, output: str) -> None:
        self.require_power_output(int(output))
        if not self.follows:
            raise self.fault("expected ARATION before this line")
        self.follows = False

    def wait_for(self, label: str) -> None:
        _, below = (*self.rows[self.row + 1 : self.row + 2], (0, ""))[0]
        said = re.fullmatch(r"WAIT IN#\((\d+)\)=ON T=(\d+\.\d\d)", below, re.ASCII)
        if said is None:
            raise self.fault("expected the wait for an input after the label")
        partner = self.partner(int(said[1]), "input")
        awaited = Await(partner=partner, timeout=float(said[2]))
        lines = wait_lines(int(label), awaited, self.asked(), self.settings)[1:]
        self.label(f"WAIT{label}")
        self.add_handshake(awaited)
        self.require_next(lines, _WITHOUT_ANSWER)

    def require_stopped(self, what: str) -> None:
        if not self.stands:
            raise self.fault(f"{what} must follow a move with PL=0")

    def move(self, kind: MoveKind, speed: float, level: str, **said: Any) -> None:
        """Add a move; a position level above 0 has no length."""
        if self.arc_poses:
            raise self.fault("an arc needs three MOVC, one after the other")
        if level not in ("0", str(self.settings.position_level)):
            raise self.fault(f"expected PL=0 or PL={self.settings.position_level}, got PL={level}")
        self.stands = level == "0"
        zone = 0.0 if self.stands else None
        self.add_move(kind, speed, zone=zone, elsewhere={"target": self.target_at}, **said)

    def pose(self, target: str) -> tuple[Array, tuple[int, ...]]:
        k = self.number(target)
        if len(self.q):
            raise self.fault("a move of the path needs a position in the user frame")
        return freeze(self.T[k]), self.types[k]

    def require_here(self, T: Array) -> None:
        if self.last is not None and not np.array_equal(T, self.last):
            raise self.fault("an arc must begin where the move before it ends")

    def number(self, target: str) -> int:
        if int(target) >= max(len(self.q), len(self.T)):
            raise self.fault(f"C{target} is missing")
        self.target_at = self.said_at[int(target)]
        return int(target)
