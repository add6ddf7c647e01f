"""A body of a cell: a solid fixed in one frame of the robot."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from kerfpath._told import told
from kerfpath.cell._shapes import Shape

__all__ = ["Body", "Kind"]

Kind = Literal["robot", "head", "part", "fixture"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Body:
    """A solid fixed in one of the robot's frames.

    Parameters
    ----------
    name : str
        Unique in the cell.
    shape : Shape
        In coordinates of the frame, m.
    frame : int
        0 the robot base, where all that stands still is; i the link that joint i moves.
    kind : {"robot", "head", "part", "fixture"}
    approximate : bool
        The shape stands in for one that is not known, or is the hull around it.
    """

    name: str
    shape: Shape
    frame: int
    kind: Kind
    approximate: bool = False

    __repr__ = told
