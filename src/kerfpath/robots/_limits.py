"""What joint limits must be."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from kerfpath.errors import InputError
from kerfpath.kernels.turns import MOST_TURNS

if TYPE_CHECKING:
    from kerfpath.robots._robot import Robot

__all__ = ["for_each", "require_few_turns", "require_order"]


def require_order(robot: Robot) -> None:
    """Require of position limits, where both are known, that they are in order.

    Raises
    ------
    InputError
        Limits of a joint that are reversed.
    """
    if robot.lower is None or robot.upper is None:
        return
    n = robot.family.joints
    if robot.external is not None:
        robot.external.require_range(float(robot.lower[n]), float(robot.upper[n]))
    reversed_ = np.flatnonzero(~(robot.lower[:n] < robot.upper[:n]))
    if reversed_.size:
        i = int(reversed_[0])
        raise InputError(
            f"robot {robot.id!r}: limits of joint {i + 1} are reversed, lower "
            f"{np.degrees(robot.lower[i]):g} deg is not below upper "
            f"{np.degrees(robot.upper[i]):g} deg"
        )


def require_few_turns(robot: Robot) -> None:
    """Require of position limits that the kernels have room for every combination of turns.

    Raises
    ------
    InputError
        Limits that are not known, or that leave more: some would be lost.
    """
    n, limits = robot.family.joints, robot.joint_limits()
    span = (limits.upper - limits.lower)[:n] / (2 * np.pi)
    turns = np.where(limits.endless[:n], 1.0, np.floor(span) + 1).prod()
    if turns > MOST_TURNS:
        raise InputError(
            f"robot {robot.id!r}: its limits leave {turns:g} combinations of turns, at most "
            f"{MOST_TURNS} are told apart; call joints that turn without end endless, or narrow "
            "their limits"
        )


def for_each(value: ArrayLike, joints: int) -> ArrayLike:
    """Return one number as that number for each joint; anything longer as it is."""
    return np.full(joints, value) if np.ndim(value) == 0 else value
