"""Axes of Staubli controllers, and the configuration of a pose.

Axes: all of them turn by the right-hand rule and are zero with the arm upright. The flange is then
parallel to the world, which has its origin on axis 1 at the height of axis 2. A public project for
a TX90 confirms this: its joints lead to a point that it contains, to 1e-5 mm:
ThenesVara/Checkers_Staubli, AA_Chessie.dtx @ 6129e2fb29f4b3461ddd9c3177d49867b4a5be20.

Configuration: `lefty` where the wrist centre lies ahead of axis 1, as the arm faces, else
`righty`; `epositive` where axis 3 is not negative, else `enegative`; `wpositive` where axis 5 is
not negative, else `wnegative`. Two public post processors write them this way (RoboDK's,
visose/Robots); the point of that project agrees in the first two, but has wpositive where axis 5 is
-14 deg. A straight move keeps the configuration, so that points may have "the same" instead. Points
contain no turns.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from kerfpath._arrays import Array, floats
from kerfpath.post._axes import AxisCount, wrist_in_plane
from kerfpath.post.val3._settings import Val3Settings
from kerfpath.robots import Robot

__all__ = ["SAME", "axes_from_joints", "configurations", "joints_from_axes", "posture"]

SAME = ("ssame", "esame", "wsame")
"""Words of a point that keeps the configuration."""

COUNT = AxisCount()
axes_from_joints = COUNT.from_joints
joints_from_axes = COUNT.to_joints
NOISE = 1e-8
"""Sines and lengths (m) below zero by less than this count as zero."""


def posture(robot: Robot, q: Array, settings: Val3Settings) -> list[tuple[int | str, ...]]:
    """Return the words of points for shoulder, elbow and wrist at joint vectors q (K, 6) rad."""
    return [SAME] * len(q) if settings.configurations == "same" else configurations(robot, q)


def configurations(robot: Robot, q: ArrayLike) -> list[tuple[int | str, ...]]:
    """Return the words for shoulder, elbow and wrist at joint vectors q (K, 6) rad."""
    axes = axes_from_joints(robot, q)
    ahead, _ = wrist_in_plane(robot, floats(q, "q", (None, 6)))
    _, _, q3, _, q5, _ = axes.T
    words = (
        np.where(ahead < -NOISE, "righty", "lefty").tolist(),
        np.where(np.sin(q3) < -NOISE, "enegative", "epositive").tolist(),
        np.where(np.sin(q5) < -NOISE, "wnegative", "wpositive").tolist(),
    )
    return list(zip(*words, strict=True))
