"""A second kinematics: a generic chain of joint frames, as a robot description states it.

Nothing here is shared with the closed form that plans: the audit must not repeat its mistakes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from kerfpath._arrays import Array
from kerfpath.robots import Robot

__all__ = ["JointChain", "chain_of"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class JointChain:
    """Revolute joints one after the other, each fixed in the frame of the one before.

    Parameters
    ----------
    origins : (n, 4, 4)
        Pose of each joint frame at angle zero, in the frame of the joint before it, m.
    axes : (n, 3)
        Unit axis of each joint in its own frame.
    tip : (4, 4)
        Tip in the frame of the last joint, m.
    """

    origins: Array
    axes: Array
    tip: Array

    def forward(self, q: Array) -> Array:
        """Return the tip poses (B, 4, 4) of joint vectors q (B, n) rad."""
        return self._frames(q)[-1]

    def joints(self, q: Array) -> list[Array]:
        """Return the poses (B, 4, 4) of every joint frame, turned, of joint vectors q (B, n)."""
        return self._frames(q)[:-1]

    def jacobian(self, q: Array) -> tuple[Array, Array]:
        """Return tip poses (B, 4, 4) and geometric Jacobians (B, 6, n): linear over angular."""
        *joints, tip = self._frames(q)
        position = tip[:, :3, 3]
        J = np.empty((len(q), 6, len(self.axes)))
        for i, T in enumerate(joints):
            axis = T[:, :3, :3] @ self.axes[i]
            J[:, :3, i] = np.cross(axis, position - T[:, :3, 3])
            J[:, 3:, i] = axis
        return tip, J

    def _frames(self, q: Array) -> list[Array]:
        """Return the poses of every joint frame, turned, and of the tip; (B, 4, 4) each."""
        T = np.broadcast_to(np.eye(4), (len(q), 4, 4))
        frames = []
        for i, (origin, axis) in enumerate(zip(self.origins, self.axes, strict=True)):
            turn = np.zeros((len(q), 4, 4))
            turn[:, :3, :3] = Rotation.from_rotvec(q[:, i, None] * axis).as_matrix()
            turn[:, 3, 3] = 1.0
            T = T @ origin @ turn
            frames.append(T)
        return [*frames, T @ self.tip]


def chain_of(robot: Robot) -> JointChain:
    """Return the joint chain of an OPW robot, built from its lengths and joint convention alone.

    Axis 1 is vertical; axes 2 and 3 are parallel to y, at the shoulder (a1, b, c1) and c2 above
    it; the spherical wrist sits at (a2, 0, c3) from the elbow with axes z, y, z; the flange c4
    further (Brandstoetter, Angerer and Hofbaur 2014, figure 1).
    """
    g = robot.geometry
    y, z = (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
    places = [
        ((0.0, 0.0, 0.0), z),
        ((g["a1"], g["b"], g["c1"]), y),
        ((0.0, 0.0, g["c2"]), y),
        ((g["a2"], 0.0, g["c3"]), z),
        ((0.0, 0.0, 0.0), y),
        ((0.0, 0.0, 0.0), z),
    ]
    origins = np.tile(np.eye(4), (6, 1, 1))
    axes = np.empty((6, 3))
    for i, (xyz, axis) in enumerate(places):
        # q_model = sign q - offset: the frame at angle zero is turned back by the offset.
        origins[i, :3, 3] = xyz
        origins[i, :3, :3] = Rotation.from_rotvec(-robot.offset[i] * np.array(axis)).as_matrix()
        axes[i] = robot.sign[i] * np.array(axis)
    tip = np.eye(4)
    tip[2, 3] = g["c4"]
    return JointChain(origins=origins, axes=axes, tip=tip)
