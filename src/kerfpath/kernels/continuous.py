"""The first-order problem over continuous gamma, solved backwards (a semi-Lagrangian scheme).

Recursion (16) runs from the last layer to the first. A step may lead to any point between two
neighbouring samples of gamma, where joints and costs to come are interpolated:

    V_k(i) = c_k(i) + min over targets (j, l), t in [0, 1] of
             rho(q_j + t (q_l - q_j) - q_i) + V_{k+1}(j) + t (V_{k+1}(l) - V_{k+1}(j)),

over the part of t where the increment is within (5). This function is convex in t for every metric,
for (14) and for (15): two tangents bound it from below, and the next t is where they meet.
"""

from __future__ import annotations

from math import pi, sqrt
from typing import NamedTuple

import numpy as np

from kerfpath.arrays import Array, Bools, Ints
from kerfpath.kernels.jit import jit, jit_inline, variable
from kerfpath.kernels.limits import LIMIT_TOLERANCE
from kerfpath.kernels.metric import EUCLID, MANHATTAN, increment, wrap_angle
from kerfpath.kernels.search import first_from

__all__ = ["OVER_CAP", "Targets", "fill_keys", "join_samples", "values_to_go"]

SAME_VALUE = 1e-9
"""Relative gap between a value and its bound below which a minimum over t counts as found."""
MOST_TANGENTS = 24
"""Most tangents to a step's cost; with the Manhattan and Chebychev metrics it has fewer pieces."""
OVER_CAP = 20.0
"""Price per unit of distance over the cap, added to the distance."""
RELAXED = (1.0, 1.05, 1.2, 1.5, 2.5, 5.0, np.inf)
"""Multiples of (6) that a forward step is tried with, in this order."""


class Targets(NamedTuple):
    """Targets of the steps of each layer: between neighbouring samples, and lone vertices.

    Each layer is sorted by the angle of one joint at the middle of the target.
    """

    q: Array
    """(N, n) rad."""
    start: Ints
    """(K+1,): layer k is q[start[k]:start[k+1]]."""
    one: Ints
    """(T,): vertex at which a target begins."""
    other: Ints
    """(T,): vertex at which it ends, the same for a lone vertex."""
    begin: Ints
    """(K+1,): layer k has the targets begin[k]..begin[k+1]-1."""
    key: Array
    """(T,) rad: joint `joint` at the middle of the target; in (-pi, pi] if it is endless."""
    half: Array
    """(K,) rad: largest motion of this joint from the middle of a target to an end, by layer."""
    joint: int
    endless: Bools


class Steps(NamedTuple):
    """What a step minimises, and the box that its increment must lie in."""

    weight: Array
    """(n,) 1/rad."""
    metric: int
    minimax: bool
    cap: float
    """Distance above which a step costs more, see `OVER_CAP`."""
    low: Array
    """(n,) rad"""
    high: Array
    """(n,) rad"""


@jit
def join_samples(
    q: Array, start: Ints, sample: Ints, variant: Ints, posture: Ints, samples: int,
    endless: Bools, widest: float, out_one: Ints, out_other: Ints, out_begin: Ints,
) -> None:  # fmt: skip
    """Join each vertex with that of the next sample on its branch; lone ones with themselves.

    The partner is the nearest vertex of the same layer, variant and posture, if no joint moves by
    more than `widest` rad. A layer is ordered by variant and sample. There are no more targets
    than vertices.
    """
    count, joined = 0, np.zeros(len(q), np.bool_)
    place = np.empty(len(q), np.int64)
    for v in range(len(q)):
        place[v] = variant[v] * samples + sample[v]
    for k in range(len(start) - 1):
        out_begin[k] = count
        a, b = start[k], start[k + 1]
        for v in range(a, b):
            following = sample[v] + 1 if sample[v] + 1 < samples else 0
            wanted = variant[v] * samples + following
            w, nearest, best = first_from(place, a, b, wanted), widest, -1
            while samples > 1 and w < b and place[w] == wanted:
                if posture[w] == posture[v]:
                    far = _farthest(q, v, w, endless)
                    if far <= nearest:
                        nearest, best = far, w
                w += 1
            if best >= 0:
                joined[v] = joined[best] = True
                out_one[count], out_other[count] = v, best
                count += 1
        for v in range(a, b):
            if not joined[v]:
                out_one[count] = out_other[count] = v
                count += 1
    out_begin[len(start) - 1] = count


