"""Plan a job again around targets of its program that a person has moved."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from kerfpath.arrays import Array, Ints, short_repr
from kerfpath.auditor import Check
from kerfpath.cad import Part
from kerfpath.cell import Cell
from kerfpath.contour import Contour, angle_between
from kerfpath.errors import AuditFailed, InputError, NoFeasiblePath
from kerfpath.job.format import (
    AuditTable,
    Candidate,
    CutRequest,
    Drawing,
    ExternalTable,
    Job,
    LayoutTable,
    PreparedJob,
    ProgramOptions,
    ProgramTable,
    SequenceTable,
    Tolerances,
    home_of,
    prepare,
    program_options,
    read_job,
    tolerances_of,
)
from kerfpath.job.plan_file import (
    AuditReport,
    PlanAudit,
    PlanFile,
    read_plan_file,
    table_of,
)
from kerfpath.job.programs.audit import ProgramAudit
from kerfpath.job.programs.reading import add_tips, language_of, program_on_disk
from kerfpath.job.run import CutResult, JobResult, run_prepared
from kerfpath.operations import touched_up
from kerfpath.placement import MeasuredFrame, place_moves, placed, planned_again
from kerfpath.plans import Plan
from kerfpath.post import (
    Difference,
    ReadGroup,
    ReadMove,
    ReadProgram,
    Rules,
    differences,
    dry_run,
    groups_of,
    language,
    not_compared,
    post_and_read,
    read_program,
)
from kerfpath.post import language as find_language
from kerfpath.progress import Progress, no_progress
from kerfpath.transfer import TransferMove

# -----------------------------------------------------------------------------
# Write the program of plans as text, read it back, and audit it before it is returned.

REMEDIES = {
    "acceleration": "lower eta_acceleration in [plan] or raise the spacing of the nodes, and plan "
    "again; with arcs_mm, lower it or remove it",
    "velocity": "lower eta_velocity in [plan], and plan again",
    "velocity-between": "lower eta_velocity in [plan], and plan again",
    "beam-stop": "write a zone_mm above 0, and cut without stops",
    "lead-time": "write a lead_time_s that the language can express",
    "pierce": "write a pierce_time_s that the language can express",
    "speed": "write a speed that the language can express",
    "tip-between-nodes": "lower arcs_mm, or sample the contour more finely",
    "axis-between-nodes": "remove arcs_mm, or sample the contour more finely",
}
"""What to change if a check of a written program fails, by the code of the check."""
OTHERWISE = "change the job and plan it again"


def audit_of_cuts(job: Job, cuts: Sequence[CutResult], cell: Cell | None) -> ProgramAudit:
    """Return the audit for the program of a job's cuts, with their paths, nodes and speeds."""
    planned = [cut for cut in cuts if cut.plan is not None]
    return ProgramAudit(
        job=job,
        contours=tuple((cut.candidate,) for cut in planned),
        windows=tuple(cut.request.options.gamma_windows for cut in planned),
        cell=cell,
    )


def audit_of_plans(job: Job, plans: Sequence[Plan]) -> ProgramAudit:
    """Return the audit for the program of plans, without the drawing and the cell of their job."""
    contours = []
    for made in plans:
        dt = float(np.diff(made.time).min())  # where the feed is reduced it is longer
        nodes = replace(made.contour, time=dt * np.arange(len(made.contour), dtype=float))
        contours.append((Candidate(path=made.contour, nodes=nodes),))
    windows = tuple(made.settings.gamma_windows for made in plans)
    return ProgramAudit(job=job, contours=tuple(contours), windows=windows, cell=None)


