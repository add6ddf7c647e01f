"""External axes in jobs: base axes that carry the robot, stations that carry the part, in pulses.

With external axes every position is in pulses: those of the arm (C), of the base axes (BC, control
group BS1 beside RB1) and of the station (EC, group ST1). A path on a part that a station carries is
SMOVL: the robot follows the station, which +MOVJ moves. Layout and groups are those of a DX200's
own jobs (MQCIA/yaskawa-cadcam, reference cell with RECT-X and TURN-1).
"""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np

from kerfpath._arrays import Array
from kerfpath.errors import InputError
from kerfpath.post._external import axes_that_carry, from_said, said, setup_remarks
from kerfpath.post.inform._settings import InformSettings
from kerfpath.robots import Robot

__all__ = ["ExternalPulses", "missing"]

_MOVE = re.compile(
    r"S?(MOVJ|MOVL) (C\d{5})(?: BC\d{5})? (VJ?=[\d.]+ PL=\d)"
    r"(?: \+MOVJ EC\d{5}(?: VJ=[\d.]+)?)?",
    re.ASCII,
)
_POSITION = re.compile(r"(BC|EC)(\d{5})=(-?\d+(?:,-?\d+)*)", re.ASCII)


class ExternalPulses:
    """The external axes of a robot in the lines of its jobs.

    Parameters
    ----------
    robot : Robot
    settings : InformSettings
        Settings with pulses for each axis; `missing` reports before if they are not given.
    """

    def __init__(self, robot: Robot, settings: InformSettings) -> None:
        self.robot = robot
        count = len(robot.externals)
        self.scales = np.array((settings.external_pulses or [np.nan] * count)[:count])
        self.numbers = {
            word: axes_that_carry(robot, what) for word, what in (("BC", "robot"), ("EC", "part"))
        }
        """The numbers, from 0, of the axes in positions of each kind."""

    def kinds(self) -> list[str]:
        """Return the kinds of positions beside those of the arm."""
        return [word for word, numbers in self.numbers.items() if numbers]

    def counts(self, count: int) -> str:
        """Return the numbers of ///NPOS for `count` positions."""
        each = [count, *(count if self.numbers[word] else 0 for word in ("BC", "EC")), 0, 0, 0]
        return ",".join(map(str, each))

    def groups(self) -> list[str]:
        """Return the control groups of a job."""
        base = ",BS1" if self.numbers["BC"] else ""
        return [f"///GROUP1 RB1{base}", *(["///GROUP2 ST1"] if self.numbers["EC"] else [])]

    def rows(self, q: Array) -> list[str]:
        """Return the positions of base axes and station, at joints q (K, n)."""
        pulses = np.round(said(self.robot, q) * self.scales).astype(np.int64)
        return [
            f"{word}{k:05d}={','.join(map(str, row[self.numbers[word]].tolist()))}"
            for word in self.kinds()
            for k, row in enumerate(pulses)
        ]

    def read(self, row: str, word: str, k: int, pulses: Array) -> None:
        """Read position k of a kind from a row into the pulses (E,) of the external axes.

        Raises
        ------
        InputError
            The row is not a position that `rows` writes there.
        """
        match, numbers = _POSITION.fullmatch(row), self.numbers[word]
        if match is None or (match[1], int(match[2])) != (word, k):
            raise InputError(f"expected position {word}{k:05d}, got {row[:60]!r}")
        values = match[3].split(",")
        if len(values) != len(numbers):
            names = " and ".join(self.robot.externals[i].name for i in numbers)
            raise InputError(f"{word}{k:05d}: expected pulses of {names}, got {match[3]}")
        pulses[numbers] = [float(value) for value in values]

    def values(self, pulses: Array) -> Array:
        """Return values (K, E) m and rad of pulses."""
        return from_said(self.robot, pulses / self.scales)

    def moved(self, line: str) -> str:
        """Return the line of a move with the positions of base axes and station."""
        word, target, *rest = line.split(" ")
        base = [f"B{target}"] if self.numbers["BC"] else []
        if not self.numbers["EC"]:
            return " ".join([word, target, *base, *rest])
        share = [rest[0]] if word == "MOVJ" else []
        word = "SMOVL" if word == "MOVL" else word
        return " ".join([word, target, *base, *rest, "+MOVJ", f"E{target}", *share])

    def plain(self, row: str) -> str:
        """Return the line of a move without base axes and station; any other line unchanged.

        Raises
        ------
        InputError
            The move does not have exactly the external axes of the robot.
        """
        match = _MOVE.fullmatch(row)
        if match is None:
            return row
        line = " ".join(match.groups())
        if (expected := self.moved(line)) != row:
            raise InputError(f"expected {expected!r}, got {row[:60]!r}")
        return line

    def remarks(self) -> Iterator[str]:
        """Yield remarks on what must be set up at the controller."""
        yield from setup_remarks(self.robot)
        for word, group in (("BC", "base axis"), ("EC", "axis of station ST1")):
            for number, i in enumerate(self.numbers[word], 1):
                yield f"{self.robot.externals[i].name} is {group} {number}."


def missing(robot: Robot, settings: InformSettings) -> Iterator[str]:
    """Yield what is missing in the settings for a robot's external axes."""
    names = ", ".join(axis.name for axis in robot.externals)
    if settings.pulses_per_deg is None:
        yield (
            f"with external axes ({names}) all positions are in pulses; give pulses_per_deg in "
            "[program.inform]"
        )
    given = settings.external_pulses or []
    if len(given) != len(robot.externals):
        yield (
            f"expected the pulses per mm or deg of each external axis ({names}), got {len(given)}; "
            "give external_pulses in [program.inform]"
        )
