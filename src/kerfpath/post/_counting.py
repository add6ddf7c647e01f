"""From which angle a joint counts: a description tells it only up to whole turns."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from kerfpath._arrays import Array
from kerfpath.robots import Robot

__all__ = ["offset_near"]


def offset_near(robot: Robot, makers_deg: ArrayLike) -> Array:
    """Return the joint offsets (6,) rad of a robot, each within half a turn of its maker's (deg).

    The geometry of an arm is the same whether joint 6 counts from -180 or from 180 deg; axes and
    turns that its controller is told are not.
    """
    # The least share less than half a turn: halves are rounded one way, whatever their last digit.
    makers = np.radians(np.asarray(makers_deg, dtype=float))
    off = robot.offset - makers
    return np.asarray(makers + off - 2 * np.pi * np.round(off / (2 * np.pi) - 1e-9))
