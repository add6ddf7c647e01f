"""The layout study: find the best placement of a job, and write it."""

from __future__ import annotations

import json
import os
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import cast

import numpy as np

from kerfpath import __version__
from kerfpath.arrays import short_repr
from kerfpath.contour import Contour
from kerfpath.errors import InputError
from kerfpath.front import follows_courses
from kerfpath.job import Goal, Job, LayoutTable, cell_of_job, make_folder
from kerfpath.planner import require_rates_alone
from kerfpath.post import write_set
from kerfpath.progress import Progress, no_progress
from kerfpath.report import LayoutEntry, render_layout
from kerfpath.study.loaded_job import SampledContour, job_key, load_job, sample_contours
from kerfpath.study.placing.evaluators import (
    ContourValue,
    OffGridEvaluator,
    PlacementEvaluator,
    PlacementValue,
    Stage,
    is_better,
    is_estimated,
    leaves_grid,
    worst_of,
)
from kerfpath.study.placing.place import (
    DEFAULT_RANGES,
    Numbers,
    middle_of,
    move_job,
    numbers_of,
    placed_text,
)
from kerfpath.study.placing.search import (
    LEAST_EXACT,
    MOST_EXACT,
    PlacementMap,
    PlacementSearch,
    PlacementTrial,
)
from kerfpath.sweep import Sweep

# -----------------------------------------------------------------------------
# The task: evaluate a placement together with its errors.


def evaluate_placements(
    *,
    job: str,
    digest: str,
    goal: str,
    places: list[dict[str, float]],
    stretches: list[list[int]],
    exact: bool = False,
    whole: bool = False,
    prove: bool = False,
    floor: float | None = None,
) -> dict[str, object]:
    """Return the `PlacementValue` of the worst of several placements; the task of a sweep.

    They are evaluated over continuous gamma if the job's method is "continuous", otherwise on its
    grid.

    Parameters
    ----------
    job, digest
        As in `load_job`.
    goal : {"speed", "margin", "motion"}
    places : list of mapping
        Offsets by variable; the first is the nominal placement, the others are its errors.
    stretches : list of (contour, first node, last node)
        Stretches that are solved for the bound or the estimate.
    exact : bool
        Also solve the contours, unless the placement is infeasible before.
    whole : bool
        Solve every contour of the nominal placement to its own optimum.
    prove : bool
        Over continuous gamma: only try to prove by the stretches that no motion is faster than the
        floor.
    floor : float, optional
        Best value so far; values that do not beat it need not be exact.
    """
    known = load_job(job, digest)
    contours = contours_of(job, digest)
    middle = middle_of(known.job, nodes_of(contours))
    of_contours: tuple[ContourValue, ...] = ()
    worst: PlacementValue | None = None
    for i, offsets in enumerate(places):
        kind = OffGridEvaluator if leaves_grid(known.job) else PlacementEvaluator
        evaluator = kind(
            job=move_job(known.job, numbers_of(known.job, offsets, middle)),
            part=known.part,
            goal=goal,
            contours=contours,
        )
        if prove and floor is not None and isinstance(evaluator, OffGridEvaluator):
            here = evaluator.disproved(stretches, floor)
        else:
            here = evaluator.evaluate(
                stretches,
                exact=exact,
                whole=whole and i == 0,
                floor=floor,
                least=None if worst is None else worst.value,
            )
        of_contours, here = of_contours or here.contours, replace(here, place=i)
        worst = here if worst is None else _worse(goal, worst, here)
        if not worst.feasible:
            break
        if (
            floor is not None
            and worst.bound is not None
            and not is_better(goal, worst.bound, floor)
        ):
            break
    assert worst is not None
    return asdict(replace(worst, contours=of_contours))


def _worse(goal: str, one: PlacementValue, two: PlacementValue) -> PlacementValue:
    """Return the worse of two placement values."""
    if not two.feasible:
        return two
    bound, estimate = (
        worst_of(goal, known) if (known := [v for v in pair if v is not None]) else None
        for pair in ((one.bound, two.bound), (one.estimate, two.estimate))
    )
    first = (one.bound, one.estimate) == (bound, estimate)
    exact = None if one.value is None or two.value is None else [one.value, two.value]
    return replace(
        two,
        bound=bound,
        value=None if exact is None else worst_of(goal, exact),
        estimate=estimate,
        slowest=one.slowest if first else two.slowest,
        place=one.place if first else two.place,
    )


@lru_cache(maxsize=2)
def contours_of(job: str, digest: str) -> tuple[SampledContour, ...]:
    """Return the contours of a job, sampled as they are planned."""
    known = load_job(job, digest)
    return sample_contours(known.job, known.part)


def nodes_of(contours: Sequence[SampledContour]) -> list[Contour]:
    """Return the nodes of sampled contours."""
    return [contour.nodes for contour in contours]


