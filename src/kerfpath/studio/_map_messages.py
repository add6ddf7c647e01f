"""Messages about shades and techniques on maps; README.md in this folder defines their keys."""

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
    """The values of a quantity over the map of one posture."""

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
    """The course of another technique along a contour, with its cost and peak shares."""

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
