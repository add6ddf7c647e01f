"""Branch and bound over tubes: motions whose gamma stays in one interval at each node.

Three bounds hold for the motions of a tube. The first is a linear (or second-order cone) program in
the powers of gamma, too: with q_k = c_k + s_k t + b_k t^2 / 2 + g_k t^3 / 6 +- r_k on the interval
of node k, the powers (t, t^2, t^3) are replaced by (t, w, z) in a convex set that holds them, so
that (5), (6) and the cost become convex; what the squares of neighbouring nodes differ is tied to
the changes of gamma (`kerfpath.certifier.neighbours`). Its duals y of the increments, nu of (6) and
of what is tied give a bound that is proved by itself, whatever they are (`Tube.least`): a sum of
minima of one cubic at each node. The other two are stages on the cells of the tube, with nu of the
whole tube and of its part around the motion that the program found; they rule out cells. The joints
on an interval of half-width h differ from the convex set by no more than a multiple of h^2, so that
the first bound closes as tubes get narrower. Where a program has no solution, its duals prove that
the tube has no motion.

The tube with the lowest bound is divided first: at the node where the duals feel the powers of
gamma most, compared with its width.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from heapq import heappop, heappush
from itertools import count
from typing import Any, NamedTuple

import numpy as np
from scipy import sparse

from kerfpath.arrays import Array, Bools, Ints, short_repr
from kerfpath.certificate import cell_bounds
from kerfpath.certifier.cells import TURN, CellMaker, CellSet
from kerfpath.certifier.multipliers import Lengths
from kerfpath.certifier.parts import CARE, SAME_COST
from kerfpath.certifier.stages import StageResult, Steps, solve_stage
from kerfpath.certifier.tube import (
    DEEPEST,
    Duals,
    Tube,
    TubeRows,
    enclosed,
    finer,
    hull,
    limit_share,
    motion_through,
)
from kerfpath.conic import NonnegativeConeT, minimise
from kerfpath.kernels.metric import MANHATTAN
from kerfpath.search import Course

ACROSS = 16
"""Cells of a node below which all of them are halved."""
WIDEST = 0.5
"""rad: largest half-width of an interval for which a program is solved."""
TRUST, WIDER, TIMES = 0.017, 2.0, 5
"""rad: how far from the motion of the program its part goes for which multipliers are made; and the
factor by which it is widened, and how often, where it has no motion."""
AGAIN, ROUNDS = 0.8, 4
"""Share of its cells that a tube must lose to be bounded again, undivided, and how often."""
NEARLY = 1.02
"""Most of the limits that a motion of a program may need to be refined."""
PROGRAM_PAIRS = 400
"""Number of steps from cell to cell that take as long as a program, for each of its nodes."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Found:
    """What a program found: gamma (M,) and duals.

    Without a solution there are duals only, which may prove that there is none.
    """

    solved: bool
    duals: Duals
    gamma: Array

    __repr__ = short_repr


class _Program:
    """The convex program of tubes at given layers."""

    def __init__(self, steps: Steps, nodes: Ints) -> None:
        M, n = len(nodes), len(steps.weight)
        edges, size = M - 1, (M - 1) * n
        manhattan = steps.metric == MANHATTAN
        lengths = size if manhattan else edges
        self._of = one = TubeRows(steps, nodes, lengths)
        self.spans, first = one.spans, one.count - lengths
        moved = sparse.diags_array(np.tile(steps.weight, edges)) @ one.step
        u, velocity = one.move
        pairs: list[tuple[Any, Array]] = [(u, velocity), (-u, velocity)]
        pairs += one.powers
        if manhattan:
            pairs += [(moved - one.own, np.zeros(size)), (-moved - one.own, np.zeros(size))]
        held = sum(len(bound) for _, bound in pairs)
        held += 2 * one.bend.shape[0]
        self._linear, self._cones = 2 * size + held, list[Any]()
        if not manhattan:
            longer, bound, cones = Lengths(moved, np.zeros(size), n, steps.metric).cones(
                first, one.count
            )
            pairs.append((longer, bound))
            self._cones = cones
        rows, right = zip(*pairs, strict=True)
        self._rows, self._right = sparse.csr_array(sparse.vstack(rows)), np.concatenate(right)
        self._cost = np.concatenate([np.zeros(first), np.ones(lengths)])

    def solve(self, tube: Tube) -> Found | None:
        """Return what the program of a tube finds; None if the solver fails."""
        link, wide = self._of.of(tube)
        tied = 0 if tube.tied is None else len(tube.tied[1])
        cones = [NonnegativeConeT(self._linear + tied), *self._cones]
        bend, change = self._of.bend, tube.bent(self._of.steps, self.spans).ravel()
        rows = sparse.vstack([link, bend, -bend, self._rows])
        right = np.concatenate([wide, change, change, self._right])
        found = minimise(self._cost, rows, right, cones, threads=1)
        if not np.isfinite(found.dual).all():
            return None
        t = found.x[: len(tube.half)]
        return Found(
            solved=found.solved and bool(np.isfinite(t).all()),
            duals=self._of.duals(found.dual, tube),
            gamma=tube.middle + tube.half * np.clip(t, -1.0, 1.0),
        )


