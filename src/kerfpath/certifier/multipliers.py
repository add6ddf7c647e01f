"""Multipliers of (6): the gain in cost for a little more acceleration.

They are the dual of a convex program around a motion, with joints linear in the change of gamma. A
bound is valid with any multipliers; they only decide how close it is.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from scipy import sparse

from kerfpath.arrays import Array, Ints
from kerfpath.certifier.stages import Steps
from kerfpath.conic import NonnegativeConeT, SecondOrderConeT, SparseRows, minimise
from kerfpath.kernels.metric import CHEBYCHEV, MANHATTAN

FAST = 10.0
"""Price of an increment beyond (5), in largest prices of (6)."""
LEAST_WORTH = 0.25
"""Share of the largest weight that the prices of every joint are measured by at least: a joint
without weight costs nothing, but its limits keep others from moving less."""
NOTHING = 1e-4
"""Share of a weight below which a price counts as zero."""


def limit_prices(
    u: Array, slope: Array, steps: Steps, spans: Ints, reach: float, most: float,
    change: Array | None = None,
) -> Array | None:  # fmt: skip
    """Return prices (M, n) of (6) for a motion at M layers, zero at the first and the last.

    None if (6) cannot bind, or if the program has no solution.

    Parameters
    ----------
    u : (M-1, n) rad
        Increments of the motion from layer to layer.
    slope : (M, n) rad/rad
        Derivatives of its joints by gamma.
    steps : Steps
    spans : (M-1,)
        Number of intervals between the layers.
    reach : float rad
        Largest change of gamma at each layer.
    most : float
        The largest price per interval, in weights, which is the penalty for breaking (6) in the
        program; see `LEAST_WORTH`. Large prices give better bounds close to the motion, and worse
        ones farther away.
    change : (M, n) or (1, n) rad, optional
        Bound (6) at the layers, as by `Steps.changes`; default: where it allows most.
    """
    edges, n = u.shape
    weight, own = np.tile(steps.weight, edges), u.ravel()
    worth = np.maximum(weight, LEAST_WORTH * steps.weight.max())
    moved = _moved(slope * reach, n)
    each, apart = np.repeat(spans / 1.0, n), np.repeat((spans[:-1] + spans[1:]) / 2, n)
    mean = sparse.diags_array(1 / each) @ moved
    bent, bend = mean[n:] - mean[:-n], np.diff(u / spans[:, None], axis=0).ravel()
    own_change = steps.acceleration if change is None else change
    bound, velocity = (
        apart * np.broadcast_to(own_change, (edges + 1, n))[1:-1].ravel(),
        each * np.tile(steps.velocity, edges),
    )
    span = abs(moved).sum(axis=1)
    # Constraints that can bind: joints that reverse, increments near (5), changes near (6).
    turns = np.flatnonzero(np.abs(own) <= span)
    if steps.metric != MANHATTAN:
        turns = turns[:0]
    fast = np.flatnonzero(np.abs(own) + span > velocity)
    acts = np.flatnonzero(np.abs(bend) + abs(bent).sum(axis=1) > bound)
    if not len(acts):
        return None
    cost = np.sign(own) * weight
    cost[turns] = 0.0
    lengths = None
    if steps.metric != MANHATTAN:
        cost[:] = 0.0
        lengths = Lengths(sparse.diags_array(weight) @ moved, weight * own, n, steps.metric)
    linear = np.concatenate(
        [
            cost @ moved,
            np.ones(len(turns)),
            FAST * most * worth[fast],
            most * (apart * worth[: len(bend)])[acts],
            np.ones(edges if lengths else 0),
        ]
    )
    groups: list[tuple[SparseRows, Array, Array | float]] = [
        (sparse.diags_array(weight[turns]) @ moved[turns], weight[turns] * own[turns], 0.0),
        (moved[fast], own[fast], velocity[fast]),
        (bent[acts], bend[acts], bound[acts]),
    ]
    dual = _dual(groups, linear, lengths)
    if dual is None:
        return None
    prices = np.zeros(len(bend))
    prices[acts] = dual
    prices[np.abs(prices) <= NOTHING * worth[: len(bend)]] = 0.0
    return np.pad(prices.reshape(edges - 1, n), ((1, 1), (0, 0)))


def _moved(slope: Array, n: int) -> SparseRows:
    """Return the derivatives of the increments by the nodes' gamma, ((K-1) n, K)."""
    nodes = len(slope)
    row = np.arange((nodes - 1) * n)
    values = np.concatenate([slope[1:].ravel(), -slope[:-1].ravel()])
    place = np.tile(row, 2), np.concatenate([row // n + 1, row // n])
    return sparse.csr_array((values, place), shape=(len(row), nodes))


class Lengths(NamedTuple):
    """Weighted increments slope x + value, ((K-1) n,), and the metric that makes lengths of n."""

    slope: SparseRows
    value: Array
    n: int
    metric: int

    def cones(self, first: int, unknowns: int) -> tuple[SparseRows, Array, list[Any]]:
        """Return rows, right sides and cones by which unknowns from `first` on are no shorter."""
        edges = len(self.value) // self.n
        each = np.arange(len(self.value)) // self.n
        zeros = sparse.csr_array((len(self.value), unknowns - self.slope.shape[1]))
        slope = sparse.hstack([self.slope, zeros])
        if self.metric == CHEBYCHEV:
            ones = np.ones(len(each))
            own = sparse.csr_array(
                (ones, (np.arange(len(each)), first + each)), shape=(len(each), unknowns)
            )
            right = np.concatenate([-self.value, self.value])
            cones = [NonnegativeConeT(len(right))]
            return sparse.vstack([slope - own, -slope - own]), right, cones
        edge = np.arange(edges)
        size = (edges, unknowns)
        own = sparse.csr_array((np.ones(edges), (edge, first + edge)), shape=size)
        order = np.argsort(np.append(edge, each), kind="stable")  # the length, then its joints
        rows = sparse.csr_array(sparse.vstack([-own, -slope]))[order]
        right = np.append(np.zeros(edges), self.value)[order]
        return rows, right, [SecondOrderConeT(self.n + 1)] * edges


def _dual(
    groups: list[tuple[SparseRows, Array, Array | float]], cost: Array, lengths: Lengths | None
) -> Any:
    """Return the dual of |value + slope x| <= bound + s, s >= 0, of the last group, or None.

    The program minimises cost (x, s, r) over x from -1 to 1; every row of each group (slope, value,
    bound) has its own s, and r are no shorter than the lengths.
    """
    boxed = groups[0][0].shape[1]
    sizes = [len(value) for _, value, _ in groups]
    first = boxed + np.cumsum([0, *sizes])
    unknowns = len(cost)

    def own(begin: int, size: int) -> SparseRows:
        place = np.arange(size), np.arange(begin, begin + size)
        return sparse.csr_array((np.ones(size), place), shape=(size, unknowns))

    rows, bounds = [own(0, boxed), -own(0, boxed)], [np.ones(2 * boxed)]
    cones = [NonnegativeConeT(2 * boxed)]
    if lengths is not None:
        longer, right, kinds = lengths.cones(int(first[-1]), unknowns)
        rows, bounds, cones = [*rows, longer], [*bounds, right], cones + kinds
    for (slope, value, bound), begin, size in zip(groups, first, sizes, strict=False):
        slack = own(int(begin), size)
        wide = sparse.hstack([slope, sparse.csr_array((size, unknowns - boxed))])
        rows += [-slack, wide - slack, -wide - slack]
        bounds += [np.zeros(size), bound - value, bound + value]
    cones.append(NonnegativeConeT(3 * sum(sizes)))
    found = minimise(cost, sparse.vstack(rows), np.concatenate(bounds), cones)
    if not found.solved:
        return None
    size = sizes[-1]
    above, below = found.dual[-2 * size :].reshape(2, size)
    return above - below
