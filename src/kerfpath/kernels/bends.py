"""The least cost of motions through each step from cell to cell, if pairs of steps keep (6).

The state is the step: its least cost up to its end is the minimum over the earlier steps that may
precede it by (6). They are tested in the order of their cost, until the first that may.
"""

from __future__ import annotations

import numpy as np

from kerfpath.arrays import Array, Ints
from kerfpath.kernels.cell_elimination import Bend, bent_by
from kerfpath.kernels.jit import jit
from kerfpath.kernels.reduced import Cells, Step

__all__ = ["cross_back", "cross_on"]


@jit
def cross_on(
    cells: Cells, step: Step, bend: Bend, lead: Ints, first: int, last: int,
    begin: Ints, to: Ints, origin: Ints, sorted_in: Ints, in_begin: Ints,
    cost: Array, rest: Array, most: float, out_behind: Array,
) -> int:  # fmt: skip
    """Fill the least cost up to the end of each step from cells first..last-1; count the tests.

    The steps that end in cell b are sorted_in[in_begin[b - first]..], cheapest first by their
    ``out_behind`` (E,), which is already filled. Steps whose cost with the ``rest`` (C,) exceeds
    ``most`` get infinity.
    """
    D, tests = np.empty((2, len(bend.bound))), 0
    for b in range(first, last):
        for e in range(begin[b], begin[b + 1]):
            out_behind[e] = np.inf
            for p in range(in_begin[b - first], in_begin[b - first + 1]):
                i = sorted_in[p]
                total = out_behind[i] + cost[e]
                if not total + rest[to[e]] <= most:
                    break
                tests += 1
                if bent_by(cells, step, bend, lead, origin[i], b, to[e], D) < 0:
                    out_behind[e] = total
                    break
    return tests


@jit
def cross_back(
    cells: Cells, step: Step, bend: Bend, lead: Ints, first: int, last: int,
    to: Ints, origin: Ints, sorted_on: Ints, on_begin: Ints, steps_in: Ints,
    cost: Array, behind: Array, most: float, out_ahead: Array,
) -> int:  # fmt: skip
    """Fill the least cost from the end of each of the ``steps_in`` on; count the tests.

    The steps that begin in cell b are sorted_on[on_begin[b - first]..], cheapest first by the sum
    of cost and ``out_ahead`` (E,), which is already filled for them.
    """
    D, tests = np.empty((2, len(bend.bound))), 0
    for i in steps_in:
        b = to[i]
        out_ahead[i] = np.inf
        for p in range(on_begin[b - first], on_begin[b - first + 1]):
            e = sorted_on[p]
            total = cost[e] + out_ahead[e]
            if not behind[i] + total <= most:
                break
            tests += 1
            if bent_by(cells, step, bend, lead, origin[i], b, to[e], D) < 0:
                out_ahead[i] = total
                break
    return tests
