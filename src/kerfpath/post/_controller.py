"""How a controller runs straight moves and arcs: what its maker says, and what is assumed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from kerfpath._repr import short_repr

__all__ = ["PLAIN", "Controller", "Orientation"]

Orientation = Literal["slerp", "two-angle", "wrist"]
"""What the tool does between two targets.

"slerp": it turns evenly about one axis that stands still. "two-angle": its axis z swings evenly in
the plane of where it points to at both, and the tool turns evenly about it. "wrist": the last three
of six joints go evenly from one to the other, and the first three keep the tip on its way.
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Controller:
    """What of a controller decides how it runs the path of a program.

    Parameters
    ----------
    turning_speed : float rad/s
        How fast the tool may turn before its tip goes more slowly; of "two-angle" each angle.
    orientation : {"slerp", "two-angle", "wrist"}
        What the tool does between two targets.
    corner : float m, optional
        How far from every corner the tip begins and ends to round it, whatever the program says.
    corner_time : float s, optional
        The same as a time at the programmed speed.
    assumed : str
        What of its corners is assumed as long as nobody has stated it; empty: nothing.
    """

    turning_speed: float = np.inf
    orientation: Orientation = "slerp"
    corner: float | None = None
    corner_time: float | None = None
    assumed: str = ""

    __repr__ = short_repr

    @property
    def rounds_by_itself(self) -> bool:
        """Whether it rounds corners by a measure of its own, and not by that of a program."""
        return self.corner is not None or self.corner_time is not None

    def zone(self, said: float, speed: float) -> float:
        """Return how far (m) from a corner it is rounded, of what a program says (m) and m/s.

        Nothing is rounded where a program says 0: there it stops.
        """
        if said == 0 or not self.rounds_by_itself:
            return said
        return speed * self.corner_time if self.corner_time is not None else self.corner or 0.0


PLAIN = Controller()
"""One that is never too slow to turn, about one axis."""