def program_of(
    plans: Sequence[Plan],
    options: ProgramOptions,
    moves: Sequence[TransferMove] = (),
    *,
    audit: ProgramAudit,
    strict: bool = False,
    dry_share: float | None = None,
) -> tuple[dict[str, str], list[str]]:
    """Return the files of the program that cuts `plans`, and the warnings of its preflight.

    Between the cuts the robot makes `moves`; without any, it moves straight to each cut. With
    `dry_share` the program is a dry run at that share of the speed. The text is read back and
    audited as by `kerfpath audit`; for a dry run, the text at full speed is audited.

    The caller must have audited the plans.

    Raises
    ------
    AuditFailed
        There is no plan, or the program fails its audit; the message has the first reason and what
        to do.
    InputError
        The preflight refuses the program.
    """
    if not plans:
        raise AuditFailed("no program: there is no plan to write one from")
    chosen = language(options.language)
    if refusal := chosen.refusal(plans[0].robot):
        raise InputError(f"no program: {refusal}")
    program = options.program(plans, moves)
    written = post_and_read(program, options.language, options.settings, strict=strict)
    if written.read is not None:
        audit = replace(audit, job=replace(audit.job, program=options))
        settings = chosen.completed(options.settings)
        found = audit.audited(written.read, chosen, settings, next(iter(written.files)))
        _require_passed(found, chosen.title)
    if dry_share is not None:
        dry = dry_run(program, dry_share)
        written = post_and_read(dry, options.language, options.settings, strict=strict)
    return written.files, [str(issue) for issue in written.warnings]


def _require_passed(found: AuditReport, title: str) -> None:
    """Raise AuditFailed if a program fails, with the first reason, a count, and what to do."""
    failed = [
        (name, check)
        for name, table in found.tables.items()
        for check in table
        if not check.ok and check.level == "error"
    ]
    if failed:
        name, check = failed[0]
        more = f" (and {len(failed) - 1} more)" if len(failed) > 1 else ""
        raise AuditFailed(
            f"no program: in {title}, {name} fails its audit at {found.place(name, check)}: "
            f"{check.issue().message}{more}; {REMEDIES.get(check.code, OTHERWISE)}"
        )
    if found.missing:
        raise AuditFailed(f"no program: in {title}, {found.missing[0]} is not cut")


# -----------------------------------------------------------------------------
# Write the program of a plan.json after another audit, as planned or at a measured part.

MEASURED_NOTE = (
    "The joints are moved to the measured part and audited there for path, limits, velocities and "
    "accelerations; collisions are not checked there, as its cell is not known: simulate the "
    "program in the cell before running it."
)
MEASURED_MOVES_NOTE = (
    "The moves between contours are straight joint motions between their new ends, and no longer "
    "proved free of collisions."
)
SAME_PLACE = 1e-6
"""Difference in m of the same place in a plan.json and its job that is attributed to rounding."""


