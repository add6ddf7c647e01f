"""Write the program of plans as text, read it back, and audit it before it is returned."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from kerfpath.cell import Cell
from kerfpath.errors import AuditFailed, InputError
from kerfpath.job.format import Candidate, Job, ProgramOptions
from kerfpath.job.plan_file import AuditReport
from kerfpath.job.programs._audit import ProgramAudit
from kerfpath.job.run import CutResult
from kerfpath.plans import Plan
from kerfpath.post import dry_run, language, post_and_read
from kerfpath.transfer import TransferMove

__all__ = ["audit_of_cuts", "audit_of_plans", "program_of"]

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
