"""External axes in RAPID: their letters, mechanical units and speeds.

A target gives each external axis under a letter, eax_a to eax_f, in mm or deg; 9E9 means no axis. A
unit that carries the part moves the user frame of the work object that names it (wobjdata: ufprog
FALSE, ufmec). The calibration of the unit defines that frame, and the object frame is the part in
it. A track moves the base of the robot, which the controller knows from its own configuration; a
fixed work object is in the world.
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
"""Value for an axis that does not exist."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ExternalSpeeds:
    """v_leax (mm/s) and v_reax (deg/s) of speed data.

    Parameters
    ----------
    linear_mm_s, rotary_deg_s : float
        Speeds of linear and rotary axes at full speed.
    shared : bool
        Whether joint moves at a share of the full speed also take that share of these speeds.
    """

    linear_mm_s: float = 5000.0
    rotary_deg_s: float = 1000.0
    shared: bool = False

    __repr__ = short_repr

    def said(self, share: float) -> str:
        """Return both speeds as text, at a share of the full speed."""
        share = share if self.shared else 1.0
        return f"{number(share * self.linear_mm_s, 0)},{number(share * self.rotary_deg_s, 0)}"


NO_EXTERNAL = ExternalSpeeds()
"""Speeds for an arm alone, because speed data must contain some."""


class ExternalUnits:
    """The external axes of a robot as its controller knows them.

    Parameters
    ----------
    robot : Robot
    settings : RapidSettings
        Names of a unit and letters for every axis; `missing` reports before if they lack.
    """

    def __init__(self, robot: Robot, settings: RapidSettings) -> None:
        self.robot = robot
        count = len(robot.externals)
        self.frame = settings.positioner_frame
        self.units: Sequence[str] = (settings.mechanical_units or [])[:count]
        self.letters = (settings.external_letters or LETTERS)[:count]
        carrying = [self.units[i] for i in axes_that_carry(robot, "part") if i < len(self.units)]
        self.coupled = carrying[0] if carrying else ""
        """The unit that carries the part; empty if none does."""

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
        """Return the text of the external axes in targets at joint vectors q (K, n)."""
        texts = []
        for row in said(self.robot, q).tolist():
            values = dict(zip(self.letters, row, strict=True))
            words = [number(values[c], 6) if c in values else NONE for c in LETTERS]
            texts.append(f"[{','.join(words)}]")
        return texts

    def read(self, values: Sequence[float]) -> Array | str:
        """Return the values (E,) m and rad in a target, or what is wrong with them."""
        axes = self.robot.externals
        names = {c: axis.name for c, axis in zip(self.letters, axes, strict=True)}
        for letter, value in zip(LETTERS, values, strict=True):
            if letter in names and value == ABSENT:
                return f"eax_{letter} has no value for {names[letter]}"
            if letter not in names and value != ABSENT:
                return f"eax_{letter} = {value:g}: the robot has no such axis, expected {NONE}"
        said_values = [values[LETTERS.index(letter)] for letter in self.letters]
        return from_said(self.robot, said_values) if axes else freeze(np.zeros(0))

    def activated(self) -> list[str]:
        """Return the lines that activate every unit; the robot is stopped."""
        return [f"ActUnit {unit};" for unit in dict.fromkeys(self.units)]

    def deactivated(self) -> list[str]:
        """Return the lines that deactivate the unit that carries the part; a track stays active."""
        return [f"DeactUnit {self.coupled};"] if self.coupled else []

    def remarks(self) -> Iterator[str]:
        """Yield remarks on what must be set up at the controller."""
        yield from map(plain, setup_remarks(self.robot))
        for axis, unit, letter in zip(self.robot.externals, self.units, self.letters, strict=True):
            yield f"{plain(axis.name)} is eax_{letter}, of the mechanical unit {unit}."
        if self.coupled:
            yield from calibration_remarks(self.robot, self.coupled, self.frame)


def missing(robot: Robot, settings: RapidSettings) -> Iterator[str]:
    """Yield what is missing or wrong in the settings for a robot's external axes."""
    count, letters = len(robot.externals), settings.external_letters
    names = ", ".join(axis.name for axis in robot.externals)
    for key, values, what in (
        ("mechanical_units", settings.mechanical_units or (), "mechanical unit"),
        ("external_letters", letters or LETTERS[:count], "letter"),
    ):
        if len(values) != count:
            yield (
                f"expected a {what} for each external axis ({names}), got {len(values)}; name them "
                f"with {key} in [program.rapid]"
            )
    if len(set(letters or "")) < len(letters or ""):
        yield f"external_letters: two external axes have the same letter, {letters!r}"
    units = list(zip(settings.mechanical_units or (), robot.externals, strict=False))
    carry = {what: {u for u, axis in units if axis.carries == what} for what in ("part", "robot")}
    if len(carry["part"]) > 1:
        yield (
            f"the part is carried by {' and '.join(sorted(carry['part']))}; a work object can be "
            "coordinated with one mechanical unit only"
        )
    for unit in sorted(carry["part"] & carry["robot"]):
        yield f"the mechanical unit {unit} cannot carry both robot and part; name two"
