"""One listing of a FANUC controller: attributes, numbered lines, and what follows them.

Attributes that controllers add when they list a program again are accepted.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from kerfpath.post._line_reader import LineReader, program_lines
from kerfpath.post.fanuc._external import leads
from kerfpath.post.fanuc._settings import FanucSettings
from kerfpath.robots import Robot

__all__ = ["Listing"]

_ATTRIBUTE = re.compile(
    r"(?:(?:OWNER|COMMENT|PROG_SIZE|CREATE|MODIFIED|FILE_NAME|VERSION|MEMORY_SIZE|PROTECT|"
    r"CONTROL_CODE|LOCAL_REGISTERS)\s*=[^;]*;|"
    r"(?:TCD:)?\s+[A-Z_]+\s*= \d+[,;])"
)
_GROUPS = {
    False: re.compile(r"DEFAULT_GROUP\s*= [1*](?:,\*){4,7};"),
    True: re.compile(r"DEFAULT_GROUP\s*= (?:1,1|\*,\*)(?:,\*){3,6};"),
}
"""The motion groups of a program, by whether group 2 carries the part."""
_COUNT = re.compile(r"LINE_COUNT\s*= (\d+);")
_NUMBERED = re.compile(r" *(\d+):(.*?) *;")
_VIA = re.compile(r" *\d+:C P\[\d+\] *")


class Listing(LineReader):
    """One program: attributes, then numbered lines."""

    settings: FanucSettings
    too_early = "the listing ends too early; /END is missing"

    def __init__(self, file: str, text: str, robot: Robot, settings: FanucSettings) -> None:
        rows = [(n, row.rstrip()) for n, row in enumerate(program_lines(file, text), 1)]
        super().__init__(file, robot, settings, rows)
        self.name = ""

    def body(self, kinds: Mapping[str, re.Pattern[str]]) -> None:
        """Read the attributes and the numbered lines, up to /POS."""
        match = re.fullmatch(r"/PROG  ([A-Z][A-Z0-9_]*)", self.next_row())
        self.name = match[1] if match else ""
        if f"{self.name}.ls" != self.file.rpartition("/")[2]:
            raise self.fault(f"expected /PROG and the name of the file, got {self.text[:60]!r}")
        if (row := self.next_row()) != "/ATTR":
            raise self.fault(f"expected /ATTR, got {row[:60]!r}")
        counted = None
        while (row := self.next_row()) != "/MN":
            if match := _COUNT.fullmatch(row):
                counted = int(match[1])
            elif not _ATTRIBUTE.fullmatch(row) and not _GROUPS[leads(self.robot)].fullmatch(row):
                raise self.fault(f"not an attribute: {row[:60]!r}")
        number = 0
        while (row := self.next_row()) != "/POS":
            number += 1
            if _VIA.fullmatch(row):
                row += self.next_row()
            match = _NUMBERED.fullmatch(row)
            if not match or int(match[1]) != number:
                raise self.fault(f"expected line number {number}, got {self.text[:60]!r}")
            self.read(match[2], kinds)
        if counted != number:
            raise self.fault(f"LINE_COUNT is {counted}, but there are {number} lines")

    def require(self, lines: Sequence[str]) -> None:
        """Require that these lines come next."""
        self.required = [line.removesuffix(" ;").rstrip() for line in lines]

    def end(self) -> None:
        """Read the end of the listing."""
        self.require_complete()
        if self.next_row() != "/END" or any(row for _, row in self.rows[self.line :]):
            raise self.fault(f"expected /END and nothing after it, got {self.text[:60]!r}")

    def require_frames(self, user: str, tool: str) -> None:
        """Refuse frames whose numbers are not those of the settings."""
        expected = [self.settings.user_frame, self.settings.tool_frame]
        if [int(user), int(tool)] != expected:
            raise self.fault(
                f"expected user frame {expected[0]} and tool frame {expected[1]}, got {user} and "
                f"{tool}"
            )
