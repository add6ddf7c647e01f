"""Reduced costs: the least that a step from cell to cell costs, measured by a potential.

Over a cell the joints are q(t) = c + s t + [k] t^2 / 2 +- r, |t| <= h (`kernels.enclosure`); where
poses leave more than gamma free, plus slopes times further parameters. A potential V has two cuts
per cell, V(q) = max_m level_m - y_m . (q - c). For a step u = q' - q with |u| <= v, and any vector
y,

    rho(u) + mu . u >= y . u - P(y),    P(y) the most by which y . u can exceed it,

so that the step from cell c to c', with V' at its end and V at its beginning, costs at least

    y . D - P(y) + min_t' [y . (q' - c') + V'(q')] + min_t [(y_m - y) . (q - c)] - level_m,

with D = c' - c. Each of the two minima is over one cell. All sums are rounded down.
"""

from __future__ import annotations

from math import pi, sqrt
from typing import NamedTuple

import numpy as np

from kerfpath.arrays import Array, Bools, Ints
from kerfpath.kernels.jit import jit, jit_inline
from kerfpath.kernels.metric import CHEBYCHEV, MANHATTAN, increment
from kerfpath.kernels.search import first_from

__all__ = [
    "Cells",
    "Potential",
    "Step",
    "beyond",
    "drift",
    "excess",
    "lean",
    "least_ahead",
    "near",
    "tangent",
    "tangents",
    "window",
]

SLACK = 1e-14
"""Relative rounding error of a sum of a few dozen terms, with a margin."""


class Cells(NamedTuple):
    """Cells of gamma, node after node; within a node by the joint `key`.

    ``start`` is (K+1,). ``center``, ``slope``, ``bend`` (middle of the curvature), ``spread``
    (uncertainty of the joint, rad) and ``box`` (how far a joint may be from its centre) are (C, n).
    ``half`` is (C,) rad; ``widest`` (K,) is the largest box of the joint ``key`` in each layer.
    ``tied`` (C, M, n) are the slopes of the joints by M further parameters, whose sizes are at most
    ``reach`` (C, M). ``middle`` and ``room`` (n, C) are ``center`` and ``box`` joint by joint.
    ``change`` (C, n) rad is the largest change of an increment from node to node that (6) allows
    about each cell; (1, n) where it is the same everywhere.
    """

    start: Ints
    center: Array
    slope: Array
    bend: Array
    spread: Array
    box: Array
    half: Array
    key: int
    widest: Array
    tied: Array
    reach: Array
    middle: Array
    room: Array
    change: Array


class Potential(NamedTuple):
    """Levels (C, 2) and slopes (C, 2, n) of the cuts, and the slopes along s and k, (C, 2).

    ``least`` (C,) is a lower bound of V on the cell.
    """

    level: Array
    dual: Array
    along: Array
    bent: Array
    least: Array


class Step(NamedTuple):
    """Cost and limits of a step: weights, tilt mu, velocity bound v (n,), metric, endless.

    ``most`` is the largest cost allowed, infinite if there is no such limit.
    """

    weight: Array
    tilt: Array
    velocity: Array
    metric: int
    endless: Bools
    most: float


@jit_inline
def near(cells: Cells, step: Step, a: int, b: int, out_D: Array) -> int:
    """Fill D = c_b - c_a, endless joints the short way; return 0 if no step within (5) joins them.

    Returns 1 if the increments are those of D, 2 if an endless joint may go either way round.
    """
    status = 1
    for i in range(len(out_D)):
        d = increment(cells.center[b, i] - cells.center[a, i], step.endless[i])
        wide = cells.box[a, i] + cells.box[b, i]
        if step.endless[i] and abs(d) + wide > pi:
            status = 2
        if abs(d) > step.velocity[i] + wide:
            return 0
        out_D[i] = d
    return status


@jit_inline
def window(cells: Cells, step: Step, a: int, k: int, out_run: Ints) -> None:
    """Fill the run of layer k + 1 that contains all cells that a step from cell a may lead to."""
    first, last = cells.start[k + 1], cells.start[k + 2]
    key, keys, x = cells.key, cells.center[:, cells.key], cells.center[a, cells.key]
    wide = step.velocity[key] + cells.box[a, key] + cells.widest[k + 1]
    out_run[0], out_run[1] = last, first
    for turn in range(-1, 2):
        if turn != 0 and not step.endless[key]:
            continue
        low, high = x - wide + 2.0 * np.pi * turn, x + wide + 2.0 * np.pi * turn
        out_run[0] = min(out_run[0], first_from(keys, first, last, low))
        out_run[1] = max(out_run[1], first_from(keys, first, last, high))


