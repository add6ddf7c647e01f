"""Proof that no motion exists: cells of gamma are ruled out until a node has none left."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from heapq import heapify, heappop, heappush, heapreplace
from itertools import count, pairwise
from typing import Literal

import numpy as np

from kerfpath.arrays import Array, Bools, Ints, freeze, short_repr
from kerfpath.certificate import cell_bounds
from kerfpath.certifier.cells import CellMaker, CellSet
from kerfpath.certifier.stages import StageResult, Steps, arranged, distinct_groups, solve_stage
from kerfpath.effort import current_effort
from kerfpath.errors import Closed
from kerfpath.kernels.cell_elimination import (
    blame_bends,
    count_rejections,
    count_steps,
    keep_back,
    keep_on,
    list_steps,
)
from kerfpath.kernels.limits import LIMIT_TOLERANCE
from kerfpath.kernels.metric import MANHATTAN, rho
from kerfpath.limits import Limits
from kerfpath.plans import Plan, path_cost
from kerfpath.progress import Progress
from kerfpath.robots import Robot
from kerfpath.search import METRIC_CODES

# -----------------------------------------------------------------------------
# Nodes of a stage: those where the plan changes direction.


def turning_nodes(plan: Plan, share: float, longest: int) -> Ints:
    """Return nodes (M,) such that straight steps between them cost about as much as the plan.

    Parameters
    ----------
    plan : Plan
    share : float
        Largest share of the plan's cost that the straight steps may lose.
    longest : int
        Most intervals that a step spans.
    """
    asked, dq = plan.settings, plan.increments
    metric, last = METRIC_CODES[asked.metric], len(dq)
    q = np.vstack([np.zeros(dq.shape[1]), np.cumsum(dq, axis=0)])
    each = [path_cost(step[None], asked.weights, asked.metric, "sum") for step in dq]
    upto = np.concatenate([[0.0], np.cumsum(each)])

    def lost(a: int, b: int) -> float:
        """Return the cost that a straight step from node a to b loses."""
        return float(upto[b] - upto[a] - rho(q[b] - q[a], asked.weights, metric))

    ends = np.unique(np.append(np.arange(0, last, longest), last)).tolist()
    steps = [(-lost(a, b), a, b) for a, b in pairwise(ends)]
    heapify(steps)
    left = -sum(step[0] for step in steps)
    while left > share * upto[-1]:
        loss, a, b = steps[0]
        if b - a < 2:
            break
        middle = max(range(a + 1, b), key=lambda m: (-lost(a, m) - lost(m, b), -abs(2 * m - a - b)))
        heapreplace(steps, (-lost(a, middle), a, middle))
        heappush(steps, (-lost(middle, b), middle, b))
        left += loss + lost(a, middle) + lost(middle, b)
    return np.array(sorted({node for _, a, b in steps for node in (a, b)}))


def between(nodes: Ints) -> Ints:
    """Return the nodes plus one in the middle of each step that spans several intervals."""
    return np.unique(np.append(nodes, (nodes[:-1] + nodes[1:]) // 2))


# -----------------------------------------------------------------------------
# Choice of the cells to divide: first those whose joints are too uncertain, if these decide.

DECIDES = 0.5
"""Uncertain cells decide if the joint uncertainty along the cheapest motion is worth more than this
share of what that motion lacks."""
HALF = 0.5
"""Share of the total worth that the cells to divide have together."""
AIM, MOST = 0.5, 0.25
"""Share of the lack that the division is to gain; and the largest worth of a cell, as a share of
its lack."""
BOX_WEIGHT = 0.02
"""Weight of the box of a cell, compared with the uncertainty of the joints on it."""


def cells_to_divide(
    cells: CellSet, through: Array, target: float, weight: Array
) -> tuple[Bools, bool]:
    """Return which cells (C,) to divide, and whether only uncertain ones are divided.

    Near a singularity the joints turn fast with gamma: a few cells there, on which the joints may
    be almost anywhere, make motions look cheap that do not exist. As long as such cells decide,
    only the most uncertain ones are divided, with half of the total worth (as finite elements are
    refined: Doerfler, SIAM J. Numer. Anal. 33 (1996) 1106); else all cells below the target.

    Parameters
    ----------
    cells : CellSet
    through : (C,)
        Lower bound on the cost of motions through each cell.
    target : float
        Lower bound to reach.
    weight : (n,) 1/rad
    """
    low = through < target
    if not low.any():
        return low, False
    unsure = cells.unsure @ weight
    order = np.lexsort((through, cells.node))
    cheapest = order[np.append(True, np.diff(cells.node[order]) > 0)]
    least = float(through[cheapest].min())
    if unsure[cheapest].sum() <= DECIDES * (target - least):
        return low, False
    lack = np.maximum(least + AIM * (target - least) - through, 0.0)
    worth = np.minimum(unsure + BOX_WEIGHT * (cells.box @ weight), MOST * lack)
    order = np.argsort(-worth, kind="stable")
    total = np.cumsum(worth[order])
    which = np.zeros(len(worth), np.bool_)
    which[order[: np.searchsorted(total, HALF * total[-1]) + 1]] = True
    return which, True


# -----------------------------------------------------------------------------
# Parts of the motions, each with its own bound, divided until all bounds reach the target.
#
# If (6) decides, two things prevent a close bound. Multipliers that give a close bound for
# motions near the plan make other motions look cheap, above all in another posture. And however
# fine the cells, a bound with multipliers stays below the best motion as long as its cells are
# far apart. So the motions are divided: into groups that no step joins, and by where they pass a
# node. Each part is bounded without multipliers, with those of the plan or of a motion that
# looked cheap before, and with those of the motion that then looks cheapest: if that motion
# breaks (6), it shows where prices are missing in the part. Bounds that are known for cells stay
# valid.

SAME_COST = 1e-9
"""Share of the cost by which motions must cost more than the plan to drop out, for rounding."""
CARE = 0.05
"""Share of the cost beyond the cheapest step up to which steps are bounded with care."""
STALLED, AGAIN = 0.1, 1
"""Share of the lack of a part that finer cells must gain, and how often they may gain less."""
NARROW, WIDE = 0.017, 0.2
"""rad: largest change of gamma when multipliers are computed, around the plan, which keeps (6), and
around a motion that does not."""
DEAREST = 5.0, 20.0
"""The largest multipliers, in weights; small ones prove more far from the motion that they are
computed for."""
DEEPEST_PART = 16
"""Largest level: cells of 1e-4 deg."""


@dataclass(slots=True, eq=False)
class _Part:
    """Cells, their own bound, and the number of successive divisions that gained little.

    `prices` (K, n) are the multipliers with the best bound; None if the bound without multipliers
    is the best.
    """

    cells: CellSet
    own: float = -np.inf
    stalled: int = 0
    prices: Array | None = None

    __repr__ = short_repr


class Parts:
    """Divides motions, those that may be the cheapest first, and bounds each part.

    Parameters
    ----------
    maker : CellMaker
    steps : Steps
    prices : callable
        Takes gamma (K,), a posture, the largest change of gamma, rad, and the largest multiplier,
        in weights; returns multipliers (K, n) of (6) for that motion, or None. Any multipliers give
        a valid bound.
    gamma : (K,) rad
        Gamma of the plan.
    cost, target : float
        Cost of the plan, and the bound to reach.
    enough : callable
        Takes the number of steps bounded and of cells held; returns whether to stop.
    """

    def __init__(
        self,
        maker: CellMaker,
        steps: Steps,
        prices: Callable[[Array, int, float, float], Array | None],
        gamma: Array,
        *,
        cost: float,
        target: float,
        enough: Callable[[int, int], bool],
    ) -> None:
        self._maker, self._steps, self._prices, self._gamma = maker, steps, prices, gamma
        self._cost, self._target, self._enough = cost, target, enough
        self._number, self._held = count(), 0
        self._open: list[tuple[float, int, _Part]] = []
        self._closed = cost
        self.pairs, self.count = 0, 0

    def bound(self, cells: CellSet, known: float) -> float:
        """Return a lower bound on the cost of motions through the cells, at most the plan's cost.

        There must be cells at all nodes; `known` is a known lower bound.
        """
        self._wait(known, _Part(cells))
        while self._open and self._open[0][0] < min(self._target, self._closed):
            if self._enough(self.pairs, self._held):
                break
            known, _, part = heappop(self._open)
            self._held -= len(part.cells)
            self._divide(part, known)
        return min(self._closed, self._open[0][0]) if self._open else self._closed

    def _wait(self, known: float, part: _Part) -> None:
        heappush(self._open, (known, next(self._number), part))
        self._held += len(part.cells)

    def _divide(self, part: _Part, known: float) -> None:
        """Bound a part, and queue smaller parts of it that may cost less than the target."""
        self.count += 1
        through, result, prices = self._solved(part)
        kept = through <= self._cost * (1 + SAME_COST)
        if not kept.any():
            return
        cells = replace(result.cells, floor=through)
        layers = len(np.unique(cells.node))
        for one in distinct_groups(result, kept, self._maker):
            rest = cells.take(one)
            if len(np.unique(rest.node)) < layers:
                continue  # no motion along the whole contour
            own = float(rest.floor.min())
            least = max(known, own)
            slow = part.own > -np.inf and own - part.own < STALLED * (self._target - part.own)
            left = _Part(rest, own, part.stalled + 1 if slow else 0, prices)
            smaller = [] if least >= self._target else self._smaller(left)
            if not smaller:
                self._closed = min(self._closed, least)
            for each in smaller:
                self._wait(least, each)

    def _solved(self, part: _Part) -> tuple[Array, StageResult, Array | None]:
        """Return the best bound through each cell, a result, and the prices of the best bound.

        The result has the order of the cells. Prices for another motion are tried if the known ones
        prove nothing more, or no longer do.
        """
        result = best = self._stage(part.cells, None)
        through = np.maximum(result.through, result.cells.floor)

        def tried(prices: Array | None) -> bool:
            nonlocal best, through
            if prices is None:
                return False
            priced = self._stage(part.cells, prices)
            through = np.maximum(through, priced.through)
            better = priced.bound > best.bound
            best = priced if better else best
            return better

        if part.prices is not None:
            tried(part.prices)
        else:
            posture = int(np.bincount(part.cells.posture).argmax())
            for most in DEAREST:
                tried(self._prices(self._gamma, posture, NARROW, most))
        if best.multipliers is not None and not part.stalled:
            return through, result, best.multipliers
        motion = best.cells.take(best.cheapest())
        if len(motion) == len(self._gamma):
            posture = int(np.bincount(motion.posture).argmax())
            gamma, _ = cell_bounds(motion.level, motion.index)
            for most in DEAREST:
                if not tried(self._prices(gamma, posture, WIDE, most)):
                    break
        return through, result, best.multipliers

    def _stage(self, cells: CellSet, prices: Array | None) -> StageResult:
        most = self._cost * (1 + SAME_COST)
        result = solve_stage(cells, self._steps, prices, care=CARE * self._cost, most=most)
        self.pairs += result.pairs
        return result

    def _smaller(self, part: _Part) -> list[_Part]:
        """Return the smaller parts of a part; none if it cannot be divided.

        The part gets finer cells; if these gain little, it is split in the middle of the joint
        range at the node where the joints are farthest apart.
        """
        cells = part.cells
        low = cells.floor < self._target
        which, singular = cells_to_divide(cells, cells.floor, self._target, self._steps.weight)
        which &= cells.level < DEEPEST_PART
        if which.any() and (singular or part.stalled <= AGAIN):
            finer = self._maker.divided(cells, which)
            return [replace(part, cells=finer, stalled=0 if singular else part.stalled)]
        nodes = np.unique(cells.node[low])
        start = np.searchsorted(cells.node, nodes), np.searchsorted(cells.node, nodes, "right")
        joints = [cells.center[a:b] * self._steps.weight for a, b in zip(*start, strict=True)]
        apart = np.array([np.ptp(at, axis=0) for at in joints])
        place, joint = np.unravel_index(np.argmax(apart), apart.shape)
        if not apart[place, joint] > 0:
            return []
        inside, q = cells.node == nodes[place], cells.center[:, joint]
        middle = (q[inside].min() + q[inside].max()) / 2
        sides = (~inside | (q <= middle), ~inside | (q > middle))
        return [replace(part, cells=cells.take(side), stalled=0) for side in sides]


# -----------------------------------------------------------------------------
# Proof that no motion exists: cells of gamma are ruled out until a node has none left.

DEEPEST_RULED_OUT = 12
"""Largest level: cells of 0.001 deg."""
NODES_AROUND = 12
"""Nodes on either side of a node in a part of the contour that is tested."""
MOST_CELLS = 2_000
"""Most cells of one node that may have a pose, before the test ends undecided."""
EACH_PAIRS = 1_000_000
"""Most pairs of steps at one node for which (6) is tested in a round."""


def closed_node(
    robot: Robot,
    frames: Array,
    T_flange_tip: Array,
    nodes: Ints,
    postures: tuple[int, ...] | None = None,
) -> Closed | None:
    """Return the first of some nodes that is proved to have no pose within the ranges at any gamma.

    None if this is proved for none of them. Cells of gamma without a solution within ranges and
    couplings drop out, and the others are halved. Arguments are as in `MotionTest`.
    """
    maker = CellMaker(robot, frames, T_flange_tip, postures)
    for node in nodes:
        cells = maker.coarsest(np.array([node]))
        for _ in range(DEEPEST_RULED_OUT):
            if not 0 < len(cells) <= MOST_CELLS:
                break
            cells = maker.halves(cells)
        if not len(cells):
            return Closed(node=int(node) - 1, joint=None, limit="pose")
    return None


@dataclass(slots=True, eq=False)
class _Layer:
    """The steps from the cells of one layer: begin (C_k + 1,), to (E,), and which are kept (E,)."""

    begin: Ints
    to: Ints
    kept: Bools

    __repr__ = short_repr


class MotionTest:
    """Tests whether any motion along a contour keeps given limits, by an outer approximation.

    Parameters
    ----------
    robot : Robot
        A robot that `encloses`.
    frames : (K, 4, 4) m
        Task frames in the robot base.
    T_flange_tip : (4, 4) m
    postures : sequence of int, optional
        The postures that may be used; default all.
    """

    def __init__(
        self,
        robot: Robot,
        frames: Array,
        T_flange_tip: Array,
        postures: tuple[int, ...] | None = None,
    ) -> None:
        self._endless = robot.endless
        self._maker = CellMaker(robot, frames, T_flange_tip, postures)
        self._count = len(frames)
        self._coarsest = self._maker.coarsest(np.arange(self._count))

    def closed(self, limits: Limits, dt: float, around: int | None = None) -> Closed | None:
        """Return the place that no motion passes, with nodes `dt` s apart; None if not proved.

        Motions that keep (5) and (6) at the nodes, ranges and couplings cannot pass a cell from
        which, or to which, no step or pair of steps leads. The other cells are halved until a node
        has none left, or until the limit of work. With `around`, only the part of the contour
        around that node is tested, with finer cells: a motion that cannot pass a part cannot pass
        the whole contour.
        """
        steps = Steps(
            weight=freeze(np.ones(len(self._endless))),
            velocity=limits.velocity.per_interval(dt) + 2 * LIMIT_TOLERANCE,
            acceleration=limits.acceleration.per_interval(dt) + 4 * LIMIT_TOLERANCE,
            metric=MANHATTAN,
            endless=self._endless,
        )
        return self.closed_to(steps, current_effort().infeasibility_pairs, around)

    def closed_to(self, steps: Steps, most_pairs: int, around: int | None = None) -> Closed | None:
        """Return the same for motions with given bounds (5) and (6) and largest cost of steps.

        It ends undecided after `most_pairs` pairs of steps.
        """
        first, last = 0, self._count - 1
        if around is not None:
            first, last = max(first, around - NODES_AROUND), min(last, around + NODES_AROUND)
        cells, work = self._coarsest, 0
        cells = cells.take((cells.node >= first) & (cells.node <= last))
        for _ in range(DEEPEST_RULED_OUT):
            present = np.bincount(cells.node - first, minlength=last - first + 1) > 0
            if not present.all():
                return Closed(node=first + int(np.argmin(present)) - 1, joint=None, limit="pose")
            one = _Round(cells, steps)
            found = one.forward()
            if found is not None:
                return replace(found, node=first + found.node)
            work += one.pairs
            if one.left or work > most_pairs:
                return None
            cells = self._maker.halves(one.cells.take(one.backward()))
        return None


class _Round:
    """One forward and one backward sweep over cells of all nodes."""

    def __init__(self, cells: CellSet, steps: Steps) -> None:
        self.cells, self._packed, _, _ = arranged(cells, steps)
        self._step, self._bound = steps.over(1), steps.acceleration
        moved = np.abs(self.cells.slope)
        self._lead_v = np.argmax(moved / steps.velocity, axis=1)
        self._lead_a = np.argmax(moved / steps.acceleration, axis=1)
        self._layers: list[_Layer] = []
        self.pairs, self.left, self._steps = 0, False, 0

    def forward(self) -> Closed | None:
        """Keep the steps that motions from the first node may make; return where all end."""
        start = self._packed.start
        live = np.ones(len(self.cells), np.bool_)
        for k in range(len(start) - 2):
            layer = self._steps_from(k, live)
            if layer is None:
                return None
            if not len(layer.to):
                return self._closed(k, "velocity", live)
            if k and self._few(self._layers[-1], layer, k):
                before = self._layers[-1]
                layer.kept[:] = False
                self.pairs += keep_on(
                    self._packed, self._step, self._bound, self._lead_a, k - 1,
                    before.begin, before.to, before.kept, layer.begin, layer.to, layer.kept,
                )  # fmt: skip
                if not layer.kept.any():
                    self._layers.append(layer)
                    return self._closed(k, "acceleration", live)
            self._layers.append(layer)
            live[start[k + 1] : start[k + 2]] = False
            live[layer.to[layer.kept]] = True
        return None

    def backward(self) -> Bools:
        """Keep the steps from which motions may reach the end; return the cells (C,) passed."""
        start = self._packed.start
        live = np.zeros(len(self.cells), np.bool_)
        last = self._layers[-1]
        live[last.to[last.kept]] = True
        for k in range(len(self._layers) - 1, -1, -1):
            layer = self._layers[k]
            layer.kept &= live[layer.to]
            if k + 1 < len(self._layers) and self._few(layer, self._layers[k + 1], k + 1):
                ahead = self._layers[k + 1]
                self.pairs += keep_back(
                    self._packed, self._step, self._bound, self._lead_a, k,
                    layer.begin, layer.to, ahead.begin, ahead.to, ahead.kept, layer.kept,
                )  # fmt: skip
            # Cells of the next layer stay only if a kept step leads to them, too.
            reached = np.zeros(start[k + 2] - start[k + 1], np.bool_)
            reached[layer.to[layer.kept] - start[k + 1]] = True
            live[start[k + 1] : start[k + 2]] &= reached
            cell = np.repeat(np.arange(start[k], start[k + 1]), np.diff(layer.begin))
            live[cell[layer.kept]] = True
        return live

    def _steps_from(self, k: int, live: Bools) -> _Layer | None:
        """Return the steps from the live cells of layer k; None if there are too many."""
        start = self._packed.start
        count = np.zeros(start[k + 1] - start[k], np.int64)
        count_steps(self._packed, self._step, self._lead_v, k, live, count)
        begin = np.concatenate([[0], np.cumsum(count)])
        self._steps += int(begin[-1])
        if self._steps > current_effort().infeasibility_steps:
            self.left = True
            return None
        to = np.empty(begin[-1], np.int64)
        list_steps(self._packed, self._step, self._lead_v, k, live, begin, to)
        return _Layer(begin, to, np.ones(len(to), np.bool_))

    def _few(self, layer: _Layer, ahead: _Layer, k: int) -> bool:
        """Return whether the pairs of steps at layer k are few enough to be tested."""
        onward = np.diff(ahead.begin)[layer.to[layer.kept] - self._packed.start[k]]
        return bool(onward.sum() <= EACH_PAIRS)

    def _closed(self, k: int, limit: Literal["velocity", "acceleration"], live: Bools) -> Closed:
        """Return the closed place at node k, from which no step continues."""
        blame = np.zeros(len(self._bound), np.int64)
        if limit == "velocity":
            count_rejections(self._packed, self._step, k, live, blame)
        else:
            before, layer = self._layers[-2:]
            blame_bends(
                self._packed, self._step, self._bound, self._lead_a, k - 1,
                before.begin, before.to, before.kept, layer.begin, layer.to, blame,
            )  # fmt: skip
        return Closed(node=k, joint=int(np.argmax(blame)), limit=limit)


# -----------------------------------------------------------------------------
# The bound of the objective "max" (15): the least cost of the costliest step of any motion.
#
# A motion that costs at most c has no step that costs more. `_nopath` proves, as for any other
# limit, that no motion has only such steps, near the costliest step of the plan. The largest c
# for which this is proved is a lower bound on the cost.

NODES_AROUND_STEP = 12
"""Nodes on either side of the costliest step that are tested: with more, cells stay too coarse."""
CLOSE = 0.5
"""Precision of the largest proved cost, as a share of the gap asked for."""
SHARES = (0.5, 0.75, 0.9, 0.95)
"""Shares of the cost that are tried in this order if that of the gap stays undecided: costs that
are far too low are quickly proved to be impossible."""
ROUNDED = 1e-15
"""Relative rounding error of a quotient."""


def largest_step_bound(
    plan: Plan, steps: Steps, gap: float, spent: Callable[[], bool], progress: Progress
) -> tuple[float, int]:
    """Return a lower bound on the costliest step of any motion, and the number of tests.

    Parameters
    ----------
    plan : Plan
        With the objective "max".
    steps : Steps
        Bounds (5) and (6), weights and metric.
    gap : float
        Value of (cost - bound) / cost at which it stops.
    spent : callable
        Returns whether the time is over, so that no further test begins.
    progress : Progress
    """
    middle = int(np.argmax([rho(u, steps.weight, steps.metric) for u in plan.increments]))
    part = slice(max(middle - NODES_AROUND_STEP, 0), middle + NODES_AROUND_STEP + 2)
    test = MotionTest(plan.robot, plan.frames[part], plan.T_flange_tip, plan.settings.postures)
    effort = current_effort()
    low, high, cost = 0.0, plan.cost, (1 - gap) * plan.cost
    ladder = iter(share * plan.cost for share in SHARES if share < 1 - gap)
    tests = failed = 0
    close = CLOSE * gap * plan.cost
    while not spent() and failed < effort.minimax_undecided and high - low > close:
        progress("certificate", int(1000 * low / plan.cost), 1000)
        tests += 1
        if test.closed_to(_capped(steps, cost), effort.minimax_pairs) is not None:
            low = cost
            if tests == 1:
                break
        else:
            high, failed = cost, failed + 1
        climbed = next(ladder, high) if failed <= 1 else high
        cost = climbed if climbed < high else (low + high) / 2
    return low, tests


def _capped(steps: Steps, cost: float) -> Steps:
    """Return the steps with a largest cost, which also bounds the increment of each joint."""
    alone: Array = np.divide(
        cost, steps.weight, out=np.full_like(steps.weight, np.inf), where=steps.weight > 0
    )
    farthest = np.minimum(steps.velocity, alone * (1 + ROUNDED))
    return replace(steps, velocity=farthest, most=cost)
