"""The frames of a robot's links in bulk, and how far the points of a body are from its joints."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kerfpath._arrays import Array
from kerfpath.errors import InputError
from kerfpath.robots import Robot

__all__ = ["Chain", "chain_of"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Chain:
    """Revolute joints one after the other; frame 0 is the base, frame i turns with joint i.

    Parameters
    ----------
    origins : (n, 4, 4)
        Pose of each joint frame at angle zero, in the frame of the joint before it, m.
    axes : (n, 3)
        Unit axis of each joint in its own frame.
    flange : (4, 4)
        Flange in the last frame, m.
    """

    origins: Array
    axes: Array
    flange: Array

    def frames(self, q: Array) -> Array:
        """Return the poses (B, n+1, 4, 4) in the base of all frames of joint vectors q (B, n)."""
        B, n = q.shape
        T = np.zeros((B, n + 1, 4, 4))
        T[:, 0] = np.eye(4)
        for i in range(n):
            T[:, i + 1] = T[:, i] @ (self.origins[i] @ _turns(self.axes[i], q[:, i]))
        return T

    def reach(self, frame: int, points: Array) -> Array:
        """Return bounds (n,) m on the distance of any of points (c, 3) from each joint's axis.

        They hold at every q: the links between stretched out, or zero for joints that do not move
        the frame.
        """
        arms = np.zeros(len(self.axes))
        length = float(np.linalg.norm(points, axis=1).max())
        for i in range(frame - 1, -1, -1):
            arms[i] = length
            length += float(np.linalg.norm(self.origins[i][:3, 3]))
        return arms


def chain_of(robot: Robot) -> Chain:
    """Return the chain of an OPW robot (Brandstoetter, Angerer and Hofbaur 2014, figure 1).

    Raises
    ------
    InputError
        Another family of arm, or one that stands or ends elsewhere than the model: where its links
        are is not known here.
    """
    if robot.external is not None:
        raise InputError(
            f"robot {robot.id!r}: a cell does not know how a {robot.external.kind} moves in it"
        )
    placed = (robot.T_base_foot, robot.T_end_flange)
    if robot.kinematics != "opw" or not all(np.array_equal(T, np.eye(4)) for T in placed):
        raise InputError(
            f"robot {robot.id!r}: a cell knows the links of ortho-parallel arms of the library so "
            f"far, got {robot.family.words}"
            + ("" if robot.kinematics != "opw" else " from a description")
        )
    g = robot.geometry
    y, z = (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
    shoulder, elbow = (g["a1"], g["b"], g["c1"]), (0.0, 0.0, g["c2"])
    wrist, here = (g["a2"], 0.0, g["c3"]), (0.0, 0.0, 0.0)
    axes = np.array([z, y, y, z, y, z])
    origins = np.tile(np.eye(4), (6, 1, 1))
    for i, place in enumerate((here, shoulder, elbow, wrist, here, here)):
        # q_model = sign q - offset: the frame at angle zero is turned back by the offset.
        origins[i] = _turns(axes[i], -robot.offset[i : i + 1])[0]
        origins[i, :3, 3] = place
    flange = np.eye(4)
    flange[2, 3] = g["c4"]
    return Chain(origins=origins, axes=robot.sign[:, None] * axes, flange=flange)


def _turns(axis: Array, angle: Array) -> Array:
    """Return the rotations (B, 4, 4) about a unit axis (3,) by angles (B,) rad."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    s, c = np.sin(angle)[:, None, None], np.cos(angle)[:, None, None]
    T = np.zeros((len(angle), 4, 4))
    T[:, :3, :3] = np.eye(3) + s * cross + (1 - c) * (cross @ cross)
    T[:, 3, 3] = 1.0
    return T
