"""Branch and bound over tubes that proves that no motion keeps (5) and (6).

A tube holds gamma in an interval at each node. On the intervals the joints are parabolas within a
radius; with the pair (t, t^2) in the convex hull of the parabola, a linear program looks for the
motion that exceeds the limits by the least share. The duals y of the increments and nu of (6) of
this program prove that there is none within the limits if, whatever they are,

    sum over k of min over t of (y_{k-1} - y_k) . q_k(t)  >  sum of P(y_k)  +  sum of |nu_k| . A

(`Tube.least` without costs; Farkas' lemma). All rounding is taken off, so that nothing rests on the
solver. Between programs, elimination takes cells from which no step or pair of steps leads on. What
is left is divided at the node where the program is the farthest from the parabola, compared with
the change that (6) allows.
"""

from __future__ import annotations

from collections import Counter

import numpy as np
from scipy import sparse

from kerfpath.arrays import Array, Bools, Ints
from kerfpath.certificate import cell_bounds
from kerfpath.certifier.cells import TURN, CellMaker, CellSet
from kerfpath.certifier.elimination import Elimination
from kerfpath.certifier.stages import Steps, distinct_groups
from kerfpath.certifier.tubes import DEEPEST, Tube, TubeRows, hull
from kerfpath.conic import NonnegativeConeT, minimise

ACROSS = 24
"""Cells of a node below which all of them are halved."""
ROUNDS, FEW_LOST = 6, 0.1
"""Most rounds of elimination of a tube, and the share of its cells that a round must remove for
another one."""
NARROW = 0.2
"""rad: half-width up to which the joints are enclosed anew on the whole interval of a node."""
NEARER = 1e-3
"""What the program pays for squares beyond those of gamma, compared with exceeding the limits."""
ROUNDED = 1e-13
"""Rounding error of the curves, in rad per rad and in rad."""


class _Excess:
    """The program of the least share by which the motions of a tube exceed (5) and (6)."""

    def __init__(self, steps: Steps, nodes: Ints) -> None:
        self._steps, self._of = steps, TubeRows(steps, nodes, 1)
        over = self._of.own
        (bent, change), (u, velocity) = self._of.bend, self._of.move
        faster, sharper = (sparse.csr_array(a[:, None]) @ over for a in (velocity, change))
        pairs = [(bent - sharper, change), (-bent - sharper, change)]
        pairs += [(u - faster, velocity), (-u - faster, velocity)]
        pairs += [*self._of.box, (-over, np.zeros(1)), *self._of.tangents]
        rows, right = zip(*pairs, strict=True)
        self._rows, self._right = sparse.csr_array(sparse.vstack(rows)), np.concatenate(right)
        self.spans = self._of.spans

    def solve(self, tube: Tube) -> tuple[Array, Array, Array] | None:
        """Return duals y (M - 1, n) and nu (M, n), and how far each layer is from the parabola.

        The last are (M,), as shares of (6). None if the solver fails.
        """
        link, wide = self._of.of(tube)
        square = tube.bend * tube.half[:, None] ** 2 / 2
        worth = np.abs(2 * square / self._steps.acceleration).max(axis=1)
        zero = np.zeros(len(worth)), np.zeros(self._of.size)
        cost = np.concatenate([zero[0], NEARER * worth / worth.sum(), zero[1], [1.0]])
        bounds = np.concatenate([wide, self._right])
        cones = [NonnegativeConeT(len(bounds))]
        found = minimise(cost, sparse.vstack([link, self._rows]), bounds, cones, threads=1)
        if not (np.isfinite(found.dual).all() and np.isfinite(found.x).all()):
            return None
        _, beyond = self._of.beyond(found.x)
        return *self._of.duals(found.dual), beyond * worth


