"""A stage: cells at some nodes, a potential on them, and the bounds that it proves.

The potential is laid from the last layer to the first, so that no step from cell to cell costs less
than the potential falls. What a motion through a cell costs at least follows from it; pairs of
steps that break (6) are excluded where that is asked for.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from kerfpath.arrays import Array, Bools, Ints, freeze, short_repr
from kerfpath.certificate import Stage
from kerfpath.certifier.cells import CellMaker, CellSet
from kerfpath.effort import thread_count
from kerfpath.kernels.bends import cross_back, cross_on
from kerfpath.kernels.cell_elimination import Bend
from kerfpath.kernels.change_table import NO_TABLE, ChangeTable, most_factors
from kerfpath.kernels.limits import LIMIT_TOLERANCE
from kerfpath.kernels.metric import CHEBYCHEV, MANHATTAN
from kerfpath.kernels.potentials import cross_cells, lay_potential, link_cells
from kerfpath.kernels.reduced import Cells, Potential, Step, tangents
from kerfpath.limits import Limits
from kerfpath.search import change_table

# -----------------------------------------------------------------------------
# Costs and limits of the steps of a motion, and the prices of (6).

LONGEST = 3.0
"""rad: largest rotation of a joint in a step over several intervals, less than half a turn."""
QUICK, LONGEST_STRIDE, FEWEST = 5.5, 5, 8
"""Median number of intervals in which joints reach their velocity limit from rest, up to which
neighbouring intervals tell most by (6); the most intervals of a step where (6) is used; and the
fewest steps along a part of a contour."""
ROUNDED = 1e-14
"""Relative rounding error of adding one term to a sum, as a share of the largest term."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Steps:
    """Costs and limits of the steps of a motion.

    Parameters
    ----------
    weight : (n,) 1/rad
    velocity, acceleration : (n,) rad
        Bounds (5) and (6) on an increment and on its change, tolerance included; (6) as it is
        where a table allows most.
    metric : int
        Code of the metric.
    endless : (n,) bool
    most : float
        Largest cost of a step; infinite for no limit.
    farthest : float or (n,) rad
        Largest increment of a joint in a step over any number of intervals.
    table, everywhere : ChangeTable, (n,) rad
        Where (6) depends on the configuration, the factors on what holds everywhere.
    """

    weight: Array
    velocity: Array
    acceleration: Array
    metric: int
    endless: Bools
    most: float = np.inf
    farthest: float | Array = np.inf
    table: ChangeTable = NO_TABLE
    everywhere: Array | None = None

    __repr__ = short_repr

    @classmethod
    def within(
        cls, limits: Limits, dt: float, *, weight: Array, metric: int, endless: Bools
    ) -> Steps:
        """Return the steps of motions within limits, with nodes `dt` s apart."""
        change = limits.acceleration
        return cls(
            weight=weight,
            velocity=limits.velocity.per_interval(dt) + 2 * LIMIT_TOLERANCE,
            acceleration=change.most_per_interval(dt) + 2 * LIMIT_TOLERANCE,
            metric=metric,
            endless=endless,
            table=change_table(limits),
            everywhere=change.per_interval(dt),
        )

    def changes(
        self, middle: Array, reach: Array | float, spans: Ints, layer: Ints | None = None
    ) -> Array:
        """Return bound (6) about boxes, (C, n) rad; (1, n) if it is the same everywhere.

        Where the steps to a box and from it span several intervals, it is the mean of the bounds
        at their nodes, as each counts by its distance: there joints are within (5) of the box.

        Parameters
        ----------
        middle, reach : (C, n) rad
            Boxes of the joints, on their turns.
        spans : (M - 1,)
            The intervals between the layers.
        layer : (C,), optional
            That of each box. Default: there is one box for each layer, in their order.
        """
        layer = np.arange(len(middle)) if layer is None else layer
        if self.everywhere is None or not len(self.table.joint_2):
            return self.acceleration[None].copy()  # writable always: one type for the kernels
        before, after = np.append(1, spans)[layer], np.append(spans, 1)[layer]
        factor = own = most_factors(self.table, middle - reach, middle + reach)
        for far in range(1, int(spans.max(initial=1))):
            wide = reach + far * self.velocity
            there = most_factors(self.table, middle - wide, middle + wide)
            share = sum(np.maximum(1 - far / each, 0.0) for each in (before, after))
            factor = factor + (share / ((before + after) / 2))[:, None] * (there - own)
        return np.asarray(self.everywhere * factor + 2 * LIMIT_TOLERANCE)

    def over(self, intervals: int) -> Step:
        """Return the step over several intervals, which costs at most their sum (14)."""
        velocity = np.minimum(intervals * self.velocity, self.farthest)
        tilt, most = np.zeros_like(velocity), intervals * self.most
        return Step(self.weight, tilt, velocity, self.metric, self.endless, most)

    def layers(self, first: int, last: int) -> Ints:
        """Return nodes (M,) from one to another between which steps tell most by (6).

        Pairs of steps tell motions apart only if cells are small against the change that (6)
        allows, which grows with the square of the time of a step: the longer joints take to reach
        their velocity limit, the longer the steps.
        """
        wanted = np.sqrt(np.median(self.velocity / self.acceleration) / QUICK)
        within = LONGEST / self.velocity.max(), LONGEST_STRIDE, (last - first) / FEWEST
        stride = max(1, int(min(np.rint(wanted), *within)))
        count = -(-(last - first) // stride)
        return np.rint(np.linspace(first, last, count + 1)).astype(np.int64)

    def tilted(self, multipliers: Array | None, spans: Ints, k: int) -> Step:
        """Return the step from layer k to the next, tilted by the multipliers (M, n) of (6).

        ``spans`` (M - 1,) are the intervals between the layers.
        """
        step = self.over(int(spans[k]))
        if multipliers is None:
            return step
        return step._replace(tilt=(multipliers[k] - multipliers[k + 1]) / spans[k])

    def prices(self, multipliers: Array, spans: Ints, change: Array, layer: Ints) -> Array:
        """Return the most (C,) that multipliers (M, n) add on layers where (6) is as `changes`."""
        apart = np.pad((spans[:-1] + spans[1:]) / 2, 1)
        return np.asarray(apart[layer] * (np.abs(multipliers)[layer] * change).sum(axis=1))

    def price(self, multipliers: Array | None, spans: Ints, change: Array | None = None) -> float:
        """Return the price of the multipliers (M, n): the most that they add where (6) holds.

        (6) is as `changes` for each layer, by default where it allows most. The rounding of the
        tilts of all steps is included.
        """
        if multipliers is None:
            return 0.0
        change = self.acceleration[None] if change is None else change
        each = self.prices(multipliers, spans, change, np.arange(len(multipliers)))
        return self.rounded_price(each, multipliers)

    def rounded_price(self, each: Array, multipliers: Array) -> float:
        """Return the sum of prices (M,) with the rounding of the tilts of all steps."""
        most = each.sum()
        return float(most + ROUNDED * (most + (np.abs(multipliers) @ self.velocity).sum()))

    def distance(self, dq: Array) -> Array:
        """Return the distances (...,) of increments (..., n)."""
        each = self.weight * np.abs(dq)
        if self.metric == MANHATTAN:
            return np.asarray(each.sum(axis=-1))
        if self.metric == CHEBYCHEV:
            return np.asarray(each.max(axis=-1))
        return np.asarray(np.sqrt((each**2).sum(axis=-1)))

    def priced(self, dq: Array, multipliers: Array, spans: Ints, change: Array) -> float:
        """Return the cost of increments (M - 1, n) with the multipliers (M, n) of (6)."""
        tilt = (multipliers[:-1] - multipliers[1:]) / spans[:, None]
        moved = float(self.distance(dq).sum() + (tilt * dq).sum())
        return moved - self.price(multipliers, spans, change)


def bend_of(before: int, after: int) -> Bend:
    """Return the steps over some intervals and over those after, to which (6) applies."""
    return Bend((before + after) / 2, 1 / before, 1 / after)


# -----------------------------------------------------------------------------
# Least cost of motions through each cell, without pairs of steps that break (6).


def cross_bends(
    packed: Cells, steps: Steps, spans: Ints, begin: Ints, to: Ints, cost: Array,
    behind: Array, ahead: Array, most: float, multipliers: Array | None = None,
) -> tuple[Array, int]:  # fmt: skip
    """Return the least cost through each cell (C,), infinite beyond `most`; and the tests of (6).

    Parameters
    ----------
    packed : Cells
        Cells at the nodes of M layers.
    steps : Steps
    spans : (M - 1,)
        Number of intervals between the layers.
    begin, to, cost : (C + 1,), (E,), (E,)
        The steps of cell a are begin[a]..begin[a+1]-1, each to a cell and at a reduced cost.
    behind, ahead : (C,)
        Least reduced cost up to each cell and from it on, without (6).
    most : float
        Largest cost of the motions of interest.
    multipliers : (M, n), optional
        Multipliers of (6) that the reduced costs contain. A pair of steps costs more by what it
        leaves of their price unused.
    """
    start, step = packed.start, steps.over(1)
    nu, price = np.zeros((len(start) - 1, len(steps.weight))), np.zeros(len(behind))
    if multipliers is not None:
        nu = multipliers
        price = steps.prices(nu, spans, packed.change, _layers(packed)) * (1 - ROUNDED)
    lead = np.argmax(np.abs(packed.slope) / steps.acceleration, axis=1)
    bends = [bend_of(*pair) for pair in pairwise(spans.tolist())]
    origin = np.repeat(np.arange(len(behind)), np.diff(begin))
    until = np.full(len(to), np.inf)  # up to the end of each step
    onward = np.full(len(to), np.inf)  # from there on
    tests = 0
    layers = len(start) - 1
    edges = [slice(int(begin[start[k]]), int(begin[start[k + 1]])) for k in range(layers - 1)]
    until[edges[0]] = behind[origin[edges[0]]] + cost[edges[0]]
    for k in range(1, layers - 1):
        first, last = int(start[k]), int(start[k + 1])
        ending = np.arange(edges[k - 1].start, edges[k - 1].stop)
        ending = ending[np.isfinite(until[ending])]
        ending = ending[np.lexsort((until[ending], to[ending]))]
        in_begin = np.searchsorted(to[ending], np.arange(first, last + 1))
        tests += cross_on(
            packed, step, bends[k - 1], lead, first, last, begin, to, origin, ending, in_begin,
            cost, ahead, most, nu[k], price, until,
        )  # fmt: skip
    onward[edges[-1]] = 0.0
    for k in range(layers - 2, 0, -1):
        first, last = int(start[k]), int(start[k + 1])
        leaving = np.arange(edges[k].start, edges[k].stop)
        total = cost[leaving] + onward[leaving]
        some = np.isfinite(total) & np.isfinite(until[leaving])
        leaving, total = leaving[some], total[some]
        leaving = leaving[np.lexsort((total, origin[leaving]))]
        on_begin = np.searchsorted(origin[leaving], np.arange(first, last + 1))
        ending = np.arange(edges[k - 1].start, edges[k - 1].stop)
        tests += cross_back(
            packed, step, bends[k - 1], lead, first, last, to, origin, leaving, on_begin,
            ending[np.isfinite(until[ending])], cost, until, most, nu[k], price, onward,
        )  # fmt: skip
    through = np.full(len(behind), np.inf)
    whole = until + onward
    np.minimum.at(through, origin, whole)
    np.minimum.at(through, to[edges[-1]], until[edges[-1]])
    return through, tests


def _layers(packed: Cells) -> Ints:
    """Return the layer (C,) of each cell."""
    return np.repeat(np.arange(len(packed.start) - 1), np.diff(packed.start))


# -----------------------------------------------------------------------------
# One stage: a potential on cells, and a lower bound on the cost of motions through each cell.

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
    multipliers : (M, n), optional
    begin, to : (C + 1,), (E,)
        The steps of cell a are begin[a]..begin[a+1]-1, each to a cell.
    count : int
        Number of all steps, with those that are left out.
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
    count: int
    tests: int = 0

    __repr__ = short_repr

    def groups(self, kept: Bools, maker: CellMaker) -> list[Bools]:
        """Return the groups of kept cells that no step joins, see `distinct_groups`."""
        return distinct_groups(self.cells, self.begin, self.to, kept, maker)

    @property
    def pairs(self) -> int:
        """Work of the stage in steps from cell to cell, with the tests of pairs converted."""
        return self.count + self.tests // TESTS

    @property
    def bound(self) -> float:
        """Lower bound on the cost of any motion: it passes a cell of each layer."""
        return least_over_layers(self.cells.node, self.through)

    def floored(self) -> StageResult:
        """Return the result with what is known of the cells already, which becomes their floor."""
        through = np.maximum(self.through, self.cells.floor)
        return replace(self, cells=replace(self.cells, floor=through), through=through)

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
    given: Array | None = None,
    worth: float = np.inf,
    low: float = -np.inf,
) -> StageResult:
    """Return the bounds that the cells prove for every motion through them.

    Parameters
    ----------
    cells : CellSet
        Their nodes are the M layers; at the nodes in between, the motion is arbitrary.
    steps : Steps
    multipliers : (M, n), optional
        Multipliers of (6) at the layers, zero at the first and the last.
    care : float
        Cost beyond the cheapest step of a cell up to which steps are bounded with care.
    most : float, optional
        If given, pairs of steps that break (6) are excluded for motions that cost at most this.
    given : (M - 1, J, n), optional
        Slopes of the potential to try at each layer but the last.
    worth, low : float
        Largest cost of the motions of interest, and what the potential at the first layer is
        expected to reach; if it does not, the work is done twice. Steps that only dearer motions
        take are left out, and cells that only these pass have the bound infinity. Not with `most`.

    Raises
    ------
    ValueError
        Multipliers that are not those of the layers.
    """
    cells, packed, nodes, _ = arranged(cells, steps)
    spans = np.diff(nodes)
    if multipliers is not None and len(nodes) != len(multipliers):
        raise ValueError("multipliers of (6) need cells at each of their nodes, and at no other")
    start = packed.start
    C, n = cells.center.shape
    first, price, spared = slice(start[0], start[1]), 0.0, np.zeros(C)
    if multipliers is not None:
        layer = _layers(packed)
        each = steps.prices(multipliers, spans, packed.change, layer)
        most_of = np.maximum.reduceat(each, start[:-1])
        price, spared = steps.rounded_price(most_of, multipliers), most_of[layer] - each
    while True:
        potential = Potential(
            np.full((C, 2), np.inf),
            np.zeros((C, 2, n)),
            np.zeros((C, 2)),
            np.zeros((C, 2)),
            np.zeros(C),
        )
        potential.level[start[-2] :] = 0.0
        dear = worth + price - low
        begin, to, cost, count = _lay(
            packed, spans, potential, steps, multipliers, min(care, dear), dear, given
        )
        ahead, behind = np.zeros(C), np.full(C, np.inf)
        behind[first] = _least_at_first(cells.take(first), potential, first)
        if not (least := float(behind[first].min())) < low:
            break
        low = least  # the potential does not depend on the steps that are left out
    cost += np.repeat(spared, np.diff(begin))  # what the price of the layer exceeds the cell's by
    cross_cells(start, begin, to, cost, ahead, behind)
    through = ahead + behind
    tests = 0
    if most is not None and len(start) > 2 and np.isfinite(through).any():
        through, tests = cross_bends(
            packed, steps, spans, begin, to, cost, behind, ahead, most + price, multipliers
        )
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
        count=count,
        tests=tests,
    )


