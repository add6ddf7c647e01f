"""Where controllers that count from the height of axis 2 have their world, and their flange."""

from __future__ import annotations

import numpy as np

from kerfpath._arrays import Array, freeze
from kerfpath.robots import Robot

__all__ = ["faceplate", "world"]


def world(robot: Robot) -> Array:
    """Return the pose (4, 4) m of the controller's world, on axis 1 at the height of axis 2."""
    T = np.eye(4)
    T[2, 3] = robot.geometry["c1"]
    return freeze(np.asarray(robot.T_base_foot @ T))


def faceplate(robot: Robot) -> Array:
    """Return the pose (4, 4) m of the model's own flange in the robot's flange."""
    return freeze(np.asarray(np.linalg.inv(robot.T_end_flange), dtype=np.float64))
