"""Branch and bound over tubes that proves that no motion keeps (5) and (6).

A tube holds gamma in an interval at each node. On the intervals the joints are cubics within a
radius; with the powers of gamma in a convex set that holds the cubic (t, t^2, t^3), and their
differences from node to node tied (`kerfpath.certifier.neighbours`), a linear program looks for the
motion that exceeds the limits by the least share. Its duals y of the increments, nu of (6) and of
what is tied prove that there is none within the limits if, whatever they are,

    sum over k of min over t of (y_{k-1} - y_k) . q_k(t) + ...  >  sum of P(y_k) + sum of |nu_k| . A

(`Tube.least` without costs; Farkas' lemma). All rounding is taken off, so that nothing rests on the
solver. Between programs, elimination takes cells from which no step or pair of steps leads on. What
is left is divided at the node where the duals feel the powers of gamma most.

A contour of which no motion passes a part has none. So motions are looked at along a window, about
the nodes where limits bind the quickest motion known; the window of those that pass it grows.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse

from kerfpath.arrays import Array, Bools, Ints, short_repr
from kerfpath.certificate import cell_bounds
from kerfpath.certifier.cells import TURN, CellMaker, CellSet
from kerfpath.certifier.elimination import Elimination
from kerfpath.certifier.neighbours import within
from kerfpath.certifier.stages import Steps, distinct_groups, linked
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
    tube_about,
)
from kerfpath.conic import NonnegativeConeT, minimise

ACROSS = 24
"""Cells of a node below which all of them are halved."""
ROUNDS, FEW_LOST = 6, 0.1
"""Most rounds of elimination of a tube, and the share of its cells that a round must remove for
another one."""
LOST = 0.1
"""Share of its cells that a tube must lose, by the changes that gamma may make, to be enclosed
again before it is divided."""
NEAR, EVERY, POLISHED = 0.3, 8, 3
"""Excess over the limits up to which the motion of a program is improved by programs in ever
narrower tubes, how often one with more is, and how often it is improved."""
TRUST, CLOSER = 0.03, 3.0
"""rad: half-width of the first of these tubes, and the factor to the next."""
PASSES = 1e-4
"""Excess of a motion, as a share of the limits, up to which its window grows."""
GROWS, LEAST = 3, 4
"""A window grows by its length divided by this at either end, and by at least so many nodes."""
FELT = 1e-3
"""Share of the largest dual from which it counts where a window begins and ends."""
AROUND = 2
"""Nodes of a window beyond those where duals count."""


class _Excess:
    """The program of the least share by which the motions of a tube exceed (5) and (6)."""

    def __init__(self, steps: Steps, nodes: Ints) -> None:
        self._of = TubeRows(steps, nodes, 1)
        over, (u, velocity) = self._of.own, self._of.move
        faster = sparse.csr_array(velocity[:, None]) @ over
        pairs = [(u - faster, velocity), (-u - faster, velocity)]
        pairs += [(-over, np.zeros(1)), *self._of.powers]
        rows, right = zip(*pairs, strict=True)
        self._rows, self._right = sparse.csr_array(sparse.vstack(rows)), np.concatenate(right)
        self._cost = np.zeros(self._of.count)
        self._cost[-1] = 1.0
        self.spans = self._of.spans

    def solve(self, tube: Tube) -> tuple[Duals, Array] | None:
        """Return duals, and gamma (M,) of the motion found; None if the solver fails."""
        link, wide = self._of.of(tube)
        bend, change = self._of.bend, tube.bent(self._of.steps, self.spans).ravel()
        sharper = sparse.csr_array(change[:, None]) @ self._of.own
        rows = sparse.vstack([link, bend - sharper, -bend - sharper, self._rows])
        bounds = np.concatenate([wide, change, change, self._right])
        cones = [NonnegativeConeT(len(bounds))]
        found = minimise(self._cost, rows, bounds, cones, threads=1)
        if not (np.isfinite(found.dual).all() and np.isfinite(found.x).all()):
            return None
        t = np.clip(found.x[: len(tube.half)], -1.0, 1.0)
        return self._of.duals(found.dual, tube), tube.middle + tube.half * t


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Part:
    """Cells at nodes (M,), and parts whose motions repeat theirs on other turns or flipped.

    Where the joints are in range at these nodes, the others are, too, but not beyond: so they are
    left out until the window grows. The lists are shared by all parts of a part.
    """

    cells: CellSet
    nodes: Ints
    twins: tuple[list[_Part], ...] = ()

    __repr__ = short_repr


class EmptyTubes:
    """Divides motions into tubes until each is proved to be empty.

    Parameters
    ----------
    maker : CellMaker
        Of cells of gamma alone.
    steps : Steps
        Without costs: all weights are zero.
    last : int
        The last node of the contour.
    most : int
        Most tubes.

    Attributes
    ----------
    count : int
        Number of tubes so far.
    motion : tuple, optional
        Gamma (K,) and the posture of a motion along the whole contour that keeps the limits at the
        nodes, if one was come upon; then nothing is proved.
    """

    def __init__(self, maker: CellMaker, steps: Steps, last: int, most: int) -> None:
        self._maker, self._steps, self._last, self._most = maker, steps, last, most
        self._programs: dict[bytes, _Excess] = {}
        self._blamed = Counter[int]()
        self.count = 0
        self.motion: tuple[Array, int] | None = None

    def closed(self, cells: CellSet, nodes: Ints) -> int | None:
        """Return the node, after the first, that rules out most tubes, if none holds a motion.

        None if this is not proved. The cells are those of the nodes (M,), at least three.
        """
        waiting = [_Part(cells=cells, nodes=nodes)]
        while waiting:
            if self.count >= self._most:
                return None
            left = self._left_of(waiting.pop())
            if left is None:
                return None
            waiting += left
        return max(self._blamed, key=lambda node: self._blamed[node], default=int(nodes[1]))

    def _left_of(self, part: _Part) -> list[_Part] | None:
        """Return parts of what is left of a tube; None if it cannot be divided further."""
        self.count += 1
        parts: list[_Part] = []
        for group in self._groups(part):
            left = self._divided(group)
            if left is None:
                return None
            parts += left
        return parts

    def _divided(self, part: _Part) -> list[_Part] | None:
        """Return parts of a tube, none if it is empty; None if it cannot be divided further."""
        cells, nodes = part.cells, part.nodes
        program, pull, motion = self.program(nodes), None, None
        tube = enclosed(self._maker, self._steps.endless, nodes, cells, hull(cells, nodes))
        if tube is not None:
            tube, layer = tube.with_ties(self._steps, program.spans)
            if tube is None:
                self._blamed[int(nodes[max(layer, 1)])] += 1
                return []
            rest = _passed(cells, nodes, tube)
            present = np.isin(nodes, rest.node)
            if not present.all():
                self._blamed[int(nodes[max(int(present.argmin()), 1)])] += 1
                return []
            if len(rest) < (1 - LOST) * len(cells):
                return [replace(part, cells=rest)]
            found = program.solve(tube)
            if found is not None:
                duals, motion = found
                if tube.least(self._steps, program.spans, duals) > 0:
                    most = int(np.abs(duals.y).sum(axis=1).argmax())
                    self._blamed[int(nodes[most + 1])] += 1
                    return []
                pull = tube.pull(duals)
                posture = int(cells.posture[0])
                if (cells.posture == posture).all() and self._passes(motion, nodes, posture):
                    return self._grown(part)
        halves = self._halves(cells, nodes, pull, motion)
        if not halves:
            if (cells.level >= DEEPEST).any():
                return self._grown(part)
            halves = [self._maker.halves(cells)]
        return [replace(part, cells=half) for half in halves]

    def program(self, nodes: Ints) -> _Excess:
        """Return the program of tubes at nodes (M,), which is made once."""
        key = nodes.tobytes()
        if key not in self._programs:
            self._programs[key] = _Excess(self._steps, nodes)
        return self._programs[key]

    def _grown(self, part: _Part) -> list[_Part] | None:
        """Return the motions along more nodes; None if there are none more."""
        nodes = part.nodes
        first, last = int(nodes[0]), int(nodes[-1])
        if len(nodes) > last - first:
            more = max(LEAST, (last - first) // GROWS)
            first, last = max(first - more, 0), min(last + more, self._last)
        wanted = np.arange(first, last + 1)
        if len(wanted) == len(nodes):
            return None
        new = self._maker.coarsest(np.setdiff1d(wanted, nodes))
        parts = list[_Part]()
        for twins in part.twins:
            parts += twins
            twins.clear()
        cells = CellSet.join([part.cells, new])
        cells = cells.take(linked(cells, self._steps))
        return [*parts, _Part(cells=cells, nodes=wanted)] if len(cells) else parts

    def _excess(self, gamma: Array, nodes: Ints, posture: int) -> float:
        """Return by which share of the limits a motion with gamma (M,) exceeds them at most."""
        motion = motion_through(self._maker, nodes, gamma, posture)
        return np.inf if motion is None else limit_share(*motion, np.diff(nodes), self._steps) - 1

    def _passes(self, gamma: Array, nodes: Ints, posture: int) -> bool:
        """Return whether a motion near gamma (M,) passes all nodes; the whole one is kept."""
        over = self._excess(gamma, nodes, posture)
        if over > NEAR and self.count % EVERY:
            return False
        program, half = self.program(nodes), np.full(len(nodes), TRUST)
        same = np.full(len(nodes), posture)
        for _ in range(POLISHED):
            if over <= 0:
                break
            tube = tube_about(self._maker, nodes, gamma, half, same)
            half = half / CLOSER
            if tube is None:
                continue
            found = program.solve(tube)
            if found is None:
                break
            better = self._excess(found[1], nodes, posture)
            if better < over:
                gamma, over = found[1], better
        whole = len(nodes) == self._last + 1
        if whole and over <= 0:
            self.motion = gamma, posture
        return over <= (0 if whole else PASSES)

    def _groups(self, part: _Part) -> list[_Part]:
        """Return the groups of cells that elimination leaves, or all if there are too many."""
        cells, nodes = part.cells, part.nodes
        for _ in range(ROUNDS):
            cells = finer(self._maker, cells, int(nodes[-1]), ACROSS)
            present = np.isin(nodes, cells.node)
            if not present.all():
                self._blamed[int(nodes[max(int(np.argmin(present)), 1)])] += 1
                return []
            one = Elimination(cells, self._steps)
            found = one.forward()
            if found is not None:
                self._blamed[int(nodes[found.node + 1])] += 1
                return []
            if one.left:
                return [replace(part, cells=cells)]
            live = one.backward()
            cells = one.cells.take(live)
            if live.mean() > 1 - FEW_LOST:
                break
        begin, to = one.steps()
        groups = distinct_groups(one.cells, begin, to, live, self._maker)
        rest = live & ~np.logical_or.reduce(groups)
        twins = part.twins
        if rest.any():
            twins = (*twins, [_Part(cells=one.cells.take(rest), nodes=nodes)])
        found_cells = [one.cells.take(each) for each in groups]
        whole = [each for each in found_cells if np.isin(nodes, each.node).all()]
        return [replace(part, cells=each, twins=twins) for each in whole]

    def _halves(
        self, cells: CellSet, nodes: Ints, pull: Array | None, motion: Array | None
    ) -> list[CellSet]:
        """Return the cells in parts at one node; none if every node has one cell alone.

        The node is one with several postures, or where the duals feel the powers of gamma most
        (M,), or the widest. The last part, which is divided next, is the one that most other cells
        are in the posture of, or that holds the motion found, its gamma (M,).
        """
        layer = np.searchsorted(nodes, cells.node)
        mixed = [k for k in range(len(nodes)) if np.ptp(cells.posture[layer == k])]
        if mixed:
            k = mixed[len(mixed) // 2]
            sure = np.isin(layer, mixed, invert=True)
            usual = np.bincount(cells.posture[sure], minlength=int(cells.posture.max()) + 1)
            alone = sorted(np.unique(cells.posture[layer == k]), key=lambda p: usual[p])
            return [cells.take((layer != k) | (cells.posture == p)) for p in alone]
        low, high = hull(cells, nodes)
        at, _ = cell_bounds(cells.level, cells.index)
        middle = (low + high) / 2
        off = at - middle[layer]
        left = off - TURN * np.rint(off / TURN) <= 0
        wide = (high - low) / (high - low).max()
        score = wide if pull is None else pull + 1e-3 * pull.max() * wide**2 + 1e-12 * wide
        turns = _turns(cells, layer, ~self._steps.endless)
        if turns is not None:
            return [cells.take(~turns[0] | side) for side in (turns[1], ~turns[1])]
        for k in np.argsort(-score):
            here = layer == k
            if left[here].any() and not left[here].all():
                sides = (left, ~left) if motion is None or motion[k] > middle[k] else (~left, left)
                return [cells.take(~here | side) for side in sides]
        return []


def binding_window(
    maker: CellMaker, steps: Steps, gamma: Array, posture: Ints
) -> tuple[int, int] | None:
    """Return the first and last node of the part where limits bind a motion that nearly keeps them.

    Duals of the program near it say where nothing can be gained; None if they do not.

    Parameters
    ----------
    maker : CellMaker
    steps : Steps
        With limits that the motion exceeds.
    gamma, posture : (K,)
        The motion.
    """
    nodes, half = np.arange(len(gamma)), np.full(len(gamma), TRUST / CLOSER**2)
    tube = tube_about(maker, nodes, gamma, half, posture)
    found = None if tube is None else _Excess(steps, nodes).solve(tube)
    if found is None:
        return None
    duals, _ = found
    size = np.abs(np.diff(duals.y, axis=0, prepend=0.0, append=0.0)).sum(axis=1)
    felt = np.flatnonzero(size > FELT * np.abs(duals.y).max())
    if not len(felt):
        return None
    return max(int(felt[0]) - AROUND, 0), min(int(felt[-1]) + AROUND, len(gamma) - 1)


def _passed(cells: CellSet, nodes: Ints, tube: Tube) -> CellSet:
    """Return the cells that motions may pass by the changes that gamma may make in their tube."""
    if tube.changes is None:
        return cells
    low, high = within(tube.changes, tube.half)
    layer = np.searchsorted(nodes, cells.node)
    at, wide = cell_bounds(cells.level, cells.index)
    off = at - tube.middle[layer]
    off -= TURN * np.rint(off / TURN)
    return cells.take((off + wide >= low[layer]) & (off - wide <= high[layer]))


def _turns(cells: CellSet, layer: Ints, ended: Bools) -> tuple[Bools, Bools] | None:
    """Return the cells (C,) of a node on several turns of a joint, and those on the first ones."""
    for k in range(int(layer.max()) + 1):
        here = layer == k
        for q in cells.center[:, ended].T:
            ordered = np.sort(q[here])
            gap = int(np.argmax(np.diff(ordered))) if len(ordered) > 1 else 0
            if len(ordered) > 1 and ordered[gap + 1] - ordered[gap] > np.pi:
                return here, q <= ordered[gap]
    return None
