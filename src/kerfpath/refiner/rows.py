"""Rows and cones of a convex program, collected block by block and handed to the solver."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from scipy import sparse

from kerfpath.arrays import Array, Bools, Ints
from kerfpath.conic import NonnegativeConeT, SecondOrderConeT, ZeroConeT, minimise


class Rows(NamedTuple):
    """Rows of a sparse matrix with w entries each: values (m, w) in columns (m, w).

    Further entries in the column of another one are zero. The rows of a motion join a few nodes
    each, so that work on whole arrays takes far less time than on general sparse matrices.
    """

    value: Array
    column: Ints

    def __neg__(self) -> Rows:
        return Rows(-self.value, self.column)

    def of(self, which: Ints | Bools | slice) -> Rows:
        """Return some of the rows."""
        return Rows(self.value[which], self.column[which])

    def scaled(self, factors: Array) -> Rows:
        """Multiply the rows by factors (m,)."""
        return Rows(self.value * factors[:, None], self.column)

    def beside(self, value: Array | float, column: Ints) -> Rows:
        """Return the rows with more entries: values (m, v) in columns (m, v) that have none yet."""
        more = np.broadcast_to(value, column.shape)
        return Rows(np.hstack([self.value, more]), np.hstack([self.column, column]))

    def plus(self, other: Rows) -> Rows:
        """Add other rows (m, v)."""
        value, more, w = self.value.copy(), other.value.copy(), self.value.shape[1]
        for i in range(w):
            for j in range(more.shape[1]):
                same = self.column[:, i] == other.column[:, j]
                value[same, i] += more[same, j]
                more[same, j] = 0.0
        return Rows(value, self.column).beside(more, other.column)

    @property
    def span(self) -> Array:
        """Largest value (m,) of each row over unknowns in [-1, 1]."""
        return np.asarray(np.abs(self.value).sum(axis=1))


class ConstraintRows:
    """The constraints of a program whose first `boxed` unknowns lie in [-1, 1]."""

    def __init__(self, boxed: int) -> None:
        self.variables = boxed
        self._flat: list[tuple[Rows, Array]] = []
        self._cones: list[tuple[Rows, Array, int]] = []

    def new(self, count: int) -> Ints:
        """Add `count` free unknowns; return their columns."""
        first, self.variables = self.variables, self.variables + count
        return np.arange(first, self.variables)

    def hold(self, slope: Rows, bound: Array) -> None:
        """Add slope x <= bound."""
        self._flat.append((slope, bound))

    def at_most(self, value: Array, slope: Rows, bound: Array | float) -> None:
        """Add value + slope x <= bound over boxed unknowns.

        Rows that always hold are left out, and so are those that no unknown changes.
        """
        span = slope.span
        kept = np.flatnonzero((value + span > bound) & (span > 0))
        if len(kept):
            self.hold(slope.of(kept), (bound - value)[kept])

    def cone(self, slope: Rows, value: Array, size: int) -> None:
        """Add cones: of each `size` rows of slope x + value, the first is >= the others' norm."""
        self._cones.append((slope, value, size))

    def solve(self, cost: Array, equal: Rows | None, *, scaled: bool = False) -> Array | None:
        """Minimise cost x subject to equal x = 0; None if the solver finds no optimum.

        The rows of a program that is `scaled` already are scaled again only if it is not solved so.
        """
        zero = [] if equal is None else [(equal, np.zeros(len(equal.value)))]
        blocks = [*zero, *self._flat, *((-slope, value) for slope, value, _ in self._cones)]
        kinds: list[Any] = [ZeroConeT(len(b)) for _, b in zero]
        kinds.append(NonnegativeConeT(sum(len(b) for _, b in self._flat)))
        for _, value, size in self._cones:
            kinds += [SecondOrderConeT(size)] * (len(value) // size)
        bounds = np.concatenate([b for _, b in blocks])
        widths = [np.full(len(b), a.value.shape[1]) for a, b in blocks]
        row = np.repeat(np.arange(len(bounds)), np.concatenate(widths))
        value = np.concatenate([a.value.ravel() for a, _ in blocks])
        column = np.concatenate([a.column.ravel() for a, _ in blocks])
        some = value != 0
        shape = len(bounds), self.variables
        matrix = sparse.csc_matrix((value[some], (row[some], column[some])), shape=shape)
        padded = np.pad(cost, (0, self.variables - len(cost)))
        for scales in (False, True) if scaled else (True,):
            found = minimise(padded, matrix, bounds, kinds, scales=scales)
            if found.solved:
                return found.x
        return None
