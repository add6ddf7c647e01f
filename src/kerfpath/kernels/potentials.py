"""The potential of a stage, computed backwards: the least cost to come, by cells of gamma.

The slopes of a cut come from the step that seems best from one end of the cell (a guess, which
may be wrong); its level is then proved: the least over all cells that a step can lead to.
"""

from __future__ import annotations

from math import pi

import numpy as np

from kerfpath.arrays import Array, Bools, Ints
from kerfpath.kernels.jit import jit, jit_inline
from kerfpath.kernels.metric import extend, finish
from kerfpath.kernels.reduced import (
    SLACK,
    Cells,
    Potential,
    Step,
    beyond,
    lean,
    least_ahead,
    near,
    tangent,
    window,
)
from kerfpath.kernels.slopes import Spare, flatten, guess_slopes

__all__ = ["close_cut", "cross_cells", "lay_potential", "link_cells", "reach_cells"]


@jit_inline
def _proved(
    cells: Cells,
    potential: Potential,
    step: Step,
    a: int,
    b: int,
    way: int,
    D: Array,
    y: Array,
    price: float,
    enough: float,
    other: Array,
) -> float:
    """Return a lower bound of the cost of a step from cell a to b, with V at b and slopes y at a.

    The slopes y alone are used if they prove ``enough``; else the best of several slopes counts. A
    joint that may go either way round has no definite increment, and its slope is then 0.
    """
    best = -np.inf
    if way == 1:
        best = _along(D, y) - price + least_ahead(cells, potential, b, y)
        if best > enough:
            return best
    for kind in range(-1 if way == 1 else -2, 3):
        if kind == -1:
            tangent(D, step, other)
        for i in range(len(y)):
            if kind == 2 or (way == 2 and _either_way(cells, step, a, b, i, D[i])):
                other[i] = 0.0
            elif kind >= 0:
                other[i] = potential.dual[b, kind, i]
            elif kind == -2:
                other[i] = y[i]
        best = max(best, _turned(cells, potential, step, a, b, D, y, other))
        if best > enough:
            break
    return best


@jit_inline
def _either_way(cells: Cells, step: Step, a: int, b: int, i: int, d: float) -> bool:
    """Return whether joint i may go either way round from cell a to b, the short way being d."""
    wide: float = abs(d) + cells.box[a, i] + cells.box[b, i]
    return bool(step.endless[i]) and wide > pi


@jit_inline
def _along(D: Array, y: Array) -> float:
    """Return y . D, rounded down."""
    total, size = 0.0, 0.0
    for i in range(len(y)):
        x = y[i] * D[i]
        total += x
        size += abs(x)
    return total - SLACK * size


@jit_inline
def _turned(
    cells: Cells, potential: Potential, step: Step, a: int, b: int, D: Array, y: Array, z: Array
) -> float:
    """Return the bound that slopes z prove for the step; the cut at cell a has slopes y."""
    still = True
    for i in range(len(z)):
        still = still and z[i] == 0.0
    moved = 0.0 if still else _along(D, z)
    ahead = least_ahead(cells, potential, b, z)
    return moved - beyond(z, step) + ahead + lean(cells, a, z, y)


@jit_inline
def _level(
    cells: Cells,
    potential: Potential,
    step: Step,
    a: int,
    ahead: Ints,
    way: Ints,
    D: Array,
    y: Array,
    care: float,
    first: int,
    other: Array,
    out_proved: Array,
) -> float:
    """Return the level of a cut of cell a with slopes y; fill the least cost of each step from it.

    The step that seems best is tested first, so that a quick test suffices for most others.
    """
    least, price = np.inf, beyond(y, step)
    for i in range(len(y)):
        other[i] = 0.0
    lean_here = lean(cells, a, other, y)
    for turn in range(-1, len(ahead)):
        p = first if turn < 0 else turn
        if turn == first:
            continue
        b = ahead[p]
        if way[p] == 1:
            far = potential.least[b] + lean_here + _apart(cells, step, a, b, D[p])
            if far > least + care:
                out_proved[p] = far
                continue
        proved = _proved(cells, potential, step, a, b, way[p], D[p], y, price, least + care, other)
        out_proved[p] = proved
        least = min(least, proved)
    return least


