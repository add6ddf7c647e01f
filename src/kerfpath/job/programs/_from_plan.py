"""Write the program of a plan.json after another audit, as planned or at a measured part."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from kerfpath.auditor import Check
from kerfpath.errors import AuditFailed, InputError, NoFeasiblePath
from kerfpath.job.format import (
    AuditTable,
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
from kerfpath.job.programs._audit import ProgramAudit
from kerfpath.job.programs._build import audit_of_plans, program_of
from kerfpath.placement import MeasuredFrame, place_moves, placed, planned_again
from kerfpath.plans import Plan
from kerfpath.post import language as find_language

__all__ = ["program_from_file", "program_language", "require_same_setup"]

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
        _require_passed(PlanAudit(prepared=prepared).audited(plan_file))
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


def _require_passed(found: AuditReport) -> None:
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
