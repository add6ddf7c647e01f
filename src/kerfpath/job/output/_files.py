"""Write the files of a run: plan.json, trajectory.csv, report.html and the program."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from kerfpath._arrays import Array
from kerfpath._repr import short_repr
from kerfpath.errors import AuditFailed, InputError
from kerfpath.job.format import Job, ProgramOptions, refusal_at
from kerfpath.job.output._report import report_text
from kerfpath.job.plan_file import (
    ContourData,
    broken_entry,
    collision_note,
    plan_document,
    plan_entry,
    plan_text,
)
from kerfpath.job.programs import audit_of_cuts, program_of
from kerfpath.job.run import JobResult
from kerfpath.plans import Plan, joint_columns
from kerfpath.post import language, replace_program
from kerfpath.sequence import PartPlan
from kerfpath.transfer import TransferMove

__all__ = [
    "FileTexts",
    "WrittenFiles",
    "make_folder",
    "plan_file_text",
    "program_texts",
    "require_folder",
    "require_language",
    "result_texts",
    "stale_program",
    "trajectory_text",
    "write_result",
]

SHORT_PIECE = 0.02
"""Length in m below which a piece has hardly room for its leads, so that a note warns of it."""
SHORTEST_CUT = 8
"""Least number of characters to which a language cuts names."""


@dataclass(frozen=True, slots=True, kw_only=True)
class WrittenFiles:
    """The written files of a run, and notes for their reader.

    Parameters
    ----------
    files : tuple of Path
        Written files, in this order.
    removed : tuple of Path
        Removed files of the program of an earlier run.
    stale : Path or None
        A file of an earlier program that was edited or is of unknown origin, and so was kept.
    notes : tuple of str
        Warnings of the program's preflight, and what was not checked.
    faults : tuple of str
        Why nothing must be cut, although every contour is planned.
    """

    files: tuple[Path, ...]
    removed: tuple[Path, ...]
    stale: Path | None
    notes: tuple[str, ...]
    faults: tuple[str, ...] = ()

    __repr__ = short_repr


@dataclass(frozen=True, slots=True, kw_only=True)
class FileTexts:
    """The files of a run as text, not written yet.

    Parameters
    ----------
    files : dict of str to str
        Texts by the names of the files, those of the program first.
    program : tuple of str
        Names of the files of the program, the one that is started first; empty without a program.
    refused : str
        Why there is no program, although every plan has passed; empty otherwise.
    unsafe : bool
        Whether the reason is that the text of the program fails its audit.
    notes : tuple of str
        Warnings of the program's preflight, and what was not checked.
    faults : tuple of str
        Why nothing must be cut, although every contour is planned.
    """

    files: dict[str, str]
    program: tuple[str, ...]
    refused: str
    unsafe: bool
    notes: tuple[str, ...]
    faults: tuple[str, ...] = ()

    __repr__ = short_repr


def write_result(outcome: JobResult, folder: Path, *, strict: bool = False) -> WrittenFiles:
    """Write the files of a run into `folder`; the program only if every audit has passed.

    Raises
    ------
    InputError
        The folder cannot be made or written to; or the program is refused (the other files are
        written).
    AuditFailed
        The program fails its audit; the other files are written.
    """
    texts = result_texts(outcome, strict=strict)
    make_folder(folder)
    replaced = replace_program(folder, texts.files, texts.program)
    if texts.refused:
        said = f"{texts.refused} ({folder / 'plan.json'} and the report are written)"
        raise AuditFailed(said) if texts.unsafe else InputError(said)
    stale = stale_program(outcome.job.program, folder, texts.program)
    return WrittenFiles(
        files=replaced.written,
        removed=replaced.removed,
        stale=next(iter(replaced.edited), stale),
        notes=texts.notes,
        faults=texts.faults,
    )


def result_texts(outcome: JobResult, *, strict: bool = False) -> FileTexts:
    """Return the files of a run as text; the program only if every audit has passed."""
    made = program_texts(outcome, strict=strict)
    files = {
        **made.files,
        "plan.json": plan_file_text(outcome),
        "trajectory.csv": trajectory_text(outcome.plans, outcome.moves),
        "report.html": report_text(outcome, made.notes, made.faults),
    }
    return replace(made, files=files)


def program_texts(outcome: JobResult, *, strict: bool = False) -> FileTexts:
    """Return the files of a run's program alone, none unless every audit has passed."""
    job, part, moves = outcome.job, outcome.part, outcome.moves
    program: dict[str, str] = {}
    refused, unsafe = "", False
    notes = [collision_note(outcome.cell, moves_too=bool(moves))]
    notes += [] if part is None else [order_note(part)]
    notes += closer_sampling(outcome) + short_pieces(outcome)
    faults = [] if outcome.stuck is None else [f"The moves between contours: {outcome.stuck}"]
    faults += [f"The moves between contours: {c.issue()}" for c in outcome.air if not c.ok]
    if outcome.passed and job.program.language != "none":
        try:
            audit = audit_of_cuts(job, outcome.cuts, outcome.cell)
            program, warnings = program_of(
                outcome.plans, job.program, moves, audit=audit, strict=strict
            )
            notes += warnings
        except (InputError, AuditFailed) as error:
            refused, unsafe = str(error), isinstance(error, AuditFailed)
            faults.append(refused if unsafe else f"no program was written: {error}")
    return FileTexts(
        files=program, program=tuple(program), refused=refused, unsafe=unsafe,
        notes=tuple(notes), faults=tuple(faults),
    )  # fmt: skip


