"""Beam search for paths over continuous gamma under (5) and (6): a few states of each layer stay.

A state is a point between two samples and the increment that led there. From each state, and for
each target within its box of (5) and (6), three steps are tried: to the point of least cost and
value, and to both ends of what the box admits. The states with the least sum of cost so far and
value to come are kept, one of those that are alike.
"""

from __future__ import annotations

from math import pi
from typing import NamedTuple

import numpy as np

from kerfpath.arrays import Array, Ints
from kerfpath.kernels.change_table import ChangeTable, fill_change
from kerfpath.kernels.continuous import (
    RELAXED,
    Steps,
    Targets,
    course_within,
    least_value,
    step_value,
)
from kerfpath.kernels.jit import jit, jit_inline, jit_part, variable
from kerfpath.kernels.limits import LIMIT_TOLERANCE
from kerfpath.kernels.metric import wrap_angle
from kerfpath.kernels.search import first_from

__all__ = ["Alike", "Beam", "advance"]


class Alike(NamedTuple):
    """When two states on the same target count as alike, so that only the better one is kept."""

    share: float
    """Largest distance between them, as a share of the target."""
    change: float
    """Difference of their increments, as a share of the change that (6) allows, largest joint."""


class Beam(NamedTuple):
    """The states kept of every layer."""

    at: Ints
    """(K, B): target; in the first layer the vertex."""
    share: Array
    """(K, B): place on the target, as a share of it."""
    parent: Ints
    """(K, B): state of the layer before."""
    cost: Array
    """(K, B): cost so far; states are sorted by its sum with the value to come."""
    size: Ints
    """(K,): number of states of each layer."""


class _Offers(NamedTuple):
    """Steps that the states of a layer offer: their total cost, and where they lead."""

    total: Array
    cost: Array
    parent: Ints
    at: Ints
    share: Array
    increment: Array
    """(m, n)"""


@jit
def advance(
    targets: Targets, steps: Steps, cost: Array, tail: Array, acceleration: Array,
    table: ChangeTable, first: Ints, alike: Alike, out: Beam,
) -> int:  # fmt: skip
    """Fill the beam from vertices `first` of the first layer; returns the layers reached.

    cost (N,) is the cost of visiting a vertex, tail (N,) the value function, which includes it.
    Where no step keeps (6), the limit is relaxed to the least multiple in `RELAXED` that a step
    keeps.
    """
    (K, B), n = out.at.shape, len(acceleration)
    x, before, change = np.empty((B, n)), np.zeros((B, n)), np.empty(n)
    offers = _Offers(
        np.empty(64 * B), np.empty(64 * B), np.empty(64 * B, np.int64),
        np.empty(64 * B, np.int64), np.empty(64 * B), np.empty((64 * B, n)),
    )  # fmt: skip
    out.size[0] = min(B, len(first))
    for b in range(out.size[0]):
        p = first[b]
        out.at[0, b], out.share[0, b], out.parent[0, b], out.cost[0, b] = p, 0.0, -1, cost[p]
        for i in range(n):
            x[b, i] = targets.q[p, i]
    for k in range(1, K):
        made = variable(0)
        for relaxed in RELAXED:
            free = np.inf if k == 1 else relaxed
            for b in range(out.size[k - 1]):
                if len(table.joint_2) > 0:
                    fill_change(table, x[b, 1], x[b, 2], acceleration, change)
                else:
                    change[:] = acceleration
                for i in range(n):
                    change[i] *= free
                made = _offer(
                    targets, steps, cost, tail, change, k, b, x[b], before[b],
                    out.cost[k - 1, b], made, offers,
                )  # fmt: skip
            if made > 0:
                break
        if made == 0:
            return k
        _keep(offers, made, acceleration, k, x, before, alike, out)
    return len(out.at)


