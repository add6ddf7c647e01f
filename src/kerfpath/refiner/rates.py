"""Limits on the rates of a motion, as the audit measures them: finite differences at the nodes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from kerfpath.acceleration_table import OVER
from kerfpath.arrays import Array, Ints, short_repr
from kerfpath.limits import Limits, jerks_of, meetings, rates_of

DERIVATIVE_STEP = 1e-4
"""rad: central differences are exact to 1e-8 of the third derivative, rounding to 1e-11."""
STEEPEST = 100.0
"""1/rad: largest relative change of an acceleration limit with a joint that is one."""
LEAST_SHARE = 0.1
"""Least share of an acceleration limit that a linear model of it may fall to."""


class KeptShares(NamedTuple):
    """Shares of the usable limits that a motion may use, place by place.

    velocity : (K-1, n), in each interval; acceleration : (M, n), where two intervals meet.
    """

    velocity: Array
    acceleration: Array


class LinearAcceleration(NamedTuple):
    """Largest accelerations at nodes, as linear functions of changes of the free variables.

    limit : (M, n) rad/s^2, at no change; node : (M,) int; slope : (M, n, F), by its variables.
    """

    limit: Array
    node: Ints
    slope: Array

    def through(self, delta: Array) -> LinearAcceleration:
        """Return the limits, made after changes delta (K, F), with their values before them."""
        before = self.limit - (self.slope @ delta[self.node][..., None])[..., 0]
        return self._replace(limit=np.maximum(before, LEAST_SHARE * self.limit))


class LinearTorque(NamedTuple):
    """Shares of the torque limits at nodes, as linear functions of changes of gamma.

    share : (M, n), at no change; column : (3, M) int, the node before, the node and the one after;
    slope : (3, M, n) 1/rad, by their gamma.
    """

    share: Array
    column: Ints
    slope: Array

    def at(self, delta: Array) -> Array:
        """Return the shares (M, n) at changes of gamma (K,) rad."""
        return np.asarray(self.share + (self.slope * delta[self.column][..., None]).sum(axis=0))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RateLimits:
    """Limits of a motion on velocity, acceleration, torque and jerk.

    Parameters
    ----------
    tau : (K-1,) s
        Time of each interval.
    limits : Limits
        Limits of (5) and (6), and on torque and jerk if there are any.
    periodic : bool
        Whether the last node is the first one again, and (6) holds across the seam.
    kept : KeptShares, optional
        Lower shares of the limits in some places; None: all that may be used, everywhere.
    """

    tau: Array
    limits: Limits
    periodic: bool
    kept: KeptShares | None = None

    __repr__ = short_repr

    def part(self, first: int, last: int) -> RateLimits:
        """Return the limits of nodes `first` to `last`, both included, as an open motion."""
        kept = self.kept
        if kept is not None:
            kept = KeptShares(kept.velocity[first:last], kept.acceleration[first : last - 1])
        return replace(self, tau=self.tau[first:last], periodic=False, kept=kept)

    @property
    def meetings(self) -> tuple[Ints, Ints]:
        """Intervals that end, and that begin, at the nodes where (6) is tested, (M,) each."""
        return meetings(len(self.tau), periodic=self.periodic)

    def of(self, dq: Array) -> tuple[Array, Array]:
        """Return the velocities (K-1, n) and accelerations (M, n) of increments (K-1, n) rad."""
        return rates_of(dq, self.tau, periodic=self.periodic)

    def shares(self, q: Array) -> tuple[Array, Array]:
        """Return the shares of the limits at joints q (K, n) rad, not wrapped.

        They are those of the velocities (K-1, n) and of the accelerations (M, n).
        """
        v, a = (np.abs(rates) for rates in self.of(np.diff(q, axis=0)))
        return v / self.velocity, a / self.acceleration(q)

    @property
    def velocity(self) -> Array:
        """Largest velocities in each interval, (K-1, n) rad/s (a rail: m/s)."""
        share = np.ones(len(self.tau))[:, None] if self.kept is None else self.kept.velocity
        return np.asarray(share * self.limits.velocity.usable)

    def acceleration(self, q: Array) -> Array:
        """Return the largest accelerations where intervals meet, (M, n) rad/s^2 (a rail: m/s^2).

        q (K, n) rad are the joints, on which they may depend.
        """
        after = self.meetings[1]
        share = np.ones(len(after))[:, None] if self.kept is None else self.kept.acceleration
        return np.asarray(share * self.limits.acceleration.usable_at(q[after]))

    def linear_acceleration(self, q: Array, slope: Array) -> LinearAcceleration:
        """Return the largest accelerations as linear functions of the free variables.

        slope (K, n, F) is the derivative of the joints q (K, n) rad by them.
        """
        after, table = self.meetings[1], self.limits.acceleration.table
        at, limit, slopes = q[after], self.acceleration(q), np.zeros((len(after), *slope.shape[1:]))
        for joint in () if table is None else OVER:
            step = DERIVATIVE_STEP * (np.arange(q.shape[1]) == joint)
            ahead, behind = (self.limits.acceleration.at(at + sign * step) for sign in (1.0, -1.0))
            rise = (ahead - behind) / (2 * DERIVATIVE_STEP) / self.limits.acceleration.at(at)
            rise[np.abs(rise) > STEEPEST] = 0.0  # at the end of the table
            slopes += (limit * rise)[..., None] * slope[after, joint, None]
        return LinearAcceleration(limit, after, slopes)

    def torque_share(self, q: Array) -> Array:
        """Return the signed shares (M, n) of the torque limits at joints (K, n) rad; (0, n): none.

        M is the number of nodes where intervals meet.
        """
        if self.limits.torque is None:
            return np.empty((0, q.shape[1]))
        return self.limits.torque.shares(q, self.tau, periodic=self.periodic)

    def jerk_share(self, dq: Array) -> Array:
        """Return the signed shares (J, n) of the jerk limits of increments (K-1, n); (0, n): none.

        J is the number of intervals with another interval at both ends.
        """
        if self.limits.jerk is None:
            return np.empty((0, dq.shape[1]))
        jerk = jerks_of(self.of(dq)[1], self.tau, periodic=self.periodic)
        return np.asarray(jerk / self.limits.jerk.usable)

    def linear_torque(self, q: Array, slope: Array) -> LinearTorque | None:
        """Return the shares of torque limits as linear functions of gamma; None without limits.

        slope (K, n) is the derivative of the joints q (K, n) rad by gamma.
        """
        limit = self.limits.torque
        before, after = self.meetings
        if limit is None or not len(before):
            return None
        v, a = self.of(np.diff(q, axis=0))
        middle, b, c = (v[before] + v[after]) / 2, self.tau[before, None], self.tau[after, None]
        column = np.stack([before, after, after + 1])
        # Change of joints, velocities and accelerations at the node with each of the three nodes.
        moves = (
            (0.0, -1 / (2 * b), 2 / (b * (b + c))),
            (1.0, 1 / (2 * b) - 1 / (2 * c), -2 / (b * c)),
            (0.0, 1 / (2 * c), 2 / (c * (b + c))),
        )
        slopes = []
        for nodes, (at, speed, bend) in zip(column, moves, strict=True):
            step = DERIVATIVE_STEP * slope[nodes]
            ahead, behind = (
                limit.dynamics.torque(
                    q[after] + sign * at * step,
                    middle + sign * speed * step,
                    a + sign * bend * step,
                )
                for sign in (1.0, -1.0)
            )
            slopes.append((ahead - behind) / (2 * DERIVATIVE_STEP) / limit.bound)
        share = limit.dynamics.torque(q[after], middle, a) / limit.bound
        return LinearTorque(share, column, np.array(slopes))

    def excess(self, q: Array) -> float:
        """Return the largest share of a limit that joints (K, n) rad need, minus one."""
        return float(max(share.max(initial=0.0) for share in self._every_share(q))) - 1

    def lost(self, q: Array) -> float:
        """Return the sum over intervals and nodes of the excess over limits, in shares of them."""
        shares = [share for share in self._every_share(q) if len(share)]
        return float(sum(np.maximum(share.max(axis=1) - 1, 0).sum() for share in shares))

    def _every_share(self, q: Array) -> tuple[Array, Array, Array, Array]:
        """Return the absolute shares of all limits, one row for each place."""
        dq = np.diff(q, axis=0)
        torque, jerk = np.abs(self.torque_share(q)), np.abs(self.jerk_share(dq))
        return *self.shares(q), torque, jerk
