"""feed="dip": paths to slow down, their least times, and where the speed is reduced."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kerfpath import refiner
from kerfpath.planner._clear import ClearSearch
from kerfpath.planner._refined import plan_first_order
from kerfpath.planner._task import PlanningTask
from kerfpath.plans import Plan, Proof
from kerfpath.retime import feed, retime
from kerfpath.search import ContinuousSearch, Effort, SearchProblem, find_slowed

__all__ = ["plan_slowed"]

EFFORT = Effort(60, (1.1, 1.0))
"""Effort of the search for a path over continuous gamma."""
SLOWER = (1.0, 1.15, 1.4, 2.0)
"""Node intervals at which (6) must hold everywhere, as multiples of the one asked for."""
MOST_LOOKS = 20
"""Most searches for a path whose samples are clear in the cell."""


def plan_slowed(task: PlanningTask, finder: ClearSearch, *, refine: bool) -> Plan:
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


def _off_grid(task: PlanningTask, start: Plan) -> Plan:
    """Return the quicker of an eased path and its refinement, with the least times."""
    eased = _ease(task, start)
    return min(eased, _with_least_times(task, refiner.refine(eased).plan), key=_time_and_cost)


def _between_the_samples(task: PlanningTask, finder: ClearSearch) -> list[Plan]:
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


def _between(task: PlanningTask, finder: ClearSearch, problem: SearchProblem) -> Plan | None:
    """Return the best path over continuous gamma of a problem; None if none is found."""
    claim = "no motion was found at constant speed; slowed down from a path over continuous gamma"
    for _ in range(MOST_LOOKS):
        search = ContinuousSearch(finder.open_problem(problem), task.samples)
        paths = list(search.paths(EFFORT))
        if not finder.learn([ends for path in paths for ends in (path.one, path.other)]):
            proof = Proof(optimal=False, statement=finder.claimed(claim))
            return task.plan_between(paths[0], proof) if paths else None
    return None


def _ease(task: PlanningTask, start: Plan) -> Plan:
    """Return the plan moved off the grid so that it exceeds the limits little, with least times."""
    claim = f"{start.proof.statement}; gamma moved off the grid to lose little time"
    eased = replace(refiner.ease(start), proof=Proof(optimal=False, statement=claim))
    return _with_least_times(task, eased)


def _time_and_cost(made: Plan) -> tuple[float, float]:
    """Return the time of a plan, s, rounded to 1 ns, and its cost."""
    return round(float(made.time[-1]), 9), made.cost


def _broken(task: PlanningTask, finder: ClearSearch, made: Plan) -> str:
    """Return what a plan off the grid would break, as text; "" if nothing."""
    comfort = task.settings.comfort
    if comfort is not None and comfort.broken(task.robot, made.q, task.T_flange_tip):
        return "break a margin of comfort"
    return "" if finder.is_clear(made) else "not be clear"


def _least_lost(task: PlanningTask, finder: ClearSearch) -> Plan:
    found = finder.find(find_slowed, task.problem)
    claim = finder.claimed(
        "at constant speed the graph has no path; of all its paths this one loses the least time "
        "step by step"
    )
    return task.plan(found.index, task.cost(found.index), Proof(optimal=False, statement=claim))


def _with_least_times(task: PlanningTask, made: Plan) -> Plan:
    """Return the plan with the least times and its feed reduction."""
    limits = task.problem.limits
    tau = retime(made.increments, task.dt, limits)
    dips = feed(tau, task.dt, made.increments, limits, np.diff(made.contour.s))
    return replace(made, time=np.concatenate([[0.0], np.cumsum(tau)]), feed=dips)
