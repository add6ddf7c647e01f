"""What a placement is worth, contour by contour, and what is better."""

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
"""Relative: by how much rounding may lift a value over its bound."""

Stage = Literal["reach", "stretch", "exact", "estimate", "proved", "planned"]
"""Tests on the grid: reach, stretch, exact; over continuous gamma: reach, estimate, and planned or
proved to be no better than another."""
Status = Literal["unreachable", "collision", "speed"]
"""Why a placement is infeasible."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ContourValue:
    """What a placement is worth for one contour, by its place in the job, its name and nodes.

    The value is in the unit of the goal; where only a part of the graph was searched, `at_least`
    was found on it. A speed has what binds it: the joint, from 1, the limit and the node.
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
    """Why a placement is infeasible, and in which contour, at which of its nodes.

    More `progress` is nearer to being feasible. The contour's place in the job, `index`, is known
    where a search found no path. It is `sure` unless there may be a plan all the same.
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
    """What is known of a placement, or of the worst of several (`place`).

    Parameters
    ----------
    stage : Stage
        The test that decided.
    bound, value : float, optional
        What the value cannot beat, and the value, exact on the grid or that of plans over
        continuous gamma: m/min of the slowest contour, least share of the asked speeds, or
        displacement (14); None where that is not known.
    estimate : float, optional
        About what the value is over continuous gamma; it may be better or worse.
    slowest : int, optional
        The stretch that the estimate is of, by its number.
    infeasibility : Infeasibility, optional
    contours : tuple of ContourValue
        Of the first placement.
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
        """Whether nothing forbids it, as far as is known."""
        return self.infeasibility is None

    @property
    def promise(self) -> float | None:
        """What it is worth as far as is known: its value, or else its bound, or its estimate."""
        known = (self.value, self.bound, self.estimate)
        return next((number for number in known if number is not None), None)

    @property
    def status(self) -> str:
        """Whether it is "feasible", or why not."""
        return "feasible" if self.infeasibility is None else self.infeasibility.status

    @classmethod
    def from_data(cls, data: object) -> PlacementValue:
        """Return the value that `dataclasses.asdict` made `data` of."""
        return _DATA.validate_python(data)

    def entry(self, *names: str) -> dict[str, object]:
        """Return some of what is known, with why it is infeasible, as JSON holds it."""
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
    """Return whether all that says that a placement is not the best is an estimate.

    For a displacement, too, where no motion was found along a stretch or by the value function; and
    with external axes wherever none was found along a course of theirs.
    """
    why = value.infeasibility
    return value.stage == "estimate" and (why is None or not why.sure)


def worst_of(goal: str, values: Sequence[float]) -> float:
    """Return the worst of some values."""
    return max(values) if goal == "motion" else min(values)


_DATA = TypeAdapter(PlacementValue)
