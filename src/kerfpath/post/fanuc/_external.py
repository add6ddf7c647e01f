"""External axes in FANUC listings: extended axes of group 1, and group 2 that carries the part.

Axes that carry the robot are integrated extended axes of its group, E1 and on: X to Z are those of
the tip in the world, wherever the robot is. Axes that carry the part are the joints of group 2, the
leader, and COORD on a motion moves the tip straight relative to the part. Positions are in the user
frame, which is fixed: the part frame with all axes at 0. They therefore give the tip after the part
has been moved, and each belongs to the values of group 2 beside it. The layout is that of
controllers' own listings with extended axes and a second group.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np

from kerfpath._arrays import Array
from kerfpath.errors import InputError
from kerfpath.post._external import axes_that_carry, from_said, said, setup_remarks
from kerfpath.post._formatter import number
from kerfpath.robots import Robot

__all__ = [
    "EXTENDED", "GROUP_2", "extended_rows", "group_2_rows", "groups", "leads", "read_values",
    "remarks",
]  # fmt: skip

DECIMALS = 6
_VALUE = r"= *-?\d*\.\d+ +(?:mm|deg)"
EXTENDED = rf"((?:,\s*E\d{_VALUE})*)"
"""Regular expression of the extended axes of a position, after its last value."""
GROUP_2 = rf"(?:\n\s*GP2:\n\s*UF : (\d+), UT : (\d+),\s*(J\d{_VALUE}(?:,\s*J\d{_VALUE})*))?"
"""Regular expression of group 2 of a position: user frame, tool frame, values."""
_SAID = re.compile(r"([EJ]\d)= *(-?\d*\.\d+) +(mm|deg)", re.ASCII)


def leads(robot: Robot) -> bool:
    """Return whether group 2 carries the part."""
    return bool(axes_that_carry(robot, "part"))


def groups(robot: Robot) -> str:
    """Return the motion groups, of five, in programs that move a robot."""
    return "1,1,*,*,*" if leads(robot) else "1,*,*,*,*"


def _words(robot: Robot) -> dict[int, str]:
    """Return the name of each external axis in positions, by its number from 0."""
    names = {i: f"E{k}" for k, i in enumerate(axes_that_carry(robot, "robot"), 1)}
    return names | {i: f"J{k}" for k, i in enumerate(axes_that_carry(robot, "part"), 1)}


def _rows(robot: Robot, q: Array, letter: str) -> str:
    """Return the values of the axes whose names begin with a letter, at joints q (n,)."""
    words, texts = _words(robot), []
    for i, value in enumerate(said(robot, q[None])[0]):
        if words[i][0] == letter:
            measure = " mm" if robot.externals[i].kind == "linear" else "deg"
            texts.append(f"{words[i]}={number(value, DECIMALS):>13} {measure}")
    return ",\t".join(texts)


def extended_rows(robot: Robot, q: Array) -> list[str]:
    """Return the row of extended axes at joints q (n,), if there is any."""
    return [f"\t{text}"] if (text := _rows(robot, q, "E")) else []


def group_2_rows(robot: Robot, q: Array, frames: str) -> list[str]:
    """Return the rows of group 2 at joints q (n,), if there is one."""
    return ["   GP2:", frames, f"\t{text}"] if (text := _rows(robot, q, "J")) else []


def read_values(robot: Robot, extended: str, leading: str) -> Array:
    """Return the values (E,) m and rad in a position.

    Raises
    ------
    InputError
        The axes are not those of the robot, or have another unit; the message names one.
    """
    found = [*_SAID.findall(extended), *_SAID.findall(leading)]
    values = {word: (float(value), unit) for word, value, unit in found}
    words, axes = _words(robot), robot.externals
    if unknown := [word for word in values if word not in words.values()]:
        raise InputError(f"{unknown[0]}: the robot has no such external axis")
    if len(found) > len(values):
        raise InputError("the position gives an external axis twice")
    rows = []
    for i, word in sorted(words.items()):
        unit = "mm" if axes[i].kind == "linear" else "deg"
        if word not in values:
            raise InputError(f"{word} is missing: the position has no value for {axes[i].name}")
        if values[word][1] != unit:
            raise InputError(f"{word}: expected {unit}, got {values[word][1]}")
        rows.append(values[word][0])
    return from_said(robot, rows) if rows else np.zeros(0)


def remarks(robot: Robot) -> Iterator[str]:
    """Yield remarks on what must be set up at the controller."""
    yield from setup_remarks(robot)
    for i, word in sorted(_words(robot).items()):
        where = "GP1, integrated" if word[0] == "E" else "GP2, the leader of GP1"
        yield f"{robot.externals[i].name} is {word} of {where}."
