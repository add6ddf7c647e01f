"""External axes in RAPID: their letters, their mechanical units, and how fast they are.

A target says each external axis by a letter, eax_a to eax_f, in mm or deg; 9E9 where there is none.
A unit that carries the part moves the user frame of the work object that names it (wobjdata: ufprog
FALSE, ufmec); where that frame stands is the unit's own calibration, and the object frame is the
part in it. A track moves the robot's base, of which the controller knows by its own definition; the
work object of what stands still is in the world.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from kerfpath._arrays import Array, freeze
from kerfpath._repr import short_repr
from kerfpath.post._external import (
    axes_that_carry,
    calibration_remarks,
    from_said,
    said,
    setup_remarks,
)
from kerfpath.post._formatter import number, plain
from kerfpath.post.rapid._settings import RapidSettings
from kerfpath.robots import Robot

__all__ = ["NO_EXTERNAL", "ExternalSpeeds", "ExternalUnits", "missing"]

LETTERS = "abcdef"
NONE = "9E9"
ABSENT = 9e9
"""What stands for an axis that is not there."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ExternalSpeeds:
    """v_leax (mm/s) and v_reax (deg/s) of speed data.

    Parameters
    ----------
    linear_mm_s, rotary_deg_s : float
        At full speed.
    shared : bool
        Whether joint moves that take a share of the full speed take it of these, too.
    """

    linear_mm_s: float = 5000.0
    rotary_deg_s: float = 1000.0
    shared: bool = False

    __repr__ = short_repr

    def said(self, share: float) -> str:
        """Return both at a share of the full speed."""
        share = share if self.shared else 1.0
        return f"{number(share * self.linear_mm_s, 0)},{number(share * self.rotary_deg_s, 0)}"


NO_EXTERNAL = ExternalSpeeds()
"""Of an arm alone: speed data must say something."""


class ExternalUnits:
    """The external axes of a robot as its controller knows them.

    Parameters
    ----------
    robot : Robot
    settings : RapidSettings
        Which name a unit for every axis, and letters; `check` says before where they do not.
    """

    def __init__(self, robot: Robot, settings: RapidSettings) -> None:
        self.robot = robot
        count = len(robot.externals)
        self.frame = settings.positioner_frame
        self.units: Sequence[str] = (settings.mechanical_units or [])[:count]
        self.letters = (settings.external_letters or LETTERS)[:count]
        carrying = [self.units[i] for i in axes_that_carry(robot, "part") if i < len(self.units)]
        self.coupled = carrying[0] if carrying else ""
        """The unit that carries the part; empty where none does."""

    @property
    def speeds(self) -> ExternalSpeeds:
        """The largest speeds of the linear and rotary axes."""
        robot = self.robot
        if not robot.externals:
            return NO_EXTERNAL
        own = robot.speed_limits()[0][robot.family.joints :]
        linear = [1e3 * v for v, a in zip(own, robot.externals, strict=True) if a.kind == "linear"]
        turning = [
            float(np.degrees(v))
            for v, a in zip(own, robot.externals, strict=True)
            if a.kind == "rotary"
        ]
        return ExternalSpeeds(
            linear_mm_s=max(linear, default=NO_EXTERNAL.linear_mm_s),
            rotary_deg_s=max(turning, default=NO_EXTERNAL.rotary_deg_s),
            shared=True,
        )

    def values(self, q: Array) -> list[str]:
        """Return what targets say of the axes at joint vectors q (K, n)."""
        texts = []
        for row in said(self.robot, q).tolist():
            values = dict(zip(self.letters, row, strict=True))
            words = [number(values[c], 6) if c in values else NONE for c in LETTERS]
            texts.append(f"[{','.join(words)}]")
        return texts

    def read(self, values: Sequence[float]) -> Array | str:
        """Return the values (E,) m and rad that a target says, or why it says none."""
        axes = self.robot.externals
        names = {c: axis.name for c, axis in zip(self.letters, axes, strict=True)}
        for letter, value in zip(LETTERS, values, strict=True):
            if letter in names and value == ABSENT:
                return f"eax_{letter} says no value of {names[letter]}"
            if letter not in names and value != ABSENT:
                return f"eax_{letter} = {value:g}: no external axes are there, expected {NONE}"
        said_values = [values[LETTERS.index(letter)] for letter in self.letters]
        return from_said(self.robot, said_values) if axes else freeze(np.zeros(0))

    def activated(self) -> list[str]:
        """Return the lines that activate every unit; the robot stands."""
        return [f"ActUnit {unit};" for unit in dict.fromkeys(self.units)]

    def deactivated(self) -> list[str]:
        """Return the lines that deactivate the unit that carries the part; a track stays active."""
        return [f"DeactUnit {self.coupled};"] if self.coupled else []

    def remarks(self) -> Iterator[str]:
        """Yield what the controller has to have set up."""
        yield from map(plain, setup_remarks(self.robot))
        for axis, unit, letter in zip(self.robot.externals, self.units, self.letters, strict=True):
            yield f"{plain(axis.name)} is eax_{letter}, of the mechanical unit {unit}."
        if self.coupled:
            yield from calibration_remarks(self.robot, self.coupled, self.frame)


def missing(robot: Robot, settings: RapidSettings) -> Iterator[str]:
    """Yield what is not known of a robot's external axes, or cannot be said of them."""
    count, letters = len(robot.externals), settings.external_letters
    names = ", ".join(axis.name for axis in robot.externals)
    for key, values, what in (
        ("mechanical_units", settings.mechanical_units or (), "mechanical unit"),
        ("external_letters", letters or LETTERS[:count], "letter"),
    ):
        if len(values) != count:
            yield (
                f"expected a {what} for each external axis ({names}), got {len(values)}; say which "
                f"with {key} in [program.rapid]"
            )
    if len(set(letters or "")) < len(letters or ""):
        yield f"external_letters: two external axes have the same letter, {letters!r}"
    units = list(zip(settings.mechanical_units or (), robot.externals, strict=False))
    carry = {what: {u for u, axis in units if axis.carries == what} for what in ("part", "robot")}
    if len(carry["part"]) > 1:
        yield (
            f"the part is carried by {' and '.join(sorted(carry['part']))}; a work object is "
            "coordinated with one mechanical unit"
        )
    for unit in sorted(carry["part"] & carry["robot"]):
        yield f"the mechanical unit {unit} cannot carry both robot and part; name two"
