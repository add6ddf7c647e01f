"""The first-order problem over continuous gamma, solved backwards (a semi-Lagrangian scheme).

Recursion (16) from the last layer to the first, where a step may lead to any point between two
neighbouring samples of gamma: there joints and costs to come are interpolated,

    V_k(i) = c_k(i) + min over targets (j, l), t in [0, 1] of
             rho(q_j + t (q_l - q_j) - q_i) + V_{k+1}(j) + t (V_{k+1}(l) - V_{k+1}(j)),

over the part of t where the increment is within (5). What is minimised is convex in t by every
metric, by (14) and by (15): two tangents bound it from below, and where they meet is the next t.
"""

from __future__ import annotations

from math import pi, sqrt
from typing import NamedTuple

import numpy as np

from kerfpath._arrays import Array, Bools, Ints
from kerfpath.kernels._jit import jit, jit_inline, variable
from kerfpath.kernels.limits import LIMIT_TOLERANCE
from kerfpath.kernels.metric import EUCLID, MANHATTAN, increment, wrap_angle
from kerfpath.kernels.search import first_from

__all__ = ["OVER_CAP", "Targets", "fill_keys", "join_samples", "values_to_go"]

SAME_VALUE = 1e-9
"""Relative gap between a value and its bound below which a minimum over t has been found."""
MOST_TANGENTS = 24
"""Tangents to a step's cost; by the Manhattan and Chebychev metrics it has fewer pieces."""
OVER_CAP = 20.0
"""Price of what a distance is over the cap, on top of its own."""
RELAXED = (1.0, 1.05, 1.2, 1.5, 2.5, 5.0, np.inf)
"""Multiples of (6) that a step forward is tried with, one after the other."""


class Targets(NamedTuple):
    """Where the steps of each layer may lead: between neighbouring samples, and to lone vertices.

    Sorted in each layer by the angle of one joint half way.
    """

    q: Array
    """(N, n) rad."""
    start: Ints
    """(K+1,): layer k is q[start[k]:start[k+1]]."""
    one: Ints
    """(T,): vertex that a target begins at;"""
    other: Ints
    """(T,): where it ends: the same for a lone vertex."""
    begin: Ints
    """(K+1,): layer k has the targets begin[k] to begin[k+1] - 1."""
    key: Array
    """(T,) rad: joint `joint` half way; in (-pi, pi] if it is endless."""
    half: Array
    """(K,) rad: most that this joint moves from half way to an end, by layers."""
    joint: int
    endless: Bools


class Steps(NamedTuple):
    """What a step is to minimise, and the box that its increment lies in."""

    weight: Array
    """(n,) 1/rad."""
    metric: int
    minimax: bool
    cap: float
    """Distance from which on a step costs more, see `OVER_CAP`."""
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

    Of the same layer, variant and posture, the nearest, if no joint moves by more than `widest`
    rad. A layer is ordered by variant and sample. There are no more targets than vertices.
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

    Fills a and d (n,), endless joints the short way, as far as the part is not empty: then it ends
    before it begins.
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
    """Cost of the step a + t d with what is still to come, begin + t rise; and a slope by t."""
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
    """Least value over t in first..last, and that t; any that is no less than `ceiling`, if so."""
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

    Next to a vertex from which nothing leads on, only the other end of a target remains. a, d (n,)
    are room to work in.
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
    """Best step from joints x into layer k: its value, its target, and where on it; -1: none.

    Only targets whose key may come within the box are looked at, those about `hint` first.
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
    """Fill V (N,): least cost from each vertex to the end, its own included; infinite if no way.

    cost (N,) is what visiting a vertex costs, infinite where it is closed. The last layer is given:
    what ends there cost, infinite where no path may end. Returns the first layer from which paths
    reach the end.
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
