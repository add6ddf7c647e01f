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
        Name of the body, unique in the cell.
    shape : Shape
        Shape in coordinates of the frame, m.
    frame : int
        Index of the frame: 0 is the robot base, which does not move, i the link that joint i moves.
        With external axes, the frames that they carry come first, see
        `kerfpath.robots.CarriedChain`.
    kind : {"robot", "head", "part", "fixture", "floor"}
    approximate : bool
        Whether the shape replaces an unknown one, or is the hull around the real one.
    holds : bool
        Whether the shape encloses the real body. If not, clearance to the shape proves nothing
        about the body.
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
