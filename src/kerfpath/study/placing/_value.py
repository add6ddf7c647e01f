"""Values of placements, contour by contour, and their comparison."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Literal

from pydantic import TypeAdapter

from kerfpath._repr import short_repr

__all__ = [
    "SLACK",
    "ContourValue",
    "Infeasibility",
    "PlacementValue",
    "Stage",
    "Status",
    "is_better",
    "is_estimated",
    "worst_of",
]

SLACK = 1e-9
"""Relative amount by which rounding may lift a value above its bound."""

Stage = Literal["reach", "stretch", "exact", "estimate", "proved", "planned"]
"""Tests on the grid: reach, stretch, exact. Over continuous gamma: reach, estimate, and planned or
proved (to be no better than another placement)."""
Status = Literal["unreachable", "collision", "speed"]
"""Why a placement is infeasible."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ContourValue:
    """The value of a placement for one contour, given by its index in the job, name and nodes.

    The value is in the unit of the goal; if only a part of the graph was searched, `at_least` is
    the value found there. A speed comes with the joint (from 1), the limit and the node that limit
    it.
    """

    index: int
    name: str
    nodes: int
    value: float | None = None
    at_least: float | None = None
    fastest_m_min: float | None = None
    joint: int | None = None
    limit: Literal["velocity", "acceleration"] | None = None
    node: int | None = None

    __repr__ = short_repr


@dataclass(frozen=True, slots=True, kw_only=True)
class Infeasibility:
    """Why a placement is infeasible, in which contour and at which node.

    A larger `progress` is nearer to being feasible. The index of the contour in the job, `index`,
    is known where a search found no path. `sure` is false if there may still be a plan.
    """

    status: Status
    progress: float
    reason: str
    contour: str | None = None
    node: int | None = None
    nodes: int | None = None
    index: int | None = None
    sure: bool = True

    __repr__ = short_repr


@dataclass(frozen=True, slots=True, kw_only=True)
class PlacementValue:
    """The result for a placement, or for the worst of several.

    Parameters
    ----------
    stage : Stage
        The test that decided.
    bound, value : float, optional
        Bound on the value, and the value, exact on the grid or of plans over continuous gamma:
        m/min of the slowest contour, least ratio to the speeds asked for, or displacement (14).
        None where it is not known.
    estimate : float, optional
        Estimate of the value over continuous gamma; the value may be better or worse.
    slowest : int, optional
        Number of the stretch that the estimate comes from.
    infeasibility : Infeasibility, optional
    contours : tuple of ContourValue
        Values of the contours at the first placement.
    place : int
        Number of the worst placement.
    """

    stage: Stage
    bound: float | None = None
    value: float | None = None
    estimate: float | None = None
    slowest: int | None = None
    infeasibility: Infeasibility | None = None
    contours: tuple[ContourValue, ...] = ()
    place: int = 0

    __repr__ = short_repr

    @property
    def feasible(self) -> bool:
        """Whether the placement is feasible as far as is known."""
        return self.infeasibility is None

    @property
    def promise(self) -> float | None:
        """The best known figure: the value, or otherwise the bound, or the estimate."""
        known = (self.value, self.bound, self.estimate)
        return next((number for number in known if number is not None), None)

    @property
    def status(self) -> str:
        """The status of the infeasibility, or "feasible"."""
        return "feasible" if self.infeasibility is None else self.infeasibility.status

    @classmethod
    def from_data(cls, data: object) -> PlacementValue:
        """Return the value from the data that `dataclasses.asdict` made of it."""
        return _DATA.validate_python(data)

    def entry(self, *names: str) -> dict[str, object]:
        """Return the named fields that are known, also those of the infeasibility, for JSON."""
        known = {
            name: getattr(self, name) for name in ("status", "stage", "bound", "value", "estimate")
        }
        if self.infeasibility is not None:
            known |= {k: v for k, v in asdict(self.infeasibility).items() if v is not None}
        return {name: known[name] for name in names if name in known}


def is_better(goal: str, value: float, other: float | None) -> bool:
    """Return whether a value is better than another, by more than rounding."""
    if other is None:
        return True
    if goal == "motion":
        return value < other * (1 - SLACK)
    return value > other * (1 + SLACK)


def is_estimated(value: PlacementValue) -> bool:
    """Return whether only an estimate says that a placement is not the best.

    This includes displacements where no motion was found along a stretch or by the value function,
    and external axes where no motion was found along one of their courses.
    """
    why = value.infeasibility
    return value.stage == "estimate" and (why is None or not why.sure)


def worst_of(goal: str, values: Sequence[float]) -> float:
    """Return the worst of some values."""
    return max(values) if goal == "motion" else min(values)


_DATA = TypeAdapter(PlacementValue)
