"""The fastest constant speeds of a job's contours."""

from __future__ import annotations

from dataclasses import dataclass, replace

from kerfpath._repr import short_repr
from kerfpath.cell import Cell
from kerfpath.contour import Contour
from kerfpath.errors import NoFeasiblePath
from kerfpath.graph import LayeredGraph
from kerfpath.job.format import ContourSpec, Job, cell_of_job
from kerfpath.job.run._speed_as_run import speed_as_run
from kerfpath.planner import FastestSpeed, fastest_speed
from kerfpath.progress import Progress, no_progress

__all__ = ["ContourSpeed", "fastest_along", "fastest_speeds", "leaves_grid"]


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
    """

    task: ContourSpec
    nodes: Contour
    at_nodes: FastestSpeed | NoFeasiblePath
    as_run: float | None = None

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
) -> FastestSpeed:
    """Return the fastest constant speed of a contour, free of collisions if there is a cell.

    With `ceiling`, the result also has the speed from which on no motion is possible, if that is
    proved. Off the grid, a speed of at least `enough`, m/s, may be returned although faster ones
    exist.
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
    )


def leaves_grid(job: Job) -> bool:
    """Return whether plans of a job may leave the grid of gamma."""
    return job.options.refine or job.options.method == "continuous"


def fastest_speeds(job: Job, *, progress: Progress = no_progress) -> list[ContourSpeed]:
    """Return the fastest constant speed of each contour of a job, at its nodes and as run.

    The speeds in the job, shares of them, and the penalties of [comfort] have no effect.

    Raises
    ------
    InputError
        As `run_job`.
    """
    part = job.read_part()
    cell = cell_of_job(job, part)
    answers = []
    tasks = job.tasks(part)
    for i, task in enumerate(tasks):
        progress("contours", i, len(tasks))
        progress(f"{task.name}: fastest speed", 0, 0)
        nodes, own = task.evenly_fast(part), replace(job, options=task.asked(job.options))
        try:
            found = fastest_along(own, nodes, cell, refine=leaves_grid(job), ceiling=True)
        except NoFeasiblePath as broken:
            answers.append(ContourSpeed(task=task, nodes=nodes, at_nodes=broken))
            continue
        progress(f"{task.name}: between the nodes", 0, 0)
        free = replace(own, options=own.options.without_penalties)
        as_run = speed_as_run(free, nodes, cell, found.speed)
        answers.append(ContourSpeed(task=task, nodes=nodes, at_nodes=found, as_run=as_run))
    return answers
