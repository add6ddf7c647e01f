"""Read back the G code that `Linuxcnc` writes; anything else is refused."""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np

from kerfpath.arrays import Array, freeze
from kerfpath.post.build import from_controller_units
from kerfpath.post.flow import section_of
from kerfpath.post.harmless import LinePattern
from kerfpath.post.languages import reset_lines
from kerfpath.post.line_reader import (
    END_OF_FILE,
    LineReader,
    patterns,
    program_lines,
    statements,
)
from kerfpath.post.linuxcnc.controller import (
    PORTS,
    WORDS,
    LinuxcncSettings,
    goes_nowhere,
    hal_lines,
    inherited,
    ini_lines,
    longest_way,
    ramp_of,
    time_from,
)
from kerfpath.post.linuxcnc.writer import (
    AWAIT,
    GUARD,
    MINUTE,
    MOST_NEEDS,
    STOP,
    blend_line,
    guard_lines,
    off_lines,
    wait_lines,
)
from kerfpath.post.program import Switch
from kerfpath.post.read_program import FlowStep, ReadMove, ReadProgram, ReadSection
from kerfpath.robots import Robot


def read(
    main: str, files: Mapping[str, str], robot: Robot, settings: LinuxcncSettings
) -> ReadProgram:
    """Return the program in the G code that `Linuxcnc` wrote; see `kerfpath.post.Reader`."""
    reader = _Reader(main, files[main], robot, settings)
    program = reader.program()
    name = main.removesuffix(".ngc")
    first = program.moves[0].q if program.moves else np.zeros(robot.joints)
    assert first is not None
    for end, lines in (
        (".ini", ini_lines(name, robot, first)),
        (".hal", hal_lines(robot, settings)),
    ):
        file = f"{name}{end}"
        rows = [
            (n, row)
            for n, row in enumerate(program_lines(file, files[file]), 1)
            if not _IDLE.fullmatch(row)
        ]
        beside = LineReader(file, robot, settings, rows)
        beside.advance()
        beside.expect([*lines, END_OF_FILE])
    return program


_NUMBER = r"(-?(?:\d+\.?\d*|\.\d+))"
_IDLE = re.compile(r"[ \t]*(?:#.*)?", re.ASCII)
"""An empty line or a remark of INI and HAL."""
_NAME = r"([A-Za-z]\w*)"
_SUB = LinePattern(rf"o<{_NAME}> sub", caseless=True)
_CALL = LinePattern(rf"o<{_NAME}> call", caseless=True)
_ACTIVE = re.compile(r"\s*(?:msg|debug|print|log\w*|probe\w*|abort|py\w*)\s*,", re.ASCII | re.I)
"""The begin of a remark that does something."""
_WITHOUT_ANSWER = patterns(
    {
        "": r"o<.*|M66 .*|\(MSG,.*\)",
        "off": r"M65 P(\d{1,2})",
        "power_off": r"M68 E(\d) Q0",
        "end_program": "M2",
    },
    caseless=True,
)


def _steps(words: str) -> dict[str, LinePattern]:
    """Return the patterns of the lines of a contour of a robot with these words."""
    target = " ".join(rf"{word}{_NUMBER}" for word in words)
    return patterns(
        {
            "linear": rf"G1 {target} F{_NUMBER}",
            "joint": rf"G53 G1 {target} F{_NUMBER}",
            "path_mode": r"(G61\.1|G64 P.* Q0)",
            "switch_ahead": r"M(62|63) P(\d{1,2})",
            "switch_now": r"M(64|65) P(\d{1,2})",
            "power_ahead": rf"M67 E(\d) Q{_NUMBER}",
            "power_now": rf"M68 E(\d) Q{_NUMBER}",
            "guarded": rf"o<{GUARD}> call" + r" \[(\d{1,2})\]" * MOST_NEEDS,
            "wait": rf"G4 P{_NUMBER}",
            "wait_for": rf"o<{AWAIT}> call \[(\d{{1,2}})\] \[{_NUMBER}\]",
        },
        caseless=True,
    )


