"""Read cutter-location files: APT (ISO 4343) of numbers, as CAM systems write them."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path

from kerfpath.arrays import Array
from kerfpath.cad.part import Part
from kerfpath.cad.toolpath import (
    UNKNOWN,
    Arc,
    Move,
    ToolPath,
    Triple,
    finite,
    lines_of,
    part_of_tool_path,
    unit_axis,
)
from kerfpath.errors import InputError
from kerfpath.text import upper

BLANK = " \t"
UNITS = {"MM": "mm", "CM": "cm", "INCHES": "in", "INCH": "in", "IN": "in", "FEET": "ft", "M": "m"}
NUMBERS = re.compile(r"[-+.,0-9DE \t]+\$?[ \t]*", re.IGNORECASE)
"""A line of numbers, continued or not."""
TEXTS = ("PARTNO", "PPRINT", "REMARK", "TPRINT")
"""Words that any text may follow, with or without a slash."""
HARMLESS = (
    "AUXFUN", "CLAMP", "CLDIST", "COOLNT", "CUTTER", "DELAY", "DISPLY", "DWELL", "FEDRAT",
    "INTOL", "LEADER", "LINTOL", "MACHIN", "MODE", "OFSTNO", "OPSTOP", "OUTTOL", "PAINT",
    "SELCTL", "SELECT", "SEQNO", "SPINDL", "STOP", "TLDATA", "TOLER", "TOOLNO",
)  # fmt: skip
"""Words that do not affect the path."""
BEGINS = ("END-OF-PATH", "LOAD", "LOADTL", "TOOL PATH")
"""Words between operations: a cut ends there, and the next one may start anywhere."""
ENDS = ("END", "FINI")
REFUSED = {
    **dict.fromkeys(
        ("ARCMOV", "GOFWD", "HELIX", "INDIRV", "MOVARC", "NURBS", "SPLINE", "TLON"),
        "a curve; have the CAM system write linear moves only",
    ),
    **dict.fromkeys(
        ("CUTCOM",), "the controller would offset the path; write the path of the tool centre"
    ),
    **dict.fromkeys(
        ("COPY", "ORIGIN", "ROTABL", "ROTATE", "ROTHED", "TRACUT", "TRANS"),
        "it moves the points that follow; write them in the coordinates of the part",
    ),
    **dict.fromkeys(
        ("INSERT", "PREFUN"), "text for the controller only, which may change the path"
    ),
    **dict.fromkeys(
        ("CYCLE", "GODLTA", "RETRCT"), "a motion that is not written out; write it as GOTO"
    ),
}
"""Words that change the path, and why they are refused."""
UPRIGHT: Triple = (0.0, 0.0, 1.0)


def read_apt(
    path: Path, content: bytes, unit: str | None, gap: float, axis: Array | None = None
) -> Part:
    """Return the cuts of a cutter-location file, one per run of feed moves.

    Raises
    ------
    InputError
        A word that is not known or changes the path (its line is named), a missing number, no unit,
        no tool axis, no cut.
    """
    reader = _Reader()
    for line, word, rest in _statements(lines_of(content)):
        reader.take(line, word, rest)
    reader.require_whole()
    tool_path = ToolPath(
        moves=reader.moves, unit=reader.unit, notes=reader.notes, unused=reader.unused
    )
    return part_of_tool_path(path, tool_path, unit, gap, axis)


def _statements(lines: Sequence[str]) -> Iterator[tuple[int, str, str]]:
    """Yield line, major word and rest of each statement, with continued lines joined.

    A comment that ends with $ goes on in lines of numbers, as Creo writes it; a line with a word is
    always a statement.
    """
    begun, whole, in_comment = 0, "", False
    for number, line in enumerate(lines, start=1):
        in_comment = not whole and (
            line.strip(BLANK).startswith("$$") or (in_comment and bool(NUMBERS.fullmatch(line)))
        )
        bare = "" if in_comment else line.partition("$$")[0].strip(BLANK)
        in_comment = in_comment and line.rstrip(BLANK).endswith("$")
        begun = begun if whole else number
        whole += bare.removesuffix("$")
        if bare and not bare.endswith("$"):
            yield begun, *_split(whole)
            whole = ""
    if whole:
        raise InputError(f"line {begun}: continues with $, but the file ends")


def _split(statement: str) -> tuple[str, str]:
    for word in TEXTS:
        if upper(statement).startswith(word):
            return word, statement[len(word) :].lstrip(" /")
    word, _, rest = statement.partition("/")
    return re.sub(f"[{BLANK}]+", " ", upper(word)).strip(BLANK), rest.strip(BLANK)


class _Reader:
    """The state of the reader, which the next statement is read with."""

    def __init__(self) -> None:
        self.moves: list[Move] = []
        self.notes: list[str] = []
        self.unused: set[str] = set()
        self.unit = ""
        self._axis: Triple | None = None
        self._is_upright = False
        self._is_rapid = False
        self._operation = ""
        self._system: tuple[float, ...] = ()
        self._arc: Arc | None = None
        self._end = 0

    def take(self, line: int, word: str, rest: str) -> None:
        """Take one statement.

        Raises
        ------
        InputError
            A statement that is not known, or that changes the path.
        """
        where, values = f"line {line}", [value.strip(BLANK) for value in upper(rest).split(",")]
        if self._arc is not None and word != "GOTO" and word not in (*TEXTS, *HARMLESS):
            raise InputError(f"{where}: expected the GOTO that ends a CIRCLE, got {word[:40]!r}")
        if word in ("GOTO", "FROM"):
            self._goto(where, line, word, values)
        elif word in TEXTS or (word in HARMLESS and "RAPID" not in values):
            self.unused.add(word)
        elif word == "CIRCLE":
            self._circle(where, _numbers(where, word, values, (7,)))
        elif word == "UNITS":
            self._units(where, values)
        elif word == "MULTAX" and values in ([""], ["ON"], ["OFF"]):
            self._is_upright = values == ["OFF"]
            self._axis = UPRIGHT if self._is_upright else self._axis
        elif word == "TLAXIS":
            self._axis = self._direction(where, _numbers(where, word, values, (3,)))
        elif word == "RAPID" and values == [""]:
            self._is_rapid = True
        elif word == "MSYS":
            self._coordinates(where, _numbers(where, word, values, (9,)))
        elif word == "GOHOME":
            self._moves_away(line)
        elif word in BEGINS:
            self._begins(line, word, rest)
        elif word in ENDS:
            self._end = self._end or line
        elif not (word in ("CUTCOM", "CYCLE") and values == ["OFF"]):
            raise InputError(f"{where}: {_refusal(word, rest)}")

    def _goto(self, where: str, line: int, word: str, values: Sequence[str]) -> None:
        numbers = _numbers(where, word, values, (3, 6))
        arc, self._arc = self._arc, None
        if self._end:
            raise InputError(f"{where}: a move after the end of the path in line {self._end}")
        if len(numbers) == 6:
            self._axis = self._direction(where, numbers[3:])
        is_feed = word == "GOTO" and not self._is_rapid
        self._is_rapid = self._is_rapid and word == "FROM"
        self.moves.append(
            Move(
                line=line, kind="feed" if is_feed else "rapid", point=_triple(numbers),
                axis=self._axis, operation=self._operation, arc=arc,
            )
        )  # fmt: skip

    def require_whole(self) -> None:
        """Raise InputError if the file ends before a move does."""
        if self._arc is not None:
            raise InputError("ends after a CIRCLE, without the GOTO that ends its arc")

    def _circle(self, where: str, numbers: Sequence[float]) -> None:
        """Take the circle along which the next GOTO moves, counter-clockwise about its axis."""
        if not self.moves or self.moves[-1].point is None or self._is_rapid:
            raise InputError(f"{where}: CIRCLE: expected a GOTO at feed to its start before it")
        i, j, k = numbers[3:6]
        normal = unit_axis((i, j, k), where)
        self._arc = Arc(_triple(numbers), normal)

    def _direction(self, where: str, numbers: Sequence[float]) -> Triple:
        axis = unit_axis(_triple(numbers), where)
        if self._is_upright and axis != UPRIGHT:
            raise InputError(f"{where}: a tool axis that is not 0,0,1 under MULTAX/OFF")
        return axis

    def _units(self, where: str, values: Sequence[str]) -> None:
        if len(values) != 1 or values[0] not in UNITS:
            raise InputError(f"{where}: UNITS: expected one of {', '.join(UNITS)}")
        unit = UNITS[values[0]]
        has_points = any(move.point for move in self.moves)
        if self.unit != unit and (self.unit or has_points):
            was = f"other than {self.unit} before" if self.unit else "after points without one"
            raise InputError(f"{where}: UNITS {was}; use one unit for the whole file")
        self.unit = unit

    def _coordinates(self, where: str, system: tuple[float, ...]) -> None:
        if self._system and system != self._system:
            raise InputError(f"{where}: another MSYS; write all operations in one system")
        if not self._system and system != (0, 0, 0, 1, 0, 0, 0, 1, 0):
            self.notes.append(f"points are in the system that MSYS in {where} defines")
        self._system = system

    def _moves_away(self, line: int) -> None:
        self._is_rapid = False
        self.moves.append(Move(line=line, kind="away"))

    def _begins(self, line: int, word: str, rest: str) -> None:
        if word == "TOOL PATH":
            self._operation = rest.partition(",")[0].strip(BLANK)
            self._axis = UPRIGHT if self._is_upright else None
        elif word == "END-OF-PATH":
            self._operation = ""
        self.moves.append(Move(line=line, kind="begin"))


def _numbers(
    where: str, word: str, values: Sequence[str], counts: Sequence[int]
) -> tuple[float, ...]:
    if len(values) not in counts:
        raise InputError(
            f"{where}: {word}: expected {' or '.join(map(str, counts))} numbers, got {len(values)}"
        )
    return tuple(finite(value, f"{where}: {word}") for value in values)


def _triple(numbers: Sequence[float]) -> Triple:
    x, y, z = numbers[:3]
    return x, y, z


def _refusal(word: str, rest: str) -> str:
    asked = f"{word[:40]}/{rest[:20]}" if rest else word[:40]
    if "=" in word or "=" in rest:
        return f"{asked!r} defines geometry; expected a cutter-location file with numbers only"
    return f"{asked!r}: {REFUSED.get(word.partition(',')[0], UNKNOWN)}"
