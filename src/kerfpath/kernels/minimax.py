"""The potential of the objective "max" (15): the least that the costliest step to come costs.

On a cell it is a function of the place t of gamma alone, with two cuts: V(t) is at least the larger
of level_m + along_m t, |t| <= h. For a step u from cell a to b, any z with z . u <= rho(u) and any
share from 0 to 1,

    max(rho(u), V_b(t')) >= (1 - share) z . u + share (level_b + along_b t'),

and on the cells u = D + s_b t' - s_a t +- r, so that the least over t' is a straight line in t. All
sums are rounded down.
"""

from __future__ import annotations

from math import pi
from typing import NamedTuple

import numpy as np

from kerfpath.arrays import Array, Ints
from kerfpath.kernels.cell_elimination import may_step
from kerfpath.kernels.jit import jit, jit_inline, jit_part
from kerfpath.kernels.metric import extend, finish
from kerfpath.kernels.reduced import SLACK, Cells, Step, tangent, window

__all__ = ["LargestStep", "lay_largest"]

HALVINGS = 24
"""Steps of the search along a cell."""
TIE = 1e-6
"""Relative difference below which the cost of a step and the potential ahead count as equal."""
BESIDE = 1e-3
"""Half widths to either side of the best place at which the slopes of a cost are taken."""
UNSURE = 0.05
"""rad: a joint that is less certain than this on a cell gets no slope."""


class LargestStep(NamedTuple):
    """Levels and slopes of the cuts, (C, 2), and the least of the potential on each cell, (C,)."""

    level: Array
    along: Array
    least: Array


@jit_inline
def _unsure(cells: Cells, a: int, i: int) -> float:
    """Return how far joint i may be from a straight line over cell a."""
    h = cells.half[a]
    wide: float = abs(cells.bend[a, i]) * h * h / 2.0 + cells.spread[a, i]
    for m in range(cells.reach.shape[1]):
        wide += abs(cells.tied[a, m, i]) * cells.reach[a, m]
    return wide


@jit_inline
def _least_step(cells: Cells, step: Step, a: int, b: int, D: Array) -> float:
    """Return the least cost of a step from the box of cell a to that of b, D between centres."""
    total = 0.0
    for i in range(len(D)):
        x = max(abs(D[i]) - cells.box[a, i] - cells.box[b, i], 0.0)
        total = extend(total, step.weight[i] * x, step.metric)
    least: float = finish(total, step.metric) * (1.0 - SLACK)
    return least


@jit_inline
def _ahead(V: LargestStep, b: int, t: float) -> float:
    """Return the potential at place t of cell b."""
    ahead: float = max(V.level[b, 0] + V.along[b, 0] * t, V.level[b, 1] + V.along[b, 1] * t)
    return ahead


@jit_inline
def _cost_at(cells: Cells, step: Step, b: int, here: Array, t: float) -> float:
    """Return the cost of a step to place t of cell b, ``here`` to its centre."""
    total = 0.0
    for i in range(len(here)):
        x = abs(here[i] + cells.slope[b, i] * t)
        total = extend(total, step.weight[i] * x, step.metric)
    cost: float = finish(total, step.metric)
    return cost


@jit_part
def _best_place(
    cells: Cells, step: Step, V: LargestStep, b: int, here: Array
) -> tuple[float, float]:
    """Return the place of cell b where the larger of step and potential is least, and the two."""
    low, high = -cells.half[b], cells.half[b]
    for _ in range(HALVINGS):
        third = (high - low) / 3.0
        one, two = low + third, high - third
        first = max(_cost_at(cells, step, b, here, one), _ahead(V, b, one))
        if first < max(_cost_at(cells, step, b, here, two), _ahead(V, b, two)):
            high = two
        else:
            low = one
    t = (low + high) / 2.0
    return t, max(_cost_at(cells, step, b, here, t), _ahead(V, b, t))


@jit_inline
def _slope_at(
    cells: Cells, step: Step, a: int, b: int, here: Array, t: float, moved: Array, out_z: Array
) -> float:
    """Fill the slopes z (n,) of the cost of the step to place t of cell b; return z . s_b."""
    along = 0.0
    for i in range(len(here)):
        moved[i] = here[i] + cells.slope[b, i] * t
    tangent(moved, step, out_z)
    for i in range(len(here)):
        if _unsure(cells, a, i) + _unsure(cells, b, i) > UNSURE:
            out_z[i] = 0.0
        out_z[i] *= 1.0 - SLACK  # its dual norm is at most 1 in spite of rounding
        along += out_z[i] * cells.slope[b, i]
    return along


@jit_part
def _balance(
    cells: Cells, step: Step, V: LargestStep, a: int, b: int, here: Array, t: float,
    moved: Array, other: Array, out_z: Array,
) -> float:  # fmt: skip
    """Fill slopes z (n,) and return the share with which they balance at place t of cell b."""
    h = cells.half[b]
    cost, ahead = _cost_at(cells, step, b, here, t), _ahead(V, b, t)
    left = _slope_at(cells, step, a, b, here, max(t - BESIDE * h, -h), moved, out_z)
    right = _slope_at(cells, step, a, b, here, min(t + BESIDE * h, h), moved, other)
    part = 1.0 if abs(left) <= abs(right) else 0.0
    if left < 0.0 < right:  # a kink of the cost
        part = right / (right - left)
    tied = abs(cost - ahead) <= TIE * (cost + ahead)
    first = V.level[b, 0] + V.along[b, 0] * t >= V.level[b, 1] + V.along[b, 1] * t
    rise = V.along[b, 0] if first else V.along[b, 1]
    if tied and rise != 0.0:
        if rise > 0.0 and left < 0.0:
            part = 1.0
        elif rise < 0.0 < right:
            part = 0.0
    along = part * left + (1.0 - part) * right
    for i in range(len(out_z)):
        out_z[i] = part * out_z[i] + (1.0 - part) * other[i]
    share: float = 1.0 if ahead > cost else 0.0
    if tied and along * rise < 0.0:
        share = along / (along - rise)
    return share


