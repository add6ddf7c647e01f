"""Run a program on a controller that is installed here, and judge what it did."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from kerfpath.arrays import Array, Bools, Ints, short_repr
from kerfpath.auditor import Check
from kerfpath.errors import InputError
from kerfpath.execution import on_chords
from kerfpath.job.audit_report import check, count
from kerfpath.job.format import Job, read_job
from kerfpath.job.plan_file import read_plan_file
from kerfpath.job.program_file import in_language_of, program_on_disk
from kerfpath.job.programs import job_of_plans
from kerfpath.post import ReadMove, ReadProgram, ReadWait
from kerfpath.post.linuxcnc import (
    LinuxcncSettings,
    Record,
    Stretch,
    record,
    require_linuxcnc,
    stretches_of,
)
from kerfpath.robots import Robot

CONTROLLERS = ("linuxcnc",)
"""Controllers that programs can be run on."""
TIME_SHARE = 0.03
"""Share by which the time of a run may differ from the model's."""
BEAM = 2e-3
"""Time (s) by which the laser may be switched beside its node: two periods of the controller."""
DIGITS = 0.02
"""Share of an acceleration limit that digits of the record may add: it has 1e-6 deg each ms."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ContourRun:
    """How one contour, from a stop to the next with the laser on, was run.

    Parameters
    ----------
    name : str
    planned, foreseen, time : float s
        In the program, by the model of the controller, and as run.
    off_path : float m
        Largest distance of the tip from the straight lines between the targets.
    """

    name: str
    planned: float
    foreseen: float
    time: float
    off_path: float

    __repr__ = short_repr


@dataclass(frozen=True, slots=True, kw_only=True)
class BeamSwitch:
    """A switch of the laser as run.

    Parameters
    ----------
    place : str
        File and line of the move at whose end it is.
    on : bool
    late : float s
        Time after the tip has passed the target; 0 if it stands there.
    off : float m
        Distance of the tip from the target.
    """

    place: str
    on: bool
    late: float
    off: float

    __repr__ = short_repr


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ControllerRun:
    """A run of a program on a controller, and its checks.

    Parameters
    ----------
    robot : Robot
    record : Record
        What the controller commanded.
    planned, foreseen : float s
        Time of the whole program by its own times, and by the model of the controller.
    contours : tuple of ContourRun
    switches : tuple of BeamSwitch
    off_path : (M,) m
        Distance of the tip from the lines between targets at each sample; NaN in joint moves.
    velocity, acceleration : (M, n)
        Shares of the limits of each joint at each sample.
    checks : tuple of Check
    """

    robot: Robot
    record: Record
    planned: float
    foreseen: float
    contours: tuple[ContourRun, ...]
    switches: tuple[BeamSwitch, ...]
    off_path: Array
    velocity: Array
    acceleration: Array
    checks: tuple[Check, ...]

    __repr__ = short_repr

    @property
    def time(self) -> float:
        """Time of the run, s."""
        return float(self.record.time[-1])


def run_program(path: Path, job_file: Path | None = None, *, on: str = "linuxcnc") -> ControllerRun:
    """Run a program on a controller, and return what it did.

    Parameters
    ----------
    path : Path
        The program, with the files beside it.
    job_file : Path, optional
        Its job; default: that of the plan.json beside the program.
    on : {"linuxcnc"}
        The controller.

    Raises
    ------
    InputError
        The controller is not known or not installed, the program is not for it, has no job, or
        cannot be read, or the controller does not run it to its end.
    """
    if on not in CONTROLLERS:
        raise InputError(f"on: expected {' or '.join(CONTROLLERS)}, got {on!r}")
    require_linuxcnc()
    job = _job(path, job_file)
    if job.program.language != on:
        raise InputError(
            f"{path}: expected a program in the language {on}, got one in {job.program.language}; "
            f"write it with kerfpath post PLAN.json --language {on}"
        )
    settings = job.program.language_settings
    assert isinstance(settings, LinuxcncSettings)
    read = program_on_disk(path, job)
    steps = list(stretches_of(read, job.robot, settings))
    foreseen = sum(step if isinstance(step, float) else step.time for step in steps)
    done = record(path.absolute(), job.robot, settings, longest=2 * foreseen)
    return judge(done, read, [step for step in steps if isinstance(step, Stretch)], job)


def _job(path: Path, job_file: Path | None) -> Job:
    """Return the job of a program, in the language of the program."""
    if job_file is not None:
        return in_language_of(path, read_job(job_file))
    plan = path.parent / "plan.json"
    if not plan.is_file():
        raise InputError(
            f"{path}: a program is run with its job, but there is no plan.json beside it; give the "
            "job with --job JOB.toml"
        )
    file = read_plan_file(plan)
    return in_language_of(path, job_of_plans(file, file.program(path.stem)))


def judge(done: Record, read: ReadProgram, stretches: Sequence[Stretch], job: Job) -> ControllerRun:
    """Return a run with its checks.

    Parameters
    ----------
    done : Record
    read : ReadProgram
        The program.
    stretches : sequence of Stretch
        Its moves as foreseen, from `stretches_of`.
    job : Job
    """
    velocity, acceleration = _shares(done, job.robot)
    off_path = np.full(len(done.time), np.nan)
    contours = []
    for stretch in stretches:
        found = _along(done, stretch)
        if not len(found) or stretch.moves[0].kind == "joint":
            continue
        off_path[found] = _distances(job, done.q[found], stretch.q)
        # A way to a contour ends with the laser switched on, as near as that may be to its node.
        lit = found[done.laser[found]]
        if len(lit) and done.time[lit[-1]] - done.time[lit[0]] > BEAM:
            contours.append(
                ContourRun(
                    name=_contour_of(read, stretch.moves[0]),
                    planned=float(stretch.asked.sum()),
                    foreseen=stretch.time,
                    time=float(done.time[found[-1]] - done.time[found[0]]),
                    off_path=float(off_path[found].max()),
                )
            )
    waits = sum(step.time for step in read.steps if isinstance(step, ReadWait))
    planned = [move.duration or 0.0 for stretch in stretches for move in stretch.moves]
    foreseen = waits + sum(stretch.time for stretch in stretches)
    switches, missing = _switches(done, read, job)
    return ControllerRun(
        robot=job.robot,
        record=done,
        planned=waits + sum(planned),
        foreseen=foreseen,
        contours=tuple(contours),
        switches=switches,
        off_path=off_path,
        velocity=velocity,
        acceleration=acceleration,
        checks=tuple(
            _checks(
                time=abs(float(done.time[-1]) / foreseen - 1),
                off_path=max((each.off_path for each in contours), default=0.0),
                most_off=job.tolerances.path,
                velocity=float(velocity.max()),
                acceleration=float(acceleration.max()),
                late=max((abs(each.late) for each in switches), default=0.0),
                missing=missing,
            )
        ),
    )


def _checks(
    *, time: float, off_path: float, most_off: float, velocity: float, acceleration: float,
    late: float, missing: int,
) -> Iterator[Check]:  # fmt: skip
    yield count("beam", "switches of the laser that are missing or too many", missing)
    rows = (
        check("beam-late", "laser beside its node, before or after", late, BEAM, "s"),
        check("time", "time beside the model of the controller", time, TIME_SHARE, "share"),
        check("path", "tip from the lines between targets, laser on", off_path, most_off, "m"),
        check("velocity", "velocity of a joint", velocity, 1 + 1e-3, "share"),
        check("acceleration", "acceleration of a joint", acceleration, 1 + DIGITS, "share"),
    )
    yield from (replace(row, level="warning") for row in rows)


def _shares(done: Record, robot: Robot) -> tuple[Array, Array]:
    """Return the shares of the limits of velocity and acceleration, (M, n) each."""
    period = float(np.diff(done.time).mean())
    dq = np.diff(done.q, axis=0, prepend=done.q[:1], append=done.q[-1:]) / period
    velocity, acceleration = robot.velocity_limits(), robot.acceleration_at(done.q)
    return np.abs(dq[:-1]) / velocity, np.abs(np.diff(dq, axis=0)) / period / acceleration


def _along(done: Record, stretch: Stretch) -> Ints:
    """Return the samples of a stretch, from its first line to its last."""
    if not stretch.moves:
        return np.zeros(0, np.int64)
    first, last = stretch.moves[0].line, stretch.moves[-1].line
    return np.flatnonzero((done.line >= first) & (done.line <= last))


def _contour_of(read: ReadProgram, move: ReadMove) -> str:
    """Return the name of the contour that a move belongs to."""
    return next(s.name for s in read.sections if any(m is move for m in s.moves))


def _tips(job: Job, q: Array) -> Array:
    """Return the tips (M, 3) m of joints (M, n)."""
    return np.asarray((job.robot.forward(q) @ job.tool)[:, :3, 3])


def _distances(job: Job, q: Array, targets: Array) -> Array:
    """Return the distances (M,) m of tips from the straight lines between targets (m+1, n).

    They are taken to the line of the nearest target and to those before and after it.
    """
    tips, ends = _tips(job, q), _tips(job, targets)
    # The path never goes back, so that the nearest target lies near the one before it.
    nearest, at = np.empty(len(tips), np.int64), 0
    for k, tip in enumerate(tips):
        ahead = ends[at : at + 4]
        at += int(np.argmin(np.linalg.norm(ahead - tip, axis=1)))
        nearest[k] = at
    first = np.clip(nearest[:, None] + [-1, 0], 0, len(ends) - 2)
    return np.asarray(on_chords(tips[:, None], ends[first], ends[first + 1])[1].min(axis=1))


def _switches(done: Record, read: ReadProgram, job: Job) -> tuple[tuple[BeamSwitch, ...], int]:
    """Return the switches of the laser as run, and how many are missing or too many."""
    said = [
        (move, switch.on)
        for move in read.moves
        for switch in move.switches
        if switch.signal == "laser"
    ]
    edges = np.flatnonzero(_changes(done.laser)).tolist()
    found: list[BeamSwitch] = []
    for (move, on), edge in zip(said, edges, strict=False):
        passed = np.flatnonzero(done.line == move.line)
        if not len(passed) or bool(done.laser[edge]) != on or move.q is None:
            return tuple(found), abs(len(said) - len(edges)) + 1
        target, tip = _tips(job, np.array([move.q, done.q[edge]]))
        stands = np.array_equal(done.q[edge], done.q[edge - 1])
        late = 0.0 if stands else float(done.time[edge] - done.time[passed[-1] + 1])
        off = float(np.linalg.norm(tip - target))
        found.append(BeamSwitch(place=move.place, on=on, late=late, off=off))
    return tuple(found), abs(len(said) - len(edges))


def _changes(on: Bools) -> Bools:
    """Return at which samples (M,) an output has another state than before."""
    return np.asarray(np.diff(on, prepend=on[:1]).astype(bool))
