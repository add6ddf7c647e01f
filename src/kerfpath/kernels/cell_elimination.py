"""An outer approximation of all motions: the steps and pairs of steps that cells of gamma admit.

On a cell the joints are q(t) = c + s t + [k] t^2 / 2 +- r (`kernels.reduced`). A step from cell
a to b keeps (5) only if, for any factor f and joints i and r,

    |D_i - f D_r| <= v_i + |f| v_r + w(a) + w(b),    D = c_b - c_a,

where w is the most by which q_i - f q_r may differ from its value in the middle of the cell. Two
steps from a over b to c keep (6) only if

    |B_i - f B_r| <= a_i + |f| a_r + w(a) + 2 w(b) + w(c),    B = D_bc - D_ab.

If the steps span m and m' intervals, D / m is the mean of the increments from a to b. The middles
of both groups are (m + m') / 2 intervals apart, so that the means differ by that many times a:

    |B_i - f B_r| <= (a_i + |f| a_r) (m + m') / 2 + w(a) / m + w(b) (1 / m + 1 / m') + w(c) / m',
    B = D_bc / m' - D_ab / m.

With f = 0 both are tests of one joint. With f = s_i / s_r, where r is the joint that gamma moves
most, the unknown gamma drops out except for curvature: these tests find what no choice of gamma can
repair.
"""

from __future__ import annotations

from math import inf, pi
from typing import NamedTuple

import numpy as np

from kerfpath.arrays import Array, Bools, Ints
from kerfpath.kernels.jit import jit, jit_inline
from kerfpath.kernels.limits import LIMIT_TOLERANCE
from kerfpath.kernels.metric import extend, finish, increment
from kerfpath.kernels.reduced import SLACK, Cells, Step, near, window

__all__ = [
    "Bend",
    "bent_by",
    "blame_bends",
    "count_rejections",
    "keep_back",
    "keep_on",
    "list_steps",
    "may_step",
]


class Bend(NamedTuple):
    """Two steps to which (6) applies: how many intervals their middles are ``apart``.

    ``one`` and ``two`` are 1 by the number of intervals of each step.
    """

    apart: float
    one: float
    two: float


@jit_inline
def _wide(cells: Cells, a: int, i: int, r: int, f: float) -> float:
    """Return the most by which q_i - f q_r differs on cell a from its value in the middle."""
    h = cells.half[a]
    slope = abs(cells.slope[a, i] - f * cells.slope[a, r])
    bend = abs(cells.bend[a, i] - f * cells.bend[a, r])
    wide: float = slope * h + bend * h * h / 2.0 + cells.spread[a, i] + abs(f) * cells.spread[a, r]
    for m in range(cells.reach.shape[1]):
        wide += abs(cells.tied[a, m, i] - f * cells.tied[a, m, r]) * cells.reach[a, m]
    return wide


@jit_inline
def _factor(cells: Cells, b: int, i: int, r: int) -> float:
    """Return the factor f with which gamma drops out of q_i - f q_r on cell b."""
    s = cells.slope[b, r]
    return cells.slope[b, i] / s if s != 0.0 and i != r else 0.0


@jit_inline
def _exceeds_bound(cells: Cells, step: Step, a: int, b: int, D: Array) -> bool:
    """Return whether every step from cell a to b, D between centres, costs over `step.most`."""
    if step.most == inf:
        return False
    total = 0.0
    for i in range(len(D)):
        least = max(abs(D[i]) - cells.box[a, i] - cells.box[b, i], 0.0)
        total = extend(total, step.weight[i] * least, step.metric)
    return finish(total, step.metric) * (1.0 - SLACK) > step.most


@jit_inline
def may_step(cells: Cells, step: Step, lead: Ints, a: int, b: int, out_D: Array) -> bool:
    """Fill D; return whether a step from cell a to b may keep (5) and cost at most `step.most`."""
    status = near(cells, step, a, b, out_D)
    if status != 1:
        return status > 0
    if _exceeds_bound(cells, step, a, b, out_D):
        return False
    r = lead[b]
    for i in range(len(out_D)):
        f = _factor(cells, b, i, r)
        if f != 0.0:
            d = out_D[i] - f * out_D[r]
            wide = step.velocity[i] + abs(f) * step.velocity[r]
            wide += _wide(cells, a, i, r, f) + _wide(cells, b, i, r, f)
            if abs(d) > wide + SLACK * (abs(out_D[i]) + abs(f * out_D[r]) + wide):
                return False
    return True


@jit_inline
def _increment(cells: Cells, step: Step, a: int, b: int, i: int) -> tuple[float, bool]:
    """Return D_i from cell a to b, endless joints the short way, and whether the way is certain."""
    d = increment(cells.center[b, i] - cells.center[a, i], step.endless[i])
    return d, not step.endless[i] or abs(d) + cells.box[a, i] + cells.box[b, i] <= pi


