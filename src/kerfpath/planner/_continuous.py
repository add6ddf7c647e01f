"""A plan over continuous gamma: paths by the value function, refined; the grid where that fails."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from kerfpath import refiner
from kerfpath.errors import NoFeasiblePath
from kerfpath.kernels.metric import wrap
from kerfpath.planner._clear import ClearSearch
from kerfpath.planner._closed import at_any_gamma
from kerfpath.planner._on_grid import plan_on_grid
from kerfpath.planner._task import PlanningTask
from kerfpath.plans import Plan, Proof
from kerfpath.refiner import Refinement
from kerfpath.search import ContinuousPath, ContinuousSearch, Effort

__all__ = ["clear_motion", "grid_reason", "plan_continuous"]

FIRST_STEP = 5e-3
"""rad: first change of gamma of a refinement that begins from a path between the samples."""
FINE, COARSE = (0.1, 0.25), (1.1, 1.0)
"""When the states of a beam are alike: for paths that hardly accelerate, and that must."""
QUICK = (Effort(60, FINE, 2), Effort(200, COARSE, 2))
"""Paths that are refined at first,"""
WIDE = Effort(1600, (1.1, 0.5), 1)
"""and those where the values promise better."""
SAME_VALLEY = 0.05
"""rad of gamma up to which a path leads to the motion that another was refined to."""
ENOUGH = 5e-3
"""Relative gap to what the values promise with which a motion is good."""
GAIN = 5e-3
"""What a refinement may take off the cost that a path promises, relative."""
MOST_SEARCHES = 40
"""Searches for a path that is clear."""
NARROWED = 6
"""Times that a refinement is kept nearer to its path where it is not clear."""


def plan_continuous(task: PlanningTask, finder: ClearSearch, begin: Callable[[str], None]) -> Plan:
    """Return the best motion found over continuous gamma; on the grid where that is not the way.

    Raises
    ------
    NoFeasiblePath
        None was found, on the grid neither.
    """
    why, found = grid_reason(task), None
    if not why:
        begin("search")
        found = clear_motion(task, finder, begin)
        why = "no motion was found off it"
    if found is None:
        comfort = task.settings.comfort
        # What the nodes of a slower motion cost is known on the grid only.
        priced = task.settings.feed == "dip" and comfort is not None and comfort.costs
        refine = task.robot.family.free_rotation and not priced
        try:
            return _said(plan_on_grid(task, finder, begin, refine=refine), why)
        except NoFeasiblePath as broken:
            begin("search for a proof that there is none")
            raise at_any_gamma(broken, task) from None
    claim = f"the best motion found over continuous rotation: cost {found.cost_after:.6g}"
    return replace(found.plan, proof=Proof(optimal=False, statement=finder.claimed(claim)))


def clear_motion(
    task: PlanningTask, finder: ClearSearch, begin: Callable[[str], None] = lambda what: None
) -> Refinement | None:
    """Return the best motion found that is clear; None where none is.

    What paths want to use is looked at, and avoided where it collides, until they are clear.
    """
    for _ in range(MOST_SEARCHES):
        search = ContinuousSearch(finder.open_problem(task.problem), task.samples)
        quick = [path for effort in QUICK for path in search.paths(effort)]
        if finder.learn([vertices for path in quick for vertices in (path.one, path.other)]):
            continue
        begin("refinement")
        found = _refined(task, finder, quick)
        if found is None or found.cost_after > (1 + ENOUGH) * search.value:
            found = _better(found, _refined(task, finder, list(search.paths(WIDE))))
        return found
    return None


def _refined(
    task: PlanningTask, finder: ClearSearch, paths: list[ContinuousPath]
) -> Refinement | None:
    """Return the best motion that paths are refined to; None where none is."""
    claim = Proof(optimal=False, statement="found over continuous rotation")
    plans = [task.plan_between(path, claim) for path in paths]
    best: Refinement | None = None
    for promised, i in sorted((refiner.promise(plan), i) for i, plan in enumerate(plans)):
        if best is not None and promised * (1 - GAIN) >= best.cost_after:
            break
        if best is not None and _close(plans[i], best.plan):
            continue
        best = _better(best, _refine_path(task, finder, paths[i], plans[i]))
    return best


def _refine_path(
    task: PlanningTask, finder: ClearSearch, path: ContinuousPath, made: Plan
) -> Refinement | None:
    """Return what a path is refined to, clear; None where the limits, or clearance, are not kept.

    In a cell gamma stays between samples that are clear, and nearer to the path where the motion
    between them is not.
    """
    clear = finder.corridor(path.one, path.other)
    if clear is None:
        found = refiner.refine(made, first=FIRST_STEP)
        return found if found.done else None
    step = 2 * np.pi / len(task.graph.gamma)
    low = made.gamma - (path.share + clear[0]) * step
    high = made.gamma + (np.where(path.one == path.other, 0, 1 - path.share) + clear[1]) * step
    for _ in range(NARROWED):
        found = refiner.refine(made, first=FIRST_STEP, within=(low, high))
        unclear = finder.unclear(found.plan)
        if not (found.done and unclear.any()):
            break
        low = np.where(unclear, (low + made.gamma) / 2, low)
        high = np.where(unclear, (high + made.gamma) / 2, high)
    return found if found.done and not unclear.any() else None


def _close(made: Plan, other: Plan) -> bool:
    """Return whether two motions are so alike that they are refined to the same one."""
    apart = np.abs(wrap(made.gamma - other.gamma)).max()
    return bool(apart < SAME_VALLEY and np.array_equal(made.posture, other.posture))


def _better(one: Refinement | None, other: Refinement | None) -> Refinement | None:
    """Return the better of two motions, or the one that there is."""
    if one is None or other is None:
        return one or other
    return min(one, other, key=lambda found: found.cost_after)


def grid_reason(task: PlanningTask) -> str:
    """Return why a task is planned on the grid; "" where it need not be."""
    comfort = task.settings.comfort
    if not task.robot.family.free_rotation:
        return "the robot leaves no rotation free"
    if comfort is not None and comfort.clearance is not None:
        return "what clearance costs is known there only"
    return ""


def _said(made: Plan, why: str) -> Plan:
    """Return a plan on the grid that says so."""
    statement = f"planned on the grid: {why}; {made.proof.statement}"
    return replace(made, proof=replace(made.proof, statement=statement))
