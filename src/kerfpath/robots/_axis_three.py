"""The meaning of a controller's axis 3: the elbow, or the upper arm from the horizontal.

In an arm with a parallel rod (IRB 2400, 4400) the upper arm keeps its orientation while axis 2
moves, and every FANUC pendant shows J3 this way: axis 3 then combines joints 2 and 3 of the serial
model, and its limits bound both. A robot description does not say which convention applies. For an
arm read from a description, axis 3 is taken from a library robot with the same lengths, or it is
given by the user. Otherwise it is unknown, and languages that contain axis 3 refuse the arm.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike

from kerfpath._arrays import Array, floats
from kerfpath.errors import InputError
from kerfpath.robots._coupling import Coupling
from kerfpath.robots._library import read_robot, robot_ids
from kerfpath.robots._manipulator import Manipulator

__all__ = ["level", "with_axis_3"]

A = TypeVar("A", bound=Manipulator)

COUNTED = {
    "ABB": ("serial", "horizontal"),
    "FANUC": ("horizontal",),
    "KUKA": ("serial",),
    "Staubli": ("serial",),
    "Universal Robots": ("serial",),
    "Yaskawa": ("serial",),
}
"""How each maker's controllers count axis 3 of six-axis arms; unknown for other makers."""
UPWARDS = ("FANUC",)
"""Makers whose axis 3 increases as the upper arm lifts; for all others it increases as it falls."""
ALIKE = 0.002
"""m: lengths that differ by less than this are the same. Published lengths are rounded by up to
0.5 mm; the lengths of different models differ by 5 mm or more."""
ARM = ("a1", "a2", "b", "c2", "c3")
"""The lengths from axis 1 to the wrist; descriptions may place foot and flange differently."""


def level(robot: Manipulator) -> tuple[Array, float]:
    """Return row (n,) and shift (rad) of axis 3 counted from the horizontal: row @ q + shift.

    The sign is that of the robot's maker; the value is zero where the upper arm is horizontal.
    """
    row = np.zeros(robot.joints)
    row[1:3] = robot.sign[1:3]
    shift = float(_wrap_offsets(-robot.offset[1]) + _wrap_offsets(-robot.offset[2] - np.pi / 2))
    way = -1.0 if robot.manufacturer in UPWARDS else 1.0
    return way * row, way * shift


def with_axis_3(robot: A, axis_3: str = "", limits: ArrayLike | None = None) -> A:
    """Return the robot with axis 3 as given, or otherwise as in the library.

    Parameters
    ----------
    robot : Robot
        A robot from a description, its axis 3 not known.
    axis_3 : {"", "serial", "horizontal"}
        What axis 3 measures; "" looks for arms of the same maker and lengths in the library.
    limits : (2,) rad, optional
        Limits of a "horizontal" axis 3, as the controller shows them.

    Raises
    ------
    InputError
        The limits are missing, not needed, or outside the range of joints 2 and 3; or `axis_3`
        contradicts the maker's controllers or a library robot with the same lengths.
    """
    if axis_3:
        return _given(robot, axis_3, limits)
    if limits is not None:
        raise InputError('axis_3_limits=: expected them with axis_3="horizontal", got no axis_3=')
    return _look_up_axis_3(robot)


def _look_up_axis_3(robot: A) -> A:
    """Return the robot with axis 3 of the library arms that have the same lengths.

    The robot is unchanged where no arm of its maker has these lengths, or where they disagree.
    """
    twins = [
        twin
        for twin in (read_robot(Manipulator, name) for name in robot_ids())
        if twin.kinematics == robot.kinematics == "opw"
        and robot.manufacturer in ("", twin.manufacturer)
        and all(abs(robot.geometry[k] - twin.geometry[k]) <= ALIKE for k in ARM)
    ]
    if not twins or len({twin.axis_3 for twin in twins}) > 1:
        return robot
    names = ", ".join(twin.id for twin in twins)
    counted = twins[0].axis_3
    bounds = [_carried_over(c, twin, robot) for twin in twins for c in twin.couplings]
    notes = [
        f"Axis 3 of the controller is taken as {counted}: the arm has the same lengths as {names}."
    ]
    turned = float(np.degrees(_wrap_offsets(robot.offset[5] - twins[0].offset[5])))
    if round(turned, 3):
        notes.append(
            f"The tip is rotated by {turned:.3f} deg about axis 6 relative to the flange of "
            f"{twins[0].id}: programs use the tip frame as the controller's flange."
        )
    return replace(robot, axis_3=counted, couplings=_tightest(bounds), notes=(*robot.notes, *notes))


