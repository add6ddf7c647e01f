"""Plans of a job as its program cuts them: with targets moved, where [program] asks for that."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from kerfpath.auditor import Check
from kerfpath.cell import Cell
from kerfpath.contour import Contour
from kerfpath.errors import InputError
from kerfpath.execution import (
    Compensation,
    Compensator,
    Correction,
    Executed,
    Kept,
    speed_of,
)
from kerfpath.job.as_run import ZONE_SLACK, AsRun, allowed_off, as_run, run_judged, run_of
from kerfpath.job.audit_report import check
from kerfpath.job.format import Job
from kerfpath.planner import at_most
from kerfpath.plans import Plan

__all__ = ["as_programmed", "compensation_notes", "programmed"]


def as_programmed(
    job: Job, plan: Plan, path: Contour, cell: Cell | None, kept: Kept | None = None
) -> AsRun:
    """Return a plan as its program is run, with its targets moved if the job asks for it.

    Where they cannot be moved so that everything is kept, a failed check says why, and at which
    speed they can.
    """
    if job.compensation is None:
        return as_run(job, plan, path, kept)
    try:
        found, more = _compensated(job, plan, path, cell)
    except InputError as fault:
        return replace(as_run(job, plan, path, kept), checks=(_refused(str(fault)),))
    if found.failure:
        run = as_run(job, plan, path, kept)
        said = f"{found.failure}{more}"
        return replace(run, checks=(*run.checks, _refused(said)), compensation=found)
    assert found.run is not None
    run = run_judged(job, found.run, found.plan, path)
    row = check(
        "compensation", "largest displacement of a target by compensation", found.largest,
        job.most_moved, "m",
    )  # fmt: skip
    return replace(run, checks=(*run.checks, row), compensation=found)


def _refused(why: str) -> Check:
    return Check(
        code="compensation",
        title="cuts whose targets cannot be moved so that they are executed as drawn",
        value=1.0,
        limit=0.0,
        unit="count",
        node=0,
        advice=why,
    )


def _compensated(
    job: Job, plan: Plan, path: Contour, cell: Cell | None
) -> tuple[Compensation, str]:
    """Return the compensation of a plan, and what would help if it fails."""

    def run(made: Plan, bounded: bool) -> Executed:
        found = run_of(job, made, bounded=bounded)
        if found is None:
            raise InputError("the robot stops at every node, where nothing lags")
        return found

    def broken(made: Plan, found: Executed) -> str:
        return _broken(job, made, found, cell)

    compensator = Compensator(
        path=path, response=job.response, tolerance=allowed_off(job), most=job.most_moved,
        run=run, broken=broken,
    )  # fmt: skip
    if isinstance(job.compensation, Correction):
        return compensator.by(plan, job.compensation.displacement_at(plan.contour)), ""
    found = compensator.of(plan)
    if not found.failure:
        return found, ""
    share = compensator.share(plan)
    if share is None:
        return found, "; a lower speed alone does not help: sample the contour more finely"
    speed = at_most(60 * share * speed_of(plan), 3)
    return found, f"; this motion can be compensated at {speed} m/min"


def _broken(job: Job, plan: Plan, run: Executed, cell: Cell | None) -> str:
    """Return which limit a plan with moved targets breaks, in words; empty if none."""
    bounds = (run.velocity_bound, run.acceleration_bound)
    peaks = (run.peak_velocity, run.peak_acceleration)
    for what, bound, peak in zip(("velocity", "acceleration"), bounds, peaks, strict=True):
        share = peak.share if run.sampled else max(bound, peak.share)
        if share > 1 + ZONE_SLACK:
            return (
                f"{plan.robot.joint_names[peak.joint]} would need {share:.3g} of its {what} limit"
            )
    failed = [
        row for row in job.tolerances.checks(plan, cell=cell) if row.level == "error" and not row.ok
    ]
    return f"with moved targets: {failed[0].issue().message}" if failed else ""


def programmed(job: Job, plan: Plan, run: AsRun) -> Plan:
    """Return a plan as its program cuts it.

    Raises
    ------
    InputError
        Its targets cannot be moved as the job asks for.
    """
    if job.compensation is None:
        return plan
    found = run.compensation
    if found is None or found.failure:
        why = "its motion is not known" if found is None else found.failure
        raise InputError(f"contour {plan.name!r} cannot be compensated: {why}")
    return found.plan


def compensation_notes(job: Job, runs: Sequence[tuple[str, AsRun]]) -> list[str]:
    """Return what the runs of contours, by name, owe to compensation, and what that rests on."""
    done = [(name, run, c) for name, run in runs if (c := run.compensation) and not c.failure]
    if not done:
        return []
    largest = max(c.largest for _, _, c in done) * 1e3
    if isinstance(job.compensation, Correction):
        said = f"Targets are moved by up to {largest:.2g} mm, as {job.compensation.name} has it"
        lacks = [name for name, _, c in done if c.largest == 0]
        said += f"; it moves none of {', '.join(lacks)}." if lacks else "."
        return [said]
    before, rest = (max(getattr(c, of) for _, _, c in done) * 1e3 for of in ("before", "rest"))
    said = (
        f"Targets are moved by up to {largest:.2g} mm, so that the executed tip is off the drawing "
        f"by {rest:.2g} mm instead of {before:.2g} mm, by {job.response.words}."
    )
    ends = [run.path_error.ends for _, run, _ in done if run.path_error is not None]
    if job.response.standing == "assumed":
        said += (
            " This rests on an assumption: no runs of this arm are known; fit its response with "
            "kerfpath fit, or correct the program by measured runs with kerfpath correct."
        )
        if job.response.sigma_range is not None and all(ends):
            low, high = (max(each[k] for each in ends) * 1e3 for k in (0, 1))
            least, most = job.response.sigma_range * 1e3
            said += f" With {least:g} ms it would be {low:.2g} mm, with {most:g} ms {high:.2g} mm."
    return [said]
