"""Read programs of FANUC robots (listings of TP) as paths."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from pathlib import Path

from scipy.spatial.transform import Rotation

from kerfpath.arrays import Array
from kerfpath.cad.programs import Beam, Frame, Language, Place, Statement, pose_of, value
from kerfpath.errors import InputError
from kerfpath.text import upper

_I = re.IGNORECASE | re.ASCII
NUMBERED = re.compile(r"\s*(\d*)\s*:(.*)", _I)
MOTION = re.compile(r"([LJCAS])\s+(P|PR)\[\s*(\d+)\s*(?::[^\]]*)?\](.*)", _I)
VIA = re.compile(r"\s*:?\s*(P|PR)\[\s*(\d+)\s*(?::[^\]]*)?\](.*)", _I)
SPEED = re.compile(r"\s*([\d.]+)\s*(mm/sec\b|cm/min\b|inch/min\b|deg/sec\b|msec\b|sec\b|%)(.*)", _I)
TO_MM_S = {"mm/sec": 1.0, "cm/min": 10 / 60, "inch/min": 25.4 / 60}
ON_THE_WAY = re.compile(
    r"\b(TB|TA|DB)\s*([-\d.]+)\s*(?:sec|mm)\s*,\s*(.*?)(?=\s+(?:TB|TA|DB)\s|\Z)", _I
)
OUTPUT = re.compile(
    r"((?:DO|RO|SO|WO)\[\s*\d+)\s*(?::[^\]]*)?\]\s*=\s*\(?\s*(ON|OFF|PULSE)\b.*", _I
)
GUARDED = re.compile(r"IF\s*\((?:DO\[\d+\]|AND|\s)*\)\s*,\s*(DO\[.*)", _I)
"""The beam goes on only if other outputs are on, as that of the gas."""
CALL = re.compile(r"(?:CALL|RUN)\s+(\w+)\s*(?:\(.*\))?", _I)
PLAIN = re.compile(
    r"(?:FINE|CNT\s*\d+|CR\s*\d+|ACC\s*\d+|WJNT|COORD|PTH|BREAK|RT_LD\w*|AP_LD\w*|\s)*", _I
)
"""What may follow the speed of a motion, besides switches."""
FRAME_SAID = re.compile(r"UFRAME\s+(\d+)\s+([XYZWPR])\s+(\S+)", _I)
"""Remarks with a frame, as kerfpath writes them."""
POSITION = re.compile(r"P\[\s*(\d+)\s*(?::[^\]]*)?\]\s*\{(.*?)\}\s*;", re.ASCII | re.DOTALL)
GROUP = re.compile(r"GP1\s*:(.*?)(?=GP\d|\Z)", re.ASCII | re.DOTALL)
USED = re.compile(r"UF\s*:\s*(\w+)", re.ASCII)
FIELD = re.compile(r"\b([XYZWPR])\s*=\s*(\S+)\s*(?:mm|deg)", re.ASCII)


class Fanuc(Language):
    """A listing, and those beside it that it calls."""

    base = "WORLD"
    opens = re.compile(r"FOR\b.*|IF\b.*\bTHEN|SELECT\b.*", _I)
    closes = re.compile(r"ENDFOR|ENDIF", _I)
    endless = re.compile(r"(?!)")
    harmless = re.compile(
        r"(UTOOL_NUM|OVERRIDE|PAYLOAD|R\[|AR\[|SR\[|F\[|AO\[|GO\[|TIMER\[|\$WAITTMOUT|WAIT|LBL\["
        r"|MESSAGE|UALM|PAUSE|REMARK|COL\s|RSR|ELSE|LINEAR_MAX_SPEED|JOINT_MAX_SPEED|TC_ONLINE"
        r"|MONITOR|SOFTFLOAT\[?END|LOCK PREG|UNLOCK PREG|TOOL_OFFSET_?END|EQ\b).*", _I
    )  # fmt: skip

    def __init__(
        self, path: Path, text: Callable[[Path], Sequence[str] | None], beam: Beam | None
    ) -> None:
        super().__init__(path, text, beam)
        self.positions: dict[str, dict[str, str]] = {}
        self.said: dict[str, dict[str, float]] = {}

    def start(self) -> None:
        self.run(self.load(self.path))

    def load(self, path: Path) -> str:
        """Read a listing; return the key of its routine."""
        lines = self.text(path)
        assert lines is not None  # its caller knows that it exists
        rows = [line.rstrip(" \t") for line in lines]
        heads = [upper(row.strip()) for row in rows]
        if "/MN" not in heads or "/POS" not in heads[heads.index("/MN") :]:
            raise InputError(f"{path.name}: expected a listing with /MN and /POS")
        begin, middle = heads.index("/MN") + 1, heads.index("/POS")
        name, own = upper(path.stem), path == self.path
        statements: list[Statement] = []
        text, at = "", 0
        for number, row in enumerate(rows[begin:middle], begin + 1):
            if not row.strip():
                continue
            found = NUMBERED.fullmatch(row)
            if found is None:
                raise InputError(f"line {number}: expected a numbered line, got {row[:40]!r}")
            text, at = f"{text} {found[2].strip()}".strip(), at or number
            if text.endswith(";") or text.startswith(("!", "--")):
                text = text.removesuffix(";").strip()
                if said := FRAME_SAID.search(text):
                    self.said.setdefault(said[1], {})[upper(said[2])] = value(said[3], at, text)
                if text and not text.startswith(("!", "--", "//")):
                    statements.append(Statement(at if own else f"{at} of {path.name}", text))
                text, at = "", 0
        if text:
            raise InputError(f"line {at}: {text[:40]!r}: its end (;) is missing")
        self.routines[name] = statements
        last = next((k for k in range(middle, len(heads)) if heads[k] == "/END"), len(heads))
        self.positions[name] = dict(POSITION.findall("\n".join(rows[middle + 1 : last])))
        return name

    def leaves(self, text: str) -> bool:
        return upper(text) in ("END", "ABORT")

    def take(self, line: int | str, text: str) -> None:
        if found := MOTION.fullmatch(text):
            self._motion(line, upper(found[1]), found[2], found[3], found[4])
        elif found := OUTPUT.fullmatch(text):
            self.switch(line, f"{upper(found[1])}]", on=upper(found[2]) != "OFF")
        elif found := GUARDED.fullmatch(text):
            self.take(line, found[1])
        elif found := re.fullmatch(r"UFRAME_NUM\s*=\s*(\d+)", text, _I):
            self.frame = self._frame(found[1])
        elif found := CALL.fullmatch(text):
            self._call(line, text, upper(found[1]))
        else:
            raise self.refusal(line, text)

    def _call(self, line: int | str, text: str, name: str) -> None:
        if name in self.switching:
            self.switch(line, "beam", on=self.switching[name])
            return
        file = self.path.with_name(f"{name}.ls")
        if name not in self.routines and self.text(file) is None:
            raise self.refusal(line, text)
        if name not in self.routines:
            self.load(file)
        self.run(name)

    def _frame(self, number: str) -> Frame:
        fields = self.said.get(number, {})
        return Frame(
            name=f"UFRAME {int(number)}" if int(number) else self.base,
            T=_pose(fields)
            if len(fields) == 6
            else None
            if int(number)
            else pose_of([0, 0, 0], Rotation.identity()),
        )

    def _motion(self, line: int | str, kind: str, where: str, number: str, rest: str) -> None:
        if kind in "AS":
            raise InputError(f"line {line}: {kind}: an arc through its neighbours; write C")
        via: Place | None = None
        targets = [(where, number)]
        if kind == "C":
            found = VIA.fullmatch(rest)
            if found is None:
                raise InputError(f"line {line}: C: expected two targets")
            targets.append((found[1], found[2]))
            rest = found[3]
        places = [self._target(line, kind, *target) for target in targets]
        via = places[0] if kind == "C" else None
        speed: float | None = None
        if found := SPEED.fullmatch(rest):
            unit, rest = found[2].lower(), found[3]
            speed = value(found[1], line, "the speed") * TO_MM_S[unit] if unit in TO_MM_S else None
        else:
            rest = re.sub(r"^\s*(R\[\d+\]|\w+_SPEED)\s*(mm/sec|cm/min|%)?", "", rest)
        switches = ON_THE_WAY.findall(rest)
        if not PLAIN.fullmatch(ON_THE_WAY.sub("", rest)):
            raise InputError(
                f"line {line}: {rest.strip()[:40]!r}: it is not known, and may move the target"
            )
        self.move(line, places[-1], on_path=kind != "J", speed=speed, via=via)
        for word, amount, does in switches:
            if upper(word) == "DB" and value(amount, line, "DB") != 0:
                self.early(line, f"a switch {amount} mm off")
            self.take(line, does.strip())

    def _target(self, line: int | str, kind: str, where: str, number: str) -> Place | None:
        if upper(where) == "PR":
            if kind == "J":
                return None
            raise InputError(f"line {line}: PR[{number}]: the listing does not say where it is")
        said = self.positions[self.inside[-1]].get(number)
        if said is None:
            raise InputError(f"line {line}: P[{number}] is missing under /POS")
        group = GROUP.search(said)
        text = group[1] if group else said
        fields = {name: value(each, line, f"P[{number}]") for name, each in FIELD.findall(text)}
        if len(fields) < 6:
            return None
        used = USED.search(text)
        frame = self._frame(used[1]) if used and used[1].isdigit() else self.frame
        return Place(_pose(fields), frame)


def _pose(fields: dict[str, float]) -> Array:
    turned = Rotation.from_euler("xyz", [fields[name] for name in "WPR"], degrees=True)
    return pose_of([fields[name] for name in "XYZ"], turned)
