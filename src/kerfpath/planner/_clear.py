"""The searches of a task, in a cell for what is clear in it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np

from kerfpath._arrays import Array, Ints
from kerfpath.cell import UNPROVED, Cell, Checker
from kerfpath.comfort import Band
from kerfpath.errors import InputError, NoFeasiblePath
from kerfpath.graph import LayeredGraph
from kerfpath.planner._task import Task
from kerfpath.plans import Plan
from kerfpath.search import (
    InterruptedPath,
    Known,
    LayeredPath,
    LeastInterval,
    SlowedPath,
    clear_path,
)

__all__ = ["Finder"]

_P = TypeVar("_P", LayeredPath, SlowedPath, InterruptedPath, LeastInterval)

POSES_TOLD, PAIRS_TOLD = 100, 3
"""Poses of a node that are looked at, and pairs of bodies that are named, where it is closed."""
ACCURACY = 1e-5
"""m beyond what is required: nothing above it need be known."""
SAME_PLACE = 1e-9
"""m: two poses of the same tool or part differ by rounding at most."""


class Finder:
    """How the searches of a task run: as they are or, in a cell, for what is clear in it."""

    def __init__(self, task: Task, cell: Cell | None) -> None:
        self._limits, self._cell = task.limits, cell
        self._but = f" ({UNPROVED})" if cell is not None and cell.unproved else ""
        if cell is None:
            return
        _require_same_cell(task, cell)
        asked = task.settings.comfort
        band = Band() if asked is None or asked.clearance is None else asked.clearance
        self._checker = Checker(cell, task.graph.q, comfort=band.width, comfort_cost=band.cost)
        self._known = Known(
            task.graph.q,
            task.graph.start,
            price=self._checker.price,
            passable=self._checker.passable,
            blocked=self._checker.blocked,
            around=_beside(task.graph),
        )

    def best(self, search: Callable[..., _P], **options: Any) -> _P:
        """Return what a search finds within the limits of the task, `options` before them."""
        options = self._limits | options
        if self._cell is None:
            return search(**options)
        del options["q"], options["start"]
        try:
            return clear_path(search, self._known, **options)
        except NoFeasiblePath as broken:
            raise self._named(broken) from None

    def _named(self, broken: NoFeasiblePath) -> NoFeasiblePath:
        """Say of a break at a node which bodies collide there, in some of its poses, most often."""
        if not broken.counts.get("collision at the node") or self._cell is None:
            return broken
        first, last = self._known.start[broken.node + 1 : broken.node + 3]
        some = np.unique(np.linspace(first, last - 1, POSES_TOLD).astype(np.int64))
        needed = self._cell.required
        hits = self._cell.distances(self._known.q[some], enough=needed + ACCURACY) <= needed
        order = np.argsort(-hits.sum(axis=0), kind="stable")[:PAIRS_TOLD]
        pairs = [self._cell.pair_names[p] for p in order if hits[:, p].any()]
        told = ", ".join(f"{one} and {two}" for one, two in pairs)
        return broken.retold(f"{broken} (most often of {told})") if told else broken

    def claimed(self, claim: str) -> str:
        """Return a claim and, in a cell, that it holds for what is clear, after how many checks."""
        if self._cell is None:
            return claim
        seen = self._checker
        return (
            f"{claim}, clear in the cell{self._but}: "
            f"{seen.asked} of {len(self._known.cost)} poses and "
            f"{seen.motions_asked} motions looked at in {self._known.searches} searches, "
            f"distances found at {seen.measured} poses and on {seen.motions_measured} motions"
        )

    def is_clear(self, made: Plan) -> bool:
        """Return whether a plan is clear in the cell, if there is one, at and between its nodes."""
        if self._cell is None:
            return True
        q = made.q
        return bool(self._cell.clear(q).all() and self._cell.clear_motion(q[:-1], q[1:]).all())


def _require_same_cell(task: Task, cell: Cell) -> None:
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
