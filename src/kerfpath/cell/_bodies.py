"""A body of a cell: a solid fixed in one frame of its chain."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from kerfpath._arrays import Array
from kerfpath._repr import short_repr
from kerfpath.cell._shapes import Shape

__all__ = ["Body", "Kind"]

Kind = Literal["robot", "head", "part", "fixture", "floor"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Body:
    """A solid fixed in one of the frames that the robot and its external axes move.

    Parameters
    ----------
    name : str
        Unique in the cell.
    shape : Shape
        In coordinates of the frame, m.
    frame : int
        0 the robot base, where all that stands still is; i the link that joint i moves. With
        external axes the frames that they carry come before, see `kerfpath.robots.CarriedChain`.
    kind : {"robot", "head", "part", "fixture", "floor"}
    approximate : bool
        The shape stands in for one that is not known, or is the hull around it.
    holds : bool
        The shape holds the real body whole. Where it need not, what is clear of it is not proved
        clear of the body.
    """

    name: str
    shape: Shape
    frame: int
    kind: Kind
    approximate: bool = False
    holds: bool = True

    __repr__ = short_repr

    @property
    def size(self) -> Array:
        """Edges (3,) m of the box around the shape, along the axes of its frame."""
        corners = self.shape.corners
        return np.asarray(np.ptp(corners, axis=0) + 2 * self.shape.radius)
