"""One more joint, of the robot's base or of the part: a rail or a positioner."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypedDict

import numpy as np
from scipy.spatial.transform import Rotation

from kerfpath._arrays import Array, floats, freeze, scalar
from kerfpath._repr import short_repr
from kerfpath.errors import InputError

__all__ = ["ExternalAxis", "Travel"]


class Travel(TypedDict):
    """Range, limits and grid of an external axis: rad; m for a rail."""

    lower: float
    upper: float
    velocity: float
    acceleration: float
    step: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ExternalAxis:
    """A joint that moves the whole robot against the part; its value is the last column of q.

    Known to the search, the refinement and the audit; jobs, cells, reports and programs have none.

    Where it stands at x: a rail has taken the robot's base x metres along `axis`; a positioner has
    turned the part by x about `axis` through `point`. All frames and poses stay those of base and
    part at x = 0: what matters is how the one moves against the other. Its limits are the last of
    the robot's `lower`, `upper`, `velocity` and `acceleration`.

    Parameters
    ----------
    kind : {"rail", "positioner"}
    axis : (3,)
        Direction in the robot base, any length but zero.
    point : (3,) m
        Where a positioner's axis passes, in the robot base.
    step : float m or rad
        Largest step of its samples.

    Raises
    ------
    InputError
        A direction of length zero, a step that is not positive.
    """

    kind: Literal["rail", "positioner"]
    axis: Array
    point: Array
    step: float

    __repr__ = short_repr

    def __post_init__(self) -> None:
        axis = floats(self.axis, f"{self.kind} axis", (3,))
        if not axis.any():
            raise InputError(f"{self.kind} axis: expected a direction, got {axis.tolist()}")
        step = scalar(self.step, f"{self.kind} step", unit=self.unit, above=0.0)
        _set = object.__setattr__
        _set(self, "axis", freeze(axis / np.linalg.norm(axis)))
        _set(self, "point", floats(self.point, f"{self.kind} point", (3,)))
        _set(self, "step", step)

    @property
    def unit(self) -> Literal["m", "rad"]:
        """Unit of its values."""
        return "m" if self.kind == "rail" else "rad"

    def samples(self, lower: float, upper: float) -> Array:
        """Return its samples (E,), both ends of the range among them, at most a step apart."""
        parts = int(np.ceil((upper - lower) / self.step * (1 - 1e-9)))
        return freeze(np.linspace(lower, upper, parts + 1))

    def require_range(self, lower: float, upper: float) -> None:
        """Raise InputError where the ends of its range are reversed; they may be the same."""
        if not lower <= upper:
            raise InputError(
                f"{self.kind}: its limits are reversed, lower {lower:g} {self.unit} is above upper "
                f"{upper:g} {self.unit}"
            )

    def no_inverse(self) -> InputError:
        """Return the error for a pose to be solved: why it is not, and what to ask instead."""
        return InputError(
            f"inverse: with a {self.kind} a pose has solutions without end; ask "
            f"robot.held(x).inverse(T), x in {self.unit}"
        )

    def poses(self, x: Array) -> Array:
        """Return where the robot's base stands against the part, (..., 4, 4) m, at x (...,)."""
        x = np.asarray(x, dtype=float)
        T = np.zeros((*x.shape, 4, 4))
        T[..., range(4), range(4)] = 1.0
        if self.kind == "rail":
            T[..., :3, 3] = x[..., None] * self.axis
            return T
        turn = Rotation.from_rotvec(-x.reshape(-1, 1) * self.axis).as_matrix()
        T[..., :3, :3] = turn.reshape(*x.shape, 3, 3)
        T[..., :3, 3] = self.point - T[..., :3, :3] @ self.point
        return T
