"""Read back the projects that `Val3` writes; anything else is refused."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import PurePosixPath
from typing import Any

import numpy as np

from kerfpath.arrays import Array, freeze
from kerfpath.errors import InputError
from kerfpath.post.arcs import faceplate, from_euler, world
from kerfpath.post.flow import section_of
from kerfpath.post.harmless import LinePattern, compact, harmless_lines
from kerfpath.post.line_reader import BLANK, LineReader, patterns, program_lines, statements
from kerfpath.post.program import GASES, PARTNERS, SIGNALS, Await, Gas, Partner, Switch
from kerfpath.post.read_program import FlowStep, MoveKind, ReadMove, ReadOff, ReadProgram
from kerfpath.post.val3.controller import SAME, Val3Settings, joints_from_axes
from kerfpath.post.val3.writer import (
    ANGLES,
    DATA,
    FIRST,
    OUTPUTS,
    PORTS,
    PROGRAM,
    PROJECT,
    SPACE,
    STACK_SIZE,
    TYPES,
    Element,
    closing_lines,
    links,
    opening_lines,
    parameters,
    parse,
    stop_lines,
    wait_lines,
)
from kerfpath.robots import Robot

# -----------------------------------------------------------------------------
# Read the data of a project that `Val3` writes: frames, targets, speeds and outputs.

_NUMBER = re.compile(r"-?\d+(?:\.\d+)?", re.ASCII)
_POSE = ("x", "y", "z", "rx", "ry", "rz")
_WORDS = {
    "shoulder": ("lefty", "righty", SAME[0]),
    "elbow": ("epositive", "enegative", SAME[1]),
    "wrist": ("wpositive", "wnegative", SAME[2]),
}
_UNUSED_TYPES = ("num", "bool", "string", "pointRx", "jointRx", "trsf", "mdesc", "config")
"""Types of data that may be declared although no routine uses them."""
_JOINTS = tuple(f"j{i}" for i in range(1, 7))
_BOUNDS = {"accel": "100", "decel": "100", "rmax": "99999"}


class Val3Data:
    """The data that a .dtx declares; each kind of datum has a method.

    They are `frames` by name; `q` (K, 6) rad; `T` (K, 4, 4) m in the part with their `words`; and
    `motions` by name, with speed (m/s or share of the full speed) and zone (m).
    """

    def __init__(self, root: Element, robot: Robot, settings: Val3Settings) -> None:
        self.robot, self.settings = robot, settings
        self.said_at: dict[str, list[str]] = {}
        self.frames: dict[str, Array] = {}
        self.first: int | None = None
        self.q, self.T = np.empty((0, 6)), np.empty((0, 4, 4))
        self.words: list[tuple[str, ...]] = []
        self.motions: dict[str, list[tuple[float, float]]] = {"mAir": [], "mPath": []}
        seen = set()
        for datum in root.only("Datas")[0].each("Data"):
            name = datum.attributes.get("name", "")
            unused = name not in _DATA and datum.attributes.get("type") in _UNUSED_TYPES
            if name in seen or not (unused or name in _DATA):
                raise datum.fault(f"not expected here: {datum.shown()}")
            seen.add(name)
            if unused:  # routines have no names but those of _DATA
                continue
            values = datum.each("Value")
            kind, reader = _DATA[name]
            datum.take(
                **{"name": name, "access": "private", "xsi:type": "array"},
                type=kind,
                size=str(len(values)),
            )
            if not values or (len(values) > 1 and name not in TYPES):
                raise datum.fault(f"expected one value of {name}, got {len(values)}")
            for key, value in enumerate(values):
                value.only()
                if value.attributes.pop("key", "") != str(key):
                    raise value.fault(f"expected the value of key {key}")
            self.said_at[name] = [f"{value.file}, line {value.line}" for value in values]
            reader(self, name, values)
        expected = links(settings)
        for name in ("fPart", "tLaser", *expected):
            if name not in seen:
                raise root.fault(f"{name} is not declared")

    def _frame(self, name: str, values: list[Element]) -> None:
        (value,) = values
        own = {} if name == "fPart" else {"ioLink": self.settings.tool_link}
        for key, link in own.items():
            if value.attributes.pop(key, "") != link:
                raise value.fault(f"expected {key} {link!r} of a tool")
        self.frames[name] = _poses(values, "world[0]" if name == "fPart" else "flange[0]")[0]

    def _first(self, name: str, values: list[Element]) -> None:
        (value,) = values
        text = value.attributes.get("value", "")
        value.take(value=text)
        if not re.fullmatch(r"[1-9]\d{0,5}", text, re.ASCII):
            raise value.fault(f"{name} must be the number of a contour, got {text[:60]!r}")
        self.first = int(text)

    def _output(self, name: str, values: list[Element]) -> None:
        (value,) = values
        link = value.attributes.get("link", "")
        if link != (expected := links(self.settings).get(name)):
            raise value.fault(f"expected the output {expected} to be switched, got {link}")
        value.take(link=link)

    def _air_targets(self, name: str, values: list[Element]) -> None:
        rows = [_numbers(value, _JOINTS) for value in values]
        for value in values:
            value.take(**{k: v for k, v in value.attributes.items() if k in _JOINTS})
        self.q = joints_from_axes(self.robot, np.radians(np.array(rows)))

    def _points(self, name: str, values: list[Element]) -> None:
        for value in values:
            words = tuple(value.attributes.pop(what, "") for what in _WORDS)
            for (what, known), word in zip(_WORDS.items(), words, strict=True):
                if word not in known:
                    raise value.fault(f"expected {what} {' or '.join(known)}, got {word!r}")
            self.words.append(words)
        self.T = _poses(values, "fPart[0]")

    def _descriptors(self, name: str, values: list[Element]) -> None:
        path = name == "mPath"
        for value in values:
            (speed,) = _numbers(value, ("tmax" if path else "vel",))
            free = {"vel": "100"} if path else {"tmax": "99999"}
            zone, corner = 0.0, {"blend": "off"}
            if value.attributes.get("blend") != "off":
                (zone,) = _numbers(value, ("leave",))
                said = value.attributes["leave"]
                corner = {"blend": "Cartesian" if path else "joint", "leave": said, "reach": said}
            value.take(**{**value.attributes, **_BOUNDS, **free, **corner})
            if set(value.attributes) != {*_BOUNDS, *corner, "vel", "tmax"}:
                raise value.fault(f"expected a speed and a corner, got {value.shown()}")
            self.motions[name].append((speed * (1e-3 if path else 1e-2), zone * 1e-3))


_DATA = {
    "fPart": ("frame", Val3Data._frame),
    "tLaser": ("tool", Val3Data._frame),
    **{name: ("dio", Val3Data._output) for name in (*OUTPUTS.values(), *PORTS.values())},
    FIRST: ("num", Val3Data._first),
    "jAir": ("jointRx", Val3Data._air_targets),
    "mAir": ("mdesc", Val3Data._descriptors),
    "pPath": ("pointRx", Val3Data._points),
    "mPath": ("mdesc", Val3Data._descriptors),
}
"""Type of each datum, and how its values are read."""


def _numbers(value: Element, names: tuple[str, ...]) -> list[float]:
    """Return attributes as numbers."""
    found = []
    for name in names:
        text = value.attributes.get(name, "")
        if not _NUMBER.fullmatch(text):
            raise value.fault(f"expected a number as {name}, got {text[:60]!r}")
        found.append(float(text))
    return found


def _poses(values: list[Element], father: str) -> Array:
    """Return poses (K, 4, 4) m of x, y, z in mm and rx, ry, rz in deg, in the frame `father`."""
    rows = np.array([_numbers(value, _POSE) for value in values])
    for value in values:
        if value.attributes.keys() != {*_POSE, "fatherId"}:
            raise value.fault(f"expected a pose, got {value.shown()}")
        if value.attributes["fatherId"] != father:
            raise value.fault(f"expected it in {father}, got {value.attributes['fatherId'][:60]!r}")
    return from_euler(rows, ANGLES)


# -----------------------------------------------------------------------------
# The reader of programs.

_NAME = r"([A-Za-z]\w*)"
_CALL = LinePattern(rf"call (?:{_NAME}:)?{_NAME}\(\)")
_LINES = patterns(
    {
        "linear": r"movel\(pPath\[(\d+)\],tLaser,mPath\[(\d+)\]\)",
        "circular": r"movec\(pPath\[(\d+)\],pPath\[(\d+)\],tLaser,mPath\[(\d+)\]\)",
        "joint": r"movej\(jAir\[(\d+)\],tLaser,mAir\[(\d+)\]\)",
        "stand": r"waitEndMove\(\)",
        "switch": rf"({'|'.join(OUTPUTS.values())})=(true|false)",
        "guarded": r"dioLaser=(d\w+(?: and d\w+)*)",
        "request": r"(do[A-Z]\w*)=(true|false)",
        "wait_for": r"while watch\((di\w+)==true,(\d+\.\d+)\)==false",
        "wait": r"delay\((\d+\.?\d*|\.\d+)\)",
    }
)
_WITHOUT_ANSWER = patterns(
    {
        "off": r"(d\w+)=false",
        "": r'disablePower\(\)|logMsg\("\w+: no answer"\)',
        "pause": r"wait\(isPowered\(\)\)",
        "ask_again": r"(do\w+)=true",
        "wait_again": r"wait\((di\w+)==true\)",
        "end_loop": "endWhile",
    }
)


def read(main: str, files: Mapping[str, str], robot: Robot, settings: Val3Settings) -> ReadProgram:
    """Return the program in projects that `Val3` wrote; see `kerfpath.post.Reader`."""
    top = _Project(main, files, robot, settings)
    projects = {"": top}
    for alias, path in top.libraries.items():
        projects[alias] = _Project(path, files, robot, settings)
        projects[alias].require_same(top)
    sections, called = [], set()
    start = top.routine("start")
    for line, alias, name in top.calls(start):
        if alias not in projects or name not in projects[alias].routines:
            raise start.fault(f"{name} is not a routine of {alias or 'the project'}", line)
        if (alias, name) in called:
            raise start.fault(f"{name} is called twice", line)
        called.add((alias, name))
        sections.append(section_of(name, projects[alias].steps(name)))
    begin = top.data.first
    if begin is None or begin > len(sections):
        raise start.fault(f"{FIRST} must be the number of a contour")
    there = {(alias, name) for alias, project in projects.items() for name in project.routines}
    if idle := there - called:
        raise start.fault(f"{min(idle)[1]} is never called")
    for project in projects.values():
        project.require_stop()
        if project is not top and project.statements(idle_start := project.routine("start")):
            raise idle_start.fault("a library must not do anything when it is started")
    return ReadProgram(
        name=top.name,
        sections=tuple(sections[begin - 1 :]),
        T_flange_tip=faceplate(robot) @ top.data.frames["tLaser"],
        T_base_part=world(robot) @ top.data.frames["fPart"],
    )


class _Project:
    """One project: its files, its data, and its routines."""

    def __init__(
        self, file: str, files: Mapping[str, str], robot: Robot, settings: Val3Settings
    ) -> None:
        self.files, self.robot, self.settings = files, robot, settings
        self.folder = PurePosixPath(file).parent
        self.name = PurePosixPath(file).stem
        root = parse(file, files[file], "Project", PROJECT)
        head, programs, database, libraries = root.only(
            "Parameters", "Programs", "Database", "Libraries"
        )
        size = head.attributes.get("stackSize", "")
        larger = size.isascii() and size.isdecimal() and int(size) > STACK_SIZE
        head.take(**parameters(settings) | ({"stackSize": size} if larger else {}))
        self.programs = self._programs(programs)
        (data,) = database.only("Data")
        data.take(file=f"{self.name}.dtx")
        self.libraries = self._libraries(libraries)
        file = str(self.folder / f"{self.name}.dtx")
        self.data = Val3Data(parse(file, files[file], "Database", DATA), robot, settings)

    def _programs(self, programs: Element) -> list[str]:
        names: list[str] = []
        for row in programs.each("Program"):
            name = row.attributes.get("file", "").removesuffix(".pgx")
            row.take(file=f"{name}.pgx")
            if name in names or not re.fullmatch(_NAME, name, re.ASCII):
                raise row.fault(f"expected the file of another routine, got {row.shown()}")
            names.append(name)
        return names

    @property
    def routines(self) -> list[str]:
        """Names of the routines that start() may call."""
        return [name for name in self.programs if name not in ("start", "stop")]

    def _libraries(self, libraries: Element) -> dict[str, str]:
        found: dict[str, str] = {}
        for row in libraries.each("Library"):
            alias = row.attributes.get("alias", "")
            row.take(alias=alias, path=f"{self.settings.folder}{alias}/{alias}.pjx")
            if alias in found or not re.fullmatch(_NAME, alias, re.ASCII):
                raise row.fault(f"expected another library, got {row.shown()}")
            beside = self.folder.parent if self.folder.name else PurePosixPath("..")
            found[alias] = str(beside / alias / f"{alias}.pjx")
        return found

    def require_same(self, top: _Project) -> None:
        """Check that a library has the frames of the project and no libraries itself."""
        frames = self.data.frames
        same = all(np.array_equal(T, top.data.frames[name]) for name, T in frames.items())
        if not same or self.libraries:
            raise InputError(
                f"{self.folder / self.name}.pjx: expected a library with the tool and the frame of "
                f"{top.name}, and without libraries"
            )

    def routine(self, name: str) -> Element:
        """Return the code of the routine `name`."""
        if name not in self.programs:
            raise InputError(f"{self.folder / self.name}.pjx: {name}.pgx is missing")
        file = str(self.folder / f"{name}.pgx")
        root = parse(file, self.files[file], "Programs", PROGRAM)
        (program,) = root.only("Program")
        program.take(name=name, access="public")
        (code,) = program.only("Code")
        code.take()
        if len(code.quoted) != 1 or code.text.strip(SPACE):
            raise code.fault("expected the code in one <![CDATA[...]]>, and nothing else")
        lines = program_lines(file, code.quoted[0], code.line)
        ends = [line.strip(BLANK) for line in (*lines[:1], *lines[-1:])]
        if code.children or ends != ["begin", "end"]:
            raise code.fault("expected code from begin to end")
        return code

    def statements(self, code: Element) -> list[tuple[int, str]]:
        """Return the lines of a routine that do something, with their numbers."""
        lines = program_lines(code.file, code.quoted[0], code.line)[1:-1]
        harmless = harmless_lines("val3")
        found = statements(lines, "//", code.line + 1)
        return [(number, row) for number, row in found if not harmless.fullmatch(row)]

    def calls(self, start: Element) -> list[tuple[int, str, str]]:
        """Return what start() calls: line, alias of the library or nothing, routine."""
        rows = [(number, compact(row)) for number, row in self.statements(start)]
        begin, end = opening_lines(self.settings), closing_lines()
        count = len(rows) - len(begin) - len(end)
        for number, row in enumerate(begin):
            if [text for _, text in rows[number : number + 1]] != [row]:
                raise start.fault(f"expected {row} before anything else is done")
        if count < 0 or [text for _, text in rows[-len(end) :]] != end:
            raise start.fault(f"expected {' and '.join(end)} at the end of start()")
        found: list[tuple[int, str, str]] = []
        body = rows[len(begin) : -len(end)]
        for k in range(0, len(body), 3):
            line, row = body[k + 1] if k + 1 < len(body) else body[k]
            match = _CALL.fullmatch(row)
            around = [text for _, text in body[k : k + 3 : 2]]
            if match is None or around != [f"if {FIRST}<={len(found) + 1}", "endIf"]:
                raise start.fault(f"not expected here: {row[:60]!r}", line)
            found.append((line, match[1] or "", match[2]))
        return found

    def require_stop(self) -> None:
        """Check that stop() switches everything off."""
        stop = self.routine("stop")
        if [compact(row) for _, row in self.statements(stop)] != stop_lines(self.settings):
            raise stop.fault(f"expected {' and '.join(stop_lines(self.settings))} in stop()")

    def steps(self, name: str) -> list[FlowStep]:
        """Return the steps of a routine."""
        return _Routine(self, self.routine(name)).steps


class _Routine(LineReader):
    """The statements of one routine."""

    language = "val3"

    def __init__(self, project: _Project, code: Element) -> None:
        super().__init__(code.file, project.robot, project.settings, project.statements(code))
        self.data = project.data
        self.stands = False
        for _ in self.rows:
            self.read(self.advance(), _LINES)
        self.line = code.line
        self.require_complete()

    def joint(self, target: str, motion: str) -> None:
        q = self.data.q[self.index("jAir", target, len(self.data.q))]
        self.move("joint", ("jAir", target), ("mAir", motion), q=freeze(q))

    def linear(self, target: str, motion: str) -> None:
        self.path("linear", target, motion)

    def circular(self, via: str, target: str, motion: str) -> None:
        self.path("circular", target, motion, self.pose(via))

    def path(self, kind: MoveKind, target: str, motion: str, via: Array | None = None) -> None:
        said = {"T_part_tip": self.pose(target), "T_part_via": via}
        posture = self.data.words[int(target)]
        self.move(kind, ("pPath", target), ("mPath", motion), posture=posture, **said)

    def pose(self, key: str) -> Array:
        """Return a point (4, 4) m of the data."""
        return freeze(self.data.T[self.index("pPath", key, len(self.data.T))])

    def move(
        self, kind: MoveKind, target: tuple[str, str], motion: tuple[str, str], **said: Any
    ) -> None:
        """Add a move to a target with a speed and a corner, each by the name and key of a datum."""
        name, key = motion
        motions, at = self.data.motions[name], self.data.said_at
        speed, zone = motions[self.index(name, key, len(motions))]
        place = at[name][int(key)]
        elsewhere = {"target": at[target[0]][int(target[1])], "speed": place, "zone": place}
        self.add_move(kind, speed, zone=zone, elsewhere=elsewhere, **said)
        self.stands = False

    def stand(self) -> None:
        last = self.steps[-1] if self.steps else None
        if isinstance(last, ReadMove) and last.zone:
            raise self.fault("the robot must not wait where a corner is to be rounded")
        self.stands = True

    def switch(self, name: str, state: str) -> None:
        last = self.last_on_path()
        if not self.stands or last is None:
            raise self.fault("a switch must follow a move of the path and waitEndMove()")
        if name not in links(self.settings):
            raise self.fault(f"{name} is not declared")
        signal = next(signal for signal, known in OUTPUTS.items() if known == name)
        switch = Switch(signal=SIGNALS[signal], on=state == "true")
        self.add_switch(last, switch, self.place)

    def guarded(self, needed: str) -> None:
        if not self.stands:
            raise self.fault("a switch must follow a move of the path and waitEndMove()")
        self.add_needing(needed.split(" and "))

    def gases(self) -> Mapping[Any, Gas]:
        return {OUTPUTS[gas]: gas for gas in GASES}

    def request(self, name: str, state: str) -> None:
        self.ask(name, on=state == "true")

    def wait_for(self, name: str, timeout: str) -> None:
        awaited = Await(partner=self.partner(name, "input"), timeout=float(timeout))
        self.require_next(wait_lines(awaited, self.asked(), self.settings)[1:], _WITHOUT_ANSWER)
        self.begin_loop()
        self.add_handshake(awaited)
        self.leave_loop_if_on(name)

    def off(self, port: object) -> None:
        signals = {name: SIGNALS[signal] for signal, name in OUTPUTS.items()}
        self.add(ReadOff, output=signals.get(str(port)) or self.partner(port, "output"))

    def partner(self, port: object, way: str) -> Partner:
        if port in links(self.settings):
            for (partner, its_way), known in PORTS.items():
                if (known, its_way) == (port, way):
                    return PARTNERS[partner]
        raise self.fault(f"{port} is not declared")

    def require_stopped(self, what: str) -> None:
        if not self.stands:
            raise self.fault(f"{what} must follow waitEndMove()")

    def index(self, name: str, key: str, count: int) -> int:
        if int(key) >= count:
            raise self.fault(f"{name}[{key}] is not declared")
        return int(key)