@jit_inline
def bent_by(
    cells: Cells, step: Step, bend: Bend, lead: Ints, a: int, b: int, c: int, D: Array
) -> int:
    """Return a joint that breaks (6) in the two steps from cell a over b to c; -1 if none does.

    ``D`` (2, n) is scratch for the bends and for whether their direction is certain.
    """
    apart, one, two = bend
    n, both, at = D.shape[1], one + two, min(b, len(cells.change) - 1)
    for i in range(n):
        d, first = _increment(cells, step, a, b, i)
        e, second = _increment(cells, step, b, c, i)
        d, e = d * one, e * two
        D[0, i], D[1, i] = e - d, 1.0 if first and second else 0.0
        bound = cells.change[at, i] * apart + 2 * LIMIT_TOLERANCE
        wide = bound + one * cells.box[a, i] + both * cells.box[b, i] + two * cells.box[c, i]
        if first and second and abs(e - d) > wide + SLACK * (abs(d) + abs(e) + wide):
            return i
    r = lead[b]
    if D[1, r] == 0.0:
        return -1
    for i in range(n):
        f = _factor(cells, b, i, r)
        if f != 0.0 and D[1, i] > 0.0:
            wide = cells.change[at, i] * apart + 2 * LIMIT_TOLERANCE
            wide += abs(f) * (cells.change[at, r] * apart + 2 * LIMIT_TOLERANCE)
            wide += one * _wide(cells, a, i, r, f)
            wide += both * _wide(cells, b, i, r, f) + two * _wide(cells, c, i, r, f)
            size = abs(D[0, i]) + abs(f * D[0, r]) + wide
            if abs(D[0, i] - f * D[0, r]) > wide + SLACK * size:
                return i
    return -1


@jit
def list_steps(
    cells: Cells, step: Step, lead: Ints, k: int, live: Bools, most: int, out_count: Ints
) -> Ints:
    """Return the cells to which the steps (5) from live cells of layer k to live ones lead, (E,).

    They are in the order of the cells, of which ``out_count`` (C_k,) gets the numbers of steps. It
    ends at the first cell that makes them more than ``most``.
    """
    run, D = np.empty(2, np.int64), np.empty(len(step.velocity))
    first, number = cells.start[k], 0
    to = np.empty(8 * (cells.start[k + 1] - first) + 8, np.int64)
    out_count[:] = 0
    for a in range(first, cells.start[k + 1]):
        if not live[a]:
            continue
        window(cells, step, a, k, run)
        if number + max(0, run[1] - run[0]) > len(to):
            wider = np.empty(2 * len(to) + run[1] - run[0], np.int64)
            wider[:number] = to[:number]
            to = wider
        before = number
        for b in range(run[0], run[1]):
            if live[b] and may_step(cells, step, lead, a, b, D):
                to[number] = b
                number += 1
        out_count[a - first] = number - before
        if number > most:
            break
    return to[:number].copy()


@jit
def keep_on(
    cells: Cells, step: Step, bend: Bend, lead: Ints, k: int,
    begin: Ints, to: Ints, kept: Bools, begin_on: Ints, to_on: Ints, out_kept: Bools,
) -> int:  # fmt: skip
    """Mark the steps from layer k + 1 that keep (6) after some kept step from k; count the tests.

    ``begin``, ``to``, ``kept`` describe the steps from layer k, ``begin_on``, ``to_on`` those from
    layer k + 1.
    """
    first, second, tests = cells.start[k], cells.start[k + 1], 0
    D, missing = np.empty((2, cells.center.shape[1])), np.diff(begin_on)
    for a in range(first, second):
        for p in range(begin[a - first], begin[a - first + 1]):
            b = to[p]
            if not kept[p] or missing[b - second] == 0:
                continue
            for e in range(begin_on[b - second], begin_on[b - second + 1]):
                if not out_kept[e]:
                    tests += 1
                    if bent_by(cells, step, bend, lead, a, b, to_on[e], D) < 0:
                        out_kept[e] = True
                        missing[b - second] -= 1
    return tests


@jit
def keep_back(
    cells: Cells, step: Step, bend: Bend, lead: Ints, k: int,
    begin: Ints, to: Ints, begin_on: Ints, to_on: Ints, kept_on: Bools, out_kept: Bools,
) -> int:  # fmt: skip
    """Drop the steps from layer k that break (6) with every kept step on; count the tests."""
    first, second, tests = cells.start[k], cells.start[k + 1], 0
    D = np.empty((2, cells.center.shape[1]))
    for a in range(first, second):
        for p in range(begin[a - first], begin[a - first + 1]):
            if not out_kept[p]:
                continue
            b, goes = to[p], False
            for e in range(begin_on[b - second], begin_on[b - second + 1]):
                if kept_on[e]:
                    tests += 1
                    if bent_by(cells, step, bend, lead, a, b, to_on[e], D) < 0:
                        goes = True
                        break
            out_kept[p] = goes
    return tests


@jit
def count_rejections(cells: Cells, step: Step, k: int, live: Bools, out_blame: Ints) -> None:
    """Count the steps from live cells of layer k that break (5), by the joint with most excess."""
    for a in range(cells.start[k], cells.start[k + 1]):
        if not live[a]:
            continue
        for b in range(cells.start[k + 1], cells.start[k + 2]):
            worst, most = 0, -1.0
            for i in range(len(out_blame)):
                d = _increment(cells, step, a, b, i)[0]
                over = (abs(d) - cells.box[a, i] - cells.box[b, i]) / step.velocity[i]
                if over > most:
                    worst, most = i, over
            if live[b]:
                out_blame[worst] += 1


@jit
def blame_bends(
    cells: Cells, step: Step, bend: Bend, lead: Ints, k: int,
    begin: Ints, to: Ints, kept: Bools, begin_on: Ints, to_on: Ints, out_blame: Ints,
) -> None:  # fmt: skip
    """Count, by joint, the pairs of steps over layer k + 1 that break (6)."""
    first, second = cells.start[k], cells.start[k + 1]
    D = np.empty((2, cells.center.shape[1]))
    for a in range(first, second):
        for p in range(begin[a - first], begin[a - first + 1]):
            if kept[p]:
                b = to[p]
                for e in range(begin_on[b - second], begin_on[b - second + 1]):
                    joint = bent_by(cells, step, bend, lead, a, b, to_on[e], D)
                    if joint >= 0:
                        out_blame[joint] += 1
