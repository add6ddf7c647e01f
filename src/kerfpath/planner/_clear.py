"""The best path of a task that is clear in a cell, and whether a plan is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kerfpath._arrays import Array, Ints
from kerfpath.cell import Cell, Checker
from kerfpath.comfort import Band
from kerfpath.errors import InputError
from kerfpath.graph import LayeredGraph
from kerfpath.planner._task import Task
from kerfpath.plans import Plan
from kerfpath.search import LayeredPath, LeastInterval, clear_interval, clear_path

__all__ = ["clear_least", "clear_search", "is_clear", "only_if_clear", "require_same_cell"]

SAME_PLACE = 1e-9
"""m: two poses of the same tool or part differ by rounding at most."""


def clear_search(task: Task, cell: Cell) -> tuple[LayeredPath, str]:
    """Return the best path that is clear, and in words how many checks it took."""
    asked = task.settings.comfort
    band = Band() if asked is None or asked.clearance is None else asked.clearance
    checker = Checker(cell, task.graph.q, comfort=band.width, comfort_cost=band.cost)
    found = clear_path(
        **task.limits,
        **task.aim,
        price=checker.price,
        passable=checker.passable,
        around=_beside(task.graph),
        method=task.settings.method,
        closure=task.settings.closure,
    )
    return found.path, (
        f"clear in the cell: {checker.asked} of {len(task.graph.q)} poses and "
        f"{checker.motions_asked} motions looked at in {found.searches} searches, distances "
        f"found at {checker.measured} poses and on {checker.motions_measured} motions"
    )


def clear_least(task: Task, cell: Cell) -> LeastInterval:
    """Return the least node interval in which a path keeps the limits and is clear."""
    checker = Checker(cell, task.graph.q)
    return clear_interval(
        **task.limits,
        price=checker.price,
        passable=checker.passable,
        around=_beside(task.graph),
    )


def only_if_clear(refined: Plan, made: Plan, cell: Cell) -> Plan:
    """Return the refined plan if it is clear at and between its nodes, else the one on the grid."""
    if is_clear(refined.q, cell):
        return refined
    statement = f"{made.proof.statement}; not refined: off the grid it would not be clear"
    return replace(made, proof=replace(made.proof, statement=statement))


def is_clear(q: Array, cell: Cell) -> bool:
    """Say whether joint vectors (K, n) rad and the straight motions between them are clear."""
    return bool(cell.clear(q).all() and cell.clear_motion(q[:-1], q[1:]).all())


def require_same_cell(task: Task, cell: Cell) -> None:
    """Raise InputError where the cell was built for another tool or another place of the part."""
    if task.robot.external is not None:
        raise InputError(f"cell: it does not know how a {task.robot.external.kind} moves in it")
    for name, here, there in (
        ("tool", task.T_flange_tip, cell.T_flange_tip),
        ("placement", task.T_base_part, cell.T_base_part),
    ):
        if there is not None and not _same(here, there):
            raise InputError(f"cell: it was built with another {name} than is planned with")
    if not np.array_equal(cell.endless, task.robot.endless):
        raise InputError("cell: it was built with other endless joints than is planned with")


def _same(a: Array, b: Array) -> bool:
    return bool(np.abs(a - b).max() <= SAME_PLACE)


def _beside(graph: LayeredGraph) -> Ints:
    """Return the vertices (N, 2) one step of gamma before and after each, -1 where there is none.

    Of the same node, variant, posture and turns; where one collides, its neighbours are likely to.
    """
    m, layer = len(graph.gamma), np.repeat(np.arange(len(graph.start) - 1), np.diff(graph.start))
    _, turn = np.unique(graph.turn, axis=0, return_inverse=True)
    strand = layer * len(graph.tilt) + graph.variant
    strand = (strand * (graph.posture.max(initial=0) + 1) + graph.posture) * (turn.max() + 1)
    strand += turn.ravel()
    key = strand * m + graph.sample
    order = np.argsort(key)
    beside = np.empty((len(key), 2), np.int64)
    for side, step in enumerate((-1, 1)):
        wanted = strand * m + (graph.sample + step) % m
        place = np.minimum(np.searchsorted(key[order], wanted), len(key) - 1)
        beside[:, side] = np.where(key[order][place] == wanted, order[place], -1)
    return beside
