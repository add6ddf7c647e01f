"""Plans as a controller runs their program: with rounded corners, and with moved targets."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from kerfpath.arrays import Array, short_repr
from kerfpath.auditor import Check, Level
from kerfpath.cell import Cell
from kerfpath.contour import Contour
from kerfpath.errors import InputError, about
from kerfpath.execution import (
    AT_SPEED,
    Compensation,
    Compensator,
    Correction,
    Executed,
    Kept,
    PathError,
    Peak,
    Roundness,
    Timing,
    keep_limits,
    longest_run,
    path_error,
    roundness,
    share_within,
    speed_of,
    timing_of,
)
from kerfpath.job.audit_report import check, count
from kerfpath.job.format import Job
from kerfpath.planner import at_most
from kerfpath.plans import Plan
from kerfpath.post import REMEDY_SHORT, STRETCHED, Controller, Program, build_program

# -----------------------------------------------------------------------------
# Joint limits between the nodes, as a controller runs the program with rounded corners.

ZONE_SLACK = 1e-3
"""Share by which limits may be exceeded, as zones in a program are rounded down to steps."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AsRun:
    """A plan as a controller runs its program.

    Parameters
    ----------
    checks : tuple of Check
        Rows of the audit about the motion between the nodes.
    timing : Timing or None
        How long it takes and where it slows down; None if that is not known.
    path_error : PathError or None
        How far the executed motion is from the path; None if it stops at every node.
    hole : Roundness or None
        Size and roundness of the cut, if a circle is drawn.
    compensation : Compensation or None
        The plan with its targets moved, which runs as said above; None without compensation.
    """

    checks: tuple[Check, ...] = ()
    timing: Timing | None = None
    path_error: PathError | None = None
    hole: Roundness | None = None
    compensation: Compensation | None = None

    __repr__ = short_repr


def as_run(job: Job, plan: Plan, path: Contour, kept: Kept | None = None) -> AsRun:
    """Return a plan as a controller runs its program; without checks if it stops at every node.

    The checks of velocity and acceleration hold at every instant if the rates of the arm can be
    bounded, otherwise at samples, as those of torque do. If a joint would exceed its full limit
    between the nodes, the controller slows down: that is a warning, or an error if the job asks
    for a guarantee. `kept` is the result of `kept_between_nodes`.
    """
    if kept is not None and kept.run is not None:
        return run_judged(job, kept.run, plan, path, "" if kept.done else kept.statement)
    try:
        run = run_of(job, plan)
    except InputError as fault:
        return AsRun(checks=checks_of_unknown(job, str(fault)))
    return AsRun() if run is None else run_judged(job, run, plan, path)


def run_of(job: Job, plan: Plan, *, bounded: bool = True) -> Executed | None:
    """Return a plan as its program is run; None if the robot stops at every node.

    It has proved bounds if `bounded`.

    Raises
    ------
    InputError
        The motion of the job's programs between the nodes is not known, or there is no program.
    """
    if unknown := _not_modelled(job):
        raise InputError(unknown)
    return longest_run(_program(job)(plan), job.program.rules.controller, bounded=bounded)


def allowed_off(job: Job) -> float:
    """Return the largest distance, m, by which the executed tip may be off the path."""
    return job.tolerances.path if job.path_tolerance is None else job.path_tolerance


def checks_of_unknown(job: Job, why: str) -> tuple[Check, ...]:
    """Return a failed check if the job asks for a guarantee between the nodes, else none."""
    if job.options.between_nodes != "guaranteed":
        return ()
    title = "joint limits between the nodes that are not checked"
    return (count("between-nodes", title, 1, advice=f"they cannot be guaranteed: {why}"),)


