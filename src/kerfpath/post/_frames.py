"""Frames of several controllers: the world at axis 2, the flange, positions with three angles."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from kerfpath._arrays import Array, freeze
from kerfpath.post._program import Program
from kerfpath.robots import Robot

__all__ = ["Order", "controller_frames", "euler", "faceplate", "from_euler", "world"]

Order = Literal["xyz", "XYZ", "ZYX"]


def world(robot: Robot) -> Array:
    """Return the pose (4, 4) m of the controller's world, on axis 1 at the height of axis 2."""
    T = np.eye(4)
    T[2, 3] = robot.geometry["c1"]
    return freeze(np.asarray(robot.T_base_foot @ T))


def faceplate(robot: Robot) -> Array:
    """Return the pose (4, 4) m of the model's own flange in the robot's flange."""
    return freeze(np.asarray(np.linalg.inv(robot.T_end_flange), dtype=np.float64))


def controller_frames(program: Program) -> tuple[Array, Array]:
    """Return the poses (4, 4) m of part and tool in the controller's world and flange."""
    robot = program.robot
    part = np.linalg.inv(world(robot)) @ program.T_base_part
    tool = np.linalg.inv(faceplate(robot)) @ program.T_flange_tip
    return np.asarray(part), np.asarray(tool)


def euler(T: ArrayLike, order: Order) -> Array:
    """Return poses (K, 4, 4) m as X, Y, Z in mm and three angles in deg, (K, 6).

    The angles are about the axes of `order`, one after the other: fixed axes for small letters,
    axes turned by the angles before for capitals.
    """
    poses = np.asarray(T, dtype=np.float64).reshape(-1, 4, 4)
    turned = Rotation.from_matrix(poses[:, :3, :3])
    angles = turned.as_euler(order, degrees=True, suppress_warnings=True)
    return np.hstack([poses[:, :3, 3] * 1e3, angles])


def from_euler(values: ArrayLike, order: Order) -> Array:
    """Return poses (K, 4, 4) m from X, Y, Z in mm and three angles in deg, (K, 6); see `euler`."""
    rows = np.asarray(values, dtype=np.float64).reshape(-1, 6)
    T = np.tile(np.eye(4), (len(rows), 1, 1))
    T[:, :3, :3] = Rotation.from_euler(order, rows[:, 3:], degrees=True).as_matrix()
    T[:, :3, 3] = rows[:, :3] * 1e-3
    return freeze(T)
