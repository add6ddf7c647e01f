"""Rows and cones of a convex program, collected block by block and handed to Clarabel."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import clarabel
import numpy as np
from scipy import sparse

from kerfpath.arrays import Array, Ints, short_repr
from kerfpath.limits import Limits, jerks_of, meetings, rates_of

# -----------------------------------------------------------------------------
# Limits on the rates of a motion, as the audit measures them: finite differences at the nodes.

DERIVATIVE_STEP = 1e-4
"""rad: central differences are exact to 1e-8 of the third derivative, rounding to 1e-11."""


class KeptShares(NamedTuple):
    """Shares of the usable limits that a motion may use, place by place.

    velocity : (K-1, n), in each interval; acceleration : (M, n), where two intervals meet.
    """

    velocity: Array
    acceleration: Array


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

    @property
    def meetings(self) -> tuple[Ints, Ints]:
        """Intervals that end, and that begin, at the nodes where (6) is tested, (M,) each."""
        return meetings(len(self.tau), periodic=self.periodic)

    def of(self, dq: Array) -> tuple[Array, Array]:
        """Return the velocities (K-1, n) and accelerations (M, n) of increments (K-1, n) rad."""
        return rates_of(dq, self.tau, periodic=self.periodic)

    def shares(self, dq: Array) -> tuple[Array, Array]:
        """Return the shares of the velocity limits (K-1, n) and the acceleration limits (M, n)."""
        v, a = (np.abs(rates) for rates in self.of(dq))
        return v / self.velocity, a / self.acceleration

    @property
    def velocity(self) -> Array:
        """Largest velocities in each interval, (K-1, n) rad/s (a rail: m/s)."""
        share = np.ones(len(self.tau))[:, None] if self.kept is None else self.kept.velocity
        return np.asarray(share * self.limits.velocity.usable)

    @property
    def acceleration(self) -> Array:
        """Largest accelerations where intervals meet, (M, n) rad/s^2 (a rail: m/s^2)."""
        share = (
            np.ones(len(self.meetings[0]))[:, None] if self.kept is None else self.kept.acceleration
        )
        return np.asarray(share * self.limits.acceleration.usable)

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
        return *self.shares(dq), torque, jerk


# -----------------------------------------------------------------------------
# Rows and cones of a convex program, collected block by block and handed to Clarabel.

Sparse = Any  # scipy's stubs tell csr from csc and array from matrix, which nothing here needs
SOLVED = (clarabel.SolverStatus.Solved, clarabel.SolverStatus.AlmostSolved)


class ConstraintRows:
    """The constraints of a program whose first `boxed` unknowns lie in [-1, 1]."""

    def __init__(self, boxed: int) -> None:
        self.variables = boxed
        self._flat: list[tuple[Sparse, Array]] = []
        self._cones: list[tuple[Sparse, Array, int]] = []

    def new(self, count: int) -> Sparse:
        """Add `count` free unknowns; return them as rows of the identity."""
        first, self.variables = self.variables, self.variables + count
        place = np.arange(count), np.arange(first, self.variables)
        return sparse.csr_array((np.ones(count), place), shape=(count, self.variables))

    def hold(self, slope: Sparse, bound: Array) -> None:
        """Add slope x <= bound."""
        self._flat.append((slope, bound))

    def at_most(self, value: Array, slope: Sparse, bound: Array | float) -> None:
        """Add value + slope x <= bound over boxed unknowns, without the rows that always hold."""
        kept = np.flatnonzero(value + span_of(slope) > bound)
        if len(kept):
            self.hold(slope[kept], (bound - value)[kept])

    def cone(self, slope: Sparse, value: Array, size: int) -> None:
        """Add cones: of each `size` rows of slope x + value, the first is >= the others' norm."""
        self._cones.append((slope, value, size))

    def solve(self, cost: Array, equal: Sparse | None) -> Array | None:
        """Minimise cost x subject to equal x = 0; None if the solver finds no optimum."""
        zero = [] if equal is None else [(equal, np.zeros(equal.shape[0]))]
        cones = [(-slope, value) for slope, value, _ in self._cones]
        blocks = [(wide(a, self.variables), b) for a, b in zero + self._flat + cones]
        kinds: list[Any] = [clarabel.ZeroConeT(len(b)) for _, b in zero]
        kinds.append(clarabel.NonnegativeConeT(sum(len(b) for _, b in self._flat)))
        for _, value, size in self._cones:
            kinds += [clarabel.SecondOrderConeT(size)] * (len(value) // size)
        settings = clarabel.DefaultSettings()
        settings.verbose = False
        solver = clarabel.DefaultSolver(
            sparse.csc_matrix((self.variables, self.variables)),
            np.pad(cost, (0, self.variables - len(cost))),
            sparse.csc_matrix(sparse.vstack([a for a, _ in blocks])),
            np.concatenate([b for _, b in blocks]),
            kinds,
            settings,
        )
        found = solver.solve()
        return np.array(found.x) if found.status in SOLVED else None


def span_of(rows: Sparse) -> Array:
    """Return the largest value (m,) of each row over unknowns in [-1, 1]."""
    row = np.repeat(np.arange(rows.shape[0]), np.diff(rows.indptr))
    return np.bincount(row, np.abs(rows.data), rows.shape[0]).astype(np.float64, copy=False)


def wide(rows: Sparse, variables: int) -> Sparse:
    """Return the rows over more unknowns, with zero coefficients for the added ones."""
    return sparse.csr_array((rows.data, rows.indices, rows.indptr), (rows.shape[0], variables))
