"""What the joints need of their limits where a controller rounds the corners of a program."""

from __future__ import annotations

import numpy as np

from kerfpath.auditor import Check
from kerfpath.errors import InputError
from kerfpath.execution import Executed, Peak, executed
from kerfpath.job.format import Job
from kerfpath.job.run._result import CutResult
from kerfpath.plans import Plan
from kerfpath.post import language

__all__ = ["checks_as_run"]

SLACK = 1e-3
"""Share of a limit that the steps of zones in a program take: they are rounded down."""


def checks_as_run(job: Job, cut: CutResult) -> tuple[Check, ...]:
    """Return the checks of a cut as its program has it run; none where it does not run straight.

    They warn where a joint needs more than its full limit between the nodes: a controller slows
    down there.
    """
    plan, options = cut.plan, job.program
    if plan is None or options.language == "none" or plan.robot.external is not None:
        return ()
    chosen = language(options.language)
    if not chosen.zones or options.zone == 0:
        return ()
    try:
        program = options.program([plan])
    except InputError:  # said when it is written
        return ()
    turning = chosen.rules(chosen.completed(options.settings)).turning_speed
    runs = executed(program, turning_speed=turning)
    if not runs:
        return ()
    run = max(runs, key=lambda each: len(each.course.T))
    remedy = (
        'write zone_mm = "auto"'
        if options.zone != "auto"
        else ("lower eta_acceleration in [plan], or sample the contour more finely")
    )
    rows = {
        "velocity": (run.peak_velocity, "lower eta_velocity in [plan]"),
        "acceleration": (run.peak_acceleration, remedy),
    }
    return tuple(_check(what, peak, remedy, run, plan) for what, (peak, remedy) in rows.items())


def _check(what: str, peak: Peak, remedy: str, run: Executed, plan: Plan) -> Check:
    """Return a row about the largest share of one kind of limits."""
    there = run.course.T[int(np.argmin(np.abs(run.course.time - peak.time))), :3, 3]
    tips = plan.T_part_tip[:, :3, 3]
    return Check(
        code=f"{what}-as-run",
        title=f"joint {what} share, corners rounded in zones",
        value=peak.share,
        limit=1.0 + SLACK,
        unit="share",
        node=int(np.argmin(np.linalg.norm(tips - there, axis=1))),
        level="warning",
        advice=f"joint {peak.joint + 1} needs it, and a controller slows down there; {remedy}",
    )
