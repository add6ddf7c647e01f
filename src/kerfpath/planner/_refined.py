"""Off the grid: the best of what the refinement makes of the paths worth beginning from."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kerfpath import refiner
from kerfpath.errors import NoFeasiblePath
from kerfpath.planner._task import Task
from kerfpath.plans import Plan, Proof
from kerfpath.refiner import Refinement
from kerfpath.search import least_interval, shortest_path

__all__ = ["first_order", "off_grid", "refined"]

FREE = 1e6
"""Multiple of the acceleration limits that never binds."""
TOO_SLOW = 2.0
"""Multiple of the node interval up to which the fastest path is worth an attempt off the grid."""


def refined(task: Task, made: Plan) -> Plan:
    """Return the plan off its grid, at least as good; where that cannot be, as it is.

    A refinement ends in the nearest optimum. The grid quantises the acceleration, so that its best
    path under (6) may lie far from the best motion, and its best path without (6) close by: both
    are begun from.
    """
    first = first_order(task)
    starts = [made]
    if first is not None and not np.array_equal(first.q, made.q):
        starts.append(first)
    found = [refiner.refine(start) for start in starts]
    done = [f for f in found if f.done and f.cost_after <= made.cost]
    if not done:
        why = "not refined: off the grid it would cost more"
        statement = f"{made.proof.statement}; {why if found[0].done else found[0].statement}"
        return replace(made, proof=replace(made.proof, statement=statement))
    best = min(done, key=lambda f: f.cost_after)
    how = "" if best is found[0] else " by way of the best path without acceleration limits"
    statement = (
        f"{made.proof.statement}; refined off the grid{how}: cost {made.cost:.6g} to "
        f"{best.cost_after:.6g}"
    )
    proof = Proof(optimal=made.proof.optimal, statement=statement, grid_cost=made.cost)
    return replace(best.plan, proof=proof)


def off_grid(task: Task) -> Refinement | None:
    """Look for a motion where the graph has no path; None where that is hopeless.

    Of a path that breaks (6) because gamma can only step, the motion close by may not. Begun from
    the best path without (6), and from the one that asks for the least time.
    """
    first = first_order(task)
    found = None if first is None else refiner.refine(first)
    if found is not None and found.done:
        return found
    least = least_interval(**task.limits)
    if least.dt > TOO_SLOW * task.dt:
        return found
    claim = Proof(optimal=False, statement="the fastest path on this graph")
    return refiner.refine(task.plan(least.index, task.cost(least.index), claim))


def first_order(task: Task) -> Plan | None:
    """Return the best path without (6); None where (5) alone closes the way."""
    limits = task.limits | {"acceleration": FREE * task.limits["acceleration"]}
    try:
        settings = task.settings
        path = shortest_path(
            **limits, **task.aim, closure=settings.closure, rotation=settings.rotation
        )
    except NoFeasiblePath:
        return None
    claim = "the best path on this graph without acceleration limits"
    return task.plan(path.index, path.cost, Proof(optimal=False, statement=claim))
