"""How the joints may move: limits as objects that say what they bound.

A rate limit bounds a time derivative of every joint. Between nodes at equal intervals the
derivative is a difference of as many orders, so that such a limit is a bound on a difference. The
share of it that may be used, eta, is applied here and nowhere else.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from kerfpath._arrays import Array, Ints, floats, freeze, positive, scalar
from kerfpath._repr import short_repr
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
        Largest size of the derivative (for a rail, m); infinity where there is none.
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
        """What of the bound may be used, (n,) rad/s^order."""
        return freeze(self.share * self.bound)

    def per_interval(self, dt: float) -> Array:
        """Return the bound (n,) rad on a difference between nodes that are dt s apart."""
        return freeze(self.share * self.bound * dt**self.order)


class VelocityLimit(RateLimit):
    """Bound on the velocity of each joint: on its increment from node to node (5)."""

    __slots__ = ()
    quantity = "velocity"
    eta = "eta_v"
    order = 1


class AccelerationLimit(RateLimit):
    """Bound on the acceleration of each joint: on the change of its increment at a node (6)."""

    __slots__ = ()
    quantity = "acceleration"
    eta = "eta_a"
    order = 2


class JerkLimit(RateLimit):
    """Bound on the jerk of each joint: on the change of the change of its increment."""

    __slots__ = ()
    quantity = "jerk"
    eta = "eta_j"
    order = 3


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TorqueLimit:
    """Bound on the torque of each joint, and the arm that says what it is.

    Held at the nodes, where (6) holds the acceleration: at node k between intervals of length
    t_k and t_{k+1}, where the joints are q_k, the velocity is the mean of those of both intervals
    and the acceleration their difference over (t_k + t_{k+1}) / 2. Of equal intervals these are the
    central differences. At the two ends of an open path nothing is held, as by (6).

    Parameters
    ----------
    bound : (n,) N m
    dynamics : ArmDynamics

    Raises
    ------
    InputError
        A bound that is not positive, or of another number of joints.
    """

    bound: Array
    dynamics: ArmDynamics

    __repr__ = short_repr
    quantity: ClassVar[str] = "torque"

    def __post_init__(self) -> None:
        n = len(self.dynamics.chain.axes)
        object.__setattr__(self, "bound", positive(self.bound, "torque", (n,)))

    def shares(self, q: Array, tau: Array, *, periodic: bool = False) -> Array:
        """Return the signed shares (M, n) of the bound that a motion asks for at its nodes.

        Parameters
        ----------
        q : (K, n) rad
            Joints, not wrapped.
        tau : (K-1,) s
            Time of each interval.
        periodic : bool
            Whether the last interval is followed by the first.
        """
        dq = np.diff(q, axis=0)
        v, a = rates_of(dq, tau, periodic=periodic)
        before, after = meetings(len(tau), periodic=periodic)
        middle = (v[before] + v[after]) / 2
        return freeze(self.dynamics.torque(q[after], middle, a) / self.bound)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Limits:
    """What bounds a motion in time, joint by joint.

    Parameters
    ----------
    velocity : VelocityLimit
    acceleration : AccelerationLimit
    torque : TorqueLimit, optional
        Held by the exact search and the refinement, as the acceleration at the nodes.
    jerk : JerkLimit, optional
        Held by the refinement: a search would have to know three steps back.
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
    ) -> Limits:
        """Return the limits of a robot, all finite, and the shares of them that may be used."""
        return cls(
            velocity=VelocityLimit(bound=positive(velocity, "velocity", (None,)), share=eta_v),
            acceleration=AccelerationLimit(
                bound=positive(acceleration, "acceleration", (None,)), share=eta_a
            ),
            torque=torque,
            jerk=jerk,
        )

    def require_joints(self, n: int) -> None:
        """Raise InputError unless each limit is one of n joints."""
        for limit in (self.velocity, self.acceleration, self.torque, self.jerk):
            if limit is not None and len(limit.bound) != n:
                raise InputError(f"{limit.quantity}: expected shape ({n}), got {limit.bound.shape}")

    def without_acceleration(self) -> Limits:
        """Return the limits on the velocity alone."""
        free = np.full(len(self.acceleration.bound), np.inf)
        return Limits(velocity=self.velocity, acceleration=AccelerationLimit(bound=free))


def meetings(intervals: int, *, periodic: bool = False) -> tuple[Ints, Ints]:
    """Return the intervals before and after each node where two meet, (M,) each.

    With `periodic` the last one is followed by the first.
    """
    before = np.arange(intervals if periodic and intervals > 1 else intervals - 1)
    return before, (before + 1) % intervals


def rates_of(dq: Array, tau: Array, *, periodic: bool = False) -> tuple[Array, Array]:
    """Return the velocities (K-1, n) and accelerations (M, n) of a motion in rad and s.

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
    """Return the jerks (J, n) between nodes of accelerations (M, n) at them, rad and s.

    Over each interval that both ends of have an acceleration: third differences over dt^3 where
    all intervals are alike. The arguments are as of `rates_of`.
    """
    _, after = meetings(len(tau), periodic=periodic)
    if periodic:
        return np.asarray((np.roll(a, -1, axis=0) - a) / tau[after, None])
    return np.asarray(np.diff(a, axis=0) / tau[after[:-1], None])
