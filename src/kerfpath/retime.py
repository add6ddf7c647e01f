"""Feed reduction: keep the commanded speed where the limits allow it, and slow down elsewhere.

The path is fixed, and each interval may take longer than commanded. In terms of the interval times
tau, the limits as the audit measures them are velocity bounds, |dq_k| / tau_k <= v, and, where two
intervals meet,

    dq_{k+1} / tau_{k+1} - dq_k / tau_k <= a (tau_k + tau_{k+1}) / 2

for either sign. Positive terms are convex in tau; negative ones are not and are replaced by their
tangents. This is an inner approximation: every solution keeps the limits, and the next one is never
slower (the convex-concave procedure).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy import sparse

from kerfpath.arrays import Array, Ints, floats, freeze, positive
from kerfpath.conic import NonnegativeConeT, SecondOrderConeT, minimise
from kerfpath.errors import InputError
from kerfpath.limits import Limits, meetings, rates_of
from kerfpath.plans import Feed

__all__ = ["feed", "retime"]

LIMIT_ROUNDING = 1e-9
"""Relative slack of the limits in the result, for rounding."""
MARGIN = 1e-7
"""Share of the acceleration kept from the solver, so that its tolerance breaks no limit."""
SNAP = 1e-6
"""Relative excess over the least time below which an interval is set to it, if the limits allow."""
GAIN = 1e-5
"""Relative gain in total time below which the procedure has converged."""
ITERATIONS = 50
"""Most iterations; each about halves the excess over the optimal time."""


class _LimitRows(NamedTuple):
    """Limits b / tau[after] - a / tau[before] <= (tau[before] + tau[after]) / 2."""

    before: Ints
    after: Ints
    a: Array
    b: Array

    def excess(self, tau: Array) -> Array:
        """Return, row by row, the left side divided by the right one."""
        left = self.b / tau[self.after] - self.a / tau[self.before]
        return 2 * left / (tau[self.before] + tau[self.after])


def retime(
    dq: ArrayLike,
    dt: ArrayLike,
    limits: Limits,
    *,
    q: ArrayLike | None = None,
    periodic: bool = False,
) -> Array:
    """Return the interval times with the least sum, none below `dt`, that keep the limits.

    The result keeps them to 1e-9 relative; it is a local optimum, to about 1e-4 of the total time.
    An interval that no limit slows has exactly the time `dt`.

    Parameters
    ----------
    dq : (K-1, n) rad
        Joint increments along the path, endless joints the short way.
    dt : float or (K-1,) s
        Commanded time of each interval.
    limits : Limits
    q : (K, n) rad, optional
        Joints at the nodes; needed where accelerations depend on them.
    periodic : bool
        Whether the last interval is followed by the first; else the path begins and ends at speed.

    Returns
    -------
    tau : (K-1,) s

    Raises
    ------
    InputError
        Arrays whose shapes do not fit, NaN, times that are not positive, limits on torque or jerk,
        or no joints beside accelerations that depend on them.
    """
    if limits.torque is not None or limits.jerk is not None:
        raise InputError(
            "retime: supports limits on velocity and acceleration only; remove those on torque "
            "and jerk"
        )
    dq, dt, velocity = _inputs(dq, dt, limits)
    least = np.maximum(dt, (np.abs(dq) / velocity).max(axis=1, initial=0.0))
    rows = _rows(dq, _accelerations(limits, q, len(dq), periodic), least, periodic)
    tau = _stretch_times(rows, least)
    if np.array_equal(tau, least):
        return freeze(tau)
    inner = rows._replace(a=rows.a / (1 - MARGIN), b=rows.b / (1 - MARGIN))
    tau = _stretch_times(inner, least)
    for _ in range(ITERATIONS):
        solved = _stretch_times(inner, np.maximum(_improve_times(inner, least, tau), least))
        gain = 1 - solved.sum() / tau.sum()
        tau = solved if gain > 0 else tau
        if gain < GAIN:
            break
    return freeze(_snap_times(rows, least, tau))


def feed(
    tau: ArrayLike,
    dt: ArrayLike,
    dq: ArrayLike,
    limits: Limits,
    length: ArrayLike,
    *,
    q: ArrayLike | None = None,
    periodic: bool = False,
) -> Feed:
    """Return where the times `tau` keep the commanded speed, and what limits the slowest interval.

    Parameters
    ----------
    tau : (K-1,) s
        The result of `retime`.
    dt, dq, limits, q, periodic
        As in `retime`.
    length : (K-1,) m
        Length of the path in each interval.

    Raises
    ------
    InputError
        As `retime`.
    """
    dq, dt, velocity = _inputs(dq, dt, limits)
    acceleration = _accelerations(limits, q, len(dq), periodic)
    tau = positive(tau, "tau", dt.shape)
    length = floats(length, "length", dt.shape)
    at_speed = tau <= dt * (1 + LIMIT_ROUNDING)
    full = float(length[at_speed].sum() / length.sum()) if length.any() else float(at_speed.mean())
    if at_speed.all():
        return Feed(full=full, slowest=1.0, node=-1, joint=-1, limit=None)
    k = int(np.argmin(dt / tau))
    v, a = (np.abs(rates) for rates in rates_of(dq, tau, periodic=periodic))
    before, after = meetings(len(dq), periodic=periodic)
    speed = v[k] / velocity
    change = (a / acceleration)[(before == k) | (after == k)].max(axis=0, initial=0.0)
    fast = speed.max() >= change.max()
    return Feed(
        full=full,
        slowest=float(dt[k] / tau[k]),
        node=k,
        joint=int(np.argmax(speed if fast else change)),
        limit="velocity" if fast else "acceleration",
    )


def _inputs(dq: ArrayLike, dt: ArrayLike, limits: Limits) -> tuple[Array, Array, Array]:
    dq = floats(dq, "dq", (None, None))
    intervals, n = dq.shape
    if intervals == 0 or n == 0:
        raise InputError(f"dq: expected at least one interval and one joint, got shape {dq.shape}")
    if np.ndim(dt) == 0:
        dt = np.full(intervals, dt)
    limits.require_joints(n)
    dt = positive(dt, "dt", (intervals,))
    return dq, dt, limits.velocity.usable


def _accelerations(limits: Limits, q: ArrayLike | None, intervals: int, periodic: bool) -> Array:
    """Return the largest accelerations (M, n) where intervals meet, or those of any node (n,)."""
    if limits.acceleration.table is None:
        return limits.acceleration.usable
    if q is None:
        raise InputError(
            "retime: accelerations depend on the configuration; give the joints at the nodes, q="
        )
    nodes = floats(q, "q", (intervals + 1, len(limits.acceleration.bound)))
    return limits.acceleration.usable_at(nodes[meetings(intervals, periodic=periodic)[1]])


def _rows(dq: Array, acceleration: Array, least: Array, periodic: bool) -> _LimitRows:
    """Return the acceleration limits that can bind, from increments dq (K-1, n) rad.

    Of the rows of one node, the one with the larger b and the smaller a implies the other.
    """
    before, after = meetings(len(dq), periodic=periodic)
    early, late = dq[before] / acceleration, dq[after] / acceleration
    a, b = np.hstack([early, -early]), np.hstack([late, -late])
    first, second = least[before, None], least[after, None]
    kept = np.maximum(b, 0) / second + np.maximum(-a, 0) / first > (first + second) / 2
    number = np.arange(a.shape[1])
    for i in number:
        implied = (b >= b[:, [i]]) & (a <= a[:, [i]]) & kept
        same = (b == b[:, [i]]) & (a == a[:, [i]])
        kept[:, i] &= ~(implied & ~(same & (number >= i))).any(axis=1)
    node, row = np.nonzero(kept)
    return _LimitRows(before[node], after[node], a[node, row], b[node, row])


def _stretch_times(rows: _LimitRows, tau: Array) -> Array:
    """Return times that keep the rows: all of `tau` stretched by the factor of the worst row."""
    worst = rows.excess(tau).max(initial=0.0)
    return tau if worst <= 1 + LIMIT_ROUNDING / 2 else tau * np.sqrt(worst)


def _snap_times(rows: _LimitRows, least: Array, tau: Array) -> Array:
    """Set times that are nearly the least to the least, where the rows allow it."""
    near = tau <= least * (1 + SNAP)
    while True:
        snapped = np.where(near, least, tau)
        broken = rows.excess(snapped) > 1 + LIMIT_ROUNDING / 2
        blamed = np.zeros_like(near)
        blamed[rows.before[broken]] = blamed[rows.after[broken]] = True
        if not (blamed & near).any():
            return snapped
        near &= ~blamed


def _improve_times(rows: _LimitRows, least: Array, tau: Array) -> Array:
    """Return the quickest times under the rows made convex at `tau` (K-1,).

    Variables: y = tau / unit, and x >= 1 / y for each interval whose 1 / y has a positive sign in
    some row.
    """
    unit = float(np.mean(least))
    y, a, b = tau / unit, rows.a / unit**2, rows.b / unit**2
    to_y, to_x, most = _tangents(rows.before, y, np.maximum(-a, 0), np.maximum(a, 0))
    to_y2, to_x2, most2 = _tangents(rows.after, y, np.maximum(b, 0), np.maximum(-b, 0))
    used = np.flatnonzero((to_x + to_x2).sum(axis=0))
    m, each = len(used), sparse.eye_array(len(y), format="csc")
    # (x + y, x - y, 2) in the cone of order two: x y >= 1.
    of_y = [to_y + to_y2, -each, sparse.kron(each[:, used].T, np.array([[-1.0], [1.0], [0.0]]))]
    of_x = [
        (to_x + to_x2)[:, used],
        sparse.csc_array((len(y), m)),
        sparse.kron(sparse.eye_array(m), np.array([[-1.0], [-1.0], [0.0]])),
    ]
    solution = minimise(
        np.repeat([1.0, 0.0], [len(y), m]),
        sparse.hstack([sparse.vstack(of_y), sparse.vstack(of_x)]),
        np.concatenate([most + most2, -least / unit, np.tile([0.0, 0.0, 2.0], m)]),
        [NonnegativeConeT(len(a) + len(y)), *[SecondOrderConeT(3)] * m],
        threads=1,
    )
    found = solution.x[: len(y)] * unit
    return found if np.isfinite(found).all() else tau


def _tangents(
    interval: Ints, y: Array, plus: Array, minus: Array
) -> tuple[sparse.csc_array, sparse.csc_array, Array]:
    """Return plus / y - minus / y - y / 2, one interval a row, as (to_y) y + (to_x) x - most.

    The tangent of -1 / y at y0 is y / y0^2 - 2 / y0.
    """
    row, at, shape = np.arange(len(interval)), y[interval], (len(interval), len(y))
    to_y = sparse.csc_array((minus / at**2 - 0.5, (row, interval)), shape=shape)
    to_x = sparse.csc_array((plus, (row, interval)), shape=shape)
    return to_y, to_x, 2 * minus / at