def program_from_file(
    plan_file: Path,
    language: str | None = None,
    *,
    name: str | None = None,
    strict: bool = False,
    job_file: Path | None = None,
    dry_share: float | None = None,
    frame: MeasuredFrame | None = None,
) -> tuple[dict[str, str], list[str]]:
    """Return the files of a plan.json's program in a language, and its preflight's warnings.

    Parameters
    ----------
    plan_file : Path
    language : str, optional
        Default: that of the job.
    name : str, optional
        Name of the program; default: that of the job.
    strict : bool
        Refuse a program that would only give a warning.
    job_file : Path, optional
        The current job: its [program] is used, and the plans are audited against its drawing and
        in its cell. Default: [program] as it was when the plan was made, and no cell.
    dry_share : float, optional
        Make it a dry run at this share of the speed, see `kerfpath.post.dry_run`.
    frame : MeasuredFrame, optional
        The measured placement of the part; the plans are moved there and audited, except for
        collisions.

    Raises
    ------
    AuditFailed
        A contour has no plan, or its plan or the text of the program fails the audit, which is
        run again.
    NoFeasiblePath
        The robot does not reach the measured part as planned.
    InputError
        The file cannot be read, the language is unknown, the preflight refuses the program, or
        moves around obstacles cannot be moved to a measured part.
    """
    file = read_plan_file(plan_file)
    if file.missing:
        raise AuditFailed(f"no program: {', '.join(file.missing)} has no plan")
    if file.failed:
        raise AuditFailed(
            f"no program: {', '.join(file.failed)} failed the audit against the drawing when it "
            "was planned; correct the job and plan it again"
        )
    notes: list[str] = []
    by_job = None
    if job_file is not None:
        if frame is not None:
            raise InputError(
                f"{job_file}: expected a job or a measured part, got both, but the cell of a job "
                "is not known at a measured placement; remove one"
            )
        prepared = _planned_requirements(prepare(read_job(job_file)), file)
        _require_plans_passed(PlanAudit(prepared=prepared).audited(plan_file))
        if prepared.job.options.interruptions == "none":
            by_job = ProgramAudit.by(prepared)
        file = replace(file, job=prepared.job.source)
    options = _options(
        file,
        language or program_language(file.job, job_file or plan_file),
        (job_file or plan_file).stem,
    )
    options = options if name is None else replace(options, name=name)
    if frame is not None:
        file, again = _at_measured(file, frame, options.retract)
        notes += [*again, MEASURED_NOTE, *([MEASURED_MOVES_NOTE] if file.moves else [])]
    tolerances = table_of(file, "audit", AuditTable, tolerances_of)
    there = "" if frame is None else " at the measured placement"
    for p in file.plans:
        if (failed := _first_failed(tolerances.checks(p))) is not None:
            raise AuditFailed(
                f"no program: contour {p.name!r} fails its audit{there}: {failed.issue()}"
            )
    files, warnings = program_of(
        file.plans,
        options,
        file.moves,
        audit=by_job or audit_of_plans(_job_of(file, options), file.plans),
        strict=strict,
        dry_share=dry_share,
    )
    return files, notes + warnings


def program_language(source: Mapping[str, Any], path: Path) -> str:
    """Return the language that a parsed job asks for; `path` is its file, for messages.

    Raises
    ------
    InputError
        The job asks for no program.
    """
    name = str(source.get("program", {}).get("language", ProgramTable().language))
    if name == "none":
        raise InputError(f"{path}: its job asks for no program; choose a language with --language")
    return name


def _job_of(file: PlanFile, options: ProgramOptions) -> Job:
    """Return the job of a plan.json, without its drawing and its cell."""
    first = file.plans[0]
    sequence = None
    if file.job.get("sequence") is not None:
        sequence = table_of(file, "sequence", SequenceTable, lambda table: table)
    axes = file.job["robot"].get("external", ())
    external = [ExternalTable.model_validate(axis) for axis in axes]
    return Job(
        path=file.path,
        robot=first.robot,
        tool=first.T_flange_tip,
        placement=first.T_base_part,
        drawing=Drawing(file=file.path),
        contours=(),
        options=replace(first.settings, refine_parts=1, interruptions="none", least_piece=None),
        cell=None,
        home=home_of(sequence, external, first.robot),
        sequence=sequence,
        layout=LayoutTable(),
        tolerances=table_of(file, "audit", AuditTable, tolerances_of),
        program=options,
        source=file.job,
    )


def _planned_requirements(prepared: PreparedJob, file: PlanFile) -> PreparedJob:
    """Return a job with the [program] that a plan.json was made with.

    The retract, transfer and pierce times of the plan follow from that one. The program is built
    with the current one of the job, and refused if the planned moves do not fit its retract.
    """
    stem = prepared.job.path.stem
    allowed = table_of(file, "audit", AuditTable, tolerances_of)
    then = table_of(
        file, "program", ProgramTable, lambda table: program_options(table, stem, allowed)
    )
    return replace(prepared, job=replace(prepared.job, program=then))


def _require_plans_passed(found: AuditReport) -> None:
    for name, table in found.tables.items():
        # The program uses the current [program] of the job.
        failed = _first_failed([row for row in table if row.code != "job-program"])
        if failed is not None:
            raise AuditFailed(f"no program: {name!r} fails its audit: {failed.issue()}")


