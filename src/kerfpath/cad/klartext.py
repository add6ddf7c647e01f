"""Read moves of Heidenhain's programs: L, LN, C and CR, with tool axes or rotary axes."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence

import numpy as np

from kerfpath.cad.machine import GIVE_MACHINE, Machine
from kerfpath.cad.toolpath import (
    Arc,
    Tip,
    ToolPath,
    Triple,
    centre_by_radius,
    finite,
    unit_axis,
)
from kerfpath.errors import InputError
from kerfpath.text import upper

BEGIN = re.compile(r"\s*\d*\s*BEGIN PGM\s+\S+(?:\s+(\S+))?", re.ASCII)
UNITS = {"MM": "mm", "INCH": "in"}
AXIS = ("TX", "TY", "TZ")
NORMAL = ("NX", "NY", "NZ")
HARMLESS = re.compile(
    r"BLK FORM\b|TOOL (?:CALL|DEF)\b|STOP\b|CYCL DEF 32(?:\.\d)?\b|M\d+$|FUNCTION TCPM\b|\*",
    re.ASCII,
)
TCPM = re.compile(r"FUNCTION TCPM\b|M128\b")
ENDS = ("M2", "M02", "M30")
IN_MACHINE = ("M91", "M92")
CHANGING = ("M89", "M99", "M114", "M118", "M130", "M140", "M144")
"""Called cycles, compensated tool axes, handwheel, other systems: moves that are not supported."""
CHANGING_FEED = ("M103", "M109", "M110", "M111", "M136")
"""F is a share while plunging, of arcs, or per revolution: no speed of the tip from here on."""
TOOL_FEED = re.compile(r"TOOL CALL\b.*\sF([0-9.,]+)(?:\s|$)")
NO_TCPM = re.compile(r"FUNCTION RESET TCPM$|M129$")
WORD = re.compile(r"([TN]?[XYZ]|[ABCFM])([-+]?[0-9.,]+|MAX)|(R[0LR])$")
RADIUS = re.compile(r"R([-+][0-9.,]+)")
TURNS = {"DR+": 1.0, "DR-": -1.0}
"""Which way an arc turns about the tool axis."""
TOOL_AXIS = re.compile(r"TOOL CALL\b.*\s([XYUVW])(?:\s|$)")
"""A tool axis other than Z, about which arcs would turn."""


def is_klartext(lines: Sequence[str]) -> bool:
    """Return whether a program begins as Heidenhain's do."""
    first = next((line for line in lines if line.strip() and not line.strip().startswith(";")), "")
    return BEGIN.match(upper(first)) is not None


def klartext_path(lines: Sequence[str], machine: Machine | None) -> ToolPath:
    """Return the moves of a program.

    Raises
    ------
    InputError
        A block that is not known, that changes the path, or that needs a machine that is not given
        (its line is named).
    """
    program = _Program(machine)
    for number, line in enumerate(lines, start=1):
        text = re.sub(r"^[ \t]*[0-9]+\b", "", upper(line).partition(";")[0]).strip(" \t")
        if text:
            program.take(number, f"line {number}", text)
    return ToolPath(
        moves=program.tip.moves, unit=program.unit, notes=program.tip.notes, unused=program.unused
    )


