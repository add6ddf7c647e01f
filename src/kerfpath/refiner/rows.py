"""Rows and cones of a convex program, collected block by block and handed to the solver."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy import sparse

from kerfpath.arrays import Array
from kerfpath.conic import NonnegativeConeT, SecondOrderConeT, ZeroConeT, minimise

Sparse = Any  # scipy's stubs tell csr from csc and array from matrix, which nothing here needs


class ConstraintRows:
    """The constraints of a program whose first `boxed` unknowns lie in [-1, 1]."""

    def __init__(self, boxed: int) -> None:
        self.variables = boxed
        self._flat: list[tuple[Sparse, Array]] = []
        self._cones: list[tuple[Sparse, Array, int]] = []

    def new(self, count: int) -> Sparse:
        """Add `count` free unknowns; return them as rows of the identity."""
        first, self.variables = self.variables, self.variables + count
        place = np.arange(count), np.arange(first, self.variables)
        return sparse.csr_array((np.ones(count), place), shape=(count, self.variables))

    def hold(self, slope: Sparse, bound: Array) -> None:
        """Add slope x <= bound."""
        self._flat.append((slope, bound))

    def at_most(self, value: Array, slope: Sparse, bound: Array | float) -> None:
        """Add value + slope x <= bound over boxed unknowns.

        Rows that always hold are left out, and so are those that no unknown changes.
        """
        span = span_of(slope)
        kept = np.flatnonzero((value + span > bound) & (span > 0))
        if len(kept):
            self.hold(slope[kept], (bound - value)[kept])

    def cone(self, slope: Sparse, value: Array, size: int) -> None:
        """Add cones: of each `size` rows of slope x + value, the first is >= the others' norm."""
        self._cones.append((slope, value, size))

    def solve(self, cost: Array, equal: Sparse | None) -> Array | None:
        """Minimise cost x subject to equal x = 0; None if the solver finds no optimum."""
        zero = [] if equal is None else [(equal, np.zeros(equal.shape[0]))]
        cones = [(-slope, value) for slope, value, _ in self._cones]
        blocks = [(wide(a, self.variables), b) for a, b in zero + self._flat + cones]
        kinds: list[Any] = [ZeroConeT(len(b)) for _, b in zero]
        kinds.append(NonnegativeConeT(sum(len(b) for _, b in self._flat)))
        for _, value, size in self._cones:
            kinds += [SecondOrderConeT(size)] * (len(value) // size)
        found = minimise(
            np.pad(cost, (0, self.variables - len(cost))),
            sparse.vstack([a for a, _ in blocks]),
            np.concatenate([b for _, b in blocks]),
            kinds,
        )
        return found.x if found.solved else None


def span_of(rows: Sparse) -> Array:
    """Return the largest value (m,) of each row over unknowns in [-1, 1]."""
    row = np.repeat(np.arange(rows.shape[0]), np.diff(rows.indptr))
    return np.bincount(row, np.abs(rows.data), rows.shape[0]).astype(np.float64, copy=False)


def wide(rows: Sparse, variables: int) -> Sparse:
    """Return the rows over more unknowns, with zero coefficients for the added ones."""
    return sparse.csr_array((rows.data, rows.indices, rows.indptr), (rows.shape[0], variables))
