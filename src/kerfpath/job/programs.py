"""Programs of plans: written as text, read back and audited before they are returned."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import BaseModel

from kerfpath.auditor import Check
from kerfpath.cell import Cell
from kerfpath.errors import AuditFailed, InputError, NoFeasiblePath
from kerfpath.execution import with_power
from kerfpath.job.as_run import as_programmed, programmed
from kerfpath.job.audit import Audit
from kerfpath.job.audit_report import AuditReport
from kerfpath.job.expected import Expected, ExpectedContour, expect_plans
from kerfpath.job.format import (
    Candidate,
    Drawing,
    ExternalTable,
    Job,
    LayoutTable,
    PreparedJob,
    ProgramTable,
    SequenceTable,
    Tolerances,
    home_of,
    prepare,
    read_job,
)
from kerfpath.job.plan_file import PlanFile, read_plan_file
from kerfpath.job.run.results import CutResult
from kerfpath.placement import MeasuredFrame, place_moves, placed, planned_again
from kerfpath.plans import Plan, TransferMove
from kerfpath.post import ProgramIssue, ProgramOptions, build_program, dry_run, post_and_read
from kerfpath.post import language as find_language

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


def expected_of_cuts(job: Job, cuts: Sequence[CutResult], cell: Cell | None) -> Expected:
    """Return what the program of a job's cuts should have: their paths, nodes and speeds."""
    contours = tuple(
        ExpectedContour(name=cut.name, candidates=(cut.candidate,), options=cut.request.options)
        for cut in cuts
        if cut.plan is not None
    )
    return Expected(job=job, contours=contours, cell=cell)


def expected_of_plans(job: Job, plans: Sequence[Plan]) -> Expected:
    """Return what the program of plans should have, without drawing and cell of their job."""
    contours = []
    for made in plans:
        dt = float(np.diff(made.time).min())  # where the feed is reduced it is longer
        nodes = replace(made.contour, time=dt * np.arange(len(made.contour), dtype=float))
        candidate = Candidate(path=made.contour, nodes=nodes)
        contours.append(
            ExpectedContour(name=made.name, candidates=(candidate,), options=made.settings)
        )
    return Expected(job=job, contours=tuple(contours))


