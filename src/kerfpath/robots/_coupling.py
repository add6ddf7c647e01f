"""Bounds on combinations of joints, which parallel rods and controllers impose."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kerfpath._arrays import Array, floats
from kerfpath._repr import short_repr
from kerfpath.errors import InputError

__all__ = ["AXIS_3", "Coupling"]

AXIS_3 = ("", "serial", "horizontal")
"""What axis 3 of a controller can measure; "" means not known, see `Robot`."""


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
