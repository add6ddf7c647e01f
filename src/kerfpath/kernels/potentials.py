"""The potential of a stage, computed backwards: the least cost to come, by cells of gamma.

The slopes of a cut come from the step that seems best from one end of the cell (a guess, which
may be wrong); its level is then proved: the least over all cells that a step can lead to.
"""

from __future__ import annotations

from math import pi, sqrt

import numpy as np

from kerfpath.arrays import Array, Bools, Ints
from kerfpath.kernels.jit import either, jit, jit_callee, jit_inline, jit_vector, larger
from kerfpath.kernels.metric import CHEBYCHEV, MANHATTAN
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
from kerfpath.kernels.slopes import Ahead, Spare, flatten, guess_slopes, join

__all__ = ["close_cut", "cross_cells", "lay_potential", "link_cells"]


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


@jit_callee
def _level(
    cells: Cells,
    potential: Potential,
    step: Step,
    a: int,
    ahead: Ahead,
    count: int,
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
    for turn in range(-1, count):
        p = first if turn < 0 else turn
        if turn == first:
            continue
        far = ahead.least[p] + lean_here
        if far > least + care:
            out_proved[p] = far
            continue
        way = join(cells, step, a, ahead, p)
        proved = _proved(
            cells, potential, step, a, ahead.cell[p], way, ahead.D[p], y, price, least + care, other
        )
        out_proved[p] = proved
        least = min(least, proved)
    return least


@jit_vector
def _add_joint(
    center: Array, box: Array, x: float, wide: float, weight: float, tilt: float, v: float,
    turn: float, metric: int, out_away: Array, out_tilted: Array,
) -> None:  # fmt: skip
    """Add what a joint tells about the steps from a cell to a run of cells (W,), see `_apart`.

    Its centre there is at ``center`` within ``box`` (W,), here at x within ``wide``; ``turn`` is a
    full turn, or 0 if the joint is not endless. Costs are infinite beyond v.
    """
    for p in range(np.uint64(len(center))):
        d = center[p] - x
        d -= turn * np.rint(d / (2.0 * pi))
        both, far = wide + box[p], abs(d)
        over = weight * larger(0.0, far - both)
        over = either(far > v + both, np.inf, over)
        if metric == MANHATTAN:
            out_away[p] += over
        elif metric == CHEBYCHEV:
            out_away[p] = larger(out_away[p], over)
        else:
            out_away[p] += over * over
        round_about = either(turn > 0.0, far + both, 0.0) > pi
        out_tilted[p] += either(round_about, -abs(tilt) * v, tilt * d - abs(tilt) * both)


@jit_inline
def _apart(
    cells: Cells, potential: Potential, step: Step, a: int, first: int, last: int, out_least: Array,
    spare: Array,
) -> None:  # fmt: skip
    """Fill the least cost of a step from cell a to each of the cells first..last-1 and on, (W,).

    It is that of the least increments; infinite if no step within (5) joins the cells, or none
    leads on from there.
    """
    W = last - first
    away, tilted = out_least[:W], spare[:W]
    for p in range(W):
        away[p] = tilted[p] = 0.0
    for i in range(len(step.velocity)):
        _add_joint(
            cells.middle[i][first:last], cells.room[i][first:last], cells.center[a, i],
            cells.box[a, i], step.weight[i], step.tilt[i], step.velocity[i],
            2.0 * pi if step.endless[i] else 0.0, step.metric, away, tilted,
        )  # fmt: skip
    for p in range(W):
        total = away[p]
        if step.metric != MANHATTAN and step.metric != CHEBYCHEV:
            total = sqrt(total)
        total = total * (1.0 - SLACK) + tilted[p] - SLACK * abs(tilted[p])
        away[p] = potential.least[first + p] + total


@jit_inline
def _find_ahead(
    cells: Cells, potential: Potential, step: Step, a: int, k: int, run: Ints, ahead: Ahead,
    spare: Array,
) -> int:  # fmt: skip
    """Fill the steps that lead on from cell a of layer k; return their number."""
    window(cells, step, a, k, run)
    first, last, count = run[0], run[1], 0
    if last <= first:
        return 0
    _apart(cells, potential, step, a, first, last, ahead.least, spare)
    for p in range(last - first):
        if ahead.least[p] < np.inf:
            ahead.least[count], ahead.cell[count], ahead.way[count] = ahead.least[p], first + p, -1
            count += 1
    return count


@jit_inline
def _flat_level(potential: Potential, step: Step, ahead: Ahead, count: int, other: Array) -> float:
    """Return the level of a cut without slopes, from the least of the cells ahead."""
    for i in range(len(other)):
        other[i] = 0.0
    least = np.inf
    for p in range(count):
        least = min(least, potential.least[ahead.cell[p]])
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
def link_cells(cells: Cells, step: Step, k: int, out_after: Bools, out_before: Bools) -> None:
    """Mark the cells of layer k from which a step leads on, and those of layer k + 1 it reaches."""
    run, D = np.empty(2, np.int64), np.empty(len(step.velocity))
    for a in range(cells.start[k], cells.start[k + 1]):
        window(cells, step, a, k, run)
        for b in range(run[0], run[1]):
            if not (out_after[a] and out_before[b]) and near(cells, step, a, b, D) > 0:
                out_after[a] = out_before[b] = True


@jit_callee
def _lay_given(
    cells: Cells, potential: Potential, step: Step, a: int, ahead: Ahead, count: int, given: Array,
    flat: float, care: float, here: Array, spare: Spare, y: Array, other: Array, proved: Array,
) -> tuple[int, int]:  # fmt: skip
    """Lay both cuts of cell a by the best of the given slopes, of a guess, and of none at all.

    Returns the rows of ``proved`` (3, E) that have the least costs of the steps by both cuts.
    """
    n, J = len(y), len(given)
    one, two, free = 0, 1, 2
    kept, sure = -np.inf, -np.inf
    potential.level[a, 0] = potential.level[a, 1] = -np.inf
    best = guess_slopes(cells, potential, step, a, 0.0, ahead, count, here, spare, y)
    for j in range(J + 2):
        for i in range(n):
            if j > J:
                y[i] = 0.0
            elif j > 0:
                y[i] = given[j - 1, i]
        if j > J and max(kept, sure) >= flat:
            break
        flatten(cells, a, y)
        level = _level(cells, potential, step, a, ahead, count, y, care, best, other, proved[free])
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
    return one, two


@jit
def lay_potential(
    cells: Cells,
    potential: Potential,
    step: Step,
    k: int,
    first: int,
    last: int,
    care: float,
    dear: float,
    given: Array,
    out_count: Ints,
) -> tuple[Ints, Array, int]:
    """Lay the potential over cells first..last-1 of layer k; return the steps from them.

    Returned are the cell that each step leads to, ascending, and its reduced cost, in the order of
    the cells, of which ``out_count`` (C,) gets the numbers of steps; and the number of all steps
    within (5). Steps whose reduced cost exceeds ``dear`` are left out. Those that cost more than
    ``care`` beyond the cheapest may get a smaller bound than could be proved. ``given`` (J, n) are
    slopes to try besides those that are guessed; without any there are guesses from both ends of
    each cell.
    """
    n, most = len(step.velocity), cells.start[k + 2] - cells.start[k + 1]
    ahead = Ahead(
        np.empty(most, np.int64), np.empty(most), np.empty((most, n)), np.empty(most, np.int64)
    )
    proved, more = np.empty((3, most)), np.empty(most)
    here, y, other = np.empty(n), np.empty(n), np.empty(n)
    run, P = np.empty(2, np.int64), 1 + cells.reach.shape[1]
    spare = Spare(
        np.empty((P, n)), np.empty((P, 2)), np.empty(P), np.empty(P), np.empty(2),
        np.empty(3 * n + 3),
    )  # fmt: skip
    to, cost = np.empty(8 * (last - first) + most, np.int64), np.empty(8 * (last - first) + most)
    kept, tried = 0, 0
    for a in range(first, last):
        count = _find_ahead(cells, potential, step, a, k, run, ahead, more)
        tried += count
        out_count[a] = 0
        if count == 0:
            potential.level[a, 0] = potential.level[a, 1] = potential.least[a] = np.inf
            continue
        flat, one, two = _flat_level(potential, step, ahead, count, other), 0, 1
        if len(given) > 0:
            one, two = _lay_given(
                cells, potential, step, a, ahead, count, given, flat, care, here, spare, y, other,
                proved,
            )  # fmt: skip
        else:
            for m in range(2):
                t = (2 * m - 1) * cells.half[a]
                best = guess_slopes(cells, potential, step, a, t, ahead, count, here, spare, y)
                if m == 1:
                    flatten(cells, a, y)
                level = -np.inf
                for attempt in range(2):
                    if attempt == 1 and level < flat:
                        for i in range(n):
                            y[i] = 0.0
                    if attempt == 0 or level < flat:
                        level = _level(
                            cells, potential, step, a, ahead, count, y, care, best, other, proved[m]
                        )
                potential.level[a, m] = level
                for i in range(n):
                    potential.dual[a, m, i] = y[i]
        close_cut(cells, potential, a, other)
        if kept + count > len(to):
            wider_to, wider_cost = (
                np.empty(2 * len(to) + count, np.int64),
                np.empty(2 * len(to) + count),
            )
            wider_to[:kept], wider_cost[:kept] = to[:kept], cost[:kept]
            to, cost = wider_to, wider_cost
        before = kept
        for p in range(count):
            by_one = proved[one, p] - potential.level[a, 0]
            reduced = min(by_one, proved[two, p] - potential.level[a, 1])
            if reduced <= dear:
                to[kept], cost[kept] = ahead.cell[p], reduced
                kept += 1
        out_count[a] = kept - before
    return to[:kept].copy(), cost[:kept].copy(), tried


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
