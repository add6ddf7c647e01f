"""One stage: a potential on cells, and a lower bound on the cost of motions through each cell."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from kerfpath._arrays import Array, Bools, Ints
from kerfpath._repr import short_repr
from kerfpath.certificate import Stage
from kerfpath.certifier._bends import cross_bends
from kerfpath.certifier._cells import CellSet
from kerfpath.certifier._steps import ROUNDED, Steps
from kerfpath.kernels.potentials import cross_cells, lay_potential, link_cells, reach_cells
from kerfpath.kernels.reduced import Cells, Potential

__all__ = ["StageResult", "arranged", "linked", "solve_stage"]

TESTS = 50
"""Number of pairs of steps whose test by (6) takes as long as bounding one step."""
IN_ONE = 64
"""Cells of a layer below which a second thread takes more time than it saves."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StageResult:
    """The bounds that a stage proves.

    Parameters
    ----------
    cells : CellSet
        The cells, sorted.
    through : (C,)
        Lower bound on the cost of a motion through each cell; infinite if no motion passes.
    level, dual : (C, 2), (C, 2, n)
        The potential.
    multipliers : (K, n), optional
    begin, to : (C + 1,), (E,)
        The steps of cell a are begin[a]..begin[a+1]-1, each to a cell.
    tests : int
        Number of pairs of steps tested.
    """

    cells: CellSet
    through: Array
    level: Array
    dual: Array
    multipliers: Array | None
    begin: Ints
    to: Ints
    tests: int = 0

    __repr__ = short_repr

    @property
    def pairs(self) -> int:
        """Work of the stage in steps from cell to cell, with the tests of pairs converted."""
        return len(self.to) + self.tests // TESTS

    @property
    def bound(self) -> float:
        """Lower bound on the cost of any motion."""
        return float(self.through.min(initial=np.inf))

    def cheapest(self) -> Ints:
        """Return the cells of a motion that may be the cheapest, one per layer."""
        cell = int(self.through[: int((self.cells.node == self.cells.node[0]).sum())].argmin())
        motion = [cell]
        while self.begin[cell] < self.begin[cell + 1]:
            ahead = self.to[self.begin[cell] : self.begin[cell + 1]]
            cell = int(ahead[self.through[ahead].argmin()])
            motion.append(cell)
        return np.array(motion)

    def stage(self) -> Stage:
        """Return the stage for a certificate."""
        cells = self.cells
        return Stage(
            node=cells.node,
            posture=cells.posture,
            level=cells.level,
            index=cells.index,
            lift=cells.lift,
            value=np.where(np.isfinite(self.level), self.level, 0.0),
            dual=self.dual.astype(np.float32),
            multipliers=self.multipliers,
        )


def solve_stage(
    cells: CellSet,
    steps: Steps,
    multipliers: Array | None = None,
    care: float = np.inf,
    most: float | None = None,
) -> StageResult:
    """Return the bounds that the cells prove for every motion through them.

    Parameters
    ----------
    cells : CellSet
        Their nodes are the layers; at the nodes in between, the motion is arbitrary.
    steps : Steps
    multipliers : (K, n), optional
        Multipliers of (6), zero at the first and the last node; they need cells at all nodes.
    care : float
        Cost beyond the cheapest step of a cell up to which steps are bounded with care.
    most : float, optional
        If given, pairs of steps that break (6) are excluded for motions that cost at most this; it
        needs cells at all nodes.

    Raises
    ------
    ValueError
        Multipliers without cells at every node.
    """
    cells, packed, nodes, _ = arranged(cells, steps)
    if multipliers is not None and len(nodes) < len(multipliers):
        raise ValueError("multipliers of (6) need cells at every node")
    start = packed.start
    C, n = cells.center.shape
    potential = Potential(
        np.full((C, 2), np.inf),
        np.zeros((C, 2, n)),
        np.zeros((C, 2)),
        np.zeros((C, 2)),
        np.zeros(C),
    )
    potential.level[start[-2] :] = 0.0
    begin, to, cost = _lay(packed, nodes, potential, steps, multipliers, care)
    ahead, behind = np.zeros(C), np.full(C, np.inf)
    first = slice(start[0], start[1])
    behind[first] = _least_at_first(cells.take(first), potential, first)
    cross_cells(start, begin, to, cost, ahead, behind)
    through, price = ahead + behind, steps.price(multipliers)
    tests = 0
    if most is not None and len(start) > 2 and np.isfinite(through).any():
        through, tests = cross_bends(packed, steps, begin, to, cost, behind, ahead, most + price)
    through -= price
    finite = np.isfinite(through)
    largest = np.abs(potential.level[np.isfinite(potential.level)]).max(initial=0.0)
    through[finite] -= ROUNDED * len(nodes) * (largest + np.abs(through[finite]))
    return StageResult(
        cells=cells,
        through=through,
        level=potential.level,
        dual=potential.dual,
        multipliers=multipliers,
        begin=begin,
        to=to,
        tests=tests,
    )


