"""What the digits of a text add to the rates of a motion: a bounded share that the audit states."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from kerfpath._arrays import Array
from kerfpath._repr import short_repr
from kerfpath.auditor._chain import chain_of
from kerfpath.plans import Plan

__all__ = ["MOST_ROUNDED", "Rounding", "rounding_of"]

MOST_ROUNDED = 0.05
"""Share of a limit that digits may explain at most; a text that needs more has too few of them."""
SINGULAR = 1e-9
"""Singular values below it, relative to the largest, do not turn digits into joints."""
AXES = np.sqrt(5.0)
"""Most that errors of three angles, two of them about one axis at worst, come to together."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Rounding:
    """How far a motion that was read from a text may be from the one that was written.

    Parameters
    ----------
    q : (K, n) rad
        Of the joints at each node.
    time : (K-1,)
        Of the time between nodes, as a share.
    """

    q: Array
    time: Array

    __repr__ = short_repr

    def of_velocity(self, dq: Array, dt: Array) -> Array:
        """Return the bound (K-1, n) rad/s on joint velocities from increments dq in dt (K-1,) s."""
        steps = self.q[:-1] + self.q[1:]
        return np.asarray((steps + np.abs(dq) * self.time[:, None]) / dt[:, None])

    def of_acceleration(self, dq: Array, dt: Array) -> Array:
        """Return the bound (K-2, n) rad/s^2 on accelerations from increments dq in dt (K-1,) s."""
        velocity = self.of_velocity(dq, dt)
        mean = ((dt[1:] + dt[:-1]) / 2)[:, None]
        change = np.abs(np.diff(dq / dt[:, None], axis=0))
        slip = np.maximum(self.time[1:], self.time[:-1])[:, None]
        return np.asarray((velocity[1:] + velocity[:-1] + change * slip) / mean)


def rounding_of(plan: Plan, point: float, angle: float, time: Array, *, jointed: bool) -> Rounding:
    """Return what digits leave of the joints of a plan that was read from a text.

    A pose that is off by its last digits is reached by joints that are off by them through the
    inverse Jacobian; the bound is that of the worst direction.

    Parameters
    ----------
    plan : Plan
    point, angle : float m, rad
        Half of the last digit of a coordinate and of an angle.
    time : (K-1,)
        What the digits of speeds leave of the time between nodes, as a share.
    jointed : bool
        The text says joints, not poses: `angle` is that of a joint.
    """
    arm = plan.robot.family.joints
    linear = np.array([unit == "m" for unit in plan.robot.units])
    own = np.where(linear, point, angle)
    if jointed:
        return Rounding(q=np.tile(own, (len(plan.q), 1)), time=time)
    chain = chain_of(plan.robot)
    chain = replace(chain, tip=chain.tip @ plan.T_flange_tip)
    tips, jacobian = chain.jacobian(plan.q)
    inverse = np.linalg.pinv(jacobian, rcond=SINGULAR)
    # The text says where external axes are, and the arm makes up for those digits, too.
    carried = np.abs(inverse @ chain.twists(plan.q, tips[:, :3, 3])) @ own[arm:]
    off = np.sqrt(3.0) * point * np.linalg.norm(inverse[..., :3], axis=-1)
    turned = AXES * angle * np.linalg.norm(inverse[..., 3:], axis=-1)
    external = np.tile(own[arm:], (len(plan.q), 1))
    return Rounding(q=np.hstack([off + turned + carried, external]), time=time)
