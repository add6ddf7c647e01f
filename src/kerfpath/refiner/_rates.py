"""What a motion is held to in time, as the audit measures it: finite differences at the nodes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kerfpath._arrays import Array, Ints
from kerfpath._told import told
from kerfpath.limits import Limits

__all__ = ["Rates"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Rates:
    """What the motion is held to, in time.

    Parameters
    ----------
    tau : (K-1,) s
        Time of each interval.
    limits : Limits
        What (5) and (6) hold it to.
    periodic : bool
        The last node is the first one again, and (6) holds across the seam.
    """

    tau: Array
    limits: Limits
    periodic: bool

    __repr__ = told

    @property
    def before(self) -> Ints:
        """Intervals that end at the nodes where (6) is tested, (M,)."""
        inner = np.arange(len(self.tau) - 1)
        return np.append(inner, len(self.tau) - 1) if self.periodic else inner

    @property
    def after(self) -> Ints:
        """Intervals that begin there, (M,)."""
        return np.asarray((self.before + 1) % len(self.tau))

    @property
    def span(self) -> Array:
        """Time over which the velocity changes there, (M,) s."""
        return np.asarray((self.tau[self.before] + self.tau[self.after]) / 2)

    def velocities(self, dq: Array) -> Array:
        """Return the joint velocities (K-1, n) rad/s of increments (K-1, n) rad."""
        return dq / self.tau[:, None]

    def accelerations(self, dq: Array) -> Array:
        """Return the joint accelerations (M, n) rad/s^2 of increments (K-1, n) rad."""
        v = self.velocities(dq)
        return (v[self.after] - v[self.before]) / self.span[:, None]

    def shares(self, dq: Array) -> tuple[Array, Array]:
        """Return the shares of the velocity limits (K-1, n) and the acceleration limits (M, n)."""
        fast = np.abs(self.velocities(dq)) / self.limits.velocity.usable
        return fast, np.abs(self.accelerations(dq)) / self.limits.acceleration.usable

    def excess(self, dq: Array) -> float:
        """Return the largest share of a limit that increments (K-1, n) rad ask for, less one."""
        fast, sharp = self.shares(dq)
        return float(max(fast.max(), sharp.max(initial=0.0))) - 1

    def lost(self, dq: Array) -> float:
        """Return what all intervals and nodes ask for beyond the limits, in shares of them."""
        return float(sum(np.maximum(s.max(axis=1) - 1, 0).sum() for s in self.shares(dq) if len(s)))
