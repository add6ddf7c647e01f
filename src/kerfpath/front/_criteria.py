"""The criteria that plans are compared by, by name."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kerfpath._arrays import Array, freeze
from kerfpath.comfort import MEASURES
from kerfpath.errors import InputError
from kerfpath.plans import Plan
from kerfpath.robots import Robot

__all__ = ["Criterion", "criteria_of", "losses"]

PER_JOINT = {"displacement": "displacement", "increment": "largest_increment", "range": "range"}
"""Criteria (7) to (9) of one joint, and what `kerfpath.plans.Criteria` calls them."""
TOGETHER = ("displacement", "range", "velocity", "acceleration")


@dataclass(frozen=True, slots=True, kw_only=True)
class Criterion:
    """One criterion.

    Parameters
    ----------
    kind : str
        "displacement", "increment", "range", "velocity", "acceleration" or a comfort measure.
    joint : int, optional
        The joint it is of, 0-based; None: of all joints together.
    unit : str
    """

    kind: str
    joint: int | None
    unit: str

    @property
    def sense(self) -> float:
        """1 where less is better, -1 where more is."""
        return -1.0 if self.kind in MEASURES else 1.0

    def of(self, plan: Plan) -> float:
        """Return its value for a plan, in `unit`."""
        found = plan.criteria
        if self.kind in MEASURES:
            return found.nearest[self.kind][0]
        if self.kind in ("velocity", "acceleration"):
            return float(getattr(found, f"peak_{self.kind}").max())
        values: Array = getattr(found, PER_JOINT[self.kind])
        if self.joint is not None:
            return float(values[self.joint])
        return float((values / plan.robot.speed_limits()[0]).sum())


def criteria_of(names: Sequence[str], robot: Robot) -> tuple[Criterion, ...]:
    """Return the criteria of these names.

    Raises
    ------
    InputError
        An unknown name, a joint that the robot does not have, a name given twice, or none.
    """
    if isinstance(names, str) or not names or len(set(names)) != len(names):
        raise InputError(f"criteria: expected different names, at least one, got {names!r}")
    return tuple(_criterion(name, robot) for name in names)


def _criterion(name: str, robot: Robot) -> Criterion:
    kind, _, number = str(name).rpartition("_")
    if kind in PER_JOINT and number in map(str, range(1, robot.joints + 1)):
        joint = int(number) - 1
        unit = robot.external.unit if robot.external and joint == robot.joints - 1 else "rad"
        return Criterion(kind=kind, joint=joint, unit=unit)
    if name in MEASURES:
        return Criterion(kind=name, joint=None, unit=MEASURES[name].unit)
    if name in TOGETHER:
        share = name in ("velocity", "acceleration")
        return Criterion(kind=name, joint=None, unit="share" if share else "s")
    raise InputError(
        f"criteria: expected some of {', '.join((*TOGETHER, *MEASURES))}, or "
        f"{', '.join(f'{kind}_J' for kind in PER_JOINT)} of a joint J from 1 to {robot.joints}, "
        f"got {name!r}"
    )


def losses(plan: Plan, criteria: Sequence[Criterion]) -> Array:
    """Return the criteria (C,) of a plan, with signs by which less is better."""
    return freeze(np.array([criterion.sense * criterion.of(plan) for criterion in criteria]))
