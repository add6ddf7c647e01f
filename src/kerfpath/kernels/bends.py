"""The least cost of motions through each step from cell to cell, if pairs of steps keep (6).

The state is the step: its least cost up to its end is the minimum over the earlier steps that may
precede it by (6), plus what the pair of steps leaves unused of the price of (6). They are tested
in the order of their cost, until none can cost less.
"""

from __future__ import annotations

import numpy as np

from kerfpath.arrays import Array, Ints
from kerfpath.kernels.cell_elimination import Bend, bent_by
from kerfpath.kernels.jit import jit, jit_inline
from kerfpath.kernels.reduced import SLACK, Cells, Step

__all__ = ["cross_back", "cross_on"]


@jit_inline
def _unused(
    cells: Cells, bend: Bend, nu: Array, price: float, a: int, b: int, c: int, D: Array
) -> float:
    """Return the least by which the price of (6) exceeds nu . B on cells a, b and c; 0 if unknown.

    ``D`` (2, n) has the bends B between the middles of the cells, and whether they are certain.
    """
    along, size, wide = 0.0, 0.0, 0.0
    for i in range(len(nu)):
        if nu[i] == 0.0:
            continue
        if D[1, i] == 0.0:
            return 0.0
        x = nu[i] * D[0, i]
        along += x
        size += abs(x)
    for part in range(3):
        cell = a if part == 0 else b if part == 1 else c
        times = bend.one if part == 0 else bend.one + bend.two if part == 1 else bend.two
        slope, curve, spread = 0.0, 0.0, 0.0
        for i in range(len(nu)):
            slope += nu[i] * cells.slope[cell, i]
            curve += nu[i] * cells.bend[cell, i]
            spread += abs(nu[i]) * cells.spread[cell, i]
            for m in range(cells.reach.shape[1]):
                spread += abs(nu[i] * cells.tied[cell, m, i]) * cells.reach[cell, m]
        h = cells.half[cell]
        wide += times * (abs(slope) * h + abs(curve) * h * h / 2.0 + spread)
    unused = price - along - wide - SLACK * (price + size + wide)
    return max(unused, 0.0)


@jit
def cross_on(
    cells: Cells, step: Step, bend: Bend, lead: Ints, first: int, last: int,
    begin: Ints, to: Ints, origin: Ints, sorted_in: Ints, in_begin: Ints,
    cost: Array, rest: Array, most: float, nu: Array, price: Array, out_behind: Array,
) -> int:  # fmt: skip
    """Fill the least cost up to the end of each step from cells first..last-1; count the tests.

    The steps that end in cell b are sorted_in[in_begin[b - first]..], cheapest first by their
    ``out_behind`` (E,), which is already filled. Steps whose cost with the ``rest`` (C,) exceeds
    ``most`` get infinity. ``nu`` (n,) are the multipliers of (6) at this layer, and ``price``
    (C,) is the most that they add in a cell; what a pair of steps leaves of it unused is added to
    its cost.
    """
    D, tests = np.empty((2, len(nu))), 0
    for b in range(first, last):
        for e in range(begin[b], begin[b + 1]):
            out_behind[e] = np.inf
            for p in range(in_begin[b - first], in_begin[b - first + 1]):
                i = sorted_in[p]
                total = out_behind[i] + cost[e]
                if not total + rest[to[e]] <= most or total >= out_behind[e]:
                    break
                tests += 1
                if bent_by(cells, step, bend, lead, origin[i], b, to[e], D) < 0:
                    total += _unused(cells, bend, nu, price[b], origin[i], b, to[e], D)
                    out_behind[e] = min(out_behind[e], total)
            if not out_behind[e] + rest[to[e]] <= most:
                out_behind[e] = np.inf
    return tests


@jit
def cross_back(
    cells: Cells, step: Step, bend: Bend, lead: Ints, first: int, last: int,
    to: Ints, origin: Ints, sorted_on: Ints, on_begin: Ints, steps_in: Ints,
    cost: Array, behind: Array, most: float, nu: Array, price: Array, out_ahead: Array,
) -> int:  # fmt: skip
    """Fill the least cost from the end of each of the ``steps_in`` on; count the tests.

    The steps that begin in cell b are sorted_on[on_begin[b - first]..], cheapest first by the sum
    of cost and ``out_ahead`` (E,), which is already filled for them. ``nu`` and ``price`` are as in
    `cross_on`.
    """
    D, tests = np.empty((2, len(nu))), 0
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
