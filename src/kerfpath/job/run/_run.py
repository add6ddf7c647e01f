"""The run of a job: plan and audit every contour, and put them in order."""

from __future__ import annotations

from dataclasses import replace

from kerfpath.auditor import bound_checks
from kerfpath.cad import Part
from kerfpath.job.format import Job, PreparedJob, prepare
from kerfpath.job.run._contour import advised, cut_candidate
from kerfpath.job.run._foresee import require_foreseen
from kerfpath.job.run._order import order_cuts
from kerfpath.job.run._result import CutResult, JobResult
from kerfpath.planner import with_bound
from kerfpath.progress import Progress, no_progress

__all__ = ["certified", "measured", "run_job", "run_prepared"]


def run_job(job: Job, part: Part | None = None, *, progress: Progress = no_progress) -> JobResult:
    """Plan and audit every contour of a job.

    `part` is the part in its drawing, if that is read already. A contour without a feasible path
    does not stop the others; its result has the reason.

    Raises
    ------
    InputError
        The part cannot be read, a loop does not exist, or a contour cannot be sampled; or a fault
        is known before planning, such as a contour below the floor or a reserved name.
    """
    prepared = prepare(job, part)
    require_foreseen(prepared)
    return run_prepared(prepared, progress=progress)


def run_prepared(prepared: PreparedJob, *, progress: Progress = no_progress) -> JobResult:
    """Plan and audit every contour of a prepared job, in the order of its contours.

    Its contours replace those of the job: a touch-up has other paths in them, a plan picked from
    a Pareto set has other options.
    """
    tried = [
        [
            tuple(
                advised(prepared, cut, progress)
                for cut in cut_candidate(prepared, contour, candidate, progress)
            )
            for candidate in contour.candidates
        ]
        for contour in prepared.contours
    ]
    result = order_cuts(prepared, tried, progress)
    cuts = tuple(certified(cut, progress) for cut in result.cuts)
    return measured(prepared, result.with_cuts(cuts))


def measured(prepared: PreparedJob, result: JobResult) -> JobResult:
    """Return the result with the departures of its nodes from the CAD curves."""
    part = prepared.part
    moved = {
        contour.task.name: part.departure(contour.task.pick, contour.loop)
        for contour in prepared.contours
        if contour.leaves_the_loop
    }
    return replace(
        result, cuts=tuple(cut.measured(part, moved.get(cut.contour)) for cut in result.cuts)
    )


def certified(cut: CutResult, progress: Progress) -> CutResult:
    """Return a cut with the bound of its plan, if one is asked for.

    The bound is audited if plan.json is to keep its certificate.
    """
    asked = cut.request.options.certify
    if cut.plan is None or asked is None:
        return cut

    def named(what: str, done: int, total: int, /) -> None:
        share = f", {100 * done // total} %" if total else ""
        progress(f"{cut.name}: {what}{share}", 0, 0)

    made = with_bound(cut.plan, asked, progress=named)
    if not asked.keep:
        return replace(cut, plan=made)
    named("audit of the certificate", 0, 0)
    return replace(cut, plan=made, checks=(*cut.checks, *bound_checks(made)))
