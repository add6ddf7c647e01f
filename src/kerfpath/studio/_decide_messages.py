"""What the server says for one to decide by, see README.md beside this file."""

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
    """A job that is kept to be compared."""

    id: int
    name: str
    revision: int
    metric: str
    objective: str
    contours: list[str]
    cycle: Cycle | None
    settled: bool


class KeptMessage(Message):
    """The jobs that are kept to be compared."""

    type: Literal["kept"] = "kept"
    plans: list[KeptEntry]


class AxisEntry(Message):
    """A criterion of a Pareto set."""

    name: str
    words: str
    unit: str
    better: Literal["more", "less"]


class PointEntry(Message):
    """A run of the planner, in the criteria; and what makes its plan the job's."""

    number: int
    values: list[float]
    best: bool
    edits: list[EditEntry] | None


class FrontMessage(Message):
    """The Pareto set of a contour, as far as it is found."""

    type: Literal["front"] = "front"
    revision: int
    contour: str
    axes: list[AxisEntry]
    points: list[PointEntry]
    done: int
    total: int
    state: Literal["running", "done", "stopped"]


class CandidateMessage(Message):
    """The motion of a point of the Pareto set, which is not the job's."""

    type: Literal["candidate"] = "candidate"
    contour: str
    number: int
    plan: PlanMessage
