"""Find the best placement: a global search on bounds or estimates, then exact values."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kerfpath._repr import short_repr
from kerfpath.errors import InputError
from kerfpath.front import follows_courses
from kerfpath.job import Goal, Job, LayoutTable, cell_of_job
from kerfpath.planner import require_rates_alone
from kerfpath.progress import Progress, no_progress
from kerfpath.study._job import digest, load_job
from kerfpath.study.placing._evaluate import contours_of, evaluate_placements, nodes_of
from kerfpath.study.placing._off_grid import leaves_grid
from kerfpath.study.placing._place import DEFAULT_RANGES, Numbers, middle_of, numbers_of
from kerfpath.study.placing._search import (
    LEAST_EXACT,
    MOST_EXACT,
    PlacementMap,
    PlacementSearch,
    PlacementTrial,
)
from kerfpath.study.placing._value import PlacementValue, Stage, is_estimated
from kerfpath.sweep import Sweep

__all__ = ["STATUSES", "Layout", "layout", "layout_as"]

ON_GRID: tuple[Stage, ...] = ("reach", "stretch", "exact")
OFF_GRID: tuple[Stage, ...] = ("reach", "estimate", "proved", "planned")
"""The tests that decide, in order."""
STATUSES = ("feasible", "speed", "collision", "unreachable")
"""The possible statuses of a placement, the best first."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Layout:
    """The best placement of a job, and all placements that were tried.

    Parameters
    ----------
    job : Job
    goal : {"speed", "margin", "motion"}
    off_grid : bool
        Whether placements are evaluated by plans over continuous gamma instead of paths of the
        grid.
    ranges : mapping of variable to (low, high)
        Range of each variable, in the unit in its name.
    by_default : bool
        Whether the ranges are the default ones.
    tolerance : mapping of variable to float
        Error of each variable, to either side; empty where no tolerance was given.
    seed, evaluations : int
    tried : tuple of PlacementTrial
        All placements, in order; the first is that of the job.
    evolved : int
        Number of placements before those of the map.
    best : PlacementTrial or None
        The best placement; None if none is feasible.
    before, after : PlacementValue
        Values of the job's placement and of the best one, contour by contour.
    proved : bool
        Whether it is proved that no other placement tried is better.
    open_bound : float or None
        Where that is not proved, the best value that the others may have; over continuous gamma,
        the best estimate of the placements that were neither planned nor proved to be no better.
    numbers : Numbers
        Changes of the job file for the best placement.
    map : PlacementMap or None
    """

    job: Job
    goal: Goal
    off_grid: bool
    ranges: Mapping[str, tuple[float, float]]
    by_default: bool
    tolerance: Mapping[str, float]
    seed: int
    evaluations: int
    tried: tuple[PlacementTrial, ...]
    evolved: int
    best: PlacementTrial | None
    before: PlacementValue
    after: PlacementValue | None
    proved: bool
    open_bound: float | None
    numbers: Numbers
    map: PlacementMap | None

    __repr__ = short_repr

    @property
    def statuses(self) -> dict[str, int]:
        """Number of placements with each status."""
        found = Counter(trial.result.status for trial in self.tried)
        return {status: found[status] for status in STATUSES if found[status]}

    @property
    def stages(self) -> dict[str, int]:
        """Number of placements that each test decided."""
        found = Counter(trial.result.stage for trial in self.tried)
        return {stage: found[stage] for stage in (OFF_GRID if self.off_grid else ON_GRID)}

    @property
    def solved(self) -> int:
        """Number of placements solved exactly on the grid, or planned over continuous gamma."""
        return sum(t.searched and t.result.stage != "proved" for t in self.tried)

    @property
    def estimated(self) -> int:
        """Number of placements with only an estimate: neither planned nor proved no better."""
        return sum(is_estimated(trial.result) for trial in self.tried)

    @property
    def estimate_error(self) -> tuple[float, float] | None:
        """Least and largest ratio of value to estimate over the planned placements."""
        both = [(trial.result.value, trial.result.estimate) for trial in self.tried]
        shares = [value / about for value, about in both if value is not None and about]
        return (min(shares), max(shares)) if shares else None

    @property
    def nearest(self) -> PlacementTrial:
        """The placement that is nearest to being feasible."""
        return max(
            self.tried,
            key=lambda trial: why.progress if (why := trial.result.infeasibility) else np.inf,
        )


