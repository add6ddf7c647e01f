"""The base of all readers, which read programs line by line, and what no text may contain."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, Literal

from kerfpath.errors import InputError
from kerfpath.post.flow import section_of
from kerfpath.post.harmless import (
    CASELESS,
    LinePattern,
    Where,
    compact,
    harmless_lines,
    without_remark,
)
from kerfpath.post.languages import LanguageSettings, gas_outputs, handshakes
from kerfpath.post.program import (
    Await,
    Gas,
    Handshake,
    Partner,
    Request,
    Signal,
    Switch,
    still_asked,
)
from kerfpath.post.read_program import (
    FlowStep,
    MoveKind,
    ReadEnd,
    ReadHandshake,
    ReadJump,
    ReadLabel,
    ReadMove,
    ReadOff,
    ReadPause,
    ReadPower,
    ReadWait,
)
from kerfpath.robots import Robot
from kerfpath.text import NOT_TEXT, named

# -----------------------------------------------------------------------------
# The base of all readers, which read programs line by line.

SHOWN = 60
"""Characters of a line that a message shows."""
END_OF_FILE = "the end of the file"
"""Text of the row after the last one."""
BLANK = " \t"
"""Blanks of all languages; further ones, as U+00A0, are no blanks for a controller."""


def patterns(by_kind: Mapping[str, str], *, caseless: bool = False) -> dict[str, LinePattern]:
    """Return the patterns of lines by their kind."""
    return {kind: LinePattern(pattern, caseless=caseless) for kind, pattern in by_kind.items()}


def only(by_kind: Mapping[str, LinePattern], *kinds: str) -> dict[str, LinePattern]:
    """Return the patterns of some kinds of lines."""
    return {kind: by_kind[kind] for kind in kinds}


def program_lines(file: str, text: str, first: int = 1) -> list[str]:
    """Return the lines of a program, which end with LF or CR LF as for a controller.

    All readers split their texts here. `str.splitlines` alone also ends a line at characters that
    do not end it for a controller, for which the rest is still part of a remark.

    Parameters
    ----------
    file, text : str
    first : int
        Number of the first line in its file.

    Raises
    ------
    InputError
        The text has a control character or another separator of lines; with line and character.
    """
    if found := NOT_TEXT.search(text):
        line = first + text.count("\n", 0, found.start())
        raise InputError(
            f"{file}, line {line}: a program must not contain the character {named(found[0])}; its "
            "lines end with LF or CR LF"
        )
    return text.splitlines()


def statements(lines: Iterable[str], mark: str, first: int = 1) -> list[tuple[int, str]]:
    """Return the lines that are not empty without their remarks, with their numbers.

    A remark goes from `mark` to the end of its line.
    """
    numbered = ((n, without_remark(line, mark).strip(BLANK)) for n, line in enumerate(lines, first))
    return [(n, line) for n, line in numbered if line]


def numbers_in(text: str) -> list[int]:
    """Return the whole numbers in a text, in order."""
    return [int(digits) for digits in re.findall(r"\d+", text, re.ASCII)]


class LineReader:
    """Reader of one text; a subclass has a method for each kind of line of its language.

    Parameters
    ----------
    file : str
    robot : Robot
        Robot to whose joints the controller's axes are converted.
    settings : LanguageSettings
        Settings of the language.
    rows : sequence of (int, str)
        Numbers and texts of the lines, for readers that `advance` from one to the next.
    """

    settings: Any
    language = ""
    """Name of the language, whose harmless lines are ignored, and case if it is in `CASELESS`."""
    words: Sequence[str] = ()
    """Names and words of the language in the spelling that methods get."""
    too_early = "the text ends too early"
    where: Where = ""
    """Which harmless lines are ignored once the text has begun, see `Harmless`."""

    def __init__(
        self,
        file: str,
        robot: Robot,
        settings: LanguageSettings,
        rows: Sequence[tuple[int, str]] = (),
    ) -> None:
        self.file, self.robot, self.settings = file, robot, settings
        self.begun = False
        """Whether a line that does something has been read."""
        self.rows: list[tuple[int, str]] = []
        for self.line, row in rows:
            if not self.ignores(row):
                self.rows.append((self.line, row))
        self.row = -1
        self.line, self.text = 0, ""
        self.spellings = {word.lower(): word for word in self.words}
        for value in dict(settings).values():
            if isinstance(value, str):
                self.spellings.setdefault(value.lower(), value)
        self.steps: list[FlowStep] = []
        """Steps of the routine that is being read."""
        self.asked_before: Sequence[Handshake] = ()
        """Handshakes that hold where the routine begins."""
        self.loops: list[int] = []
        """Lines at which the loops begin that are being read, the innermost last."""
        self.required: list[str] = []
        """Lines that must come next, exactly."""
        self.flow_lines: Mapping[str, LinePattern] | None = None
        """Patterns of those lines, see `require_next`."""

    # Lines.

    @property
    def place(self) -> str:
        """File and number of the line that is being read."""
        return f"{self.file}, line {self.line}"

    def fault(self, message: str) -> InputError:
        """Return an error with the place of this line."""
        return InputError(f"{self.place}: {message}")

    def advance(self) -> str:
        """Go to the next row and return it; after the last one it is `END_OF_FILE`."""
        self.row += 1
        end = self.rows[-1][0] + 1 if self.rows else 1
        self.line, self.text = (
            self.rows[self.row] if self.row < len(self.rows) else (end, END_OF_FILE)
        )
        return self.text

    def next_row(self) -> str:
        """Go to the next row and return it; raise InputError if there is none."""
        row = self.advance()
        if self.row >= len(self.rows):
            raise self.fault(self.too_early)
        return row

    def take(self, pattern: LinePattern | re.Pattern[str], what: str) -> tuple[str, ...]:
        """Return the groups of this row, which must match, and go to the next one."""
        match = pattern.fullmatch(self.text)
        if match is None:
            raise self.fault(f"expected {what}, got {self.text[:SHOWN]!r}")
        self.advance()
        return match.groups()

    def expect(
        self, lines: Iterable[str], flow_lines: Mapping[str, LinePattern] | None = None
    ) -> None:
        """Pass over lines that must come here, exactly; `flow_lines` is that of `require_next`."""
        for line in lines:
            self.require_line(self.text, line.strip())
            if flow_lines is not None:
                self.follow(self.text, flow_lines)
            self.advance()

    def require_next(
        self, lines: Iterable[str], flow_lines: Mapping[str, LinePattern] | None = None
    ) -> None:
        """Require these lines to come next, exactly.

        If they have a flow of control, `flow_lines` has the patterns of them all by the method here
        that reads them; "" has those that do nothing to it.
        """
        harmless = harmless_lines(self.language)
        self.required = [
            line for line in lines if not (harmless.fullmatch(line) or self.is_remark(line))
        ]
        self.flow_lines = flow_lines

    def ignores(self, row: str) -> bool:
        """Return whether a row does nothing; refuse it if it says a load that is not the job's."""
        where = self.where if self.begun else "head"
        found = harmless_lines(self.language, where).fullmatch(row)
        self.begun = self.begun or found is None
        if found is None:
            return False
        said = found.groupdict()
        if said.get("mass"):
            self.require_load(float(said["mass"]))
        if said.get("schedule") and int(said["schedule"]) != self.settings.payload_schedule:
            raise self.fault(
                f"it is not known what PAYLOAD[{said['schedule']}] holds; name the schedule of the "
                "load on the flange with payload_schedule"
            )
        return True

    def is_remark(self, row: str) -> bool:
        """Return whether a row is a remark that the rows still have; languages override this."""
        return False

    def require_load(self, mass: float) -> None:
        """Refuse a load (kg) above that of the job; without one, above what the robot carries."""
        load = self.robot.dynamics.load
        most = self.robot.payload if load is None else load.mass
        if most is not None and mass > most:
            what = "mass_kg of [tool]" if load else "the robot's payload"
            raise self.fault(f"expected a load up to {most:g} kg, {what}, got {mass:g} kg")

    def plain(self, row: str) -> str:
        """Return a row as it is compared: without needless blanks."""
        return compact(row)

    def same(self, row: str, expected: str) -> bool:
        """Return whether two rows are the same for the controller."""
        if row == expected:
            return True
        one, other = self.plain(row), self.plain(expected)
        if self.language in CASELESS and one.isascii():
            return one.lower() == other.lower()
        return one == other

    def spelled(self, word: str) -> str:
        """Return a name as it was spelled first, if case makes no difference."""
        if self.language not in CASELESS or not word.isidentifier():
            return word
        return self.spellings.setdefault(word.lower(), word)

    def require_line(self, row: str, expected: str) -> None:
        """Refuse a row that is not the expected one."""
        if not self.same(row, expected):
            raise self.fault(f"expected {expected!r}, got {row[:SHOWN]!r}")

    def read(self, row: str, kinds: Mapping[str, LinePattern]) -> None:
        """Read a row with the method of its kind, unless it is a required row."""
        if self.ignores(row) or (self.required and self.is_remark(row)):
            return
        if self.required:
            if "remark" in kinds and self.kind_of(row, kinds)[0] == "remark":
                return
            self.require_line(row, self.required.pop(0))
            if self.flow_lines is not None:
                self.follow(row, self.flow_lines)
            return
        kind, match = self.kind_of(row, kinds)
        if match is None:
            raise self.fault(f"not expected here: {row[:SHOWN]!r}")
        self.admit(kind)
        words = (word and self.spelled(word) for word in match.groups())
        getattr(self, kind)(*words)

    def kind_of(
        self, row: str, kinds: Mapping[str, LinePattern]
    ) -> tuple[str, re.Match[str] | None]:
        """Return the kind of a row and its match: first of rows as they are written here."""
        for kind, pattern in kinds.items():
            if match := pattern.as_written.fullmatch(row):
                return kind, match
        plain = self.plain(row)
        for kind, pattern in kinds.items():
            if match := pattern.compacted.fullmatch(plain):
                return kind, match
        return "", None

    def follow(self, row: str, flow_lines: Mapping[str, LinePattern]) -> None:
        """Add the steps of the flow of control on a required row.

        Raises
        ------
        InputError
            It is not known what the row does to the flow of control.
        """
        kind, match = self.kind_of(row, flow_lines)
        if match is None:
            raise self.fault(f"it is not known where the program goes on after {row[:SHOWN]!r}")
        if kind:
            words = (int(word) if word.isdecimal() else word for word in match.groups())
            getattr(self, kind)(*words)

    def admit(self, kind: str) -> None:
        """Refuse a kind of line that must not come here; each language overrides this."""

    def remark(self) -> None:
        """Pass over a remark."""

    def require_complete(self) -> None:
        """Refuse the end while lines are required."""
        if self.required:
            raise self.fault(f"{self.required[0]!r} is missing")

    # Steps.

    def require_stopped(self, what: str) -> None:
        """Refuse a wait or handshake while the robot moves; each language overrides this."""

    def add(self, step: type[FlowStep], /, **said: Any) -> None:
        """Add a step on this line, by its type and attributes."""
        self.steps.append(step(file=self.file, line=self.line, **said))

    def add_move(self, kind: MoveKind, speed: float | None, **said: Any) -> None:
        """Add the move on this line; `said` are further attributes of `ReadMove`."""
        self.add(ReadMove, kind=kind, speed=speed, **said)

    def wait(self, time: str | float) -> None:
        """Add a wait (s)."""
        self.require_stopped("a wait")
        self.add(ReadWait, time=float(time))

    def ask(self, port: object, *, on: bool) -> None:
        """Add a request through an output that the settings name."""
        self.add_handshake(Request(partner=self.partner(port, "output"), on=on))

    def expect_answer(self, port: object, timeout: float, otherwise: str = "") -> None:
        """Add a wait for an input that the settings name, for at most `timeout` (s).

        Without an answer the program goes on at the label or error exit `otherwise`.
        """
        self.add_handshake(Await(partner=self.partner(port, "input"), timeout=timeout), otherwise)

    def add_handshake(self, what: Handshake, otherwise: str = "") -> None:
        """Add a handshake."""
        self.require_stopped("a handshake")
        self.add(ReadHandshake, what=what, otherwise=otherwise)

    def asked(self) -> list[Handshake]:
        """Return the handshakes that hold here: those before the routine, and its own."""
        own: list[Handshake | None] = []
        for step in section_of("", self.steps).steps:
            if isinstance(step, ReadHandshake):
                own.append(step.what)
            elif isinstance(step, ReadMove) and step.kind == "joint":
                own.append(None)
        return still_asked([*self.asked_before, *own])

    # Flow of control.

    def label(self, name: object) -> None:
        """Add a label, a name or number."""
        self.add(ReadLabel, name=str(name))

    def jump(self, label: object) -> None:
        """Add a jump to a label."""
        self.add(ReadJump, label=str(label))

    def jump_if_on(self, label: object, port: object) -> None:
        """Add a jump to a label that is made only while an input is on."""
        self.add(ReadJump, label=str(label), partner=self.partner(port, "input"))

    def begin_loop(self) -> None:
        """Add the start of a loop."""
        self.loops.append(self.line)
        self.label(f"loop {self.line}")

    def leave_loop_if_on(self, port: object) -> None:
        """Add that the innermost loop is left if an input is on."""
        self.jump_if_on(f"end of loop {self.loops[-1]}", port)

    def end_loop(self) -> None:
        """Add the end of the innermost loop."""
        line = self.loops.pop()
        self.jump(f"loop {line}")
        self.label(f"end of loop {line}")

    def off(self, port: object) -> None:
        """Add that the output of a signal or partner is switched off, whatever it is."""
        names: dict[object, str] = {self.settings.laser_output: "laser"}
        names |= gas_outputs(self.settings)
        name = names.get(port) or self.partner(port, "output")
        self.add(ReadOff, output=name)

    def ask_again(self, port: object) -> None:
        """Add a request that is made again after a pause."""
        self.ask(port, on=True)

    def wait_again(self, port: object) -> None:
        """Add a wait for an input without a limit."""
        self.expect_answer(port, math.inf)

    # Power, by an analogue output.

    def power(self, output: object, value: str) -> None:
        """Add that the power is set while the robot stands."""
        self.require_stopped("a power")
        self.add(ReadPower, share=self.power_share(output, value))

    def follow_speed(self, output: object, per_speed: float, lead_time: float = 0.0) -> None:
        """Add that the controller sets the power: a value of its output for each m/s."""
        self.require_stopped("a power")
        share = self.power_share(output, "0")
        slope = per_speed / float(self.settings.power_full)
        self.add(ReadPower, share=share, per_speed=slope, lead_time=lead_time)

    def power_off(self, output: object) -> None:
        """Add that the power is set to 0, whatever it is."""
        self.require_power_output(output)
        self.add(ReadOff, output="power")

    def power_switch(self, output: object, value: str, lead_time: float = 0.0) -> Switch:
        """Return the switch of the power to a value of its output."""
        share = self.power_share(output, value)
        return Switch(signal="power", on=share > 0, lead_time=lead_time, share=share)

    def power_share(self, output: object, value: str) -> float:
        """Return the share of the full power at a value of its output."""
        self.require_power_output(output)
        full = self.settings.power_full
        if full is None:
            raise self.fault("the power is set; say its value at full power with power_full")
        share = float(value) / float(full)
        if not 0 <= share <= 1 + 1e-9:
            raise self.fault(f"expected a power from 0 to {full:g}, got {value}")
        return share

    def require_power_output(self, output: object) -> None:
        """Refuse an analogue output that is not that of the power."""
        expected = self.settings.power_output
        if expected is None or output != expected:
            named = "no analogue output" if expected is None else f"the output {expected}"
            raise self.fault(f"expected {named} to be set, got {output}")

    def pause(self) -> None:
        """Add a pause, after which the operator may continue."""
        self.add(ReadPause)

    def end_program(self) -> None:
        """Add the end of the program."""
        self.add(ReadEnd, of_program=True)

    def leave_routine(self) -> None:
        """Add the end of the routine."""
        self.add(ReadEnd, of_program=False)

    # Names of inputs and outputs.

    def partner(self, port: object, way: Literal["input", "output"]) -> Partner:
        """Return the partner of an input or output, by the settings."""
        for (partner, its_way), name in handshakes(self.settings).items():
            if its_way == way and name == port:
                return partner
        raise self.fault(f"the settings name no partner with the {way} {port}")

    def signal(self, output: object) -> Signal:
        """Return the signal that an output switches, by the settings."""
        if (gas := gas_outputs(self.settings).get(output)) is not None:
            return gas
        self.require_output(output, self.settings.laser_output)
        return "laser"

    def is_signal(self, output: object) -> bool:
        """Return whether an output is that of the laser or of a gas."""
        return output == self.settings.laser_output or output in gas_outputs(self.settings)

    def gases(self) -> Mapping[Any, Gas]:
        """Return the gases by their outputs as the text names them."""
        return gas_outputs(self.settings)

    def require_output(self, output: object, expected: object) -> None:
        """Refuse an output that is not the expected one."""
        if output != expected:
            raise self.fault(f"expected the output {expected} to be switched, got {output}")

    def add_needing(self, needed: Iterable[object]) -> None:
        """Add that the laser goes on after the last move, if the outputs `needed` are on."""
        last = self.last_on_path()
        if last is None or last.zone != 0:
            raise self.fault("the laser may go on here only after a motion of the path that stops")
        gases = self.gases()
        needs: tuple[Signal | Partner, ...] = ()
        for port in needed:
            needs += (gases.get(port) or self.partner(port, "output"),)
        self.add_switch(last, Switch(signal="laser", on=True, needs=needs), self.place)

    def last_on_path(self) -> ReadMove | None:
        """Return the last step, if it is a move of the path."""
        last = self.steps[-1] if self.steps else None
        return last if isinstance(last, ReadMove) and last.kind != "joint" else None

    def add_switch(self, move: ReadMove, switch: Switch, place: str) -> None:
        """Add a switch from the line `place` to the last step, a move."""
        self.steps[-1] = replace(
            move,
            switches=(*move.switches, switch),
            elsewhere={**move.elsewhere, "switches": place},
        )