def program_of(
    plans: Sequence[Plan],
    options: ProgramOptions,
    moves: Sequence[TransferMove] = (),
    *,
    missing: Sequence[str] = (),
    expected: Expected,
    strict: bool = False,
    dry_share: float | None = None,
) -> tuple[dict[str, str], tuple[ProgramIssue, ...]]:
    """Return the files of the program that cuts `plans`, and the warnings of its preflight.

    Between the cuts the robot makes `moves`; without any, it moves straight to each cut. With
    `dry_share` the program is a dry run at that share of the speed. Its head names the contours
    that are missing because they have no path. The text is read back and
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
    chosen = options.robot_language
    if refusal := chosen.refusal(plans[0].robot):
        raise InputError(f"no program: {refusal}")
    program = with_power(build_program(plans, options, moves=moves), options)
    if missing:
        lacks = f"Not cut, as no path was found: {', '.join(missing)}."
        program = replace(program, caveats=(lacks, *program.caveats))
    written = post_and_read(program, options.language, options.settings, strict=strict)
    if written.read is not None:
        audit = Audit(expected=replace(expected, job=replace(expected.job, program=options)))
        found = audit.program(written.read, next(iter(written.files)))
        _require_passed(found, chosen.title)
    if dry_share is not None:
        dry = dry_run(program, dry_share)
        written = post_and_read(dry, options.language, options.settings, strict=strict)
    return written.files, written.warnings


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
    current = None if job_file is None else read_job(job_file)
    if file.missing and not _accepts_incomplete(file, current):
        raise AuditFailed(
            f"no program: {', '.join(file.missing)} has no plan; for a program without, write "
            'incomplete = "accept" in [program]'
        )
    if file.failed:
        raise AuditFailed(
            f"no program: {', '.join(file.failed)} failed the audit against the drawing when it "
            "was planned; correct the job and plan it again"
        )
    notes: list[str] = []
    by_job: Expected | None = None
    required: Expected | None = None
    if current is None and file.table("program", ProgramTable).compensate is not None:
        raise InputError(
            f"{plan_file}: expected the job, by whose drawing targets are moved (compensate), got "
            "none; give it with --job"
        )
    if current is not None:
        if frame is not None:
            raise InputError(
                f"{job_file}: expected a job or a measured part, got both, but the cell of a job "
                "is not known at a measured placement; remove one"
            )
        prepared = _planned_requirements(prepare(current), file)
        required = Expected.of(prepared)
        _require_plans_passed(Audit(expected=required).plan_file(plan_file))
        if prepared.job.options.interruptions == "none" and not file.missing:
            by_job = required
        file = replace(file, job=prepared.job.source)
    given = job_file or plan_file
    language = language or program_language(file.job, given)
    find_language(language)  # refused by its name if it is unknown
    options = file.program(given.stem, language=language)
    options = options if name is None else replace(options, name=name)
    if frame is not None:
        file, again = _at_measured(file, frame, options.retract)
        notes += [*again, MEASURED_NOTE, *([MEASURED_MOVES_NOTE] if file.moves else [])]
    there, tolerances = "" if frame is None else " at the measured placement", file.tolerances
    for p in file.plans:
        if (failed := _first_failed(tolerances.checks(p))) is not None:
            raise AuditFailed(
                f"no program: contour {p.name!r} fails its audit{there}: {failed.issue()}"
            )
    plans = file.plans
    if required is not None:
        job = replace(required.job, program=options)
        plans = programmed_plans(replace(required, job=job), file)
    files, warnings = program_of(
        plans,
        options,
        file.moves,
        missing=file.missing,
        expected=by_job or expected_of_plans(job_of_plans(file, options), file.plans),
        strict=strict,
        dry_share=dry_share,
    )
    return files, [*notes, *map(str, warnings)]


def programmed_plans(expected: Expected | Job, file: PlanFile) -> tuple[Plan, ...]:
    """Return the plans of a plan.json as its job's program cuts them, with moved targets.

    The drawing of a job is read if its targets are moved.

    Raises
    ------
    InputError
        The job is not that of the plans, or the targets of one cannot be moved.
    """
    job = expected if isinstance(expected, Job) else expected.job
    if job.compensation is None:
        return file.plans
    if isinstance(expected, Job):
        expected = Expected.of(prepare(job))
    made = []
    for each in expect_plans(expected, file)[0]:
        if each.plan is None or each.path is None:
            raise InputError(f"{file.path}: contour {each.name!r} is not as in {job.path}")
        run = as_programmed(job, each.plan, each.path, expected.cell)
        made.append(programmed(job, each.plan, run))
    return tuple(made)


def _accepts_incomplete(file: PlanFile, current: Job | None) -> bool:
    """Return whether the job accepts a program without the contours that have no path."""
    if current is not None:
        return current.accepts_incomplete
    return file.table("program", ProgramTable).incomplete == "accept"


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


class _Externals(BaseModel):
    """The external axes in the [robot] of a job."""

    external: tuple[ExternalTable, ...] = ()


def job_of_plans(file: PlanFile, options: ProgramOptions) -> Job:
    """Return the job of a plan.json, without its drawing and its cell."""
    first = file.plans[0]
    sequence = None
    if file.job.get("sequence") is not None:
        sequence = file.table("sequence", SequenceTable)
    external = file.table("robot", _Externals).external
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
        tolerances=file.tolerances,
        program=options,
        source=file.job,
    )


def _planned_requirements(prepared: PreparedJob, file: PlanFile) -> PreparedJob:
    """Return a job with the [program] that a plan.json was made with.

    The retract, transfer and pierce times of the plan follow from that one. The program is built
    with the current one of the job, and refused if the planned moves do not fit its retract.
    """
    then = file.program(prepared.job.path.stem)
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
    tolerances, plans, notes = file.tolerances, [], []
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
