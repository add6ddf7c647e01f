"""An arm with its external axes as one chain, from the part to the flange.

Each joint moves all frames after it relative to all frames before it. Code that computes distances
and motions of bodies can therefore treat rails and tables like the joints of an arm.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kerfpath._arrays import Array, Bools, Ints, floats
from kerfpath._repr import short_repr
from kerfpath.errors import InputError
from kerfpath.robots._external import ExternalAxis, carried
from kerfpath.urdf import KinematicChain

__all__ = ["CarriedChain"]

BEYOND = 1e-6
"""m: rounding error of a linear axis at the end of its travel."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CarriedChain(KinematicChain):
    """The chain of the external axes and, after them, the joints of the arm.

    In q, as in that of a robot, the joints of the arm come first. Frame 0 moves with the part. Up
    to frame `still`, the ground, each frame is carried by one axis fewer of those that carry the
    part; from there to frame `base` each is carried by one axis more of those that carry the robot;
    the links of the arm follow. Poses are in the ground frame: the robot base with every external
    axis at zero, where all frames up to `base` coincide.

    Parameters
    ----------
    origins, axes, end
        Chain of the arm, as in `KinematicChain`.
    externals : tuple of ExternalAxis
    travel : (E, 2) rad or m
        Least and largest value of each external axis. Bounds on motions hold for linear axes
        within their travel.
    """

    externals: tuple[ExternalAxis, ...]
    travel: Array

    __repr__ = short_repr

    def __post_init__(self) -> None:
        KinematicChain.__post_init__(self)
        travel = floats(self.travel, "travel", (len(self.externals), 2))
        object.__setattr__(self, "travel", travel)

    @property
    def joints(self) -> int:
        """Number of joints of arm and external axes together."""
        return len(self.axes) + len(self.externals)

    @property
    def still(self) -> int:
        """Index of the ground frame."""
        return sum(axis.carries == "part" for axis in self.externals)

    @property
    def base(self) -> int:
        """Index of the frame of the robot base."""
        return len(self.externals)

    @property
    def order(self) -> Ints:
        """The column of q of each joint of the chain, (n,)."""
        n = len(self.axes)
        return np.array([*(n + i for i in self._passed()), *range(n)], dtype=np.int64)

    @property
    def slides(self) -> Bools:
        """Which joints of the chain are linear, (n,)."""
        linear = [self.externals[i].kind == "linear" for i in self._passed()]
        return np.array([*linear, *(False for _ in self.axes)], dtype=np.bool_)

    def frame_on(self, name: str) -> int:
        """Return the frame directly on an external axis, before any axis that it carries.

        Raises
        ------
        InputError
            There is no axis of that name.
        """
        names = [axis.name for axis in self.externals]
        if name not in names:
            raise InputError(
                f"no external axis is called {name!r}; there are {', '.join(map(repr, names))}"
            )
        place = self._passed().index(names.index(name))
        return place if place < self.still else place + 1

    def say(self, place: int) -> str:
        """Return the name of a joint of the chain in messages."""
        if place < self.base:
            return self.externals[self._passed()[place]].name
        return f"joint {place - self.base + 1}"

    def moves_with(self, frame: int) -> str:
        """Return the name of the axis or joint that moves a frame directly, or "ground"."""
        if frame == self.still:
            return "ground"
        return self.say(frame if frame < self.still else frame - 1)

    def spread(self, share: Array) -> Array:
        """Return joints (B, n) at shares (B, n), 0 to 1, of a full turn or of a linear travel."""
        q, n = KinematicChain.spread(self, share), len(self.axes)
        linear = [axis.kind == "linear" for axis in self.externals]
        low, high = self.travel.T
        q[:, n:][:, linear] = (low + (high - low) * share[:, n:])[:, linear]
        return q

    def bounded(self, q: Array) -> Bools:
        """Return whether all linear axes of q (B, n) are in their travel, so that bounds hold."""
        x, linear = q[:, len(self.axes) :], [axis.kind == "linear" for axis in self.externals]
        low, high = self.travel.T
        inside = (x >= low - BEYOND) & (x <= high + BEYOND)
        return np.asarray(inside[:, linear].all(axis=1))

    def frames(self, q: Array) -> Array:
        """Return poses (B, n + 1, 4, 4) m of all frames in the ground at q (B, n) rad or m."""
        n, passed, still = len(self.axes), self._passed(), self.still
        stands = []
        for frame in range(self.base + 1):
            on = passed[frame:still][::-1] + passed[still:frame]
            axes = [self.externals[i] for i in on]
            x = q[:, [n + i for i in on]]
            stands.append(carried(axes, x, "part" if frame < still else "robot"))
        arm = KinematicChain.frames(self, q[:, :n])
        return np.concatenate([np.stack(stands[:-1], axis=1), stands[-1][:, None] @ arm], axis=1)

    def reach(self, frame: int, points: Array) -> Array:
        """Return bounds (n,) m on the distance of points (c, 3) m in a frame from each rotary axis.

        The bounds are in the order of the chain and hold at every q within the travel. They are 1
        for linear axes and 0 for joints that do not move the frame.
        """
        arms, passed = np.zeros(self.joints), self._passed()
        if frame > self.base:
            arms[self.base :] = own = KinematicChain.reach(self, frame - self.base, points)
            centre, ball = self.origins[0][:3, 3], float(own[0])
        else:
            centre = (points.min(axis=0) + points.max(axis=0)) / 2
            ball = float(np.linalg.norm(points - centre, axis=1).max())
        # The ball contains the points at all positions of the axes passed so far.
        for place in range(min(frame, self.base) - 1, -1, -1):
            axis = self.externals[passed[place]]
            if axis.kind == "linear":
                low, high = self.travel[passed[place]] * (-1.0 if place < self.still else 1.0)
                centre = centre + (low + high) / 2 * axis.axis
                ball += abs(high - low) / 2
                arms[place] = 1.0
            else:
                foot = axis.point + ((centre - axis.point) @ axis.axis) * axis.axis
                ball += float(np.linalg.norm(centre - foot))
                centre, arms[place] = foot, ball
        return arms

    @property
    def sway(self) -> float:
        """Bound (m) on how far the axes move the origin of the robot base relative to the part."""
        return sum(
            float(np.abs(travel).max())
            if axis.kind == "linear"
            else 2 * float(np.linalg.norm(axis.point))
            for axis, travel in zip(self.externals, self.travel, strict=True)
        )

    def _passed(self) -> list[int]:
        """Return the external axes in the order of the chain: from the part to the base."""
        places = range(len(self.externals))
        part = [i for i in places if self.externals[i].carries == "part"]
        return part[::-1] + [i for i in places if self.externals[i].carries == "robot"]
