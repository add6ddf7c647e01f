"""External axes in programs: their values in the controller's units, and their set-up.

The targets of a program are poses of the tip in the part, wherever external axes carry robot and
part. Some controllers couple the work object to the axes that carry the part, and have the same
poses (RAPID, KRL); others have poses of the tip in the fixed frame (FANUC), see `standing`. In both
cases the controller itself takes account of axes that carry the robot.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np
from numpy.typing import ArrayLike

from kerfpath._arrays import Array, floats, freeze
from kerfpath.post._frames import euler, from_euler
from kerfpath.robots import ExternalAxis, Robot, carried

__all__ = [
    "arm_joints", "axes_that_carry", "axis_numbers", "calibration_remarks", "carrier_frame",
    "from_said", "said", "said_unit", "setup_remarks", "standing",
]  # fmt: skip

SAME_DIRECTION = 0.1
"""Sine below which x of the base does not define how a frame about an axis is turned."""


def said_unit(axis: ExternalAxis) -> str:
    """Return the unit of the values of an axis in programs: mm or deg."""
    return "mm" if axis.kind == "linear" else "deg"


def arm_joints(robot: Robot, q: ArrayLike) -> Array:
    """Return the joints (K, m) rad of the arm alone from joint vectors q (K, n)."""
    return floats(q, "q", (None, robot.joints))[:, : robot.family.joints]


def said(robot: Robot, q: ArrayLike) -> Array:
    """Return the values (K, E) of the external axes, mm and deg, from joint vectors q (K, n)."""
    values = floats(q, "q", (None, robot.joints))[:, robot.family.joints :]
    return np.asarray(values * _scales(robot))


def from_said(robot: Robot, values: ArrayLike) -> Array:
    """Return values (..., E) of the external axes in m and rad, given in mm and deg."""
    return freeze(np.asarray(values, dtype=np.float64) / _scales(robot))


def _scales(robot: Robot) -> Array:
    return np.array([1e3 if a.kind == "linear" else np.degrees(1.0) for a in robot.externals])


def axes_that_carry(robot: Robot, what: str) -> list[int]:
    """Return the numbers, from 0, of the external axes that carry "robot" or "part"."""
    return [i for i, axis in enumerate(robot.externals) if axis.carries == what]


def carrier_frame(robot: Robot, values: Sequence[float] | None = None) -> Array:
    """Return the frame that moves with the part, (4, 4) m in the robot base, all axes at zero.

    It is the identity if no axis carries the part.

    Parameters
    ----------
    robot : Robot
    values : six numbers, optional
        The frame at the controller: mm, and deg about fixed x, y, z. Default: a frame at the point
        of the last axis that carries the part. For a linear axis it is parallel to the base; for a
        rotary one, z is along the axis and x as close as possible to x of the base (to its y if
        the axis runs along x).
    """
    if values is not None:
        return freeze(from_euler(values, "xyz")[0])
    T = np.eye(4)
    for i in axes_that_carry(robot, "part")[-1:]:
        axis = robot.externals[i]
        T[:3, 3] = axis.point
        if axis.kind == "rotary":
            across = np.eye(3)[:2] - axis.axis[:2, None] * axis.axis
            x = across[int(np.linalg.norm(across[0]) < SAME_DIRECTION)]
            x = x / np.linalg.norm(x)
            T[:3, :3] = np.c_[x, np.cross(axis.axis, x), axis.axis]
    return freeze(T)


def standing(robot: Robot, T_base_part: Array, external: Array) -> Array:
    """Return the poses (K, 4, 4) m of the part in the part frame with all axes at zero.

    `external` has the values (K, E) m and rad of the external axes.
    """
    moved = carried(robot.externals, external, "part")
    return np.asarray(np.linalg.inv(T_base_part) @ moved @ T_base_part)


def words_of(values: Iterable[float], decimals: int) -> str:
    """Return numbers as text for a remark."""
    return " ".join(f"{round(float(x), decimals) + 0.0:.10g}" for x in values)


def calibration_remarks(robot: Robot, what: str, values: Sequence[float] | None) -> Iterator[str]:
    """Yield remarks on the required frame of the unit that carries the part, named `what`."""
    place = words_of(euler(carrier_frame(robot, values)[None], "xyz")[0], 4)
    yield f"At 0 the frame of {what} stands in the base at {place}"
    yield "(mm, deg about fixed x, y, z): calibrate it so, or say positioner_frame."


def axis_numbers(given: Sequence[int] | None, count: int) -> Sequence[int]:
    """Return the controller's numbers of `count` external axes; default: from 1 on."""
    return (given or range(1, count + 1))[:count]


def setup_remarks(robot: Robot, *, si: bool = False) -> Iterator[str]:
    """Yield remarks on the external axes that must be set up at the controller.

    The units are those of the program: mm and deg, or m and rad with `si`.
    """
    for axis in robot.externals:
        unit = axis.unit if si else said_unit(axis)
        way = "along" if axis.kind == "linear" else "about"
        yield f"External axis {axis.name} ({unit}): carries the {axis.carries}"
        yield f"{way} {words_of(axis.axis, 6)} of the base"
        if axis.kind == "rotary":
            yield f"through {words_of(axis.point * 1e3, 4)} mm"
    if robot.externals:
        yield "Base: where the robot stands with all external axes at 0."
