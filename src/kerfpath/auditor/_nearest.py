"""Find the pose and pair with the least clearance among many poses, with few distance queries.

From one joint vector to another, no corner of a body moves farther, seen from the other body of its
pair, than the sum of |dq_j| times its reach from joint j, and the distance changes by no more. So
each distance found gives lower bounds at all other poses, and a distance must be computed only
where these bounds are not above the least one found. The result is still exact.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from kerfpath._arrays import Array, Bools, Ints
from kerfpath.cell import Cell

__all__ = ["nearest"]

SURE = 1e-5
"""m above the least value found where a bound rules a pose out; distances are exact to 1e-6 m."""
NEIGHBOURS = 4
"""Number of solved poses that give bounds for another pose."""


def nearest(
    cell: Cell, rates: Array, q: Array, frames: Array, wanted: Bools
) -> tuple[int, int, float]:
    """Return the pose and the pair with the least distance beyond the near-miss distance.

    Parameters
    ----------
    cell : Cell
    rates : (P, n) m/rad
        Largest motion of a corner of each pair per joint, seen from the other body.
    q : (B, n) rad
    frames : (B, n+1, 4, 4) m
        Poses of base and links at q.
    wanted : (P,) bool
        The pairs to check, at least one.

    Returns
    -------
    row, pair : int
        Index of the pose and of the pair.
    beyond : float m
        Distance of the pair less its near-miss distance; NaN if a joint vector is NaN.
    """
    pairs = np.flatnonzero(wanted)
    beyond = cell.scene.cheap(frames)[:, pairs] - cell.required[pairs]
    found = np.isnan(beyond) | cell.scene.round[pairs]
    least = float(beyond[found].min(initial=np.inf))
    count = 1
    while True:
        looked = False
        for c in np.argsort(beyond.min(axis=0)):
            p, own = pairs[c], beyond[:, c]
            # The depth of overlapping meshes is no bound: nothing is ruled out below contact.
            clear = max(least, float(-cell.required[p])) + SURE
            open_ = np.flatnonzero(~found[:, c] & (own <= clear))
            if not open_.size:
                continue
            looked = True
            rows = open_[_spread(own[open_], count)]
            enough = np.full(len(rows), clear + cell.required[p])
            own[rows] = cell.scene.pair_bounds(p, frames[rows], enough)[0] - cell.required[p]
            found[rows, c] = True
            least = min(least, float(own[rows].min()))
            near, far = np.flatnonzero(found[:, c]), open_[~found[open_, c]]
            own[far] = np.maximum(own[far], _bounds(q[near], own[near], q[far], rates[p]))
        if not looked:
            break
        count *= 2
    row, c = divmod(int(np.argmin(np.where(found, beyond, np.inf))), len(pairs))
    return row, int(pairs[c]), float(beyond[row, c])


def _spread(bounds: Array, count: int) -> Ints:
    """Return the index of the least bound if `count` is 1, otherwise `count` spread indices."""
    if count == 1:
        return np.array([np.argmin(bounds)])
    return np.unique(np.linspace(0, len(bounds) - 1, min(count, len(bounds))).astype(np.int64))


def _bounds(q: Array, beyond: Array, there: Array, rate: Array) -> Array:
    """Return lower bounds (S,) m at joints `there` (S, n) from values `beyond` at q (F, n) rad."""
    count = min(NEIGHBOURS, len(q))
    moved, at = cKDTree(q * rate).query(there * rate, count, p=1)
    shape = (len(there), count)
    bounds = beyond[np.asarray(at).reshape(shape)] - np.asarray(moved).reshape(shape)
    return np.asarray(bounds.max(axis=1))
