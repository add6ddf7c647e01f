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
    """

    turning_speed: float = np.inf
    orientation: Orientation = "slerp"

    __repr__ = short_repr


PLAIN = Controller()
"""One that is never too slow to turn, about one axis."""
