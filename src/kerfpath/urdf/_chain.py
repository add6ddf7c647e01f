"""A chain of revolute joints: the frames of its links for many joint vectors, and its reach."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kerfpath._arrays import Array, Bools, Ints, floats
from kerfpath._repr import short_repr

__all__ = ["KinematicChain", "turns"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class KinematicChain:
    """A serial chain of revolute joints; frame 0 is the base, frame i turns with joint i.

    Parameters
    ----------
    origins : (n, 4, 4)
        Pose of each joint frame at angle zero, in the frame of the joint before it, m.
    axes : (n, 3)
        Unit axis of each joint in its own frame.
    end : (4, 4)
        Flange or tip in the frame of the last joint, m.
    """

    origins: Array
    axes: Array
    end: Array

    __repr__ = short_repr

    def __post_init__(self) -> None:
        n = len(self.origins)
        object.__setattr__(self, "origins", floats(self.origins, "chain origins", (n, 4, 4)))
        object.__setattr__(self, "axes", floats(self.axes, "chain axes", (n, 3)))
        object.__setattr__(self, "end", floats(self.end, "chain end", (4, 4)))

    @property
    def joints(self) -> int:
        """Number of joints."""
        return len(self.axes)

    @property
    def still(self) -> int:
        """Index of the fixed frame: the base."""
        return 0

    @property
    def base(self) -> int:
        """Index of the frame of the robot's base."""
        return 0

    @property
    def order(self) -> Ints:
        """The column of q of each joint of the chain, (n,)."""
        return np.arange(len(self.axes))

    @property
    def slides(self) -> Bools:
        """Whether each joint of the chain is linear, (n,): none is."""
        return np.zeros(len(self.axes), np.bool_)

    def say(self, place: int) -> str:
        """Return the name of a joint of the chain in messages."""
        return f"joint {place + 1}"

    def moves_with(self, frame: int) -> str:
        """Return the name of what a frame moves with."""
        return f"joint {frame}" if frame else "base"

    def spread(self, share: Array) -> Array:
        """Map shares (B, n) from 0 to 1 to joints (B, n) rad over a whole turn each."""
        return np.asarray(2 * np.pi * share - np.pi, dtype=np.float64)

    def bounded(self, q: Array) -> Bools:
        """Return at which of q (B, n) the bounds on motions hold, (B,): at all."""
        return np.ones(len(q), np.bool_)

    @property
    def length(self) -> float:
        """Sum of the lengths (m) from joint to joint and to the end, the reach of the arm."""
        steps = np.linalg.norm(self.origins[1:, :3, 3], axis=1)
        return float(steps.sum() + np.linalg.norm(self.end[:3, 3]))

    def frames(self, q: Array) -> Array:
        """Return the poses (B, n+1, 4, 4) in the base of all frames at q (B, n) rad."""
        B, n = q.shape
        T = np.zeros((B, n + 1, 4, 4))
        T[:, 0] = np.eye(4)
        for i in range(n):
            T[:, i + 1] = T[:, i] @ (self.origins[i] @ turns(self.axes[i], q[:, i]))
        return T

    def forward(self, q: Array) -> Array:
        """Return the poses (B, 4, 4) of the end in the base at q (B, n) rad."""
        return np.asarray(self.frames(q)[:, -1] @ self.end)

    def reach(self, frame: int, points: Array) -> Array:
        """Return bounds (n,) m on the distance of any of points (c, 3) m from each joint's axis.

        The points are in coordinates of `frame`. The bounds hold at every q, as they assume that
        the links between are stretched out; they are zero for joints that do not move the frame.
        """
        arms = np.zeros(len(self.axes))
        length = float(np.linalg.norm(points, axis=1).max())
        for i in range(frame - 1, -1, -1):
            arms[i] = length
            length += float(np.linalg.norm(self.origins[i][:3, 3]))
        return arms


def turns(axis: Array, angle: Array) -> Array:
    """Return the rotations (B, 4, 4) about a unit axis (3,) by angles (B,) rad (Rodrigues)."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    s, c = np.sin(angle)[:, None, None], np.cos(angle)[:, None, None]
    T = np.zeros((len(angle), 4, 4))
    T[:, :3, :3] = np.eye(3) + s * cross + (1 - c) * (cross @ cross)
    T[:, 3, 3] = 1.0
    return T
