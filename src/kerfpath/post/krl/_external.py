"""External axes in KRL: their numbers, and the base that moves with the part.

A target gives external axis n as En, in mm or deg. EK couples $BASE to an external kinematic system
of the configuration (MACHINE_DEF, #EASYS and so on): its third argument is the part in the frame
that moves with it. An axis that carries the robot moves $ROBROOT by its own machine data (#ERSYS);
fixed bases are in $WORLD.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np

from kerfpath._arrays import Array
from kerfpath.errors import InputError
from kerfpath.post._external import (
    axes_that_carry,
    axis_numbers,
    calibration_remarks,
    from_said,
    said,
    setup_remarks,
)
from kerfpath.post._formatter import number, plain
from kerfpath.post.krl._settings import KrlSettings
from kerfpath.robots import Robot

__all__ = ["coupled", "external_fields", "missing", "read_fields", "remarks"]

DECIMALS = 6
_FIELD = re.compile(r",E(\d) (-?\d+(?:\.\d+)?)", re.ASCII)


def coupled(robot: Robot) -> bool:
    """Return whether the base moves with the part."""
    return bool(axes_that_carry(robot, "part"))


def external_fields(robot: Robot, q: Array, settings: KrlSettings) -> list[str]:
    """Return the external axes in targets at joint vectors q (K, n), after the other fields."""
    numbers = axis_numbers(settings.external_numbers, len(robot.externals))
    return [
        "".join(f",E{n} {number(x, DECIMALS)}" for n, x in zip(numbers, row, strict=False))
        for row in said(robot, q).tolist()
    ]


def read_fields(robot: Robot, text: str, settings: KrlSettings) -> Array:
    """Return the values (E,) m and rad in a target.

    Raises
    ------
    InputError
        The external axes are not those of the robot; the message names one.
    """
    values = {int(n): float(value) for n, value in _FIELD.findall(text)}
    numbers = axis_numbers(settings.external_numbers, len(robot.externals))
    names = {n: axis.name for n, axis in zip(numbers, robot.externals, strict=True)}
    for n in names:
        if n not in values:
            raise InputError(f"E{n} is missing: the target has no value for {names[n]}")
    for n in values:
        if n not in names:
            raise InputError(f"E{n} = {values[n]:g}: the robot has no such external axis")
    if len(_FIELD.findall(text)) > len(values):
        raise InputError("the target gives an external axis twice")
    return from_said(robot, [values[n] for n in numbers]) if names else np.zeros(0)


def missing(robot: Robot, settings: KrlSettings) -> Iterator[str]:
    """Yield what is wrong in the settings for a robot's external axes."""
    numbers, count = settings.external_numbers, len(robot.externals)
    if numbers is not None and (len(numbers) != count or len(set(numbers)) < count):
        names = ", ".join(axis.name for axis in robot.externals)
        yield (
            f"expected a different number for each external axis ({names}), got {numbers}; give "
            "the number n of each En with external_numbers in [program.krl]"
        )
    if coupled(robot) and settings.base_number is not None:
        yield (
            "the base moves with the part and is written in the program; leave base_number out of "
            "[program.krl]"
        )


def remarks(robot: Robot, settings: KrlSettings) -> Iterator[str]:
    """Yield remarks on what must be set up at the controller."""
    yield from map(plain, setup_remarks(robot))
    numbers = axis_numbers(settings.external_numbers, len(robot.externals))
    for n, axis in zip(numbers, robot.externals, strict=True):
        machine = (
            f"MACHINE_DEF[{settings.machine_number}]" if axis.carries == "part" else "$ROBROOT"
        )
        yield f"{plain(axis.name)} is E{n}, and moves {machine}."
    if coupled(robot):
        what = f"MACHINE_DEF[{settings.machine_number}]"
        yield from calibration_remarks(robot, what, settings.positioner_frame)
