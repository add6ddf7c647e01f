"""Limits on the motion of the joints: velocity, acceleration, jerk and torque.

A rate limit bounds a time derivative of every joint. Between nodes at equal intervals the
derivative is a difference of the same order, so that such a limit bounds a difference. The share of
a limit that may be used, eta, is applied here and nowhere else.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from kerfpath.acceleration_table import AccelerationTable
from kerfpath.arrays import Array, Ints, floats, freeze, positive, scalar, short_repr
from kerfpath.dynamics import ArmDynamics
from kerfpath.errors import InputError

__all__ = [
    "AccelerationLimit",
    "JerkLimit",
    "Limits",
    "RateLimit",
    "VelocityLimit",
    "meetings",
    "rates_of",
]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RateLimit:
    """Bound on a time derivative of each joint.

    Parameters
    ----------
    bound : (n,) rad/s^order
        Largest absolute value of the derivative (a rail: m/s^order); infinity for no limit.
    share : float
        Share of the bound that may be used, eta.

    Raises
    ------
    InputError
        NaN, a bound or a share that is not positive.
    """

    quantity: ClassVar[str]
    eta: ClassVar[str]
    order: ClassVar[int]

    bound: Array
    share: float = 1.0

    __repr__ = short_repr

    def __post_init__(self) -> None:
        bound = floats(self.bound, self.quantity, (None,), infinite=True)
        if not (bound > 0).all():
            raise InputError(f"{self.quantity}: must be positive, got {bound.tolist()}")
        object.__setattr__(self, "bound", bound)
        object.__setattr__(self, "share", scalar(self.share, self.eta, above=0.0))

    @property
    def usable(self) -> Array:
        """The usable part of the bound, share * bound, (n,) rad/s^order."""
        return freeze(self.share * self.bound)

    def per_interval(self, dt: float) -> Array:
        """Return the bound (n,) rad on a difference between nodes that are dt s apart."""
        return freeze(self.share * self.bound * dt**self.order)


class VelocityLimit(RateLimit):
    """Bound on the velocity of each joint, thus on its increment from node to node (5)."""

    __slots__ = ()
    quantity = "velocity"
    eta = "eta_v"
    order = 1


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class AccelerationLimit(RateLimit):
    """Bound on the acceleration of each joint, thus on the change of its increment (6).

    It may depend on the configuration. Then `bound`, and all that follows from it, is what holds
    at any configuration; `at` says how much more may be used where.

    Parameters
    ----------
    table : AccelerationTable, optional
        Bounds of some joints by configuration; they replace those of `bound`.

    Raises
    ------
    InputError
        As `RateLimit`, and a table for joints that there are not.
    """

    quantity = "acceleration"
    eta = "eta_a"
    order = 2

    table: AccelerationTable | None = None

    __repr__ = short_repr

    def __post_init__(self) -> None:
        RateLimit.__post_init__(self)
        if self.table is not None:
            self.table.require_arm(len(self.bound))
            object.__setattr__(self, "bound", self.table.into(self.bound, self.table.least))

    def at(self, q: Array) -> Array:
        """Return the bound at configurations q (..., n) rad; (n,) where it does not depend on q."""
        return self.bound if self.table is None else self.table.into(self.bound, self.table.at(q))

    def usable_at(self, q: Array) -> Array:
        """Return the usable part of the bound at q, shaped as by `at`."""
        return freeze(self.share * self.at(q))

    def most_per_interval(self, dt: float) -> Array:
        """Return a bound (n,) rad on the change of an increment that holds for any motion.

        It is the largest that any configuration allows, where `per_interval` is the smallest.
        """
        most = self.bound if self.table is None else self.table.into(self.bound, self.table.most)
        return freeze(self.share * most * dt**self.order)


class JerkLimit(RateLimit):
    """Bound on the jerk of each joint, thus on the third difference over four nodes."""

    __slots__ = ()
    quantity = "jerk"
    eta = "eta_j"
    order = 3


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TorqueLimit:
    """Bound on the torque of each joint, and the dynamics of the arm that give the torque.

    It holds at the nodes where (6) bounds the acceleration. At node k, between intervals of
    t_k and t_{k+1}, the joints are q_k, the velocity is the mean of those of both intervals, and
    the acceleration is their difference over (t_k + t_{k+1}) / 2. If the intervals are equal, these
    are the central differences. As with (6), nothing is bounded at the two ends of an open path.

    Parameters
    ----------
    bound : (n,) N m
        Largest torque of each joint.
    dynamics : ArmDynamics

    Raises
    ------
    InputError
        A bound that is not positive, or not for the number of joints of the arm.
    """

    bound: Array
    dynamics: ArmDynamics

    __repr__ = short_repr
    quantity: ClassVar[str] = "torque"

    def __post_init__(self) -> None:
        n = len(self.dynamics.chain.axes)
        object.__setattr__(self, "bound", positive(self.bound, "torque", (n,)))

    def shares(self, q: Array, tau: Array, *, periodic: bool = False) -> Array:
        """Return the torques of a motion as signed shares of the bound.

        Parameters
        ----------
        q : (K, n) rad
            Joints, not wrapped.
        tau : (K-1,) s
            Time of each interval.
        periodic : bool
            Whether the last interval is followed by the first.

        Returns
        -------
        shares : (M, n)
            At each node where two intervals meet, see `meetings`.
        """
        dq = np.diff(q, axis=0)
        v, a = rates_of(dq, tau, periodic=periodic)
        before, after = meetings(len(tau), periodic=periodic)
        middle = (v[before] + v[after]) / 2
        return freeze(self.dynamics.torque(q[after], middle, a) / self.bound)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Limits:
    """Limits on the velocity, acceleration, torque and jerk of each joint.

    Parameters
    ----------
    velocity : VelocityLimit
    acceleration : AccelerationLimit
    torque : TorqueLimit, optional
        The exact search and the refinement keep it at the nodes, as they do the acceleration.
    jerk : JerkLimit, optional
        Only the refinement keeps it: a search would have to remember the last three steps.
    """

    velocity: VelocityLimit
    acceleration: AccelerationLimit
    torque: TorqueLimit | None = None
    jerk: JerkLimit | None = None

    __repr__ = short_repr

    @classmethod
    def of(
        cls,
        velocity: ArrayLike,
        acceleration: ArrayLike,
        *,
        eta_v: float = 1.0,
        eta_a: float = 1.0,
        torque: TorqueLimit | None = None,
        jerk: JerkLimit | None = None,
        table: AccelerationTable | None = None,
    ) -> Limits:
        """Return the limits of a robot, with the shares of them that may be used.

        Parameters
        ----------
        velocity, acceleration : (n,) rad/s, rad/s^2
        eta_v, eta_a : float
            Share of the velocity and acceleration limits that may be used.
        torque : TorqueLimit, optional
        jerk : JerkLimit, optional
        table : AccelerationTable, optional
            Accelerations of some joints by configuration, which replace those of `acceleration`.

        Raises
        ------
        InputError
            A velocity, an acceleration or a share that is not positive or not finite.
        """
        return cls(
            velocity=VelocityLimit(bound=positive(velocity, "velocity", (None,)), share=eta_v),
            acceleration=AccelerationLimit(
                bound=positive(acceleration, "acceleration", (None,)), share=eta_a, table=table
            ),
            torque=torque,
            jerk=jerk,
        )

    def require_joints(self, n: int) -> None:
        """Raise InputError unless each limit is for n joints."""
        for limit in (self.velocity, self.acceleration, self.torque, self.jerk):
            if limit is not None and len(limit.bound) != n:
                raise InputError(f"{limit.quantity}: expected shape ({n}), got {limit.bound.shape}")

    def without_acceleration(self) -> Limits:
        """Return the velocity limit alone."""
        free = np.full(len(self.acceleration.bound), np.inf)
        return Limits(velocity=self.velocity, acceleration=AccelerationLimit(bound=free))


def meetings(intervals: int, *, periodic: bool = False) -> tuple[Ints, Ints]:
    """Return the intervals before and after each node where two intervals meet, (M,) each.

    If `periodic`, the last interval is followed by the first.
    """
    before = np.arange(intervals if periodic and intervals > 1 else intervals - 1)
    return before, (before + 1) % intervals


def rates_of(dq: Array, tau: Array, *, periodic: bool = False) -> tuple[Array, Array]:
    """Return the velocities (K-1, n) rad/s and accelerations (M, n) rad/s^2 of a motion.

    Parameters
    ----------
    dq : (K-1, n) rad
        Joint increments.
    tau : (K-1,) s
        Time of each interval.
    periodic : bool
        Whether the last interval is followed by the first.
    """
    v, (before, after) = dq / tau[:, None], meetings(len(tau), periodic=periodic)
    span = (tau[before] + tau[after]) / 2
    return v, (v[after] - v[before]) / span[:, None]


def jerks_of(a: Array, tau: Array, *, periodic: bool = False) -> Array:
    """Return the jerks (J, n) rad/s^3 between nodes from the accelerations (M, n) rad/s^2 at them.

    There is one for each interval with an acceleration at both ends. If all intervals are equal,
    the jerks are third differences over dt^3. `tau` and `periodic` are as in `rates_of`.
    """
    _, after = meetings(len(tau), periodic=periodic)
    if periodic:
        return np.asarray((np.roll(a, -1, axis=0) - a) / tau[after, None])
    return np.asarray(np.diff(a, axis=0) / tau[after[:-1], None])
