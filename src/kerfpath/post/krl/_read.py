"""Read back the KRL that `Krl` writes, and nothing else: what it does not know, it refuses."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any, Literal

import numpy as np
from scipy.spatial.transform import Rotation

from kerfpath._arrays import Array, freeze
from kerfpath.errors import InputError
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
from kerfpath.post.krl._axes import joints_from_axes
from kerfpath.post.krl._settings import KrlSettings
from kerfpath.post.krl._write import (
    AXES,
    FIRST,
    HEAD,
    PASSED,
    SWITCH_OFF,
    awaiting,
    data_list,
    opening,
    switched_off,
)
from kerfpath.robots import Robot

__all__ = ["read"]

_NAME = r"([A-Za-z]\w*)"
_NUMBER = r"(-?\d+(?:\.\d+)?)"
_POINT = ",".join(f"{field} {_NUMBER}" for field in "XYZABC")
_LINES = patterns(
    {
        "linear": rf"LIN {{{_POINT},S (\d+),T (\d+)}}( C_DIS)?",
        "circular": rf"CIRC {{{_POINT}}},{{{_POINT},S (\d+),T (\d+)}}( C_DIS)?",
        "joint": rf"PTP {{{','.join(f'{axis} {_NUMBER}' for axis in AXES)}}}",
        "speed": rf"\$VEL\.CP={_NUMBER}",
        "zone": rf"\$APO\.CDIS={_NUMBER}",
        "share": r"BAS\(#VEL_PTP,(\d+)\)",
        "trigger": r"TRIGGER WHEN PATH=0 DELAY=(-?\d+) DO \$OUT\[(\d+)\]=(TRUE|FALSE)",
        "wait": rf"WAIT SEC {_NUMBER}",
        "condition": rf"IF ({FIRST}|{PASSED})<=(\d+) THEN",
        "call": rf"{_NAME}\((|{FIRST})\)",
        "end_condition": "ENDIF",
        "again": rf"{FIRST}=1",
        "request": r"\$OUT\[(\d+)\]=(TRUE|FALSE)",
        "wait_for": r"\$TIMER\[\d+\]=-(\d+)",
        "end": "END",
        "routine": rf"DEF {_NAME}\((|{PASSED} :IN)\)",
        "tool": rf"\$TOOL={{{_POINT}}}",
        "base": rf"\$BASE={{{_POINT}}}",
    }
)
_CALLS = ("condition", "call", "end_condition", "end")
_IN_MAIN = ("tool", "base", "again", *_CALLS)
_IN_FIRST = _CALLS
_IN_ROUTINE = (
    "linear", "speed", "zone", "trigger", "circular", "joint", "share", "wait", "request",
    "wait_for", "end",
)  # fmt: skip
_FIRST = re.compile(rf"INT {FIRST}=(\d+)", re.ASCII)


def read(main: str, files: Mapping[str, str], robot: Robot, settings: KrlSettings) -> ReadProgram:
    """Return the program that .src and .dat files of ours say; see `kerfpath.post.Reader`."""
    first = _File(main, files, robot, settings, opening(settings))
    begin = first.require_data([name for name in first.calls if name not in first.steps])
    sections: list[ReadSection] = []
    for name, number in first.calls.items():
        if name in first.steps:
            sections.append(ReadSection(name=name, steps=tuple(first.steps[name])))
        else:
            own = _File(f"{name}.src", files, robot, settings, [], before=len(sections))
            own.require_data([])
            sections += [ReadSection(name=n, steps=tuple(own.steps[n])) for n in own.calls]
        if number != len(sections):
            first.line = 1
            raise first.fault(f"{name} is called for contours up to {number}, not {len(sections)}")
    if not 1 <= begin <= len(sections):
        raise InputError(f"{first.name}.dat: {FIRST} must be the number of a contour, got {begin}")
    return ReadProgram(
        name=first.name,
        sections=tuple(sections[begin - 1 :]),
        T_flange_tip=first.frames.get("tool"),
        T_base_part=first.frames.get("base"),
    )


class _File:
    """One .src, read line by line; each kind of line has a method of its name.

    The main file is the one with an opening.
    """

    def __init__(
        self,
        file: str,
        files: Mapping[str, str],
        robot: Robot,
        settings: KrlSettings,
        opening: list[str],
        *,
        before: int = 0,
    ) -> None:
        self.file, self.files, self.robot, self.settings = file, files, robot, settings
        self.name = file.removesuffix(".src")
        self.is_main, self.opening, self.head = bool(opening), opening, list(HEAD)
        self.routines: list[str] = []
        self.inside = False
        self.calls: dict[str, int] = {}
        self.before, self.condition_open, self.number = before, False, 0
        self.must_say: list[str] = []
        self.begins_again = False
        self.steps: dict[str, list[ReadStep]] = {}
        self.frames: dict[str, Array] = {}
        self.held: dict[str, float] = {}
        self.held_at: dict[str, str] = {}
        self.switches: tuple[Switch, ...] = ()
        self.line = 0
        self.rows = [row.strip() for row in files[file].splitlines()]
        for number, line in enumerate(self.rows, 1):
            self.line = number
            if line and not line.startswith(";"):
                self.read(line)
        self.line += 1
        if self.inside or self.must_say or not self.routines:
            raise self.fault("END is missing")

    def read(self, line: str) -> None:
        if self.must_say:
            if line != self.must_say[0]:
                raise self.fault(f"expected {self.must_say[0]!r}, got {line[:60]!r}")
            del self.must_say[0]
            return
        for rest in (self.head, self.opening if self.inside else []):
            if rest and line == rest[0]:
                del rest[0]
                return
        for kind in self.expected():
            if match := _LINES[kind].fullmatch(line):
                if self.switches and kind not in {"linear", "circular", "trigger"}:
                    raise self.fault("a trigger must stand right before its motion")
                getattr(self, kind)(*match.groups())
                return
        raise self.fault(f"not expected here: {line[:60]!r}")

    def expected(self) -> tuple[str, ...]:
        if not self.inside:
            return ("routine",)
        if len(self.routines) > 1:
            return _IN_ROUTINE
        return _IN_MAIN if self.is_main else _IN_FIRST

    def require_data(self, others: list[str]) -> int:
        """Check that all routines are called and that the .dat declares exactly the other files.

        Returns the contour at which the program begins, if it is the main file's.
        """
        self.line = 1
        if unknown := set(self.calls) ^ {*self.steps, *others}:
            raise self.fault(f"calls and routines do not match: {', '.join(sorted(unknown))}")
        if self.is_main and SWITCH_OFF not in self.routines:
            raise self.fault(f"{SWITCH_OFF} is missing")
        data = f"{self.name}.dat"
        lines = [line.strip() for line in self.files[data].splitlines()]
        first = next((m[1] for line in lines if (m := _FIRST.fullmatch(line))), "0")
        begin = int(first) if self.is_main else None
        for number, line in enumerate(data_list(self.name, others, begin)[:-1], 1):
            if lines[number - 1 : number] != [line]:
                raise InputError(f"{data}, line {number}: expected {line!r}")
        if len(lines) > number:
            raise InputError(f"{data}, line {number + 1}: nothing may follow ENDDAT")
        return int(first)

    def routine(self, name: str, passed: str) -> None:
        if self.head:
            raise self.fault(f"expected {self.head[0]} before")
        if not self.routines and name != self.name:
            raise self.fault(f"the first routine must be named as the file, {self.name}")
        if name in self.routines:
            raise self.fault(f"{name} is defined twice")
        if bool(passed) != (not self.is_main and not self.routines):
            raise self.fault("only the first routine of a file that is called takes a number")
        self.routines.append(name)
        if name == SWITCH_OFF:
            self.must_say = [*switched_off(self.settings), "END"]
            return
        if len(self.routines) > 1:
            self.steps[name] = []
        elif passed:
            self.must_say = [f"INT {PASSED}"]
        self.inside, self.held = True, {}

    def end(self) -> None:
        self.require_opening()
        if self.condition_open:
            raise self.fault("ENDIF is missing")
        if self.is_main and len(self.routines) == 1 and not self.begins_again:
            raise self.fault(f"expected {FIRST}=1 before")
        self.inside = False

    def again(self) -> None:
        if self.condition_open or self.begins_again or not self.calls:
            raise self.fault(f"{FIRST} must be set once, after all calls")
        self.begins_again = True

    def condition(self, variable: str, number: str) -> None:
        self.require_opening()
        if (
            self.begins_again
            or self.condition_open
            or variable != (FIRST if self.is_main else PASSED)
        ):
            raise self.fault("a call must have one condition of its own")
        self.condition_open, self.number = True, int(number)

    def call(self, name: str, passed: str) -> None:
        self.require_opening()
        if name in self.calls:
            raise self.fault(f"{name} is called twice")
        if not self.condition_open or not self.number:
            raise self.fault(f"{name} must be called alone under a condition")
        if not self.is_main and self.number != self.before + len(self.calls) + 1:
            raise self.fault(f"{name} is contour {self.before + len(self.calls) + 1}")
        self.calls[name], self.number = self.number, 0

    def end_condition(self) -> None:
        if not self.condition_open or self.number:
            raise self.fault("a condition must have one call")
        self.condition_open = False

    def request(self, output: str, state: str) -> None:
        partner = partner_of(int(output), "output", self.settings, self.place)
        self.handshake(Request(partner=partner, on=state == "TRUE"))

    def wait_for(self, timeout_ms: str) -> None:
        said = re.match(
            r"WAIT FOR \$IN\[(\d+)\]", "".join(self.rows[self.line + 1 : self.line + 2])
        )
        if said is None:
            raise self.fault("expected the wait for an input two lines below")
        timeout = float(timeout_ms) * 1e-3
        first, *rest = awaiting(int(said[1]), timeout, self.settings)
        if self.rows[self.line - 1] != first:
            raise self.fault(f"expected {first!r}")
        self.must_say = rest
        partner = partner_of(int(said[1]), "input", self.settings, self.place)
        self.handshake(Await(partner=partner, timeout=timeout))

    def handshake(self, what: Handshake) -> None:
        self.append(ReadHandshake(what=what, file=self.file, line=self.line))

    def require_opening(self) -> None:
        if self.opening:
            raise self.fault(f"expected {self.opening[0]} before")
        numbers = {"tool": self.settings.tool_number, "base": self.settings.base_number}
        for kind, n in numbers.items():
            if self.is_main and n is None and kind not in self.frames:
                raise self.fault(f"expected ${kind.upper()} before")

    def tool(self, *point: str) -> None:
        self.frame("tool", self.settings.tool_number, point)

    def base(self, *point: str) -> None:
        self.frame("base", self.settings.base_number, point)

    def frame(self, kind: str, numbered: int | None, point: Sequence[str]) -> None:
        if numbered is not None or kind in self.frames:
            raise self.fault(f"another {kind}")
        self.frames[kind] = _pose(point)

    def share(self, percent: str) -> None:
        self.hold("share", int(percent) / 100)

    def speed(self, speed_m_s: str) -> None:
        self.hold("speed", float(speed_m_s))

    def zone(self, radius_mm: str) -> None:
        self.hold("zone", float(radius_mm) * 1e-3)

    def hold(self, what: str, value: float) -> None:
        self.held[what], self.held_at[what] = value, self.place

    def trigger(self, delay_ms: str, output: str, state: str) -> None:
        if int(delay_ms) > 0:
            raise self.fault("a trigger must not come after its place")
        signal: Signal = "gas" if int(output) == self.settings.gas_output else "laser"
        if signal == "laser":
            same_output(int(output), self.settings.laser_output, self.place)
        lead = -int(delay_ms) * 1e-3
        self.held_at.setdefault("switches", self.place)
        self.switches += (Switch(signal=signal, on=state == "TRUE", lead_time=lead),)

    def wait(self, time: str) -> None:
        self.append(ReadWait(time=float(time), file=self.file, line=self.line))

    def joint(self, *axes_deg: str) -> None:
        axes = np.radians([[float(axis) for axis in axes_deg]])
        self.append(
            ReadMove(
                kind="joint",
                file=self.file,
                line=self.line,
                q=joints_from_axes(self.robot, axes)[0],
                speed=self.holds("share", "BAS(#VEL_PTP,...)"),
                elsewhere={"speed": self.held_at["share"]},
            )
        )

    def linear(self, *fields: str | None) -> None:
        self.path("linear", fields, None)

    def circular(self, *fields: str | None) -> None:
        self.path("circular", fields[6:], _pose(fields[:6]))

    def path(
        self, kind: Literal["linear", "circular"], fields: Sequence[Any], T_part_via: Array | None
    ) -> None:
        *point, status, turn, blended = fields
        self.append(
            ReadMove(
                kind=kind,
                file=self.file,
                line=self.line,
                T_part_tip=_pose(point),
                T_part_via=T_part_via,
                posture=(int(status), int(turn)),
                speed=self.holds("speed", "$VEL.CP"),
                zone=self.holds("zone", "$APO.CDIS") if blended else 0.0,
                switches=self.switches,
                elsewhere=self.elsewhere("speed", *(["zone"] if blended else []), "switches"),
            )
        )
        self.switches = ()
        self.held_at.pop("switches", None)

    def append(self, step: ReadStep) -> None:
        self.steps[self.routines[-1]].append(step)

    def elsewhere(self, *whats: str) -> dict[str, str]:
        """Return where what holds for a motion has been set."""
        return {what: self.held_at[what] for what in whats if what in self.held_at}

    def holds(self, what: str, word: str) -> float:
        if what not in self.held:
            raise self.fault(f"{word} has not been set in this routine")
        return self.held[what]

    def fault(self, message: str) -> InputError:
        return InputError(f"{self.place}: {message}")

    @property
    def place(self) -> str:
        return f"{self.file}, line {self.line}"


def _pose(fields: Sequence[Any]) -> Array:
    """Return the pose (4, 4) m of X, Y, Z in mm and A, B, C in deg."""
    values = [float(field) for field in fields]
    T = np.eye(4)
    T[:3, :3] = Rotation.from_euler("ZYX", values[3:], degrees=True).as_matrix()
    T[:3, 3] = np.array(values[:3]) * 1e-3
    return freeze(T)
