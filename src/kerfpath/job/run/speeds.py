"""The fastest constant speeds of a job's contours."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from math import inf, isfinite, sqrt

from kerfpath.arrays import short_repr
from kerfpath.cell import Cell
from kerfpath.contour import Contour
from kerfpath.errors import InputError, NoFeasiblePath
from kerfpath.execution import Executed, Kept, share_within
from kerfpath.graph import LayeredGraph
from kerfpath.job.as_run import allowed_off, keeps_between_nodes, kept_between_nodes, run_of
from kerfpath.job.format import ContourSpec, Job, prepare
from kerfpath.planner import FastestSpeed, best_motion, fastest_speed, plan
from kerfpath.plans import Plan
from kerfpath.progress import Progress, no_progress

# -----------------------------------------------------------------------------
# A fast speed of a contour at which its program also keeps the limits between the nodes.

HALVINGS, CLOSE = 4, 1.02
"""Most bisections between a speed that keeps the limits and one that was not found to; and the
factor between them from which on there are none."""
SLOWER, MUCH_SLOWER = 0.97, 0.5
"""Factors on a speed that does not keep the limits, for the next one that is tried: the largest,
and the one where no run says more."""
TRIES = 6


def speed_as_run(
    job: Job, nodes: Contour, cell: Cell | None, fastest: float
) -> tuple[float, Kept] | None:
    """Return a speed, m/s, at which the program of a plan keeps the limits between the nodes.

    It is at most `fastest`, m/s, at which a path exists at the nodes. It is found by drafts of
    plans, and proved for that speed and the plan that is returned; a faster one may exist. None if
    the job does not ask for it, or if none is found. Times of the nodes are those at 1 m/s.
    """
    if not keeps_between_nodes(job):
        return None
    kept = partial(_kept, job, nodes, cell)
    low, high, drafted = fastest, fastest, True
    for _ in range(TRIES):
        tried = kept(low, draft=True)
        if _is_done(tried):
            break
        low, high, drafted = low * _share(tried), low, tried is not None
    else:
        return None
    for _ in range(HALVINGS):
        if high <= CLOSE * low:
            break
        middle = sqrt(low * high)
        tried = kept(middle, draft=True)
        if _is_done(tried):
            low = middle
        else:
            high, drafted = middle, tried is not None
    # Where there is no draft there may be a plan.
    without_draft = [high] if high > low and not drafted else []
    for speed in without_draft + [low * SLOWER**i for i in range(TRIES)]:
        if (found := kept(speed)) is not None and found.done:
            return speed, found
    return None


def speed_true_to_path(job: Job, run: Executed | None, path: Contour, speed: float) -> float | None:
    """Return a speed, m/s, at which the executed path is within the path tolerance of the job.

    It is that of a run at `speed`, m/s, when it is run more slowly. None if no speed helps, or the
    motion between the nodes is not known.
    """
    if run is None or not run.reached:
        return None
    share = share_within(run, path, allowed_off(job), job.response)
    return None if share is None else speed * share


def _run_at(job: Job, nodes: Contour, cell: Cell | None, speed: float) -> Executed | None:
    """Return the run of a plan at a speed, m/s; None without a plan, or if it is not known."""
    made = _planned(job, nodes, cell, speed)
    try:
        return None if made is None else run_of(job, made)
    except InputError:  # reported when the program is written
        return None


def _share(kept: Kept | None) -> float:
    """Return an estimate of the share of its speed at which a plan keeps the limits."""
    run: Executed | None = None if kept is None else kept.run
    slower = inf if run is None else max(run.velocity_bound, sqrt(run.acceleration_bound))
    return min(1 / slower, SLOWER) if isfinite(slower) else MUCH_SLOWER


def _is_done(kept: Kept | None) -> bool:
    """Return whether there is a plan, and it keeps the limits between its nodes."""
    return kept is not None and kept.done


def _kept(
    job: Job, nodes: Contour, cell: Cell | None, speed: float, *, draft: bool = False
) -> Kept | None:
    """Return a plan at a speed with the limits kept between its nodes; None without a plan."""
    made = _planned(job, nodes, cell, speed, draft=draft)
    return None if made is None else kept_between_nodes(job, made)


def _planned(
    job: Job, nodes: Contour, cell: Cell | None, speed: float, *, draft: bool = False
) -> Plan | None:
    """Return a plan at a speed, m/s; None if there is none. Times of nodes are those at 1 m/s.

    A `draft` is the best of the first motions found over continuous gamma.
    """
    timed = nodes.time is not None
    nodes = nodes if nodes.time is None else replace(nodes, time=nodes.time / speed)
    at = None if timed else speed
    options = replace(job.options, certify=None, between_nodes="reported")
    try:
        if draft and options.method == "continuous":
            return best_motion(nodes, job.setup_in(cell), options, speed=at, thorough=False)
        return plan(
            nodes, job.robot, tool=job.tool, placement=job.placement, speed=at, options=options,
            cell=cell,
        )  # fmt: skip
    except NoFeasiblePath:
        return None


# -----------------------------------------------------------------------------
# The fastest constant speeds of a job's contours.


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ContourSpeed:
    """How fast a contour can be cut.

    Parameters
    ----------
    task : ContourSpec
    nodes : Contour
    at_nodes : FastestSpeed or NoFeasiblePath
        The fastest constant speed at which the limits hold at the nodes; or why there is none.
    as_run : float m/s, optional
        A speed at which they hold between the nodes, too, see `speed_as_run`; None if the job does
        not keep them there, or if none was found.
    true_to_path : float m/s, optional
        A speed at which the executed path is within the path tolerance, too, see
        `speed_true_to_path`; None if none was found, or the motion between the nodes is not known.
    """

    task: ContourSpec
    nodes: Contour
    at_nodes: FastestSpeed | NoFeasiblePath
    as_run: float | None = None
    true_to_path: float | None = None

    __repr__ = short_repr


def fastest_along(
    job: Job,
    nodes: Contour,
    cell: Cell | None,
    *,
    refine: bool,
    graph: LayeredGraph | None = None,
    ceiling: bool = False,
    enough: float | None = None,
    explore: bool = True,
) -> FastestSpeed:
    """Return the fastest constant speed of a contour, free of collisions if there is a cell.

    With `ceiling`, the result also has the speed from which on no motion is possible, if that is
    proved. Off the grid, a speed of at least `enough`, m/s, may be returned although faster ones
    exist, and without `explore` one that is some per cent lower.
    """
    return fastest_speed(
        nodes,
        job.robot,
        tool=job.tool,
        placement=job.placement,
        options=replace(job.options.without_penalties, refine=refine),
        cell=cell,
        graph=graph,
        ceiling=ceiling,
        enough=enough,
        explore=explore,
    )


def leaves_grid(job: Job) -> bool:
    """Return whether plans of a job may leave the grid of gamma."""
    return job.options.refine or job.options.method == "continuous"


def fastest_speeds(job: Job, *, progress: Progress = no_progress) -> list[ContourSpeed]:
    """Return the fastest constant speed of each contour of a job, at its nodes and as run.

    They are speeds to be asked for in place of those of the job: a cut stays slower where its job
    has shares of its speed, or its axis turns about sharp edges. The penalties of [comfort] have no
    effect. Each contour is cut as its first candidate.

    Raises
    ------
    InputError
        As `run_job`.
    """
    prepared, answers = prepare(job), list[ContourSpeed]()
    cell = prepared.cell
    for i, request in enumerate(prepared.contours):
        task, first = request.task, request.candidates[0]
        progress("contours", i, len(prepared.contours))
        progress(f"{task.name}: fastest speed", 0, 0)
        nodes, own = first.nodes, replace(job, options=request.options)
        if nodes.time is not None:
            nodes = replace(nodes, time=nodes.time * task.speed)  # at 1 m/s
        try:
            found = fastest_along(own, nodes, cell, refine=leaves_grid(job), ceiling=True)
        except NoFeasiblePath as broken:
            answers.append(ContourSpeed(task=task, nodes=nodes, at_nodes=broken))
            continue
        progress(f"{task.name}: between the nodes", 0, 0)
        free = replace(own, options=own.options.without_penalties)
        kept = speed_as_run(free, nodes, cell, found.speed)
        if kept is None:
            speed, run = found.speed, _run_at(free, nodes, cell, found.speed)
        else:
            speed, run = kept[0], kept[1].run
        answers.append(
            ContourSpeed(
                task=task,
                nodes=nodes,
                at_nodes=found,
                as_run=None if kept is None else speed,
                true_to_path=speed_true_to_path(free, run, first.path, speed),
            )
        )
    return answers
