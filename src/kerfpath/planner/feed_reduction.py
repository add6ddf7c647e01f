"""feed = "dip": paths to slow down, their least times, and where the feed is reduced."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kerfpath import refiner
from kerfpath.planner.collision_free import CollisionFreeSearch
from kerfpath.planner.refinements import plan_first_order
from kerfpath.planner.task import Task
from kerfpath.plans import Plan, Proof
from kerfpath.retime import feed, retime
from kerfpath.search import BeamWidth, ContinuousSearch, SearchProblem, find_slowed

BEAM = BeamWidth(60, (1.1, 1.0))
"""BeamWidth of the search for a path over continuous gamma."""
SLOWER = (1.0, 1.15, 1.4, 2.0)
"""Node intervals at which (6) must hold everywhere, as multiples of the one asked for."""
MOST_LOOKS = 20
"""Most searches for a path whose samples are clear in the cell."""


def plan_slowed(task: Task, finder: CollisionFreeSearch, *, refine: bool) -> Plan:
    """Return a plan at the speed asked for where its path allows it, and slower elsewhere.

    Two paths of the grid get the least times under all limits: the one that loses the least time
    step by step, with lost time priced above all distances, and the best one without acceleration
    limits, if there is one. With `refine`, gamma also moves off the grid from each of them so that
    the limits are exceeded little, and each is refined. With the method "continuous", so are paths
    over continuous gamma: the best one without acceleration limits, and the one that keeps all
    limits at the least constant interval that has one. The plan is the quickest clear one, and of
    equally quick ones the cheapest.
    """
    slowed, first = _least_lost(task, finder), plan_first_order(task, finder)
    starts = [slowed]
    if first is not None and not np.array_equal(first.q, slowed.q):
        starts.append(first)
    on_grid = min((_with_least_times(task, start) for start in starts), key=_time_and_cost)
    if not (refine and task.robot.family.free_rotation):
        return on_grid
    if task.settings.method == "continuous":
        starts += _between_the_samples(task, finder)
    why = "take longer"
    for made in sorted((_off_grid(task, start) for start in starts), key=_time_and_cost):
        if _time_and_cost(made) > _time_and_cost(on_grid):
            break
        broken = _broken(task, finder, made)
        if not broken:
            return made
        why = broken
    claim = f"{on_grid.proof.statement}; not refined: off the grid it would {why}"
    return replace(on_grid, proof=replace(on_grid.proof, statement=claim))


def _off_grid(task: Task, start: Plan) -> Plan:
    """Return the faster of a path with reduced excess and its refinement, with the least times."""
    moved = _with_reduced_excess(task, start)
    return min(moved, _with_least_times(task, refiner.refine(moved).plan), key=_time_and_cost)


def _between_the_samples(task: Task, finder: CollisionFreeSearch) -> list[Plan]:
    """Return the paths over continuous gamma that are worth slowing down; there may be none.

    Each has a constant interval: the one asked for, without (6), and the least of `SLOWER` with it.
    """
    free = replace(task.problem, limits=task.problem.limits.without_acceleration())
    found = [_between(task, finder, free)]
    for times in SLOWER:
        slow = _between(task, finder, replace(task.problem, dt=times * task.dt))
        if slow is not None:
            found.append(slow)
            break
    return [path for path in found if path is not None]


def _between(task: Task, finder: CollisionFreeSearch, problem: SearchProblem) -> Plan | None:
    """Return the best path over continuous gamma of a problem; None if none is found."""
    claim = "no motion was found at constant speed; slowed down from a path over continuous gamma"
    for _ in range(MOST_LOOKS):
        search = ContinuousSearch(finder.open_problem(problem), task.samples)
        paths = list(search.paths(BEAM))
        if not finder.learn([ends for path in paths for ends in (path.one, path.other)]):
            proof = Proof(optimal=False, statement=finder.claimed(claim))
            return task.plan_between(paths[0], proof) if paths else None
    return None


def _with_reduced_excess(task: Task, start: Plan) -> Plan:
    """Return the plan moved off the grid so that it exceeds the limits little, with least times."""
    claim = f"{start.proof.statement}; gamma moved off the grid to lose little time"
    moved = replace(refiner.reduce_excess(start), proof=Proof(optimal=False, statement=claim))
    return _with_least_times(task, moved)


def _time_and_cost(made: Plan) -> tuple[float, float]:
    """Return the time of a plan, s, rounded to 1 ns, and its cost."""
    return round(float(made.time[-1]), 9), made.cost


def _broken(task: Task, finder: CollisionFreeSearch, made: Plan) -> str:
    """Return what a plan off the grid would break, as text; "" if nothing."""
    comfort = task.settings.comfort
    if comfort is not None and comfort.broken(task.robot, made.q, task.setup.tool):
        return "break a margin of comfort"
    return "" if finder.is_clear(made) else "not be clear"


def _least_lost(task: Task, finder: CollisionFreeSearch) -> Plan:
    found = finder.find(find_slowed, task.problem)
    claim = finder.claimed(
        "at constant speed the graph has no path; of all its paths this one loses the least time "
        "step by step"
    )
    return task.plan(found.index, task.cost(found.index), Proof(optimal=False, statement=claim))


def _with_least_times(task: Task, made: Plan) -> Plan:
    """Return the plan with the least times and its feed reduction."""
    limits = task.problem.limits
    tau = retime(made.increments, task.dt, limits)
    dips = feed(tau, task.dt, made.increments, limits, np.diff(made.contour.s))
    return replace(made, time=np.concatenate([[0.0], np.cumsum(tau)]), feed=dips)
