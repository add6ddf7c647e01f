"""The best placement: a global search on bounds or estimates, then values, the best first."""

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
"""The tests that decide, in their order."""
STATUSES = ("feasible", "speed", "collision", "unreachable")
"""What may become of a placement, the best first."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Layout:
    """The best placement of a job, and all that were tried.

    Parameters
    ----------
    job : Job
    goal : {"speed", "margin", "motion"}
    off_grid : bool
        Whether placements are judged over continuous gamma, by plans, or by paths of the grid.
    ranges : mapping of variable to (low, high)
    by_default : bool
        Whether nobody said what varies.
    tolerance : mapping of variable to float
        What each variable may be off, either way; empty where nobody asked.
    seed, evaluations : int
    tried : tuple of PlacementTrial
        All placements, in order; the first is that of the job.
    evolved : int
        How many there were before those of the map.
    best : PlacementTrial or None
        The best one, unless none is feasible.
    before, after : PlacementValue
        What the job's placement and the best one are worth, contour by contour.
    proved : bool
        Whether it is proved that no other of those tried is better.
    open_bound : float or None
        What the others can come to at best, where it is not proved; over continuous gamma, the best
        estimate of those that were neither planned nor proved to be no better.
    numbers : Numbers
        What the best placement changes in the job.
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
        """How many placements are feasible, and how many not for which reason."""
        found = Counter(trial.result.status for trial in self.tried)
        return {status: found[status] for status in STATUSES if found[status]}

    @property
    def stages(self) -> dict[str, int]:
        """How many placements each test decided."""
        found = Counter(trial.result.stage for trial in self.tried)
        return {stage: found[stage] for stage in (OFF_GRID if self.off_grid else ON_GRID)}

    @property
    def solved(self) -> int:
        """How many placements were solved exactly on the grid, or planned over continuous gamma."""
        return sum(t.searched and t.result.stage != "proved" for t in self.tried)

    @property
    def estimated(self) -> int:
        """How many placements are neither planned nor proved to be no better, but estimated."""
        return sum(is_estimated(trial.result) for trial in self.tried)

    @property
    def estimate_error(self) -> tuple[float, float] | None:
        """The least and the largest share of their estimates that planned placements came to."""
        both = [(trial.result.value, trial.result.estimate) for trial in self.tried]
        shares = [value / about for value, about in both if value is not None and about]
        return (min(shares), max(shares)) if shares else None

    @property
    def nearest(self) -> PlacementTrial:
        """The placement that came nearest to being feasible."""
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
    """Return the best placement that is found in the ranges, never worse than the job's own.

    Differential evolution (Storn and Price, J. Global Optim. 11, 1997) goes by bounds of what
    placements are worth; then the exact search takes the placements tried by their bounds, the best
    first, until the best value is at least the next bound: no other of those tried is better then.
    Where an exact search shows a stretch that binds and was not in the bound, the bounds are found
    again with it. The points of the map about the best are tried in the same way. The same seed
    gives the same answer, whatever the number of processes.

    Over continuous gamma, which the job's method asks for by default, values are those of plans,
    and estimates stand in the place of bounds: placements whose estimates come near the best value
    are planned, and of the others it is proved, as far as can be, that no motion there is faster,
    see `Layout.proved` and `Layout.estimated`.

    Parameters
    ----------
    job : path
        The job file; what is not given here is as its [layout] says.
    store : path
        Keeps what was found: the same call goes on where it was stopped.
    goal : {"speed", "margin", "motion"}, optional
        The fastest speed of the slowest contour; the least share of a fastest speed and the speed
        asked for; or the total displacement of the best motions, at the speeds asked for.
    ranges : mapping of variable to (low, high), optional
        What varies; default: the ranges of [layout], or else `DEFAULT_RANGES`.
    evaluations : int, optional
        Placements that are tried.
    seed : int, optional
    tolerance_mm, tolerance_deg : float, optional
        By how much each variable may be off: the worst of its two ends counts, one at a time.
    map_points : int, optional
        Points of the map along each of two variables, which are tried, too; 0: no map.
    scheduler, processes
        As in `kerfpath.sweep.run`.
    progress : callable, optional
        Called with what is being done, how much of it is done, and how much there is.

    Raises
    ------
    InputError
        As `read_job`, `cell_of_job` and `kerfpath.sweep.run`; numbers out of range.
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
    """Return the best placement as `layout` does, asked for by a table in place of the job's.

    Parameters
    ----------
    job, store, ranges, scheduler, processes, progress
        As in `layout`.
    table : LayoutTable
        All else that `layout` can be asked for.
    found : callable, optional
        Called with each placement whenever more is known of it: estimated, planned, proved.

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
            "a layout: the bounds of an arm that leaves no rotation free hold on a grid of its "
            'external axes alone; write method = "exact" in [plan], and the step of each axis'
        )
    cell_of_job(at.job, at.part)  # what is wrong with it is said once, not by every placement
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
            proved, open_bound = search.climb()  # what the map shows to be better is taken
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
    """Return what is given in place of [layout]; raise InputError where it is out of range."""
    for name, value in given.items():
        low = 8 if name == "evaluations" else 0
        if isinstance(value, int | float) and not value >= low:
            raise InputError(f"{name}: expected at least {low}, got {value:g}")
    return {name: value for name, value in given.items() if value is not None}
