"""feed="dip": the path to slow down, the least time it takes, and where the speed dips."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kerfpath import refiner
from kerfpath.planner._clear import ClearSearch
from kerfpath.planner._refined import plan_first_order
from kerfpath.planner._task import PlanningTask
from kerfpath.plans import Plan, Proof
from kerfpath.retime import feed, retime
from kerfpath.search import find_slowed

__all__ = ["plan_slowed"]


def plan_slowed(task: PlanningTask, finder: ClearSearch, *, refine: bool) -> Plan:
    """Return a plan that keeps the speed asked for wherever its path lets it, and dips elsewhere.

    On the grid two paths are worth their least times under all limits: the one that loses the least
    time, priced above all distances, if each step had to be slow on its own, and the best one
    without acceleration limits, where there is one. With `refine` gamma also moves off the grid
    from each to ask for little beyond the limits, and the quicker of the two, or if that is not
    clear the other, is refined. The plan is the quickest, and of equally quick ones the cheapest.
    """
    slowed, first = _least_lost(task, finder), plan_first_order(task, finder)
    starts = [slowed]
    if first is not None and not np.array_equal(first.q, slowed.q):
        starts.append(first)
    on_grid = min((_with_least_times(task, start) for start in starts), key=_time_and_cost)
    if not (refine and task.robot.family.free_rotation):
        return on_grid
    why = "take longer"
    for eased in sorted((_ease(task, start) for start in starts), key=_time_and_cost):
        again = _with_least_times(task, refiner.refine(eased).plan)
        made = min(again, eased, key=_time_and_cost)
        if _time_and_cost(made) > _time_and_cost(on_grid):
            continue
        broken = _broken(task, finder, made)
        if not broken:
            return made
        why = broken
    claim = f"{on_grid.proof.statement}; not refined: off the grid it would {why}"
    return replace(on_grid, proof=replace(on_grid.proof, statement=claim))


def _ease(task: PlanningTask, start: Plan) -> Plan:
    """Return the plan off the grid that asks for little beyond the limits, with its least times."""
    claim = f"{start.proof.statement}; gamma moved off the grid to lose little time"
    eased = replace(refiner.ease(start), proof=Proof(optimal=False, statement=claim))
    return _with_least_times(task, eased)


def _time_and_cost(made: Plan) -> tuple[float, float]:
    """Return the time of a plan, s, without its rounding, and its cost."""
    return round(float(made.time[-1]), 9), made.cost


def _broken(task: PlanningTask, finder: ClearSearch, made: Plan) -> str:
    """Return what a plan off the grid would break; empty where nothing."""
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
    """Return the plan with the least times, and where they dip."""
    limits = task.problem.limits
    tau = retime(made.increments, task.dt, limits)
    dips = feed(tau, task.dt, made.increments, limits, np.diff(made.contour.s))
    return replace(made, time=np.concatenate([[0.0], np.cumsum(tau)]), feed=dips)