# -----------------------------------------------------------------------------
# Check texts of programs, for all languages: no control characters, no absurdly large numbers.

LARGEST = 1e10
"""Largest number of a program, above ABB's 9E+09 for an axis that does not exist."""
NUMBER = re.compile(r"(?<![\w.])[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?", re.ASCII)
LONG = re.compile(r"\d{10,}|[eE]\+?\d", re.ASCII)
"""What the text of such a large number contains."""

REMARK = re.compile(r"\s*(?:\d+:\s*)?(?:!|;|//|'|#) ", re.ASCII)
"""Start of a remark in any of the languages; a remark that gives a frame has no space."""


class CheckedTexts(Mapping[str, str]):
    """Texts by name; a character, line or number that no program has is refused with its line.

    Parameters
    ----------
    files : mapping of str to str
    longest_line : int
        Characters of the longest line.
    """

    def __init__(self, files: Mapping[str, str], longest_line: int) -> None:
        self.files, self.longest_line = files, longest_line

    def __getitem__(self, name: str) -> str:
        text = self.files[name]
        for number, line in enumerate(program_lines(name, text), start=1):
            if len(line) > self.longest_line:
                raise InputError(
                    f"{name}, line {number}: expected at most {self.longest_line} characters, of "
                    f"which a controller reads all, got {len(line)}"
                )
            if not LONG.search(line) or REMARK.match(line):
                continue
            for found in NUMBER.finditer(line):
                if abs(float(found[0])) > LARGEST:
                    raise InputError(
                        f"{name}, line {number}: {found[0]} is larger than any number of a "
                        f"program ({LARGEST:g}); write the program again"
                    )
        return text

    def __iter__(self) -> Iterator[str]:
        return iter(self.files)

    def __len__(self) -> int:
        return len(self.files)
