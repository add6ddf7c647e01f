"""Rounding errors of a motion that was read from a text, which widen the limits of the audit."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from kerfpath.arrays import Array, short_repr
from kerfpath.auditor.chain import chain_of
from kerfpath.plans import Plan

MOST_ROUNDED = 0.05
"""Largest share of a limit that rounding may explain; a text that needs more has too few digits."""
SINGULAR = 1e-9
"""Singular values below this share of the largest one are ignored."""
AXES = np.sqrt(5.0)
"""Factor for the errors of three angles, two of which are about the same axis at worst."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Rounding:
    """Rounding errors of a motion that was read from a text.

    Parameters
    ----------
    q : (K, n) rad
        Error of each joint at each node.
    time : (K-1,)
        Relative error of the time between nodes.
    """

    q: Array
    time: Array

    __repr__ = short_repr

    def of_velocity(self, dq: Array, dt: Array) -> Array:
        """Return error bounds (K-1, n) rad/s on velocities from increments dq in dt (K-1,) s."""
        steps = self.q[:-1] + self.q[1:]
        return np.asarray((steps + np.abs(dq) * self.time[:, None]) / dt[:, None])

    def of_acceleration(self, dq: Array, dt: Array) -> Array:
        """Return error bounds (K-2, n) rad/s^2 on accelerations; dq and dt (K-1,) s as above."""
        velocity = self.of_velocity(dq, dt)
        mean = ((dt[1:] + dt[:-1]) / 2)[:, None]
        change = np.abs(np.diff(dq / dt[:, None], axis=0))
        slip = np.maximum(self.time[1:], self.time[:-1])[:, None]
        return np.asarray((velocity[1:] + velocity[:-1] + change * slip) / mean)


def rounding_of(plan: Plan, point: float, angle: float, time: Array, *, jointed: bool) -> Rounding:
    """Return the rounding errors of a plan that was read from a text.

    The rounding of a pose changes the joints by the inverse Jacobian; the bound is that of the
    worst direction.

    Parameters
    ----------
    plan : Plan
    point, angle : float m, rad
        Half of the last digit of a coordinate and of an angle.
    time : (K-1,)
        Relative error of the time between nodes, from the digits of speeds.
    jointed : bool
        Whether the text has joints instead of poses; then `angle` is that of a joint.
    """
    n = plan.robot.arm.joints
    linear = np.array([unit == "m" for unit in plan.robot.units])
    own = np.where(linear, point, angle)
    if jointed:
        return Rounding(q=np.tile(own, (len(plan.q), 1)), time=time)
    chain = chain_of(plan.robot)
    chain = replace(chain, tip=chain.tip @ plan.T_flange_tip)
    tips, jacobian = chain.jacobian(plan.q)
    inverse = np.linalg.pinv(jacobian, rcond=SINGULAR)
    # The text has the external axes too, and the arm compensates for their rounding.
    carried = np.abs(inverse @ chain.twists(plan.q, tips[:, :3, 3])) @ own[n:]
    off = np.sqrt(3.0) * point * np.linalg.norm(inverse[..., :3], axis=-1)
    turned = AXES * angle * np.linalg.norm(inverse[..., 3:], axis=-1)
    external = np.tile(own[n:], (len(plan.q), 1))
    return Rounding(q=np.hstack([off + turned + carried, external]), time=time)