def least_over_layers(node: NDArray[np.int32], through: Array) -> float:
    """Return the bound that those of cells (C,) give, as a motion passes a cell at each node."""
    _, layer = np.unique(node, return_inverse=True)
    least = np.full(layer.max(initial=-1) + 1, np.inf)
    np.minimum.at(least, layer, through)
    return float(least.max(initial=-np.inf)) if len(least) else np.inf


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
    by_joint = np.ascontiguousarray(cells.center.T), np.ascontiguousarray(box.T)
    layer = np.repeat(np.arange(len(nodes)), np.diff(start, append=len(cells)))
    change = steps.changes(cells.center, box, np.diff(nodes), layer)
    more = cells.tied, cells.reach, *by_joint, change
    packed = Cells(np.append(start, len(cells)), *curves, key, widest, *more)
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
    spans: Ints,
    potential: Potential,
    steps: Steps,
    multipliers: Array | None,
    care: float,
    dear: float,
    given: Array | None = None,
) -> tuple[Ints, Ints, Array, int]:
    """Compute the potential from the last layer to the first; return steps and reduced costs.

    The steps of cell a are begin[a]..begin[a+1]-1, each to a cell and at a cost; those that cost
    more than `dear` are left out. Also returned is the number of all steps.
    """
    start, C = packed.start, len(packed.half)
    count, all_steps = np.zeros(C, np.int64), 0
    found: list[tuple[Ints, Array]] = [(np.zeros(0, np.int64), np.zeros(0))]
    threads, none = thread_count(), np.zeros((0, len(steps.weight)))
    with ThreadPoolExecutor(threads) as pool:
        for k in range(len(start) - 3, -1, -1):
            first, last = int(start[k]), int(start[k + 1])
            step = steps.tilted(multipliers, spans, k)
            parts = threads if last - first >= IN_ONE else 1
            ends = np.linspace(first, last, parts + 1).astype(np.int64).tolist()
            slopes = none if given is None else given[k]
            runs = [
                pool.submit(
                    lay_potential, packed, potential, step, k, a, b, care, dear, slopes, count
                )
                for a, b in pairwise(ends)
            ]
            laid = [run.result() for run in runs]
            all_steps += sum(tried for _, _, tried in laid)
            found += [(to, cost) for to, cost, _ in reversed(laid)]
    found.reverse()
    to, cost = (np.concatenate(each) for each in zip(*found, strict=True))
    return np.append(0, np.cumsum(count)), to, cost, all_steps