@jit_inline
def _line(
    cells: Cells, step: Step, V: LargestStep, a: int, b: int, D: Array, z: Array, share: float
) -> tuple[float, float]:
    """Return level and slope of the line over cell a that z and the share prove for a step to b.

    A joint that may go either way round has no definite increment, and its slope is then 0.
    """
    moved, size, here, there, off, steep = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(len(z)):
        if z[i] == 0.0:
            continue
        if step.endless[i] and abs(D[i]) + cells.box[a, i] + cells.box[b, i] > pi:
            continue
        x = z[i] * D[i]
        moved += x
        size += abs(x)
        here += z[i] * cells.slope[a, i]
        there += z[i] * cells.slope[b, i]
        steep += abs(z[i]) * (
            abs(cells.slope[a, i]) * cells.half[a] + abs(cells.slope[b, i]) * cells.half[b]
        )
        off += abs(z[i]) * (_unsure(cells, a, i) + _unsure(cells, b, i))
    h, rest, level = cells.half[b], 1.0 - share, -np.inf
    for m in range(2):
        ahead, along = share * V.level[b, m], share * V.along[b, m]
        rounded = SLACK * (rest * (size + off + steep) + abs(ahead) + abs(along) * h)
        level = max(level, rest * (moved - off) + ahead - abs(rest * there + along) * h - rounded)
    return level, -rest * here


@jit_inline
def _on_cell(level: float, slope: float, along: float, h: float) -> float:
    """Return the largest level of a cut with slope `along` below a line over |t| <= h."""
    return level - (abs(slope - along) * h + SLACK * (abs(slope) + abs(along)) * h)


@jit
def lay_largest(cells: Cells, step: Step, lead: Ints, k: int, out: LargestStep) -> int:
    """Lay the potential over the cells of layer k, from that of layer k + 1; count the steps.

    Only motions count whose steps cost at most ``step.most``; cells from which there is none get
    an infinite potential. ``lead`` (C,) is the joint that gamma moves most.
    """
    n, most = len(step.velocity), cells.start[k + 2] - cells.start[k + 1]
    ahead, floor, D = np.empty(most, np.int64), np.empty(most), np.empty((most, n))
    here, moved, other, z, own = np.empty((5, n))
    run, pairs = np.empty(2, np.int64), 0
    for a in range(cells.start[k], cells.start[k + 1]):
        window(cells, step, a, k, run)
        count, nearest, h = 0, 0, cells.half[a]
        for b in range(run[0], run[1]):
            if out.least[b] <= step.most and may_step(cells, step, lead, a, b, D[count]):
                ahead[count] = b
                floor[count] = max(out.least[b], _least_step(cells, step, a, b, D[count]))
                if floor[count] <= step.most:
                    nearest = count if floor[count] < floor[nearest] else nearest
                    count += 1
        pairs += count
        out.level[a] = out.least[a] = np.inf
        out.along[a] = 0.0
        if count == 0:
            continue
        for m in range(2):
            t = (2 * m - 1) * h
            best, place, to = np.inf, 0.0, nearest
            for turn in range(-1, count):
                p = nearest if turn < 0 else turn
                if floor[p] >= best:
                    continue
                for i in range(n):
                    here[i] = D[p, i] - cells.slope[a, i] * t
                where, cost = _best_place(cells, step, out, ahead[p], here)
                if cost < best:
                    best, place, to = cost, where, p
            for i in range(n):
                here[i] = D[to, i] - cells.slope[a, i] * t
            share = _balance(cells, step, out, a, ahead[to], here, place, moved, other, z)
            along, level = 0.0, np.inf
            for i in range(n):
                along -= (1.0 - share) * z[i] * cells.slope[a, i]
            for turn in range(-1, count):
                p = to if turn < 0 else turn
                proved = _on_cell(floor[p], 0.0, along, h)
                if proved >= level:
                    continue
                b = ahead[p]
                for i in range(n):
                    own[i] = z[i]
                part = share
                for attempt in range(3):
                    if attempt == 1:
                        where = _best_place(cells, step, out, b, D[p])[0]
                        part = _balance(cells, step, out, a, b, D[p], where, moved, other, own)
                    elif attempt == 2:
                        part = 0.0
                    line, slope = _line(cells, step, out, a, b, D[p], own, part)
                    proved = max(proved, _on_cell(line, slope, along, h))
                    if proved >= level or turn < 0:
                        break
                level = min(level, proved)
            out.level[a, m], out.along[a, m] = level, along
        out.least[a] = _least(out, a, h)
    return pairs


@jit_inline
def _least(V: LargestStep, a: int, h: float) -> float:
    """Return a lower bound of the potential on cell a: of the larger of its two cuts."""
    l0, l1, s0, s1 = V.level[a, 0], V.level[a, 1], V.along[a, 0], V.along[a, 1]
    least = min(max(l0 - s0 * h, l1 - s1 * h), max(l0 + s0 * h, l1 + s1 * h))
    if s0 != s1:
        t = (l1 - l0) / (s0 - s1)
        if abs(t) < h:
            least = min(least, max(l0 + s0 * t, l1 + s1 * t))
    sizes = abs(l0) + abs(l1) + (abs(s0) + abs(s1)) * h
    lower: float = least - SLACK * sizes
    return lower
