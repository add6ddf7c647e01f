"""Read programs of ABB robots (RAPID) as paths."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
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
    pose_of,
    shown,
    split,
    value,
)
from kerfpath.errors import InputError
from kerfpath.text import upper

_I = re.IGNORECASE | re.ASCII
NAME = r"[A-Z]\w*"
PROC = re.compile(rf"(?:LOCAL\s+)?PROC\s+({NAME})\s*\(.*\)", _I)
STRUCTURE = re.compile(
    r"(?:LOCAL\s+)?(?:MODULE\b.*|ENDMODULE|PROC\b.*\)|ENDPROC|FUNC\b.*\)|ENDFUNC|TRAP\s+\w+|ENDTRAP"
    r"|RECORD\s+\w+|ENDRECORD)|IF\b.*\bTHEN|ELSEIF\b.*\bTHEN|ELSE|ENDIF|WHILE\b.*\bDO|ENDWHILE"
    r"|FOR\b.*\bDO|ENDFOR|TEST\b.*|CASE\b.*:|DEFAULT\s*:|ENDTEST|ERROR|UNDO|BACKWARD|%%%|\w+\s*:",
    _I,
)
"""Lines that are whole without a semicolon."""
HEAD = re.compile(r"(IF\b[^;]*?\bTHEN|(?:WHILE|FOR)\b[^;]*?\bDO)\s+(?=\S)", _I)
"""The first part of a block on one line."""
DATA = re.compile(
    rf"(?:(?:LOCAL|TASK)\s+)?(?:CONST|PERS|VAR)\s+(\w+)\s+({NAME})(?:\{{.*\}})?"
    r"\s*(?::=\s*(.*))?",
    _I,
)
MOTION = re.compile(r"(Move(?:L|C|J|AbsJ)(?:DO|Sync)?|Trigg[LCJ])\s*((?:\\\w+\s*)*),?\s*(.*)", _I)
TRIGGER = re.compile(r"Trigg(?:IO|Equip)\s+(\w+)\s*,\s*(.*)", _I)
SWITCH = re.compile(r"SetDO\s*(?:\\[^,]*,)?\s*(\w+)\s*,\s*(\w+)|(Set|Reset)\s+(\w+)", _I)
COMPACT_IF = re.compile(
    r"IF\s+(.*?[\w\])\"])(?<!\bNOT)(?<!\bAND)(?<!\bOR)\s+"
    r"(?!(?:AND|OR|XOR|DIV|MOD)\b)([A-Z]\w*.*)",
    _I,
)
OUTPUTS_ON = re.compile(r"DOutput\(\w+\)=1(\s+AND\s+DOutput\(\w+\)=1)*", _I)
"""A condition under which the beam goes on only if others are on, as the gas is."""
ASSIGNED = re.compile(r"([A-Z]\w*)[\w.{}\[\], ]*:=\s*(.*)", _I)
CALL = re.compile(rf"({NAME})\s*", _I)
OFFSET = re.compile(r"(Offs|RelTool)\s*\((.*)\)", _I)
SPEEDS = re.compile(r"V(\d+)", re.ASCII)
HANDLERS = ("ERROR", "UNDO", "BACKWARD")


class Rapid(Language):
    """A module."""

    base = "wobj0"
    state = ("data", "triggers")
    opens = re.compile(r"IF\b.*\bTHEN|(?:WHILE|FOR)\b.*\bDO|TEST\b.*", _I)
    closes = re.compile(r"ENDIF|ENDWHILE|ENDFOR|ENDTEST", _I)
    endless = re.compile(r"WHILE\s+TRUE\s+DO", _I)
    harmless = re.compile(
        r"(Conf[LJ]|SingArea|AccSet|VelSet|SpeedRefresh|PathAccLim|WorldAccLim|SoftDeact|PDispOff"
        r"|EOffsOff|CornerPathWarning|StopMove|StartMove|ClearPath|CirPathMode|ActUnit|DeactUnit"
        r"|WaitTime|WaitDI|WaitDO|WaitUntil|WaitRob|WaitSyncTask|TP(?:Write|Erase|Show|ReadFK|ReadNum)|UIMsgBox"
        r"|ErrWrite|Clk(?:Start|Stop|Reset)|Close|Open"
        r"|Write|Stop|Break|Exit|RAISE|RETRY|TRYNEXT|GripLoad|PulseDO|SetAO|SetGO|InvertDO|ISignalD[IO]"
        r"|IDelete|IEnable|IDisable|MotionSup|PDispSet\s+NOPDISP|Incr|Decr|Add|Clear"
        r"|ELSE|ELSEIF|CASE|DEFAULT)\b.*|\w+\s*:|CONNECT\s.*", _I
    )  # fmt: skip

    def __init__(
        self, path: Path, text: Callable[[Path], Sequence[str] | None], beam: Beam | None
    ) -> None:
        super().__init__(path, text, beam)
        self.data: dict[str, tuple[str, str]] = {}
        self.triggers: dict[str, tuple[str, bool, bool, str]] = {}
        """Output, whether it switches on, whether at the start, and what is said of its place."""

    def start(self) -> None:
        statements = list(_statements(self.text(self.path) or ()))
        for line, text in statements:
            if found := DATA.fullmatch(text):
                if upper(found[2]) in self.data and found[3] is not None:
                    raise InputError(f"line {line}: {found[2]} is declared twice")
                self.data[upper(found[2])] = upper(found[1]), (found[3] or "").strip()
        for head, body in blocks(statements, PROC, re.compile("ENDPROC", _I)):
            handler = next((k for k, each in enumerate(body) if upper(each.text) in HANDLERS), None)
            self.routines[upper(head[1])] = body[:handler]
        if "MAIN" not in self.routines and len(self.routines) != 1:
            raise InputError(
                f"expected PROC main(), or one routine, got {len(self.routines)}; give a module "
                "with its main"
            )
        self.run("MAIN" if "MAIN" in self.routines else next(iter(self.routines)))

    def leaves(self, text: str) -> bool:
        return upper(text) in ("RETURN", "EXIT")

    def take(self, line: int | str, text: str) -> None:
        if DATA.fullmatch(text):
            return
        if found := MOTION.fullmatch(text):
            self._motion(line, upper(found[1]), split(found[3]))
        elif found := TRIGGER.fullmatch(text):
            self._trigger(line, upper(found[1]), split(found[2]))
        elif found := SWITCH.fullmatch(text):
            output = found[1] or found[4]
            on = (found[2] or found[3]).lower() in ("1", "high", "set")
            self.switch(line, output, on=on)
        elif found := COMPACT_IF.fullmatch(text):
            if OUTPUTS_ON.fullmatch(found[1]):
                self.take(line, found[2])
            else:
                self.run_block(Statement(line, f"IF {found[1]}"), [Statement(line, found[2])])
        elif found := ASSIGNED.fullmatch(text):
            self._assign(line, text, upper(found[1]), found[2])
        elif found := CALL.fullmatch(text):
            if upper(found[1]) not in self.routines:
                raise self.refusal(line, text)
            self.run(upper(found[1]))
        else:
            raise self.refusal(line, text)

    def _assign(self, line: int | str, text: str, name: str, value_of: str) -> None:
        kind, said = self.data.get(name, ("", ""))
        if kind in ("ROBTARGET", "WOBJDATA", "SPEEDDATA", "POSE", "POS") and said:
            raise InputError(f"line {line}: {shown(text)}: a {kind.lower()} that is computed")
        if kind in ("ROBTARGET", "WOBJDATA", "SPEEDDATA"):
            self.data = {**self.data, name: (kind, value_of)}

    def _trigger(self, line: int | str, name: str, said: list[str]) -> None:
        where, *options = said[0].split("\\")
        rest = "\\".join(said[1:])
        output = re.search(r"\\DOp\s*:=\s*(\w+)", f"{said[0]}\\{rest}", _I)
        if output is None:
            self.triggers.pop(name, None)  # another kind of output
            return
        flags = [option.strip().lower() for option in options]
        off = (
            "" if "time" in flags or value(where, line, "the distance") == 0 else f"{where} mm off"
        )
        on = said[-1].strip().lower() in ("1", "high")
        self.triggers = {**self.triggers, name: (output[1], on, "start" in flags, off)}

    def _motion(self, line: int | str, kind: str, said: list[str]) -> None:
        is_arc = kind.startswith(("MOVEC", "TRIGGC"))
        is_free = kind.startswith(("MOVEJ", "MOVEABSJ", "TRIGGJ"))
        targets, said = said[: 1 + is_arc], said[1 + is_arc :]
        triggers: list[tuple[str, bool, bool, str]] = []
        if kind.startswith("TRIGG") and len(said) > 1:
            first, *more = said[1].split("\\")
            names = [first, *(each.partition(":=")[2] for each in more)]
            if unknown := [each for each in names if upper(each.strip()) not in self.triggers]:
                raise InputError(f"line {line}: {unknown[0]}: no TriggIO or TriggEquip before it")
            triggers = [self.triggers[upper(each.strip())] for each in names]
            said = [said[0], *said[2:]]
        if len(said) < 3 or len(targets) < 1 + is_arc:
            raise InputError(f"line {line}: {kind}: expected a target, speed, zone and tool")
        frame = self._frame(line, said[2])
        self._tool(line, said[2].split("\\")[0].strip())
        places = [None if kind.startswith("MOVEABSJ") else self._target(line, each, frame)
                  for each in targets]  # fmt: skip
        for output, on, at_start, off in triggers:
            if off:
                self.early(line, off)
            if at_start:
                self.switch(line, output, on=on)
        self.move(
            line, places[-1], on_path=not is_free, speed=self._speed(line, said[0]),
            via=places[0] if is_arc else None,
        )  # fmt: skip
        for output, on, at_start, _ in triggers:
            if not at_start:
                self.switch(line, output, on=on)
        if kind.endswith("DO") and len(said) > 4:
            self.switch(line, said[3], on=said[4].lower() in ("1", "high"))
        elif kind.endswith("SYNC"):
            raise InputError(f"line {line}: {kind}: calls a routine on the way; not supported")

    def _speed(self, line: int | str, said: str) -> float | None:
        name, *options = said.split("\\")
        for option in options:
            if found := re.fullmatch(r"V\s*:=\s*(\S+)\s*", option, _I):
                return value(found[1], line, "V")
        declared = self.data.get(upper(name.strip()), ("", name))[1].strip()
        if found := SPEEDS.fullmatch(upper(declared)):
            return float(found[1])
        fields = aggregate(line, declared) if declared.startswith("[") else None
        if isinstance(fields, list) and fields and isinstance(fields[0], str):
            return value(fields[0], line, "the speed")
        return None

    def _frame(self, line: int | str, said: str) -> Frame:
        found = re.search(r"\\WObj\s*:=\s*(\w+)", said, _I)
        if found is None or upper(found[1]) == "WOBJ0":
            return Frame(name=self.base, T=np.eye(4))
        _kind, declared = self.data.get(upper(found[1]), ("", ""))
        if not declared.startswith("["):
            return Frame(name=found[1])
        match aggregate(line, declared):
            case [hold, fixed, _, [user, user_turned], [own, own_turned]]:
                if str(hold).upper() == "TRUE":
                    raise InputError(f"line {line}: {found[1]}: the robot holds the part")
                if str(fixed).upper() != "TRUE":  # a positioner moves it
                    return Frame(name=found[1])
                T = _pose(line, user, user_turned) @ _pose(line, own, own_turned)
                return Frame(name=found[1], T=T)
        raise InputError(f"line {line}: {found[1]}: expected a wobjdata, got {shown(declared)}")

    def _tool(self, line: int | str, name: str) -> None:
        _, declared = self.data.get(upper(name), ("", ""))
        if re.match(r"\[\s*FALSE", declared, _I):
            raise InputError(f"line {line}: {name}: the robot does not hold this tool")

    def _target(self, line: int | str, said: str, frame: Frame) -> Place | None:
        said = said.split("\\")[0].strip()
        if found := OFFSET.fullmatch(said):
            base, *by = split(found[2])
            if len(by) != 3:
                raise InputError(f"line {line}: {shown(said)}: expected a target and three numbers")
            place = self._target(line, base, frame)
            if place is None:
                return None
            T, way = (
                place.T.copy(),
                np.array([value(each.split("\\")[0], line, said) for each in by]),
            )
            T[:3, 3] += way if upper(found[1]) == "OFFS" else T[:3, :3] @ way
            return Place(T, frame)
        kind, declared = self.data.get(upper(said), ("ROBTARGET", said))
        if kind == "JOINTTARGET":
            return None
        match aggregate(line, declared) if declared.startswith("[") else None:
            case [list(at), list(turned), *_]:
                return Place(_pose(line, at, turned), frame)
        raise InputError(f"line {line}: {shown(said)}: no robtarget of this module")


def aggregate(line: int | str, text: str) -> list[object]:
    """Return the parts of [..., [...]] as lists of texts.

    Raises
    ------
    InputError
        Brackets that do not match.
    """
    stack: list[list[object]] = [[]]
    for token in re.findall(r'"[^"]*"|[\[\]]|[^\[\],\s"]+', text):
        if token == "[":
            stack.append([])
        elif token == "]" and len(stack) > 1:
            closed = stack.pop()
            stack[-1].append(closed)
        elif token == "]":
            break
        else:
            stack[-1].append(token)
    if len(stack) != 1 or len(stack[0]) != 1 or not isinstance(stack[0][0], list):
        raise InputError(f"line {line}: {shown(text)}: expected brackets that match")
    return stack[0][0]


def _pose(line: int | str, at: object, turned: object) -> Array:
    if not (
        isinstance(at, list) and isinstance(turned, list) and len(at) == 3 and len(turned) == 4
    ):
        raise InputError(f"line {line}: expected a position and a quaternion, got {at} {turned}")
    w, x, y, z = (value(str(each), line, "a quaternion") for each in turned)
    if not abs(w * w + x * x + y * y + z * z - 1) < 1e-2:
        raise InputError(f"line {line}: a quaternion whose length is not 1")
    return pose_of([value(str(each), line, "a position") for each in at],
                   Rotation.from_quat([x, y, z, w]))  # fmt: skip


def _statements(lines: Sequence[str]) -> Iterator[Statement]:
    """Yield the statements of a module; one may have several lines, and a line several."""
    begun, text = 0, ""
    for number, line in enumerate(lines, 1):
        code = split(line, "!", nested=False)[0]
        for k, part in enumerate(pieces := split(code, ";", nested=False)):
            text = f"{text} {part}".strip() if text else part
            begun = begun if text != part else number
            while head := HEAD.match(text):
                yield Statement(begun, head[1])
                text, begun = text[head.end() :], number
            if text and (k < len(pieces) - 1 or STRUCTURE.fullmatch(text)):
                yield Statement(begun, text)
                text = ""
