"""Lower bounds on the reduced cost of a step of a motion between two places with a potential.

The cost of a step u of the joints is rho(u) + mu . u, with every |u_i| at most v_i. For any y it is
at least y . u plus the minimum of rho(u) + (mu - y) . u. The step from one place to another is the
difference D of their middles plus the offsets of the joints from the middles. The first part gives
y . D; the offsets are weighted with y and the slopes of the potential at both ends, and each is
bounded separately.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields

import numpy as np

from kerfpath.arrays import Array, Bools, Ints, places_within, short_repr
from kerfpath.auditor.cover import TURN, Places
from kerfpath.auditor.enclosure import linear_minimum

AT_ONCE = 8192
"""Number of pairs of places bounded together, so that their rows stay in the cache."""
FOUND_AT_ONCE = 1 << 18
"""Number of pairs found together, before all joints are compared."""
NEAR = 1e-9
"""rad: allowance for the rounding of differences, far above it."""
ROUNDED = 1 + 2.0**-46
"""Factor that covers the rounding of a norm."""


@dataclass(frozen=True, slots=True, eq=False)
class Rates:
    """Limits and costs of the steps of a motion, from each of M nodes to the next.

    A step over several intervals costs no more than all of them together.

    Parameters
    ----------
    nodes : (M,) int
        Node numbers, ascending.
    velocity : (M-1, n) rad
        Largest change of each joint in a step.
    weights : (n,) 1/rad
    metric : {"euclid", "manhattan", "chebychev"}
    endless : (n,) bool
    tilt : (M-1, n)
        mu: the multipliers of a stage add mu . u to the cost of a step u.
    """

    nodes: Ints
    velocity: Array
    weights: Array
    metric: str
    endless: Bools
    tilt: Array

    __repr__ = short_repr

    def layer(self, at: Places) -> Ints:
        """Return the index in `nodes` of the node of each place, (C,)."""
        return np.searchsorted(self.nodes, at.node)

    def most(self, layer: Ints) -> Array:
        """Return the largest change of each joint in the step from some nodes, (B, n) rad."""
        return np.asarray(self.velocity[np.minimum(layer, len(self.velocity) - 1)])


@dataclass(frozen=True, slots=True, eq=False)
class _Curves:
    """Offsets of joints from their middle, slope t + [low, high] t^2 / 2 +- radius; a potential.

    The joints are on the first axis, (n, B), where numpy adds several times faster. The potential
    is the larger of value_m - dual_m . off for m = 0, 1, with value (2, B) and dual (2, n, B).
    """

    q: Array
    reach: Array
    slope: Array
    low: Array
    high: Array
    radius: Array
    half: Array
    value: Array
    dual: Array

    __repr__ = short_repr

    @classmethod
    def of(cls, at: Places, value: Array, dual: Array) -> _Curves:
        """Return the curves of places (C,) with their potential (C, 2) and (C, 2, n)."""
        joints = (at.q, at.reach, at.slope, at.low, at.high, at.radius, at.half)
        potential = value, dual.transpose(0, 2, 1)
        return cls(*(np.ascontiguousarray(part.T) for part in joints + potential))

    def take(self, which: Ints) -> _Curves:
        """Return a selection of the curves."""
        return _Curves(*(getattr(self, each.name).take(which, axis=-1) for each in fields(self)))

    def least(self, z: Array) -> Array:
        """Return the least value (B,) of z . off, for z (n, B)."""
        return linear_minimum(self.slope, self.low, self.high, self.radius, self.half, z, axis=0)

    def least_with(self, y: Array) -> Array:
        """Return the least value (B,) of y . off plus the potential, for y (n, B).

        The larger of two lines is at least any weighted mean of both; the best mean is one of the
        lines, or level.
        """
        run = ((y - self.dual) * self.slope).sum(1)
        ends = self.value - np.abs(run) * self.half
        share = (ends[0] >= ends[1]).astype(float)
        across = run[1] - run[0]
        opposed = run[0] * run[1] < 0
        safe = np.where(opposed, across, 1.0)
        crossing = np.abs(self.value[0] - self.value[1]) < np.abs(safe) * self.half
        share = np.where(opposed & crossing, np.clip(run[1] / safe, 0.0, 1.0), share)
        rest = 1.0 - share
        z = y - (share * self.dual[0] + rest * self.dual[1])
        return np.asarray(share * self.value[0] + rest * self.value[1] + self.least(z))


def least_value(at: Places, value: Array, dual: Array) -> Array:
    """Return the least value of the potential at each place, (C,)."""
    return _Curves.of(at, value, dual).least_with(np.zeros(at.q.T.shape))


def candidates(rates: Rates, at: Places) -> Iterator[tuple[Ints, Ints]]:
    """Yield the pairs of places at neighbouring nodes that a step may join, each pair once.

    Pairs are found by sorting the values of the joint that leaves the fewest pairs; then the other
    joints are compared.
    """
    layer = rates.layer(at)
    wide = at.reach + rates.most(layer) + NEAR
    bound = np.flatnonzero(~rates.endless)
    size = np.abs(at.q).max(initial=0.0) + wide.max(initial=0.0) + 1.0
    step = 2 * size * layer
    best: tuple[float, tuple[Array, ...]] | None = None
    for i in bound:
        # Intervals of both ends of a step on one line, each step on a separate stretch of it.
        q = at.q[:, i]
        pad = 1e-14 * (np.abs(step).max(initial=0.0) + size)
        first = q - wide[:, i] + step - pad, q + wide[:, i] + step + pad
        to = step - 2 * size
        second = q - at.reach[:, i] + to - pad, q + at.reach[:, i] + to + pad
        starts = np.sort(first[0]), np.sort(second[0])
        number = float(_number(starts[1], *first).sum() + _number(starts[0], *second).sum())
        if best is None or number < best[0]:
            best = number, (*first, *second)
    if best is None:  # all joints are endless: all pairs, stretch by stretch
        flat = np.full(len(at), size)
        best = 0.0, (step - flat / 2, step + flat / 2, step - 2.5 * size, step - 1.5 * size)
    first_low, first_high, second_low, second_high = best[1]
    by_second = np.argsort(second_low, kind="stable")
    for a, place in _inside(second_low[by_second], first_low, first_high, "left"):
        yield from _possible(rates, at, layer, a, by_second[place])
    by_first = np.argsort(first_low, kind="stable")
    for b, place in _inside(first_low[by_first], second_low, second_high, "right"):
        yield from _possible(rates, at, layer, by_first[place], b)


def _number(starts: Array, low: Array, high: Array) -> Ints:
    return np.asarray(np.searchsorted(starts, high, "right") - np.searchsorted(starts, low))


def _inside(starts: Array, low: Array, high: Array, side: str) -> Iterator[tuple[Ints, Ints]]:
    """Yield rows and places of all starts in [low, high], or in (low, high] if side is "right"."""
    begin = np.searchsorted(starts, low, "left" if side == "left" else "right")
    number = np.maximum(np.searchsorted(starts, high, "right") - begin, 0)
    total = np.cumsum(number)
    row = 0
    while row < len(number):
        done = total[row - 1] if row else 0
        end = max(row + 1, int(np.searchsorted(total, done + FOUND_AT_ONCE, "right")))
        part = number[row:end]
        rows = np.repeat(np.arange(row, end), part)
        yield rows, begin[rows] + places_within(part)
        row = end


def _possible(
    rates: Rates, at: Places, layer: Ints, a: Ints, b: Ints
) -> Iterator[tuple[Ints, Ints]]:
    right = layer[b] == layer[a] + 1
    a, b = a[right], b[right]
    for i, endless in enumerate(rates.endless):
        off = at.q[b, i] - at.q[a, i]
        if endless:
            off -= TURN * np.round(off / TURN)
        most = rates.velocity[layer[a], i] + at.reach[a, i] + at.reach[b, i] + NEAR
        near = np.abs(off) <= most
        a, b = a[near], b[near]
    if len(a):
        yield a, b


def steps_on(rates: Rates, at: Places) -> Iterator[tuple[slice, Places]]:
    """Yield, for each two neighbouring nodes, the slice of their places and the places.

    Places must be in the order of nodes.
    """
    start = np.searchsorted(at.node, rates.nodes)
    ends = [*start[2:], len(at)]
    for first, last in zip(start, ends, strict=False):
        both = slice(int(first), int(last))
        yield both, at.take(both)


def linked(rates: Rates, at: Places) -> Bools:
    """Return which places (C,) are joined by steps to the first and to the last node."""
    order = np.argsort(at.node, kind="stable")
    at = at.take(order)
    begun, ended = at.node == rates.nodes[0], at.node == rates.nodes[-1]
    steps = list(steps_on(rates, at))
    for both, places in steps:
        for a, b in candidates(rates, places):
            begun[both.start + b[begun[both.start + a]]] = True
    for both, places in reversed(steps):
        for a, b in candidates(rates, places):
            ended[both.start + a[ended[both.start + b]]] = True
    found = np.empty(len(at), dtype=bool)
    found[order] = begun & ended
    return found


def reduced_costs(rates: Rates, at: Places, value: Array, dual: Array, a: Ints, b: Ints) -> Array:
    """Return lower bounds (B,) on the reduced cost of steps from places a to places b (B,).

    The reduced cost is the cost plus the potential (C, 2) and (C, 2, n) at the end, less that at
    the beginning; up to rounding.
    """
    curves, layer, least = _Curves.of(at, value, dual), rates.layer(at), np.empty(len(a))
    for i in range(0, len(a), AT_ONCE):
        part = slice(i, i + AT_ONCE)
        here, there = curves.take(a[part]), curves.take(b[part])
        k = layer[a[part]]
        mu, most = (np.ascontiguousarray(each[k].T) for each in (rates.tilt, rates.velocity))
        least[part] = _reduced_costs(rates, here, there, mu, most)
    return least


def _reduced_costs(rates: Rates, here: _Curves, there: _Curves, mu: Array, most: Array) -> Array:
    low, high = _differences(rates, most, here, there)
    off = here.reach + there.reach + NEAR
    u_low = np.maximum(low - off, -most)
    u_high = np.maximum(np.minimum(high + off, most), u_low)
    at_least = np.full((2, len(here.half)), -np.inf)

    def offer(y: Array, cut: int | None = None) -> None:
        """Use the bound by y, for the line `cut` of the potential at the start, or for both."""
        apart = np.minimum(y * low, y * high).sum(0) + least_step(rates, y - mu, u_low, u_high)
        apart += there.least_with(y)
        for m in (0, 1) if cut is None else (cut,):
            more = apart if cut is not None else apart + here.least(here.dual[m] - y)
            np.maximum(at_least[m], more, out=at_least[m])

    for m in (0, 1):
        offer(here.dual[m], m)
    offer(mu + _slope(rates, (low + high) / 2))
    for m in (0, 1):
        offer(there.dual[m])
    offer(np.zeros(low.shape))
    return np.asarray((at_least - here.value).min(0))


def _differences(rates: Rates, most: Array, here: _Curves, there: _Curves) -> tuple[Array, Array]:
    """Return the least and the largest difference of the middles of two places, (n, B) rad each.

    For endless joints they include every full turn with which a step may join the places.
    """
    off = there.q - here.q
    if not rates.endless.any():
        return off, off
    endless = rates.endless[:, None]
    off = np.where(endless, off - TURN * np.round(off / TURN), off)
    room = most + here.reach + there.reach + NEAR
    if not ((np.abs(off) + room > TURN) & endless).any():
        return off, off
    low = np.where(endless, np.minimum(np.ceil((-room - off) / TURN), 0), 0)
    high = np.where(endless, np.maximum(np.floor((room - off) / TURN), 0), 0)
    return off + TURN * low, off + TURN * high


def least_step(rates: Rates, z: Array, low: Array, high: Array) -> Array:
    """Return a lower bound of rho(u) - z . u over steps u between low and high (n, B)."""
    w = rates.weights[:, None]
    nearest = np.clip(0.0, low, high)
    if rates.metric == "manhattan":
        ends = np.minimum(w * np.abs(low) - z * low, w * np.abs(high) - z * high)
        return np.asarray(np.minimum(ends, w * np.abs(nearest) - z * nearest).sum(0))
    # rho(u) >= s . u for any s of dual norm at most 1: z scaled down to it, and the slope at the
    # shortest step, by which rho(u) is at least its value there.
    scaled = np.where(w > 0, z / np.where(w > 0, w, 1.0), 0.0)
    euclid = rates.metric == "euclid"
    size = np.sqrt((scaled * scaled).sum(0)) if euclid else np.abs(scaled).sum(0)
    short = np.where(w > 0, z, 0.0) / np.maximum(1.0, size * ROUNDED)
    towards = _slope(rates, nearest) / ROUNDED
    each = (np.minimum((s - z) * low, (s - z) * high).sum(0) for s in (short, towards))
    return np.asarray(np.maximum(*each))


def _slope(rates: Rates, u: Array) -> Array:
    """Return the slope of rho at u (n, B)."""
    w = rates.weights[:, None]
    if rates.metric == "manhattan":
        return np.asarray(w * np.sign(u))
    if rates.metric == "euclid":
        size = np.sqrt(((w * u) ** 2).sum(0))
        return np.asarray(w * w * u / np.where(size > 0, size, 1.0))
    largest = np.argmax(w * np.abs(u), axis=0) == np.arange(len(w))[:, None]
    return np.where(largest, w * np.sign(u), 0.0)
