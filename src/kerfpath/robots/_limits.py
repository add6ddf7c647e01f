"""What joint limits must be."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from kerfpath.errors import InputError
from kerfpath.kernels.turns import MOST_TURNS

if TYPE_CHECKING:
    from kerfpath.robots._robot import Robot

__all__ = ["require_limits"]


def require_limits(robot: Robot) -> None:
    """Require of known position limits that they are in order, and leave a finite choice of turns.

    Raises
    ------
    InputError
        Limits of a joint that are reversed, or ranges with more combinations of turns than the
        kernels have room for.
    """
    assert robot.lower is not None
    assert robot.upper is not None
    n = robot.family.joints
    lower, upper = robot.lower[:n], robot.upper[:n]
    if robot.external is not None:
        robot.external.require_range(float(robot.lower[n]), float(robot.upper[n]))
    reversed_ = np.flatnonzero(~(lower < upper))
    if reversed_.size:
        i = int(reversed_[0])
        raise InputError(
            f"robot {robot.id!r}: limits of joint {i + 1} are reversed, lower "
            f"{np.degrees(lower[i]):g} deg is not below upper {np.degrees(upper[i]):g} deg"
        )
    turns = np.where(robot.endless[:n], 1.0, np.floor((upper - lower) / (2 * np.pi)) + 1)
    if turns.prod() > MOST_TURNS:
        raise InputError(
            f"robot {robot.id!r}: its limits leave {turns.prod():g} combinations of turns, at most "
            f"{MOST_TURNS} are told apart; call joints that turn without end endless, or narrow "
            "their limits"
        )