def run_judged(job: Job, run: Executed, plan: Plan, path: Contour, why: str = "") -> AsRun:
    """Return the checks and the timing of a run along a plan and its path, see `as_run`."""
    shares = (
        _check("velocity", run.peak_velocity, run.velocity_bound, run, plan),
        _check("acceleration", run.peak_acceleration, run.acceleration_bound, run, plan),
    )
    controller = run.controller
    doubts = "; ".join(each for each in (run.sampled, controller.assumed) if each)
    unproved = checks_of_unknown(job, doubts) if doubts else ()
    level: Level = "error" if job.options.between_nodes == "guaranteed" else "warning"
    why = "; ".join(each for each in (why, controller.assumed) if each)
    if job.program.zone != "auto" and not controller.rounds_by_itself:
        why = f'{why}; write zone_mm = "auto" in [program]'.removeprefix("; ")
    advice = [f"{row.advice}; {why}".removesuffix("; ") for row in shares]
    kept = [replace(r, level=level, advice=a) for r, a in zip(shares, advice, strict=True)]
    torque = [replace(row, level=level) for row in _torque(run, plan)]
    timing = timing_of(run) if run.reached else None
    off = path_error(run, path, timing=timing, response=job.response)
    rows = (*kept, *unproved, *torque, *_deviations(job, run, off, plan, path), *_cycle(run, plan))
    if timing is not None:
        rows = (*rows, _speed(run, plan, timing))
    return AsRun(checks=rows, timing=timing, path_error=off, hole=roundness(off, path))


def _torque(run: Executed, plan: Plan) -> Iterator[Check]:
    """Yield the check of the largest share of a torque limit, if the load is known."""
    peak = run.peak_torque
    if peak is not None:
        joint, node = f"joint {peak.joint + 1}", _node(run, plan, peak.time)
        how = f"sampled, without friction and rotors (highest: {joint})"
        yield check(
            "torque-as-run", f"joint torque share as run, {how}", peak.share, 1 + ZONE_SLACK,
            "share", node, advice=f"{joint} exceeds its limit: go more slowly, or carry less",
        )  # fmt: skip


def _cycle(run: Executed, plan: Plan) -> Iterator[Check]:
    """Yield the check of the moves that the controller's cycle makes longer than planned."""
    motion, controller = run.tool_motion, run.controller
    stretch = motion.stretch
    if stretch is None or max(controller.shortest, controller.cycle) <= 0:
        return
    found = controller.short_moves(motion.duration / (1 + stretch))
    node = _node(run, plan, float(motion.time[found.worst + 1]))
    yield check(
        "cycle-as-run", "time by which the controller's cycle stretches a move", found.share,
        STRETCHED, "share", node, level=found.level, advice=f"{found.words}; {REMEDY_SHORT}",
    )  # fmt: skip


def _speed(run: Executed, plan: Plan, timing: Timing) -> Check:
    """Return the check of the speed between the ramps at both ends."""
    share, at = timing.slowest
    node = _node(run, plan, float(np.interp(at, timing.length, timing.time)))
    said = f"the programmed speed is held on {timing.held:.1%} of the length, as the joints keep "
    return check(
        "speed-as-run", "loss of programmed speed, between the ramps", 1 - share, 1 - AT_SPEED,
        "share", node, level="warning", advice=f"{said}their limits",
    )  # fmt: skip


def _deviations(
    job: Job, run: Executed, off: PathError, plan: Plan, path: Contour
) -> Iterator[Check]:
    """Yield the checks of tip and tool axis against the path, as the joints execute the run."""
    allowed = job.tolerances
    cone = 0.0 if job.options.tilt is None else job.options.tilt.cone
    tip, by_model = allowed_off(job), job.compensation == "model"
    strict = by_model or (job.compensation is None and job.path_tolerance is not None)
    if job.compensation is None:
        advice = _closer(run, off, plan, path, tip)
    elif by_model:
        advice = (
            "targets are not moved as compensation asks: see there if it is refused, else write "
            "the program again"
        )
    else:
        advice = "by the model of the response; the measured runs say what is really left"
    # Of corners alone unless the joints lag; then by a model, which no program is refused for.
    yield check(
        "tip-as-run", "distance of the tool tip from the path as run", off.largest, tip, "m",
        _nearest(plan, off.T[off.worst]), level="error" if strict else "warning", advice=advice,
    )  # fmt: skip
    yield check(
        "axis-as-run", "angle of the tool axis to that of the path as run",
        off.axis[off.worst_axis], allowed.axis + cone, "rad",
        _nearest(plan, off.T[off.worst_axis]), level="warning",
        advice="sample the contour more finely, or smooth its axes",
    )  # fmt: skip


