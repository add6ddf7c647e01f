"""Tubes whose proof is kept: branches of a certificate, which others can check.

A checker has its own enclosures of the joints. It knows neither pairs of steps that break (6) nor
what other tubes prove of a cell. So a cell drops out only if a stage by itself shows that its
motions clearly cost too much, and what is left is always divided in two. Each tube keeps its stages
and its duals.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from kerfpath.arrays import Array, Ints
from kerfpath.certificate import Branch, cell_bounds
from kerfpath.certifier.cells import TURN, CellMaker, CellSet
from kerfpath.certifier.parts import CARE
from kerfpath.certifier.stages import StageResult, Steps, solve_stage
from kerfpath.certifier.tube import Tube, finer, hull
from kerfpath.certifier.tubes import ACROSS, AGAIN, ROUNDS, Found, Part, Split, Tubes

FINE, MOST_CELLS = 6, 1200
"""Level up to which cells of tubes that are too wide for a program are halved, and the most cells
of which they are: coarse cells hardly drop out."""
SHORT = 0.2
"""rad: length of an interval of the middle node from which on others are divided."""
APART = 4.0
"""Half-widths of a cell by which middles differ at most where cells are side by side."""
MOST_BRANCHES = 399
"""Most branches of a certificate; all have some ten megabytes in plan.json."""


class KeptTubes(Tubes):
    """Divides motions into tubes as `Tubes` does, and keeps the proof.

    Parameters
    ----------
    maker, steps, nodes, cost, target, enough
        As in `Tubes`; the layers are all nodes.
    clearly : callable
        Returns the share of the plan's cost for each cell (C,) by which its motions must cost more
        than the plan, so that it drops out.
    prices : sequence of (K, n)
        Multipliers of (6) for tubes that are too wide for a program; the one that proves most of
        the whole is used.
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
        clearly: Callable[[CellSet], Array],
        prices: Sequence[Array],
    ) -> None:
        def over(pairs: int, held: int) -> bool:
            return len(self._made) >= MOST_BRANCHES or enough(pairs, held)

        super().__init__(
            maker, steps, nodes, cost=cost, target=target, enough=over, cheaper=lambda _: np.inf
        )
        self._clearly, self._prices = clearly, list(prices)
        self._made = [Branch(stages=())]
        self._sides: dict[int, tuple[int, int]] = {}

    @property
    def branches(self) -> tuple[Branch, ...]:
        """The branches, each followed by the two that it is divided into, if it is."""
        found, ahead = list[Branch](), [0]
        while ahead:
            number = ahead.pop()
            found.append(self._made[number])
            ahead += self._sides.get(number, ())[::-1]
        return tuple(found)

    def _divide(self, part: Part, known: float) -> None:
        """Bound a tube, and queue the two parts of what is left of it, if it may cost less."""
        self.count += 1
        cells, branch, duals = part.cells, Branch(stages=()), part.duals
        tube = found = None
        rounds = 0
        while True:
            rounds += 1
            cells = finer(self._maker, cells, int(self._nodes[-1]), ACROSS)
            low, high = hull(cells, self._nodes)
            tube = self._tube(cells, low, high)
            found = None if tube is None else self._solved(tube)
            if tube is not None and found is not None:
                plain, given = _without_cubes(tube), (self._program.spans, found.duals)
                closed = not found.solved and plain.least(self._free, *given) > 0
                if found.solved:
                    known = max(known, plain.least(self._steps, *given))
                    duals = found
                    closed = self._close(known)
                if closed or found.solved:
                    branch = replace(branch, y=found.duals.y, multipliers=found.duals.nu)
                if closed:
                    self._made[part.number] = branch
                    return
                found = found if found.solved else None
            if tube is not None and duals is not None:
                results = self._stages(cells, low, high, tube, duals)
            else:
                results = [self._priced_stage(cells)]
            stages = (*branch.stages, *(each.stage() for each in results))
            branch = replace(branch, stages=stages)
            self._made[part.number] = branch
            known = max(known, *(each.bound for each in results))
            if self._close(known):
                return
            through = np.maximum.reduce([each.through for each in results])
            cells = results[0].cells
            kept = through <= self._cost * (1 + self._clearly(cells))
            cells = cells.take(kept)
            if len(np.unique(cells.node)) < len(self._nodes):
                return
            wide = tube is None and len(cells) < MOST_CELLS
            coarse = (through[kept] < self._target) & (cells.grain < FINE)
            if wide and coarse.any():
                cells = self._maker.divided(cells, coarse)
            elif kept.mean() > AGAIN or rounds >= ROUNDS:
                break
        split = self._split_of(cells, tube, found)
        if split is None:
            self._closed = min(self._closed, known)
            return
        layer = np.searchsorted(self._nodes, cells.node)
        one, other = len(self._made), len(self._made) + 1
        self._made += [Branch(stages=()), Branch(stages=())]
        self._sides[part.number] = one, other
        self._made[part.number] = replace(
            branch, node=int(self._nodes[split.layer]), posture=split.posture, gamma=split.gamma
        )
        for number, side in ((one, split.first), (other, ~split.first)):
            here = cells.take((layer != split.layer) | side)
            self._wait(known, Part(here, duals=duals, number=number))

    def _split_of(self, cells: CellSet, tube: Tube | None, found: Found | None) -> Split | None:
        """Return how cells are divided: at the middle node until its interval is short.

        By (5) the intervals of the other nodes follow.
        """
        k = len(self._nodes) // 2
        here = cells.node == self._nodes[k]
        if tube is not None or len(np.unique(cells.posture)) > 1:
            return self._split(cells, tube, found)
        middle, half = cell_bounds(cells.level, cells.index)
        at = np.sort(middle[here])
        gap = int(np.argmax(np.diff(at, append=at[0] + TURN))) + 1
        low = at[gap % len(at)]
        along = np.sort((at - low) % TURN)
        if along[-1] > SHORT:
            # Where cells are farthest apart, if they are not all side by side; else in the middle.
            apart = np.diff(along)
            i = int(apart.argmax())
            beside = apart[i] <= APART * half[here].max()
            cut = low + (along[-1] / 2 if beside else (along[i] + along[i + 1]) / 2)
            off = middle - cut
            first = off - TURN * np.rint(off / TURN) <= 0
            if first[here].any() and not first[here].all():
                return Split(k, -1, float(cut), first)
        return self._split(cells, tube, found)

    def _priced_stage(self, cells: CellSet) -> StageResult:
        """Return the stage with the multipliers that prove most; only they are used later."""
        tried = [self._stage(cells, nu, None) for nu in self._prices]
        if not tried:
            return self._stage(cells, None, None)
        best = int(np.argmax([each.bound for each in tried]))
        self._prices = [self._prices[best]]
        return tried[best]

    def _stage(self, cells: CellSet, nu: Array | None, y: Array | None) -> StageResult:
        given = None if y is None else np.ascontiguousarray(y[:, None])
        result = solve_stage(cells, self._steps, nu, care=CARE * self._cost, given=given)
        self.pairs += result.pairs
        return result


def _without_cubes(tube: Tube) -> Tube:
    """Return a tube with the bends that a checker may find: it bounds only second derivatives."""
    apart = np.abs(tube.twist) * tube.half[:, None] ** 3
    return replace(tube, twist=np.zeros_like(tube.twist), spread=tube.spread + apart)
