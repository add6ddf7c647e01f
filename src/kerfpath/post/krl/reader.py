"""Read back the KRL that `Krl` writes; anything else is refused."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import PurePosixPath

import numpy as np

from kerfpath.arrays import Array, freeze
from kerfpath.errors import InputError
from kerfpath.post.arcs import from_euler
from kerfpath.post.build import carrier_frame
from kerfpath.post.flow import section_of
from kerfpath.post.harmless import LinePattern
from kerfpath.post.krl.controller import AXES, KrlSettings, coupled, joints_from_axes, read_fields
from kerfpath.post.krl.writer import (
    ANGLES,
    FIRST,
    HEAD,
    PASSED,
    POWER,
    SWITCH_OFF,
    TIMER,
    data_list,
    opening_lines,
    switch_off_lines,
    wait_lines,
)
from kerfpath.post.line_reader import (
    LineReader,
    numbers_in,
    only,
    patterns,
    program_lines,
    statements,
)
from kerfpath.post.program import Await, Switch
from kerfpath.post.read_program import FlowStep, MoveKind, ReadMove, ReadProgram, ReadSection
from kerfpath.robots import Robot

_NAME = r"([A-Za-z]\w*)"
_NUMBER = r"(-?(?:\d+\.?\d*|\.\d+))"
_POINT = ",".join(f"{field} {_NUMBER}" for field in "XYZABC")
_EXTERNAL = r"((?:,E\d -?(?:\d+\.?\d*|\.\d+))*)"
_MACHINE = r"MACHINE_DEF\[(\d+)\]"
_LINES = patterns(
    {
        "linear": rf"LIN {{{_POINT},S (\d+),T (\d+){_EXTERNAL}}}( C_DIS)?",
        "circular": rf"CIRC {{{_POINT}}},{{{_POINT},S (\d+),T (\d+){_EXTERNAL}}}( C_DIS)?",
        "joint": rf"PTP {{{','.join(f'{axis} {_NUMBER}' for axis in AXES)}{_EXTERNAL}}}",
        "speed": rf"\$VEL\.CP={_NUMBER}",
        "zone": rf"\$APO\.CDIS={_NUMBER}",
        "share": r"BAS\(#VEL_PTP,(\d+)\)",
        "trigger": r"TRIGGER WHEN PATH=0 DELAY=(-?\d+) DO \$OUT\[(\d+)\]=(TRUE|FALSE)",
        "power_trigger": r"TRIGGER WHEN PATH=0 DELAY=(-?\d+) DO \$ANOUT\[(\d+)\]=(\d+\.?\d*)",
        "signal_of_power": rf"SIGNAL {POWER} \$ANOUT\[(\d+)\]",
        "anout_on": rf"ANOUT ON {POWER}=(\d+\.?\d*)\*\$VEL_ACT DELAY=-(\d+\.?\d*)",
        "anout_off": rf"ANOUT OFF {POWER}",
        "set_power": r"\$ANOUT\[(\d+)\]=(\d+\.?\d*)",
        "wait": rf"WAIT SEC {_NUMBER}",
        "condition": rf"IF ({FIRST}|{PASSED})<=(\d+) THEN",
        "call": rf"{_NAME}\((|{FIRST})\)",
        "end_condition": "ENDIF",
        "again": rf"{FIRST}=1",
        "request": r"\$OUT\[(\d+)\]=(TRUE|FALSE)",
        "guarded": r"\$OUT\[(\d+)\]=(\$OUT\[\d+\](?: AND \$OUT\[\d+\])*)",
        "wait_for": r"\$TIMER\[\d+\]=-(\d+)",
        "timer": r"\$TIMER(?:\[(\d+)\]=0|_STOP\[(\d+)\]=(?:TRUE|FALSE))",
        "end": "END",
        "routine": rf"DEF {_NAME}\((|{PASSED} :IN)\)",
        "tool": rf"\$TOOL={{{_POINT}}}",
        "base": rf"\$BASE={{{_POINT}}}",
        "coupled_base": rf"\$BASE=EK\({_MACHINE}\.ROOT,{_MACHINE}\.MECH_TYPE,{{{_POINT}}}\)",
    },
    caseless=True,
)

_OUTSIDE = only(_LINES, "routine")
_IN_FIRST = only(_LINES, "condition", "call", "end_condition", "timer", "end")
_IN_MAIN = only(_LINES, "tool", "base", "coupled_base", "again") | _IN_FIRST
_IN_ROUTINE = only(
    _LINES,
    "linear", "speed", "zone", "trigger", "power_trigger", "circular", "joint", "share", "wait",
    "set_power", "signal_of_power", "anout_on", "anout_off", "request",
    "guarded", "wait_for", "timer", "end",
)  # fmt: skip
_WITHOUT_ANSWER = patterns(
    {
        "": r"\$TIMER_STOP\[\d+\]=(?:TRUE|FALSE)|WAIT FOR \$IN\[\d+\] OR \$TIMER_FLAG\[\d+\]",
        "while_off": r"WHILE NOT \$IN\[(\d+)\]",
        "off": r"\$OUT\[(\d+)\]=FALSE",
        "power_off": r"\$ANOUT\[(\d+)\]=0",
        "pause": "HALT",
        "ask_again": r"\$OUT\[(\d+)\]=TRUE",
        "wait_again": r"WAIT FOR \$IN\[(\d+)\]",
        "end_loop": "ENDWHILE",
    },
    caseless=True,
)
_FIRST = LinePattern(rf"INT {FIRST}=(\d+)", caseless=True)


def read(main: str, files: Mapping[str, str], robot: Robot, settings: KrlSettings) -> ReadProgram:
    """Return the program in .src and .dat files that `Krl` wrote; see `kerfpath.post.Reader`."""
    first = _File(main, files, robot, settings, opening_lines(settings))
    begin = first.require_data([name for name in first.calls if name not in first.contours])
    sections: list[ReadSection] = []
    for name, number in first.calls.items():
        if name in first.contours:
            sections.append(section_of(name, first.contours[name]))
        else:
            own = _File(f"{name}.src", files, robot, settings, [], before=len(sections))
            own.require_data([])
            sections += [section_of(n, own.contours[n]) for n in own.calls]
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


class _Data(LineReader):
    """One .dat."""

    language = "krl"
    where = "data"


class _File(LineReader):
    """One .src; the main file is the one with an opening."""

    settings: KrlSettings
    language = "krl"
    words = ("TRUE", "FALSE", FIRST, PASSED, SWITCH_OFF)

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
        lines = program_lines(file, files[file])
        super().__init__(file, robot, settings, statements(lines, ";"))
        self.files, self.name = files, PurePosixPath(file).stem
        self.is_main, self.opening = bool(opening), opening
        self.routines: list[str] = []
        self.inside = False
        self.calls: dict[str, int] = {}
        self.before, self.condition_open, self.number = before, False, 0
        self.begins_again = False
        self.contours: dict[str, list[FlowStep]] = {}
        self.frames: dict[str, Array] = {}
        self.held: dict[str, float] = {}
        self.held_at: dict[str, str] = {}
        self.switches: tuple[Switch, ...] = ()
        self.follows = self.power_named = False
        for _ in self.rows:
            self.read_line(self.advance())
        self.line = len(lines) + 1
        if self.inside or self.required or not self.routines:
            raise self.fault("END is missing")

    def read_line(self, line: str) -> None:
        if self.inside and not self.required and self.opening and self.same(line, self.opening[0]):
            del self.opening[0]
            return
        self.read(line, self.expected())

    def expected(self) -> dict[str, LinePattern]:
        if not self.inside:
            return _OUTSIDE
        if len(self.routines) > 1:
            return _IN_ROUTINE
        return _IN_MAIN if self.is_main else _IN_FIRST

    def admit(self, kind: str) -> None:
        if self.switches and kind not in {"linear", "circular", "trigger", "power_trigger"}:
            raise self.fault("a trigger must come right before its motion")

    def require_data(self, others: list[str]) -> int:
        """Check that all routines are called and that the .dat declares exactly the other files.

        Return the contour at which the program begins, if this is the main file.
        """
        self.line = 1
        if unknown := set(self.calls) ^ {*self.contours, *others}:
            raise self.fault(f"calls and routines do not match: {', '.join(sorted(unknown))}")
        if self.is_main and SWITCH_OFF not in self.routines:
            raise self.fault(f"{SWITCH_OFF} is missing")
        data = f"{self.name}.dat"
        rows = statements(program_lines(data, self.files[data]), ";")
        lists = _Data(data, self.robot, self.settings, rows)
        first = next((m[1] for _, row in lists.rows if (m := _FIRST.fullmatch(row))), "0")
        begin = int(first) if self.is_main else None
        lists.advance()
        lists.expect(row for row in data_list(self.name, others, begin) if row not in (*HEAD, ""))
        if lists.row < len(lists.rows):
            raise lists.fault("nothing may follow ENDDAT")
        return int(first)

    def routine(self, name: str, passed: str) -> None:
        if not self.routines and name.lower() != self.name.lower():
            raise self.fault(f"the first routine must have the name of the file, {self.name}")
        if name in self.routines:
            raise self.fault(f"{name} is defined twice")
        if bool(passed) != (not self.is_main and not self.routines):
            raise self.fault("only the first routine of a file that is called takes a number")
        self.routines.append(name)
        if name == SWITCH_OFF:
            self.require_next([*switch_off_lines(self.settings), "END"])
            return
        if len(self.routines) > 1:
            self.steps = self.contours[name] = []
        elif passed:
            self.require_next([f"INT {PASSED}"])
        self.inside, self.held = True, {}
        self.follows = self.power_named = False

    def end(self) -> None:
        self.require_opening()
        if self.follows:
            raise self.fault(f"expected ANOUT OFF {POWER} before this line")
        if self.condition_open:
            raise self.fault("ENDIF is missing")
        if self.is_main and len(self.routines) == 1 and not self.begins_again:
            raise self.fault(f"expected {FIRST}=1 before this line")
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
            raise self.fault("each call must have its own condition")
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
        self.ask(int(output), on=state == "TRUE")

    def guarded(self, output: str, needed: str) -> None:
        self.require_output(int(output), self.settings.laser_output)
        self.add_needing(numbers_in(needed))

    def wait_for(self, timeout_ms: str) -> None:
        here, (_, below) = self.text, (*self.rows[self.row + 2 : self.row + 3], (0, ""))[0]
        said = LinePattern(r"WAIT FOR \$IN\[(\d+)\].*", caseless=True).fullmatch(below)
        if said is None:
            raise self.fault("expected the wait for an input two lines below")
        port, timeout = int(said[1]), float(timeout_ms) * 1e-3
        awaited = Await(partner=self.partner(port, "input"), timeout=timeout)
        first, *others = wait_lines(awaited, self.asked(), self.settings)
        self.require_line(here, first)
        self.add_handshake(awaited)
        self.require_next(others, _WITHOUT_ANSWER)

    def timer(self, reset: str | None, stopped: str | None) -> None:
        """Pass over a timer that nothing waits for; its use stops the advance run."""
        if int(reset or stopped or 0) == TIMER:
            raise self.fault(f"timer {TIMER} is that of the waits for inputs; use another")
        moves = [step for step in self.steps if isinstance(step, ReadMove)]
        if self.switches or (moves and moves[-1].zone):
            raise self.fault("a timer stops the robot in the cut; use it where the robot stands")

    def while_off(self, port: int) -> None:
        self.begin_loop()
        self.leave_loop_if_on(port)

    def require_opening(self) -> None:
        if self.opening:
            raise self.fault(f"expected {self.opening[0]} before this line")
        numbers = {"tool": self.settings.tool_number, "base": self.settings.base_number}
        for kind, n in numbers.items():
            if self.is_main and n is None and kind not in self.frames:
                raise self.fault(f"expected ${kind.upper()} before this line")

    def tool(self, *point: str) -> None:
        self.frame("tool", self.settings.tool_number, point)

    def base(self, *point: str) -> None:
        if coupled(self.robot):
            raise self.fault("expected a base that moves with the part, $BASE=EK(...)")
        self.frame("base", self.settings.base_number, point)

    def coupled_base(self, root: str, kind: str, *point: str) -> None:
        if not coupled(self.robot) or {int(root), int(kind)} != {self.settings.machine_number}:
            expected = f"MACHINE_DEF[{self.settings.machine_number}]"
            raise self.fault(f"expected a base that moves with {expected}, or a fixed one")
        self.frame("base", self.settings.base_number, point)
        frame = carrier_frame(self.robot, self.settings.positioner_frame)
        self.frames["base"] = freeze(np.asarray(frame @ self.frames["base"]))

    def frame(self, kind: str, numbered: int | None, point: Sequence[str]) -> None:
        if self.opening:  # its BAS(#INITMOV,0) would replace the frame
            raise self.fault(f"expected {self.opening[0]} before this line")
        if numbered is not None or kind in self.frames:
            raise self.fault(f"expected no {kind} here: it is given before, or by its number")
        self.frames[kind] = self.pose(point)

    def share(self, percent: str) -> None:
        self.hold("share", int(percent) / 100)

    def speed(self, speed_m_s: str) -> None:
        self.hold("speed", float(speed_m_s))

    def zone(self, radius_mm: str) -> None:
        self.hold("zone", float(radius_mm) * 1e-3)

    def hold(self, what: str, value: float) -> None:
        self.held[what], self.held_at[what] = value, self.place

    def trigger(self, delay_ms: str, output: str, state: str) -> None:
        lead = self.lead_of(delay_ms)
        switch = Switch(signal=self.signal(int(output)), on=state == "TRUE", lead_time=lead)
        self.switches += (switch,)

    def power_trigger(self, delay_ms: str, output: str, value: str) -> None:
        self.switches += (self.power_switch(int(output), value, self.lead_of(delay_ms)),)

    def set_power(self, output: str, value: str) -> None:
        if self.follows:
            raise self.fault(f"expected ANOUT OFF {POWER} before this line")
        self.power(int(output), value)

    def signal_of_power(self, output: str) -> None:
        if self.steps or self.power_named:
            raise self.fault("a signal must be declared once, at the start of a routine")
        self.require_power_output(int(output))
        self.power_named = True

    def anout_on(self, per_speed: str, lead_time: str) -> None:
        if self.follows or not self.power_named:
            raise self.fault(f"expected SIGNAL {POWER} at the start, and one ANOUT ON at a time")
        self.follow_speed(self.settings.power_output, float(per_speed), float(lead_time))
        self.follows = True

    def anout_off(self) -> None:
        if not self.follows:
            raise self.fault(f"expected ANOUT ON {POWER} before this line")
        self.follows = False

    def lead_of(self, delay_ms: str) -> float:
        """Return the lead time (s) of a trigger."""
        if int(delay_ms) > 0:
            raise self.fault("a trigger must not have a positive DELAY")
        self.held_at.setdefault("switches", self.place)
        return -int(delay_ms) * 1e-3

    def joint(self, *fields: str) -> None:
        if self.follows:
            raise self.fault(f"expected ANOUT OFF {POWER} before this line")
        *axes_deg, external = fields
        axes = np.radians([[float(axis) for axis in axes_deg]])
        speed = self.holds("share", "BAS(#VEL_PTP,...)")
        q = np.append(joints_from_axes(self.robot, axes)[0], self.external(external))
        self.add_move("joint", speed, q=q, elsewhere={"speed": self.held_at["share"]})

    def linear(self, *fields: str | None) -> None:
        self.path("linear", fields)

    def circular(self, *fields: str | None) -> None:
        self.path("circular", fields[6:], self.pose(fields[:6]))

    def path(
        self, kind: MoveKind, fields: Sequence[str | None], T_part_via: Array | None = None
    ) -> None:
        *point, status, turn, said, blended = fields
        external = self.external(str(said))
        self.add_move(
            kind,
            self.holds("speed", "$VEL.CP"),
            T_part_tip=self.pose(point),
            T_part_via=T_part_via,
            external=external if len(external) else None,
            posture=(int(str(status)), int(str(turn))),
            zone=self.holds("zone", "$APO.CDIS") if blended else 0.0,
            switches=self.switches,
            elsewhere=self.elsewhere("speed", *(["zone"] if blended else []), "switches"),
        )
        self.switches = ()
        self.held_at.pop("switches", None)

    def external(self, text: str) -> Array:
        """Return the values (E,) m and rad of the external axes of a target."""
        try:
            return freeze(read_fields(self.robot, text, self.settings))
        except InputError as error:
            raise self.fault(str(error)) from None

    def pose(self, fields: Sequence[str | None]) -> Array:
        """Return the pose (4, 4) m of X, Y, Z in mm and A, B, C in deg."""
        return freeze(from_euler([float(str(field)) for field in fields], ANGLES)[0])

    def elsewhere(self, *whats: str) -> dict[str, str]:
        """Return file and line where the values that hold for a motion were set."""
        return {what: self.held_at[what] for what in whats if what in self.held_at}

    def holds(self, what: str, word: str) -> float:
        if what not in self.held:
            raise self.fault(f"{word} has not been set in this routine")
        return self.held[what]
