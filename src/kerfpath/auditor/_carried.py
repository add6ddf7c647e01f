"""Enclosures of a pose that moves with the part, as seen from the robot base on external axes."""

from __future__ import annotations

from kerfpath.auditor._enclosure import seen_from_foot
from kerfpath.auditor._intervals import exact
from kerfpath.auditor._jets import Jet
from kerfpath.robots import ExternalAxis, Robot

__all__ = ["CarryingAxes", "Column"]

Column = tuple[Jet, Jet, Jet]
"""A direction or a point."""


class CarryingAxes:
    """The external axes of a robot in the frame of its model's base, with all axes at zero."""

    def __init__(self, robot: Robot) -> None:
        numbered = list(enumerate(robot.externals))
        part = [(i, axis) for i, axis in numbered if axis.carries == "part"]
        carriers = [(i, axis) for i, axis in numbered if axis.carries == "robot"]
        # On the way from the part to the base, the part's innermost axis comes first, and the
        # outermost of the axes under the robot comes before the inner ones.
        self._passed = [_Axis(robot, *each) for each in [*part[::-1], *carriers]]

    def moved(self, columns: list[Column], values: list[Jet]) -> list[Column]:
        """Return axes x, y, z and a point of a frame that moves with the part, in the moved base.

        Parameters
        ----------
        columns : four columns of jets
            x, y, z and the point with all axes at zero.
        values : list of Jet
            Values of the axes, rad or m.
        """
        for axis in self._passed:
            columns = axis.moved(columns, values[axis.number])
        return columns


class _Axis:
    """One external axis: a direction and a point on it, enclosed."""

    def __init__(self, robot: Robot, number: int, axis: ExternalAxis) -> None:
        self.number = number
        self._sign = 1.0 if axis.carries == "part" else -1.0
        self._turns = axis.kind == "rotary"
        unit = exact(axis.axis)
        size = (unit[0].square() + unit[1].square() + unit[2].square()).sqrt()
        direction = [unit[i] / size for i in range(3)]
        self._direction, self._point = seen_from_foot(robot, direction, exact(axis.point))

    def moved(self, columns: list[Column], value: Jet) -> list[Column]:
        """Return axes and point of a frame moved by this axis to a value."""
        *axes, point = columns
        value = value.scaled(self._sign)
        if not self._turns:
            way = [p + value.times(k) for p, k in zip(point, self._direction, strict=True)]
            return [*axes, (way[0], way[1], way[2])]
        c, s = value.cos_sin()
        x, y, z = (p.plus(-o) for p, o in zip(point, self._point, strict=True))
        u, v, w = self._turned((x, y, z), c, s)
        a, b, d = self._point
        return [*(self._turned(each, c, s) for each in axes), (u.plus(a), v.plus(b), w.plus(d))]

    def _turned(self, r: Column, c: Jet, s: Jet) -> Column:
        """Return a vector turned about the direction k by an angle of cosine c and sine s.

        By Rodrigues' formula the part along k stays, and the rest r' becomes c r' + s (k x r).
        """
        k = self._direction
        along = r[0].times(k[0]) + r[1].times(k[1]) + r[2].times(k[2])
        turned = []
        for i in range(3):
            m, n = (i + 1) % 3, (i + 2) % 3
            own = along.times(k[i])
            turned.append(own + c * (r[i] - own) + s * (r[n].times(k[m]) - r[m].times(k[n])))
        return turned[0], turned[1], turned[2]
