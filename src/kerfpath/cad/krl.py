"""Read programs of KUKA robots (KRL) as paths."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from kerfpath.arrays import Array
from kerfpath.cad.programs import (
    Beam,
    Frame,
    Language,
    Place,
    Statement,
    blocks,
    compact,
    pose_of,
    shown,
    split,
    value,
)
from kerfpath.errors import InputError
from kerfpath.text import upper

NAME = r"[A-Z_$][\w$.]*"
FIELDS = "XYZABC"
_I = re.IGNORECASE | re.ASCII
MOTION = re.compile(r"(S?LIN|S?CIRC|S?PTP)\s+(.*)", _I)
AGGREGATE = re.compile(rf"(?:{NAME}\s*:\s*)?\{{(.*)\}}", _I)
DECLARED = re.compile(
    rf"(?:(?:GLOBAL|DECL|CONST)\s+)*(?:\w+\s+)?({NAME}(?:\[\d+\])?)\s*=\s*(.*)", _I
)
TRIGGER = re.compile(
    r"TRIGGER\s+WHEN\s+(PATH|DISTANCE)\s*=\s*(\S+)\s+DELAY\s*=\s*\S+\s+DO\s+(.*?)"
    r"(?:\s+PRIO\s*=.*)?",
    _I,
)
OUTPUT = re.compile(r"(\$OUT\[\d+\])\s*=\s*(.+)", _I)
CALL = re.compile(rf"({NAME})\s*\(.*\)", _I)
BAS = re.compile(r"BAS\s*\(\s*#(\w+)\s*(?:,\s*([^)]*))?\)", _I)
FDAT = re.compile(r"BASE_NO\s+(\d+)", _I)
AFTER = re.compile(r"C_\w+|,\s*C_\w+", _I)


class Krl(Language):
    """A .src with its .dat, and the .src files beside it that it calls."""

    base = "$WORLD"
    opens = re.compile(r"(IF|WHILE|FOR|LOOP|REPEAT|SWITCH)\b.*", _I)
    closes = re.compile(r"(ENDIF|ENDWHILE|ENDFOR|ENDLOOP|UNTIL|ENDSWITCH)\b.*", _I)
    endless = re.compile(r"LOOP|WHILE\s*\(?\s*TRUE\s*\)?", _I)
    state = ("frame", "speed", "waiting")
    harmless = re.compile(
        r"(&.*|(GLOBAL\s+)?INTERRUPT\s.*|WAIT\s.*|HALT|CONTINUE|ELSE|CASE\b.*|DEFAULT|BRAKE\b.*"
        r"|(DECL|INT|REAL|BOOL|CHAR|E6POS|E6AXIS|POS|FRAME|AXIS|EXT)\s.*|IMPORT\s.*"
        r"|\$(OV_PRO|ADVANCE|ORI_TYPE|CIRC_TYPE|VEL(?!\s*\.\s*CP|\s*=)\w*|ACC\w*|APO\w*|JERK\w*|H_POS|LOAD|NULLFRAME"
        r"|TIMER\w*|CYCFLAG|FLAG|ANOUT|LOOP_MSG|SPL_\w*)\b.*"
        r"|(PDAT_ACT|LDAT_ACT|LCPDAT_ACT|SPTP_\w+|TOOL_?DATA\w*|LOAD_DATA)\b.*"
        r"|(BAS|VAR|MSG\w*|LOG)\s*\(\s*#(INITMOV|ACC_\w+|VEL_PTP|PTP_PARAMS|OUT_SYNC)\b.*\)"
        r"|BAS\s*\(\s*#?(PTP_DAT|LIN_DAT|CP_DAT)\s*\)|ANOUT\s.*)", _I
    )  # fmt: skip

    def __init__(
        self, path: Path, text: Callable[[Path], Sequence[str] | None], beam: Beam | None
    ) -> None:
        super().__init__(path, text, beam)
        self.data: dict[str, str] = {}
        self.read: set[str] = set()
        self.frame = Frame(name="$BASE")
        self.last: dict[str, float] = {}
        self.waiting: list[tuple[int | str, str, bool]] = []

    def start(self) -> None:
        if self.path.suffix.lower() == ".dat":
            raise InputError(f"holds data alone; give the program, {self.path.stem}.src")
        (name, *_) = self.load(self.path)
        self.run(name)

    def load(self, path: Path) -> list[str]:
        """Read the routines of a .src and the data of its .dat; return their names."""
        lines = self.text(path)
        assert lines is not None  # its caller knows that it exists
        self.read.add(path.stem.upper())
        found = list(blocks(self._statements(path, lines), _DEF, _END))
        if not found:
            raise InputError(f"{path.name}: expected DEF NAME(), got none")
        for head, body in found:
            self.routines[upper(head[1])] = body
        for file in (path.with_suffix(".dat"), path.with_name("$config.dat")):
            for each in self._statements(file, self.text(file) or ()):
                if said := DECLARED.fullmatch(each.text):
                    self.data.setdefault(upper(said[1]), said[2])
        return [upper(head[1]) for head, _ in found]

    def _statements(self, path: Path, lines: Sequence[str]) -> list[Statement]:
        own = path == self.path
        rows = [(n, line.partition(";")[0].strip()) for n, line in enumerate(lines, 1)]
        return [Statement(n if own else f"{n} of {path.name}", row) for n, row in rows if row]

    def leaves(self, text: str) -> bool:
        return upper(text) in ("RETURN", "EXIT")

    def take(self, line: int | str, text: str) -> None:
        if found := MOTION.fullmatch(text):
            self._motion(line, upper(found[1]), found[2])
        elif found := TRIGGER.fullmatch(text):
            self._trigger(line, *found.groups())
        elif found := OUTPUT.fullmatch(text):
            self.switch(line, found[1], on=compact(found[2]) != "FALSE")
        elif found := BAS.fullmatch(text):
            self._bas(line, text, upper(found[1]), (found[2] or "").strip())
        elif found := CALL.fullmatch(text):
            self._call(line, text, upper(found[1]))
        elif found := DECLARED.fullmatch(text):
            self._assign(line, text, upper(found[1]), found[2].strip())
        else:
            raise self.refusal(line, text)

    def _call(self, line: int | str, text: str, name: str) -> None:
        if (said := compact(name + "()")) in self.switching:
            self.switch(line, "beam", on=self.switching[said])
            return
        if name not in self.routines:
            file = self.path.with_name(f"{name}.src")
            if name in self.read or self.text(file) is None:
                raise self.refusal(line, text)
            self.load(file)
        self.run(name)

    def _assign(self, line: int | str, text: str, name: str, said: str) -> None:
        if name == "$BASE":
            self.frame = self._frame(line, said)
        elif name == "FDAT_ACT":
            numbered = FDAT.search(self.data.get(upper(said), said))
            if numbered is None:
                raise InputError(f"line {line}: {shown(text)}: expected a BASE_NO, in the .dat")
            self.frame = self._frame(line, f"BASE_DATA[{numbered[1]}]")
        elif name == "$VEL.CP":
            self.speed = 1000 * value(said, line, name)
        elif name == "$IPO_MODE" and upper(said) != "#BASE":
            raise InputError(f"line {line}: {shown(text)}: the robot holds the part; not supported")
        elif name in self.data and AGGREGATE.fullmatch(self.data[name]):
            raise InputError(f"line {line}: {shown(text)}: a position that is computed")

    def _bas(self, line: int | str, text: str, what: str, said: str) -> None:
        if what == "VEL_CP":
            self.speed = 1000 * value(said, line, text)
        elif what == "BASE":
            self.frame = self._frame(line, f"BASE_DATA[{said}]")
        elif what not in ("TOOL", "INITMOV", "FRAMES", "CP_PARAMS", "EX_BASE"):
            raise self.refusal(line, text)

    def _frame(self, line: int | str, said: str) -> Frame:
        if upper(said) in ("$NULLFRAME", "$WORLD"):
            return Frame(name="$WORLD", T=np.eye(4))
        name, said = upper(said), self.data.get(upper(said), said)
        if not AGGREGATE.fullmatch(said):
            return Frame(name=compact(name))
        if name[:1] == "{":
            name = "$BASE"
        fields = self._fields(line, said)
        if missing := [each for each in FIELDS if each not in fields]:
            raise InputError(f"line {line}: $BASE: {missing[0]} is missing")
        if self.frame.name == name and self.frame.T is not None:  # another value, so another frame
            name = f"{name} of line {line}"
        return Frame(name=name, T=_pose(fields))

    def _fields(self, line: int | str, said: str) -> dict[str, float]:
        found = AGGREGATE.fullmatch(said)
        assert found is not None
        fields: dict[str, float] = {}
        for part in split(found[1]):
            name, _, number = part.partition(" ")
            if upper(name) in (*FIELDS, "A1", "A2", "A3", "A4", "A5", "A6"):
                fields[upper(name)] = value(number, line, name)
        return fields

    def _motion(self, line: int | str, kind: str, said: str) -> None:
        parts = [AFTER.sub("", part).strip() for part in split(_with_lists(said))]
        parts = [part for part in parts if part]
        if any(compact(part).startswith("CA") and "{" not in part for part in parts):
            raise InputError(f"line {line}: CA: an arc by its angle; write the end of the arc")
        needed = 2 if kind.endswith("CIRC") else 1
        if len(parts) != needed:
            raise InputError(f"line {line}: {kind}: expected {needed} target, got {len(parts)}")
        places = [self._target(line, kind, part) for part in parts]
        before, self.waiting = self.waiting, []
        for where, output, is_start in before:
            if is_start:
                self.take(where, output)
        self.move(
            line, places[-1], on_path=not kind.endswith("PTP"), speed=self.speed,
            via=places[0] if needed == 2 else None,
        )  # fmt: skip
        for where, output, is_start in before:
            if not is_start:
                self.take(where, output)

    def _target(self, line: int | str, kind: str, said: str) -> Place | None:
        is_joint = kind.endswith("PTP")
        named, said = said, self.data.get(upper(said), said)
        if not AGGREGATE.fullmatch(said):
            if is_joint:
                return None
            raise InputError(
                f"line {line}: {shown(named)}: no such position in the .dat; it is not known where "
                "it is"
            )
        fields = self._fields(line, said)
        if any(name in fields for name in ("A1", "A2", "A3", "A4", "A5", "A6")):
            self.last = {}
            return None
        known = self.last | fields  # what is left out is kept
        if missing := [each for each in FIELDS if each not in known]:
            if is_joint:
                return None
            raise InputError(f"line {line}: {missing[0]} is missing, and was not given before")
        self.last = known
        return Place(_pose(known), self.frame)

    def _trigger(self, line: int | str, what: str, where: str, does: str) -> None:
        if not OUTPUT.fullmatch(does) and not CALL.fullmatch(does):
            return
        is_start = upper(what) == "DISTANCE" and where == "0"
        if upper(what) == "PATH" and value(where, line, "PATH") != 0:
            self.early(line, f"a switch {where} mm off the end")
        self.waiting = [*self.waiting, (line, does, is_start)]


_DEF = re.compile(rf"(?:GLOBAL\s+)?DEF(?:FCT\s+\w+)?\s+({NAME})\s*\(.*\)", _I)
_END = re.compile("END(FCT)?", _I)


def _with_lists(said: str) -> str:
    """Return the targets of a motion, what follows the last of them after a comma."""
    return re.sub(r"\s+(C_\w+|WITH\b.*)", "", re.sub(r"\s+WITH\b.*", "", said, flags=_I), flags=_I)


def _pose(fields: dict[str, float]) -> Array:
    a, b, c = (fields[name] for name in "ABC")
    return pose_of([fields[name] for name in "XYZ"], Rotation.from_euler("ZYX", [a, b, c], True))
