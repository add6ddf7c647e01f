"""Read back the jobs that `Inform` writes, and nothing else: what it does not know, it refuses."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Literal

import numpy as np
from scipy.spatial.transform import Rotation

from kerfpath._arrays import Array, freeze
from kerfpath.errors import InputError
from kerfpath.post._frames import faceplate, world
from kerfpath.post._program import Await, Handshake, Request, Signal, Switch
from kerfpath.post._read import (
    ReadHandshake,
    ReadMove,
    ReadProgram,
    ReadSection,
    ReadStep,
    ReadWait,
    partner_of,
    patterns,
    same_output,
)
from kerfpath.post.inform._axes import joints_at, joints_from_axes
from kerfpath.post.inform._settings import InformSettings
from kerfpath.post.inform._write import (
    FRAME_WORDS,
    SUFFIX,
    awaiting,
    head,
    middle,
    off_name,
    switched_off,
)
from kerfpath.robots import Robot

__all__ = ["read"]

_NUMBER, _WHOLE = r"(-?\d+\.\d+)", r"(-?\d+)"
_POSE = re.compile(rf"C(\d{{5}})={','.join([_NUMBER] * 6)}", re.ASCII)
_PULSES = re.compile(rf"C(\d{{5}})={','.join([_WHOLE] * 6)}", re.ASCII)
_TYPE = re.compile(r"///RCONF ([01](?:,[01])*)", re.ASCII)
_COUNT = re.compile(r"///NPOS (\d+),0,0,0,0,0", re.ASCII)
_MAIN = patterns(
    {
        "remark": r"' .*",
        "told": rf"'(UFRAME|TOOL) (\d+) (R?[XYZ]) {_NUMBER}",
        "call": r"CALL JOB:([A-Z][A-Z0-9_]*)",
    }
)
_JOB = patterns(
    {
        "linear": r"MOVL C(\d{5}) V=(\d+\.\d) PL=(\d)",
        "arc": r"MOVC C(\d{5}) V=(\d+\.\d)(?: PL=(\d))?",
        "part": r"MOVL C(\d{5}) V=(\d+\.\d)",
        "joint": r"MOVJ C(\d{5}) VJ=(\d+\.\d\d) PL=(\d)",
        "switch": r"DOUT OT#\((\d+)\) (ON|OFF)",
        "wait": r"TIMER T=(\d+\.\d\d)",
        "remark": r"' .*",
        "wait_for": r"\*WAIT(\d+)",
    }
)


def read(
    main: str, files: Mapping[str, str], robot: Robot, settings: InformSettings
) -> ReadProgram:
    """Return the program that jobs of ours say; see `kerfpath.post.Reader`."""
    top = _Main(main, files[main], robot, settings)
    tool = faceplate(robot) @ top.frame(f"TOOL {settings.tool_number}")
    part = world(robot) @ top.frame(f"UFRAME {settings.user_frame}")
    off, *calls = top.calls
    _Off(f"{off}{SUFFIX}", files[f"{off}{SUFFIX}"], robot, settings)
    sections, last = [], None
    for name in calls:
        job = _Job(f"{name}{SUFFIX}", files[f"{name}{SUFFIX}"], robot, settings, last, part, tool)
        sections.append(ReadSection(name=name, steps=tuple(job.found)))
        last = job.last
    return ReadProgram(
        name=top.name,
        sections=tuple(sections),
        T_flange_tip=tool,
        T_base_part=part,
    )


class _Text:
    """The lines of one job, taken one after the other."""

    def __init__(self, file: str, text: str, robot: Robot, settings: InformSettings) -> None:
        self.file, self.robot, self.settings = file, robot, settings
        self.rows = [row.rstrip() for row in text.splitlines()]
        self.line = 0
        self.name = file.rpartition("/")[2].removesuffix(SUFFIX)
        self.must_say: list[str] = []

    def take(self) -> str:
        """Return the next line."""
        self.line += 1
        if self.line > len(self.rows):
            raise self.fault("the job ends too early; END is missing")
        return self.rows[self.line - 1]

    def expect(self, *lines: str) -> None:
        """Take lines that are known."""
        for line in lines:
            if (row := self.take()) != line:
                raise self.fault(f"expected {line!r}, got {row[:60]!r}")

    def begin(self) -> int:
        """Take the first lines; return how many positions the job is said to have."""
        *known, _ = head(self.name, 0)
        self.expect(*known)
        match = _COUNT.fullmatch(self.take())
        if match is None:
            raise self.fault("expected the number of positions, ///NPOS n,0,0,0,0,0")
        return int(match[1])

    def read(self, kinds: Mapping[str, re.Pattern[str]]) -> None:
        """Read instructions to END, each by the method of its kind."""
        while (row := self.take()) != "END":
            if self.must_say:
                if row != self.must_say[0]:
                    raise self.fault(f"expected {self.must_say[0]!r}, got {row[:60]!r}")
                del self.must_say[0]
                continue
            for kind, pattern in kinds.items():
                if match := pattern.fullmatch(row):
                    getattr(self, kind)(*match.groups())
                    break
            else:
                raise self.fault(f"not expected here: {row[:60]!r}")
        if self.must_say:
            raise self.fault(f"{self.must_say[0]!r} is missing")
        if any(self.rows[self.line :]):
            self.line += 1
            raise self.fault("nothing may follow END")

    def remark(self) -> None:
        """Keep nothing of a remark."""

    def signal(self, output: str) -> Signal:
        if int(output) == self.settings.gas_output:
            return "gas"
        same_output(int(output), self.settings.laser_output, f"{self.file}, line {self.line}")
        return "laser"

    def fault(self, message: str) -> InputError:
        return InputError(f"{self.place}: {message}")

    @property
    def place(self) -> str:
        return f"{self.file}, line {self.line}"


class _Off(_Text):
    """The job that switches everything off, and does nothing else."""

    def __init__(self, file: str, text: str, robot: Robot, settings: InformSettings) -> None:
        super().__init__(file, text, robot, settings)
        if self.begin():
            raise self.fault("this job must have no positions")
        self.expect(*middle("main", settings)[1])
        self.must_say = switched_off(settings)
        self.read({})


class _Main(_Text):
    """The main job: frames as they are told, outputs, calls."""

    def __init__(self, file: str, text: str, robot: Robot, settings: InformSettings) -> None:
        super().__init__(file, text, robot, settings)
        self.frames: dict[tuple[str, str], float] = {}
        self.calls: list[str] = []
        if self.begin():
            raise self.fault("the main job must have no positions")
        self.expect(*middle("main", settings)[1])
        self.read(_MAIN)
        if self.calls[:1] != [off_name(self.name, settings)]:
            raise self.fault(f"expected {off_name(self.name, settings)} to be called first")

    def told(self, frame: str, number: str, word: str, value: str) -> None:
        if self.calls:
            raise self.fault("frames must be told before the first job is called")
        if (f"{frame} {number}", word) in self.frames:
            raise self.fault(f"{frame} {number} {word} is told twice")
        self.frames[f"{frame} {number}", word] = float(value)

    def call(self, name: str) -> None:
        if name in self.calls:
            raise self.fault(f"{name} is called twice")
        self.calls.append(name)

    def frame(self, name: str) -> Array:
        """Return a frame (4, 4) m that is told."""
        values = [self.frames.get((name, word)) for word in FRAME_WORDS]
        if None in values:
            raise self.fault(f"{name} is not told whole")
        return freeze(_poses(np.array([values], dtype=np.float64))[0])


class _Job(_Text):
    """One job that is called: its positions, then its instructions."""

    def __init__(
        self, file: str, text: str, robot: Robot, settings: InformSettings, last: Array | None,
        T_base_part: Array, T_flange_tip: Array,
    ) -> None:  # fmt: skip
        super().__init__(file, text, robot, settings)
        self.last = last
        self.T_base_part, self.T_tip_flange = T_base_part, np.linalg.inv(T_flange_tip)
        self.found: list[ReadStep] = []
        self.arc_poses: list[Array] = []
        self.stands = False
        count = self.begin()
        pulses = self.rows[self.line + 1 : self.line + 2] == ["///POSTYPE PULSE"]
        before, after = middle("pulse" if pulses else "user", settings)
        self.expect(*before)
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
        self.expect(*after)
        self.read(_JOB)
        if self.arc_poses:
            raise self.fault("an arc needs three MOVC, one after the other")

    def _read_pulses(self, count: int) -> None:
        if self.settings.pulses_per_deg is None:
            raise self.fault("positions are in pulses: give pulses_per_deg")
        rows = [self._position(_PULSES, self.take(), k) for k in range(count)]
        pulses = np.array(rows, dtype=np.float64).reshape(-1, 6)
        axes = np.radians(pulses / np.array(self.settings.pulses_per_deg))
        self.q = joints_from_axes(self.robot, axes)

    def _read_poses(self, count: int) -> None:
        rows: list[Any] = []
        bits: tuple[int, ...] | None = None
        while len(rows) < count:
            row = self.take()
            if match := _TYPE.fullmatch(row):
                bits = tuple(int(bit) for bit in match[1].split(","))
                if len(bits) != self.settings.rconf_values or any(bits[6:]):
                    raise self.fault(
                        f"expected {self.settings.rconf_values} values, 0 from the seventh on"
                    )
                continue
            rows.append(self._position(_POSE, row, len(rows)))
            if bits is None:
                raise self.fault("expected ///RCONF before the first position")
            self.types.append(bits[:6])
        self.T = _poses(np.array(rows, dtype=np.float64).reshape(-1, 6))

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
        """Return the joints to which the type of a position leads."""
        T_base_flange = self.T_base_part @ self.T[k] @ self.T_tip_flange
        return joints_at(self.robot, T_base_flange, self.types[k], self.settings.flip)

    def linear(self, target: str, speed: str, level: str) -> None:
        T, posture = self.pose(target)
        self.last = T
        self.move("linear", float(speed) * 1e-3, level, T_part_tip=T, posture=posture)

    def part(self, target: str, speed: str) -> None:
        """Check a move to where the tip is already, which parts two arcs."""
        self.require_here(self.pose(target)[0])
        self.arc_speed = speed

    def arc(self, target: str, speed: str, level: str | None) -> None:
        T, posture = self.pose(target)
        if not self.arc_poses:
            self.require_here(T)
            self.arc_speed = self.arc_speed or speed
        if speed != self.arc_speed:
            raise self.fault(f"the speed of an arc changes from V={self.arc_speed} to V={speed}")
        if (level is None) != (len(self.arc_poses) < 2):
            raise self.fault("an arc has its position level at the third MOVC")
        self.arc_poses.append(T)
        if level is None:
            self.stands = False
            return
        via, self.arc_poses, self.last = self.arc_poses[1], [], T
        self.arc_speed = ""
        self.move(
            "circular",
            float(speed) * 1e-3,
            level,
            T_part_tip=T,
            T_part_via=via,
            posture=posture,
        )

    def switch(self, output: str, state: str) -> None:
        if int(output) not in (self.settings.laser_output, self.settings.gas_output):
            partner = partner_of(int(output), "output", self.settings, self.place)
            self.handshake(Request(partner=partner, on=state == "ON"))
            return
        signal, last = self.signal(output), self.found[-1] if self.found else None
        if not self.stands or not isinstance(last, ReadMove) or last.kind == "joint":
            raise self.fault("a switch must follow a move of the path with PL=0")
        switches = (*last.switches, Switch(signal=signal, on=state == "ON"))
        elsewhere = {**last.elsewhere, "switches": self.place}
        self.found[-1] = replace(last, switches=switches, elsewhere=elsewhere)

    def wait_for(self, label: str) -> None:
        said = re.match(r"WAIT IN#\((\d+)\)=ON T=(\d+\.\d\d)$", "".join(self.rows[self.line :][:1]))
        if said is None:
            raise self.fault("expected the wait for an input behind the label")
        partner = partner_of(int(said[1]), "input", self.settings, self.place)
        lines = awaiting(int(label), int(said[1]), float(said[2]), self.settings)
        self.must_say = lines[1:]
        self.handshake(Await(partner=partner, timeout=float(said[2])))

    def handshake(self, what: Handshake) -> None:
        if not self.stands:
            raise self.fault("a handshake must follow a move with PL=0")
        self.found.append(ReadHandshake(what=what, file=self.file, line=self.line))

    def wait(self, time: str) -> None:
        if not self.stands:
            raise self.fault("a wait must follow a move with PL=0")
        self.found.append(ReadWait(time=float(time), file=self.file, line=self.line))

    def move(
        self, kind: Literal["joint", "linear", "circular"], speed: float, level: str, **said: Any
    ) -> None:
        """Add a move; a position level above 0 is no length."""
        if self.arc_poses:
            raise self.fault("an arc needs three MOVC, one after the other")
        if level not in ("0", str(self.settings.position_level)):
            raise self.fault(f"expected PL=0 or PL={self.settings.position_level}, got PL={level}")
        self.stands = level == "0"
        zone = 0.0 if self.stands else None
        place: dict[str, Any] = {"file": self.file, "line": self.line}
        place["elsewhere"] = {"target": self.target_at}
        self.found.append(ReadMove(kind=kind, speed=speed, zone=zone, **place, **said))

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
            raise self.fault(f"C{target} is not there")
        self.target_at = self.said_at[int(target)]
        return int(target)


def _poses(rows: Array) -> Array:
    """Return poses (K, 4, 4) m of mm and deg about fixed x, y, z."""
    T = np.tile(np.eye(4), (len(rows), 1, 1))
    if len(rows):
        T[:, :3, :3] = Rotation.from_euler("xyz", rows[:, 3:], degrees=True).as_matrix()
    T[:, :3, 3] = rows[:, :3] * 1e-3
    return T
