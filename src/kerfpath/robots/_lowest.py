"""Height of the lowest joint of an arm."""

from __future__ import annotations

import numpy as np

from kerfpath._arrays import Array
from kerfpath.robots._chain import chain_of
from kerfpath.robots._external import carried
from kerfpath.robots._robot import Robot
from kerfpath.urdf import KinematicChain

__all__ = ["lowest_joint"]

FIRST = 3
"""The first axis that counts, the elbow; the height of axes 1 and 2 does not depend on q."""
AT_ONCE = 10_000
"""Number of joint vectors processed at once, so that their data stay in the cache."""


def lowest_joint(robot: Robot, q: Array) -> Array:
    """Return the height (B,) m of the lowest of elbow, wrist and flange at q (B, n) rad.

    Heights are those of the origins of the joints from axis 3 on and of the flange, in the robot
    base with every external axis at zero.

    Raises
    ------
    InputError
        As `chain_of`.
    """
    chain, found = chain_of(robot), np.empty(len(q))
    for first in range(0, len(q), AT_ONCE):
        some = slice(first, first + AT_ONCE)
        found[some] = _lowest(chain, robot, q[some])
    return found


def _lowest(chain: KinematicChain, robot: Robot, q: Array) -> Array:
    # Third row of the pose of one frame after the other; its last entry is the height.
    row = np.array(carried(robot.externals, q[:, robot.family.joints :], "robot")[:, 2])
    lowest = np.full(len(q), np.inf)
    for i, axis in enumerate(chain.axes):
        row = row @ chain.origins[i]
        up, s, c = row[:, :3], np.sin(q[:, i])[:, None], np.cos(q[:, i])[:, None]
        row[:, :3] = up * c + np.cross(up, axis) * s + (up @ axis)[:, None] * axis * (1 - c)
        if i + 1 >= FIRST:
            lowest = np.minimum(lowest, row[:, 3])
    return np.asarray(np.minimum(lowest, (row @ chain.end)[:, 3]))
