"""Read programs on disk: their motions, the differences between two, and the process sheet."""

from __future__ import annotations

import re
from codecs import BOM_UTF8, BOM_UTF16_BE, BOM_UTF16_LE
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from kerfpath.arrays import Array, Bools, Ints, short_repr
from kerfpath.auditor import Check
from kerfpath.errors import InputError
from kerfpath.execution import ToolMotion
from kerfpath.job.audit_report import count
from kerfpath.job.format import TITLE, Job, ProgramTable, read_job
from kerfpath.post import (
    Difference,
    ReadGroup,
    ReadMove,
    ReadProgram,
    Rules,
    differences,
    groups_of,
    languages,
    not_compared,
    read_program,
    require_one_set,
    with_tips,
)
from kerfpath.robots import Robot, base_in_part

# -----------------------------------------------------------------------------
# Read programs on disk: the motions that a text means.

ARC_STEP = np.radians(2.0)
"""Sweep between nodes on an arc, rad, if its contour is not known."""
COARSEST = np.radians(45.0)
"""Largest sweep between nodes on an arc, rad, if its contour is known."""


class TextFolder(Mapping[str, str]):
    """The text files of a folder by name, read when they are asked for.

    Parameters
    ----------
    folder : Path
    encodings : sequence of str
        Encodings in the order in which they are tried, as those of a `Language`.
    """

    def __init__(self, folder: Path, encodings: Sequence[str]) -> None:
        self.folder, self.encodings = folder, encodings
        self.marked: list[str] = []
        """Names of the files that were read and begin with a byte order mark."""

    def __getitem__(self, name: str) -> str:
        path = self.folder / name
        if not path.is_file():
            path = self.folder / self._spelled(name)
        try:
            data = path.read_bytes()
        except OSError as error:
            why = " ".join(str(error).split())
            raise InputError(f"{path}: cannot be read ({why})") from None
        if data.startswith((BOM_UTF16_LE, BOM_UTF16_BE)) or 0 in data[:2]:
            raise InputError(f"{path}: expected {self._names}, got UTF-16; save it as UTF-8")
        if data.startswith(BOM_UTF8):
            self.marked.append(path.name)
        for encoding in self.encodings:
            try:
                return data.decode(encoding)
            except UnicodeDecodeError:
                continue
        raise InputError(f"{path}: expected text in {self._names}; write it again")

    @property
    def _names(self) -> str:
        return " or ".join(name.removesuffix("-sig") for name in self.encodings)

    def _spelled(self, name: str) -> str:
        """Return the name of the one file whose name differs in its case alone."""
        alike = [each for each in self if each.isascii() and each.lower() == name.lower()]
        if len(alike) != 1:
            raise KeyError(name)
        return alike[0]

    def __iter__(self) -> Iterator[str]:
        return (path.name for path in self.folder.iterdir())

    def __len__(self) -> int:
        return sum(1 for _ in self.folder.iterdir())


def in_language_of(path: Path, job: Job) -> Job:
    """Return a job with [program] in the language of a program, by the suffix of its file.

    Raises
    ------
    InputError
        No language writes files with this suffix.
    """
    known = languages()
    fitting = [each for each in known.values() if each.suffix.lower() == path.suffix.lower()]
    own = [each for each in fitting if each.name == job.program.language]
    if not fitting:
        suffixes = ", ".join(sorted(each.suffix for each in known.values()))
        raise InputError(f"{path}: expected a program ({suffixes}) or a plan.json")
    chosen = (own or fitting)[0]
    table = {**job.source.get("program", {}), "language": chosen.name}
    settings = ProgramTable.model_validate(table).settings()
    return replace(job, program=replace(job.program, language=chosen.name, settings=settings))