def _least_at_first(cells: CellSet, potential: Potential, first: slice) -> Array:
    """Return a lower bound of the potential on each cell of the first layer, from both cuts."""
    h, best = cells.half, np.full(len(cells), -np.inf)
    for m in range(2):
        y = potential.dual[first, m]
        slope = np.abs((y * cells.slope).sum(axis=1))
        bend = np.maximum((y * cells.bend).sum(axis=1), 0.0)
        less = slope * h + bend * h**2 / 2 + (np.abs(y) * cells.spread).sum(axis=1)
        if cells.reach.shape[1]:
            tied = np.einsum("cmi,ci->cm", cells.tied, y)
            size = np.einsum("cmi,ci->cm", np.abs(cells.tied), np.abs(y))
            less += ((np.abs(tied) + ROUNDED * size) * cells.reach).sum(axis=1)
        best = np.maximum(best, potential.level[first, m] - less * (1 + ROUNDED))
    return np.asarray(best)


# -----------------------------------------------------------------------------
# Groups of cells that no step joins, without groups that only repeat another one.


def distinct_groups(
    cells: CellSet, begin: Ints, to: Ints, kept: Bools, maker: CellMaker
) -> list[Bools]:
    """Return the groups of kept cells that no step joins, (C,) bool each.

    The steps of cell a are begin[a]..begin[a+1]-1, each to a cell.

    A group is left out if another one contains it up to whole turns of the joints or a flipped
    wrist (`Arm.flip`): each motion through it then has a counterpart through the other one at the
    same cost, as (5), (6) and the cost depend only on the sizes of increments, and (6) on the turns
    of joints over which there is a table (`CellMaker.placed`).
    """
    labels, count = _joined(begin, to, kept)
    if count < 2:
        return [labels == 0]
    which, turn = _codes(cells, maker)
    order = np.argsort(labels, kind="stable")
    groups = np.split(order, np.searchsorted(labels[order], np.arange(count)))[1:]
    found: list[Ints] = []
    for group in sorted(groups, key=len, reverse=True):
        images = [group + first for first in range(0, len(which), len(labels))]
        if not any(_contains(which, turn, one, others) for others in found for one in images):
            found.append(group)
    return [labels == labels[group[0]] for group in found]


