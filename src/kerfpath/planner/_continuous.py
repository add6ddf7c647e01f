"""A plan over continuous gamma: paths by the value function, refined; the grid where that fails."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from kerfpath import refiner
from kerfpath.errors import NoFeasiblePath
from kerfpath.planner._clear import ClearSearch
from kerfpath.planner._on_grid import plan_on_grid
from kerfpath.planner._task import PlanningTask
from kerfpath.plans import Plan, Proof
from kerfpath.refiner import Refinement
from kerfpath.search import find_continuous

__all__ = ["plan_continuous"]

FIRST_STEP = 5e-3
"""rad: first change of gamma of a refinement that begins from a path between the samples."""
MOST_PATHS = 2
"""Paths that are refined."""


def plan_continuous(
    task: PlanningTask, finder: ClearSearch, begin: Callable[[str], None]
) -> Plan:
    """Return the best motion found over continuous gamma; on the grid where that is not the way.

    Raises
    ------
    NoFeasiblePath
        None was found, on the grid neither.
    """
    free = task.robot.family.free_rotation
    why = _grid_reason(task)
    if why:
        return _said(plan_on_grid(task, finder, begin, refine=free), why)
    begin("search")
    paths = find_continuous(task.problem, task.samples, most=MOST_PATHS)
    begin("refinement")
    claim = Proof(optimal=False, statement="found over continuous rotation")
    done = [
        found
        for path in paths
        if (found := refiner.refine(task.plan_between(path, claim), first=FIRST_STEP)).done
    ]
    if not done:
        return _said(plan_on_grid(task, finder, begin, refine=True), "no motion was found off it")
    best = min(done, key=lambda found: found.cost_after)
    statement = finder.claimed(f"the best motion found over continuous rotation: cost {best.cost_after:.6g}")
    return replace(best.plan, proof=Proof(optimal=False, statement=statement))


def _grid_reason(task: PlanningTask) -> str:
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