def program_on_disk(path: Path, job: Job) -> ReadProgram:
    """Return the program whose main file is at `path`, in the language of the job.

    Raises
    ------
    InputError
        The file cannot be read, or was not written by kerfpath; the message names the line. Files
        beside it are left of an earlier run.
    """
    if not path.is_file():
        raise InputError(f"{path}: no such file; give the path of a program or a plan.json")
    require_one_set(path)
    options = job.program
    chosen = options.robot_language
    files = TextFolder(path.parent, chosen.encodings)
    read = read_program(files, options.language, job.robot, options.settings, main=path.name)
    return read if chosen.byte_order_mark else replace(read, marked=tuple(files.marked))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ReadCut:
    """One cut of a program, between the approach and the retract.

    Parameters
    ----------
    name : str
        Name of the routine in which it begins.
    approach : (m, n) rad
        Corners of the joint moves to it.
    q : (K, n) rad
        Joints at its nodes, on the branch that the joint moves lead to; NaN out of reach.
    T_part_tip : (K, 4, 4) m
        Tip poses at its nodes.
    took : (K-1,) s
        Duration of each stretch along its chord, or as the text states it.
    speed : (K-1,) m/s
        Speed along each stretch; NaN if the text states times.
    laser : (K-1,) bool
        Whether the laser is on along each stretch.
    left_on : bool
        Whether it is on while the tool backs off.
    lead_times : (s,) s
        Lead times of the switches of the laser.
    waits : (w,) s
        Waits at its first node.
    q_out : (n,) rad
        Joints after the retract.
    moves : tuple of ReadMove
        The move to each node.
    ends : (m,) int
        The node of each target of the text; an arc has more nodes between.
    group : ReadGroup
        The steps that it was made from.
    """

    name: str
    approach: Array
    q: Array
    T_part_tip: Array
    took: Array
    speed: Array
    laser: Bools
    left_on: bool
    lead_times: Array
    waits: Array
    q_out: Array
    moves: tuple[ReadMove, ...]
    ends: Ints
    group: ReadGroup

    __repr__ = short_repr

    @property
    def targets(self) -> tuple[ReadMove, ...]:
        """The moves to its first node and on, each once."""
        return tuple(self.moves[k] for k in self.ends)


def add_tips(read: ReadProgram, job: Job) -> ReadProgram:
    """Return a program with the tip poses of its joints, by the job's robot, tool and part."""
    return with_tips(read, job.robot, job.tool, job.placement)


def read_cuts(read: ReadProgram, job: Job) -> tuple[list[ReadCut], Array]:
    """Return the cuts of a program in order, and the corners (m, n) rad of the way home.

    Raises
    ------
    InputError
        The order of the moves makes no cut; the message names the place.
    """
    groups = groups_of(add_tips(read, job))
    home = np.zeros((0, job.robot.joints))
    if groups and not groups[-1].path:
        home = np.array([move.q for move in groups.pop().joint])
    cuts = []
    for group in groups:
        if not group.joint:
            raise InputError(f"{group.path[0].place}: expected a joint move before the path")
        if len(group.path) < 4:
            raise InputError(
                f"{group.path[-1].place}: expected an approach, a cut and a retract, got "
                f"{len(group.path)} moves"
            )
        cuts.append(_cut(group, job))
    return cuts, home


def divide_arcs(cut: ReadCut, interval: float, job: Job) -> ReadCut:
    """Return a cut whose arcs have a node at each interval (s), as straight moves would have.

    Rates along arcs and at their ends are then checked over the same times as all others.
    """
    if all(move.kind != "circular" for move in cut.moves):
        return cut
    return _cut(cut.group, job, interval)


def _cut(group: ReadGroup, job: Job, interval: float | None = None) -> ReadCut:
    """Return the cut of a group; an arc gets nodes along it."""
    T: list[Array] = []
    took: list[float] = []
    moves: list[ReadMove] = []
    ends: list[int] = []
    on: list[bool] = []
    laser = False
    for move in group.path:
        end = move.T_part_tip
        assert end is not None
        stops = [end]
        if move.kind == "circular" and job.robot.free.size:
            raise InputError(f"{move.place}: kerfpath writes no arcs with {job.robot.free_names}")
        if T and move.kind == "circular" and move.T_part_via is not None:
            stops = _arc(T[-1], move.T_part_via, end, move, interval)
        for stop in stops:
            if T:
                took.append(_duration(move, T[-1], stop, len(stops)))
                on.append(laser)
            T.append(np.asarray(stop))
            moves.append(move)
        ends.append(len(T) - 1)
        for switch in move.switches:
            laser = switch.on if switch.signal == "laser" else laser
    poses = np.array(T)
    flange = job.placement @ poses @ np.linalg.inv(job.tool)
    free = np.array([_free(move, job.robot) for move in moves])
    q = follow_poses(job.robot, flange, _q(group.joint[-1]), free)
    last = len(poses) - 1
    switches = [s for move in group.path for s in move.switches if s.signal == "laser"]
    return ReadCut(
        name=group.name,
        approach=np.array([_q(move) for move in group.joint]),
        q=q[:last],
        T_part_tip=poses[:last],
        took=np.array(took[: last - 1]),
        speed=np.array([_speed(move) for move in moves[1:last]]),
        laser=np.array(on[: last - 1], dtype=bool),
        left_on=on[last - 1],
        lead_times=np.array([switch.lead_time for switch in switches]),
        waits=np.array([wait.time for at, wait in group.waits if at == 1]),
        q_out=q[last],
        moves=tuple(moves[:last]),
        ends=np.array(ends[:-1]),
        group=group,
    )


