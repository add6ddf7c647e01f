"""A tube: curves of the joints on an interval of gamma at each layer, and programs about them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial import polynomial
from scipy import sparse

from kerfpath.arrays import Array, Bools, Ints, short_repr
from kerfpath.certificate import cell_bounds
from kerfpath.certifier.cells import TURN, CellMaker, CellSet
from kerfpath.certifier.neighbours import Changes, steps_of_gamma, ties
from kerfpath.certifier.stages import Steps
from kerfpath.conic import SparseRows
from kerfpath.kernels.reduced import excess

NARROW = 0.2
"""rad: half-width up to which the joints are enclosed anew on the whole interval of a layer."""
TOUCHES = -1.0, -0.7, -0.35, 0.0, 0.35, 0.7, 1.0
"""Where on the cubic, in half-widths, its powers are held."""
PIECES = 32
"""Parts of an interval on which the least of a cubic is that of a parabola, but for its change."""
UNIT = 2.0**-52
"""Relative spacing of floating-point numbers."""
ROUNDED = 1e-13
"""Rounding error of the curves, in rad per rad and in rad."""
FACTORIAL = np.array([1.0, 1.0, 2.0, 6.0])
DEEPEST = 18
"""Largest level of the cells: 2e-5 deg."""


class Duals(NamedTuple):
    """Duals of a program: y (M - 1, n) of increments, nu (M, n) of (6), ties (R,) of neighbours."""

    y: Array
    nu: Array
    ties: Array


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Tube:
    """Curves of the joints on one interval of gamma at each of M layers.

    Parameters
    ----------
    middle, half : (M,) rad
    center, slope, bend, twist, spread : (M, n)
        The joints are center + slope t + bend t^2 / 2 + twist t^3 / 6 +- spread; the increments
        are those of the centres.
    changes : Changes, optional
        How far gamma may change from layer to layer.
    tied : tuple, optional
        The rows (R, 2 M) that follow for gamma and its squares, in half-widths, and their largest
        values (R,).
    """

    middle: Array
    half: Array
    center: Array
    slope: Array
    bend: Array
    twist: Array
    spread: Array
    changes: Changes | None = None
    tied: tuple[SparseRows, Array] | None = None

    __repr__ = short_repr

    @property
    def power(self) -> Array:
        """Coefficients (M, 4, n) of the joints by powers of t."""
        curves = np.stack([self.center, self.slope, self.bend, self.twist], axis=1)
        return np.asarray(curves / FACTORIAL[:, None])

    @property
    def scaled(self) -> Array:
        """Coefficients (M, 4, n) of the joints by powers of t in half-widths."""
        return np.asarray(self.power * (self.half[:, None] ** np.arange(4))[..., None])

    @property
    def box(self) -> Array:
        """Largest distance (M, n) of a joint from its centre."""
        return np.asarray(np.abs(self.scaled[:, 1:]).sum(axis=1) + self.spread)

    def limits(self, steps: Steps, spans: Ints) -> Array:
        """Return bound (6) in the tube, as `Steps.changes`."""
        return steps.changes(self.center, self.box, spans)

    def bent(self, steps: Steps, spans: Ints) -> Array:
        """Return the most (M - 2, n) rad by which the means of two steps differ by (6)."""
        change = np.broadcast_to(self.limits(steps, spans), self.center.shape)[1:-1]
        return np.asarray(change * ((spans[:-1] + spans[1:]) / 2)[:, None])

    def with_ties(self, steps: Steps, spans: Ints) -> tuple[Tube | None, int]:
        """Return the tube with what its steps must keep; None if it has no motion at all.

        Then the second is the layer that rules all out.
        """
        change = self.bent(steps, spans)
        found, layer = steps_of_gamma(self.power, self.spread, self.half, spans, steps, change)
        if found is None:
            return None, layer
        return replace(self, changes=found, tied=ties(found, self.half, spans)), 0

    def least(self, steps: Steps, spans: Ints, duals: Duals) -> float:
        """Return a lower bound on the cost of the motions of the tube, from any duals.

        Parameters
        ----------
        steps : Steps
        spans : (M - 1,)
        duals : Duals
            Slopes of the cost, tilt included, by the increments; multipliers of (6); multipliers of
            the rows that are tied, of which negative ones do not count.
        """
        y, nu, _ = duals
        over = sum(excess(y[k], steps.tilted(nu, spans, k)) for k in range(len(y)))
        force = -np.diff(y, axis=0, prepend=0.0, append=0.0)
        size, scaled = np.abs(force), self.scaled
        value = np.einsum("kn,kpn->kp", force, scaled)
        sizes = (size * (np.abs(scaled).sum(axis=1) + self.spread)).sum()
        price, paid = steps.price(nu, spans, self.limits(steps, spans)), 0.0
        if self.tied is not None:
            rows, most = self.tied
            count = np.maximum(duals.ties, 0.0)
            M = len(value)
            more = rows.T @ count
            value[:, 1] += more[:M]
            value[:, 2] += more[M:]
            paid = float(most @ count)
            sizes += float((abs(rows).T @ count).sum() + np.abs(most) @ count)
        total = float((_lowest(value) - (size * self.spread).sum(axis=1)).sum())
        total -= over + price + paid
        terms = force.size + (0 if self.tied is None else len(duals.ties))
        return total - 4 * UNIT * terms * (float(sizes) + over + price)

    def pull(self, duals: Duals) -> Array:
        """Return how much squares and cubes of gamma matter at each layer (M,), with duals."""
        force = -np.diff(duals.y, axis=0, prepend=0.0, append=0.0)
        value = np.einsum("kn,kpn->kp", force, self.scaled)
        if self.tied is not None:
            value[:, 2] += (self.tied[0].T @ np.maximum(duals.ties, 0.0))[len(value) :]
        return np.asarray(np.abs(value[:, 2:]).sum(axis=1))


def _lowest(value: Array) -> Array:
    """Return lower bounds (M,) of cubics with coefficients (M, 4) from -1 to 1."""
    half = 1 / PIECES
    at = (2 * np.arange(PIECES) + 1) * half - 1
    one, two, three = (polynomial.polyder(value.T, m) for m in (1, 2, 3))
    level, slope, bend = (polynomial.polyval(at, p) for p in (value.T, one, two))
    ends = bend * half**2 / 2 - np.abs(slope) * half
    inside = np.abs(slope) < bend * half
    lowest = np.where(inside, -(slope**2) / (2 * np.where(inside, bend, 1.0)), ends)
    return np.asarray((level + lowest).min(axis=1) - np.abs(three[0]) * half**3 / 6)


class TubeRows:
    """What programs of tubes at given layers share: their variables, and the rows of a tube.

    The variables are gamma in half-widths (M,), its squares (M,), its cubes (M,), the increments of
    the joints (M - 1, n) in a row, and `more` of the program's own; `gamma`, `square`, `step` and
    `own` are the rows of the identity that pick them, and `bend` the rows by which (6) bounds the
    changes of the mean increments. Rows come in pairs of a matrix and its largest values.
    """

    def __init__(self, steps: Steps, nodes: Ints, more: int) -> None:
        self.spans = np.diff(nodes)
        M, n = len(nodes), len(steps.velocity)
        size = (M - 1) * n
        self.shape, self.size, self.count = (M, n), size, 3 * M + size + more
        eye = sparse.eye_array(self.count, format="csr")
        self.gamma, self.square, cube = eye[:M], eye[M : 2 * M], eye[2 * M : 3 * M]
        self.step, self.own = eye[3 * M : 3 * M + size], eye[3 * M + size :]
        each = np.repeat(self.spans.astype(float), n)
        mean: Any = sparse.csr_array(sparse.diags_array(1 / each) @ self.step)
        self.steps, self.bend = steps, mean[n:] - mean[:-n]
        velocity = [steps.over(int(m)).velocity for m in self.spans]
        self.move = self.step, np.concatenate(velocity)
        one, t, w = np.ones(M), self.gamma, self.square
        self.powers: list[tuple[Any, Array]] = []
        for side in (1.0, -1.0):  # (1 +- t) (t - a)^2 is nowhere negative
            for at in TOUCHES:
                c = polynomial.polymul([1.0, side], polynomial.polyfromroots([at, at]))
                self.powers.append((-c[1] * t - c[2] * w - c[3] * cube, c[0] * one))
        k, i = np.divmod(np.arange(size), n)
        columns = [m * M + j for m in range(3) for j in (k + 1, k)]
        self._place = np.tile(np.arange(size), 6), np.concatenate(columns)
        self._at = k, i

    def of(self, tube: Tube) -> tuple[Any, Array]:
        """Return the rows by which the increments are those of a tube, and its steps tied."""
        k, i = self._at
        scaled = tube.scaled[:, 1:]
        values = [each for m in range(3) for each in (scaled[k + 1, m, i], -scaled[k, m, i])]
        moved = sparse.csr_array((np.concatenate(values), self._place), (self.size, self.count))
        link = moved - self.step
        D, wide = np.diff(tube.center, axis=0).ravel(), (tube.spread[1:] + tube.spread[:-1]).ravel()
        rows, right = [link, -link], [wide - D, wide + D]
        if tube.tied is not None:
            tied, most = tube.tied
            none = sparse.csr_array((len(most), self.count - tied.shape[1]))
            rows.append(sparse.hstack([tied, none]))
            right.append(most)
        return sparse.vstack(rows), np.concatenate(right)

    def duals(self, found: Array, tube: Tube) -> Duals:
        """Return the duals of a program whose rows begin with a tube's and `bend`, both ways."""
        (M, n), size = self.shape, self.size
        y = (found[:size] - found[size : 2 * size]).reshape(M - 1, n)
        count = 0 if tube.tied is None else len(tube.tied[1])
        rest = found[2 * size + count :]
        above = rest[: 2 * (size - n)].reshape(2, M - 2, n)
        nu = np.pad(above[0] - above[1], ((1, 1), (0, 0)))
        return Duals(y, nu, found[2 * size : 2 * size + count])


