"""Names of the joints in the table of a plan."""

from __future__ import annotations

from kerfpath.robots import Robot

__all__ = ["joint_columns"]

TAKEN = frozenset({"s", "x", "y", "z", "gamma", "lead", "lean"})
"""Names of the other columns in lengths and angles."""


def joint_columns(robot: Robot) -> tuple[str, ...]:
    """Return the names of the joints in tables, without a unit: q1, q2, ..., then external axes.

    "_axis" is appended to the name of an external axis if another column has that name.
    """
    names = [f"q{i + 1}" for i in range(robot.family.joints)]
    for axis in robot.externals:
        name = axis.name
        while name in TAKEN or name in names:
            name += "_axis"
        names.append(name)
    return tuple(names)
