"""The limits of a robot's joints, as its maker, its description or its user gives them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, fields, replace
from typing import Any, TypedDict

import numpy as np
from numpy.typing import ArrayLike

from kerfpath.acceleration_table import OVER, AccelerationTable
from kerfpath.arrays import Array, Bools, bools, floats, positive, short_repr
from kerfpath.errors import InputError
from kerfpath.limits import AccelerationLimit, JerkLimit


class LimitKeywords(TypedDict, total=False):
    """Limits of all joints that replace known ones: as in `RobotLimits`; None: not given."""

    lower: ArrayLike | None
    upper: ArrayLike | None
    velocity: ArrayLike | None
    acceleration: ArrayLike | None
    jerk: ArrayLike | None
    torque: ArrayLike | None
    endless: ArrayLike | None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Coupling:
    """A linear bound on a combination of joints: lower <= row @ q <= upper.

    Parameters
    ----------
    row : (n,)
        Coefficients of the joints.
    lower, upper : float rad
        Bounds of the combination.
    note : str
        Where the bound comes from.

    Raises
    ------
    InputError
        The lower bound is not below the upper one.
    """

    row: Array
    lower: float
    upper: float
    note: str = ""

    __repr__ = short_repr

    def __post_init__(self) -> None:
        object.__setattr__(self, "row", floats(self.row, "coupling row", (None,)))
        if not self.lower < self.upper:
            raise InputError(
                f"coupling {self.row.tolist()}: the lower bound {np.degrees(self.lower):g} deg "
                f"must be below the upper bound {np.degrees(self.upper):g} deg"
            )

    @property
    def name(self) -> str:
        """The combination in words, such as "joint 2 + joint 3"."""
        words = ""
        for i, c in enumerate(self.row):
            if c:
                sign = " - " if c < 0 else " + " if words else ""
                size = "" if abs(c) == 1 else f"{abs(c):g} "
                words += f"{sign}{size}joint {i + 1}"
        return words.strip()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RobotLimits:
    """The limits of the joints of a robot, external axes last; a `Robot` casts and checks them.

    Parameters
    ----------
    lower, upper : (n,) rad or None
        Joint limits; None when they are not known, and then nothing can be planned.
    velocity : (n,) rad/s or None
        Largest joint speeds.
    acceleration : (n,) rad/s^2 or None
        Largest joint accelerations; most makers publish none. Those of the joints of a table are
        its least values, which hold at any configuration.
    acceleration_table : AccelerationTable or None
        Largest accelerations of some joints of the arm by configuration.
    jerk : (arm joints,) rad/s^3 or None
        Largest joint jerks; plans keep them where they are known.
    torque : (arm joints,) N m or None
        Largest joint torques; plans keep them where a load is given.
    endless : (n,) bool
        Joints that turn without end; their limits do not apply.
    couplings : tuple of Coupling
        Bounds on combinations of joints.
    """

    lower: Array | None = None
    upper: Array | None = None
    velocity: Array | None = None
    acceleration: Array | None = None
    acceleration_table: AccelerationTable | None = None
    jerk: Array | None = None
    torque: Array | None = None
    endless: Bools = field(default_factory=lambda: np.zeros((), bool))
    couplings: tuple[Coupling, ...] = ()

    __repr__ = short_repr

    def cast(self, joints: int, arm: int) -> RobotLimits:
        """Return the limits as arrays for this number of joints, `arm` of them those of the arm.

        Raises
        ------
        InputError
            An array of another shape, a speed or another rate that is not positive; or a table of
            accelerations for joints that the arm does not have, for joints 2 and 3 without end, or
            beside unknown accelerations.
        """

        def known(cast: Callable[..., Array], name: str, size: int = joints) -> Array | None:
            values = getattr(self, name)
            return None if values is None else cast(values, name, (size,))

        for coupling in self.couplings:
            floats(coupling.row, "coupling row", (joints,))
        endless = bools(for_each(self.endless, joints), "endless", (joints,))
        acceleration, table = known(positive, "acceleration"), self.acceleration_table
        if table is not None:
            table.require_arm(arm)
            if acceleration is None:
                raise InputError(
                    "acceleration table: expected the accelerations of the other joints, too, got "
                    "none; give acceleration="
                )
            if endless[list(OVER)].any():
                raise InputError(
                    "acceleration table: expected joints 2 and 3 with ranges, got an endless one, "
                    "whose turns the table does not know"
                )
            acceleration = AccelerationLimit(bound=acceleration, table=table).bound
        return replace(
            self,
            endless=endless,
            lower=known(floats, "lower"),
            upper=known(floats, "upper"),
            velocity=known(positive, "velocity"),
            acceleration=acceleration,
            jerk=known(lambda *of: JerkLimit(bound=floats(*of, infinite=True)).bound, "jerk", arm),
            torque=known(positive, "torque", arm),
        )

    def of_arm(self, n: int) -> RobotLimits:
        """Return the limits of the first n joints, those of the arm."""
        first: dict[str, Any] = {
            each.name: values[:n]
            for each in fields(self)
            if isinstance(values := getattr(self, each.name), np.ndarray)
        }
        return replace(
            self, **first, couplings=tuple(replace(c, row=c.row[:n]) for c in self.couplings)
        )


def for_each(value: ArrayLike, joints: int) -> ArrayLike:
    """Return a scalar repeated for each joint; any other array as it is."""
    return np.full(joints, value) if np.ndim(value) == 0 else value