def tube_about(
    maker: CellMaker, nodes: Ints, gamma: Array, half: Array, posture: Ints
) -> Tube | None:
    """Return the tube within half-widths (M,) rad of a motion; None where a pose is singular.

    Endless joints are on the turns that follow each other.

    Parameters
    ----------
    maker : CellMaker
    nodes, gamma, half, posture : (M,)
    """
    curves = maker.curves(nodes, gamma, half, posture)
    if curves is None:
        return None
    center, slope, bend, spread = curves
    short = TURN * np.rint(np.diff(center, axis=0) / TURN)
    center[1:] -= np.cumsum(np.where(maker.turns, short, 0.0), axis=0)
    return Tube(
        middle=gamma, half=half, center=center, slope=slope, bend=bend, twist=np.zeros_like(bend),
        spread=spread,
    )  # fmt: skip


def motion_through(
    maker: CellMaker, nodes: Ints, gamma: Array, posture: int
) -> tuple[Array, Array] | None:
    """Return joints (M, n) and increments (M - 1, n) of a motion; None if a node is out of reach.

    Endless joints take the short way.
    """
    q, _, reached = maker.joints(nodes, gamma, posture)
    if not reached.all():
        return None
    u = np.diff(q, axis=0)
    return q, u - np.where(maker.turns, TURN * np.rint(u / TURN), 0.0)


