"""External axes: rails under the robot, tables under the part; up to three, one on the other."""

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
"""External axes that a robot may have."""


class Travel(TypedDict):
    """Range and limits of an external axis: rad, rad/s, rad/s^2; m, m/s, m/s^2 of a linear one."""

    lower: float
    upper: float
    velocity: float
    acceleration: float
    endless: NotRequired[bool]
    step: NotRequired[float | None]
    name: NotRequired[str]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ExternalAxis:
    """A joint that moves the robot's base or the part; its value is one of the last columns of q.

    It is described where every external axis is at zero. Of axes that carry the same thing the
    first one named carries the others: a tilt comes before the table that it tilts. Its limits are
    among the last of the robot's `lower`, `upper`, `velocity`, `acceleration` and `endless`.

    Parameters
    ----------
    name : str
        What messages, reports and programs call it.
    kind : {"linear", "rotary"}
    carries : {"robot", "part"}
    axis : (3,)
        Direction in the robot base, any length but zero; a rotary axis turns right-handed about it.
    point : (3,) m
        Where the axis of a rotary one passes, in the robot base.
    step : float m or rad, optional
        Largest step of its samples where the exact search takes it on a grid.
    joint : str
        The joint of the robot's description that it is; "" where it comes from none.

    Raises
    ------
    InputError
        A direction of length zero, a step that is not positive.
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
        """Unit of its values."""
        return "m" if self.kind == "linear" else "rad"

    def require_range(self, lower: float, upper: float) -> None:
        """Raise InputError where the ends of its range are reversed; they may be the same."""
        if not lower <= upper:
            raise InputError(
                f"{self.name}: its limits are reversed, lower {lower:g} {self.unit} is above upper "
                f"{upper:g} {self.unit}"
            )

    def motion(self, x: Array) -> Array:
        """Return how far it has moved what it carries, (..., 4, 4) m, at values x (...,)."""
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
    """Return samples of a coordinate, at most a step apart, both ends of the range among them.

    Raises
    ------
    InputError
        There is no step; `key` says how to give it.
    """
    if step is None:
        raise InputError(
            f"{name}: the exact search takes its values on a grid and needs their step; "
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
    """Raise InputError for too many external axes of a robot, or two of one name.

    Of a `redundant` arm, whose elbow is free, too, there may be one less.
    """
    names = [axis.name for axis in axes]
    if len(names) > (most := MOST_EXTERNAL - redundant):
        why = ", as the elbow of the arm is free, too" if redundant else ""
        raise InputError(
            f"robot {robot!r}: expected at most {most} external axes{why}, got "
            f"{len(names)}: {', '.join(names)}"
        )
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"robot {robot!r}: two of its external axes are named {name!r}")


def carried(axes: Sequence[ExternalAxis], x: Array, what: Literal["robot", "part"]) -> Array:
    """Return where the axes at x (..., E) have taken robot or part from zero, (..., 4, 4) m."""
    x = np.asarray(x, dtype=float)
    T = np.broadcast_to(np.eye(4), (*x.shape[:-1], 4, 4))
    for i, axis in enumerate(axes):
        if axis.carries == what:
            T = T @ axis.motion(x[..., i])
    return T


def base_in_part(axes: Sequence[ExternalAxis], x: Array) -> Array:
    """Return where the robot's base stands against the part, (..., 4, 4) m, at x (..., E).

    In the robot base at zero: what matters is how the one moves against the other.
    """
    return np.asarray(np.linalg.inv(carried(axes, x, "part")) @ carried(axes, x, "robot"))
