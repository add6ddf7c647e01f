"""Programs over cones, solved by Clarabel."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import clarabel
import numpy as np
from clarabel import NonnegativeConeT, SecondOrderConeT, ZeroConeT
from scipy import sparse

from kerfpath.arrays import Array
from kerfpath.memory import require_memory

__all__ = [
    "ConicSolution", "NonnegativeConeT", "SecondOrderConeT", "SparseRows", "ZeroConeT", "minimise",
]  # fmt: skip

SparseRows = Any  # scipy's stubs tell csr from csc and array from matrix, which nothing here needs

SOLVED = (clarabel.SolverStatus.Solved, clarabel.SolverStatus.AlmostSolved)
ROOM = 64 * 1024**2
"""Bytes that a small program may take; glibc maps as much for a thread that asks first."""
ROOM_PER_ENTRY = 1024
"""Further bytes for each entry of the rows; up to 250 were seen in programs of 100 nodes."""


class ConicSolution(NamedTuple):
    """What the solver found: unknowns (n,), dual of each row (m,), and whether it is solved."""

    x: Array
    dual: Array
    solved: bool


def minimise(
    cost: Array, rows: SparseRows, bounds: Array, cones: Sequence[Any], *, threads: int = 0,
    scales: bool = True,
) -> ConicSolution:  # fmt: skip
    """Minimise cost x, so that bounds - rows x lies in the cones.

    Parameters
    ----------
    cost : (n,)
    rows : (m, n) sparse
    bounds : (m,)
    cones : sequence
        Cones of Clarabel, whose sizes add up to m.
    threads : int
        Threads of the solver, 0: as many as it likes.
    scales : bool
        Whether the solver scales rows and unknowns first.

    Raises
    ------
    MemoryError
        There is too little memory: Clarabel would end the process.
    """
    rows = sparse.csc_matrix(rows)
    require_memory(ROOM + ROOM_PER_ENTRY * rows.nnz)
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.max_threads = threads
    settings.equilibrate_enable = scales
    none = sparse.csc_matrix((len(cost), len(cost)))
    found = clarabel.DefaultSolver(none, cost, rows, bounds, list(cones), settings).solve()
    return ConicSolution(np.array(found.x), np.array(found.z), found.status in SOLVED)
