"""Searches of a task; in a cell they find only clear paths."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cached_property
from typing import TypeVar

import numpy as np

from kerfpath.arrays import Array, Bools, Ints
from kerfpath.cell import UNPROVED, Cell, CollisionChecker
from kerfpath.comfort import Band
from kerfpath.errors import InputError, NoFeasiblePath
from kerfpath.graph import LayeredGraph
from kerfpath.losses import Loss, Reason
from kerfpath.planner.task import Task
from kerfpath.plans import Plan
from kerfpath.robots import require_axes
from kerfpath.search import CheckedEdges, FoundPath, SearchProblem, find_clear
from kerfpath.tolerances import SAME_POINT

_P = TypeVar("_P", bound=FoundPath)

POSES_MEASURED, PAIRS_NAMED = 100, 3
"""For the message about a node without clear poses: poses measured, and pairs of bodies named."""
SAMPLES_LOOKED_AT = 8
"""Samples of gamma on either side of a path that the refinement may use if they are clear."""
POSES_SETTLED = 20_000
"""Most poses checked to find the nodes without a clear pose."""
RANGES_LISTED = 6
"""Most ranges of nodes listed in a message."""


class CollisionFreeSearch:
    """Runs the searches of a task: as they are or, in a cell, for clear paths."""

    def __init__(self, task: Task) -> None:
        self._task, self._cell = task, task.setup.cell
        cell = self._cell
        self._but = f" ({UNPROVED})" if cell is not None and cell.unproved else ""
        if cell is not None:
            _require_same_cell(task, cell)

    @property
    def graph(self) -> LayeredGraph:
        """The graph of the task, built late: a course of external axes must be known first."""
        return self._task.graph

    @cached_property
    def _checker(self) -> CollisionChecker:
        assert self._cell is not None
        asked = self._task.settings.comfort
        band = Band() if asked is None or asked.clearance is None else asked.clearance
        return CollisionChecker(
            self._cell, self.graph.q, comfort=band.width, comfort_cost=band.cost
        )

    @cached_property
    def _known(self) -> CheckedEdges:
        return CheckedEdges(
            self.graph.q,
            self.graph.start,
            price=self._checker.price,
            passable=self._checker.passable,
            blocked=self._checker.blocked,
            around=_gamma_neighbours(self.graph),
        )

    @property
    def is_free(self) -> bool:
        """Whether there is no cell, so that no sample of gamma needs a test for collisions."""
        return self._cell is None

    def clear(self, q: Array) -> Bools:
        """Return which joint vectors q (B, n) rad are clear, (B,), in the graph or not."""
        return np.ones(len(q), np.bool_) if self._cell is None else self._cell.clear(q)

    def of(self, task: Task) -> CollisionFreeSearch:
        """Return a `CollisionFreeSearch` of another task in the same cell."""
        return CollisionFreeSearch(task)

    def find(self, search: Callable[[SearchProblem], _P], problem: SearchProblem) -> _P:
        """Return the path that a search finds for a problem on the graph of the task."""
        if self._cell is None:
            return search(problem)
        try:
            return find_clear(search, problem, self._known)
        except NoFeasiblePath as broken:
            raise self._named(broken) from None

    def open_problem(self, problem: SearchProblem) -> SearchProblem:
        """Return a problem on the graph of the task without the vertices that are known to collide.

        Vertices that have not been checked stay open.
        """
        if self._cell is None:
            return problem
        return replace(problem, vertex_cost=problem.vertex_cost + self._known.cost)

    def learn(self, vertices: list[Ints]) -> bool:
        """Check vertices (rows of q) that have not been checked; return True if one collides.

        The neighbours of colliding vertices are checked, too.
        """
        if self._cell is None or not vertices:
            return False
        return self._known.learn_vertices(np.concatenate(vertices))

    def corridor(self, one: Ints, other: Ints) -> tuple[Ints, Ints] | None:
        """Return the number of successive clear samples before vertices `one` and after `other`.

        (K,) each, up to `SAMPLES_LOOKED_AT`; None without a cell.
        """
        if self._cell is None:
            return None
        back, ahead = (
            self._known.open_run(end, side, SAMPLES_LOOKED_AT)
            for side, end in enumerate((one, other))
        )
        return back, ahead

    def _named(self, broken: NoFeasiblePath) -> NoFeasiblePath:
        """Return a break by collision with the nodes without a clear pose and the colliding bodies.

        A search checks vertices in any order and may break at any of several closed nodes; the
        message is about the first of them.
        """
        if self._cell is None or not broken.lost_by(Loss.COLLISION):
            return broken
        closed, settled = self._known.closed_layers(POSES_SETTLED)
        if not closed:
            return self._at_break(broken)
        first, nodes = closed[0], len(self._known.start) - 1
        others = f" ({len(closed)} such nodes: {_ranges(closed)})" if len(closed) > 1 else ""
        rest = "" if settled == nodes else f"; nodes from {settled} on have not been checked"
        counts = self.graph.counts(first)
        counts.pop(Reason(Loss.ADMITTED), None)
        counts[Reason(Loss.COLLISION, "at the node")] = int(
            np.diff(self._known.start[first : first + 2])[0]
        )
        reasons = ", ".join(f"{word}: {number}" for word, number in counts.items())
        return NoFeasiblePath(
            f"no pose at node {first} of {nodes} is clear{others}{rest}; of the candidates there, "
            f"{reasons}{self._depths(first)}",
            proved=True,
            node=first - 1,
            counts=counts,
        )

    def _at_break(self, broken: NoFeasiblePath) -> NoFeasiblePath:
        """Return a break at a node that has clear poses, with the bodies that collide there."""
        return broken.with_message(f"{broken}{self._depths(broken.node + 1)}")

    def _depths(self, node: int) -> str:
        """Return text on the bodies that are too near each other at a node: how often, how deep."""
        assert self._cell is not None
        if node >= len(self._known.start) - 1:
            return ""
        first, last = self._known.start[node : node + 2]
        some = np.unique(np.linspace(first, last - 1, POSES_MEASURED).astype(np.int64))
        over = self._cell.distances(self._known.q[some]) - self._cell.required
        hits = over <= 0
        nearest = []
        for p in np.argsort(-hits.sum(axis=0), kind="stable")[:PAIRS_NAMED]:
            if hits[:, p].any():
                one, two = self._cell.pair_names[p]
                deep = np.abs(over[hits[:, p], p]) * 1e3
                nearest.append(
                    f"{one} and {two} at {hits[:, p].sum()} of {len(some)} poses, "
                    f"{deep.min():.3g} to {deep.max():.3g} mm nearer than allowed"
                )
        if not nearest:
            return ""
        best = int(np.argmax(over.min(axis=1)))
        least = ""
        if hits.any(axis=1).all():
            one, two = self._cell.pair_names[int(np.argmin(over[best]))]
            lack = abs(over[best].min()) * 1e3
            least = f"; the best pose is {lack:.3g} mm too near ({one} and {two})"
        return f" (most often {'; '.join(nearest)}{least})"

    def claimed(self, claim: str) -> str:
        """Return a claim; in a cell with "clear in the cell" and the number of checks."""
        if self._cell is None:
            return claim
        seen, clear = self._checker, f"{claim}, clear in the cell{self._but}"
        if not seen.asked:  # a motion found along some of the nodes is checked as a whole
            return clear
        searches = "1 search" if self._known.searches == 1 else f"{self._known.searches} searches"
        return (
            f"{clear}: {seen.asked} of {len(self._known.cost)} poses and "
            f"{seen.motions_asked} motions checked in {searches}, "
            f"distances computed at {seen.measured} poses and on {seen.motions_measured} motions"
        )

    def is_clear(self, made: Plan) -> bool:
        """Return whether a plan is clear at and between its nodes; True without a cell."""
        return not self.unclear(made).any()

    def unclear(self, made: Plan) -> Bools:
        """Return the nodes (K,) of a plan that are not clear, or that end an unclear interval."""
        q = made.q
        if self._cell is None:
            return np.zeros(len(q), np.bool_)
        at = ~self._cell.clear(q)
        if not at.any():
            between = ~self._cell.clear_motion(q[:-1], q[1:])
            at[:-1] |= between
            at[1:] |= between
        return np.asarray(at)


def _require_same_cell(task: Task, cell: Cell) -> None:
    """Raise InputError if the cell was built for another tool, placement or robot."""
    require_axes(cell.chain, task.robot)
    for name, here, there in (
        ("tool", task.setup.tool, cell.T_flange_tip),
        ("placement", task.setup.placement, cell.T_base_part),
    ):
        if there is not None and not _same(here, there):
            raise InputError(
                f"cell: it was built with another {name} than the plan has; build it again"
            )
    if not np.array_equal(cell.endless, task.robot.endless):
        raise InputError(
            "cell: it was built with other endless joints than the robot has; build it again"
        )


def _same(a: Array, b: Array) -> bool:
    return bool(np.abs(a - b).max() <= SAME_POINT)


def _gamma_neighbours(graph: LayeredGraph) -> Ints:
    """Return the vertices (N, 2) one step of gamma before and after each, -1 for none.

    They have the same node, variant, posture and turns; neighbours often collide together.
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


def _ranges(numbers: list[int]) -> str:
    """Write ascending numbers as ranges, such as "3 to 7, 9"; only the first `RANGES_LISTED`."""
    runs: list[list[int]] = []
    for number in numbers:
        if runs and number == runs[-1][1] + 1:
            runs[-1][1] = number
        else:
            runs.append([number, number])
    words = [f"{a}" if a == b else f"{a} to {b}" for a, b in runs[:RANGES_LISTED]]
    return ", ".join(words) + (", ..." if len(runs) > RANGES_LISTED else "")