@jit_inline
def tangent(D: Array, step: Step, out_y: Array) -> None:
    """Fill a slope of the cost of a step (n,) at the increment D, tilt included."""
    n = len(D)
    total, largest = 0.0, 0
    for i in range(n):
        x = step.weight[i] * abs(D[i])
        total += x * x
        if x > step.weight[largest] * abs(D[largest]):
            largest = i
    total = sqrt(total)
    for i in range(n):
        sign = 1.0 if D[i] > 0 else -1.0
        if step.metric == MANHATTAN:
            y = sign * step.weight[i]
        elif step.metric == CHEBYCHEV:
            y = sign * step.weight[i] if i == largest else 0.0
        else:
            y = step.weight[i] * step.weight[i] * D[i] / total if total > 0 else 0.0
        out_y[i] = y + step.tilt[i]


@jit
def tangents(u: Array, step: Step, out_y: Array) -> None:
    """Fill a slope of the cost of each of the steps u (m, n), tilt included."""
    for k in range(len(u)):
        tangent(u[k], step, out_y[k])


@jit_inline
def beyond(y: Array, step: Step) -> float:
    """Return P(y): the most by which y . u exceeds rho(u) + mu . u over |u| <= v."""
    n = len(y)
    if step.metric == MANHATTAN:
        most = 0.0
        for i in range(n):
            most += max(0.0, abs(y[i] - step.tilt[i]) - step.weight[i]) * step.velocity[i]
        return most * (1.0 + SLACK)
    norm, size, free = 0.0, 0.0, 0.0
    for i in range(n):
        z = abs(y[i] - step.tilt[i])
        if step.weight[i] == 0.0:  # its motion costs nothing to balance y
            free += z * step.velocity[i]
            continue
        size += z * step.velocity[i]
        x = z / step.weight[i]
        norm += x if step.metric == CHEBYCHEV else x * x
    if step.metric != CHEBYCHEV:
        norm = sqrt(norm)
    share = max(0.0, 1.0 - 1.0 / norm) if norm > 0 else 0.0
    return size * (share + SLACK) + free * (1.0 + SLACK)


@jit
def excess(y: Array, step: Step) -> float:
    """Return what `beyond` does, for callers outside the kernels."""
    return beyond(y, step)


@jit_inline
def drift(cells: Cells, a: int, y: Array, z: Array) -> float:
    """Return the most by which the further parameters of cell a move (z - y) . q, rounded up."""
    most = 0.0
    for m in range(cells.reach.shape[1]):
        slope, size = 0.0, 0.0
        for i in range(len(y)):
            x = (z[i] - y[i]) * cells.tied[a, m, i]
            slope += x
            size += abs(x)
        most += (abs(slope) + SLACK * size) * cells.reach[a, m]
    return most * (1.0 + SLACK)


@jit_inline
def lean(cells: Cells, a: int, y: Array, z: Array) -> float:
    """Return a lower bound of (z - y) . (q - c) over cell a."""
    slope, bend, spread = 0.0, 0.0, 0.0
    for i in range(len(y)):
        d = z[i] - y[i]
        slope += d * cells.slope[a, i]
        bend += d * cells.bend[a, i]
        spread += abs(d) * cells.spread[a, i]
    spread += drift(cells, a, y, z)
    h = cells.half[a]
    slope = abs(slope)
    if bend > 0 and slope < bend * h:
        least = -slope * slope / (2.0 * bend)
    else:
        least = -slope * h + bend * h * h / 2.0
    return least * (1.0 + SLACK) - spread - SLACK * h * h * abs(bend) if least < 0 else -spread


@jit_inline
def least_ahead(cells: Cells, potential: Potential, b: int, y: Array) -> float:
    """Return a lower bound of y . (q - c) + V(q) over cell b: the larger of two bent lines."""
    slope, bend, off0, off1 = 0.0, 0.0, 0.0, 0.0
    for i in range(len(y)):
        slope += y[i] * cells.slope[b, i]
        bend += y[i] * cells.bend[b, i]
        off0 += abs(y[i] - potential.dual[b, 0, i]) * cells.spread[b, i]
        off1 += abs(y[i] - potential.dual[b, 1, i]) * cells.spread[b, i]
    off0 += drift(cells, b, y, potential.dual[b, 0])
    off1 += drift(cells, b, y, potential.dual[b, 1])
    h = cells.half[b]
    slope0, slope1 = slope - potential.along[b, 0], slope - potential.along[b, 1]
    level0, level1 = potential.level[b, 0] - off0, potential.level[b, 1] - off1
    least = min(
        max(level0 - slope0 * h, level1 - slope1 * h), max(level0 + slope0 * h, level1 + slope1 * h)
    )
    if slope0 != slope1:
        t = (level1 - level0) / (slope0 - slope1)
        if abs(t) < h:
            least = min(least, max(level0 + slope0 * t, level1 + slope1 * t))
    bent = min(bend - potential.bent[b, 0], bend - potential.bent[b, 1])
    sizes = abs(slope) + abs(potential.along[b, 0]) + abs(potential.along[b, 1])
    curved = abs(bend) + abs(potential.bent[b, 0]) + abs(potential.bent[b, 1])
    rounded = SLACK * (abs(level0) + abs(level1) + sizes * h + curved * h * h)
    lower: float = least + min(bent, 0.0) * h * h / 2.0 - rounded
    return lower
