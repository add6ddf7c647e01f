"""The best motion over continuous gamma, without falling back to the grid and without proofs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from kerfpath._arrays import Array
from kerfpath.cell import Cell
from kerfpath.contour import Contour
from kerfpath.errors import NoFeasiblePath
from kerfpath.graph import LayeredGraph
from kerfpath.options import PlanOptions
from kerfpath.planner._clear import ClearSearch
from kerfpath.planner._continuous import clear_motion, grid_reason
from kerfpath.planner._courses import along_a_course
from kerfpath.planner._task import task_of
from kerfpath.plans import Plan, Proof
from kerfpath.robots import Robot

__all__ = ["best_motion"]


def best_motion(
    contour: Contour,
    robot: Robot,
    *,
    tool: Array,
    placement: Array,
    speed: float | None,
    options: PlanOptions,
    graph: LayeredGraph | None = None,
    cell: Cell | None = None,
    phase: Callable[[str], None] | None = None,
) -> Plan:
    """Return the plan of the best motion found over continuous gamma.

    It is that of `kerfpath.plan`, but not certified. Where `kerfpath.plan` would go to the grid,
    this raises NoFeasiblePath and spends no time on a proof.

    Parameters
    ----------
    contour, robot, tool, placement, speed, options, graph, cell, phase
        As in `kerfpath.plan`, method "continuous".

    Raises
    ------
    NoFeasiblePath
        No motion is found, or a node has no pose; only the latter is proved.
    InputError
        As `kerfpath.plan`.
    """
    options = replace(options, certify=None)
    task = task_of(
        contour, robot, options, tool=tool, placement=placement, speed=speed, graph=graph
    )
    task = along_a_course(task, ClearSearch(task, cell).clear)
    finder, begin = ClearSearch(task, cell), phase or (lambda what: None)
    why = grid_reason(task)
    begin("search")
    found = None if why else clear_motion(task, finder, begin)
    if found is None:
        raise NoFeasiblePath(
            f"contour {contour.name!r}: no motion over continuous rotation"
            f"{f': {why}' if why else ' was found'}",
            proved=False,
            node=-1,
            counts={},
        )
    claim = f"the best motion found over continuous rotation: cost {found.cost_after:.6g}"
    return replace(found.plan, proof=Proof(optimal=False, statement=finder.claimed(claim)))