class _Program:
    """The state of the program, which the next block is read with."""

    def __init__(self, machine: Machine | None) -> None:
        self.tip = Tip(machine)
        self.unit = ""
        self.unused: set[str] = set()
        self._pole: dict[str, float] = {}
        self._arcs_refused = ""
        self._feed: float | None = None
        self._has_feeds = True
        self._end = 0

    def take(self, line: int, where: str, text: str) -> None:
        """Take one block.

        Raises
        ------
        InputError
            A block that is not known, or that changes the path.
        """
        if self._end and not text.startswith("END PGM"):
            raise InputError(f"{where}: a block after the end of the program in line {self._end}")
        kind, *words = re.split("[ \t]+", text)
        if begin := BEGIN.match(text):
            unit = begin[1] or ""
            if unit not in UNITS or self.unit:
                raise InputError(f"{where}: expected one BEGIN PGM NAME MM or INCH, got {text!r}")
            self.unit = UNITS[unit]
        elif kind in ("L", "LN"):
            self._line(line, where, words)
        elif kind == "CC":
            self._take_pole(where, words)
        elif kind in ("C", "CR"):
            self._circle(line, where, kind, words)
        elif text.startswith("END PGM") or text.removeprefix("STOP ") in ENDS:
            self._end = line
        elif NO_TCPM.match(text):
            self._keep_tip(line, keeps=False)
        elif HARMLESS.match(text) and kind not in CHANGING:
            if TCPM.match(text):
                if "AXIS SPAT" in text:
                    raise InputError(
                        f"{where}: 'AXIS SPAT': A, B and C that are no rotary axes; write AXIS POS"
                    )
                self.tip.even = "PATHCTRL VECTOR" in text
                self._keep_tip(line, keeps=True)
            elif kind == "TOOL":
                if other := TOOL_AXIS.match(text):
                    self._arcs_refused = f"about the tool axis {other[1]}"
                if said := TOOL_FEED.match(text):
                    self._take_feed(where, said[1])
                self.tip.forget(line)
            elif text in CHANGING_FEED:
                self._has_feeds = False
            self.unused.add(kind)
        else:
            raise InputError(f"{where}: {text[:40]!r}: {_reason(kind)}")

    def _take_pole(self, where: str, words: Sequence[str]) -> None:
        """Take the centre of the arcs that follow."""
        found = [WORD.fullmatch(word) for word in words]
        values = {each[1]: each[2] for each in found if each is not None}
        if sorted(values) != ["X", "Y"] or len(words) != 2:
            raise InputError(
                f"{where}: {' '.join(['CC', *words])[:40]!r}: expected CC X Y, absolute"
            )
        self._pole = {
            name: finite(value.replace(",", "."), f"{where}: {name}")
            for name, value in values.items()
        }

    def _circle(self, line: int, where: str, kind: str, words: Sequence[str]) -> None:
        """Take an arc in the plane of X and Y, about the pole or by its radius."""
        turns = [TURNS[word] for word in words if word in TURNS]
        radii = [found[1] for word in words if (found := RADIUS.fullmatch(word))]
        rest = [word for word in words if word not in TURNS and not RADIUS.fullmatch(word)]
        if self._arcs_refused:
            raise InputError(f"{where}: an arc {self._arcs_refused}; only Z is read")
        if len(turns) != 1 or len(radii) != (kind == "CR"):
            raise InputError(
                f"{where}: expected C X Y DR+ or DR- after CC, or CR X Y R DR+ or DR-, with signs"
            )
        if kind == "C" and not self._pole:
            raise InputError(f"{where}: an arc without its centre; expected CC X Y before it")
        pole, normal = dict(self._pole), np.array([0.0, 0.0, turns[0]])
        radius = finite(radii[0].replace(",", "."), f"{where}: R") if radii else None

        def arc(before: Triple, after: Triple) -> Arc:
            start, end = np.array(before), np.array(after)
            centre = np.array([pole.get("X", 0.0), pole.get("Y", 0.0), start[2]])
            if radius is not None:
                centre = centre_by_radius(start, end, normal, radius, where)
            x, y, z = centre.tolist()
            return Arc((x, y, z), (0.0, 0.0, turns[0]))

        self._line(line, where, rest, arc)

    def _line(
        self, line: int, where: str, words: Sequence[str],
        arc: Callable[[Triple, Triple], Arc] | None = None,
    ) -> None:  # fmt: skip
        """Take a line or an arc: its position, tool axis, feed and other words."""
        values: dict[str, float] = {}
        extras: set[str] = set()
        is_rapid = False
        for word in words:
            found = WORD.fullmatch(word)
            if word.startswith("I") or found is None or word in ("RL", "RR"):
                raise InputError(f"{where}: {word[:40]!r}: {_reason(word)}")
            name, text = found[1], found[2]
            if name in ("A", "B", "C") and self.tip.machine is None:
                raise InputError(f"{where}: {name}: a rotary axis; {GIVE_MACHINE}")
            if name == "F":
                if text == "MAX":
                    is_rapid = True
                elif not extras & {"M103", "M128"}:  # whose own number it is
                    self._take_feed(where, text)
            elif name == "M":
                extras.add(f"M{text}")
                self._has_feeds &= f"M{text}" not in CHANGING_FEED
            elif name is not None:
                if name in values:
                    raise InputError(f"{where}: {name} twice in one block")
                values[name] = finite(text.replace(",", "."), f"{where}: {name}")
        if changing := [each for each in CHANGING if each in extras]:
            raise InputError(f"{where}: {changing[0]!r}: {_reason(changing[0])}")
        if "M128" in extras:
            self._keep_tip(line, keeps=True)
        self.unused |= {each[0] for each in extras} | {n for n in NORMAL if n in values}
        if arc is not None and (is_rapid or any(name in values for name in (*AXIS, *NORMAL, "Z"))):
            raise InputError(f"{where}: an arc: expected X and Y at feed, without Z and tool axis")
        self._go(line, where, values, extras, is_rapid, arc)
        if "M129" in extras:
            self._keep_tip(line, keeps=False)
        if any(each in extras for each in ENDS):
            self._end = line

    def _take_feed(self, where: str, text: str) -> None:
        """Take a feed, in mm/min; a program in inches may mean tenths of them."""
        feed = finite(text.replace(",", "."), f"{where}: F")
        self._feed = feed if feed > 0 else None

    def _keep_tip(self, line: int, *, keeps: bool) -> None:
        """Switch the tool-centre-point control on or off."""
        if self.tip.tcp is not keeps:
            self.tip.tcp = keeps
            self.tip.forget(line)

    def _go(
        self, line: int, where: str, values: dict[str, float], extras: set[str], is_rapid: bool,
        arc: Callable[[Triple, Triple], Arc] | None,
    ) -> None:  # fmt: skip
        place = {name: values[name] for name in "XYZ" if name in values}
        angles = {name: values[name] for name in "ABC" if name in values}
        axis: Triple | None = None
        if any(name in values for name in AXIS):
            if missing := [name for name in AXIS if name not in values]:
                raise InputError(f"{where}: TX, TY and TZ belong together; {missing[0]} is missing")
            if not self.tip.tcp:
                raise InputError(f"{where}: TX TY TZ without M128, which they need")
            axis = unit_axis((values["TX"], values["TY"], values["TZ"]), where)
        elif any(name in values for name in NORMAL):
            raise InputError(f"{where}: NX NY NZ without TX TY TZ; expected the tool axis")
        if any(each in extras for each in IN_MACHINE):
            if not is_rapid:
                raise InputError(
                    f"{where}: M91 at feed: its position is in machine coordinates, not in the part"
                )
            self.tip.go_away(line, angles)
        elif place or axis or angles:
            known = self._has_feeds and self.unit == "mm"
            self.tip.go(
                line, feed=not is_rapid, place=place, axis=axis, arc=arc, angles=angles,
                rate=self._feed if known else None,
            )  # fmt: skip


def _reason(word: str) -> str:
    if word in ("CT", "CP", "LP", "RND", "CHF", "APPR", "DEP", "SPL"):
        return "a curve, or a move that is not written out; have the CAM system write lines only"
    if word in ("RL", "RR"):
        return "the controller would offset the path; write the path of the tip"
    if word.startswith("I"):
        return "increments; write absolute positions"
    return "it is not known, and may change the path"
