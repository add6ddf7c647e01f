"""A second kinematics: a generic chain of joint frames, as in a robot description.

It shares no code with the closed form used for planning, so the audit cannot repeat its errors.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from kerfpath.arrays import Array, Ints, short_repr
from kerfpath.robots import ExternalAxis, Robot


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class JointChain:
    """A chain of revolute joints, each fixed in the frame of the one before.

    Parameters
    ----------
    origins : (n, 4, 4) m
        Pose of each joint frame at angle zero, in the frame of the joint before it.
    axes : (n, 3)
        Unit axis of each joint in its own frame.
    tip : (4, 4) m
        Tip in the frame of the last joint.
    externals : tuple of ExternalAxis
        External axes, which carry the first joint or the part; their values are the last of q.
    even : int, optional
        The joint (from 0) that runs evenly from node to node, like external axes: the free joint of
        a seven-axis arm.
    """

    origins: Array
    axes: Array
    tip: Array
    externals: tuple[ExternalAxis, ...] = ()
    even: int | None = None

    __repr__ = short_repr

    def forward(self, q: Array) -> Array:
        """Return the tip poses (B, 4, 4) m at joint vectors q (B, n) rad, relative to the part."""
        return self._frames(q)[-1]

    def joints(self, q: Array) -> list[Array]:
        """Return the poses (B, 4, 4) m of every turned joint frame at joints q (B, n) rad."""
        return self._frames(q)[:-1]

    def links(self, q: Array) -> Array:
        """Return the poses (B, E+n+1, 4, 4) m of all moved frames, from the part to the last link.

        Poses are in the ground frame: the robot base with every external axis at zero. The order
        is: the part and then each frame carried by one axis fewer; the ground; the frames carried
        by the axes of the robot, up to its base; the links. Without external axes: base and links.
        """
        steps = self._steps_to_base(q)
        frames = np.stack([*steps, *self.joints(q)], axis=1)
        still = sum(axis.carries == "part" for axis in self.externals)
        if not still:
            return np.ascontiguousarray(frames)
        seen = np.ascontiguousarray(np.linalg.inv(steps[still])[:, None] @ frames)
        seen[:, still] = np.eye(4)
        return seen

    @property
    def order(self) -> Ints:
        """The columns of q (E+n,), in the order in which they move `links`."""
        n = len(self.axes)
        return np.array([*(n + i for i in self._order()), *range(n)], dtype=np.int64)

    def jacobian(self, q: Array) -> tuple[Array, Array]:
        """Return tip poses (B, 4, 4) m and geometric Jacobians (B, 6, n), linear above angular.

        The Jacobians are those of the arm's own joints, without the external axes.
        """
        *joints, tip = self._frames(q)
        position = tip[:, :3, 3]
        J = np.empty((len(q), 6, len(self.axes)))
        for i, T in enumerate(joints):
            axis = T[:, :3, :3] @ self.axes[i]
            J[:, :3, i] = np.cross(axis, position - T[:, :3, 3])
            J[:, 3:, i] = axis
        return tip, J

    def twists(self, q: Array, tip: Array) -> Array:
        """Return the twist of the tip per m or rad of each external axis, (B, 6, E).

        Twists are relative to the part, linear above angular, at tips (B, 3) m of q (B, n).
        """
        steps = self._steps_to_base(q)
        columns = np.zeros((len(q), 6, len(self.externals)))
        for T, i in zip(steps, self._order(), strict=False):
            axis = self.externals[i]
            sign = -1.0 if axis.carries == "part" else 1.0
            direction = sign * T[:, :3, :3] @ axis.axis
            if axis.kind == "linear":
                columns[:, :3, i] = direction
            else:
                point = T[:, :3, :3] @ axis.point + T[:, :3, 3]
                columns[:, :3, i] = np.cross(direction, tip - point)
                columns[:, 3:, i] = direction
        return columns

    @property
    def passed(self) -> list[ExternalAxis]:
        """The external axes in the order from the part to the robot base."""
        return [self.externals[i] for i in self._order()]

    def _order(self) -> list[int]:
        """Return the numbers of the external axes from the part to the robot base."""
        numbers = range(len(self.externals))
        part = [i for i in numbers if self.externals[i].carries == "part"]
        return part[::-1] + [i for i in numbers if self.externals[i].carries == "robot"]

    def _steps_to_base(self, q: Array) -> list[Array]:
        """Return the poses (B, 4, 4) m before each axis on the way from part to base, and the base.

        An axis that carries the part is passed backwards: seen from the part, all else moves.
        """
        T, n = np.tile(np.eye(4), (len(q), 1, 1)), len(self.axes)
        steps = [T]
        for i in self._order():
            axis = self.externals[i]
            x = q[:, n + i] * (-1.0 if axis.carries == "part" else 1.0)
            moved = np.tile(np.eye(4), (len(q), 1, 1))
            if axis.kind == "linear":
                moved[:, :3, 3] = np.outer(x, axis.axis)
            else:
                moved[:, :3, :3] = turn = Rotation.from_rotvec(np.outer(x, axis.axis)).as_matrix()
                moved[:, :3, 3] = axis.point - turn @ axis.point
            T = T @ moved
            steps.append(T)
        return steps

    def _frames(self, q: Array) -> list[Array]:
        """Return the poses (B, 4, 4) m of every turned joint frame, and of the tip."""
        frames, T = [], self._steps_to_base(q)[-1]
        for i, (origin, axis) in enumerate(zip(self.origins, self.axes, strict=True)):
            turn = np.zeros((len(q), 4, 4))
            turn[:, :3, :3] = Rotation.from_rotvec(q[:, i, None] * axis).as_matrix()
            turn[:, 3, 3] = 1.0
            T = T @ origin @ turn
            frames.append(T)
        return [*frames, T @ self.tip]


def chain_of(robot: Robot) -> JointChain:
    """Return the joint chain of a robot, from its description if it has one.

    Otherwise the chain is built from the lengths and the joint convention.
    """
    if robot.chain is not None:
        given = robot.chain
        return JointChain(
            origins=given.origins,
            axes=given.axes,
            tip=given.end,
            externals=robot.externals,
            even=robot.family.given,
        )
    origins, axes, end = _MODELS[robot.kinematics](robot.geometry)
    for i, axis in enumerate(axes):
        # q_model = sign q - offset: the frame at angle zero is turned back by the offset.
        back = Rotation.from_rotvec(-robot.offset[i] * axis).as_matrix()
        origins[i, :3, :3] = origins[i, :3, :3] @ back
    origins[0] = robot.T_base_foot @ origins[0]
    return JointChain(
        origins=origins,
        axes=robot.sign[:, None] * axes,
        tip=end @ robot.T_end_flange,
        externals=robot.externals,
        even=robot.family.given,
    )


def _opw(g: dict[str, float]) -> tuple[Array, Array, Array]:
    """Return origins (6, 4, 4), axes (6, 3) and end (4, 4) of an OPW arm.

    Axis 1 is vertical; axes 2 and 3 are parallel to y, at the shoulder (a1, b, c1) and c2 above
    it; the spherical wrist is at (a2, 0, c3) from the elbow with axes z, y, z; the flange is c4
    further along (Brandstoetter, Angerer and Hofbaur 2014, figure 1).
    """
    y, z = (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
    origins, end = np.tile(np.eye(4), (6, 1, 1)), np.eye(4)
    origins[1, :3, 3] = g["a1"], g["b"], g["c1"]
    origins[2, :3, 3] = 0.0, 0.0, g["c2"]
    origins[3, :3, 3] = g["a2"], 0.0, g["c3"]
    end[2, 3] = g["c4"]
    return origins, np.array([z, y, y, z, y, z]), end


def _ur(g: dict[str, float]) -> tuple[Array, Array, Array]:
    """Return origins, axes and end of a UR arm from its Denavit-Hartenberg parameters."""
    links = np.tile(np.eye(4), (6, 1, 1))
    links[:, 2, 3] = g["d1"], 0.0, 0.0, g["d4"], g["d5"], g["d6"]
    links[:, 0, 3] = 0.0, g["a2"], g["a3"], 0.0, 0.0, 0.0
    alpha = np.radians([90.0, 0.0, 0.0, 90.0, -90.0, 0.0])
    links[:, :3, :3] = Rotation.from_rotvec(alpha[:, None] * [1.0, 0.0, 0.0]).as_matrix()
    return (
        np.concatenate([np.eye(4)[None], links[:-1]]),
        np.tile([0.0, 0.0, 1.0], (6, 1)),
        links[-1],
    )


def _five(g: dict[str, float]) -> tuple[Array, Array, Array]:
    """Return origins, axes and end of an OPW arm without axis 6."""
    origins, axes, end = _opw(g)
    return origins[:5], axes[:5], end


def _srs(g: dict[str, float]) -> tuple[Array, Array, Array]:
    """Return origins (7, 4, 4), axes (7, 3) and end of an arm with spherical shoulder and wrist.

    At zero it is upright: all axes lie on one vertical line or are parallel to y, with axis 2 at
    the height c1, axis 4 c2 above it, axis 6 c3 above that, and the flange c4 above axis 6.
    """
    steps = np.tile(np.eye(4), (8, 1, 1))
    steps[:, 2, 3] = 0.0, g["c1"], 0.0, g["c2"], 0.0, g["c3"], 0.0, g["c4"]
    axes = np.tile([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0]], (4, 1))[:7]
    return steps[:7], axes, steps[7]


_MODELS = {"opw": _opw, "ur": _ur, "five": _five, "srs": _srs}