def _at_measured(
    file: PlanFile, frame: MeasuredFrame, retract: float
) -> tuple[PlanFile, list[str]]:
    """Return a plan.json with its plans and the moves between them moved to a measured part.

    A contour that would fail its audit there is planned again; a note names it.
    """
    tolerances, plans, notes = table_of(file, "audit", AuditTable, tolerances_of), [], []
    for p in file.plans:
        moved, why = _moved(p, frame, tolerances)
        if why:
            try:
                moved = planned_again(p, frame.T_base_part)
            except NoFeasiblePath as broken:
                raise broken.with_message(
                    f"contour {p.name!r}: moved to the measured placement {why}, and planned again "
                    f"there: {broken}"
                ) from None
            notes.append(f"Contour {p.name!r} was planned again there; without planning, {why}.")
        plans.append(moved)
    moves = place_moves(file.moves, plans, retract)
    return replace(file, plans=tuple(plans), moves=moves, in_cell=False), notes


def _moved(p: Plan, frame: MeasuredFrame, tolerances: Tolerances) -> tuple[Plan, str]:
    """Return a plan moved to a measured part, and what then fails; empty if nothing does."""
    try:
        moved = placed(p, frame.T_base_part)
    except NoFeasiblePath as away:
        return p, f"it fails: {away}"
    failed = _first_failed(tolerances.checks(moved))
    return moved, "" if failed is None else f"it fails: {failed.issue()}"


def _first_failed(table: Sequence[Check]) -> Check | None:
    """Return the first check that is an error; None if the plan passes."""
    return next((check for check in table if check.level == "error" and not check.ok), None)


def _options(file: PlanFile, language: str, stem: str) -> ProgramOptions:
    find_language(language)
    allowed = table_of(file, "audit", AuditTable, tolerances_of)
    return table_of(
        file,
        "program",
        ProgramTable,
        lambda table: program_options(table, stem, allowed),
        language=language,
    )


def require_same_setup(plan: Plan, job: Job, path: Path) -> None:
    """Raise InputError if the tool, the part or the arm of a plan differs from the job."""
    pairs = {
        "tool": (plan.T_flange_tip, job.tool),
        "part": (plan.T_base_part, job.placement),
        "robot": (plan.robot.forward(plan.q[:1]), job.robot.forward(plan.q[:1])),
    }
    for name, (here, there) in pairs.items():
        if np.abs(here - there).max() > SAME_PLACE:
            raise InputError(
                f"{job.path}: its {name} is not at the place of that in {path}; give the job of "
                "that plan, or plan it again"
            )


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
    (one, settings), (two, other) = language_of(a, job), language_of(b, job)
    reads = [
        add_tips(program_on_disk(path, chosen, of, job.robot), job)
        for path, chosen, of in ((a, one, settings), (b, two, other))
    ]
    rules: tuple[Rules, ...] = ()
    said = any(move.posture for read in reads for move in read.moves)
    if one.name != two.name:  # words for postures have another meaning in another language
        rules = (one.rules(settings), two.rules(other))
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
# Plan a job again around targets of its program that a person has moved.

MOVED = 1e-6
"""Least distance (m) of a moved target from the planned one."""
TURNED = np.radians(1e-3)
"""Least angle (rad) of a moved target's tool axis to the planned one."""
MOST_MOVED = 0.1
"""Largest share of moved targets; if more were moved, the part itself is elsewhere."""
SAME_PATH = 1e-5
"""Distance (m) of a plan's nodes from the drawn path beyond which it was touched up before."""
ALONG = ("added", "removed", "order", "kinds")
"""Codes of differences other than moved targets."""
MEASURE = "for a part that is elsewhere: kerfpath post PLAN.json --measured POINTS.csv"


