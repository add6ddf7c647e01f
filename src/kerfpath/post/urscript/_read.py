"""Read back the URScript that `URScript` writes, and nothing else: the rest it refuses."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from kerfpath._arrays import Array, freeze
from kerfpath.errors import InputError
from kerfpath.post._counting import offset_near
from kerfpath.post._program import SIGNALS, Await, Handshake, Request, Switch
from kerfpath.post._read import (
    ReadHandshake,
    ReadMove,
    ReadProgram,
    ReadSection,
    ReadStep,
    ReadWait,
    partner_of,
    patterns,
)
from kerfpath.post.urscript._switching import time_ahead, waiting, when_stopped, words
from kerfpath.post.urscript._write import FIRST, URScriptSettings, full_joint_speed, outputs
from kerfpath.robots import Robot

__all__ = ["read"]


def read(
    main: str, files: Mapping[str, str], robot: Robot, settings: URScriptSettings
) -> ReadProgram:
    """Return the program that a script of ours says; see `kerfpath.post.Reader`."""
    return _Reader(main, files[main], robot, settings).program()


DIGIT = 1e-6
"""What the digits of an acceleration leave, m/s^2 or rad/s^2."""

_NUMBER = r"(-?\d+\.\d+)"
_SIX = ", ".join([_NUMBER] * 6)
_POSE = rf"p\[{_SIX}\]"
_MOTION = rf"a={_NUMBER}, v={_NUMBER}, r={_NUMBER}"
_TARGET = rf"pose_trans\(part_frame, {_POSE}\)"
_SIGNAL = "(laser|gas)"
_DEFINITION = re.compile(r"def ([A-Za-z]\w*)\(\):", re.ASCII)
_CALL = re.compile(r"([A-Za-z]\w*)\(\)", re.ASCII)
_FIRST = re.compile(rf"global {FIRST} = (\d{{1,6}})", re.ASCII)
_TOOL = re.compile(rf"set_tcp\({_POSE}\)", re.ASCII)
_PART = re.compile(rf"global part_frame = {_POSE}", re.ASCII)
_STEPS = patterns(
    {
        "linear": rf"movel\({_TARGET}, {_MOTION}\)",
        "circular": rf"movec\({_TARGET}, {_TARGET}, {_MOTION}, mode=0\)",
        "joint": rf"movej\(\[{_SIX}\], a={_NUMBER}, v={_NUMBER}, (?:t={_NUMBER}, )?r={_NUMBER}\)",
        "switch_ahead": rf"{_SIGNAL}_ahead\({_POSE}, {_NUMBER}, (True|False)\)",
        "switch": rf"{_SIGNAL}_set\((True|False)\)",
        "wait": rf"sleep\({_NUMBER}\)",
        "request": r"set_standard_digital_out\((\d), (True|False)\)",
        "wait_for": rf"await_input\((\d), {_NUMBER}\)",
    }
)


class _Reader:
    """Reads one part of the program after the other; comments and blank lines are passed over."""

    def __init__(self, file: str, text: str, robot: Robot, settings: URScriptSettings) -> None:
        self.file, self.robot, self.settings = file, robot, settings
        lines = [(n, line.strip()) for n, line in enumerate(text.splitlines(), 1)]
        self.lines = [(n, line) for n, line in lines if line and not line.startswith("#")]
        self.lines.append((len(text.splitlines()) + 1, "the end of the file"))
        self.at = 0
        self.steps: list[ReadStep] = []
        self.signals: list[str] = []
        self.can_wait = False
        self.ahead: dict[str, tuple[tuple[str, ...], float, str]] = {}
        self.ahead_at: dict[str, str] = {}
        self.leads: dict[str, tuple[float, str]] = {}

    def program(self) -> ReadProgram:
        (name,) = self.take(_DEFINITION, "def NAME():")
        tool = _pose(self.take(_TOOL, "set_tcp(p[...])"))
        part = _pose(self.take(_PART, "global part_frame = p[...]"))
        begin = int(self.take(_FIRST, f"global {FIRST} = 1")[0])
        self.expect(when_stopped(outputs(self.settings)))
        self.can_wait = self.line == waiting([])[0]
        if self.can_wait:
            self.expect(waiting(outputs(self.settings)))
        signals = self.signals
        for known in SIGNALS.values():
            if self.line != f"global {known}_waits = False":
                continue
            output = getattr(self.settings, f"{known}_output")
            if output is None:
                raise self.fault(f"switches the {known}; say by which output with {known}_output")
            signals.append(known)
            self.expect(words(known, output))
        sections: dict[str, ReadSection] = {}
        while match := _DEFINITION.fullmatch(self.line):
            if match[1] in sections:
                raise self.fault(f"{match[1]} is defined twice")
            self.at += 1
            sections[match[1]] = ReadSection(name=match[1], steps=self.section())
        for signal in signals:
            self.expect([f"{signal}_set(False)", f"{signal}_run = run {signal}_thread()"])
        calls: list[str] = []
        while self.line == f"if {FIRST} <= {len(calls) + 1}:":
            self.at += 1
            calls += self.take(_CALL, "the call of a contour")
            self.expect(["end"])
        if not 1 <= begin <= len(calls):
            raise self.fault(f"{FIRST} must be the number of a contour")
        if calls != list(sections):
            raise self.fault("the contours must be called once each, in their order")
        self.expect([*(f"kill {signal}_run" for signal in signals), "end", "the end of the file"])
        robot = self.robot
        return ReadProgram(
            name=name,
            sections=tuple(sections.values())[begin - 1 :],
            T_flange_tip=freeze(np.linalg.inv(robot.T_end_flange) @ tool),
            T_base_part=freeze(robot.T_base_foot @ part),
        )

    def section(self) -> tuple[ReadStep, ...]:
        """Return the steps of a contour, to its end."""
        self.steps = []
        while self.line != "end":
            for kind, pattern in _STEPS.items():
                if match := pattern.fullmatch(self.line):
                    getattr(self, kind)(match.groups())
                    break
            else:
                raise self.fault(f"not expected here: {self.line[:60]!r}")
            self.at += 1
        self.settled()
        self.at += 1
        return tuple(self.steps)

    def joint(self, words: tuple[str, ...]) -> None:
        self.settled()
        *angles, a, v, _, r = (float(word or "nan") for word in words)
        self.require_acceleration(a, np.radians(self.settings.joint_acceleration_deg_s2))
        timed = words[-2]
        robot = self.robot
        self.steps.append(
            ReadMove(
                kind="joint",
                file=self.file,
                line=self.number,
                q=freeze(robot.sign * (np.array(angles) + offset_near(robot, 0.0))),
                speed=v / full_joint_speed(robot) if timed is None else None,
                duration=None if timed is None else float(timed),
                zone=r,
            )
        )

    def require_acceleration(self, said: float, expected: float) -> None:
        """Refuse another acceleration than that of the settings."""
        if abs(said - expected) > DIGIT:
            raise self.fault(f"expected the acceleration a={expected:.6f}, got {said:g}")

    def linear(self, words: tuple[str, ...]) -> None:
        self.path_move(words[:6], words[6:], None)

    def circular(self, words: tuple[str, ...]) -> None:
        self.path_move(words[6:12], words[12:], _pose(words[:6]))

    def path_move(
        self, target: tuple[str, ...], motion: tuple[str, ...], via: Array | None
    ) -> None:
        armed, self.ahead = self.ahead, {}
        self.settled()
        a, v, r = (float(word) for word in motion)
        if min(a, v) <= 0:
            raise self.fault("speed and acceleration must be above 0")
        self.require_acceleration(a, self.settings.acceleration)
        for signal, (point, near, on) in armed.items():
            if point != target:
                raise self.fault(f"the {signal} is switched ahead of another point")
            self.leads[signal] = time_ahead(near, v, a, stops=r == 0), on
        self.steps.append(
            ReadMove(
                kind="linear" if via is None else "circular",
                file=self.file,
                line=self.number,
                T_part_tip=_pose(target),
                T_part_via=via,
                speed=v,
                zone=r,
            )
        )

    def switch_ahead(self, words: tuple[str, ...]) -> None:
        signal, *target, near, on = words
        self.require_signal(signal)
        if signal in self.ahead:
            raise self.fault(f"the {signal} is switched ahead twice")
        self.ahead[signal] = tuple(target), float(near), on
        self.ahead_at[signal] = f"{self.file}, line {self.number}"

    def switch(self, words: tuple[str, str]) -> None:
        signal, on = words
        self.require_signal(signal)
        move = self.steps[-1] if self.steps else None
        if self.ahead or not isinstance(move, ReadMove) or move.kind == "joint":
            raise self.fault("a switch must follow a linear or circular move")
        lead, before = self.leads.pop(signal, (0.0, on))
        if before != on:
            raise self.fault(f"the {signal} is switched to {before} ahead, to {on} here")
        switch = Switch(signal=SIGNALS[signal], on=on == "True", lead_time=lead)
        at = self.ahead_at.pop(signal, f"{self.file}, line {self.number}")
        self.steps[-1] = replace(
            move,
            switches=(*move.switches, switch),
            elsewhere={"switches": at, **move.elsewhere},
        )

    def wait(self, words: tuple[str, ...]) -> None:
        self.settled()
        self.steps.append(ReadWait(time=float(words[0]), file=self.file, line=self.number))

    def request(self, words: tuple[str, str]) -> None:
        port, on = words
        partner = partner_of(int(port), "output", self.settings, f"{self.file}, line {self.number}")
        self.handshake(Request(partner=partner, on=on == "True"))

    def wait_for(self, words: tuple[str, str]) -> None:
        port, timeout = words
        if not self.can_wait:
            raise self.fault("the program does not say how it waits for an input")
        partner = partner_of(int(port), "input", self.settings, f"{self.file}, line {self.number}")
        self.handshake(Await(partner=partner, timeout=float(timeout)))

    def handshake(self, what: Handshake) -> None:
        self.settled()
        self.steps.append(ReadHandshake(what=what, file=self.file, line=self.number))

    def settled(self) -> None:
        """Require that what is switched ahead of a move is switched at its end, too."""
        if unsettled := [*self.ahead, *self.leads]:
            raise self.fault(f"the {unsettled[0]} is switched ahead of a move, not at its end")

    def require_signal(self, signal: str) -> None:
        if signal not in self.signals:
            raise self.fault(f"the program does not say how it switches the {signal}")

    @property
    def line(self) -> str:
        return self.lines[self.at][1]

    @property
    def number(self) -> int:
        return self.lines[self.at][0]

    def take(self, pattern: re.Pattern[str], what: str) -> tuple[str, ...]:
        """Return the groups of the next line, which must match."""
        match = pattern.fullmatch(self.line)
        if match is None:
            raise self.fault(f"expected {what}, got {self.line[:60]!r}")
        self.at += 1
        return match.groups()

    def expect(self, lines: list[str]) -> None:
        """Pass over lines that must stand here, word for word."""
        for line in lines:
            if self.line != line.strip():
                raise self.fault(f"expected {line.strip()!r}, got {self.line[:60]!r}")
            self.at += 1

    def fault(self, message: str) -> InputError:
        return InputError(f"{self.file}, line {self.number}: {message}")


def _pose(words: tuple[str, ...]) -> Array:
    """Return the pose (4, 4) m that six numbers say."""
    values = np.array([float(word) for word in words])
    T = np.eye(4)
    T[:3, :3] = Rotation.from_rotvec(values[3:]).as_matrix()
    T[:3, 3] = values[:3]
    return freeze(T)