class Split(NamedTuple):
    """How cells are divided: those of a layer in a posture and the others, or by gamma (-1)."""

    layer: int
    posture: int
    gamma: float
    first: Bools
    """(C,): which cells of the layer are on the first side."""


@dataclass(slots=True, eq=False)
class Part:
    """Cells of a tube, or of several, how often it was bounded undivided, and known duals.

    Where the proof is kept, it has a number among the branches.
    """

    cells: CellSet
    rounds: int = 0
    duals: Found | None = None
    number: int = 0

    __repr__ = short_repr


class Tubes:
    """Divides motions into tubes, those that may be the cheapest first, and bounds each.

    Parameters
    ----------
    maker : CellMaker
        Of cells of gamma alone.
    steps : Steps
    nodes : (M,)
        The layers.
    cost, target : float
        Cost of the plan, and the bound to reach.
    enough : callable
        Takes the number of steps bounded and of cells held; returns whether to stop.
    cheaper : callable
        Takes a motion that seems to cost less than the plan and nearly keeps the limits; returns
        the cost of the plan that it leads to, which then counts, or infinity.
    """

    def __init__(
        self,
        maker: CellMaker,
        steps: Steps,
        nodes: Ints,
        *,
        cost: float,
        target: float,
        enough: Callable[[int, int], bool],
        cheaper: Callable[[Course], float],
    ) -> None:
        self._maker, self._steps, self._nodes = maker, steps, nodes
        self._program = _Program(steps, nodes)
        self._free = replace(steps, weight=np.zeros_like(steps.weight))
        self._cost, self._target, self._enough = cost, target, enough
        self._number, self._held = count(), 0
        self._open: list[tuple[float, int, Part]] = []
        self._closed = cost
        self._cheaper, self._tried = cheaper, cost * (1 - SAME_COST)
        self.pairs, self.count = 0, 0

    def bound(self, sets: Sequence[tuple[float, CellSet]]) -> float:
        """Return a lower bound on the cost of motions through cells, at most the plan's cost.

        Each of the sets is a known lower bound, and cells of the layers.
        """
        for known, cells in sets:
            self._wait(known, Part(cells))
        while self._open and self._open[0][0] < min(self._target, self._closed):
            if self._enough(self.pairs, self._held):
                break
            known, _, part = heappop(self._open)
            self._held -= len(part.cells)
            self._divide(part, known)
        return min(self._closed, self._open[0][0]) if self._open else self._closed

    def _wait(self, known: float, part: Part) -> None:
        heappush(self._open, (known, next(self._number), part))
        self._held += len(part.cells)

    def _divide(self, part: Part, known: float) -> None:
        """Bound a tube, and queue what is left of it, in parts, if it may cost less."""
        self.count += 1
        cells = finer(self._maker, part.cells, int(self._nodes[-1]), ACROSS)
        if len(np.unique(cells.node)) < len(self._nodes):
            return
        low, high = hull(cells, self._nodes)
        tube, found = self._tube(cells, low, high), None
        if tube is not None:
            tube, _ = tube.with_ties(self._steps, self._program.spans)
            if tube is None:
                return  # no motion
            found = self._solved(tube)
        if tube is not None and found is not None:
            if not found.solved:
                if tube.least(self._free, self._program.spans, found.duals) > 0:
                    return
                found = None
            else:
                self._look_at(found.gamma, cells)
                own = tube.least(self._steps, self._program.spans, found.duals)
                known = max(known, own)
                if self._close(known):
                    return
        duals = found or part.duals  # those of the tube that it is a part of
        results = self._stages(cells, low, high, tube, duals)
        through = np.maximum.reduce([results[0].cells.floor, *(each.through for each in results)])
        cells = replace(results[0].cells, floor=through)
        kept = through <= self._cost * (1 + SAME_COST)
        if not kept.any():
            return
        lost = 1 - float(kept.mean()) > 1 - AGAIN
        for one in results[0].groups(kept, self._maker):
            rest = cells.take(one)
            present = np.unique(rest.node)
            if len(present) < len(self._nodes):
                continue  # no motion along the whole contour
            least = max(known, _least(rest))
            if self._close(least):
                continue
            if lost and part.rounds < ROUNDS:
                self._wait(least, Part(rest, part.rounds + 1, duals))
                continue
            halves = self._halves(rest, tube, found)
            if not halves and (rest.level < DEEPEST).any():
                halves = [rest]  # one cell at each node, which is halved next time
            elif not halves:
                self._closed = min(self._closed, least)
            for each in halves:
                self._wait(least, Part(each, duals=duals))

    def _look_at(self, gamma: Array, cells: CellSet) -> None:
        """Take the plan of a motion with gamma (M,) in the posture of cells if it costs less."""
        posture = int(cells.posture[0])
        motion = motion_through(self._maker, self._nodes, gamma, posture)
        if motion is None:
            return
        q, u = motion
        cost = float(self._steps.distance(u).sum())
        if cost >= self._tried or limit_share(q, u, self._program.spans, self._steps) > NEARLY:
            return
        course = np.concatenate([q[:1], q[0] + np.cumsum(u, axis=0)])
        reached_cost = self._cheaper(Course(gamma, course, np.full(len(q), posture)))
        self._tried = min(cost, reached_cost) * (1 - SAME_COST)
        if reached_cost < self._cost:
            self._target *= reached_cost / self._cost
            self._cost, self._closed = reached_cost, min(self._closed, reached_cost)

    def _close(self, known: float) -> bool:
        """Return whether the bound of a tube suffices, so that it need not be divided."""
        if known < self._target:
            return False
        self._closed = min(self._closed, known)
        return True

    def _tube(self, cells: CellSet, low: Array, high: Array) -> Tube | None:
        """Return the curves on the hull of cells, or on a part of it.

        None if they do not have certain increments: too wide, or in several postures or turns.
        """
        if (high - low).max() > 2 * WIDEST:
            return None
        return enclosed(self._maker, self._steps.endless, self._nodes, cells, (low, high))

    def _solved(self, tube: Tube) -> Found | None:
        self.pairs += PROGRAM_PAIRS * len(self._nodes)
        return self._program.solve(tube)

    def _stages(
        self, cells: CellSet, low: Array, high: Array, tube: Tube | None, found: Found | None
    ) -> list[StageResult]:
        """Return stages on the cells, with the duals of the tube and of a part of it."""
        if tube is None or found is None:
            return [self._stage(cells, None, None)]
        duals = [found]
        about, reach = found.gamma, TRUST
        for _ in range(TIMES):
            if reach >= tube.half.max():
                break
            part = self._tube(
                cells, np.maximum(low, about - reach), np.minimum(high, about + reach)
            )
            if part is not None:
                part, _ = part.with_ties(self._steps, self._program.spans)
            near = None if part is None else self._solved(part)
            if near is not None and near.solved:
                duals.insert(0, near)
                break
            reach *= WIDER
        results: list[StageResult] = []
        for each in duals:
            results.append(self._stage(cells, each.duals.nu, each.duals.y))
            if results[-1].bound >= self._target:
                break
        return results

    def _stage(self, cells: CellSet, nu: Array | None, y: Array | None) -> StageResult:
        most = self._cost * (1 + SAME_COST)
        given = None if y is None else np.ascontiguousarray(y[:, None])
        result = solve_stage(cells, self._steps, nu, care=CARE * self._cost, most=most, given=given)
        self.pairs += result.pairs
        return result

    def _halves(self, cells: CellSet, tube: Tube | None, found: Found | None) -> list[CellSet]:
        """Return the cells on either side of the middle of a node, or none if it has one alone."""
        split = self._split(cells, tube, found)
        if split is None:
            return []
        layer = np.searchsorted(self._nodes, cells.node)
        return [cells.take((layer != split.layer) | side) for side in (split.first, ~split.first)]

    def _split(self, cells: CellSet, tube: Tube | None, found: Found | None) -> Split | None:
        """Return how cells are divided in two at a layer; None if each layer has one alone."""
        layer = np.searchsorted(self._nodes, cells.node)
        for k in range(len(self._nodes)):
            postures = np.unique(cells.posture[layer == k])
            if len(postures) > 1:
                one = int(postures[0])
                return Split(k, one, 0.0, cells.posture == one)
        low, high = hull(cells, self._nodes)
        middle, _ = cell_bounds(cells.level, cells.index)
        off = middle - ((low + high) / 2)[layer]
        off -= TURN * np.rint(off / TURN)
        left = off <= 0
        several = np.bincount(layer[left], minlength=len(low)) > 0
        several &= np.bincount(layer[~left], minlength=len(low)) > 0
        if not several.any():
            return None
        score = (high - low) ** 2
        if tube is not None and found is not None:
            pull = tube.pull(found.duals)
            score = pull + 1e-3 * score * pull.max() / score.max() + 1e-12 * score
        k = int(np.argmax(np.where(several, score, -1.0)))
        return Split(k, -1, float(low[k] + high[k]) / 2, left)


def _least(cells: CellSet) -> float:
    """Return the least floor of the cells of a node, at the node where it is largest."""
    begin = np.flatnonzero(np.diff(cells.node, prepend=-1))
    return float(np.minimum.reduceat(cells.floor, begin).max())