def _duration(move: ReadMove, start: Array, end: Array, parts: int) -> float:
    """Return the duration (s) of a move, or of one of its parts."""
    if move.duration is not None:
        return move.duration / parts
    if not move.speed:
        raise InputError(f"{move.place}: expected a speed or a time of the move, got neither")
    return float(np.linalg.norm(end[:3, 3] - start[:3, 3])) / move.speed


def _speed(move: ReadMove) -> float:
    return np.nan if move.speed is None or move.duration is not None else move.speed


def _q(move: ReadMove) -> Array:
    if move.q is None:
        raise InputError(f"{move.place}: expected the joints of a joint move, got none")
    return move.q


def _free(move: ReadMove, robot: Robot) -> Array:
    """Return the values (E,) rad and m of the free joints at the target of a move."""
    if not robot.free.size:
        return np.zeros(0)
    if move.q is not None:
        return move.q[robot.free]
    if move.external is None or robot.family.given is not None:
        free = robot.joint_names[robot.free[0]]
        raise InputError(f"{move.place}: expected a value of {free}, got none")
    return move.external


def _arc(
    start: Array, via: Array, end: Array, move: ReadMove, interval: float | None
) -> list[Array]:
    """Return poses along the arc after `start`, with its end; the tool turns evenly.

    They are `ARC_STEP` apart, or as far as the robot moves in an interval (s), at most `COARSEST`.
    """
    arc = ToolMotion.through(np.array([start, end]), [via])
    sweep = float(arc.sweep[0])
    if sweep == 0:
        return [via, end]  # on one line
    count = int(np.ceil(sweep / ARC_STEP))
    if interval is not None:
        took = move.duration
        if took is None and move.speed:
            took = float(arc.lengths[0]) / move.speed
        if took is not None:
            count = max(round(took / interval), int(np.ceil(sweep / COARSEST)))
    return list(arc.poses(np.linspace(0, 1, max(count, 1) + 1)[1:]))


def branch_of(robot: Robot, q: Array) -> int:
    """Return the posture of joints (n,); external axes have no effect on it."""
    arm, q = robot.arm, q[: robot.arm.joints]
    solved, reach = arm.inverse_all(arm.forward(q)[None], arm.given_of(q[None]))
    apart = np.abs((solved[0] - q + np.pi) % (2 * np.pi) - np.pi).max(axis=1)
    return int(np.argmin(np.where(reach[0], apart, np.inf)))


def follow_poses(robot: Robot, T: Array, q0: Array, free: Array | None = None) -> Array:
    """Return joints (K, n) at flange poses T (K, 4, 4), on the branch of q0; NaN out of reach.

    `free` (K, E) rad and m has the joints that a pose leaves free: one of a seven-axis arm, and
    external axes.
    """
    if free is not None and robot.externals:
        # The poses that the arm alone sees, after external axes have moved base and part.
        inner, external = np.split(free, [len(robot.free) - len(robot.externals)], axis=1)
        seen = np.linalg.inv(base_in_part(robot.externals, external)) @ T
        q = follow_poses(robot.alone(), seen, q0[: robot.family.joints], inner)
        return np.hstack([q, external])
    posture = branch_of(robot, q0)
    if robot.family.follow_all is None:
        near = np.tile(q0, (len(T), 1))
        if free is not None:
            near[:, robot.free] = free
        q = robot.arm.follow(T, near, np.full(len(T), posture))
        good = ~np.isnan(q).any(axis=1)
        q[good] = np.unwrap(np.vstack([q0, q[good]]), axis=0)[1:]
        return q
    q, branch = np.empty((len(T), robot.joints)), np.array([posture])
    before = q0
    for k, pose in enumerate(T):
        q[k] = robot.arm.follow(pose[None], before[None], branch)[0]
        before = before if np.isnan(q[k]).any() else q[k]
    return q