@dataclass(frozen=True, slots=True, kw_only=True)
class MovedTarget:
    """A target that a person has moved.

    Parameters
    ----------
    contour : str
    node : int
    place : str
        File and line.
    off : float m
        Distance from the planned target.
    turned : float rad
        Angle of its tool axis to the planned one.
    """

    contour: str
    node: int
    place: str
    off: float
    turned: float

    __repr__ = short_repr


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TouchUp:
    """A job planned again around moved targets.

    Parameters
    ----------
    part : Part
    outcome : JobResult
    targets : tuple of MovedTarget
    notes : tuple of str
        Other changes in the program, which are not kept.
    """

    part: Part
    outcome: JobResult
    targets: tuple[MovedTarget, ...]
    notes: tuple[str, ...]

    __repr__ = short_repr


def touch_up(
    program: Path,
    plan_file: Path,
    job_file: Path,
    *,
    ease: float = 0.01,
    progress: Progress = no_progress,
) -> TouchUp:
    """Plan a job again around the targets that were moved in its program.

    Moved nodes keep tip and axis as taught, and the path eases back to the planned one; the
    rotation about the beam is planned again. Starts, directions, order and postures stay.

    Parameters
    ----------
    program : Path
        The main file of the edited program.
    plan_file : Path
        The plan.json that it was written from.
    job_file : Path
        The job of that plan.
    ease : float m
        Distance along the path over which a shift fades out.

    Raises
    ------
    InputError
        A file cannot be read, does not belong to the others, or is of a kind that cannot be
        touched up; or no target was moved, or the start of a contour, a frame, or more than a
        tenth of the targets.
    """
    job, file = read_job(job_file), read_plan_file(plan_file)
    _require_kind(job, file)
    part = job.read_part()
    groups, notes = _read_edits(program, job, file)
    targets = [
        _taught(p, group.path[: len(p.contour)])
        for p, group in zip(file.plans, groups, strict=True)
    ]
    _require_few(program, targets, file.plans)
    if job.sequence is not None:
        job = replace(job, sequence=job.sequence.model_copy(update={"order": "given"}))
    prepared = prepare(job, part)
    requests = dict(zip(prepared.names, prepared.contours, strict=True))
    if set(requests) != set(file.contours.values()):
        raise InputError(
            f"{job.path}: the job has other contours than {file.path}; give the job of that plan"
        )
    contours = [
        _touched_up(requests[p.name], p, moved, group.path, ease)
        for p, moved, group in zip(file.plans, targets, groups, strict=True)
    ]
    outcome = run_prepared(prepared.with_contours(contours), progress=progress)
    found = tuple(target for moved in targets for target in moved)
    return TouchUp(part=part, outcome=outcome, targets=found, notes=tuple(notes))


def _require_kind(job: Job, file: PlanFile) -> None:
    """Raise InputError if job and plan do not belong together, or cannot be touched up."""
    options = job.options
    kinds = (
        (options.interruptions != "none", "interruptions"),
        (options.tilt is not None, "a tilt of the tool axis"),
        (options.refine_parts > 1, "refine_parts"),
        (job.program.arc_tolerance is not None, "arcs_mm"),
    )
    for found, words in kinds:
        if found:
            raise InputError(
                f"{job.path}: programs of jobs with {words} cannot be touched up; remove it and "
                "plan the job again"
            )
    if file.missing or file.failed:
        names = ", ".join(file.missing + file.failed)
        raise InputError(f"{file.path}: {names} has no plan that passed; plan the job again")
    for p in file.plans:
        require_same_setup(p, job, file.path)


def _read_edits(program: Path, job: Job, file: PlanFile) -> tuple[list[ReadGroup], list[str]]:
    """Return the steps of an edited program, a group for each plan, and its other changes."""
    chosen, settings = language_of(program, job)
    options = replace(job.program, language=chosen.name, settings=settings)
    texts, _ = program_of(file.plans, options, file.moves, audit=audit_of_plans(job, file.plans))
    planned, edited = (
        add_tips(read, job)
        for read in (
            read_program(texts, chosen.name, job.robot, settings),
            program_on_disk(program, chosen, settings, job.robot),
        )
    )
    found = {each.code: each for each in differences(planned, edited)}
    if "frames" in found:
        raise InputError(f"{program}: {found['frames'].message}; {MEASURE}")
    for code in ALONG:
        if code in found:
            raise InputError(
                f"{program}: {found[code]}; only moved targets are taken over: change the job and "
                "plan it again"
            )
    notes = [f"not kept: {each}" for code, each in found.items() if code != "targets"]
    return [group for group in groups_of(edited) if group.path], notes