def plan_file_text(outcome: JobResult) -> str:
    """Return the text of the plan.json of a run."""
    job = outcome.job
    entries: list[ContourData] = []
    for cut in outcome.cuts:
        if cut.plan is not None:
            asked = cut.plan.settings.certify
            shown = asked is not None and asked.keep
            entries.append(
                plan_entry(cut.plan, cut.contour, cut.checks, picked=cut.picked, certificate=shown)
            )
        elif cut.broken is not None:
            entries.append(broken_entry(cut.name, cut.broken, cut.fastest))
    return plan_text(
        plan_document(
            job.robot, job.tool, job.placement, entries, job.source, outcome.cell, outcome.part
        )
    )


def stale_program(options: ProgramOptions, folder: Path, program: Sequence[str]) -> Path | None:
    """Return a program with the job's name in a folder that is not one of the files `program`."""
    written = [folder / name for name in program]
    return next((path for path in _programs(options, folder) if path not in written), None)


def _programs(options: ProgramOptions, folder: Path) -> list[Path]:
    """Return the programs with a job's name in a folder or in a subfolder of it.

    Languages cut names or write them in capitals.
    """
    if options.language == "none":
        return []
    name, suffix = options.name.lower(), language(options.language).suffix
    there = sorted([*folder.glob(f"*{suffix}"), *folder.glob(f"*/*{suffix}")])
    shortest = min(len(name), SHORTEST_CUT)
    return [p for p in there if name.startswith(p.stem.lower()) and len(p.stem) >= shortest]


def order_note(part: PartPlan) -> str:
    """Return the note on the cycle time, and on what is proved about the order."""
    order = part.order
    proved = (
        "no order takes less"
        if order.optimal
        else f"an order of {order.at_least:.1f} s is not ruled out"
    )
    return (
        f"Cycle time {part.cycle_time:.1f} s: cutting {part.cutting_time:.1f} s, air "
        f"{part.air_time:.1f} s, piercing {part.piercing_time:.1f} s; with these candidates and "
        f"moves {proved}."
    )


def closer_sampling(outcome: JobResult) -> list[str]:
    """Return the notes on contours whose nodes are closer together than the job says."""
    found = {cut.contour: cut.request.closer for cut in outcome.cuts}
    return [f"{name}: {words}" for name, words in found.items() if words]