# -----------------------------------------------------------------------------
# Find the best placement: a global search on bounds or estimates, then exact values.

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
    given = _checked(
        goal=goal,
        evaluations=evaluations,
        seed=seed,
        tolerance_mm=tolerance_mm,
        tolerance_deg=tolerance_deg,
        map_points=map_points,
    )
    return layout_as(
        job,
        load_job(**job_key(Path(job))).job.layout.model_copy(update=given),
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
    key = job_key(Path(job))
    at = load_job(**key)
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
            task={**key, "goal": table.goal},
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
        middle = middle_of(at.job, nodes_of(contours_of(**key)))
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


# -----------------------------------------------------------------------------
# Write layout.json, layout.html and the moved job placed.toml.

SCHEMA = 2
"""Version of the format of layout.json."""
UNITS = {"speed": "m/min", "margin": "times the speed asked for", "motion": ""}
OF_CONTOUR = ("value", "at_least", "fastest_m_min", "joint", "limit", "node")
WHY = ("reason", "contour", "node", "nodes", "progress")


def layout_entry(found: Layout) -> LayoutEntry:
    """Return the content of layout.json as plain data, which is the same for the same seed."""
    best, before = found.best, found.before
    entry = {
        "schema": SCHEMA,
        "kerfpath": __version__,
        "job": found.job.path.name,
        "goal": found.goal,
        "off_grid": found.off_grid,
        "unit": UNITS[found.goal],
        "ranges": {name: list(span) for name, span in found.ranges.items()},
        "default_ranges": found.by_default,
        "standing": list(found.job.layout.standing),
        "tolerance": dict(found.tolerance),
        "seed": found.seed,
        "evaluations": found.evaluations,
        "feasible": best is not None,
        "shipped": before.entry("status", "value", *WHY),
        "best": None if best is None else _best(found, best),
        "contours": _contours(before, found.after),
        "proved": found.proved,
        "open_bound": found.open_bound,
        "statuses": found.statuses,
        "stages": found.stages,
        "exact_searches": found.solved,
        "estimated": found.estimated,
        "estimate_error": None if found.estimate_error is None else list(found.estimate_error),
        "reasons": _reasons(found),
        "nearest": None if best is not None else _trial(found.nearest),
        "evolved": found.evolved,
        "tried": [_trial(trial) for trial in found.tried],
        "map": _map(found),
    }
    return cast(LayoutEntry, entry)


def _best(found: Layout, best: PlacementTrial) -> dict[str, object]:
    value, shipped = best.result.value, found.before.value
    gain = None
    if shipped is not None and value is not None:
        gain = shipped / value - 1 if found.goal == "motion" else value / shipped - 1
    cell = found.job.cell
    names = {
        "fixture": [] if cell is None else [fixture.name for fixture in cell.fixture],
        "external": [axis.name for axis in found.job.robot.externals],
    }
    numbers = {
        ".".join(
            names[str(before)][step] if isinstance(step, int) else step
            for before, step in zip(("", *where), where, strict=False)
        ): value
        for where, value in found.numbers.items()
    }
    return {"offsets": dict(best.offsets), "value": value, "gain": gain, "numbers": numbers}


def _contours(before: PlacementValue, after: PlacementValue | None) -> list[dict[str, object]]:
    """Return the value of each contour in the job's placement and in the best one."""
    sides = [
        {
            contour.name: {k: v for k in OF_CONTOUR if (v := getattr(contour, k)) is not None}
            for contour in (() if side is None else side.contours)
        }
        for side in (before, after)
    ]
    names = dict.fromkeys([*sides[0], *sides[1]])
    return [{"name": n, "before": sides[0].get(n), "after": sides[1].get(n)} for n in names]


def _trial(trial: PlacementTrial) -> dict[str, object]:
    known = trial.result.entry("status", "stage", "bound", "value", "estimate", *WHY)
    return {"offsets": dict(trial.offsets), **known}


def _reasons(found: Layout) -> list[dict[str, object]]:
    """Return why placements are infeasible, by contour, the most common first."""
    every = [why for trial in found.tried if (why := trial.result.infeasibility)]
    reasons: list[dict[str, object]] = []
    for (status, contour), number in Counter((w.status, w.contour) for w in every).most_common():
        same = [why for why in every if (why.status, why.contour) == (status, contour)]
        nodes = Counter(why.node for why in same).most_common(1)
        reasons.append(
            {
                "status": status,
                "contour": contour,
                "count": number,
                "node": nodes[0][0],
                "reason": Counter(why.reason for why in same).most_common(1)[0][0],
            }
        )
    return reasons


def _map(found: Layout) -> dict[str, object] | None:
    if found.map is None:
        return None
    return {
        "variables": list(found.ranges)[:2],
        "x": found.map.x.tolist(),
        "y": found.map.y.tolist(),
        "cells": [
            each.result.entry("status", "bound", "value", "estimate", "reason", "contour", "node")
            for each in found.map.trials
        ],
    }


def write_layout(found: Layout, folder: Path) -> list[Path]:
    """Write layout.json and layout.html, and placed.toml if a placement is feasible.

    Raises
    ------
    InputError
        The folder cannot be created or written to.
    """
    make_folder(folder)
    entry = layout_entry(found)
    files = {
        "layout.json": json.dumps(entry, indent=1, allow_nan=False) + "\n",
        "layout.html": render_layout(entry, job_text=found.job.path.read_text("utf-8-sig")),
    }
    if found.best is not None:
        files["placed.toml"] = placed_text(
            found.job, found.numbers, folder.resolve(), _remark(found.job.path, found.best.offsets)
        )
    return write_set(folder, files)


def _remark(job: Path, offsets: Mapping[str, float]) -> str:
    moves = ", ".join(f"{name} = {value:g}" for name, value in offsets.items())
    return f"{job.name} as placed by kerfpath layout: {moves}. Ranges now count from here."