@jit_inline
def _apart(cells: Cells, step: Step, a: int, b: int, D: Array) -> float:
    """Return the least distance of cell a from cell b, less what the tilt may take off it."""
    total, tilted = 0.0, 0.0
    for i in range(len(D)):
        wide = cells.box[a, i] + cells.box[b, i]
        x = max(0.0, abs(D[i]) - wide)
        total = extend(total, step.weight[i] * x, step.metric)
        tilted += step.tilt[i] * D[i] - abs(step.tilt[i]) * wide
    away = finish(total, step.metric)
    return away + tilted - SLACK * (away + abs(tilted))


@jit_inline
def _flat_level(potential: Potential, step: Step, ahead: Ints, other: Array) -> float:
    """Return the level of a cut without slopes, from the least of the cells ahead."""
    for i in range(len(other)):
        other[i] = 0.0
    least = np.inf
    for p in range(len(ahead)):
        least = min(least, potential.least[ahead[p]])
    return least - beyond(other, step)


@jit_inline
def close_cut(cells: Cells, potential: Potential, a: int, none: Array) -> None:
    """Fill the slopes of the cuts of cell a along its curve, and their least value on the cell."""
    for m in range(2):
        along, bent = 0.0, 0.0
        for i in range(cells.slope.shape[1]):
            along += potential.dual[a, m, i] * cells.slope[a, i]
            bent += potential.dual[a, m, i] * cells.bend[a, i]
        potential.along[a, m], potential.bent[a, m] = along, bent
    for i in range(len(none)):
        none[i] = 0.0
    potential.least[a] = least_ahead(cells, potential, a, none)


@jit
def reach_cells(
    cells: Cells, step: Step, k: int, first: int, last: int, level: Array, out_count: Ints
) -> None:
    """Count the live cells of layer k + 1 that a step from cells first..last-1 of layer k reaches.

    A cell is live if its level (C, 2) is finite: from others no motion leads to the end.
    """
    run, D = np.empty(2, np.int64), np.empty(len(step.velocity))
    for a in range(first, last):
        window(cells, step, a, k, run)
        count = 0
        for b in range(run[0], run[1]):
            if level[b, 0] < np.inf and near(cells, step, a, b, D) > 0:
                count += 1
        out_count[a] = count


@jit
def link_cells(cells: Cells, step: Step, k: int, out_after: Bools, out_before: Bools) -> None:
    """Mark the cells of layer k from which a step leads on, and those of layer k + 1 it reaches."""
    run, D = np.empty(2, np.int64), np.empty(len(step.velocity))
    for a in range(cells.start[k], cells.start[k + 1]):
        window(cells, step, a, k, run)
        for b in range(run[0], run[1]):
            if not (out_after[a] and out_before[b]) and near(cells, step, a, b, D) > 0:
                out_after[a] = out_before[b] = True


@jit_inline
def _lay_given(
    cells: Cells, potential: Potential, step: Step, a: int, ahead: Ints, way: Ints, D: Array,
    given: Array, flat: float, care: float, here: Array, floor: Array, spare: Spare, y: Array,
    other: Array, proved: Array, out_cost: Array,
) -> None:  # fmt: skip
    """Lay both cuts of cell a by the best of the given slopes, of a guess, and of none at all.

    ``proved`` (3, E) is scratch.
    """
    n, J, count = len(y), len(given), len(ahead)
    one, two, free = 0, 1, 2
    kept, sure = -np.inf, -np.inf
    potential.level[a, 0] = potential.level[a, 1] = -np.inf
    best = guess_slopes(cells, potential, step, a, 0.0, ahead, D, here, floor, spare, y)
    for j in range(J + 2):
        for i in range(n):
            if j > J:
                y[i] = 0.0
            elif j > 0:
                y[i] = given[j - 1, i]
        if j > J and max(kept, sure) >= flat:
            break
        flatten(cells, a, y)
        level = _level(cells, potential, step, a, ahead, way, D, y, care, best, other, proved[free])
        for i in range(n):
            other[i] = 0.0
        least = level + lean(cells, a, other, y)
        if level > potential.level[a, 0]:
            if kept > sure:
                for i in range(n):
                    potential.dual[a, 1, i] = potential.dual[a, 0, i]
                potential.level[a, 1], sure = potential.level[a, 0], kept
                two, one = one, two
            for i in range(n):
                potential.dual[a, 0, i] = y[i]
            potential.level[a, 0], kept = level, least
            one, free = free, one
        elif least > sure:
            for i in range(n):
                potential.dual[a, 1, i] = y[i]
            potential.level[a, 1], sure = level, least
            two, free = free, two
    for p in range(count):
        to_first = proved[one, p] - potential.level[a, 0]
        out_cost[p] = min(to_first, proved[two, p] - potential.level[a, 1])
    close_cut(cells, potential, a, other)


