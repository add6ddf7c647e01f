"""Axes of FANUC controllers, the configuration of a pose, and the frames.

Axes: J2 is 0 with the lower arm upright and grows forwards; J3 is the angle of the upper arm above
the horizontal, whatever J2 is; J4, J5 and J6 are 0 with the tool straight ahead. All of them follow
from the geometry of the arm, so that joints of any description can be converted.

Configuration: F where J5 is above 0 (beyond half a turn, its sine), else N; D where the wrist
centre lies behind the extended line of the lower arm, else U; B where it lies behind axis 1, else
T; then the turns of three axes, 0 within 180 deg, 1 from 180 to 540 deg, -1 from -180 to -540 deg.

The frames of the controller: its world has its origin on axis 1 at the height of axis 2; its
faceplate has z out of the flange and, with all axes at 0, x upwards.

Measured by others on FANUC's simulated controller for an M-20iD/25: LeroyDu56/robconv,
tests/fixtures/probes/results/CFGPROBE_roboguide.LS @ d0efb3210bd6c3692a3bba8adad6fefa8af5c146.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from kerfpath._arrays import Array, Ints, floats, freeze
from kerfpath.post._axes import AxisCount, wrist_in_plane
from kerfpath.post.fanuc._settings import FanucSettings
from kerfpath.robots import Robot

__all__ = ["axes_from_joints", "joints_from_axes", "posture", "turns"]

COUNTED_FROM = (0.0, 0.0, -90.0, 0.0, 0.0, -180.0)
"""Offsets (deg) of the maker's own descriptions."""
NOISE_DECIMALS = 6
"""Angles are rounded to this many decimals (deg) before their turns are counted."""
NOISE = 1e-8
"""Sine that counts as zero."""
MATRIX = np.diag([1.0, 1.0, -1.0, -1.0, -1.0, -1.0])
MATRIX[2, 1] = -1.0
COUNT = AxisCount(
    counted_from=COUNTED_FROM, matrix=MATRIX, shift=np.array([0.0, 0.0, np.pi / 2, 0.0, 0.0, np.pi])
)
axes_from_joints = COUNT.from_joints
joints_from_axes = COUNT.to_joints
TURNING = {"J1 J4 J6": [0, 3, 5], "J4 J5 J6": [3, 4, 5]}


def turns(robot: Robot, q: ArrayLike, settings: FanucSettings) -> Ints:
    """Return the turns (K, 3) of the axes in the settings, for joint vectors q (K, n) rad."""
    axes_deg = np.degrees(axes_from_joints(robot, q))[:, TURNING[settings.turns]]
    axes_deg = np.round(axes_deg, NOISE_DECIMALS)
    return freeze((np.sign(axes_deg) * np.floor((np.abs(axes_deg) + 180) / 360)).astype(np.int64))


def posture(robot: Robot, q: Array, settings: FanucSettings) -> list[tuple[int | str, ...]]:
    """Return the configurations of joint vectors q (K, n) rad: three letters and three turns.

    Shoulder and elbow follow from `wrist_in_plane`.
    """
    q = floats(q, "q", (None, robot.joints))
    ahead, bend = wrist_in_plane(robot, q)
    flipped = np.sin(axes_from_joints(robot, q)[:, 4]) > NOISE
    letters = zip(
        np.where(flipped, "F", "N").tolist(),
        np.where(bend < 0, "D", "U").tolist(),
        np.where(ahead < 0, "B", "T").tolist(),
        strict=True,
    )
    numbers = turns(robot, q, settings).tolist()
    return [(*words, *three) for words, three in zip(letters, numbers, strict=True)]