def layout(
    job: str | os.PathLike[str],
    *,
    store: str | os.PathLike[str],
    goal: Goal | None = None,
    ranges: Mapping[str, tuple[float, float]] | None = None,
    evaluations: int | None = None,
    seed: int | None = None,
    tolerance_mm: float | None = None,
    tolerance_deg: float | None = None,
    map_points: int | None = None,
    scheduler: str | None = None,
    processes: int | None = None,
    progress: Progress = no_progress,
) -> Layout:
    """Return the best placement found in the ranges, which is never worse than the job's own.

    Differential evolution (Storn and Price, J. Global Optim. 11, 1997) searches by bounds on the
    values of placements. Then the placements are solved exactly in the order of their bounds, the
    best first, until the best value is at least as good as the next bound: then no other placement
    tried is better. Where an exact search shows a new stretch that limits the value, the bounds are
    computed again with it. The points of the map around the best placement are evaluated in the
    same way. The same seed gives the same answer, whatever the number of processes.

    Over continuous gamma (the default method of a job), values are those of plans, and estimates
    replace bounds. Placements whose estimates come near the best value are planned; for the others
    a proof is tried that no motion there is faster, see `Layout.proved` and `Layout.estimated`.

    Parameters
    ----------
    job : path
        The job file; its [layout] gives everything that is not given here.
    store : path
        Stores the results: the same call continues where it was stopped.
    goal : {"speed", "margin", "motion"}, optional
        The fastest speed of the slowest contour; the least ratio of the fastest speed to the speed
        asked for; or the total displacement of the best motions at the speeds asked for.
    ranges : mapping of variable to (low, high), optional
        The variables and their ranges; default: the ranges of [layout], or `DEFAULT_RANGES`.
    evaluations : int, optional
        Number of placements that are tried.
    seed : int, optional
    tolerance_mm, tolerance_deg : float, optional
        Error of each variable: the worse of its two ends counts, for one variable at a time.
    map_points : int, optional
        Points of the map along each of two variables, which are also tried; 0: no map.
    scheduler, processes
        As in `kerfpath.sweep.run`.
    progress : callable, optional
        Called with the name of the current stage, how much of it is done, and its total.

    Raises
    ------
    InputError
        As `read_job`, `cell_of_job` and `kerfpath.sweep.run`; also where a number is out of range.
    """
    path = Path(job).resolve()
    given = _checked(
        goal=goal,
        evaluations=evaluations,
        seed=seed,
        tolerance_mm=tolerance_mm,
        tolerance_deg=tolerance_deg,
        map_points=map_points,
    )
    return layout_as(
        path,
        load_job(str(path), digest(path)).job.layout.model_copy(update=given),
        store=store,
        ranges=ranges,
        scheduler=scheduler,
        processes=processes,
        progress=progress,
    )


def layout_as(
    job: str | os.PathLike[str],
    table: LayoutTable,
    *,
    store: str | os.PathLike[str],
    ranges: Mapping[str, tuple[float, float]] | None = None,
    scheduler: str | None = None,
    processes: int | None = None,
    progress: Progress = no_progress,
    found: Callable[[PlacementTrial], None] = lambda trial: None,
) -> Layout:
    """Return the best placement as `layout` does, with a table instead of [layout] of the job.

    Parameters
    ----------
    job, store, ranges, scheduler, processes, progress
        As in `layout`.
    table : LayoutTable
        All other settings of `layout`.
    found : callable, optional
        Called with each placement whenever it is estimated, planned or proved.

    Raises
    ------
    InputError
        As `layout`.
    """
    path, then = str(Path(job).resolve()), digest(Path(job).resolve())
    at = load_job(path, then)
    require_rates_alone(at.job.robot, "a layout")
    at.job.robot.require_no_free_joint("a layout")
    if follows_courses(at.job.robot, at.job.options) and not leaves_grid(at.job):
        raise InputError(
            "a layout: for an arm without a free rotation the bounds hold only on a grid of its "
            'external axes; write method = "exact" in [plan], and the step of each axis'
        )
    cell_of_job(at.job, at.part)  # report errors of the cell once, not for every placement
    spans = dict(ranges or table.ranges or DEFAULT_RANGES)
    allowed = {"mm": table.tolerance_mm, "deg": table.tolerance_deg}
    tolerance = {name: allowed[name.rpartition("_")[2]] for name in spans}
    tolerance = {name: size for name, size in tolerance.items() if size}
    with Sweep(evaluate_placements, store=store, scheduler=scheduler, processes=processes) as sweep:
        search = PlacementSearch(
            sweep=sweep,
            task={"job": path, "digest": then, "goal": table.goal},
            off_grid=leaves_grid(at.job),
            ranges=spans,
            tolerance=tolerance,
            most=max(LEAST_EXACT, int(MOST_EXACT * table.evaluations)),
            progress=progress,
            found=found,
        )
        before = search.first()
        search.evolve(table.evaluations, table.seed)
        proved, open_bound = search.climb()
        evolved, drawn = len(search.trials), None
        if table.map_points:
            drawn = search.mapped(search.best or search.trials[0], table.map_points)
            proved, open_bound = search.climb()  # points of the map may be better
        if search.off_grid:
            proved, open_bound = search.settle()
        best = search.best
        after = None if best is None else search.whole(best)
    numbers: Numbers = {}
    if best is not None:
        middle = middle_of(at.job, nodes_of(contours_of(path, then, table.goal)))
        numbers = numbers_of(at.job, best.offsets, middle)
    return Layout(
        job=at.job,
        goal=table.goal,
        off_grid=search.off_grid,
        ranges=spans,
        by_default=not (ranges or table.ranges),
        tolerance=tolerance,
        seed=table.seed,
        evaluations=table.evaluations,
        tried=tuple(search.trials),
        evolved=evolved,
        best=best,
        before=before,
        after=after,
        proved=proved,
        open_bound=open_bound,
        numbers=numbers,
        map=drawn,
    )


def _checked(**given: float | str | None) -> dict[str, float | str]:
    """Return the given settings that replace [layout]; raise InputError if one is out of range."""
    for name, value in given.items():
        low = 8 if name == "evaluations" else 0
        if isinstance(value, int | float) and not value >= low:
            raise InputError(f"{name}: expected at least {low}, got {value:g}")
    return {name: value for name, value in given.items() if value is not None}