def _taught(p: Plan, moves: Sequence[ReadMove]) -> list[MovedTarget]:
    """Return the targets of a contour that were moved."""
    T = np.array([move.T_part_tip for move in moves])
    off = np.linalg.norm(T[:, :3, 3] - p.contour.points, axis=1)
    turned = angle_between(p.contour.axes, T[:, :3, 2])
    return [
        MovedTarget(
            contour=p.name, node=k, place=moves[k].place, off=float(off[k]), turned=float(turned[k])
        )
        for k in np.flatnonzero((off > MOVED) | (turned > TURNED)).tolist()
    ]


def _require_few(
    program: Path, targets: Sequence[Sequence[MovedTarget]], plans: Sequence[Plan]
) -> None:
    moved = [target for each in targets for target in each]
    total = sum(len(p.contour) for p in plans)
    if not moved:
        raise InputError(f"{program}: no target on a contour was moved; there is nothing to do")
    if len(moved) > MOST_MOVED * total:
        raise InputError(f"{program}: {len(moved)} of {total} targets were moved; {MEASURE}")
    for p, each in zip(plans, targets, strict=True):
        ends = (0, len(p.contour) - 1) if p.contour.returns else (0,)
        for target in each:
            if target.node in ends:
                raise InputError(
                    f"{target.place}: the {'end' if target.node else 'start'} of contour "
                    f"{target.contour!r} was moved; write another start in the job and plan it "
                    f"again; {MEASURE}"
                )


def _touched_up(
    request: CutRequest,
    p: Plan,
    moved: Sequence[MovedTarget],
    moves: Sequence[ReadMove],
    ease: float,
) -> CutRequest:
    """Return the request for a contour around its moved targets, in the postures of its plan."""
    planned = _path_and_nodes(p, request)
    if moved:
        k = np.array([target.node for target in moved])
        T = np.array([moves[node].T_part_tip for node in k])
        path, keep = touched_up(planned.path, planned.nodes, k, T[:, :3, 3], T[:, :3, 2], ease=ease)
        nodes = _sample_touched(path, planned.nodes, keep, request.task.speed)
        planned = Candidate.at(request.task.speed, path, nodes)
    postures = tuple(np.unique(p.posture).tolist())
    return replace(
        request,
        candidates=(planned,),
        options=replace(request.options, postures=postures),
        touched_up=bool(moved),
    )


def _path_and_nodes(p: Plan, request: CutRequest) -> Candidate:
    """Return the candidate of a plan.

    For a plan that was touched up before, its path is straight lines between the plan's nodes.
    """
    for candidate in request.candidates:
        fits = len(candidate.nodes) == len(p.contour)
        if fits and _distances(p.contour, candidate.path) < SAME_PATH:
            return candidate
    slowed = bool((p.contour.speed_share < 1).any())
    nodes = replace(p.contour, time=p.time if slowed else None)
    return Candidate.at(request.task.speed, p.contour, nodes)


def _sample_touched(path: Contour, nodes: Contour, keep: Ints, speed: float) -> Contour:
    """Return a touched-up path sampled as finely as the nodes that it replaces."""
    if nodes.time is not None:
        return path.resample(dt=float(np.diff(nodes.time).max()), speed=speed, keep=keep)
    return path.resample(spacing=float(np.diff(nodes.s).max()), keep=keep)


def _distances(planned: Contour, path: Contour) -> float:
    """Return the largest error (m, rad) of nodes and axes on a path at the same arc lengths."""
    points, axes = path.at(planned.s)
    off: Array = np.linalg.norm(planned.points - points, axis=1)
    return float(np.maximum(off, angle_between(planned.axes, axes)).max())
