"""An arm with its external axes as one chain, from the part to the flange.

Each joint moves all frames after it relative to all frames before it. Code that computes distances
and motions of bodies can therefore treat rails and tables like the joints of an arm.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal, NotRequired, TypedDict

import numpy as np
from scipy.spatial.transform import Rotation

from kerfpath.arrays import Array, Bools, Ints, floats, freeze, scalar, short_repr
from kerfpath.errors import InputError
from kerfpath.urdf import KinematicChain

# -----------------------------------------------------------------------------
# External axes: rails that carry the robot and positioners that carry the part, up to three.

MOST_EXTERNAL = 3
"""Largest number of external axes of a robot."""


class Travel(TypedDict):
    """Range and limits of an external axis, in rad and s; in m and s for a linear axis."""

    lower: float
    upper: float
    velocity: float
    acceleration: float
    endless: NotRequired[bool]
    step: NotRequired[float | None]
    name: NotRequired[str]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ExternalAxis:
    """A joint that moves the robot base or the part; its value is one of the last columns of q.

    Direction and point are given with every external axis at zero. Of several axes that carry the
    robot, or several that carry the part, the first carries the others: a tilt axis comes before
    the table that it tilts. The limits of the axis are among the last entries of the robot's
    `lower`, `upper`, `velocity`, `acceleration` and `endless`.

    Parameters
    ----------
    name : str
        Name in messages, reports and programs.
    kind : {"linear", "rotary"}
    carries : {"robot", "part"}
        What the axis moves.
    axis : (3,)
        Direction in the robot base, of any length except zero; a rotary axis turns right-handed
        about it.
    point : (3,) m
        A point on the axis of rotation, in the robot base; for a rotary axis.
    step : float m or rad, optional
        Largest step between samples of the axis where the exact search takes it on a grid.
    joint : str
        Name of the joint in the robot's description; "" where it comes from no description.

    Raises
    ------
    InputError
        The direction has length zero, or the step is not positive.
    """

    name: str
    kind: Literal["linear", "rotary"]
    carries: Literal["robot", "part"]
    axis: Array
    point: Array = field(default_factory=lambda: np.zeros(3))
    step: float | None = None
    joint: str = ""

    __repr__ = short_repr

    def __post_init__(self) -> None:
        axis = floats(self.axis, f"{self.name} axis", (3,))
        if not axis.any():
            raise InputError(f"{self.name} axis: expected a direction, got {axis.tolist()}")
        _set = object.__setattr__
        length = np.linalg.norm(axis)
        unit = abs(length - 1) < 1e-15  # stays as it is: a copy of an axis is that axis
        _set(self, "axis", freeze(axis if unit else axis / length))
        _set(self, "point", floats(self.point, f"{self.name} point", (3,)))
        if self.step is not None:
            step = scalar(self.step, f"{self.name} step", unit=self.unit, above=0.0)
            _set(self, "step", step)

    @property
    def unit(self) -> Literal["m", "rad"]:
        """Unit of the axis value."""
        return "m" if self.kind == "linear" else "rad"

    def require_range(self, lower: float, upper: float) -> None:
        """Raise InputError where the ends of the range are reversed; they may be equal."""
        if not lower <= upper:
            raise InputError(
                f"{self.name}: its limits are reversed, lower {lower:g} {self.unit} is above upper "
                f"{upper:g} {self.unit}"
            )

    def motion(self, x: Array) -> Array:
        """Return the motion (..., 4, 4) m of what the axis carries, from zero to values x (...,).

        The motion is in the robot base; x is in m or rad.
        """
        x = np.asarray(x, dtype=float)
        T = np.zeros((*x.shape, 4, 4))
        T[..., range(4), range(4)] = 1.0
        if self.kind == "linear":
            T[..., :3, 3] = x[..., None] * self.axis
            return T
        turn = Rotation.from_rotvec(x.reshape(-1, 1) * self.axis).as_matrix()
        T[..., :3, :3] = turn.reshape(*x.shape, 3, 3)
        T[..., :3, 3] = self.point - T[..., :3, :3] @ self.point
        return T


def samples_of(
    name: str, step: float | None, lower: float, upper: float, *, endless: bool, key: str = "step="
) -> Array:
    """Return samples of a coordinate, at most a step apart and including both ends of the range.

    The samples of an endless coordinate cover one turn, (-pi, pi].

    Raises
    ------
    InputError
        There is no step; the message names `key`, which gives it.
    """
    if step is None:
        raise InputError(
            f"{name}: the exact search samples it on a grid and needs a step; "
            f'give {key}, or choose method "continuous"'
        )
    if endless:
        parts = int(np.ceil(2 * np.pi / step * (1 - 1e-9)))
        return freeze(-np.pi + 2 * np.pi / parts * np.arange(1, parts + 1, dtype=float))
    parts = int(np.ceil((upper - lower) / step * (1 - 1e-9)))
    return freeze(np.linspace(lower, upper, parts + 1))


def require_distinct_axes(
    robot: str, axes: Sequence[ExternalAxis], redundant: bool = False
) -> None:
    """Raise InputError for too many external axes of a robot, or two with the same name.

    A `redundant` arm, whose elbow is also free, may have one less.
    """
    names = [axis.name for axis in axes]
    if len(names) > (most := MOST_EXTERNAL - redundant):
        why = ", because the elbow of the arm is also free" if redundant else ""
        raise InputError(
            f"robot {robot!r}: expected at most {most} external axes{why}, got "
            f"{len(names)}: {', '.join(names)}"
        )
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"robot {robot!r}: two of its external axes are named {name!r}")


def carried(axes: Sequence[ExternalAxis], x: Array, what: Literal["robot", "part"]) -> Array:
    """Return the motion (..., 4, 4) m of robot or part from zero, with the axes at x (..., E)."""
    x = np.asarray(x, dtype=float)
    T = np.broadcast_to(np.eye(4), (*x.shape[:-1], 4, 4))
    for i, axis in enumerate(axes):
        if axis.carries == what:
            T = T @ axis.motion(x[..., i])
    return T


def base_in_part(axes: Sequence[ExternalAxis], x: Array) -> Array:
    """Return the motion (..., 4, 4) m of the robot base relative to the part, axes at x (..., E).

    It is expressed in the robot base at zero of all axes, where it is the identity.
    """
    return np.asarray(np.linalg.inv(carried(axes, x, "part")) @ carried(axes, x, "robot"))


# -----------------------------------------------------------------------------
# An arm with its external axes as one chain, from the part to the flange.

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
