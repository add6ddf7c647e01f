"""The table of a plan: one name for each column, with its unit."""

from __future__ import annotations

from kerfpath.robots import Robot

__all__ = ["joint_columns"]

TAKEN = frozenset({"s", "x", "y", "z", "gamma", "lead", "lean"})
"""Columns beside the joints whose unit is a length or an angle."""


def joint_columns(robot: Robot) -> tuple[str, ...]:
    """Return what tables call the joints, without a unit: q1 and on, external axes by their names.

    An axis whose name another column has is called that with "_axis" behind it.
    """
    names = [f"q{i + 1}" for i in range(robot.family.joints)]
    for axis in robot.externals:
        name = axis.name
        while name in TAKEN or name in names:
            name += "_axis"
        names.append(name)
    return tuple(names)
