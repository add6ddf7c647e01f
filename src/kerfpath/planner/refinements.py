"""Refinements of a plan: off its grid, from random starts, and towards new options."""

from __future__ import annotations

from dataclasses import replace
from itertools import cycle, islice

import numpy as np

from kerfpath import refiner
from kerfpath.errors import InputError, NoFeasiblePath
from kerfpath.options import PlanOptions
from kerfpath.planner.collision_free import CollisionFreeSearch
from kerfpath.planner.courses import waves
from kerfpath.planner.quickest import QuickMotion
from kerfpath.planner.task import Task
from kerfpath.plans import Plan, Proof, path_cost
from kerfpath.refiner import Refinement
from kerfpath.search import find_shortest


def refine_plan(task: Task, finder: CollisionFreeSearch, made: Plan) -> Plan:
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
        return replace(made, proof=made.proof.also(why))
    best = min(clear, key=lambda f: f.cost_after)
    how = "" if best is found[0] else " by way of the best path without acceleration limits"
    statement = (
        f"{made.proof.statement}; refined off the grid{how}: cost {made.cost:.6g} to "
        f"{best.cost_after:.6g}"
    )
    optimal = made.proof.optimal and best.cost_after <= made.cost
    proof = Proof(optimal=optimal, statement=statement, grid_cost=made.cost)
    return replace(best.plan, proof=proof)


def plan_off_grid(task: Task, finder: CollisionFreeSearch) -> Refinement | None:
    """Look for a motion close to the best path without (6), for graphs without a path.

    If a path breaks (6) only because gamma changes in steps, a motion close to it may keep (6). The
    motion found is clear in the cell; None if (5) alone leaves no path.
    """
    first = plan_first_order(task, finder)
    return None if first is None else _keep_if_clear(refiner.refine(first), finder)


def plan_from_faster(task: Task, quick: QuickMotion, finder: CollisionFreeSearch) -> Plan | None:
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


def _keep_if_clear(found: Refinement, finder: CollisionFreeSearch) -> Refinement:
    """Return the refinement, marked as not done if its plan is not clear."""
    if not found.done or finder.is_clear(found.plan):
        return found
    return replace(found, done=False, statement="the motion within the limits would not be clear")


def plan_first_order(task: Task, finder: CollisionFreeSearch) -> Plan | None:
    """Return the best path without (6); None if (5) alone leaves no path."""
    limits = task.problem.limits.without_acceleration()
    try:
        path = finder.find(find_shortest, replace(task.problem, limits=limits, method="exact"))
    except NoFeasiblePath:
        return None
    claim = "the best path on this graph without acceleration limits"
    return task.plan(path.index, path.cost, Proof(optimal=False, statement=claim))


# -----------------------------------------------------------------------------
# Refine again from random starts, to leave a local optimum.

CHANGES = (0.05, 0.1, 0.2, 0.4)
"""Largest change of gamma of each start, rad, in this order and again from the first one."""
SEED = 16
"""Fixed, so that the same motion always gets the same starts."""


def refine_from_random_starts(begun: Plan, finder: CollisionFreeSearch) -> Plan:
    """Return the best of a motion and its refinements from random changes of its gamma.

    If (6) binds at many nodes, there are many narrow local optima. Each change is made to the best
    motion so far. The result keeps every limit and is clear.
    """
    rng, best = np.random.default_rng(SEED), begun
    for size in islice(cycle(CHANGES), begun.settings.restarts):
        change = waves(rng, len(best.q), 1, size)[0]
        if best.settings.closure == "periodic":
            change -= np.linspace(change[0], change[-1], len(change))
        again = refiner.refine(replace(best, gamma=best.gamma + change), first=size)
        if again.done and again.plan.cost < best.cost and finder.is_clear(again.plan):
            claim = f"refined again from a change of gamma at random: cost {again.plan.cost:.6g}"
            best = replace(again.plan, proof=begun.proof.also(claim))
    return best


# -----------------------------------------------------------------------------
# Warm start: an existing plan, adapted to new options; fast, not optimal.

FIRST = np.radians(2.0)
"""rad: first change of gamma; larger steps fail more often than they gain."""
PROGRAMS = 2
"""Most convex programs of a draft: a tenth of those to the best motion, for most of the gain after
a change of weights."""


def warm_start(made: Plan, options: PlanOptions, *, dt: float) -> Plan | None:
    """Return a motion near an existing one that keeps the limits of new options and costs less.

    It stays in the posture and near the gamma of the existing motion; `plan` searches everywhere.

    Parameters
    ----------
    made : Plan
        The existing motion, at constant speed, over continuous gamma.
    options : PlanOptions
        New options: other weights, eta, metric or objective; the rest as in `made`.
    dt : float s
        New time from node to node.

    Returns
    -------
    Plan or None
        None if no such motion is found, or if these options need a full plan.
    """
    constant = made.feed is None and options.feed == "constant" and made.contour.time is None
    free = made.robot.family.free_rotation and options.method == "continuous"
    if not (constant and free and options.closure == made.settings.closure):
        return None
    # The refinement computes the cost under the new options.
    start = replace(
        made,
        settings=replace(options.resolve(made.robot, dt), certify=None),
        time=dt * np.arange(len(made.q), dtype=float),
        proof=Proof(optimal=False, statement="a draft: the previous motion, moved"),
    )
    try:
        found = refiner.refine(start, first=FIRST, most=PROGRAMS)
    except InputError:
        return None
    return found.plan if found.done else None
