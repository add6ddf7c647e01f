"""What a motion is held to in time, as the audit measures it: finite differences at the nodes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from kerfpath._arrays import Array, Ints
from kerfpath._repr import short_repr
from kerfpath.limits import Limits, meetings, rates_of

__all__ = ["KeptShares", "RateLimits"]


class KeptShares(NamedTuple):
    """How much of what may be used of the limits a motion is to use, place by place.

    velocity : (K-1, n), in each interval; acceleration : (M, n), where two intervals meet.
    """

    velocity: Array
    acceleration: Array


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RateLimits:
    """What the motion is held to, in time.

    Parameters
    ----------
    tau : (K-1,) s
        Time of each interval.
    limits : Limits
        What (5) and (6) hold it to.
    periodic : bool
        The last node is the first one again, and (6) holds across the seam.
    kept : KeptShares, optional
        Less of the limits here and there; None: all that may be used, everywhere.
    """

    tau: Array
    limits: Limits
    periodic: bool
    kept: KeptShares | None = None

    __repr__ = short_repr

    @property
    def meetings(self) -> tuple[Ints, Ints]:
        """Intervals that end and that begin at the nodes where (6) is tested, (M,) each."""
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
        """What the velocities may be in each interval, (K-1, n) rad/s or its like."""
        share = np.ones(len(self.tau))[:, None] if self.kept is None else self.kept.velocity
        return np.asarray(share * self.limits.velocity.usable)

    @property
    def acceleration(self) -> Array:
        """What the accelerations may be where intervals meet, (M, n) rad/s^2."""
        share = (
            np.ones(len(self.meetings[0]))[:, None] if self.kept is None else self.kept.acceleration
        )
        return np.asarray(share * self.limits.acceleration.usable)

    def excess(self, dq: Array) -> float:
        """Return the largest share of a limit that increments (K-1, n) rad ask for, less one."""
        fast, sharp = self.shares(dq)
        return float(max(fast.max(), sharp.max(initial=0.0))) - 1

    def lost(self, dq: Array) -> float:
        """Return what all intervals and nodes ask for beyond the limits, in shares of them."""
        return float(sum(np.maximum(s.max(axis=1) - 1, 0).sum() for s in self.shares(dq) if len(s)))