class EmptyTubes:
    """Divides motions into tubes until each is proved to be empty.

    Parameters
    ----------
    maker : CellMaker
        Of cells of gamma alone.
    steps : Steps
        Without costs: all weights are zero.
    nodes : (M,)
        The layers, at least three.
    most : int
        Most tubes.
    """

    def __init__(self, maker: CellMaker, steps: Steps, nodes: Ints, most: int) -> None:
        self._maker, self._steps, self._nodes, self._most = maker, steps, nodes, most
        self._program = _Excess(steps, nodes)
        self._blamed = Counter[int]()
        self.count = 0

    def closed(self, cells: CellSet) -> int | None:
        """Return the layer, after the first, that rules out most tubes, if none holds a motion.

        None if this is not proved.
        """
        waiting = [cells]
        while waiting:
            if self.count >= self._most:
                return None
            left = self._left_of(waiting.pop())
            if left is None:
                return None
            waiting += left
        ((layer, _),) = self._blamed.most_common(1)
        return layer

    def _left_of(self, cells: CellSet) -> list[CellSet] | None:
        """Return parts of what is left of a tube; None if it cannot be divided further."""
        self.count += 1
        groups = self._groups(cells)
        if groups is None:
            return None
        parts: list[CellSet] = []
        for group in groups:
            tube, apart = self._tube(group), None
            found = None if tube is None else self._program.solve(tube)
            if tube is not None and found is not None:
                y, nu, apart = found
                if tube.least(self._steps, self._program.spans, y, nu) > 0:
                    self._blamed[int(np.abs(y).sum(axis=1).argmax()) + 1] += 1
                    continue
            halves = self._halves(group, apart)
            if not halves:
                if (group.level >= DEEPEST).any():
                    return None
                halves = [self._maker.halves(group)]
            parts += halves
        return parts

    def _groups(self, cells: CellSet) -> list[CellSet] | None:
        """Return the groups of cells that elimination leaves; None if there are too many steps."""
        for _ in range(ROUNDS):
            cells = self._finer(cells)
            present = np.isin(self._nodes, cells.node)
            if not present.all():
                self._blamed[max(int(np.argmin(present)), 1)] += 1
                return []
            one = Elimination(cells, self._steps)
            found = one.forward()
            if found is not None:
                self._blamed[found.node + 1] += 1
                return []
            if one.left:
                return None
            live = one.backward()
            cells = one.cells.take(live)
            if live.mean() > 1 - FEW_LOST:
                break
        begin, to = one.steps()
        groups = distinct_groups(one.cells, begin, to, live, self._maker)
        found_cells = [one.cells.take(each) for each in groups]
        return [each for each in found_cells if np.isin(self._nodes, each.node).all()]

    def _finer(self, cells: CellSet) -> CellSet:
        """Return the cells, halved where a node has few."""
        while True:
            few = np.bincount(cells.node, minlength=int(self._nodes[-1]) + 1) < ACROSS
            which = few[cells.node] & (cells.level < DEEPEST)
            if not which.any():
                return cells
            cells = self._maker.divided(cells, which)

    def _tube(self, cells: CellSet) -> Tube | None:
        """Return curves that hold the joints on all cells.

        None if they do not have certain increments, as in several postures.
        """
        low, high = hull(cells, self._nodes)
        middle = (low + high) / 2
        half = (high - low) / 2 * (1 + ROUNDED) + ROUNDED * (1 + np.abs(low))
        layer = np.searchsorted(self._nodes, cells.node)
        at, _ = cell_bounds(cells.level, cells.index)
        off = at - middle[layer]
        off -= TURN * np.rint(off / TURN)
        order = np.lexsort((off, layer))
        cells, off = cells.take(order), off[order]
        groups = np.split(np.arange(len(cells)), np.flatnonzero(np.diff(layer[order])) + 1)
        ended = ~self._steps.endless
        made = []
        for k, which in enumerate(groups):
            if np.ptp(cells.posture[which]):
                return None
            made.append(_curve(cells.take(which), off[which], half[k], ended))
        center, slope, bend, spread = (np.stack(each) for each in zip(*made, strict=True))
        if half.max() < NARROW:
            posture = np.array([cells.posture[which[0]] for which in groups], np.int64)
            found = self._maker.curves(self._nodes, middle, half, posture)
            if found is not None:
                turn = TURN * np.rint((center - found[0]) / TURN)
                near = np.abs(found[0] + turn - center).max(axis=1) < 1
                closer = (near & (found[3].sum(axis=1) < spread.sum(axis=1)))[:, None]
                center = np.where(closer, found[0] + turn, center)
                slope, bend = np.where(closer, found[1], slope), np.where(closer, found[2], bend)
                spread = np.where(closer, found[3], spread)
        box = np.abs(slope) * half[:, None] + np.abs(bend) * half[:, None] ** 2 / 2 + spread
        D = np.diff(center, axis=0)
        short = TURN * np.rint(D / TURN)
        if (np.abs(D - short) + box[1:] + box[:-1] > np.pi)[:, ~ended].any():
            return None
        center[1:] -= np.cumsum(np.where(ended, 0.0, short), axis=0)
        spread = spread + ROUNDED * (1 + np.abs(center) + box)
        return Tube(middle=middle, half=half, center=center, slope=slope, bend=bend, spread=spread)

    def _halves(self, cells: CellSet, apart: Array | None) -> list[CellSet]:
        """Return the cells in parts at one node; none if every node has one cell alone.

        The node is one with several postures, or where the program is the farthest from the
        parabola (M,), or the widest.
        """
        layer = np.searchsorted(self._nodes, cells.node)
        mixed = [k for k in range(len(self._nodes)) if np.ptp(cells.posture[layer == k])]
        if mixed:
            k = mixed[len(mixed) // 2]
            alone = np.unique(cells.posture[layer == k])
            return [cells.take((layer != k) | (cells.posture == p)) for p in alone]
        low, high = hull(cells, self._nodes)
        middle, _ = cell_bounds(cells.level, cells.index)
        off = middle - ((low + high) / 2)[layer]
        left = off - TURN * np.rint(off / TURN) <= 0
        wide = (high - low) / (high - low).max()
        score = wide if apart is None else apart + 1e-3 * apart.max() * wide**2 + 1e-12 * wide
        turns = _turns(cells, layer, ~self._steps.endless)
        if turns is not None:
            return [cells.take(~turns[0] | side) for side in (turns[1], ~turns[1])]
        for k in np.argsort(-score):
            here = layer == k
            if left[here].any() and not left[here].all():
                return [cells.take(~here | side) for side in (left, ~left)]
        return []


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


def _curve(
    cells: CellSet, off: Array, half: float, ended: Bools
) -> tuple[Array, Array, Array, Array]:
    """Return center, slope, bend and spread (n,) that hold the joints on the cells of a node.

    The cells are ``off`` (C,) rad from the middle, in ascending order; endless joints are on turns
    that follow each other. It is the parabola through the middles and ends with the least squares.
    """
    center = np.where(ended, cells.center, np.unwrap(cells.center, axis=0))
    _, wide = cell_bounds(cells.level, cells.index)
    low, high = (np.clip(off + side * wide, -half, half) - off for side in (-1, 1))
    points = np.stack([low, (low + high) / 2, high])[..., None]  # on each cell
    value = center + cells.slope * points + cells.bend * points**2 / 2
    t = ((off[:, None] + points) / half).ravel()
    basis = np.column_stack([np.ones_like(t), t, t**2 / 2])
    fit = np.linalg.lstsq(basis, value.reshape(len(t), -1), rcond=None)[0]
    c, s, b = fit[0], fit[1] / half, fit[2] / half**2
    # What the joints differ from it on each cell is a parabola: its ends and its vertex.
    t = off[:, None]
    level = center - (c + s * t + b * t**2 / 2)
    slope, bend = cells.slope - (s + b * t), cells.bend - b
    vertex = np.divide(-slope, bend, out=np.zeros_like(slope), where=bend != 0)
    places = [low[:, None], high[:, None], np.clip(vertex, low[:, None], high[:, None])]
    differs = np.stack([level + slope * x + bend * x**2 / 2 for x in places])
    largest = (differs.max(axis=0) + cells.spread).max(axis=0)
    least = (differs.min(axis=0) - cells.spread).min(axis=0)
    return c + (largest + least) / 2, s, b, (largest - least) / 2 * (1 + ROUNDED)
