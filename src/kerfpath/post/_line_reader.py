"""Programs read line by line: what the readers of all languages have in common."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any, Literal

from kerfpath.errors import InputError
from kerfpath.post._program import Await, Handshake, Partner, Request, Signal, Switch
from kerfpath.post._read import MoveKind, ReadHandshake, ReadMove, ReadStep, ReadWait
from kerfpath.post._settings import LanguageSettings, handshakes
from kerfpath.robots import Robot

__all__ = ["END_OF_FILE", "LineReader", "only", "patterns", "statements"]

SHOWN = 60
"""Characters of a line that a message shows."""
END_OF_FILE = "the end of the file"
"""What stands behind the last line."""


def patterns(by_kind: Mapping[str, str]) -> dict[str, re.Pattern[str]]:
    """Return regular expressions of lines by their kind, compiled; digits and letters are ASCII."""
    return {kind: re.compile(pattern, re.ASCII) for kind, pattern in by_kind.items()}


def only(by_kind: Mapping[str, re.Pattern[str]], *kinds: str) -> dict[str, re.Pattern[str]]:
    """Return the regular expressions of some kinds of lines."""
    return {kind: by_kind[kind] for kind in kinds}


def statements(lines: Iterable[str], comment: str, first: int = 1) -> list[tuple[int, str]]:
    """Return the lines that are neither blank nor comments, stripped, with their numbers."""
    numbered = ((number, line.strip()) for number, line in enumerate(lines, first))
    return [(n, line) for n, line in numbered if line and not line.startswith(comment)]


class LineReader:
    """Reads one text; a subclass has the grammar of its language, a method for each kind of line.

    Parameters
    ----------
    file : str
    robot : Robot
        Whose joints the controller's axes are turned into.
    settings : LanguageSettings
        Those of the language.
    rows : sequence of (int, str)
        Numbers and texts of the lines, for readers that `advance` from one to the next.
    """

    settings: Any
    too_early = "the text ends too early"

    def __init__(
        self,
        file: str,
        robot: Robot,
        settings: LanguageSettings,
        rows: Sequence[tuple[int, str]] = (),
    ) -> None:
        self.file, self.robot, self.settings = file, robot, settings
        self.rows, self.row = rows, -1
        self.line, self.text = 0, ""
        self.steps: list[ReadStep] = []
        """Of the routine that is being read."""
        self.required: list[str] = []
        """Lines that have to come next, word for word."""

    # Lines.

    @property
    def place(self) -> str:
        """Where the line stands that is being read."""
        return f"{self.file}, line {self.line}"

    def fault(self, message: str) -> InputError:
        """Return the error that something is wrong on this line."""
        return InputError(f"{self.place}: {message}")

    def advance(self) -> str:
        """Go to the next row and return it; behind the last one stands `END_OF_FILE`."""
        self.row += 1
        end = self.rows[-1][0] + 1 if self.rows else 1
        self.line, self.text = (
            self.rows[self.row] if self.row < len(self.rows) else (end, END_OF_FILE)
        )
        return self.text

    def next_row(self) -> str:
        """Go to the next row and return it, refusing an end before it."""
        row = self.advance()
        if self.row >= len(self.rows):
            raise self.fault(self.too_early)
        return row

    def take(self, pattern: re.Pattern[str], what: str) -> tuple[str, ...]:
        """Return the groups of this row, which must match, and go to the next one."""
        match = pattern.fullmatch(self.text)
        if match is None:
            raise self.fault(f"expected {what}, got {self.text[:SHOWN]!r}")
        self.advance()
        return match.groups()

    def expect(self, lines: Iterable[str]) -> None:
        """Pass over lines that must stand here, word for word."""
        for line in lines:
            self.require_line(self.text, line.strip())
            self.advance()

    def require_line(self, row: str, expected: str) -> None:
        """Refuse a row that is not the expected one."""
        if row != expected:
            raise self.fault(f"expected {expected!r}, got {row[:SHOWN]!r}")

    def read(self, row: str, kinds: Mapping[str, re.Pattern[str]]) -> None:
        """Read a row by the method of its kind, unless it is one that is required here."""
        if self.required:
            self.require_line(row, self.required.pop(0))
            return
        for kind, pattern in kinds.items():
            if match := pattern.fullmatch(row):
                self.admit(kind)
                getattr(self, kind)(*match.groups())
                return
        raise self.fault(f"not expected here: {row[:SHOWN]!r}")

    def admit(self, kind: str) -> None:
        """Refuse a kind of line that must not stand here; a language says which."""

    def remark(self) -> None:
        """Pass over a remark."""

    def require_complete(self) -> None:
        """Refuse an end while lines are required."""
        if self.required:
            raise self.fault(f"{self.required[0]!r} is missing")

    # Steps.

    def require_standing(self, what: str) -> None:
        """Refuse a wait or handshake where the robot moves; a language says when it does."""

    def add_move(self, kind: MoveKind, speed: float | None, **said: Any) -> None:
        """Add a move that stands on this line; `said` is what else `ReadMove` holds."""
        self.steps.append(ReadMove(kind=kind, speed=speed, file=self.file, line=self.line, **said))

    def wait(self, time: str | float) -> None:
        """Add a wait (s)."""
        self.require_standing("a wait")
        self.steps.append(ReadWait(time=float(time), file=self.file, line=self.line))

    def ask(self, port: object, *, on: bool) -> None:
        """Add a request by an output that the settings name."""
        self.add_handshake(Request(partner=self.partner(port, "output"), on=on))

    def expect_answer(self, port: object, timeout: float) -> None:
        """Add a wait for an input that the settings name, for at most `timeout` (s)."""
        self.add_handshake(Await(partner=self.partner(port, "input"), timeout=timeout))

    def add_handshake(self, what: Handshake) -> None:
        """Add a handshake."""
        self.require_standing("a handshake")
        self.steps.append(ReadHandshake(what=what, file=self.file, line=self.line))

    def partner(self, port: object, way: Literal["input", "output"]) -> Partner:
        """Return whose input or output a port is, by the settings."""
        for (partner, its_way), name in handshakes(self.settings).items():
            if its_way == way and name == port:
                return partner
        raise self.fault(f"{port} is the {way} of no partner that the settings name")

    def signal(self, output: object) -> Signal:
        """Return what an output switches, by the settings."""
        if output == self.settings.gas_output:
            return "gas"
        self.require_output(output, self.settings.laser_output)
        return "laser"

    def require_output(self, output: object, expected: object) -> None:
        """Refuse another output than the settings name."""
        if output != expected:
            raise self.fault(f"switches the output {output}; expected {expected}")

    def last_on_path(self) -> ReadMove | None:
        """Return the last step, if it is a move of the path."""
        last = self.steps[-1] if self.steps else None
        return last if isinstance(last, ReadMove) and last.kind != "joint" else None

    def add_switch(self, move: ReadMove, switch: Switch, place: str) -> None:
        """Add a switch, which stands at `place`, to the last step, a move."""
        self.steps[-1] = replace(
            move,
            switches=(*move.switches, switch),
            elsewhere={**move.elsewhere, "switches": place},
        )