def short_pieces(outcome: JobResult) -> list[str]:
    """Return the notes on short pieces of contours, unless the job sets least_piece_mm."""
    if outcome.job.options.least_piece is not None:
        return []
    lengths: dict[str, list[float]] = {}
    for cut in outcome.cuts:
        if cut.plan is not None:
            lengths.setdefault(cut.contour, []).append(float(np.ptp(cut.plan.contour.s)))
    return [
        f"{name}: the shortest of its {len(pieces)} pieces is {min(pieces) * 1e3:.1f} mm; set "
        "least_piece_mm in [plan] to avoid short pieces"
        for name, pieces in lengths.items()
        if len(pieces) > 1 and min(pieces) < SHORT_PIECE
    ]


def require_folder(folder: Path) -> None:
    """Require that a path is a folder or can become one, before any work is done.

    Raises
    ------
    InputError
        The path or one of its parents is a file.
    """
    for place in (folder, *folder.parents):
        if place.is_dir():
            return
        if place.exists():
            raise InputError(f"{folder}: expected a folder, but {place} is a file; name another")


def make_folder(folder: Path) -> None:
    """Make a folder for the files, unless it is there.

    Raises
    ------
    InputError
        As `require_folder`; it cannot be made.
    """
    require_folder(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: cannot make this folder ({error.strerror})") from None


def require_language(job: Job) -> None:
    """Require that the job's robot can run programs in its language, before any work is done.

    Raises
    ------
    InputError
        At the language in the job.
    """
    if job.program.language == "none":
        return
    if refusal := language(job.program.language).refusal(job.robot):
        raise refusal_at(
            job.path,
            ("program", "language"),
            f'{refusal}; write language = "none" in [program] to plan without a program',
        )


def trajectory_text(plans: Sequence[Plan], moves: Sequence[TransferMove] = ()) -> str:
    """Return the text of trajectory.csv: one row per node, in mm and degrees, base frame.

    External axes follow the arm's joints, with their names and units. Points and axes of the tool
    are given for part and base with every external axis at zero.

    Transfer moves are in the order of execution, a row per corner; the time of each begins at 0.
    """
    header = ["contour", "node", "kind", "t_s", *_joint_header(plans)]
    header += ["x_mm", "y_mm", "z_mm", "axis_x", "axis_y", "axis_z", "gamma_deg", "posture"]
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(header)
    homeless = len(moves) < len(plans)
    for i, plan in enumerate(plans):
        if moves and not (homeless and i == 0):
            _write_air(writer, moves[i - 1 if homeless else i], plan)
        numbers = np.column_stack(
            [
                plan.time,
                plan.q * _shown(plan),
                plan.points * 1000,
                plan.axes,
                np.degrees(plan.gamma),
            ]
        )
        rows = zip(numbers.tolist(), plan.contour.kinds, plan.posture, strict=True)
        for k, (row, kind, posture) in enumerate(rows):
            writer.writerow([plan.name, k, kind, *row, int(posture)])
    if len(moves) > len(plans):
        _write_air(writer, moves[-1], plans[-1])
    return out.getvalue()


def _joint_header(plans: Sequence[Plan]) -> list[str]:
    if not plans:
        return [f"q{i}_deg" for i in range(1, 7)]
    robot, shown = plans[0].robot, {"m": "mm", "rad": "deg"}
    names = zip(joint_columns(robot), robot.units, strict=True)
    return [f"{name}_{shown[unit]}" for name, unit in names]


def _write_air(writer: Any, move: TransferMove, plan: Plan) -> None:
    """Write the corners of a move; gamma and posture are those of contours alone."""
    T = plan.robot.forward(move.q) @ plan.T_flange_tip
    for k, (time, q, tip) in enumerate(zip(move.time, move.q, T, strict=True)):
        row = [time, *q * _shown(plan), *tip[:3, 3] * 1000, *tip[:3, 2]]
        writer.writerow(["air", k, "air", *(float(v) for v in row), "", ""])


def _shown(plan: Plan) -> Array:
    """Return the factors (n,) that convert joints to degrees, and linear axes to mm."""
    return np.array([1e3 if unit == "m" else 180 / np.pi for unit in plan.robot.units])
