"""The criteria that plans are compared by, by name."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from kerfpath._arrays import Array, floats, freeze
from kerfpath._told import told
from kerfpath.air import least_time
from kerfpath.cell import Cell
from kerfpath.comfort import MEASURES, Comfort
from kerfpath.errors import InputError
from kerfpath.front._clearance import clearance, counted
from kerfpath.kernels.metric import increments
from kerfpath.plans import Criteria, Plan
from kerfpath.robots import Robot

__all__ = ["Criterion", "Judge", "judge_of"]

PER_JOINT = {"displacement": "displacement", "increment": "largest_increment", "range": "range"}
"""Criteria (7) to (9) of one joint, and what `kerfpath.plans.Criteria` calls them."""
TOGETHER = {
    "displacement": "s",
    "range": "s",
    "velocity": "share",
    "acceleration": "share",
    "speed": "m/s",
    "time": "s",
    "clearance": "m",
}
"""Criteria of all joints together, and their units."""
DIGITS = 12
"""Of a criterion that count."""
MORE = ("speed", "clearance", *MEASURES)
"""Criteria that are better the more they are."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Criterion:
    """One criterion.

    Parameters
    ----------
    name : str
        As `pareto` takes it.
    kind : str
        The name, without its joint.
    joint : int, optional
        The joint it is of, 0-based; None: of all joints together.
    unit : str
    """

    name: str
    kind: str
    joint: int | None
    unit: str

    __repr__ = told

    @property
    def sense(self) -> float:
        """1 where less is better, -1 where more is."""
        return -1.0 if self.kind in MORE else 1.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Judge:
    """What plans are judged by: the criteria, and what some of them need beyond the plan.

    Parameters
    ----------
    criteria : tuple of Criterion
    eta_v, eta_a : float
        Shares of the limits within which a plan could be sped up.
    cell : Cell, optional
    home : (n,) rad, optional
    """

    criteria: tuple[Criterion, ...]
    eta_v: float
    eta_a: float
    cell: Cell | None
    home: Array | None

    __repr__ = told

    def losses(self, plan: Plan) -> Array:
        """Return the criteria (C,) of a plan, with signs by which less is better.

        To so many digits that the same motion found twice, its sums rounded otherwise, is one.
        """
        found = plan.criteria
        values = [c.sense * self._value(c, plan, found) for c in self.criteria]
        return freeze(np.array([float(f"{value:.{DIGITS}g}") for value in values]))

    def _value(self, criterion: Criterion, plan: Plan, found: Criteria) -> float:
        kind = criterion.kind
        if kind in MEASURES:
            return found.nearest[kind][0]
        if kind in ("velocity", "acceleration"):
            return float(getattr(found, f"peak_{kind}").max())
        if kind == "speed":
            faster = [self.eta_v / found.peak_velocity.max()]
            if (sharpest := found.peak_acceleration.max()) > 0:
                faster.append(np.sqrt(self.eta_a / sharpest))
            return plan.contour.length / float(plan.time[-1]) * float(min(faster))
        if kind == "time":
            assert self.home is not None
            return _cycle(plan, self.home)
        if kind == "clearance":
            assert self.cell is not None
            return clearance(plan, self.cell)
        values: Array = getattr(found, PER_JOINT[kind])
        if criterion.joint is not None:
            return float(values[criterion.joint])
        return float((values / plan.robot.speed_limits()[0]).sum())


def _cycle(plan: Plan, home: Array) -> float:
    """Return the time from home along a plan and back, s: straight joint motions, full limits."""
    ends = np.stack([home, plan.q[0]]), np.stack([plan.q[-1], home])
    ways = np.vstack([increments(pair, plan.robot.endless) for pair in ends])
    return float(plan.time[-1] + least_time(ways, *plan.robot.speed_limits()).sum())


def judge_of(
    names: Sequence[str],
    robot: Robot,
    *,
    eta_v: float,
    eta_a: float,
    cell: Cell | None,
    comfort: Comfort | None,
    home: ArrayLike | None,
) -> Judge:
    """Return who judges by the criteria of these names.

    Raises
    ------
    InputError
        An unknown name, a joint that the robot does not have, a name given twice, or none; a
        clearance without a cell or beside one in `comfort`, a time without home.
    """
    if isinstance(names, str) or not names or len(set(names)) != len(names):
        raise InputError(f"criteria: expected different names, at least one, got {names!r}")
    needs: dict[str, Any] = {"clearance": ("a cell", cell), "time": ("home", home)}
    for name, (what, given) in needs.items():
        if name in names and given is None:
            raise InputError(f"criteria: {name!r} needs {what}; give it, or leave {name!r} out")
    if "clearance" in names:
        if cell is not None and not counted(cell).any():
            raise InputError(
                "criteria: 'clearance' needs a part or fixtures in the cell without near-miss "
                "distances of their own, and it has none"
            )
        if comfort is not None and comfort.clearance is not None:
            raise InputError(
                "criteria: 'clearance' is a cost of comfort already; leave one of the two out"
            )
    return Judge(
        criteria=tuple(_criterion(name, robot) for name in names),
        eta_v=eta_v,
        eta_a=eta_a,
        cell=cell,
        home=None if home is None else floats(home, "home", (robot.joints,)),
    )


def _criterion(name: str, robot: Robot) -> Criterion:
    kind, _, number = str(name).rpartition("_")
    if kind in PER_JOINT and number in map(str, range(1, robot.joints + 1)):
        joint = int(number) - 1
        unit = robot.external.unit if robot.external and joint == robot.joints - 1 else "rad"
        return Criterion(name=name, kind=kind, joint=joint, unit=unit)
    if name in MEASURES:
        return Criterion(name=name, kind=name, joint=None, unit=MEASURES[name].unit)
    if name in TOGETHER:
        return Criterion(name=name, kind=name, joint=None, unit=TOGETHER[name])
    raise InputError(
        f"criteria: expected some of {', '.join((*TOGETHER, *MEASURES))}, or "
        f"{', '.join(f'{kind}_J' for kind in PER_JOINT)} of a joint J from 1 to {robot.joints}, "
        f"got {name!r}"
    )