@jit_part
def _offer(
    targets: Targets, steps: Steps, cost: Array, tail: Array, change: Array, k: int, b: int,
    x: Array, before: Array, so_far: float, made: int, offers: _Offers,
) -> int:  # fmt: skip
    """Add the steps of one state into layer k to the offers; returns how many there are."""
    n, joint = len(x), targets.joint
    a, d, low, high = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    for i in range(n):
        low[i] = max(steps.low[i], before[i] - change[i])
        high[i] = min(steps.high[i], before[i] + change[i])
    boxed = Steps(steps.weight, steps.metric, steps.minimax, steps.cap, low, high)
    begin, end = targets.begin[k], targets.begin[k + 1]
    margin, turning = targets.half[k] + 2 * LIMIT_TOLERANCE, targets.endless[joint]
    middle = wrap_angle(x[joint]) if turning else x[joint]
    for turn in range(-1, 2):
        if turn != 0 and not turning:
            continue
        least = middle + low[joint] - margin + 2 * pi * turn
        most = middle + high[joint] + margin + 2 * pi * turn
        s = first_from(targets.key, begin, end, least)
        while s < end and targets.key[s] <= most:
            one, other = targets.one[s], targets.other[s]
            lower, upper = tail[one], tail[other]
            s += 1
            if min(lower, upper) == np.inf:
                continue
            first, last = course_within(targets, x, s - 1, low, high, a, d)
            if upper == np.inf:
                last, other, upper = min(last, 0.0), one, lower
            elif lower == np.inf:
                first, one, lower = max(first, 1.0), other, upper
            if first > last:
                continue
            best = least_value(a, d, first, last, lower, upper - lower, boxed, np.inf)[1]
            for way in range(3):
                t = best if way == 0 else (first if way == 1 else last)
                if (way > 0 and t == best) or made == len(offers.total):
                    continue
                to_come = lower + t * (upper - lower)
                length = step_value(a, d, t, 0.0, 0.0, boxed)[0]
                here = cost[one] + t * (cost[other] - cost[one])
                offers.total[made] = so_far + length + to_come
                offers.cost[made] = so_far + length + here
                offers.parent[made], offers.at[made], offers.share[made] = b, s - 1, t
                for i in range(n):
                    offers.increment[made, i] = a[i] + t * d[i]
                made += 1
    return made


@jit_inline
def _sift(heap: Ints, total: Array, root: int, size: int) -> None:
    """Let the entry at `root` of a binary heap sink to its place: least total first, then index.

    A heap suffices because only the first few of thousands are taken; compiling numpy's sorting
    would add seconds to the first run.
    """
    while True:
        least = root
        for child in range(2 * root + 1, min(2 * root + 3, size)):
            one, other = heap[child], heap[least]
            if total[one] < total[other] or (total[one] == total[other] and one < other):
                least = child
        if least == root:
            return
        heap[root], heap[least] = heap[least], heap[root]
        root = least


@jit_part
def _keep(
    offers: _Offers, made: int, acceleration: Array, k: int, x: Array, before: Array,
    alike: Alike, out: Beam,
) -> None:  # fmt: skip
    """Keep the best offers as the states of layer k, one of those that are alike."""
    B, n = x.shape
    from_x, kept = x.copy(), 0
    heap = np.arange(made)
    for root in range(made // 2 - 1, -1, -1):
        _sift(heap, offers.total, root, made)
    for left in range(made - 1, -1, -1):
        o = heap[0]
        heap[0] = heap[left]
        _sift(heap, offers.total, variable(0), left)
        known = False
        for b in range(kept):
            if out.at[k, b] != offers.at[o] or abs(out.share[k, b] - offers.share[o]) > alike.share:
                continue
            far = 0.0
            for i in range(n):
                far = max(far, abs(before[b, i] - offers.increment[o, i]) / acceleration[i])
            if far < alike.change:
                known = True
                break
        if known:
            continue
        out.at[k, kept], out.share[k, kept] = offers.at[o], offers.share[o]
        out.parent[k, kept], out.cost[k, kept] = offers.parent[o], offers.cost[o]
        for i in range(n):
            before[kept, i] = offers.increment[o, i]
            x[kept, i] = from_x[offers.parent[o], i] + offers.increment[o, i]
        kept += 1
        if kept == B:
            break
    out.size[k] = kept