def _closer(run: Executed, off: PathError, plan: Plan, path: Contour, tip: float) -> str:
    """Return what a distance beyond `tip`, m, consists of, and what would reduce it."""
    if off.largest <= tip:
        return ""
    k, response = off.worst, off.response
    said = f"{off.cause}, at s = {off.s[k] * 1e3:.1f} mm"
    if response.model != "ideal":
        said += f" ({response.words}"
        said += f"; {off.range_words})" if off.range_words else ")"
    if off.rounding[k] > tip:
        return f"{said}; {_narrower(run.controller)}, or sample the contour more finely"
    share = share_within(run, path, tip, response)
    if share is None:
        return f"{said}; a lower speed alone does not keep it: {_narrower(run.controller)}"
    return f"{said}; this motion keeps it at {at_most(60 * share * speed_of(plan), 2)} m/min"


def _narrower(controller: Controller) -> str:
    """Return the advice to round corners less."""
    if controller.rounds_by_itself:
        return "let the controller round corners less, see the page of its language"
    return "write a lower zone_error_mm in [program]"


def _node(run: Executed, plan: Plan, time: float) -> int:
    """Return the node nearest to the tip at a time, s."""
    return _nearest(plan, run.tool_motion.poses(np.array([time]))[0])


def _nearest(plan: Plan, T: Array) -> int:
    """Return the node nearest to the tip in a pose, (4, 4) m."""
    return int(np.argmin(np.linalg.norm(plan.T_part_tip[:, :3, 3] - T[:3, 3], axis=1)))


def kept_between_nodes(job: Job, plan: Plan) -> Kept | None:
    """Return the plan with lower limits at its nodes, so that those between them hold.

    None if the job does not ask for it, or its program cannot be made.
    """
    if not keeps_between_nodes(job):
        return None
    try:
        return keep_limits(plan, _program(job), controller=job.program.rules.controller)
    except InputError:  # reported when the program is written
        return None


def keeps_between_nodes(job: Job) -> bool:
    """Return whether plans of a job get lower limits at nodes, to keep those between nodes."""
    options = job.options
    moves_gamma = options.method == "continuous" or (options.method == "exact" and options.refine)
    fits = moves_gamma and options.feed == "constant" and options.tilt is None
    return options.between_nodes != "reported" and fits and not _not_modelled(job)


def runs_of(job: Job, plans: Sequence[Plan], of: str) -> list[Executed]:
    """Return the runs of plans' programs whose joints and motion are known, `of` is their file.

    Raises
    ------
    InputError
        As `run_of`, or there is no such run.
    """
    with about(job.path):
        runs = [(plan.name, run_of(job, plan)) for plan in plans]
    found = [replace(run, section=name) for name, run in runs if run is not None and run.reached]
    if not found:
        raise InputError(f"{of}: expected a cut whose motion is known, got none")
    return found


def _program(job: Job) -> Callable[[Plan], Program]:
    return lambda plan: build_program([plan], job.program)


def _not_modelled(job: Job) -> str:
    """Return why the motion of the job's programs between the nodes is unknown; else empty."""
    if job.program.language == "none":
        return "there is no program; name a language in [program]"
    if not job.program.robot_language.zones:
        return f"{job.program.language} has no zones: its corners are not modelled here"
    if job.program.zone == 0:
        return 'the robot stops at every node; write zone_mm = "auto" in [program]'
    return ""


def _check(what: str, peak: Peak, bound: float, run: Executed, plan: Plan) -> Check:
    """Return the check of the largest share of one kind of limit."""
    proved = not run.sampled
    how = "at every instant" if proved else "sampled"
    how += ", corners assumed" if run.controller.assumed else ""
    share, joint = max(peak.share, bound) if proved else peak.share, peak.joint
    slows = "exceeds its limit, so the controller slows down there"
    return check(
        f"{what}-as-run", f"joint {what} share as run, {how}", share, 1 + ZONE_SLACK, "share",
        _node(run, plan, peak.time), advice=f"{plan.robot.joint_names[joint]} {slows}",
    )  # fmt: skip


# -----------------------------------------------------------------------------
# Plans as the program of a job cuts them: with targets moved, where [program] asks for that.


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
    title = "cuts whose targets cannot be moved so that they are executed as drawn"
    return count("compensation", title, 1, advice=why)


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
