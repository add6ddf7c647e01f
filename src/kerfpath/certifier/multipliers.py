"""Multipliers of (6): the gain in cost for a little more acceleration.

They are the dual of a convex program around a motion, with joints linear in the change of gamma. A
bound is valid with any multipliers; they only decide how close it is.
"""

from __future__ import annotations

from typing import Any

import clarabel
import numpy as np
from scipy import sparse

from kerfpath.arrays import Array
from kerfpath.certifier.stages import Steps
from kerfpath.kernels.metric import MANHATTAN, rho
from kerfpath.kernels.reduced import tangents

FAST = 10.0
"""Price of an increment beyond (5), in largest prices of (6)."""
NOTHING = 1e-4
"""Share of a weight below which a price counts as zero."""
SOLVED = (clarabel.SolverStatus.Solved, clarabel.SolverStatus.AlmostSolved)
_Rows = Any  # scipy's stubs tell csr from csc and array from matrix, which nothing here needs


def limit_prices(u: Array, slope: Array, steps: Steps, reach: float, most: float) -> Array | None:
    """Return prices (K, n) of (6) for a motion, zero at the first and the last node.

    None if (6) cannot bind, or if the program has no solution.

    Parameters
    ----------
    u : (K-1, n) rad
        Increments of the motion.
    slope : (K, n) rad/rad
        Derivatives of its joints by gamma.
    steps : Steps
    reach : float rad
        Largest change of gamma at each node.
    most : float
        The largest price, in weights, which is the penalty for breaking (6) in the program. Large
        prices give better bounds close to the motion, and worse ones farther away from it.
    """
    edges, n = u.shape
    weight, own = np.tile(steps.weight, edges), u.ravel()
    moved = _moved(slope * reach, n)
    bent, bend = moved[n:] - moved[:-n], (u[1:] - u[:-1]).ravel()
    bound, velocity = np.tile(steps.acceleration, edges - 1), np.tile(steps.velocity, edges)
    span = abs(moved).sum(axis=1)
    # Constraints that can bind: joints that reverse, increments near (5), changes near (6).
    turns = np.flatnonzero(np.abs(own) <= span)
    if steps.metric != MANHATTAN:
        turns = turns[:0]
    fast = np.flatnonzero(np.abs(own) + span > velocity)
    acts = np.flatnonzero(np.abs(bend) + abs(bent).sum(axis=1) > bound)
    if not len(acts):
        return None
    cost, curved = _metric(u, moved, steps)
    cost[turns] = 0.0
    linear = np.concatenate(
        [
            cost @ moved,
            np.ones(len(turns)),
            FAST * most * weight[fast],
            most * weight[: len(bend)][acts],
        ]
    )
    groups: list[tuple[_Rows, Array, Array | float]] = [
        (sparse.diags_array(weight[turns]) @ moved[turns], weight[turns] * own[turns], 0.0),
        (moved[fast], own[fast], velocity[fast]),
        (bent[acts], bend[acts], bound[acts]),
    ]
    dual = _dual(groups, linear, curved)
    if dual is None:
        return None
    prices = np.zeros(len(bend))
    prices[acts] = dual
    prices[np.abs(prices) <= NOTHING * weight[: len(bend)]] = 0.0
    return np.pad(prices.reshape(edges - 1, n), ((1, 1), (0, 0)))


def _moved(slope: Array, n: int) -> _Rows:
    """Return the derivatives of the increments by the nodes' gamma, ((K-1) n, K)."""
    nodes = len(slope)
    row = np.arange((nodes - 1) * n)
    values = np.concatenate([slope[1:].ravel(), -slope[:-1].ravel()])
    place = np.tile(row, 2), np.concatenate([row // n + 1, row // n])
    return sparse.csr_array((values, place), shape=(len(row), nodes))


def _metric(u: Array, moved: _Rows, steps: Steps) -> tuple[Array, _Rows]:
    """Return the slope of rho at increments u (K-1, n), ((K-1) n,), and its curvature (K, K).

    The Manhattan metric has no curvature between its kinks; for the others it is estimated.
    """
    step, slope = steps.over(1), np.empty_like(u)
    tangents(u, step, slope)
    if steps.metric == MANHATTAN:
        return slope.ravel(), sparse.csr_array((moved.shape[1],) * 2)
    length = np.array([rho(row, steps.weight, steps.metric) for row in u])
    share = np.repeat(1 / np.maximum(length, NOTHING), u.shape[1])
    weight = sparse.diags_array(np.tile(steps.weight**2, len(u)) * share)
    return slope.ravel(), moved.T @ weight @ moved


def _dual(groups: list[tuple[_Rows, Array, Array | float]], cost: Array, curved: _Rows) -> Any:
    """Return the dual of |value + slope x| <= bound + s, s >= 0, of the last group, or None.

    The program minimises cost (x, s) + x curved x / 2 over x from -1 to 1; every row of each group
    (slope, value, bound) has its own s.
    """
    boxed = curved.shape[0]
    sizes = [len(value) for _, value, _ in groups]
    first = boxed + np.cumsum([0, *sizes])
    unknowns = int(first[-1])

    def own(begin: int, size: int) -> _Rows:
        place = np.arange(size), np.arange(begin, begin + size)
        return sparse.csr_array((np.ones(size), place), shape=(size, unknowns))

    rows, bounds = [own(0, boxed), -own(0, boxed)], [np.ones(2 * boxed)]
    for (slope, value, bound), begin, size in zip(groups, first, sizes, strict=False):
        slack = own(int(begin), size)
        wide = sparse.hstack([slope, sparse.csr_array((size, unknowns - boxed))])
        rows += [-slack, wide - slack, -wide - slack]
        bounds += [np.zeros(size), bound - value, bound + value]
    right = np.concatenate(bounds)
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    solver = clarabel.DefaultSolver(
        sparse.csc_matrix(sparse.block_diag([curved, sparse.csr_array((unknowns - boxed,) * 2)])),
        cost,
        sparse.csc_matrix(sparse.vstack(rows)),
        right,
        [clarabel.NonnegativeConeT(len(right))],
        settings,
    )
    found = solver.solve()
    if found.status not in SOLVED:
        return None
    size = sizes[-1]
    above, below = np.array(found.z)[-2 * size :].reshape(2, size)
    return above - below
