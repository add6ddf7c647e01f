"""What the server says of maps beyond their reasons, see README.md beside this file."""

from __future__ import annotations

from typing import Literal

from kerfpath.studio._numbers import Message, Numbers

__all__ = ["ShadeLayer", "ShadeMessage", "ShadeName", "TechniqueMessage"]


class ShadeName(Message):
    """A quantity that the admitted poses of a map can be shaded by."""

    by: str
    words: str
    unit: str


class ShadeLayer(Message):
    """That quantity over the map of one posture."""

    posture: int
    values: str
    nearest: str | None = None


class ShadeMessage(Message):
    """A quantity at every admitted pose of a contour."""

    type: Literal["shade"] = "shade"
    revision: int
    contour: str
    graph: str
    by: str
    words: str
    unit: str
    low: float
    high: float
    beyond: bool
    layers: list[ShadeLayer]
    pairs: list[list[str]]


class TechniqueMessage(Message):
    """The course that another technique takes along a contour, and what it comes to."""

    type: Literal["technique"] = "technique"
    revision: int
    contour: str
    method: Literal["paper", "known"]
    s: Numbers
    gamma: Numbers
    posture: list[int]
    cost: float | None
    peak_velocity: Numbers
    peak_acceleration: Numbers
    statement: str
    notes: list[str]
