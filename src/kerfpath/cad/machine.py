"""Machines with rotary axes: where the tip is in the part, and where the tool points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from kerfpath.arrays import Array, floats, not_negative, require_one_of, short_repr
from kerfpath.cad.units import MM
from kerfpath.errors import InputError

CHAINS = ("A", "B", "C", "AB", "AC", "BA", "BC", "CA", "CB")
"""Rotary axes that carry each other, the first the second."""
GIVE_MACHINE = (
    'say which axes carry the tool and which the part: machine = { head = "CB" }, '
    '{ table = "AC" }, { table = "A" } (a tube) or { head = "B", table = "C" } in [part] of a job, '
    "or --machine"
)
"""What to do where a program has rotary axes."""
GIVE_PIVOT = (
    "not under tool-centre-point control: add pivot_mm to machine, the distance of the tip from "
    "the point where the axes of the head meet"
)
"""What to do where that distance is needed."""
GIVE_CENTRE = (
    "the tip is on the rotary axis while that turns: say with centre_mm in machine where it is, "
    "such as [0, 0, -30] for a tube of radius 30 whose surface is at Z 0"
)
"""What to do where the axis of the table seems to be elsewhere."""
GIVE_TCP = (
    "say whether the control keeps the tip at X, Y and Z while the axes turn (G43.4, TRAORI, M128, "
    "RTCP): tcp = true or tcp = false in machine"
)
"""What to do where the head turns, and the program does not say how."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Machine:
    """The rotary axes of a machine; A, B and C turn about X, Y and Z, and all at 0 the tool is -z.

    The axes of the head meet in one point, and so do those of the table.

    Parameters
    ----------
    head, table : str
        Axes that carry the tool, and axes that carry the part, each from the frame of the machine
        outwards: "CB" is a C axis that carries a B axis. "" for none.
    tcp : bool or None
        Whether X, Y and Z are those of the tip in the part while the axes turn (tool-centre-point
        control); otherwise they are those of the slides. By default as the program says.
    pivot : float m or None
        Distance of the tip from the point where the axes of the head meet; only without `tcp`.
    centre : (3,) m
        Point where the axes of the table meet, in the coordinates of the program; only without
        `tcp`.
    reversed : str
        Axes that count against ISO 841. By ISO 841 the tool turns counter-clockwise about X, Y or Z
        of the part as the angle grows, so that a table turns clockwise.
    rollover : bool or None
        Whether an axis takes the shorter way to an angle. By default a cut on which the ways differ
        is refused.

    Raises
    ------
    InputError
        Other axes, an axis twice, or none.
    """

    head: str = ""
    table: str = ""
    tcp: bool | None = None
    pivot: float | None = None
    centre: tuple[float, float, float] = (0.0, 0.0, 0.0)
    reversed: str = ""
    rollover: bool | None = None

    __repr__ = short_repr

    def __post_init__(self) -> None:
        for name in ("head", "table"):
            if getattr(self, name) != "":
                require_one_of(getattr(self, name), name, CHAINS)
        for name in ("tcp", "rollover"):
            if (value := getattr(self, name)) not in (True, False, None):
                raise InputError(f"{name}: expected True, False or None, got {value!r}")
        if not self.axes or set(self.head) & set(self.table):
            raise InputError(
                "head and table: expected the rotary axes of the machine, each once, got "
                f"{self.head!r} and {self.table!r}"
            )
        if not set(self.reversed) <= set(self.axes):
            raise InputError(f"reversed: expected axes of {self.axes}, got {self.reversed!r}")
        if self.pivot is not None:
            not_negative(self.pivot, "pivot", unit="m")
        x, y, z = floats(self.centre, "centre", (3,)).tolist()
        object.__setattr__(self, "centre", (x, y, z))

    @property
    def axes(self) -> str:
        """Letters of all axes, in the order in which they turn the tool in the part."""
        return self.table[::-1] + self.head

    def said(self, *, tcp: bool) -> str:
        """Return words on the machine for a note."""
        carry = [f"{self.head} carry the tool"] * bool(self.head)
        carry += [f"{self.table} carry the part"] * bool(self.table)
        whose = "the tip in the part" if tcp else "the slides of the machine"
        return f"rotary axes {' and '.join(carry)}; X, Y and Z are those of {whose}"

    def in_part(self, points: Array, angles: Array, *, tcp: bool) -> tuple[Array, Array]:
        """Return the places of the tip (K, 3) mm in the part, and unit vectors to the spindle.

        Parameters
        ----------
        points : (K, 3) mm
            X, Y and Z of the program.
        angles : (K, 3) deg
            A, B and C.
        tcp : bool
            Whether these are under tool-centre-point control.
        """
        about_table = self._turned(self.table[::-1], angles)
        about_head = self._turned(self.head, angles)
        upwards = np.array([0.0, 0.0, 1.0])
        spindle = about_head.apply(upwards)
        if not tcp:
            pivot, centre = (self.pivot or 0.0) / MM, np.array(self.centre) / MM
            points = centre + about_table.apply(points + pivot * (upwards - spindle) - centre)
        return points, about_table.apply(spindle)

    def _turned(self, axes: str, angles: Array) -> Rotation:
        """Return the rotations (K,) about axes, each about the axis as turned by those before."""
        turned = Rotation.identity(len(angles))
        for letter in axes:
            signed = (-1 if letter in self.reversed else 1) * angles[:, "ABC".index(letter)]
            turned = turned * Rotation.from_euler(
                letter.translate(_XYZ), signed[:, None], degrees=True
            )
        return turned


_XYZ = str.maketrans("ABC", "XYZ")
