"""Read back the projects that `Val3` writes; anything else is refused."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import PurePosixPath
from typing import Any

import numpy as np

from kerfpath._arrays import Array, freeze
from kerfpath.errors import InputError
from kerfpath.post._frames import faceplate, world
from kerfpath.post._line_reader import LineReader, patterns, program_lines, statements
from kerfpath.post._program import PARTNERS, Partner, Switch
from kerfpath.post._read import MoveKind, ReadMove, ReadProgram, ReadSection, ReadStep
from kerfpath.post.val3._read_data import Val3Data
from kerfpath.post.val3._settings import Val3Settings
from kerfpath.post.val3._write import (
    DATA,
    FIRST,
    PORTS,
    PROGRAM,
    PROJECT,
    closing_lines,
    links,
    opening_lines,
    parameters,
    stop_lines,
    wait_lines,
)
from kerfpath.post.val3._xml import Element, parse
from kerfpath.robots import Robot

__all__ = ["read"]

_NAME = r"([A-Za-z]\w*)"
_CALL = re.compile(rf"call (?:{_NAME}:)?{_NAME}\(\)", re.ASCII)
_LINES = patterns(
    {
        "linear": r"movel\(pPath\[(\d+)\],tLaser,mPath\[(\d+)\]\)",
        "circular": r"movec\(pPath\[(\d+)\],pPath\[(\d+)\],tLaser,mPath\[(\d+)\]\)",
        "joint": r"movej\(jAir\[(\d+)\],tLaser,mAir\[(\d+)\]\)",
        "stand": r"waitEndMove\(\)",
        "switch": r"(dioLaser|dioGas)=(true|false)",
        "request": r"(do[A-Z]\w*)=(true|false)",
        "wait_for": r"if watch\((di\w+)==true,(\d+\.\d+)\)==false",
        "wait": r"delay\((\d+\.\d+)\)",
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
        sections.append(ReadSection(name=name, steps=projects[alias].steps(name)))
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
        head.take(**parameters(settings))
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
        lines = program_lines(file, code.text, code.line)  # XML may spell out any character
        ends = [line.strip() for line in (*lines[:1], *lines[-1:])]
        if code.children or ends != ["begin", "end"]:
            raise code.fault("expected code from begin to end")
        return code

    def statements(self, code: Element) -> list[tuple[int, str]]:
        """Return the lines of a routine without comments, with their numbers."""
        return statements(program_lines(code.file, code.text, code.line)[1:-1], "//", code.line + 1)

    def calls(self, start: Element) -> list[tuple[int, str, str]]:
        """Return what start() calls: line, alias of the library or nothing, routine."""
        rows = self.statements(start)
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
        if [row for _, row in self.statements(stop)] != stop_lines(self.settings):
            raise stop.fault(f"expected {' and '.join(stop_lines(self.settings))} in stop()")

    def steps(self, name: str) -> tuple[ReadStep, ...]:
        """Return the steps of a routine."""
        return tuple(_Routine(self, self.routine(name)).steps)


class _Routine(LineReader):
    """The statements of one routine."""

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
        switch = Switch(signal="laser" if name == "dioLaser" else "gas", on=state == "true")
        self.add_switch(last, switch, self.place)

    def request(self, name: str, state: str) -> None:
        self.ask(name, on=state == "true")

    def wait_for(self, name: str, timeout: str) -> None:
        partner = self.partner(name, "input")
        self.required = wait_lines(partner, float(timeout), self.settings)[1:]
        self.expect_answer(name, float(timeout))

    def partner(self, port: object, way: str) -> Partner:
        if port in links(self.settings):
            for (partner, its_way), known in PORTS.items():
                if (known, its_way) == (port, way):
                    return PARTNERS[partner]
        raise self.fault(f"{port} is not declared")

    def require_standing(self, what: str) -> None:
        if not self.stands:
            raise self.fault(f"{what} must follow waitEndMove()")

    def index(self, name: str, key: str, count: int) -> int:
        if int(key) >= count:
            raise self.fault(f"{name}[{key}] is not declared")
        return int(key)