def limit_share(q: Array, u: Array, spans: Ints, steps: Steps) -> float:
    """Return the largest share of (5) and (6) that increments u (M - 1, n) at q (M, n) take."""
    rate, apart = u / spans[:, None], ((spans[:-1] + spans[1:]) / 2)[:, None]
    bent = np.diff(rate, axis=0) / apart
    fast = np.abs(rate / steps.velocity).max()
    change = np.broadcast_to(steps.changes(q, 0.0, spans), q.shape)[1:-1]
    return float(max(fast, np.abs(bent / change).max(initial=0.0)))


def finer(maker: CellMaker, cells: CellSet, last: int, across: int) -> CellSet:
    """Return cells of nodes up to `last`, halved wherever a node has fewer than `across`."""
    while True:
        few = np.bincount(cells.node, minlength=last + 1) < across
        which = few[cells.node] & (cells.level < DEEPEST)
        if not which.any():
            return cells
        cells = maker.divided(cells, which)


def enclosed(
    maker: CellMaker, endless: Bools, nodes: Ints, cells: CellSet, ends: tuple[Array, Array]
) -> Tube | None:
    """Return curves that hold the joints on the parts of cells within intervals (M,) of gamma.

    None if they do not have certain increments, as in several postures.
    """
    low, high = ends
    middle = (low + high) / 2
    half = (high - low) / 2 * (1 + ROUNDED) + ROUNDED * (1 + np.abs(low))
    layer = np.searchsorted(nodes, cells.node)
    at, wide = cell_bounds(cells.level, cells.index)
    off = at - middle[layer]
    off -= TURN * np.rint(off / TURN)
    inside = np.abs(off) <= half[layer] + wide
    cells, off, layer = cells.take(inside), off[inside], layer[inside]
    order = np.lexsort((off, layer))
    cells, off = cells.take(order), off[order]
    groups = np.split(np.arange(len(cells)), np.flatnonzero(np.diff(layer[order])) + 1)
    if len(groups) < len(nodes) or any(np.ptp(cells.posture[which]) for which in groups):
        return None
    ended = ~endless
    made = [_curve(cells.take(g), off[g], half[k], ended) for k, g in enumerate(groups)]
    center, slope, bend, twist, spread = (np.stack(each) for each in zip(*made, strict=True))
    if half.max() < NARROW:
        posture = np.array([cells.posture[which[0]] for which in groups], np.int64)
        found = maker.curves(nodes, middle, half, posture)
        if found is not None:
            turn = TURN * np.rint((center - found[0]) / TURN)
            near = np.abs(found[0] + turn - center).max(axis=1) < 1
            closer = (near & (found[3].sum(axis=1) < spread.sum(axis=1)))[:, None]
            center = np.where(closer, found[0] + turn, center)
            slope, bend = np.where(closer, found[1], slope), np.where(closer, found[2], bend)
            twist = np.where(closer, 0.0, twist)
            spread = np.where(closer, found[3], spread)
    tube = Tube(
        middle=middle, half=half, center=center, slope=slope, bend=bend, twist=twist, spread=spread
    )
    box = tube.box
    D = np.diff(center, axis=0)
    short = TURN * np.rint(D / TURN)
    if (np.abs(D - short) + box[1:] + box[:-1] > np.pi)[:, endless].any():
        return None
    center[1:] -= np.cumsum(np.where(ended, 0.0, short), axis=0)
    return replace(tube, center=center, spread=spread + ROUNDED * (1 + np.abs(center) + box))


