"""How low the joints of an arm are."""

from __future__ import annotations

import numpy as np

from kerfpath._arrays import Array
from kerfpath.robots._chain import chain_of
from kerfpath.robots._external import carried
from kerfpath.robots._robot import Robot
from kerfpath.urdf import KinematicChain

__all__ = ["lowest_joint"]

FIRST = 3
"""The elbow is at axis 3; what comes before is as high as the robot stands."""
AT_ONCE = 10_000
"""Joint vectors whose rows are held at once: they stay in the cache."""


def lowest_joint(robot: Robot, q: Array) -> Array:
    """Return the height (B,) m over the robot base of the lowest of elbow, wrist and flange.

    Of joint vectors q (B, n) rad: by the middles of the joints from axis 3 on, and of the flange;
    over the base as it stands with every external axis at zero.

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
    # The third row of the pose of each frame in turn: its last entry is the height.
    row = np.array(carried(robot.externals, q[:, robot.family.joints :], "robot")[:, 2])
    lowest = np.full(len(q), np.inf)
    for i, axis in enumerate(chain.axes):
        row = row @ chain.origins[i]
        up, s, c = row[:, :3], np.sin(q[:, i])[:, None], np.cos(q[:, i])[:, None]
        row[:, :3] = up * c + np.cross(up, axis) * s + (up @ axis)[:, None] * axis * (1 - c)
        if i + 1 >= FIRST:
            lowest = np.minimum(lowest, row[:, 3])
    return np.asarray(np.minimum(lowest, (row @ chain.end)[:, 3]))