@jit_inline
def _farthest(q: Array, v: int, w: int, endless: Bools) -> float:
    """Largest increment of a joint from vertex v to vertex w, rad."""
    far = 0.0
    for i in range(len(endless)):
        far = max(far, abs(increment(q[w, i] - q[v, i], endless[i])))
    return far


@jit
def fill_keys(targets: Targets) -> None:
    """Fill the keys of the targets and the half widths of the layers."""
    i = targets.joint
    turning = targets.endless[i]
    for k in range(len(targets.begin) - 1):
        a, b = targets.begin[k], targets.begin[k + 1]
        half = 0.0
        for s in range(a, b):
            x = targets.q[targets.one[s], i]
            d = increment(targets.q[targets.other[s], i] - x, turning)
            middle = x + d / 2
            targets.key[s] = wrap_angle(middle) if turning else middle
            half = max(half, abs(d) / 2)
        targets.half[k] = half


@jit_inline
def course_within(
    targets: Targets, x: Array, s: int, low: Array, high: Array, out_a: Array, out_d: Array
) -> tuple[float, float]:
    """Part of t in [0, 1] where the increment a + t d from joints x to target s is in low..high.

    Fills a and d (n,), endless joints the short way. An empty part ends before it begins; a and d
    may then be incomplete.
    """
    j, w = targets.one[s], targets.other[s]
    first, last = 0.0, 1.0
    for i in range(len(x)):
        a, d = targets.q[j, i] - x[i], targets.q[w, i] - targets.q[j, i]
        if targets.endless[i]:
            d = increment(d, True)
            a -= 2.0 * pi * np.rint((a + d / 2) / (2.0 * pi))
        out_a[i], out_d[i] = a, d
        under, over = low[i] - LIMIT_TOLERANCE - a, high[i] + LIMIT_TOLERANCE - a
        if max(0.0, d) < under or min(0.0, d) > over:
            return 1.0, 0.0
        if d > LIMIT_TOLERANCE:
            first, last = max(first, under / d), min(last, over / d)
        elif d < -LIMIT_TOLERANCE:
            first, last = max(first, over / d), min(last, under / d)
        if first > last:
            return 1.0, 0.0
    return first, last


@jit_inline
def _length(a: Array, d: Array, t: float, weight: Array, metric: int) -> tuple[float, float]:
    """Distance rho of the increment a + t d, and one of its slopes by t."""
    length = slope = 0.0
    for i in range(len(a)):
        y = weight[i] * (a[i] + t * d[i])
        s = weight[i] * d[i] if y >= 0.0 else -weight[i] * d[i]
        y = abs(y)
        if metric == MANHATTAN:
            length += y
            slope += s
        elif metric == EUCLID:
            length += y * y
            slope += y * s
        elif y > length:
            length, slope = y, s
    if metric == EUCLID:
        length = sqrt(length)
        slope = slope / length if length > 0.0 else 0.0
    return length, slope


@jit_inline
def step_value(
    a: Array, d: Array, t: float, begin: float, rise: float, steps: Steps
) -> tuple[float, float]:
    """Cost of the step a + t d joined with the cost to come, begin + t rise; and a slope by t."""
    length, slope = _length(a, d, t, steps.weight, steps.metric)
    if length > steps.cap:
        length, slope = length + OVER_CAP * (length - steps.cap), (1.0 + OVER_CAP) * slope
    to_come = begin + t * rise
    if not steps.minimax:
        return length + to_come, slope + rise
    return (length, slope) if length > to_come else (to_come, rise)


