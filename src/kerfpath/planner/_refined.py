"""Plans off the grid: the best refinement of the paths worth starting from."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kerfpath import refiner
from kerfpath.errors import NoFeasiblePath
from kerfpath.planner._clear import ClearSearch
from kerfpath.planner._quickest import QuickMotion
from kerfpath.planner._task import PlanningTask
from kerfpath.plans import Plan, Proof, path_cost
from kerfpath.refiner import Refinement
from kerfpath.search import find_shortest

__all__ = ["plan_first_order", "plan_off_grid", "plan_slowly", "refine_plan"]


def refine_plan(task: PlanningTask, finder: ClearSearch, made: Plan) -> Plan:
    """Return the plan moved off its grid, clear and at least as good; unchanged if that fails.

    A refinement ends in the nearest optimum. The grid quantises the acceleration, so its best
    path under (6) may be far from the best motion, and its best path without (6) close to it: both
    are refined. With a jerk limit, which the grid ignores, the result may cost more.

    Raises
    ------
    NoFeasiblePath
        The jerk is limited, and no motion was found within the limit.
    """
    first = plan_first_order(task, finder)
    starts = [made]
    if first is not None and not np.array_equal(first.q, made.q):
        starts.append(first)
    found = [refiner.refine(start) for start in starts]
    jerk = task.robot.jerk_limit()
    done = [f for f in found if f.done and (jerk is not None or f.cost_after <= made.cost)]
    clear = [f for f in done if finder.is_clear(f.plan)]
    if not clear:
        why = f"not refined: off the grid it would {'not be clear' if done else 'cost more'}"
        why = why if found[0].done else found[0].statement
        if jerk is not None:
            raise NoFeasiblePath(
                f"contour {task.contour.name!r}: no motion was found within the jerk limits, "
                f"which the search of the grid ignores; {why}",
                proved=False,
                node=len(made.q) - 1,
            )
        statement = f"{made.proof.statement}; {why}"
        return replace(made, proof=replace(made.proof, statement=statement))
    best = min(clear, key=lambda f: f.cost_after)
    how = "" if best is found[0] else " by way of the best path without acceleration limits"
    statement = (
        f"{made.proof.statement}; refined off the grid{how}: cost {made.cost:.6g} to "
        f"{best.cost_after:.6g}"
    )
    optimal = made.proof.optimal and best.cost_after <= made.cost
    proof = Proof(optimal=optimal, statement=statement, grid_cost=made.cost)
    return replace(best.plan, proof=proof)


def plan_off_grid(task: PlanningTask, finder: ClearSearch) -> Refinement | None:
    """Look for a motion close to the best path without (6), for graphs without a path.

    If a path breaks (6) only because gamma changes in steps, a motion close to it may keep (6). The
    motion found is clear in the cell; None if (5) alone leaves no path.
    """
    first = plan_first_order(task, finder)
    return None if first is None else _keep_if_clear(refiner.refine(first), finder)


def plan_slowly(task: PlanningTask, quick: QuickMotion, finder: ClearSearch) -> Plan | None:
    """Return the plan at the speed asked for, refined from a motion that is at least as quick.

    Slowed down, that motion uses less of every limit, so it keeps them, too. None if a limit on the
    rotation is not kept.
    """
    asked = task.settings
    begun = replace(quick.plan, settings=asked, time=task.times)
    claim = "found among the quickest motions"
    cost = path_cost(
        begun.increments, asked.weights, asked.metric, asked.objective, begun.node_cost
    )
    begun = replace(begun, cost=cost, proof=Proof(optimal=False, statement=claim))
    found = refiner.refine(begun)
    if found.done and finder.is_clear(found.plan):
        return found.plan
    return begun if asked.rotation is None else None


def _keep_if_clear(found: Refinement, finder: ClearSearch) -> Refinement:
    """Return the refinement, marked as not done if its plan is not clear."""
    if not found.done or finder.is_clear(found.plan):
        return found
    return replace(found, done=False, statement="the motion within the limits would not be clear")


def plan_first_order(task: PlanningTask, finder: ClearSearch) -> Plan | None:
    """Return the best path without (6); None if (5) alone leaves no path."""
    limits = task.problem.limits.without_acceleration()
    try:
        path = finder.find(find_shortest, replace(task.problem, limits=limits, method="exact"))
    except NoFeasiblePath:
        return None
    claim = "the best path on this graph without acceleration limits"
    return task.plan(path.index, path.cost, Proof(optimal=False, statement=claim))
