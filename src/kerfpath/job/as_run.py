"""What the joints need of their limits where a controller rounds the corners of a program."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from kerfpath.auditor import ENCLOSED, Check, Level
from kerfpath.errors import InputError
from kerfpath.execution import Executed, Peak, keep_limits, longest_run
from kerfpath.job.format import Job
from kerfpath.plans import Plan
from kerfpath.post import Program, Rules, language

__all__ = [
    "checks_as_run",
    "checks_of_run",
    "checks_of_unknown",
    "keeps_between_nodes",
    "kept_between_nodes",
    "turning_speed",
]

SLACK = 1e-3
"""Share of a limit that the steps of zones in a program take: they are rounded down."""


def checks_as_run(job: Job, plan: Plan, why: str = "") -> tuple[Check, ...]:
    """Return the checks of a plan as its program has it run; none where it does not run straight.

    They hold at every instant where the arm is one whose rates can be bounded, else at samples.
    Where a joint needs more than its full limit between the nodes a controller slows down: that is
    a warning, or an error where the job asks for a guarantee, and `why` it could not be given.
    """
    unknown = _not_modelled(job)
    if not unknown:
        try:
            run = longest_run(_program(job)(plan), turning_speed(job))
        except InputError as fault:  # said when it is written
            unknown = str(fault)
    if unknown:
        return checks_of_unknown(job, unknown)
    return () if run is None else checks_of_run(job, run, plan, why)


def checks_of_unknown(job: Job, why: str) -> tuple[Check, ...]:
    """Return that nothing is guaranteed between the nodes, where the job asks for it."""
    return (_unknown(why),) if job.options.between_nodes == "guaranteed" else ()


def checks_of_run(job: Job, run: Executed, plan: Plan, why: str = "") -> tuple[Check, ...]:
    """Return the checks of a run along the nodes of a plan, see `checks_as_run`."""
    rows = (
        _check("velocity", run.peak_velocity, run.velocity_bound, run, plan),
        _check("acceleration", run.peak_acceleration, run.acceleration_bound, run, plan),
    )
    level: Level = "error" if job.options.between_nodes == "guaranteed" else "warning"
    if job.program.zone != "auto":
        why = f'{why}; write zone_mm = "auto" in [program]'.removeprefix("; ")
    advice = [f"{row.advice}; {why}".removesuffix("; ") for row in rows]
    return tuple(replace(r, level=level, advice=a) for r, a in zip(rows, advice, strict=True))


def kept_between_nodes(job: Job, plan: Plan) -> tuple[Plan, str]:
    """Return the plan held to less at its nodes where it needs more between them.

    Second: why the limits cannot be kept so, and what would help; empty where they are.
    """
    if not keeps_between_nodes(job):
        return plan, ""
    try:
        kept = keep_limits(plan, _program(job), turning_speed=turning_speed(job))
    except InputError as fault:  # said when it is written
        return plan, str(fault)
    return kept.plan, "" if kept.done else kept.statement


def keeps_between_nodes(job: Job) -> bool:
    """Return whether the plans of a job are held to less where they need more between nodes."""
    options = job.options
    moves_gamma = options.method == "continuous" or (options.method == "exact" and options.refine)
    fits = moves_gamma and options.feed == "constant" and options.tilt is None
    return options.between_nodes != "reported" and fits and not _not_modelled(job)


def _program(job: Job) -> Callable[[Plan], Program]:
    return lambda plan: job.program.program([plan])


def turning_speed(job: Job) -> float:
    """Return how fast the job's controller turns the tool, rad/s."""
    return _rules(job).turning_speed


def _rules(job: Job) -> Rules:
    chosen = language(job.program.language)
    return chosen.rules(chosen.completed(job.program.settings))


def _not_modelled(job: Job) -> str:
    """Return why the motion of the job's programs is not known between the nodes; else empty."""
    if job.robot.external is not None:
        return "the motion of a program with an external axis is not modelled"
    if job.program.language == "none":
        return "there is no program; name a language in [program]"
    if not language(job.program.language).zones:
        return f"{job.program.language} has no zones: what its controller does is not known"
    if job.program.zone == 0:
        return 'the robot stops at every node; write zone_mm = "auto" in [program]'
    if job.options.between_nodes == "guaranteed" and not _rules(job).zone_lengths:
        return f"the zones of {job.program.language} are no lengths, as it is set up"
    return ""


def _unknown(why: str) -> Check:
    return Check(
        code="between-nodes",
        title="limits kept between the nodes",
        value=np.nan,
        limit=1.0,
        unit="share",
        node=0,
        advice=f"cannot be guaranteed: {why}",
    )


def _check(what: str, peak: Peak, bound: float, run: Executed, plan: Plan) -> Check:
    """Return a row about the largest share of one kind of limits."""
    there = run.course.T[int(np.argmin(np.abs(run.course.time - peak.time))), :3, 3]
    tips = plan.T_part_tip[:, :3, 3]
    proved = plan.robot.kinematics in ENCLOSED
    return Check(
        code=f"{what}-as-run",
        title=f"joint {what} share as run, {'at every instant' if proved else 'sampled'}",
        value=max(peak.share, bound) if proved else peak.share,
        limit=1.0 + SLACK,
        unit="share",
        node=int(np.argmin(np.linalg.norm(tips - there, axis=1))),
        advice=f"joint {peak.joint + 1} needs it, and a controller slows down there",
    )
