"""Read programs of machines with the tool axis as a vector: Siemens, ISO, Heidenhain."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from kerfpath.arrays import Array
from kerfpath.cad.klartext import is_klartext, klartext_path
from kerfpath.cad.machine import GIVE_MACHINE, Machine
from kerfpath.cad.part import Part
from kerfpath.cad.toolpath import (
    UNKNOWN,
    Arc,
    Tip,
    ToolPath,
    Triple,
    centre_by_radius,
    finite,
    lines_of,
    part_of_tool_path,
    unit_axis,
)
from kerfpath.errors import InputError
from kerfpath.text import upper

NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)"
WORD = re.compile(
    rf"\s*(?:(?P<named>CR|[A-Z]\d*)\s*=\s*"
    rf"(?:(?P<way>[AD]C)\s*\(\s*(?P<there>{NUMBER})\s*\)|(?P<value>{NUMBER}))?"
    rf"|(?P<keyword>[A-Z_][A-Z_][A-Z0-9_]*)\s*(?P<arguments>\([^)]*\))?"
    rf"|(?P<letter>[A-Z])\s*(?P<number>{NUMBER})"
    rf"|(?P<comment>\([^)]*\)))",
    re.ASCII,
)
TEXT = re.compile(r'MSG\s*\(.*\)|T\s*=\s*"[^"]*"')
"""Words with text: a message, the name of a tool."""
HEADER = re.compile(r"%|[O:]\d+\s*$|\$PATH", re.ASCII)
AXIS, CENTRE = ("A3", "B3", "C3"), ("I", "J", "K")
PLANES = {17: 2, 18: 1, 19: 0}
"""The axis that arcs turn about, by their plane."""
UNITS = {20: "in", 21: "mm", 70: "in", 71: "mm", 700: "in", 710: "mm"}
OFFSETS = (54, 55, 56, 57, 58, 59, 500, *range(505, 600))
HARMLESS_G = (
    *(9, 40, 43, 60, 61, 62, 64, 80, 90, 91.1, 93, 94, 95, 96, 97),
    *(601, 602, 603, 641, 642, 643, 644, 645),
)
REFUSED_G: dict[float, str] = {
    **dict.fromkeys((5, 6), "a curve; have the CAM system write linear moves only"),
    **dict.fromkeys((41, 42), "the controller would offset the path; write the path of the tip"),
    90.1: "absolute centres of arcs; write them from the start of each arc, under G91.1",
    91: "increments; write absolute positions, under G90",
}
AWAY = ("G28", "G30", "G74", "G75")
MACHINE = ("G53", "G153", "SUPA")
HARMLESS = (
    *("BRISK", "COMPCAD", "COMPCURV", "COMPOF", "COMPON", "COMPSURF", "CYCLE832", "FFWOF"),
    *("FFWON", "FIFOCTRL", "FNORM", "ORIAXES", "ORIC", "ORIPLANE", "ORIVECT", "ORIWKS", "SOFT"),
    *("STOPRE", "UPATH", "WORKPIECE"),
)
REFUSED = {
    **dict.fromkeys(("AROT", "ASCALE", "ATRANS", "MIRROR", "ROT", "SCALE", "TRANS", "CYCLE800"),
                    "it moves the points that follow; write them in the coordinates of the part"),
    **dict.fromkeys(("BSPLINE", "CIP", "CSPLINE", "CT", "POLY", "ASPLINE"),
                    "a curve; have the CAM system write linear moves only"),
    "ORIMKS": "tool axes in the machine, not in the part; write ORIWKS",
}  # fmt: skip
ENDS = (2, 17, 30)
TOOL_CHANGE = 6
PER_MINUTE = 94
OTHER_FEEDS: dict[float, str] = {
    93: "an inverse time (G93)",
    95: "a length per revolution (G95)",
    96: "a length per revolution (G96)",
    97: "a length per revolution (G97)",
}
"""What F is under other words than G94; it is no speed of the tip then."""
INCH_PLACES, IN_BASIC_UNIT = 70, "mm or inches as the control is set (G70; G700 says inches)"
"""A word by which positions are in inches, and the unit that F has then."""
CALLS = (98, 99)
UNUSED = "DHMST"
ROTARY = "ABC"
ORIENTATION = re.compile("[ABC][0-9]+")
BY_VECTOR = {"ORIVECT": True, "ORIPLANE": True, "ORIAXES": False}
"""Whether the tool axis turns evenly from block to block, or the rotary axes do."""


def read_nc(
    path: Path, content: bytes, unit: str | None, gap: float, axis: Array | None = None,
    machine: Machine | None = None,
) -> Part:  # fmt: skip
    """Return the cuts of a program for a machine, one per run of feed moves.

    Raises
    ------
    InputError
        A word that is not known, that changes the path, or that needs a machine that is not given
        (its line is named), no unit, no tool axis, no cut.
    """
    if axis is not None and machine is not None:
        raise InputError("axis or machine: expected one of them, as a machine has its tool axis")
    lines = lines_of(content)
    path_of = klartext_path if is_klartext(lines) else _siemens_path
    return part_of_tool_path(path, path_of(lines, machine), unit, gap, axis, machine)


def _siemens_path(lines: Sequence[str], machine: Machine | None) -> ToolPath:
    program = _Program(machine)
    for number, line in enumerate(lines, start=1):
        text = TEXT.sub("", upper(line)).partition(";")[0].strip(" \t")
        if not text or HEADER.match(text):
            continue
        if text.startswith("/"):
            raise InputError(f"line {number}: a block that the machine may skip (/)")
        block = _Block(number)
        for name, value, shorter in _words(number, text):
            block.add(name, value, shorter)
        program.take(block)
    return ToolPath(
        moves=program.tip.moves,
        unit=program.unit,
        notes=[*program.tip.notes, *program.notes],
        unused=program.unused,
    )


def _words(line: int, text: str) -> Iterator[tuple[str, str, bool]]:
    """Yield the words of a block: an address and its number, or a keyword and its arguments.

    The last value says whether a rotary axis goes there the shorter way round (`DC`).
    """
    place = 0
    while place < len(text):
        found = WORD.match(text, place)
        if found is None:
            raise InputError(
                f"line {line}: expected words such as X1.5 or A3=0.5, got {text[place:][:30]!r}"
            )
        place = found.end()
        if name := found["named"]:
            value, shorter = found["there"] or found["value"], found["way"] == "DC"
            if value is None or text[place : place + 1] in tuple("*/+-(.["):
                raise InputError(
                    f"line {line}: {name}=: expected a number, or AC( ) or DC( ) of it"
                )
            if shorter and name not in ROTARY:
                raise InputError(f"line {line}: {name}=DC( ): expected a rotary axis, A, B or C")
            yield name, value, shorter
        elif found["keyword"]:
            yield found["keyword"], found["arguments"] or "", False
        elif found["letter"]:
            yield found["letter"], found["number"], False


class _Block:
    """The words of one block."""

    def __init__(self, line: int) -> None:
        self.line = line
        self.where = f"line {line}"
        self.g: list[float] = []
        self.m: list[float] = []
        self.words: dict[str, float] = {}
        self.keywords: dict[str, str] = {}
        self.shorter: set[str] = set()

    def add(self, name: str, value: str, shorter: bool) -> None:
        """Take one word; a rotary axis may go there the shorter way round.

        Raises
        ------
        InputError
            A repeated word.
        """
        if len(name) > 1 and not name[1:].isdigit() and name != "CR":
            self.keywords[name] = value
        elif name in "GM":
            (self.g if name == "G" else self.m).append(finite(value, f"{self.where}: {name}"))
        elif name in self.words:
            raise InputError(f"{self.where}: {name} twice in one block")
        else:
            self.words[name] = finite(value, f"{self.where}: {name}")
            self.shorter |= {name} if shorter else set()


class _Program:
    """The state of the program, which the next block is read with."""

    def __init__(self, machine: Machine | None) -> None:
        self.tip = Tip(machine)
        self.unit = ""
        self.unused: set[str] = set()
        self._motion: int | None = None
        self._plane = PLANES[17]
        self._is_oriented = False
        self._by_ijk = False
        self._offset = 0.0
        self._end = 0
        self._feed: float | None = None
        self._feed_kind = ""
        self._is_basic = False
        self.notes: list[str] = []

    def take(self, block: _Block) -> None:
        """Take one block.

        Raises
        ------
        InputError
            A word that is not known, or that changes the path.
        """
        line, where, words = block.line, block.where, block.words
        if self._end:
            raise InputError(f"{where}: a block after the end of the program in line {self._end}")
        away = self._keywords(block)
        for g in block.g:
            away |= self._g(block, g)
        place = {name: words.pop(name) for name in "XYZ" if name in words}
        arc = self._arc(block, place) if self._motion in (2, 3) else None
        names = CENTRE if self._by_ijk else AXIS
        vector = [words.pop(name, 0.0) if name in words else None for name in names]
        angles = {name: words.pop(name) for name in ROTARY if name in words}
        angles |= {name: self.tip.nearest(name, angles[name]) for name in block.shorter}
        words.pop("N", None)
        if angles and self.tip.machine is None:
            raise InputError(f"{where}: {next(iter(angles))}: a rotary axis; {GIVE_MACHINE}")
        if 4 in block.g or 64 in block.g:
            words.pop("P", None)  # a time, or a tolerance
        if 4 in block.g:
            words.pop("F", None)  # a time
        self._take_feed(block)
        if unknown := [name for name in words if name.rstrip("0123456789") not in UNUSED]:
            raise InputError(f"{where}: {_word_refusal(unknown[0])}")
        self.unused |= {name.rstrip("0123456789") for name in words} | ({"M"} if block.m else set())
        if called := [m for m in block.m if m in CALLS]:
            raise InputError(f"{where}: M{called[0]:g}: a program that is called is not read")
        if 4 in block.g and (place or angles):
            raise InputError(f"{where}: G4 with X, Y or Z: expected G4 F")
        if away and (place or angles or not any(word in MACHINE for word in block.keywords)):
            self._away(block, angles)
        elif place or angles or arc is not None or any(value is not None for value in vector):
            self._move(block, place, vector, arc, angles)
        if TOOL_CHANGE in block.m:
            self.tip.forget(line)
        if any(m in ENDS for m in block.m):
            self._end = line

    def _take_feed(self, block: _Block) -> None:
        """Take what F is, and F itself, in the unit of the file per minute."""
        kind = self._feed_kind
        for g in block.g:
            kind = OTHER_FEEDS.get(g, kind)
        if PER_MINUTE in block.g:
            kind = ""
        if kind != self._feed_kind:
            self._feed_kind, self._feed = kind, None
        if (feed := block.words.pop("F", None)) is None:
            return
        other = self._feed_kind or (IN_BASIC_UNIT if self._is_basic else "")
        self._feed = feed if feed > 0 and not other else None
        if other and not self.notes:
            self.notes.append(f"{block.where}: F is no speed of the tip, but {other}")

    def _keywords(self, block: _Block) -> bool:
        """Take the keywords; return whether the positions are in machine coordinates."""
        for keyword, arguments in block.keywords.items():
            if keyword == "TRAORI":
                self._is_oriented = self.tip.tcp = True
                self.tip.forget(block.line)
            elif keyword == "TRAFOOF":
                self._is_oriented = self.tip.tcp = False
                self.tip.go_away(block.line)
            elif keyword in HARMLESS:
                self.tip.even = BY_VECTOR.get(keyword, self.tip.even)
                self.unused.add(keyword)
            elif keyword not in MACHINE and not (keyword == "CYCLE800" and arguments == "()"):
                raise InputError(
                    f"{block.where}: {keyword[:40]!r}: {REFUSED.get(keyword, UNKNOWN)}"
                )
        return "SUPA" in block.keywords

    def _g(self, block: _Block, g: float) -> bool:
        """Take one G word; return whether the positions are not in part coordinates."""
        where = block.where
        if g in (0, 1, 2, 3):
            motions = sorted({other for other in block.g if other in (0, 1, 2, 3)})
            if len(motions) > 1:
                raise InputError(f"{where}: G{motions[0]:g} and G{motions[1]:g} in one block")
            self._motion = int(g)
        elif g in PLANES:
            self._plane = PLANES[int(g)]
        elif g in (43.4, 43.5) or (g == 49 and self.tip.tcp):
            if g == 43.4 and self.tip.machine is None:
                raise InputError(f"{where}: G43.4: rotary axes; {GIVE_MACHINE}")
            self._by_ijk = self._is_oriented = g == 43.5
            self.tip.tcp = g != 49
            self.tip.forget(block.line)
        elif g in UNITS:
            if self.unit != UNITS[int(g)] and (self.unit or self.tip.has_places):
                raise InputError(f"{where}: G{g:g} after moves in another unit, or without one")
            self.unit = UNITS[int(g)]
            self._is_basic = g == INCH_PLACES
        elif g in OFFSETS:
            if g != self._offset and self.tip.has_places:
                raise InputError(f"{where}: G{g:g} after moves; write all of them in one system")
            self._offset = g
        elif f"G{g:g}" in (*AWAY, *MACHINE):
            return True
        elif g not in (*HARMLESS_G, 4, 49):
            raise InputError(f"{where}: 'G{g:g}': {REFUSED_G.get(g, UNKNOWN)}")
        return False

    def _away(self, block: _Block, angles: Mapping[str, float]) -> None:
        machine = [f"G{g:g}" for g in block.g if f"G{g:g}" in MACHINE] + list(block.keywords)
        if self._motion and machine:
            raise InputError(
                f"{block.where}: {machine[0]} at feed: its position is in machine coordinates, not "
                "in the part"
            )
        self.tip.go_away(block.line, angles)

    def _arc(
        self, block: _Block, place: Mapping[str, float]
    ) -> Callable[[Triple, Triple], Arc] | None:
        """Take the words of an arc; return what makes it from its ends, None without any."""
        where, words = block.where, block.words
        offset = {name: words.pop(name) for name in CENTRE if name in words}
        radii = [words.pop(name) for name in ("R", "CR") if name in words]
        if not offset and not radii:
            if place:
                raise InputError(f"{where}: an arc without its centre (I, J, K) or radius (R, CR=)")
            return None
        if self._by_ijk:
            raise InputError(f"{where}: an arc under G43.5; have the CAM system write linear moves")
        if CENTRE[self._plane] in offset or (offset and radii) or len(radii) > 1:
            raise InputError(
                f"{where}: an arc: expected its centre from its start in its plane (I and J under "
                "G17), or its radius"
            )
        normal = np.eye(3)[self._plane] * (1.0 if self._motion == 3 else -1.0)

        def arc(before: Triple, after: Triple) -> Arc:
            start, end = np.array(before), np.array(after)
            centre = start + [offset.get(name, 0.0) for name in CENTRE]
            if radii:
                centre = centre_by_radius(start, end, normal, radii[0], where)
            x, y, z = centre.tolist()
            i, j, k = normal.tolist()
            return Arc((x, y, z), (i, j, k))

        return arc

    def _move(
        self, block: _Block, place: dict[str, float], vector: Sequence[float | None],
        arc: Callable[[Triple, Triple], Arc] | None, angles: Mapping[str, float],
    ) -> None:  # fmt: skip
        if self._motion is None:
            raise InputError(f"{block.where}: a position before any G0 or G1")
        axis: Triple | None = None
        if any(value is not None for value in vector):
            if not self._is_oriented:
                raise InputError(f"{block.where}: A3 B3 C3 without TRAORI, which they need")
            a, b, c = (value or 0.0 for value in vector)  # the controller takes missing ones as 0
            axis = unit_axis((a, b, c), block.where, any_length=True)
        self.tip.go(
            block.line, feed=self._motion > 0, place=place, axis=axis, arc=arc, angles=angles,
            rate=self._feed,
        )  # fmt: skip


def _word_refusal(name: str) -> str:
    if ORIENTATION.fullmatch(name):
        return (
            f"{name}: the effect of this angle depends on the control; have the CAM system write "
            "the tool axis as a vector (A3= B3= C3=), or APT"
        )
    return f"{name!r}: {UNKNOWN}"
