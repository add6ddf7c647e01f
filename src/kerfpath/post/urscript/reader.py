"""Read back the URScript that `URScript` writes; anything else is refused."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.spatial.transform import Rotation

from kerfpath.arrays import Array, freeze
from kerfpath.post.build import offset_near
from kerfpath.post.flow import section_of
from kerfpath.post.harmless import LinePattern
from kerfpath.post.languages import reset_lines
from kerfpath.post.line_reader import (
    END_OF_FILE,
    LineReader,
    numbers_in,
    patterns,
    program_lines,
    statements,
)
from kerfpath.post.program import SIGNALS, Signal, Switch
from kerfpath.post.read_program import FlowStep, MoveKind, ReadProgram, ReadSection
from kerfpath.post.urscript.writer import (
    FIRST,
    OFF,
    URScriptSettings,
    full_joint_speed,
    inherited,
    stop_lines,
    switch_lines,
    time_ahead,
    wait_lines,
)
from kerfpath.robots import Robot


def read(
    main: str, files: Mapping[str, str], robot: Robot, settings: URScriptSettings
) -> ReadProgram:
    """Return the program in a script that `URScript` wrote; see `kerfpath.post.Reader`."""
    return _Reader(main, files[main], robot, settings).program()


DIGIT = 1e-6
"""Rounding error of an acceleration, m/s^2 or rad/s^2."""

_NUMBER = r"(-?(?:\d+\.?\d*|\.\d+))"
_SIX = ", ".join([_NUMBER] * 6)
_POSE = rf"p\[{_SIX}\]"
_MOTION = rf"a={_NUMBER}, v={_NUMBER}, r={_NUMBER}"
_TARGET = rf"pose_trans\(part_frame, {_POSE}\)"
_SIGNAL = f"({'|'.join(SIGNALS)})"
_VALUE = r"(True|False|\d+\.\d+)"
_OUTPUT = r"get_standard_digital_out\(\d\)"
_DEFINITION = LinePattern(r"def ([A-Za-z]\w*)\(\):")
_CALL = LinePattern(r"([A-Za-z]\w*)\(\)")
_FIRST = LinePattern(rf"global {FIRST} = (\d{{1,6}})")
_TOOL = LinePattern(rf"set_tcp\({_POSE}\)")
_PART = LinePattern(rf"global part_frame = {_POSE}")
_STEPS = patterns(
    {
        "linear": rf"movel\({_TARGET}, {_MOTION}\)",
        "circular": rf"movec\({_TARGET}, {_TARGET}, {_MOTION}, mode=0\)",
        "joint": rf"movej\(\[{_SIX}\], a={_NUMBER}, v={_NUMBER}, (?:t={_NUMBER}, )?r={_NUMBER}\)",
        "switch_ahead": rf"{_SIGNAL}_ahead\({_POSE}, {_NUMBER}, {_VALUE}\)",
        "switch": rf"{_SIGNAL}_set\({_VALUE}\)",
        "guarded": rf"laser_set\(({_OUTPUT}(?: and {_OUTPUT})*)\)",
        "wait": rf"sleep\({_NUMBER}\)",
        "request": r"set_standard_digital_out\((\d), (True|False)\)",
        "wait_for": rf"await_input\((\d), {_NUMBER}\)",
    }
)
WAITING = "await_input"
"""Name of the routine that waits for an input; without an answer the program ends there."""
_WITHOUT_ANSWER = patterns(
    {
        "": r"def await_input.*|waited = .*|while .*|sync\(\)|if .*|popup\(.*|end",
        "off": r"set_standard_digital_out\((\d), False\)",
        "power_off": r"set_standard_analog_out\((\d), 0\.0\)",
        "end_program": "halt",
    }
)


class _Reader(LineReader):
    """Reader of a script, one part after the other."""

    settings: URScriptSettings
    language = "urscript"

    def __init__(self, file: str, text: str, robot: Robot, settings: URScriptSettings) -> None:
        super().__init__(file, robot, settings, statements(program_lines(file, text), "#"))
        self.signals: list[Signal] = []
        self.can_wait = False
        self.ahead: dict[str, tuple[tuple[str, ...], float, str]] = {}
        self.ahead_at: dict[str, str] = {}
        self.leads: dict[str, tuple[float, str]] = {}
        self.advance()

    def program(self) -> ReadProgram:
        (name,) = self.take(_DEFINITION, "def NAME():")
        tool = _pose(self.take(_TOOL, "set_tcp(p[...])"))
        part = _pose(self.take(_PART, "global part_frame = p[...]"))
        begin = int(self.take(_FIRST, f"global {FIRST} = 1")[0])
        self.expect(reset_lines(inherited(self.settings)))
        self.expect(stop_lines(self.settings))
        self.can_wait = self.same(self.text, wait_lines(self.settings)[0])
        if self.can_wait:
            self.expect(wait_lines(self.settings), _WITHOUT_ANSWER)
        exits = {WAITING: tuple(self.steps)}
        signals: list[Signal] = self.signals
        for known in SIGNALS.values():
            if not self.same(self.text, f"global {known}_waits = False"):
                continue
            output = getattr(self.settings, f"{known}_output")
            if output is None:
                raise self.fault(f"the {known} is switched; name its output with {known}_output")
            signals.append(known)
            self.expect(switch_lines(known, output))
        sections: dict[str, ReadSection] = {}
        while match := _DEFINITION.fullmatch(self.text):
            if match[1] in sections:
                raise self.fault(f"{match[1]} is defined twice")
            self.advance()
            sections[match[1]] = section_of(match[1], self.section())
        for signal in signals:
            self.expect([f"{signal}_set({OFF[signal]})", f"{signal}_run = run {signal}_thread()"])
        calls: list[str] = []
        while self.same(self.text, f"if {FIRST} <= {len(calls) + 1}:"):
            self.advance()
            calls += self.take(_CALL, "the call of a contour")
            self.expect(["end"])
        if not 1 <= begin <= len(calls):
            raise self.fault(f"{FIRST} must be the number of a contour")
        if calls != list(sections):
            raise self.fault("the contours must be called once each, in their order")
        self.expect([*(f"kill {signal}_run" for signal in signals), "end", END_OF_FILE])
        robot = self.robot
        return ReadProgram(
            name=name,
            sections=tuple(sections.values())[begin - 1 :],
            T_flange_tip=freeze(np.linalg.inv(robot.T_end_flange) @ tool),
            T_base_part=freeze(robot.T_base_foot @ part),
            exits=exits,
        )

    def section(self) -> list[FlowStep]:
        """Return the steps of a contour, to its end."""
        self.steps = []
        while self.text != "end":
            self.read(self.text, _STEPS)
            self.advance()
        self.require_stopped("a move")
        self.advance()
        return self.steps

    def joint(self, *said: str | None) -> None:
        self.require_stopped("a move")
        *angles, a, v, _, r = (float(word or "nan") for word in said)
        self.require_acceleration(a, np.radians(self.settings.joint_acceleration_deg_s2))
        timed, robot = said[-2], self.robot
        self.add_move(
            "joint",
            v / full_joint_speed(robot) if timed is None else None,
            duration=None if timed is None else float(timed),
            q=freeze(robot.sign * (np.array(angles) + offset_near(robot, 0.0))),
            zone=r,
        )

    def require_acceleration(self, said: float, expected: float) -> None:
        """Refuse an acceleration that is not that of the settings."""
        if abs(said - expected) > DIGIT:
            raise self.fault(f"expected the acceleration a={expected:.6f}, got {said:g}")

    def linear(self, *said: str) -> None:
        self.path(said[:6], said[6:])

    def circular(self, *said: str) -> None:
        self.path(said[6:12], said[12:], _pose(said[:6]))

    def path(
        self, target: tuple[str, ...], motion: tuple[str, ...], via: Array | None = None
    ) -> None:
        armed, self.ahead = self.ahead, {}
        self.require_stopped("a move")
        a, v, r = (float(word) for word in motion)
        if min(a, v) <= 0:
            raise self.fault("speed and acceleration must be above 0")
        self.require_acceleration(a, self.settings.acceleration)
        for signal, (point, near, on) in armed.items():
            if [*map(float, point)] != [*map(float, target)]:
                raise self.fault(f"the {signal} is switched ahead of another point than the target")
            self.leads[signal] = time_ahead(near, v, a, stops=r == 0), on
        kind: MoveKind = "linear" if via is None else "circular"
        self.add_move(kind, v, T_part_tip=_pose(target), T_part_via=via, zone=r)

    def switch_ahead(self, signal: str, *said: str) -> None:
        *target, near, on = said
        self.require_signal(signal)
        if signal in self.ahead:
            raise self.fault(f"the {signal} is switched ahead twice")
        self.ahead[signal] = tuple(target), float(near), on
        self.ahead_at[signal] = self.place

    def switch(self, signal: str, on: str) -> None:
        self.require_signal(signal)
        move = self.last_on_path()
        if signal == "power" and "power" not in self.leads and (move is None or move.zone == 0):
            if self.ahead:
                raise self.fault("a power must not be set while a switch is to come")
            self.power(self.settings.power_output, self.value(signal, on))
            return
        if self.ahead or move is None:
            raise self.fault("a switch must follow a linear or circular move")
        lead, before = self.leads.pop(signal, (0.0, on))
        if before != on:
            raise self.fault(f"the {signal} is switched to {before} ahead, but to {on} here")
        place = move.elsewhere.get("switches", self.ahead_at.pop(signal, self.place))
        said = self.value(signal, on)
        switch = Switch(signal=SIGNALS[signal], on=on == "True", lead_time=lead)
        if signal == "power":
            switch = self.power_switch(self.settings.power_output, said, lead)
        self.add_switch(move, switch, place)

    def value(self, signal: str, said: str) -> str:
        """Return the value that a signal is set to: a number for the power alone."""
        if (signal == "power") == (said in ("True", "False")):
            raise self.fault(f"expected {OFF[SIGNALS[signal]]} or the like, got {said}")
        return said

    def guarded(self, needed: str) -> None:
        self.require_signal("laser")
        if self.ahead or "laser" in self.leads:
            raise self.fault("the laser must not be switched ahead if it needs other outputs")
        self.add_needing(numbers_in(needed))

    def request(self, port: str, on: str) -> None:
        self.ask(int(port), on=on == "True")

    def wait_for(self, port: str, timeout: str) -> None:
        if not self.can_wait:
            raise self.fault("the program does not define how it waits for an input")
        self.expect_answer(int(port), float(timeout), otherwise=WAITING)

    def require_stopped(self, what: str) -> None:
        """Require that a signal switched ahead of the end of a move is also switched at its end."""
        if ahead := [*self.ahead, *self.leads]:
            raise self.fault(f"the {ahead[0]} is switched ahead of a move, but not at its end")

    def require_signal(self, signal: str) -> None:
        if signal not in self.signals:
            raise self.fault(f"the program does not define how it switches the {signal}")


def _pose(words: tuple[str, ...]) -> Array:
    """Return the pose (4, 4) m of six numbers."""
    values = np.array([float(word) for word in words])
    T = np.eye(4)
    T[:3, :3] = Rotation.from_rotvec(values[3:]).as_matrix()
    T[:3, 3] = values[:3]
    return freeze(T)
