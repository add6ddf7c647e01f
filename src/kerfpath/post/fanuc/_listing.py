"""One listing of a FANUC controller: attributes, numbered lines, and what follows them.

Attributes that controllers add when they list a program again are let pass.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from kerfpath.errors import InputError
from kerfpath.post._program import Signal
from kerfpath.post._read import same_output
from kerfpath.post.fanuc._settings import FanucSettings
from kerfpath.robots import Robot

__all__ = ["Listing"]

_ATTRIBUTE = re.compile(
    r"(?:(?:OWNER|COMMENT|PROG_SIZE|CREATE|MODIFIED|FILE_NAME|VERSION|MEMORY_SIZE|PROTECT|"
    r"CONTROL_CODE|LOCAL_REGISTERS)\s*=[^;]*;|DEFAULT_GROUP\s*= [1*](?:,\*){4,7};|"
    r"(?:TCD:)?\s+[A-Z_]+\s*= \d+[,;])"
)
_COUNT = re.compile(r"LINE_COUNT\s*= (\d+);")
_NUMBERED = re.compile(r" *(\d+):(.*?) *;")
_VIA = re.compile(r" *\d+:C P\[\d+\] *")


class Listing:
    """One program: attributes, then numbered lines, each read by the method of its kind."""

    def __init__(self, file: str, text: str, robot: Robot, settings: FanucSettings) -> None:
        self.file, self.robot, self.settings = file, robot, settings
        self.rows = [row.rstrip() for row in text.splitlines()]
        self.line = 0
        self.name = ""
        self.must_say: list[str] = []

    def take(self) -> str:
        """Return the next row."""
        self.line += 1
        if self.line > len(self.rows):
            raise self.fault("the listing ends too early; /END is missing")
        return self.rows[self.line - 1]

    def body(self, kinds: Mapping[str, re.Pattern[str]]) -> None:
        """Read the attributes and the numbered lines, up to /POS."""
        match = re.fullmatch(r"/PROG  ([A-Z][A-Z0-9_]*)", self.take())
        self.name = match[1] if match else ""
        if f"{self.name}.ls" != self.file.rpartition("/")[2]:
            raise self.fault(f"expected /PROG and the name of the file, got {self.shown()}")
        if self.take() != "/ATTR":
            raise self.fault(f"expected /ATTR, got {self.shown()}")
        counted = None
        while (row := self.take()) != "/MN":
            if match := _COUNT.fullmatch(row):
                counted = int(match[1])
            elif not _ATTRIBUTE.fullmatch(row):
                raise self.fault(f"not an attribute: {self.shown()}")
        number = 0
        while (row := self.take()) != "/POS":
            number += 1
            if _VIA.fullmatch(row):
                row += self.take()
            match = _NUMBERED.fullmatch(row)
            if not match or int(match[1]) != number:
                raise self.fault(f"expected line number {number}, got {self.shown()}")
            if self.must_say:
                if match[2] != self.must_say[0]:
                    raise self.fault(f"expected {self.must_say[0]!r}, got {self.shown()}")
                del self.must_say[0]
                continue
            for kind, pattern in kinds.items():
                if said := pattern.fullmatch(match[2]):
                    getattr(self, kind)(*said.groups())
                    break
            else:
                raise self.fault(f"not expected here: {self.shown()}")
        if counted != number:
            raise self.fault(f"LINE_COUNT is {counted}, but there are {number} lines")

    def say(self, lines: Sequence[str]) -> None:
        """Require that these lines come next."""
        self.must_say = [line.removesuffix(" ;").rstrip() for line in lines]

    def end(self) -> None:
        """Read the end."""
        if self.must_say:
            raise self.fault(f"{self.must_say[0]!r} is missing")
        if self.take() != "/END" or any(self.rows[self.line :]):
            raise self.fault(f"expected /END and nothing after it, got {self.shown()}")

    def remark(self) -> None:
        """Keep nothing."""

    def signal(self, output: str) -> Signal:
        if int(output) == self.settings.gas_output:
            return "gas"
        expected = f"DO[{self.settings.laser_output}]"
        same_output(f"DO[{output}]", expected, f"{self.file}, line {self.line}")
        return "laser"

    def frames(self, user: str, tool: str) -> None:
        """Refuse frames of other numbers than those of the settings."""
        expected = [self.settings.user_frame, self.settings.tool_frame]
        if [int(user), int(tool)] != expected:
            raise self.fault(
                f"user frame {user} and tool frame {tool}, expected {expected[0]} and {expected[1]}"
            )

    def shown(self) -> str:
        return repr(self.rows[self.line - 1][:60])

    def fault(self, message: str) -> InputError:
        return InputError(f"{self.place}: {message}")

    @property
    def place(self) -> str:
        return f"{self.file}, line {self.line}"