class Arranged(NamedTuple):
    """Cells in the order that the kernels need, and packed for them.

    ``cells`` are sorted by node and then by the joint whose windows of (5) leave the fewest;
    ``nodes`` (M,) are their layers; ``order`` (C,) is the previous index of each cell.
    """

    cells: CellSet
    packed: Cells
    nodes: Ints
    order: Ints


def arranged(cells: CellSet, steps: Steps) -> Arranged:
    """Return the cells sorted and packed."""
    box = cells.box
    key = _widest_apart(cells, box, steps)
    order = np.lexsort((cells.center[:, key], cells.node))
    cells, box = cells.take(order), box[order]
    nodes, start = np.unique(cells.node, return_index=True)
    widest = np.maximum.reduceat(box[:, key], start) if len(start) else np.zeros(0)
    curves = cells.center, cells.slope, cells.bend, cells.spread, box, cells.half
    packed = Cells(np.append(start, len(cells)), *curves, key, widest)
    return Arranged(cells, packed, nodes.astype(np.int64), order)


def linked(cells: CellSet, steps: Steps) -> Bools:
    """Return which cells (C,) steps within (5) lead to and from."""
    _, packed, nodes, order = arranged(cells, steps)
    after, before = np.zeros((2, len(cells)), np.bool_)
    after[packed.start[-2] :] = before[: packed.start[1]] = True
    for k in range(len(nodes) - 1):
        link_cells(packed, steps.over(int(nodes[k + 1] - nodes[k])), k, after, before)
    found = np.empty(len(cells), np.bool_)
    found[order] = after & before
    return found


def _widest_apart(cells: CellSet, box: Array, steps: Steps) -> int:
    """Return the joint whose windows of (5) leave the smallest share of a layer."""
    if not len(cells):
        return 0
    spread = np.where(steps.endless, np.pi / np.sqrt(3), cells.center.std(axis=0))
    return int(np.argmax(spread / (steps.velocity + 2 * np.median(box, axis=0))))


def _lay(
    packed: Cells,
    nodes: Ints,
    potential: Potential,
    steps: Steps,
    multipliers: Array | None,
    care: float,
) -> tuple[Ints, Ints, Array]:
    """Compute the potential from the last layer to the first; return steps and reduced costs.

    The steps of cell a are begin[a]..begin[a+1]-1, each to a cell and at a cost.
    """
    start, C = packed.start, len(packed.half)
    count = np.zeros(C, np.int64)
    layers: list[tuple[Ints, Array]] = []
    threads = int(os.environ.get("NUMBA_NUM_THREADS") or os.cpu_count() or 1)
    with ThreadPoolExecutor(threads) as pool:
        for k in range(len(start) - 3, -1, -1):
            first, last = int(start[k]), int(start[k + 1])
            stride = int(nodes[k + 1] - nodes[k])
            step = steps.over(stride) if stride > 1 else steps.tilted(multipliers, int(nodes[k]))
            reach_cells(packed, step, k, first, last, potential.level, count)
            begin = np.zeros(last - first + 1, np.int64)
            np.cumsum(count[first:last], out=begin[1:])
            to, cost = np.empty(begin[-1], np.int64), np.empty(begin[-1])
            shifted = np.zeros(last + 1, np.int64)
            shifted[first:] = begin
            parts = threads if last - first >= IN_ONE else 1
            middle = np.searchsorted(begin, np.linspace(0, begin[-1], parts + 1)[1:-1])
            ends = [first, *(first + middle).tolist(), last]
            runs = [
                pool.submit(
                    lay_potential, packed, potential, step, k, a, b, care, shifted, to, cost
                )
                for a, b in pairwise(ends)
            ]
            for run in runs:
                run.result()
            layers.append((to, cost))
    layers.reverse()
    begin = np.concatenate([[0], np.cumsum(count)])
    if not layers:
        return begin, np.zeros(0, np.int64), np.zeros(0)
    return (
        begin,
        np.concatenate([to for to, _ in layers]),
        np.concatenate([cost for _, cost in layers]),
    )


def _least_at_first(cells: CellSet, potential: Potential, first: slice) -> Array:
    """Return a lower bound of the potential on each cell of the first layer, from both cuts."""
    h, best = cells.half, np.full(len(cells), -np.inf)
    for m in range(2):
        y = potential.dual[first, m]
        slope = np.abs((y * cells.slope).sum(axis=1))
        bend = np.maximum((y * cells.bend).sum(axis=1), 0.0)
        less = slope * h + bend * h**2 / 2 + (np.abs(y) * cells.spread).sum(axis=1)
        best = np.maximum(best, potential.level[first, m] - less * (1 + ROUNDED))
    return np.asarray(best)
