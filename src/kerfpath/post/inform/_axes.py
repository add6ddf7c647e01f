"""Axes of Yaskawa controllers, and the manipulator type (RCONF) of a pose.

Axes S, L, U, R, B, T are zero with the lower arm upright, the rest straight ahead and the flange's
x up; S and L turn by the right-hand rule, U lifts the upper arm off the lower one. The joints of
the library's arms count this way (their descriptions are those of the ROS drivers, which convert
pulses to radians by a factor for each axis); other descriptions are converted by the arm's model.

The type of a position has six bits: no-flip; lower arm; rear; and for each of R, T and S whether
the angle lies beyond -180 to 180 deg. No-flip is where B is negative, as on a YRC1000: 20 positions
of an AR2010, in pulses and in its robot frame, agree with this in all bits and to 0.02 mm
(icors2/Yaskawa-Job-Helper, fixtures/calibration/CALIBRATION_STANDARD.JBI @
87495b7570f6ce15027710c068869f5a0ab0ac87 and CALIBRATION_RELATIVE.JBI @
549b81a697bf29b4d80f8966f80d891fa7b508e8). By the manuals of older controllers (NX100 149235-1CD,
3.9; DX100 156191-1CD, 4.1) it is where R lies beyond a quarter turn either way (at -90 deg, and
from 90 to 270 deg); the setting `flip` selects it. Our reading of their figures: lower arm where
the wrist centre lies behind the extended line of the lower arm; rear where it lies behind axis S.
The world of the controller has its origin on axis S at the height of axis L.
"""

from __future__ import annotations

from itertools import product
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from kerfpath._arrays import Array, Ints, floats, freeze
from kerfpath.post._axes import AxisCount, wrist_in_plane
from kerfpath.post.inform._settings import InformSettings
from kerfpath.robots import Robot

__all__ = ["axes_from_joints", "joints_at", "joints_from_axes", "manipulator_type", "posture"]

COUNTED_FROM = (0.0, 0.0, -90.0, 0.0, 0.0, -180.0)
"""Offsets (deg) of the maker's own descriptions."""
COUNT = AxisCount(
    counted_from=COUNTED_FROM,
    matrix=np.diag([1.0, 1.0, -1.0, -1.0, -1.0, -1.0]),
    shift=np.array([0.0, 0.0, np.pi / 2, 0.0, 0.0, np.pi]),
)
axes_from_joints = COUNT.from_joints
joints_from_axes = COUNT.to_joints
NOISE = 1e-6
"""How far (rad) an axis may be beyond its limit because of rounding."""
NOISE_DECIMALS = 6
"""Angles are rounded to this many decimals (deg) before they are compared."""


def manipulator_type(robot: Robot, q: ArrayLike, flip: Literal["B", "R"] = "B") -> Ints:
    """Return the six bits of RCONF, (K, 6), for joint vectors q (K, n) rad.

    Shoulder and elbow follow from `wrist_in_plane`; `flip` is the axis that decides the first bit.
    """
    q = floats(q, "q", (None, robot.joints))
    ahead, bend = wrist_in_plane(robot, q)
    axes_deg = np.round(np.degrees(axes_from_joints(robot, q)), NOISE_DECIMALS)
    turned = axes_deg[:, 3] % 360.0
    far = (axes_deg > 180) | (axes_deg <= -180)
    no_flip = axes_deg[:, 4] < 0 if flip == "B" else (turned > 90) & (turned <= 270)
    bits = [no_flip, bend < 0, ahead < 0, far[:, 3], far[:, 5], far[:, 0]]
    return freeze(np.array(bits, dtype=np.int64).T)


def posture(robot: Robot, q: Array, settings: InformSettings) -> list[tuple[int | str, ...]]:
    """Return `manipulator_type` for joint vectors q (K, n) rad, as tuples."""
    return [tuple(row) for row in manipulator_type(robot, q, settings.flip).tolist()]


def joints_at(
    robot: Robot, T_base_flange: Array, bits: tuple[int, ...], flip: Literal["B", "R"]
) -> Array | None:
    """Return the joints (6,) rad at a flange pose (4, 4) m with a type of six bits.

    The type gives the turns of S, R and T within 360 deg either way; the turns of the other axes
    are within their limits. Return None if no joints or several joints have this pose and type.
    """
    solved = robot.inverse(T_base_flange, within_limits=False).q
    turns = 2 * np.pi * np.array(list(product((-1, 0, 1), repeat=6)))
    axes = axes_from_joints(robot, (solved[:, None] + turns).reshape(-1, 6))
    q = joints_from_axes(robot, axes[(np.abs(axes) <= 2 * np.pi + 1e-9).all(axis=1)])
    if not len(q):
        return None
    q = q[(manipulator_type(robot, q, flip) == bits).all(axis=1)]
    limits = robot.joint_limits()
    within = ((q >= limits.lower - NOISE) & (q <= limits.upper + NOISE))[:, [1, 2, 4]].all(axis=1)
    q = q[within]
    return freeze(q[0]) if len(q) == 1 else None
