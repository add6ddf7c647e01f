"""Write the files of a run: plan.json, trajectory.csv, report.html and the program."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from kerfpath.arrays import SHOWN_UNITS, Array, short_repr
from kerfpath.cad import Departure
from kerfpath.errors import AuditFailed, InputError, NoFeasiblePath
from kerfpath.execution import with_power
from kerfpath.files import require_replaceable
from kerfpath.job.as_run import allowed_off, compensation_notes
from kerfpath.job.audit_report import collision_note
from kerfpath.job.format import DIFFER, SMALL_HOLE, Job, origins_of, refusal_at
from kerfpath.job.output.spent import power_of, spent_table
from kerfpath.job.plan_file import (
    ContourData,
    broken_entry,
    plan_document,
    plan_entry,
    plan_text,
)
from kerfpath.job.programs import expected_of_cuts, program_of
from kerfpath.job.run.foresee import sides_in_doubt
from kerfpath.job.run.results import CutResult, JobResult
from kerfpath.plans import Plan, TransferMove, joint_columns
from kerfpath.post import (
    MANIFEST,
    Line,
    ProgramIssue,
    ProgramOptions,
    TimedLine,
    build_program,
    issue_lines,
    preflight,
    read_program,
    replace_program,
    timed_lines,
)
from kerfpath.report import ContourSection, ExecutedPath, PowerPath, render
from kerfpath.robots import Robot
from kerfpath.sequence import PartPlan

# -----------------------------------------------------------------------------
# Lines of a run's program: when each line runs, and what the preflight finds at it.


@dataclass(frozen=True, slots=True, kw_only=True)
class ProgramPlaces:
    """The lines of a program, with their times and the findings of the preflight.

    Parameters
    ----------
    lines : tuple of TimedLine
        Lines of moves and waits, in the order of the program; none if the language has no reader.
    findings : tuple of (ProgramIssue, Line or None)
        What the preflight finds, and at which line.
    """

    lines: tuple[TimedLine, ...] = ()
    findings: tuple[tuple[ProgramIssue, Line | None], ...] = ()

    __repr__ = short_repr


def program_places(outcome: JobResult, files: Mapping[str, str]) -> ProgramPlaces:
    """Return when the lines of a run's program run, and what its preflight finds.

    Parameters
    ----------
    outcome : JobResult
    files : mapping of str to str
        The program by the names of its files, the one to start first; if empty, findings have no
        lines.
    """
    options = outcome.job.program
    if not outcome.plans or outcome.stuck is not None or options.language == "none":
        return ProgramPlaces()
    try:
        program = build_program(outcome.programmed, options, moves=outcome.moves)
        program = with_power(program, options)
        issues = preflight(program, options.language, options.settings)
    except InputError:  # reported when the program is written
        return ProgramPlaces()
    where: tuple[Line | None, ...] = (None,) * len(issues)
    lines: tuple[TimedLine, ...] = ()
    if files and options.robot_language.read is not None:
        read = read_program(files, options.language, program.robot, options.settings)
        where = issue_lines(issues, program, read)
        lines = timed_lines(program, read)
    return ProgramPlaces(lines=lines, findings=tuple(zip(issues, where, strict=True)))


# -----------------------------------------------------------------------------
# Write report.html, the report of a run.

PER_LEG = 17
"""Number of points with which a straight joint motion is drawn."""


def report_text(outcome: JobResult, notes: Sequence[str], faults: Sequence[str] = ()) -> str:
    """Return the HTML report of a run; `faults` say why it must not be cut although planned."""
    job = outcome.job
    sections = [
        ContourSection(
            name=cut.name,
            graph=cut.graph,
            path=cut.candidate.nodes,
            plan=cut.plan,
            checks=(*cut.checks, *cut.as_run.checks),
            failure="" if cut.broken is None else str(cut.broken),
            remedy=cut.remedy,
            broken_at=None if cut.broken is None else cut.broken.node + 1,
            clearance=cut.clearance,
            sampling=() if cut.departure is None else _sampling(cut.departure),
            executed=_executed(job, cut),
            power=_power(job, cut),
        )
        for cut in outcome.cuts
    ]
    speeds = sorted({cut.request.task.speed * 60 for cut in outcome.cuts})
    robot, options = job.robot, job.options
    n = robot.arm.joints
    velocity, acceleration = (np.degrees(v[:n]).round(1) for v in robot.speed_limits())
    part = outcome.part
    facts = [
        *([] if part is None else [("Cycle time", f"{part.cycle_time:.1f} s")]),
        ("Job", job.path.name),
        ("Part", job.part_file.name),
        ("Robot", f"{robot.manufacturer} {robot.model}".strip() or robot.id),
        ("Cutting speed", f"{' / '.join(f'{v:g}' for v in speeds)} m/min"),
        ("Gamma step", f"{np.degrees(options.gamma_step):g} deg"),
        ("Objective", f"{options.objective}, {options.metric} metric"),
        ("Method", f"{options.method}, {options.frames} frames"),
        ("Limits used", f"{options.eta_v:.0%} velocity, {options.eta_a:.0%} acceleration"),
        ("Joint velocity limits", f"{_row(velocity)} deg/s"),
        ("Joint acceleration limits", f"{_row(acceleration)} deg/s²"),  # the footer says whence
        *_by_configuration(robot),
        *_more_limits(robot),
        ("Endless axes", _row(np.flatnonzero(robot.endless[:n]) + 1) or "none"),
        *_external_facts(robot),
    ]
    # Moves from and to home are long, and would make the part small in the picture.
    moves = outcome.moves
    between = moves[1:-1] if len(moves) > len(outcome.plans) else moves
    return render(
        f"{job.part_file.stem.replace('_', ' ')}",
        sections,
        mesh=outcome.mesh,
        cell=outcome.cell,
        moves=[_tips(job, move) for move in between],
        facts=facts,
        faults=faults,
        process=_process_rows(job),
        spent=spent_table(outcome),
        notes=notes,
        job_text=job.text,
    )


def _process_rows(job: Job) -> list[tuple[str, str, str, str, str]]:
    """Return a row for each value of the process, and where it comes from."""
    return [
        (
            each.of,
            each.key,
            each.shown,
            each.origin,
            "hand" if each.by_hand else "program",
        )
        for each in origins_of(job.text, job.source)
    ]


def process_notes(job: Job) -> list[str]:
    """Return the notes on what the operator has to set."""
    lines = job.program.remarks
    if not lines:
        return []
    said = "; ".join(line[2:] if line[0] == "-" else line for line in lines[1:])
    said = said.replace("; + ", " ").removesuffix(f"; {DIFFER}")
    notes = [f"Set by hand, as no program sets it: {said}."]
    if any(line[2:] == DIFFER for line in lines):
        notes.append(
            "The rows of the techniques differ in what is set by hand: cut one technique at a time "
            "(switched_off in [part]), or stop between them."
        )
    return notes


def small_hole_notes(outcome: JobResult) -> list[str]:
    """Return the note on contours that are cut by another technique because of their size."""
    names = [cut.contour for cut in outcome.cuts if cut.request.task.by_size]
    small = outcome.job.small_holes
    if not names or small is None:
        return []
    return [
        f"{', '.join(dict.fromkeys(names))}: cut by the technique {SMALL_HOLE} "
        f"({small.row.place}), as holes of at most {small.size * 1e3:g} mm; a technique in "
        "[[contour]] comes before, and small_hole_mm = 0 in [process] switches this off."
    ]


def _executed(job: Job, cut: CutResult) -> ExecutedPath | None:
    """Return the path of a cut as it is executed; None if that is not known."""
    off, hole = cut.as_run.path_error, cut.as_run.hole
    if off is None:
        return None
    facts = [
        ("Largest distance", f"{off.largest * 1e3:.3g} mm at {off.s[off.worst] * 1e3:.1f} mm"),
        ("On 95 % of the way", f"at most {off.usual * 1e3:.3g} mm"),
        ("Joints", off.response.words),
        ("Reversals of joints 1 to 3", str(len(off.reversals))),
    ]
    if off.range_words:
        facts.insert(4, ("Largest, by sigma", off.range_words))
    made = cut.as_run.compensation
    if made is None or made.failure:
        facts.insert(1, ("It consists of", off.cause))
    else:
        facts.append(("With targets as drawn", f"{made.before * 1e3:.3g} mm"))
        facts.append(("Targets moved by", f"at most {made.largest * 1e3:.3g} mm"))
    if hole is not None:
        facts.append(("Diameter", f"{hole.executed * 1e3:.2f} mm, drawn {hole.drawn * 1e3:.2f} mm"))
        facts.append(("Out of round by", f"{hole.out_of_round * 1e3:.2f} mm"))
    return ExecutedPath(
        s=off.s,
        nearest=cut.candidate.path.at(off.s)[0],
        tip=off.T[:, :3, 3],
        off=off.tip,
        rounding=off.rounding,
        allowed=allowed_off(job),
        facts=tuple(facts),
    )


def _power(job: Job, cut: CutResult) -> PowerPath | None:
    """Return the power along a cut; None if no program sets it."""
    along = power_of(job, cut)
    if along is None:
        return None
    least, most = along.set.min(), along.set.max()
    facts = (
        ("Power", f"{least:.0%} to {most:.0%} of the full power"),
        ("Changes", str(along.switches)),
        ("Off the power by the mean speed of a move", f"at most {along.difference:.1%}"),
        ("Off the power by the speed, mean along the way", f"{along.mean_difference:.1%}"),
    )
    return PowerPath(
        s=along.s,
        set=along.set,
        fine_s=along.fine_s,
        speed=along.fine_speed,
        asked=along.fine_asked,
        facts=facts,
    )


def _by_configuration(robot: Robot) -> Iterator[tuple[str, str]]:
    """Yield what accelerations there are where they depend on the configuration."""
    table = robot.limits.acceleration_table
    for joint, values in {} if table is None else table.limits.items():
        least, most = (f"{np.degrees(value):.0f}" for value in (values.min(), values.max()))
        yield f"Acceleration limit of joint {joint}", f"{least} to {most} deg/s² by joints 2 and 3"


def _more_limits(robot: Robot) -> Iterator[tuple[str, str]]:
    """Yield the limits on jerk and torque, where there are any."""
    if robot.limits.jerk is not None:
        yield "Joint jerk limits", f"{_row(np.degrees(robot.limits.jerk).round(1))} deg/s^3"
    if robot.dynamics.load is not None:
        load = f"load {robot.dynamics.load.mass:g} kg, without friction and rotors"
        yield "Joint torque limits", f"{_row(robot.limits.torque)} N m ({load})"


def _external_facts(robot: Robot) -> list[tuple[str, str]]:
    """Return a row for each external axis: what it carries, and its limits."""
    limits, n = robot.joint_limits(), robot.arm.joints
    facts = []
    for i, axis in enumerate(robot.externals, n):
        scale, unit = SHOWN_UNITS[axis.unit]
        low, high, velocity, acceleration = (
            f"{scale * values[i]:.6g}"
            for values in (limits.lower, limits.upper, *robot.speed_limits())
        )
        travel = "endless" if robot.endless[i] else f"{low} to {high} {unit}"
        said = f"{axis.kind}, carries the {axis.carries}; {travel}"
        said += f", {velocity} {unit}/s, {acceleration} {unit}/s²"
        facts.append((f"External axis {axis.name}", said))
    return facts


def _sampling(found: Departure) -> list[tuple[str, str]]:
    """Return the rows on how far the nodes leave the curve that they sample."""
    against = {
        "CAD curve": "the CAD curve",
        "points of the drawing": "the lines through the points of the drawing",
        "path as cut": "the path as cut, which differs from the drawn loop",
    }
    rows = [
        ("Measured against", against[found.against]),
        ("Largest chord error", f"{found.chord_error * 1e3:.4f} mm, after node {found.chord_node}"),
        (
            "Largest axis error between nodes",
            f"{np.degrees(found.axis_error):.3f} deg, after node {found.axis_node}",
        ),
        (
            "Largest axis step from node to node",
            f"{np.degrees(found.axis_step):.3f} deg, after node {found.step_node}",
        ),
    ]
    if (loop := found.path) is not None:
        off = f"{loop.chord_error * 1e3:.4f} mm and {np.degrees(loop.axis_error):.3f} deg"
        rows.append(("Drawn loop", f"within {off} of {against[loop.against]}"))
    return rows


def _tips(job: Job, move: TransferMove) -> Array:
    """Return points of the tool tip along a move, (m, 3) m, part frame."""
    legs = np.linspace(move.q[:-1], move.q[1:], PER_LEG, axis=1).reshape(-1, move.q.shape[1])
    T = np.linalg.inv(job.placement) @ job.robot.forward(legs) @ job.tool
    return np.asarray(T[:, :3, 3])


def _row(values: object) -> str:
    return " ".join(f"{v:g}" for v in np.asarray(values).tolist())


# -----------------------------------------------------------------------------
# Write the files of a run: plan.json, trajectory.csv, report.html and the program.

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
    contours = {cut.contour: cut.candidate.nodes for cut in outcome.cuts}
    notes += outcome.doubts
    notes += sides_in_doubt(job, contours.items(), outcome.mesh)
    notes += (
        process_notes(job)
        + small_hole_notes(outcome)
        + closer_sampling(outcome)
        + short_pieces(outcome)
    )
    notes += compensation_notes(job, [(cut.name, cut.as_run) for cut in outcome.cuts])
    faults = [] if outcome.stuck is None else [f"The moves between contours: {outcome.stuck}"]
    faults += [f"The moves between contours: {c.issue()}" for c in outcome.air if not c.ok]
    if job.program.language != "none":
        notes += incomplete_note(outcome)
    if outcome.may_be_written and job.program.language != "none":
        try:
            expected = expected_of_cuts(job, outcome.cuts, outcome.cell)
            program, warnings = program_of(
                outcome.programmed, job.program, moves,
                missing=outcome.missing, expected=expected, strict=strict,
            )  # fmt: skip
            # What the tables of the cuts say already is not said again.
            failed = {row.code for cut in outcome.cuts for row in cut.as_run.checks if not row.ok}
            notes += [str(warning) for warning in warnings if warning.code not in failed]
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
    for name in outcome.not_planned:
        why = NoFeasiblePath("the run was stopped before it was planned", proved=False, node=-1)
        entries.append(broken_entry(name, why, None))
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
    name, suffix = options.name.lower(), options.robot_language.suffix
    there = sorted([*folder.glob(f"*{suffix}"), *folder.glob(f"*/*{suffix}")])
    shortest = min(len(name), SHORTEST_CUT)
    return [p for p in there if name.startswith(p.stem.lower()) and len(p.stem) >= shortest]


def order_note(part: PartPlan) -> str:
    """Return the note on the cycle time, and on what is proved about the order."""
    order = part.order
    took = (
        f"Cycle time {part.cycle_time:.1f} s: cutting {part.cutting_time:.1f} s, air "
        f"{part.air_time:.1f} s, piercing {part.piercing_time:.1f} s"
    )
    if order.at_least == 0:
        return f"{took}; the order was kept, no other was compared."
    proved = (
        "no order takes less"
        if order.optimal
        else f"an order of {order.at_least:.1f} s is not ruled out (for a longer search, raise "
        "seconds in [sequence])"
    )
    common = " and in those that at least half of the contours can have"
    rotations = "more than one rotation about the beam in each"
    if part.plans[0].robot.free.size:
        common = ""  # with external axes, other postures are planned only where moves need them
    elif part.plans[0].settings.method == "continuous":
        rotations = "rotations about the beam that cost over 1 % more"
    return (
        f"{took}; with these candidates and moves {proved}. Each contour was planned in its best "
        f"posture{common}; not compared: the other postures, and {rotations}."
    )


def incomplete_note(outcome: JobResult) -> list[str]:
    """Return the note on contours that the program lacks, or that keep it from being written."""
    off = ", ".join(outcome.job.switched_off)
    said = [f"Not cut, as switched_off in [part] names it: {off}."] if off else []
    if outcome.not_planned:
        left = ", ".join(outcome.not_planned)
        return [*said, f"No program is written, as the run was stopped before {left} was planned."]
    missing = ", ".join(outcome.missing)
    if not missing:
        return said
    if outcome.may_be_written:
        return [*said, f"The program does not cut {missing}: no path was found."]
    if outcome.job.accepts_incomplete:
        return said
    return [
        *said,
        f"No program is written, as there is no path for {missing}; for a program without, write "
        'incomplete = "accept" in [program].',
    ]


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


def require_folder(folder: Path, files: Iterable[str] = ()) -> None:
    """Require that a path is a folder or can become one, before any work is done.

    Parameters
    ----------
    folder : Path
    files : iterable of str
        Names of files that the work will write into it, as far as they are known before.

    Raises
    ------
    InputError
        The path or one of its parents is a file; what lies in the place of a file cannot be
        replaced, as a folder, a FIFO or a read-only file.
    """
    for place in (folder, *folder.parents):
        if place.is_dir():
            break
        if place.exists():
            raise InputError(f"{folder}: expected a folder, but {place} is a file; name another")
    for name in files:
        try:
            require_replaceable(folder / name)
        except OSError as error:
            raise InputError(
                f"{error.filename}: {error.strerror}; remove it, or name another folder"
            ) from None


def require_place(job: Job, folder: Path) -> None:
    """Require that the files of a run can be written into a folder, before any work is done.

    Raises
    ------
    InputError
        As `require_folder`.
    """
    files = ["plan.json", "trajectory.csv", "report.html", MANIFEST]
    if job.program.language != "none":
        files.append(f"{job.program.name}{job.program.robot_language.suffix}")
    require_folder(folder, files)


def make_folder(folder: Path, files: Iterable[str] = ()) -> None:
    """Make a folder for the files, unless it is there.

    Raises
    ------
    InputError
        As `require_folder`; it cannot be made.
    """
    require_folder(folder, files)
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
    if refusal := job.program.robot_language.refusal(job.robot):
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
    writer.writerow(map(_no_formula, header))
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
            writer.writerow([_no_formula(plan.name), k, kind, *row, int(posture)])
    if len(moves) > len(plans):
        _write_air(writer, moves[-1], plans[-1])
    return out.getvalue()


def _no_formula(name: str) -> str:
    """Return a name with an apostrophe before what a spreadsheet would take for a formula."""
    return f"'{name}" if name.startswith(("=", "+", "-", "@")) else name


def _joint_header(plans: Sequence[Plan]) -> list[str]:
    if not plans:
        return [f"q{i}_deg" for i in range(1, 7)]
    names = zip(joint_columns(plans[0].robot), plans[0].robot.units, strict=True)
    return [f"{name}_{SHOWN_UNITS[unit][1]}" for name, unit in names]


def _write_air(writer: Any, move: TransferMove, plan: Plan) -> None:
    """Write the corners of a move; gamma and posture are those of contours alone."""
    T = plan.robot.forward(move.q) @ plan.T_flange_tip
    for k, (time, q, tip) in enumerate(zip(move.time, move.q, T, strict=True)):
        row = [time, *q * _shown(plan), *tip[:3, 3] * 1000, *tip[:3, 2]]
        writer.writerow(["air", k, "air", *(float(v) for v in row), "", ""])


def _shown(plan: Plan) -> Array:
    """Return the factors (n,) that convert joints to degrees, and linear axes to mm."""
    return np.array([SHOWN_UNITS[unit][0] for unit in plan.robot.units])
