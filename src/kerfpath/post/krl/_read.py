"""Read back the KRL that `Krl` writes, and nothing else: what it does not know, it refuses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Literal

import numpy as np
from scipy.spatial.transform import Rotation

from kerfpath._arrays import Array, freeze
from kerfpath.errors import InputError
from kerfpath.post._program import Signal, Switch
from kerfpath.post._read import (
    ReadMove,
    ReadProgram,
    ReadSection,
    ReadStep,
    ReadWait,
    patterns,
    same_output,
)
from kerfpath.post.krl._axes import joints_from_axes
from kerfpath.post.krl._settings import KrlSettings
from kerfpath.post.krl._write import AXES, HEAD, data_list, opening
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
        "call": rf"{_NAME}\(\)",
        "end": "END",
        "routine": rf"DEF {_NAME}\(\)",
        "tool": rf"\$TOOL={{{_POINT}}}",
        "base": rf"\$BASE={{{_POINT}}}",
    }
)
_IN_MAIN = ("tool", "base", "call", "end")
_IN_FIRST = ("call", "end")
_IN_ROUTINE = ("linear", "speed", "zone", "trigger", "circular", "joint", "share", "wait", "end")


def read(main: str, files: Mapping[str, str], robot: Robot, settings: KrlSettings) -> ReadProgram:
    """Return the program that .src and .dat files of ours say; see `kerfpath.post.Reader`."""
    first = _File(main, files, robot, settings, opening(settings))
    others = [name for name in first.calls if name not in first.steps]
    first.require_calls(others)
    sections = []
    for name in first.calls:
        own = first
        if name in others:
            own = _File(f"{name}.src", files, robot, settings, [])
            own.require_calls([])
        names = own.calls if name in others else [name]
        sections += [ReadSection(name=n, steps=tuple(own.steps[n])) for n in names]
    return ReadProgram(
        name=first.name,
        sections=tuple(sections),
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
    ) -> None:
        self.file, self.files, self.robot, self.settings = file, files, robot, settings
        self.name = file.removesuffix(".src")
        self.is_main, self.opening, self.head = bool(opening), opening, list(HEAD)
        self.routines: list[str] = []
        self.inside = False
        self.calls: list[str] = []
        self.steps: dict[str, list[ReadStep]] = {}
        self.frames: dict[str, Array] = {}
        self.held: dict[str, float] = {}
        self.switches: tuple[Switch, ...] = ()
        self.line = 0
        for self.line, text in enumerate(files[file].splitlines(), 1):
            line = text.strip()
            if line and not line.startswith(";"):
                self.read(line)
        self.line += 1
        if self.inside or not self.routines:
            raise self.fault("END is missing")

    def read(self, line: str) -> None:
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

    def require_calls(self, others: list[str]) -> None:
        """Check that all routines are called and that the .dat declares exactly the other files."""
        self.line = 1
        if unknown := set(self.calls) ^ {*self.steps, *others}:
            raise self.fault(f"calls and routines do not match: {', '.join(sorted(unknown))}")
        data = f"{self.name}.dat"
        lines = [line.strip() for line in self.files[data].splitlines()]
        for number, line in enumerate(data_list(self.name, others)[:-1], 1):
            if lines[number - 1 : number] != [line]:
                raise InputError(f"{data}, line {number}: expected {line!r}")
        if len(lines) > number:
            raise InputError(f"{data}, line {number + 1}: nothing may follow ENDDAT")

    def routine(self, name: str) -> None:
        if self.head:
            raise self.fault(f"expected {self.head[0]} before")
        if not self.routines and name != self.name:
            raise self.fault(f"the first routine must be named as the file, {self.name}")
        if name in self.routines:
            raise self.fault(f"{name} is defined twice")
        if self.routines:
            self.steps[name] = []
        self.routines.append(name)
        self.inside, self.held = True, {}

    def end(self) -> None:
        self.require_opening()
        self.inside = False

    def call(self, name: str) -> None:
        self.require_opening()
        if name in self.calls:
            raise self.fault(f"{name} is called twice")
        self.calls.append(name)

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
        self.held["share"] = int(percent) / 100

    def speed(self, speed_m_s: str) -> None:
        self.held["speed"] = float(speed_m_s)

    def zone(self, radius_mm: str) -> None:
        self.held["zone"] = float(radius_mm) * 1e-3

    def trigger(self, delay_ms: str, output: str, state: str) -> None:
        if int(delay_ms) > 0:
            raise self.fault("a trigger must not come after its place")
        signal: Signal = "gas" if int(output) == self.settings.gas_output else "laser"
        if signal == "laser":
            same_output(int(output), self.settings.laser_output, f"{self.file}, line {self.line}")
        lead = -int(delay_ms) * 1e-3
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
            )
        )
        self.switches = ()

    def append(self, step: ReadStep) -> None:
        self.steps[self.routines[-1]].append(step)

    def holds(self, what: str, word: str) -> float:
        if what not in self.held:
            raise self.fault(f"{word} has not been set in this routine")
        return self.held[what]

    def fault(self, message: str) -> InputError:
        return InputError(f"{self.file}, line {self.line}: {message}")


def _pose(fields: Sequence[Any]) -> Array:
    """Return the pose (4, 4) m of X, Y, Z in mm and A, B, C in deg."""
    values = [float(field) for field in fields]
    T = np.eye(4)
    T[:3, :3] = Rotation.from_euler("ZYX", values[3:], degrees=True).as_matrix()
    T[:3, 3] = np.array(values[:3]) * 1e-3
    return freeze(T)
