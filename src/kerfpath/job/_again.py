"""Work with a plan.json again: audit it, and write its program."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from kerfpath.auditor import Check, checks
from kerfpath.cad import read as read_drawing
from kerfpath.contour import Contour
from kerfpath.errors import AuditFailed, InputError
from kerfpath.job._files import program_of
from kerfpath.job._planfile import PlanFile, read_plan_file
from kerfpath.job._read import ProgramOptions, audit_options, program_options, read_job
from kerfpath.job._tables import AuditTable, ProgramTable
from kerfpath.post import language as find_language

__all__ = ["audit_file", "program_from_file"]

_M = TypeVar("_M", bound=BaseModel)
_R = TypeVar("_R")


def audit_file(
    plan_file: Path, job_file: Path | None = None
) -> tuple[dict[str, list[Check]], tuple[str, ...]]:
    """Return the audit's table of each contour of a plan.json, and the contours without a plan.

    Parameters
    ----------
    plan_file : Path
    job_file : Path, optional
        Its job; the deviation between nodes is then measured against the drawing.

    Raises
    ------
    InputError
        A file cannot be read, or the job does not have a contour of the plan.
    """
    file = read_plan_file(plan_file)
    drawn = {} if job_file is None else _drawn(file, job_file)
    asked = _table(file, "audit", AuditTable, audit_options)
    table = {p.name: checks(p, reference=drawn.get(p.name), **asked) for p in file.plans}
    return table, file.missing


def program_from_file(plan_file: Path, language: str) -> tuple[str, list[str]]:
    """Return the program of a plan.json in a language, and the warnings of its preflight.

    Raises
    ------
    AuditFailed
        A contour has no plan, or its plan fails the audit, which is run again here.
    InputError
        The file cannot be read, an unknown language, or a program that its preflight refuses.
    """
    file = read_plan_file(plan_file)
    if file.missing:
        raise AuditFailed(f"no program: {', '.join(file.missing)} has no plan")
    if file.failed:
        raise AuditFailed(
            f"no program: {', '.join(file.failed)} failed the audit against the drawing when it "
            "was planned; mend the job and plan it again"
        )
    asked = _table(file, "audit", AuditTable, audit_options)
    for p in file.plans:
        for check in checks(p, **asked):
            if check.level == "error" and not check.ok:
                raise AuditFailed(
                    f"no program: contour {p.name!r} fails its audit: {check.issue()}"
                )
    return program_of(file.plans, _options(file, language))


def _options(file: PlanFile, language: str) -> ProgramOptions:
    find_language(language)
    return _table(
        file,
        "program",
        ProgramTable,
        lambda table: program_options(table, file.path.stem),
        language=language,
    )


def _table(
    file: PlanFile, name: str, model: type[_M], read: Callable[[_M], _R], **changes: str
) -> _R:
    """Return a table of the job that a plan was made from, read as the job's own would be."""
    table: Any = file.job.get(name, {})
    try:
        return read(model.model_validate({**table, **changes}))
    except (ValidationError, TypeError) as error:
        said = " ".join(str(error).split())
        raise InputError(f"{file.path}: its [{name}] table is not valid ({said})") from None


def _drawn(file: PlanFile, job_file: Path) -> dict[str, Contour]:
    job = read_job(job_file)
    part = read_drawing(job.part_file, unit=job.part_unit)
    picks = {task.name: task.pick for task in job.contours}
    unknown = [name for name in file.contours.values() if name not in picks]
    if unknown:
        raise InputError(
            f"{job_file}: has no contour {unknown[0]!r} of {file.path}; give the job of that plan"
        )
    drawn: dict[str, Contour] = {}
    for p in file.plans:
        whole = part.contour(picks[file.contours[p.name]])
        piece = p.name != file.contours[p.name]
        s = p.contour.s
        drawn[p.name] = whole.between(float(s[0]), float(s[-1])) if piece else whole
    return drawn
