"""Parts of the motions, each with its own bound, divided until all bounds reach the target.

If (6) decides, two things prevent a close bound. Multipliers that give a close bound for motions
near the plan make other motions look cheap, above all in another posture. And however fine the
cells, a bound with multipliers stays below the best motion as long as its cells are far apart. So
the motions are divided: into groups that no step joins, and by where they pass a node. Each part is
bounded without multipliers, with those of the plan or of a motion that looked cheap before, and
with those of the motion that then looks cheapest: if that motion breaks (6), it shows where prices
are missing in the part. Bounds that are known for cells stay valid.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from heapq import heappop, heappush
from itertools import count

import numpy as np

from kerfpath.arrays import Array, short_repr
from kerfpath.certificate import cell_bounds
from kerfpath.certifier.cells import CellMaker, CellSet
from kerfpath.certifier.division import cells_to_divide
from kerfpath.certifier.stages import StageResult, Steps, solve_stage
from kerfpath.kernels.metric import increments

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
DEEPEST = 16
"""Largest level: cells of 1e-4 deg."""


@dataclass(slots=True, eq=False)
class _Part:
    """Cells, their own bound, and the number of successive divisions that gained little.

    `prices` (M, n) are the multipliers with the best bound; None if the bound without multipliers
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
        Takes gamma (M,) at the layers, a posture, the largest change of gamma, rad, and the largest
        multiplier, in weights; returns multipliers (M, n) of (6) for that motion, or None. Any
        multipliers give a valid bound.
    gamma : (M,) rad
        Gamma of the plan at the layers.
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
        self._stuck: list[tuple[float, CellSet]] = []
        self.pairs, self.count = 0, 0

    def bound(self, cells: CellSet, known: float) -> float:
        """Return a lower bound on the cost of motions through the cells, at most the plan's cost.

        The cells are those of the layers; `known` is a known lower bound.
        """
        self._wait(known, _Part(cells))
        while self._open and self._open[0][0] < min(self._target, self._closed):
            if self._enough(self.pairs, self._held):
                break
            known, _, part = heappop(self._open)
            self._held -= len(part.cells)
            self._divide(part, known)
        return min(self._closed, self._open[0][0]) if self._open else self._closed

    @property
    def left(self) -> list[tuple[float, CellSet]]:
        """The parts whose bounds do not reach the target, each with its bound."""
        return [*self._stuck, *((known, part.cells) for known, _, part in self._open)]

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
        for one in result.groups(kept, self._maker):
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
                if least < self._target:
                    self._stuck.append((least, rest))
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
            if self._priced_cost(best, prices) <= best.bound:
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

    def _priced_cost(self, result: StageResult, prices: Array) -> float:
        """Return the cost with prices of the motion that is cheapest by a result, about."""
        motion = result.cells.take(result.cheapest())
        spans = np.diff(motion.node)
        if len(spans) + 1 != len(prices):
            return np.inf
        steps = self._steps
        change = steps.changes(motion.center, motion.box, spans)
        return steps.priced(increments(motion.center, steps.endless), prices, spans, change)

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
        which, singular = cells_to_divide(
            cells, cells.floor, self._target, self._steps.weight, DEEPEST
        )
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
