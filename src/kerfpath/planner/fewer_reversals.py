"""Plan where reversals cost: as without that cost, or off the best paths of the grid with it.

The exact search of the grid pays for each reversal, as its states are pairs of nodes; searches over
continuous gamma do not. The cheapest motion counts, with the cost of its reversals.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

from kerfpath.arrays import freeze
from kerfpath.errors import NoFeasiblePath
from kerfpath.planner.collision_free import CollisionFreeSearch
from kerfpath.planner.straight_moves import not_followed
from kerfpath.planner.task import Layered, Task, reversal_prices
from kerfpath.plans import Plan, Proof
from kerfpath.refiner import refine
from kerfpath.search import find_shortest

DEARER = (1.0, 3.0, 10.0)
"""Multiples of the cost with which the grid is searched: on its steps, a motion that turns no joint
back costs more than it does off the grid."""


def plan_with_fewer_reversals(
    task: Task, unpriced: Task, begun: list[Plan], begin: Callable[[str], None]
) -> Plan:
    """Return the cheapest of plans made without the cost of reversals or a tilt, and of the grid's.

    Parameters
    ----------
    task : Task
        The task with the cost.
    unpriced : Task
        The task without it.
    begun : list of Plan
        Its plan, then plans of `task` without a tilt.
    begin : callable
        Called with the name of each phase that begins.
    """
    plain, *others = begun
    if task.robot.free.size and not task.placed:
        graph = task.along(plain.course)
    else:
        prices = reversal_prices(task.settings, task.robot, task.dt)
        problem = replace(unpriced.problem, reversals=prices)
        graph = task.on(Layered(graph=unpriced.graph, problem=problem))
    begin("search with the cost of reversals")
    found = [_priced(plain, task), *others, *_off_grid(graph)]
    best = min(found, key=lambda plan: plan.cost)
    before, after = (len(_turned_back(plan, task)) for plan in (plain, best))
    said = f"reversals that cost: {after}, {before} in the motion found without their cost"
    return replace(best, settings=task.settings, proof=best.proof.also(said))


def _off_grid(task: Task) -> Iterator[Plan]:
    """Yield the best paths of the grid, refined where that gains; none without a path in limits.

    The search ignores limits on the jerk.
    """
    finder, prices = CollisionFreeSearch(task), task.problem.reversals
    jerk = task.robot.jerk_limit()
    for times in DEARER:
        dearer = prices._replace(price=freeze(times * prices.price))
        try:
            path = finder.find(find_shortest, replace(task.problem, reversals=dearer))
        except NoFeasiblePath:
            return
        what = "the cost" if times == 1 else f"{times:g} times the cost"
        claim = finder.claimed(f"the best path on this graph with {what} of reversals")
        proof = Proof(optimal=path.optimal and times == 1, statement=claim)
        made = task.plan(path.index, path.cost, proof)
        turned = _turned_back(made, task)
        extra = sum((times - 1) * float(prices.price[joint]) for joint, _ in turned)
        made = replace(made, cost=path.cost - extra)
        refined, better = refine(made), made if jerk is None else None
        gains = jerk is not None or refined.cost_after < made.cost
        if refined.done and gains and finder.is_clear(refined.plan):
            better = refined.plan
        if better is not None and not_followed(better) is None:
            yield better
        if not turned:
            return


def _priced(begun: Plan, task: Task) -> Plan:
    """Return a plan made without the cost of reversals, with that cost."""
    made = replace(begun, settings=task.settings)
    before, after = (
        0.0 if cost is None else float(cost.sum()) for cost in (begun.node_cost, made.node_cost)
    )
    if after == before:
        return made
    proof = replace(begun.proof, optimal=False, grid_cost=None)  # they are without that cost
    return replace(made, cost=begun.cost + after - before, proof=proof)


def _turned_back(plan: Plan, task: Task) -> list[tuple[int, int]]:
    """Return the joints and nodes of the reversals of a plan that cost in a task."""
    price = reversal_prices(task.settings, task.robot, task.dt).price
    return plan.turned_back(price.nonzero()[0].tolist())