def _given(robot: A, axis_3: str, limits: ArrayLike | None) -> A:
    """Return the robot with axis 3 as given; raise InputError where known data contradict it."""
    counted = COUNTED.get(robot.manufacturer, ("serial", "horizontal"))
    if axis_3 not in counted:
        raise InputError(
            f"axis_3: expected {' or '.join(map(repr, counted))}, the convention of controllers by "
            f"{robot.manufacturer or 'any maker'}, got {axis_3!r}"
        )
    found = _look_up_axis_3(robot)
    if found.axis_3 not in ("", axis_3):
        raise InputError(
            f"axis_3: expected {found.axis_3!r}, got {axis_3!r}. {found.notes[len(robot.notes)]}"
        )
    if (axis_3 == "horizontal") != (limits is not None):
        raise InputError(
            'axis_3_limits=: expected the two limits of axis 3 with "horizontal", and none with '
            f'"serial", got {"none" if limits is None else "them"} with {axis_3!r}'
        )
    if limits is None:
        return replace(robot, axis_3=axis_3)
    if robot.kinematics != "opw":
        raise InputError(
            f'axis_3: expected "serial", because an arm of family {robot.kinematics!r} has no '
            "upper arm between axes 3 and 4 that a parallel rod could hold, got 'horizontal'"
        )
    low, high = floats(limits, "axis_3_limits", (2,))
    row, shift = level(robot)
    one = Coupling(
        row=row, lower=low - shift, upper=high - shift,
        note="limits of the controller's axis 3, which is counted from the horizontal",
    )  # fmt: skip
    if robot.lower is not None and robot.upper is not None:
        ends = np.where(row > 0, [robot.lower, robot.upper], [robot.upper, robot.lower]) @ row
        if ends[1] <= one.lower or ends[0] >= one.upper:
            shown = np.degrees(ends + shift).round(2).tolist()
            raise InputError(
                f"axis_3_limits=: {np.degrees([low, high]).round(2).tolist()} deg is outside the "
                f"range of axis 3 that the limits of joints 2 and 3 allow, {shown} deg"
            )
    return replace(robot, axis_3=axis_3, couplings=(one,))


def _carried_over(coupling: Coupling, twin: Manipulator, robot: Manipulator) -> Coupling:
    """Return a bound of a twin in terms of the joints of a robot with another sign and offset."""
    row = coupling.row * twin.sign * robot.sign
    shift = float(coupling.row @ (twin.sign * _wrap_offsets(twin.offset - robot.offset)))
    return Coupling(
        row=row, lower=coupling.lower - shift, upper=coupling.upper - shift, note=coupling.note
    )


def _tightest(bounds: list[Coupling]) -> tuple[Coupling, ...]:
    """Return one bound for each row: the narrowest of those of all arms with the same lengths."""
    rows: dict[bytes, Coupling] = {}
    for one in bounds:
        other = rows.get(one.row.tobytes(), one)
        rows[one.row.tobytes()] = replace(
            one, lower=max(one.lower, other.lower), upper=min(one.upper, other.upper)
        )
    return tuple(rows.values())


def _wrap_offsets(angle: ArrayLike) -> Array:
    """Return angles wrapped to half a turn: the zero of a description is at most that far off."""
    angle = np.asarray(angle, dtype=float)
    return np.asarray(angle - 2 * np.pi * np.round(angle / (2 * np.pi)))
