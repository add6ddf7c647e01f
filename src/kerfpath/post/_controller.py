"""How a controller runs straight moves and arcs, from its maker's documents or assumed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from kerfpath._repr import short_repr

__all__ = ["PLAIN", "Controller", "Orientation"]

Orientation = Literal["slerp", "two-angle", "wrist"]
"""How the tool turns between two targets.

"slerp": it turns evenly about one fixed axis. "two-angle": its z axis swings evenly in the plane of
its directions at both targets, and the tool turns evenly about it. "wrist": the last three of six
joints move evenly from one target to the other, and the first three keep the tip on its path.
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Controller:
    """Properties of a controller that decide how it runs the path of a program.

    Parameters
    ----------
    turning_speed : float rad/s
        Largest turning speed of the tool; beyond it the tip slows down. For "two-angle", the limit
        of each angle.
    orientation : {"slerp", "two-angle", "wrist"}
        How the tool turns between two targets, see `Orientation`.
    corner : float m, optional
        Distance from every corner at which the tip begins and ends to round it, whatever the
        program contains.
    corner_time : float s, optional
        The same as a time at the programmed speed.
    assumed : str
        What is assumed of its corners, because the settings do not give it; empty if nothing is.
    """

    turning_speed: float = np.inf
    orientation: Orientation = "slerp"
    corner: float | None = None
    corner_time: float | None = None
    assumed: str = ""

    __repr__ = short_repr

    @property
    def rounds_by_itself(self) -> bool:
        """Whether it rounds corners by its own measure, not by that of the program."""
        return self.corner is not None or self.corner_time is not None

    def zone(self, said: float, speed: float) -> float:
        """Return the distance (m) from a corner at which the controller begins to round it.

        Parameters
        ----------
        said : float m
            Zone in the program; nothing is rounded at 0, which is a stop.
        speed : float m/s
            Programmed speed.
        """
        if said == 0 or not self.rounds_by_itself:
            return said
        return speed * self.corner_time if self.corner_time is not None else self.corner or 0.0


PLAIN = Controller()
"""A controller without a limit of the turning speed, which turns the tool about one axis."""