@jit_inline
def least_value(
    a: Array, d: Array, first: float, last: float, begin: float, rise: float,
    steps: Steps, ceiling: float,
) -> tuple[float, float]:  # fmt: skip
    """Least value over t in first..last, and its t; not exact if it is at or above `ceiling`."""
    low, slope_low = step_value(a, d, first, begin, rise, steps)
    if slope_low >= 0.0 or first == last:
        return low, first
    high, slope_high = step_value(a, d, last, begin, rise, steps)
    if slope_high <= 0.0:
        return high, last
    best, at = (low, first) if low <= high else (high, last)
    for _ in range(MOST_TANGENTS):
        t = (high - low + slope_low * first - slope_high * last) / (slope_low - slope_high)
        bound = low + slope_low * (t - first)
        if bound >= ceiling or bound >= best - SAME_VALUE * abs(best) or not first < t < last:
            break
        value, slope = step_value(a, d, t, begin, rise, steps)
        if value < best:
            best, at = value, t
        if slope < 0.0:
            first, low, slope_low = t, value, slope
        elif slope > 0.0:
            last, high, slope_high = t, value, slope
        else:
            break
    return best, at


@jit_inline
def _offered(
    targets: Targets, tail: Array, steps: Steps, x: Array, s: int, ceiling: float,
    a: Array, d: Array,
) -> tuple[float, float]:  # fmt: skip
    """Least value of a step from joints x to target s, and where on it; infinite beyond `ceiling`.

    If nothing leads on from one end of a target, only the other end remains. a, d (n,) are
    scratch arrays.
    """
    begin, end = tail[targets.one[s]], tail[targets.other[s]]
    if min(begin, end) >= ceiling:
        return np.inf, 0.0
    first, last = course_within(targets, x, s, steps.low, steps.high, a, d)
    if end == np.inf:
        last, end = min(last, 0.0), begin
    elif begin == np.inf:
        first, begin = max(first, 1.0), end
    if first > last or begin + (end - begin) * (first if end > begin else last) >= ceiling:
        return np.inf, 0.0
    return least_value(a, d, first, last, begin, end - begin, steps, ceiling)


@jit_inline
def _best_step(
    targets: Targets, tail: Array, steps: Steps, k: int, x: Array, hint: int, a: Array, d: Array
) -> tuple[float, int, float]:
    """Best step from joints x into layer k: its value, its target (-1: none), and where on it.

    Only targets whose key may lie within the box are tested, those around `hint` first.
    """
    best, at, where = np.inf, -1, 0.0
    first, last = targets.begin[k], targets.begin[k + 1]
    if first <= hint < last:
        best, where = _offered(targets, tail, steps, x, hint, best, a, d)
        at = hint if best < np.inf else -1
    i, margin = targets.joint, targets.half[k] + 2 * LIMIT_TOLERANCE
    turning = targets.endless[i]
    middle = wrap_angle(x[i]) if turning else x[i]
    low, high = middle + steps.low[i] - margin, middle + steps.high[i] + margin
    for turn in range(-1, 2):
        if turn != 0 and not turning:
            continue
        begin = first_from(targets.key, first, last, low + 2 * pi * turn)
        s = begin
        while s < last and targets.key[s] <= high + 2 * pi * turn:
            value, t = _offered(targets, tail, steps, x, s, best, a, d)
            if value < best:
                best, at, where = value, s, t
            s += 1
    return best, at, where


@jit_inline
def _joined(minimax: bool, cost: float, to_go: float) -> float:
    return max(cost, to_go) if minimax else cost + to_go


@jit
def values_to_go(targets: Targets, steps: Steps, cost: Array, out_tail: Array) -> int:
    """Fill V (N,): least cost from each vertex to the end, its own included; infinite if no path.

    cost (N,) is the cost of visiting a vertex, infinite where it is closed. The last layer is
    given: the cost of ending at a vertex, infinite where no path may end. Returns the first layer
    from which paths reach the end.
    """
    K, n = len(targets.start) - 1, len(steps.low)
    a, d = np.empty(n), np.empty(n)
    for k in range(K - 2, -1, -1):
        hint, alive = variable(-1), False
        for p in range(targets.start[k], targets.start[k + 1]):
            out_tail[p] = np.inf
            if cost[p] == np.inf:
                continue
            value, at, _ = _best_step(targets, out_tail, steps, k + 1, targets.q[p], hint, a, d)
            if at >= 0:
                hint, alive = at, True
                out_tail[p] = _joined(steps.minimax, cost[p], value)
        if not alive:
            return k + 1
    return 0
