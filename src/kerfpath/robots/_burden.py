"""Jerk and torque limits of an arm, its inertia and its load."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from kerfpath._arrays import Array, floats, positive
from kerfpath._repr import short_repr
from kerfpath.dynamics import STANDARD_GRAVITY, Load
from kerfpath.limits import JerkLimit
from kerfpath.urdf import ChainInertia

__all__ = ["Burden"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Burden:
    """The jerk, torque and mass data of a `Robot`, for the joints of the arm only."""

    jerk: Array | None = None
    torque: Array | None = None
    inertia: ChainInertia | None = None
    inertia_missing: str = ""
    load: Load | None = None
    gravity: Array = field(default_factory=lambda: np.array(STANDARD_GRAVITY))

    __repr__ = short_repr

    def cast_burden(self, joints: int) -> None:
        """Cast and check the fields for an arm with this number of joints; for `__post_init__`."""
        _set = object.__setattr__
        if self.jerk is not None:
            jerk = floats(self.jerk, "jerk", (joints,), infinite=True)
            _set(self, "jerk", JerkLimit(bound=jerk).bound)
        if self.torque is not None:
            _set(self, "torque", positive(self.torque, "torque", (joints,)))
        _set(self, "gravity", floats(self.gravity, "gravity", (3,)))
