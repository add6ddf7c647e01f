"""Messages about kept plans and Pareto sets; README.md in this folder defines their keys."""

from __future__ import annotations

from typing import Literal

from kerfpath.studio._messages import Cycle, EditEntry, PlanMessage
from kerfpath.studio._numbers import Message

__all__ = [
    "AxisEntry",
    "CandidateMessage",
    "FrontMessage",
    "KeptEntry",
    "KeptMessage",
    "PointEntry",
]


class KeptEntry(Message):
    """A job that is kept for comparison."""

    id: int
    name: str
    revision: int
    metric: str
    objective: str
    contours: list[str]
    cycle: Cycle | None
    settled: bool


class KeptMessage(Message):
    """The jobs that are kept for comparison."""

    type: Literal["kept"] = "kept"
    plans: list[KeptEntry]


class AxisEntry(Message):
    """A criterion of a Pareto set."""

    name: str
    words: str
    unit: str
    better: Literal["more", "less"]


class PointEntry(Message):
    """The criteria of a run of the planner, and the edits that make its plan the job's."""

    number: int
    values: list[float]
    best: bool
    edits: list[EditEntry] | None


class FrontMessage(Message):
    """The points of a contour's Pareto set that have been found so far."""

    type: Literal["front"] = "front"
    revision: int
    contour: str
    axes: list[AxisEntry]
    points: list[PointEntry]
    done: int
    total: int
    state: Literal["running", "done", "stopped"]


class CandidateMessage(Message):
    """The motion of a point of the Pareto set; it is not the plan of the job."""

    type: Literal["candidate"] = "candidate"
    contour: str
    number: int
    plan: PlanMessage
