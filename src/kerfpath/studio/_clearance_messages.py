"""Messages about distances in the cell; README.md in this folder defines their keys."""

from __future__ import annotations

from typing import Literal

from kerfpath.studio._numbers import Message, Numbers

__all__ = ["ClearanceMessage"]


class ClearanceMessage(Message):
    """The nearest pair of bodies at each node of a plan."""

    type: Literal["clearance"] = "clearance"
    revision: int
    contour: str
    name: str
    distance: Numbers
    over: Numbers
    pair: list[int]
    pairs: list[list[str]]
