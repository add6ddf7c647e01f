"""How low the joints of an arm are."""

from __future__ import annotations

import numpy as np

from kerfpath._arrays import Array
from kerfpath.robots._chain import chain_of
from kerfpath.robots._robot import Robot

__all__ = ["lowest_joint"]

FIRST = 3
"""The elbow is at axis 3; what comes before is as high as the robot stands."""
AT_ONCE = 50_000
"""Joint vectors whose frames are held at once: 50 MB of them."""


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
        frames = chain.frames(q[some])
        flange = frames[:, -1] @ chain.end
        joints = frames[:, chain.base + FIRST :, 2, 3]
        found[some] = np.minimum(joints.min(axis=1), flange[:, 2, 3])
    return found
