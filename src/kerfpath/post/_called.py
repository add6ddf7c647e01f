"""A main program that calls the others and gives the frames to enter in its remarks."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

from kerfpath._arrays import Array
from kerfpath._names import identifiers
from kerfpath.post._formatter import Formatter, number, plain
from kerfpath.post._frames import Order, controller_frames, euler
from kerfpath.post._program import Program

__all__ = ["CalledFormatter", "off_name"]

OFF = "_OFF"
"""Suffix of the name of the program that switches everything off."""
MOST_REMARKS = 3
"""Largest number of lines of a comment."""
FRAME_DECIMALS = (4, 4, 4, 6, 6, 6)
"""Decimals of mm and deg in remarks that give a frame."""


def off_name(name: str, settings: Any) -> str:
    """Return the name of the program that switches everything off, from that of the main one."""
    return name[: settings.longest_name - len(OFF)] + OFF


class CalledFormatter(Formatter):
    """Formatter of a main program, one for each section and one that switches off, in capitals."""

    remark_width: int
    """Largest number of characters of a remark."""
    angles: Order
    frame_words: tuple[str, ...]
    """Names of the three lengths and three angles of a frame."""
    frame_line: str
    """Format of the remark that gives one of them: frame, name, value."""

    def __init__(self, program: Program, settings: Any) -> None:
        longest = settings.longest_name
        (name,) = identifiers([program.name], (), longest)
        taken = (name, off_name(name, settings))
        names = identifiers((section.name for section in program.sections), taken, longest)
        sections = tuple(
            replace(section, name=own.upper())
            for section, own in zip(program.sections, names, strict=True)
        )
        super().__init__(replace(program, name=name.upper(), sections=sections), settings)
        self.off_name = off_name(self.program.name, settings)

    def names(self) -> list[tuple[str, str]]:
        """Return the names of all programs."""
        sections = ((section.name, "a contour") for section in self.program.sections)
        off = (self.off_name, "the program that switches off")
        return [(self.program.name, "the program"), off, *sections]

    def heading(self, *about: str, frame: str, tool: str) -> Iterator[str]:
        """Yield the remarks of the main program: what is proved, `about`, and the two frames."""
        program = self.program
        clear = "proved clear in the planned cell"
        checked = clear if program.air_checked else "not checked for collisions"
        for_robot = f"kerfpath, for {plain(program.robot.model)}"
        moves = f"Transfer moves: {checked}."
        for remark in (for_robot, moves, *program.caveats, *about):
            yield from self.comment(remark)
        for name, T in zip((frame, tool), controller_frames(program), strict=True):
            yield from self._frame(name, T)

    def _frame(self, name: str, T: Array) -> Iterator[str]:
        """Yield a frame as remarks, to be entered at the controller and read back."""
        values = euler(T, self.angles)[0]
        for word, value, decimals in zip(self.frame_words, values, FRAME_DECIMALS, strict=True):
            yield self.frame_line % (name, word, number(value, decimals))

    def wrap(self, text: str) -> list[str]:
        """Return a comment as remarks, cut where there would be too many."""
        return textwrap.wrap(text, self.remark_width, max_lines=MOST_REMARKS, placeholder=" ...")