def _curve(cells: CellSet, off: Array, half: float, ended: Bools) -> Sequence[Array]:
    """Return center, slope, bend, twist and spread (n,) that hold the joints on cells of a layer.

    The cells are ``off`` (C,) rad from the middle, in ascending order; endless joints are on turns
    that follow each other. It is the cubic through their middles and ends with the least squares.
    """
    center = np.where(ended, cells.center, np.unwrap(cells.center, axis=0))
    _, wide = cell_bounds(cells.level, cells.index)
    low, high = (np.clip(off + side * wide, -half, half) for side in (-1, 1))
    middle, reach = (low + high) / 2, ((high - low) / 2)[:, None]
    x = (middle - off)[:, None]  # of each cell, whose part it is from here on
    center, slope = center + cells.slope * x + cells.bend * x**2 / 2, cells.slope + cells.bend * x
    points = reach * np.array([-1.0, 0.0, 1.0])[:, None, None]
    value = center + slope * points + cells.bend * points**2 / 2
    t = ((middle[:, None] + points) / half).ravel()
    basis = polynomial.polyvander(t, 3) / FACTORIAL
    fit = np.linalg.lstsq(basis, value.reshape(len(t), -1), rcond=None)[0]
    c, s, b, g = fit / half ** np.arange(4.0)[:, None]
    # What the joints differ from it on each part is a parabola, with its ends and its vertex, but
    # for the cubic.
    t = middle[:, None]
    level = center - (c + s * t + b * t**2 / 2 + g * t**3 / 6)
    slope, bend = slope - (s + b * t + g * t**2 / 2), cells.bend - (b + g * t)
    loose = cells.spread + np.abs(g) * reach**3 / 6
    vertex = np.divide(-slope, bend, out=np.zeros_like(slope), where=bend != 0)
    places = [-reach, reach, np.clip(vertex, -reach, reach)]
    differs = np.stack([level + slope * x + bend * x**2 / 2 for x in places])
    largest = (differs.max(axis=0) + loose).max(axis=0)
    least = (differs.min(axis=0) - loose).min(axis=0)
    return c + (largest + least) / 2, s, b, g, (largest - least) / 2 * (1 + ROUNDED)


def hull(cells: CellSet, nodes: Ints) -> tuple[Array, Array]:
    """Return the ends (M,) of the shortest interval of gamma that holds the cells of each node."""
    middle, half = cell_bounds(cells.level, cells.index)
    order = np.lexsort((middle, cells.node))
    low, high = np.empty((2, len(nodes)))
    begin = np.searchsorted(cells.node[order], nodes)
    last = 0.0
    for k, which in enumerate(np.split(order, begin[1:])):
        at, wide = middle[which], half[which]
        gap = int(np.argmax(np.diff(at, append=at[0] + TURN))) + 1
        at, wide = np.roll(at, -gap), np.roll(wide, -gap)
        at = at[0] + np.mod(at - at[0], TURN)
        turn = TURN * np.rint((last - at.mean()) / TURN)
        low[k], high[k] = (at - wide).min() + turn, (at + wide).max() + turn
        last = (low[k] + high[k]) / 2
    return low, high