def _joined(begin: Ints, to: Ints, kept: Bools) -> tuple[Ints, int]:
    """Return the group (C,) of each cell, -1 if it is not kept, and the number of groups."""
    cell = np.repeat(np.arange(len(kept)), np.diff(begin))
    both = kept[cell] & kept[to]
    size = (len(kept),) * 2
    steps = sparse.csr_array((np.ones(both.sum()), (cell[both], to[both])), shape=size)
    group = connected_components(steps, directed=False)[1]
    labels = np.full(len(kept), -1)
    alone, labels[kept] = np.unique(group[kept], return_inverse=True)
    return labels, len(alone)


def _codes(cells: CellSet, maker: CellMaker) -> tuple[Ints, Ints]:
    """Return a number for each cell up to turns of its joints, and one for the turns, (C,) each.

    Shifting the turns of all cells shifts the second numbers of all by the same amount. If the
    wrist can be flipped, the numbers of the cells with the wrist flipped follow, (2 C,) each.
    """
    sets = [cells] if maker.flip is None else [cells, cells.flipped(*maker.flip)]
    center = np.concatenate([c.center for c in sets])
    name = np.concatenate(
        [np.column_stack([c.node, c.posture, c.level, c.index, c.at, c.reach]) for c in sets]
    )
    name = np.column_stack([name, np.rint(center[:, maker.placed] / np.pi)])
    _, first, which = np.unique(name, axis=0, return_index=True, return_inverse=True)
    which = which.ravel()
    halves = np.rint((center - center[first[which]]) / np.pi).astype(np.int64)
    halves[:, maker.endless] = 0  # all turns are equivalent
    digits = 4 * np.abs(halves).max() + 1  # keeps turns, shifts and their sums distinct
    return which, halves @ digits ** np.arange(halves.shape[1])


