"""Two public seven-axis arms, by the lengths and limits that their makers publish."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from kerfpath import Robot
from kerfpath.robots.limits import RobotLimits
from kerfpath.robots.recognition import recognise
from kerfpath.urdf import KinematicChain

__all__ = ["fetch", "panda", "panda_chain"]


def panda_chain() -> KinematicChain:
    """Return the joints of Franka's Panda up to its flange (its documents, Craig's convention)."""
    a = [0, 0, 0, 0.0825, -0.0825, 0, 0.088]
    d = [0.333, 0, 0.316, 0, 0.384, 0, 0]
    quarters = [0, -1, 1, 1, -1, 1, 1]
    origins = np.tile(np.eye(4), (7, 1, 1))
    turns = np.pi / 2 * np.array(quarters)[:, None] * [1.0, 0.0, 0.0]
    origins[:, :3, :3] = Rotation.from_rotvec(turns).as_matrix()
    origins[:, :3, 3] = origins[:, :3, 2] * np.array(d)[:, None]
    origins[:, 0, 3] += a
    end = np.eye(4)
    end[2, 3] = 0.107
    return KinematicChain(origins=origins, axes=np.tile([0.0, 0.0, 1.0], (7, 1)), end=end)


def panda() -> Robot:
    """Return Franka's Panda, with its joint limits."""
    return _robot(
        "panda", panda_chain(),
        lower=[-2.8973, -1.7628, -2.8973, -3.0718, -2.8973, -0.0175, -2.8973],
        upper=[2.8973, 1.7628, 2.8973, -0.0698, 2.8973, 3.7525, 2.8973],
        velocity=[2.175] * 4 + [2.61] * 3, acceleration=[15, 7.5, 10, 12.5, 15, 20, 20],
    )  # fmt: skip


def fetch() -> Robot:
    """Return the arm of Fetch from its torso to the gripper (its description).

    It gives no accelerations: 10 rad/s^2 are assumed.
    """
    origins, end = np.tile(np.eye(4), (7, 1, 1)), np.eye(4)
    origins[0, :3, 3] = 0.119525, 0.0, 0.34858
    origins[1, :3, 3] = 0.117, 0.0, 0.06
    origins[2:, 0, 3] = 0.219, 0.133, 0.197, 0.1245, 0.1385
    end[0, 3] = 0.16645
    x, y, z = np.eye(3)
    chain = KinematicChain(origins=origins, axes=np.array([z, y, x, y, x, y, x]), end=end)
    turn = np.pi
    return _robot(
        "fetch_arm", chain,
        lower=[-1.6056, -1.221, -turn, -2.251, -turn, -2.16, -turn],
        upper=[1.6056, 1.518, turn, 2.251, turn, 2.16, turn],
        velocity=[1.256, 1.454, 1.571, 1.521, 1.571, 2.268, 2.268], acceleration=[10.0] * 7,
        endless=[False, False, True, False, True, False, True],
    )  # fmt: skip


def _robot(
    name: str, chain: KinematicChain, *, endless: ArrayLike = False, **limits: ArrayLike
) -> Robot:
    each: dict[str, Any] = {key: np.array(values, float) for key, values in limits.items()}
    each["endless"] = np.broadcast_to(np.asarray(endless, np.bool_), 7).copy()
    return Robot(id=name, arm=recognise(chain)[0], limits=RobotLimits(**each))