class _Reader(LineReader):
    """Reader of the program, one part after the other."""

    settings: LinuxcncSettings
    language = "linuxcnc"

    def __init__(self, file: str, text: str, robot: Robot, settings: LinuxcncSettings) -> None:
        lines = program_lines(file, text)
        super().__init__(file, robot, settings, statements(lines, ";"))
        for self.line, line in enumerate(lines, 1):
            remark = line.partition(";")[2]
            if _ACTIVE.match(remark):
                raise self.fault(f"a remark that does something: {remark[:40]!r}")
        self.patterns = _steps(WORDS[: robot.joints])
        self.stops: bool | None = None
        self.here: Array | None = None
        self.can_wait = self.can_guard = False
        self.advance()

    def program(self) -> ReadProgram:
        self.expect(reset_lines(inherited(self.settings)))
        self.expect(off_lines(self.settings))
        self.can_wait = self.same(self.text, wait_lines(self.settings)[0])
        if self.can_wait:
            self.expect(wait_lines(self.settings), _WITHOUT_ANSWER)
        exits = {AWAIT: tuple(self.steps)}
        self.can_guard = self.same(self.text, guard_lines(0)[0])
        if self.can_guard:
            self.expect(guard_lines(self.settings.laser_output))
        sections: dict[str, ReadSection] = {}
        while match := _SUB.fullmatch(self.text):
            name = self.spelled(match[1])
            if name in sections:
                raise self.fault(f"{name} is defined twice")
            self.advance()
            sections[name] = section_of(name, self.section(name))
        calls: list[str] = []
        while match := _CALL.fullmatch(self.text):
            calls.append(self.spelled(match[1]))
            self.advance()
        if calls != list(sections):
            raise self.fault("the contours must be called once each, in their order")
        self.expect(["M2", END_OF_FILE])
        return ReadProgram(
            name=self.file.removesuffix(".ngc"), sections=tuple(sections.values()), exits=exits
        )

    def section(self, name: str) -> list[FlowStep]:
        """Return the steps of a contour, to its end."""
        self.steps, self.stops = [], None
        while not self.same(self.text, f"o<{name}> endsub"):
            self.read(self.text, self.patterns)
            self.next_row()
        self.advance()
        return self.steps

    def path_mode(self, mode: str) -> None:
        self.stops = self.same(mode, STOP)
        if not self.stops:
            self.require_line(mode, blend_line(self.settings))

    def joint(self, *said: str) -> None:
        self.require_mode(stops=True)
        q, cruise = self.target(said)
        way = np.zeros(len(q)) if self.here is None else q - self.here
        timed = not goes_nowhere(way)
        self.add_move(
            "joint",
            None if timed else longest_way(self.robot) / cruise,
            duration=time_from(cruise, ramp_of(self.robot, way)) if timed else None,
            q=q,
        )
        self.here = q

    def linear(self, *said: str) -> None:
        self.require_mode()
        q, took = self.target(said)
        zone = 0.0 if self.stops else None
        self.add_move("linear", None, duration=took, zone=zone, q=q)
        self.here = q

    def target(self, said: tuple[str, ...]) -> tuple[Array, float]:
        """Return the joints (n,) rad and m of a target, and the time (s) that F gives."""
        *values, rate = (float(word) for word in said)
        if rate <= 0:
            raise self.fault(f"expected F above 0, got {rate:g}")
        arm = self.robot.family.joints
        x = from_controller_units(self.robot, values[arm:])
        return freeze(np.append(np.radians(values[:arm]), x)), MINUTE / rate

    def require_mode(self, *, stops: bool = False) -> None:
        """Refuse a move of which it is not known how it ends, or a joint move that does not."""
        if self.stops is None or (stops and not self.stops):
            raise self.fault(f"expected {STOP} before this move")

    def switch_ahead(self, code: str, port: str) -> None:
        self.switch(int(port), on=code == "62")

    def switch_now(self, code: str, port: str) -> None:
        if self.is_signal(int(port)):
            self.switch(int(port), on=code == "64", now=True)
        else:
            self.ask(int(port), on=code == "64")

    def switch(self, port: int, *, on: bool, now: bool = False) -> None:
        move = self.last_on_path()
        if move is None or (now and move.zone != 0):
            raise self.fault("a switch must follow a move of the path, which stops for M64 and M65")
        self.add_switch(move, Switch(signal=self.signal(port), on=on), self.place)

    def power_ahead(self, output: str, value: str) -> None:
        move = self.last_on_path()
        if move is None:
            raise self.fault("expected M68 here: M67 sets a power as the path goes on")
        self.add_switch(move, self.power_switch(int(output), value), self.place)

    def power_now(self, output: str, value: str) -> None:
        last = [step for step in self.steps if isinstance(step, ReadMove)][-1:]
        if last and last[0].zone != 0:
            raise self.fault("expected M67 here: M68 does not wait for the end of the move")
        self.power(int(output), value)

    def power_off(self, output: object) -> None:
        super().power_off(int(str(output)))

    def guarded(self, *ports: str) -> None:
        if not self.can_guard:
            raise self.fault("the program does not define how it switches the laser on")
        needed = list(dict.fromkeys(int(port) - PORTS for port in ports))
        self.add_needing(needed)

    def wait_for(self, port: str, timeout: str) -> None:
        if not self.can_wait:
            raise self.fault("the program does not define how it waits for an input")
        self.expect_answer(int(port), float(timeout), otherwise=AWAIT)
