"""Messages about other placements of the part; README.md in this folder defines their keys."""

from __future__ import annotations

from typing import Literal

from kerfpath.studio._numbers import Message, Numbers

__all__ = ["LayoutMessage", "OutOfReach", "ReachMessage", "TryEntry"]


class OutOfReach(Message):
    """The nodes of a contour that the robot cannot reach."""

    name: str
    nodes: int
    out: list[int]


class ReachMessage(Message):
    """The nodes of each contour that the robot cannot reach at a placement."""

    type: Literal["reach"] = "reach"
    revision: int
    number: int
    middle: Numbers
    contours: list[OutOfReach]


class TryEntry(Message):
    """A placement that the search has tried."""

    number: int
    offsets: dict[str, float]
    status: str
    stage: str
    value: float | None
    bound: float | None
    estimate: float | None
    reason: str | None
    part: Numbers
    rest: Numbers


class LayoutMessage(Message):
    """The state of the search for the best placement."""

    type: Literal["layout"] = "layout"
    revision: int
    goal: str
    grid: bool
    unit: str
    best: list[TryEntry]
    tried: int
    feasible: int
    label: str
    done: int
    total: int
    state: Literal["running", "done", "stopped"]
    said: str
