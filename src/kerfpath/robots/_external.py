"""External axes: rails that carry the robot and positioners that carry the part, up to three."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal, NotRequired, TypedDict

import numpy as np
from scipy.spatial.transform import Rotation

from kerfpath._arrays import Array, floats, freeze, scalar
from kerfpath._repr import short_repr
from kerfpath.errors import InputError

__all__ = [
    "ExternalAxis",
    "Travel",
    "base_in_part",
    "carried",
    "require_distinct_axes",
    "samples_of",
]

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