@jit
def lay_potential(
    cells: Cells,
    potential: Potential,
    step: Step,
    k: int,
    first: int,
    last: int,
    care: float,
    given: Array,
    begin: Ints,
    out_to: Ints,
    out_cost: Array,
) -> None:
    """Lay the potential over cells first..last-1 of layer k; fill the reduced costs of their steps.

    The steps of cell a are begin[a]..begin[a+1]-1; out_to has the cell that each leads to. Steps
    that cost more than `care` beyond the cheapest may get a smaller bound than could be proved.
    ``given`` (J, n) are slopes to try besides those that are guessed; without any there are guesses
    from both ends of each cell.
    """
    n, most = len(step.velocity), 0
    for a in range(first, last):
        most = max(most, begin[a + 1] - begin[a])
    D, way, proved = np.empty((most, n)), np.empty(most, np.int64), np.empty((3, most))
    floor, here, y, other = np.empty(most), np.empty(n), np.empty(n), np.empty(n)
    run, P = np.empty(2, np.int64), 1 + cells.reach.shape[1]
    spare = Spare(
        np.empty((P, n)), np.empty((P, 2)), np.empty(P), np.empty(P), np.empty(2),
        np.empty(3 * n + 3),
    )  # fmt: skip
    for a in range(first, last):
        count = begin[a + 1] - begin[a]
        potential.level[a, 0] = potential.level[a, 1] = np.inf
        if count == 0:
            continue
        ahead = out_to[begin[a] : begin[a + 1]]
        window(cells, step, a, k, run)
        p = 0
        for b in range(run[0], run[1]):
            if potential.level[b, 0] < np.inf:
                way[p] = near(cells, step, a, b, D[p])
                if way[p] > 0:
                    ahead[p] = b
                    p += 1
                    if p == count:
                        break
        flat = _flat_level(potential, step, ahead, other)
        if len(given) > 0:
            _lay_given(
                cells, potential, step, a, ahead, way, D, given, flat, care, here, floor, spare,
                y, other, proved, out_cost[begin[a] : begin[a + 1]],
            )  # fmt: skip
            continue
        for m in range(2):
            t = (2 * m - 1) * cells.half[a]
            best = guess_slopes(cells, potential, step, a, t, ahead, D, here, floor, spare, y)
            if m == 1:
                flatten(cells, a, y)
            level = -np.inf
            for attempt in range(2):
                if attempt == 1 and level < flat:
                    for i in range(n):
                        y[i] = 0.0
                if attempt == 0 or level < flat:
                    level = _level(
                        cells, potential, step, a, ahead, way, D, y, care, best, other, proved[m]
                    )
            potential.level[a, m] = level
            for i in range(n):
                potential.dual[a, m, i] = y[i]
        for p in range(count):
            to_first = proved[0, p] - potential.level[a, 0]
            out_cost[begin[a] + p] = min(to_first, proved[1, p] - potential.level[a, 1])
        close_cut(cells, potential, a, other)


@jit
def cross_cells(
    start: Ints, begin: Ints, to: Ints, cost: Array, out_ahead: Array, out_behind: Array
) -> None:
    """Fill the least sum of reduced costs up to each cell and from it on, (C,) each.

    On entry ``out_behind`` has the least value of the potential on the cells of the first layer;
    ``out_ahead`` is zero at the last layer. Cells that no motion passes get infinity.
    """
    last = len(start) - 2
    for a in range(start[last]):
        out_ahead[a] = np.inf
    for a in range(start[1], start[last + 1]):
        out_behind[a] = np.inf
    for a in range(start[last]):
        for p in range(begin[a], begin[a + 1]):
            out_behind[to[p]] = min(out_behind[to[p]], out_behind[a] + cost[p])
    for a in range(start[last] - 1, -1, -1):
        for p in range(begin[a], begin[a + 1]):
            out_ahead[a] = min(out_ahead[a], cost[p] + out_ahead[to[p]])
