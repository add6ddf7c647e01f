"""Guess the slopes of a potential from the step that seems best from one end of a cell.

A guess may be wrong; `kernels.potentials` then proves what it is worth.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kerfpath.arrays import Array, Ints
from kerfpath.kernels.jit import jit_callee, jit_inline
from kerfpath.kernels.metric import CHEBYCHEV, MANHATTAN, extend, finish
from kerfpath.kernels.reduced import Cells, Potential, Step, near, tangent

__all__ = ["Ahead", "Spare", "flatten", "guess_slopes", "join"]

PENALTY = 10.0
"""Price of an increment beyond (5), in weights: it leads a guess back within (5)."""
STILL = 1e-10
"""rad: a joint that moves less counts as still."""
TIED = 2e-5
"""Share of its largest change along a cell by which the weighted increment of a joint may be below
the largest of all and still count as tied with it: what the search along the cell leaves."""
HALVINGS = 30
"""Steps of the search along a cell for metrics that are not Manhattan."""
ROUNDS = 3
"""How often each parameter of a cell takes its turn where there are more than gamma."""
UNSURE = 0.03
"""rad: a joint that is less certain than this on a cell gets no slope. The slope would lose more
than it gains wherever the cells that lead there do not have the same slope."""


class Ahead(NamedTuple):
    """Steps from a cell: to each ``cell`` (E,), with the least cost (E,) there and on.

    ``D`` (E, n) is the difference of the centres, and ``way`` (E,) whether it is definite, as
    `near` tells; -1 where it is not known yet.
    """

    cell: Ints
    least: Array
    D: Array
    way: Ints


@jit_inline
def join(cells: Cells, step: Step, a: int, ahead: Ahead, p: int) -> int:
    """Return the way of a step from cell a, and fill in its difference."""
    if ahead.way[p] < 0:
        ahead.way[p] = near(cells, step, a, ahead.cell[p], ahead.D[p])
    return int(ahead.way[p])


class Spare(NamedTuple):
    """Room for the search in P parameters of a cell: their slopes of n joints, and of both cuts.

    ``steep`` is (P, n), ``along`` (P, 2), ``place`` and ``half`` (P,), ``level`` (2,) and ``kinks``
    (3 n + 3,).
    """

    steep: Array
    along: Array
    place: Array
    half: Array
    level: Array
    kinks: Array


@jit_inline
def _price(
    D: Array, cells: Cells, potential: Potential, step: Step, b: int, t: float, penalty: float
) -> float:
    """Return the estimated cost to the end of a step by D and on to t in cell b."""
    total, tilted, over = 0.0, 0.0, 0.0
    for i in range(len(D)):
        u = D[i] + cells.slope[b, i] * t
        x = abs(u)
        total = extend(total, step.weight[i] * x, step.metric)
        tilted += step.tilt[i] * u
        over += step.weight[i] * max(0.0, x - step.velocity[i])
    ahead = max(
        potential.level[b, 0] - potential.along[b, 0] * t,
        potential.level[b, 1] - potential.along[b, 1] * t,
    )
    price: float = finish(total, step.metric) + tilted + penalty * over + ahead
    return price


@jit_inline
def _best_along(
    D: Array, cells: Cells, potential: Potential, step: Step, b: int
) -> tuple[float, float]:
    """Return the t in cell b where a step is estimated to cost least, and that cost."""
    h = cells.half[b]
    if step.metric != MANHATTAN:
        low, high = -h, h
        for _ in range(HALVINGS):
            third = (high - low) / 3.0
            one, two = low + third, high - third
            if _price(D, cells, potential, step, b, one, PENALTY) < _price(
                D, cells, potential, step, b, two, PENALTY
            ):
                high = two
            else:
                low = one
        t = (low + high) / 2.0
        return t, _price(D, cells, potential, step, b, t, PENALTY)
    best, at = np.inf, 0.0
    turn = potential.along[b, 0] - potential.along[b, 1]
    for kink in range(-3, 3 * len(D)):
        if kink == -3:
            t = (potential.level[b, 0] - potential.level[b, 1]) / turn if turn != 0.0 else h
        elif kink < 0:
            t = (2 * kink + 3) * h
        else:
            i, v = kink // 3, (kink % 3 - 1) * step.velocity[kink // 3]
            s = cells.slope[b, i]
            t = (v - D[i]) / s if s != 0.0 else 2.0 * h
        if abs(t) <= h:
            price = _price(D, cells, potential, step, b, t, PENALTY)
            if price < best:
                best, at = price, t
    return at, best


@jit_inline
def _mix(D: Array, cells: Cells, step: Step, b: int, missing: float, out_y: Array) -> None:
    """Move weight from the joint that decides the maximum metric to one that is tied with it.

    The slopes (n,) along the curve of cell b then change by what is missing. Of several joints, or
    directions of a joint that is still, the one that takes least of the weight is chosen.
    """
    n, first, size = len(D), 0, 0.0
    for i in range(n):
        size = max(size, step.weight[i] * abs(cells.slope[b, i]))
        if step.weight[i] * abs(D[i]) > step.weight[first] * abs(D[first]):
            first = i
    top = step.weight[first] if D[first] > 0 else -step.weight[first]
    most = step.weight[first] * abs(D[first]) - TIED * size * cells.half[b]
    share, other, turned = 2.0, first, 0.0
    for kind in range(2 * n):
        i = kind // 2
        w = step.weight[i] if kind % 2 == 0 else -step.weight[i]
        change = w * cells.slope[b, i] - top * cells.slope[b, first]
        if w * D[i] >= most and change * missing > 0.0 and missing / change < share:
            share, other, turned = missing / change, i, w
    if share <= 1.0:
        out_y[first] -= share * top
        out_y[other] += share * turned


@jit_inline
def _tangent(D: Array, step: Step, out_y: Array) -> None:
    """Fill the slopes (n,) of the cost of a step by D, where one beyond (5) has its price."""
    tangent(D, step, out_y)
    for i in range(len(D)):
        if abs(D[i]) > step.velocity[i] + STILL:
            out_y[i] += PENALTY * step.weight[i] * (1.0 if D[i] > 0 else -1.0)


@jit_inline
def _turn_free(
    D: Array, steep: Array, step: Step, slope: float, wanted: float, out_y: Array
) -> None:
    """Turn the slope along ``steep`` (n,) to the one that is wanted, as far as joints are free to.

    The slope of a joint that is still, or at its velocity limit, may have any value in a range.
    """
    for i in range(len(D)):
        s, w, x = steep[i], step.weight[i], abs(D[i])
        if s == 0.0:
            continue
        if x < STILL:
            low, high = -w, w
        elif abs(x - step.velocity[i]) < STILL:
            low, high = w, w * (1.0 + PENALTY)
            if D[i] < 0:
                low, high = -high, -low
        else:
            continue
        y = out_y[i] + (wanted - slope) / s
        y = min(max(y, step.tilt[i] + low), step.tilt[i] + high)
        slope += (y - out_y[i]) * s
        out_y[i] = y


@jit_inline
def _balance(
    D: Array, cells: Cells, potential: Potential, step: Step, b: int, t: float, out_y: Array
) -> None:
    """Fill slopes (n,) of the cost of the step to t in cell b that balance those of V there."""
    level0 = potential.level[b, 0] - potential.along[b, 0] * t
    level1 = potential.level[b, 1] - potential.along[b, 1] * t
    least = potential.along[b, 0] if level0 >= level1 else potential.along[b, 1]
    most = least
    if abs(level0 - level1) <= 1e-9:
        least = min(potential.along[b, 0], potential.along[b, 1])
        most = max(potential.along[b, 0], potential.along[b, 1])
    for i in range(len(D)):
        D[i] += cells.slope[b, i] * t
    _tangent(D, step, out_y)
    slope = 0.0
    for i in range(len(D)):
        slope += out_y[i] * cells.slope[b, i]
    if least <= slope <= most:
        return
    wanted = least if slope < least else most
    if step.metric == CHEBYCHEV:
        _mix(D, cells, step, b, wanted - slope, out_y)
    if step.metric == MANHATTAN:
        _turn_free(D, cells.slope[b], step, slope, wanted, out_y)


@jit_inline
def _price_by(D: Array, steep: Array, level: Array, along: Array, step: Step, t: float) -> float:
    """Return the estimated cost to the end of a step by D + steep t, where V is level - along t."""
    total, tilted, over = 0.0, 0.0, 0.0
    for i in range(len(D)):
        u = D[i] + steep[i] * t
        x = abs(u)
        total = extend(total, step.weight[i] * x, step.metric)
        tilted += step.tilt[i] * u
        over += step.weight[i] * max(0.0, x - step.velocity[i])
    ahead = max(level[0] - along[0] * t, level[1] - along[1] * t)
    price: float = finish(total, step.metric) + tilted + PENALTY * over + ahead
    return price


@jit_inline
def _best_by(
    D: Array, steep: Array, level: Array, along: Array, step: Step, h: float, kinks: Array
) -> float:
    """Return the t in [-h, h] where the estimate is least; it is convex."""
    n, count = len(D), 3
    kinks[0], kinks[1] = -h, h
    turn = along[0] - along[1]
    kinks[2] = (level[0] - level[1]) / turn if turn != 0.0 else h
    if step.metric != MANHATTAN:
        low, high = -h, h
        for _ in range(HALVINGS):
            third = (high - low) / 3.0
            one, two = low + third, high - third
            if _price_by(D, steep, level, along, step, one) < _price_by(
                D, steep, level, along, step, two
            ):
                high = two
            else:
                low = one
        return (low + high) / 2.0
    for i in range(n):
        if steep[i] != 0.0:
            for side in range(-1, 2):
                kinks[count] = (side * step.velocity[i] - D[i]) / steep[i]
                count += 1
    best, at = np.inf, 0.0
    for j in range(count):
        if abs(kinks[j]) <= h:
            price = _price_by(D, steep, level, along, step, kinks[j])
            if price < best:
                best, at = price, kinks[j]
    return at


@jit_inline
def _balance_all(
    D: Array, cells: Cells, potential: Potential, step: Step, b: int, t: float, spare: Spare,
    out_y: Array,
) -> None:  # fmt: skip
    """Fill slopes (n,) of the cost of the step to cell b that balance those of V, as `_balance`.

    The best place is looked for in all parameters of the cell, from t of gamma on, by turns.
    """
    n, M = len(D), cells.reach.shape[1]
    steep, along, place, half, level, kinks = spare
    for m in range(M + 1):
        place[m] = along[m, 0] = along[m, 1] = 0.0
        half[m] = cells.half[b] if m == M else cells.reach[b, m]
        for i in range(n):
            steep[m, i] = cells.slope[b, i] if m == M else cells.tied[b, m, i]
            for c in range(2):
                along[m, c] += potential.dual[b, c, i] * steep[m, i]
    place[M] = t
    for c in range(2):
        level[c] = potential.level[b, c] - along[M, c] * t
    for i in range(n):
        D[i] += steep[M, i] * t
    for turn in range(ROUNDS * (M + 1)):
        m = turn % (M + 1)
        for i in range(n):
            D[i] -= steep[m, i] * place[m]
        for c in range(2):
            level[c] += along[m, c] * place[m]
        place[m] = _best_by(D, steep[m], level, along[m], step, half[m], kinks)
        for i in range(n):
            D[i] += steep[m, i] * place[m]
        for c in range(2):
            level[c] -= along[m, c] * place[m]
    _tangent(D, step, out_y)
    if step.metric != MANHATTAN:
        return
    tied = abs(level[0] - level[1]) <= 1e-9
    for turn in range(ROUNDS * (M + 1)):
        m = turn % (M + 1)
        if abs(place[m]) >= half[m] * (1.0 - 1e-9):
            continue
        least = along[m, 0] if level[0] >= level[1] else along[m, 1]
        most = least
        if tied:
            least, most = min(along[m, 0], along[m, 1]), max(along[m, 0], along[m, 1])
        slope = 0.0
        for i in range(n):
            slope += out_y[i] * steep[m, i]
        wanted = min(max(slope, least), most)
        if slope != wanted:
            _turn_free(D, steep[m], step, slope, wanted, out_y)


@jit_inline
def _from_place(cells: Cells, a: int, t: float, D: Array, out_here: Array) -> None:
    """Fill the increments (n,) from t in cell a to the centre of a cell that is D away."""
    for i in range(len(D)):
        out_here[i] = D[i] - (cells.slope[a, i] + cells.bend[a, i] * t / 2.0) * t


@jit_callee
def guess_slopes(
    cells: Cells,
    potential: Potential,
    step: Step,
    a: int,
    t: float,
    ahead: Ahead,
    count: int,
    here: Array,
    spare: Spare,
    out_y: Array,
) -> int:
    """Fill the slopes of the step that seems best from t in cell a; return its index in `ahead`."""
    first = 0
    for p in range(count):
        if ahead.least[p] < ahead.least[first]:
            first = p
    best, at, to = np.inf, 0.0, -1
    for turn in range(-1, count):
        p = first if turn < 0 else turn
        if ahead.least[p] >= best or (turn >= 0 and p == first):
            continue
        join(cells, step, a, ahead, p)
        _from_place(cells, a, t, ahead.D[p], here)
        b, reach = ahead.cell[p], 0.0
        for i in range(len(here)):
            reach += (step.weight[i] + abs(step.tilt[i])) * abs(cells.slope[b, i])
        reach += max(abs(potential.along[b, 0]), abs(potential.along[b, 1]))
        price = _price(here, cells, potential, step, b, 0.0, 0.0)
        if price - reach * cells.half[b] >= best:
            continue
        where, price = _best_along(here, cells, potential, step, b)
        if price < best:
            best, at, to = price, where, p
    _from_place(cells, a, t, ahead.D[to], here)
    if cells.reach.shape[1] > 0:
        _balance_all(here, cells, potential, step, ahead.cell[to], at, spare, out_y)
    else:
        _balance(here, cells, potential, step, ahead.cell[to], at, out_y)
    return to


@jit_inline
def flatten(cells: Cells, a: int, out_y: Array) -> None:
    """Set the slopes (n,) of joints that are hardly known on cell a to zero.

    Near a singularity a joint may be almost anywhere on a cell, and a cut with a slope in that
    joint is far below its level somewhere: steps that cannot follow the slope then look too cheap.
    """
    for i in range(len(out_y)):
        if cells.spread[a, i] > UNSURE:
            out_y[i] = 0.0
