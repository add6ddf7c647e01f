"""The result of an audit: the table of checks, and the issues among them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from kerfpath.arrays import Array, short_repr
from kerfpath.auditor.chain import chain_of
from kerfpath.plans import Plan

# -----------------------------------------------------------------------------
# Rounding errors of a motion that was read from a text, which widen the limits of the audit.

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
    arm = plan.robot.family.joints
    linear = np.array([unit == "m" for unit in plan.robot.units])
    own = np.where(linear, point, angle)
    if jointed:
        return Rounding(q=np.tile(own, (len(plan.q), 1)), time=time)
    chain = chain_of(plan.robot)
    chain = replace(chain, tip=chain.tip @ plan.T_flange_tip)
    tips, jacobian = chain.jacobian(plan.q)
    inverse = np.linalg.pinv(jacobian, rcond=SINGULAR)
    # The text has the external axes too, and the arm compensates for their rounding.
    carried = np.abs(inverse @ chain.twists(plan.q, tips[:, :3, 3])) @ own[arm:]
    off = np.sqrt(3.0) * point * np.linalg.norm(inverse[..., :3], axis=-1)
    turned = AXES * angle * np.linalg.norm(inverse[..., 3:], axis=-1)
    external = np.tile(own[arm:], (len(plan.q), 1))
    return Rounding(q=np.hstack([off + turned + carried, external]), time=time)


# -----------------------------------------------------------------------------
# The result of an audit: the table of checks, and the issues among them.

Unit = Literal["m", "rad", "m^3", "s", "share", "count"]
Level = Literal["error", "warning"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Check:
    """One line of the audit's table.

    Parameters
    ----------
    code : str
        Stable name of the check, such as "tip-at-nodes".
    title : str
        The checked quantity in words.
    value, limit : float
        Worst value found and allowed value, in `unit`.
    unit : {"m", "rad", "m^3", "s", "share", "count"}
    node : int
        Node of the worst value (for a check between nodes: the node before it).
    level : {"error", "warning"}
        Severity of a failure.
    advice : str
        What to do about a failure.
    """

    code: str
    title: str
    value: float
    limit: float
    unit: Unit
    node: int
    level: Level = "error"
    advice: str = ""

    __repr__ = short_repr

    @property
    def ok(self) -> bool:
        """Whether the value keeps the limit; False for NaN."""
        return self.value <= self.limit

    def issue(self) -> Issue:
        """Return the issue for a failure of this check."""
        message = (
            f"{self.title}: {format_value(self.value, self.unit)} at node {self.node}, "
            f"allowed {format_value(self.limit, self.unit)}"
        )
        if self.advice:
            message += f"; {self.advice}"
        return Issue(level=self.level, code=self.code, message=message, node=self.node)


@dataclass(frozen=True, slots=True, kw_only=True)
class Issue:
    """A failed check: its severity, its code, what was found, and at which node."""

    level: Level
    code: str
    message: str
    node: int

    __repr__ = short_repr

    def __str__(self) -> str:
        return f"{self.level}: {self.message} [{self.code}]"


def worst_of(tables: Iterable[Iterable[Check]]) -> list[Check]:
    """Return the worst row of each check over several tables; its node is the table's number."""
    worst: dict[str, Check] = {}
    for number, table in enumerate(tables):
        for check in table:
            known = worst.get(check.code)
            if known is None or not check.value <= known.value:
                worst[check.code] = replace(check, node=number)
    return list(worst.values())


def format_value(value: float, unit: Unit) -> str:
    """Return a value with its unit for display: mm, degrees, per cent or a number."""
    if unit == "m":
        return f"{value * 1e3:.4g} mm"
    if unit == "rad":
        return f"{np.degrees(value):.4g} deg"
    if unit == "s":
        return f"{value:.4g} s"
    if unit == "m^3":
        return f"{value:.4g} m^3"
    return f"{value * 100:.4g} %" if unit == "share" else f"{value:g}"