def _contains(which: Ints, turn: Ints, cells: Ints, others: Ints) -> bool:
    """Return whether cells (A,), with their turns shifted, are all among others (B,)."""
    if len(cells) > len(others):
        return False
    shifts = turn[others[which[others] == which[cells[0]]]] - turn[cells[0]]
    known = set(zip(which[others].tolist(), turn[others].tolist(), strict=True))
    return any(
        known.issuperset(zip(which[cells].tolist(), (turn[cells] + shift).tolist(), strict=True))
        for shift in np.unique(shifts)
    )


# -----------------------------------------------------------------------------
# Compile the kernels of the certified bound by a small stage.


def compile_bound() -> None:
    """Compile the kernels of `certify` by a stage of three nodes with one cell each."""
    nodes, joints = 3, 6
    none = np.zeros((nodes, joints))
    cells = CellSet(
        node=np.arange(nodes, dtype=np.int32),
        posture=np.zeros(nodes, np.int8),
        level=np.zeros(nodes, np.int8),
        index=np.zeros(nodes, np.int32),
        half=np.full(nodes, 0.1),
        center=none,
        slope=none,
        bend=none,
        spread=none,
        floor=np.full(nodes, -np.inf),
        at=np.zeros((nodes, 0)),
        reach=np.zeros((nodes, 0)),
        tied=np.zeros((nodes, 0, joints)),
        cuts=np.zeros(nodes, np.int16),
    )
    ones = freeze(np.ones(joints))
    steps = Steps(
        weight=ones, velocity=ones, acceleration=ones, metric=MANHATTAN, endless=freeze(ones > 2)
    )
    solve_stage(cells, steps, care=1.0)
    linked(cells, steps)
    tangents(none, steps.over(1), none.copy())
