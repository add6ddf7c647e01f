"""Frames of several controllers: the world at axis 2, the flange, angles about fixed axes."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from kerfpath._arrays import Array, freeze
from kerfpath.robots import Robot

__all__ = ["faceplate", "world", "xyzwpr"]


def world(robot: Robot) -> Array:
    """Return the pose (4, 4) m of the controller's world, on axis 1 at the height of axis 2."""
    T = np.eye(4)
    T[2, 3] = robot.geometry["c1"]
    return freeze(np.asarray(robot.T_base_foot @ T))


def faceplate(robot: Robot) -> Array:
    """Return the pose (4, 4) m of the model's own flange in the robot's flange."""
    return freeze(np.asarray(np.linalg.inv(robot.T_end_flange), dtype=np.float64))


def xyzwpr(T: Array) -> Array:
    """Return poses (K, 4, 4) m as X, Y, Z in mm and W, P, R in deg, (K, 6).

    The rotation is W about x, then P about y, then R about z, all axes fixed.
    """
    turned = Rotation.from_matrix(T[:, :3, :3])
    angles = turned.as_euler("xyz", degrees=True, suppress_warnings=True)
    return np.hstack([T[:, :3, 3] * 1e3, angles])