# -----------------------------------------------------------------------------
# Compare two programs on disk.


@dataclass(frozen=True, slots=True, kw_only=True)
class ProgramComparison:
    """What differs between two programs, and what could not be compared.

    Parameters
    ----------
    differences : tuple of Difference
        Empty if the programs are the same.
    not_compared : tuple of str
        What only one of them states.
    """

    differences: tuple[Difference, ...]
    not_compared: tuple[str, ...]

    __repr__ = short_repr


def compare_programs(a: Path, b: Path, job_file: Path) -> ProgramComparison:
    """Return what differs between two programs of a job, in the same language or in two.

    Parameters
    ----------
    a, b : Path
        The main files of the programs.
    job_file : Path
        The job that they were made for, with robot, frames and settings of languages.

    Raises
    ------
    InputError
        A file cannot be read, or a line was not written by kerfpath.
    """
    job = read_job(job_file)
    one, two = in_language_of(a, job), in_language_of(b, job)
    reads = [add_tips(program_on_disk(path, of), of) for path, of in ((a, one), (b, two))]
    rules: tuple[Rules, ...] = ()
    said = any(move.posture for read in reads for move in read.moves)
    # Words for postures have another meaning in another language.
    if one.program.language != two.program.language:
        rules = (one.program.rules, two.program.rules)
        reads = [_without_postures(read) for read in reads]
    found, left = differences(*reads, rules=rules), not_compared(*reads)
    left += ["postures"] if said and rules else []
    return ProgramComparison(differences=tuple(found), not_compared=tuple(left))


def _without_postures(read: ReadProgram) -> ReadProgram:
    sections = [
        replace(
            section,
            steps=tuple(
                replace(step, posture=()) if isinstance(step, ReadMove) else step
                for step in section.steps
            ),
        )
        for section in read.sections
    ]
    return replace(read, sections=tuple(sections))


# -----------------------------------------------------------------------------
# The process sheet at the head of a program, which says what the operator sets.

MISSING = (
    "The program has no process sheet: kerfpath charts show --job JOB.toml shows what to set by "
    "hand."
)
"""The note on a program without one."""
BESIDE = {".pjx": "start.pgx"}
"""File with the sheet, by the suffix of the main file, where that has none."""
_REMARK = re.compile(r"[\s\d:;'!#/|]*([-+] .*?)[\s;]*")


def check_sheet(file: Path, expected: Sequence[str]) -> tuple[list[Check], str]:
    """Return the check that a program has the sheet of its job, and a note if it has none.

    The node of the check is the line of the file at which the sheet begins.

    Comments may be removed, but a sheet that differs would have the operator set other values.

    Parameters
    ----------
    file : Path
        The main file of the program.
    expected : sequence of str
        The lines of the sheet of the job; empty without [process].
    """
    found, begins = _sheet(with_sheet(file))
    if not found:
        return [], MISSING if expected else ""
    wanted = [_bare(line) for line in expected]
    wrong = [line for line in found if line not in wanted]
    lacking = [line for line in wanted if line not in found]
    faults = len(wrong) + len(lacking) or int(found != wanted)
    example = (wrong or lacking or [""])[0]
    said = "lines of the process sheet that differ from the job" + (f": {example}" * bool(faults))
    return [count("sheet", said, faults, begins)], ""


def with_sheet(file: Path) -> Path:
    """Return the file of a program that has its sheet."""
    return file.with_name(BESIDE.get(file.suffix.lower(), file.name))


def _sheet(file: Path) -> tuple[list[str], int]:
    """Return the lines of the sheet in a file, as far as every language writes them alike.

    Also the number of the first of them, from 1.
    """
    try:
        lines = file.read_bytes().decode("latin-1").splitlines()
    except OSError:
        return [], 0
    found: list[str] = []
    begins = 0
    for number, line in enumerate(lines, 1):
        remark = _REMARK.fullmatch(line)
        bare = "" if remark is None else _bare(remark[1])
        if found and not bare:
            break
        if found or bare == _bare(f"- {TITLE}"):
            found.append(bare)
            begins = begins or number
    return found, begins


def _bare(line: str) -> str:
    """Return a line without the characters that languages change in remarks."""
    return re.sub(r"[;,\]>\s]+", " ", line).strip()
