"""How the joints may move: limits as objects that say what they bound.

A limit bounds a time derivative of every joint. Between nodes at equal intervals the derivative is
a difference of as many orders, so that a limit is a bound on a difference. The share of it that may
be used, eta, is applied here and nowhere else.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from kerfpath._arrays import Array, Ints, floats, freeze, positive, scalar
from kerfpath._repr import short_repr
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
class Limits:
    """What bounds a motion in time, joint by joint.

    Parameters
    ----------
    velocity : VelocityLimit
    acceleration : AccelerationLimit
    """

    velocity: VelocityLimit
    acceleration: AccelerationLimit

    __repr__ = short_repr

    @classmethod
    def of(
        cls,
        velocity: ArrayLike,
        acceleration: ArrayLike,
        *,
        eta_v: float = 1.0,
        eta_a: float = 1.0,
    ) -> Limits:
        """Return the limits of a robot, all finite, and the shares of them that may be used."""
        return cls(
            velocity=VelocityLimit(bound=positive(velocity, "velocity", (None,)), share=eta_v),
            acceleration=AccelerationLimit(
                bound=positive(acceleration, "acceleration", (None,)), share=eta_a
            ),
        )

    def require_joints(self, n: int) -> None:
        """Raise InputError unless each limit is one of n joints."""
        for limit in (self.velocity, self.acceleration):
            if len(limit.bound) != n:
                raise InputError(f"{limit.quantity}: expected shape ({n}), got {limit.bound.shape}")

    def without_acceleration(self) -> Limits:
        """Return the limits with none on the acceleration."""
        free = np.full(len(self.acceleration.bound), np.inf)
        return replace(self, acceleration=AccelerationLimit(bound=free))


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
