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

    On the grid the path is the one that loses the least time, priced above all distances, if each
    step had to be slow on its own. With `refine` gamma moves off the grid to ask for little beyond
    the limits, from the best path without acceleration limits, where there is one. The times along
    the path are then the least under all limits; the refinement keeps them, and they are set anew.
    What would not be clear off the grid stays on it.
    """
    free = refine and task.robot.family.free_rotation
    start = plan_first_order(task, finder) if free else None
    start = _least_lost(task, finder) if start is None else start
    if not free:
        return _with_least_times(task, start)
    eased = refiner.ease(start)
    claim = f"{start.proof.statement}; gamma moved off the grid to lose little time"
    made = _with_least_times(task, replace(eased, proof=Proof(optimal=False, statement=claim)))
    better = refiner.refine(made)
    again = _with_least_times(task, better.plan)
    best = again if again.time[-1] <= made.time[-1] else made
    comfort, broken = task.settings.comfort, ""
    if comfort is not None and comfort.broken(task.robot, best.q, task.T_flange_tip):
        broken = "break a margin of comfort"
    elif not finder.is_clear(best):
        broken = "not be clear"
    if not broken:
        return best
    kept = plan_slowed(task, finder, refine=False)
    claim = f"{kept.proof.statement}; not refined: off the grid it would {broken}"
    return replace(kept, proof=replace(kept.proof, statement=claim))


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
