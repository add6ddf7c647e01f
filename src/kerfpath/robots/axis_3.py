"""The meaning of a controller's axis 3: the elbow, or the upper arm from the horizontal.

In an arm with a parallel rod (IRB 2400, 4400) the upper arm keeps its orientation while axis 2
moves, and every FANUC pendant shows J3 this way: axis 3 then combines joints 2 and 3 of the
serial model, and its limits bound both. A robot description does not say which convention
applies. For an arm read from a description, axis 3 is taken from a library robot with the same
lengths, or it is given by the user. Otherwise it is unknown, and languages that contain axis 3
refuse the arm.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from kerfpath.arrays import Array, floats, short_repr
from kerfpath.errors import InputError
from kerfpath.robots.arm import Arm
from kerfpath.robots.catalogue import arm_of, entry, limits_of, robot_ids
from kerfpath.robots.limits import Coupling, RobotLimits

AXIS_3 = ("", "serial", "horizontal")
"""What axis 3 of a controller can measure; "" means not known, see `Robot`."""
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


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Axis3:
    """What axis 3 of a controller measures, the bounds that it has, and remarks for the user.

    Parameters
    ----------
    counted : {"", "serial", "horizontal"}
        As `Robot.axis_3`.
    couplings : tuple of Coupling
        Bounds on combinations of joints of the arm.
    notes : tuple of str
    """

    counted: str = ""
    couplings: tuple[Coupling, ...] = ()
    notes: tuple[str, ...] = ()

    __repr__ = short_repr


def axis_3_of(
    arm: Arm, maker: str, limits: RobotLimits, counted: str, shown: ArrayLike | None
) -> Axis3:
    """Return axis 3 of an arm as given, or as in the library; see `Robot.with_axis_3`.

    Parameters
    ----------
    arm : Arm
    maker : str
        Maker of the controller.
    limits : RobotLimits
        Known limits of the joints.
    counted : {"", "serial", "horizontal"}
    shown : (2,) rad, optional
        Limits of axis 3 as the controller shows them.
    """
    if counted:
        return _given(arm, maker, limits, counted, shown)
    if shown is not None:
        said = 'axis_3_limits: expected them with axis_3 = "horizontal", got no axis_3'
        raise InputError(said, parameter="axis_3_limits")
    return _looked_up(arm, maker)


def _looked_up(arm: Arm, maker: str) -> Axis3:
    """Return axis 3 of the library arms that have the same lengths.

    It is not known where no arm of the maker has these lengths, or where they disagree.
    """
    twins = [
        (data, twin)
        for data in map(entry, robot_ids())
        if data["kinematics"] == arm.kinematics == "opw" and maker in ("", data["manufacturer"])
        for twin in [arm_of(data)]
        if all(abs(arm.geometry[k] - twin.geometry[k]) <= ALIKE for k in ARM)
    ]
    if len({data["joints"]["axis_3"] for data, _ in twins}) != 1:
        return Axis3()
    (first, like), names = twins[0], ", ".join(data["id"] for data, _ in twins)
    counted = first["joints"]["axis_3"]
    bounds = [
        _carried_over(c, twin, arm) for data, twin in twins for c in limits_of(data).couplings
    ]
    notes = [
        f"Axis 3 of the controller is taken as {counted}: the arm has the same lengths as {names}."
    ]
    turned = float(np.degrees(_wrap_offsets(arm.offset[5] - like.offset[5])))
    if round(turned, 3):
        notes.append(
            f"The tip is rotated by {turned:.3f} deg about axis 6 relative to the flange of "
            f"{first['id']}: programs use the tip frame as the controller's flange."
        )
    return Axis3(counted=counted, couplings=_tightest(bounds), notes=tuple(notes))


def _given(arm: Arm, maker: str, limits: RobotLimits, given: str, shown: ArrayLike | None) -> Axis3:
    """Return axis 3 as given; raise InputError where known data contradict it."""
    expected = COUNTED.get(maker, ("serial", "horizontal"))
    if given not in expected:
        raise InputError(
            f"axis_3: expected {' or '.join(map(repr, expected))}, the convention of controllers "
            f"by {maker or 'any maker'}, got {given!r}",
            parameter="axis_3",
        )
    found = _looked_up(arm, maker)
    if found.counted not in ("", given):
        said = f"axis_3: expected {found.counted!r}, got {given!r}. {found.notes[0]}"
        raise InputError(said, parameter="axis_3")
    if (given == "horizontal") != (shown is not None):
        raise InputError(
            'axis_3_limits: expected the two limits of axis 3 with "horizontal", and none with '
            f'"serial", got {"none" if shown is None else "them"} with {given!r}',
            parameter="axis_3_limits",
        )
    if shown is None:
        return Axis3(counted=given, couplings=limits.couplings)
    if arm.kinematics != "opw":
        raise InputError(
            f'axis_3: expected "serial", because an arm of family {arm.kinematics!r} has no '
            "upper arm between axes 3 and 4 that a parallel rod could hold, got 'horizontal'",
            parameter="axis_3",
        )
    low, high = floats(shown, "axis_3_limits", (2,))
    row, shift = _level(arm, maker)
    one = Coupling(
        row=row, lower=low - shift, upper=high - shift,
        note="limits of the controller's axis 3, which is counted from the horizontal",
    )  # fmt: skip
    lower, upper = limits.lower, limits.upper
    if lower is not None and upper is not None:
        ends = np.where(row > 0, [lower, upper], [upper, lower]) @ row
        if ends[1] <= one.lower or ends[0] >= one.upper:
            allowed = np.degrees(ends + shift).round(2).tolist()
            raise InputError(
                f"axis_3_limits: {np.degrees([low, high]).round(2).tolist()} deg is outside the "
                f"range of axis 3 that the limits of joints 2 and 3 allow, {allowed} deg",
                parameter="axis_3_limits",
            )
    return Axis3(counted=given, couplings=(one,))


def _level(arm: Arm, maker: str) -> tuple[Array, float]:
    """Return row (n,) and shift (rad) of axis 3 counted from the horizontal: row @ q + shift.

    The sign is that of the maker; the value is zero where the upper arm is horizontal.
    """
    row = np.zeros(arm.joints)
    row[1:3] = arm.sign[1:3]
    shift = float(_wrap_offsets(-arm.offset[1]) + _wrap_offsets(-arm.offset[2] - np.pi / 2))
    way = -1.0 if maker in UPWARDS else 1.0
    return way * row, way * shift


def _carried_over(coupling: Coupling, twin: Arm, arm: Arm) -> Coupling:
    """Return a bound of a twin in terms of the joints of an arm with another sign and offset."""
    row = coupling.row * twin.sign * arm.sign
    shift = float(coupling.row @ (twin.sign * _wrap_offsets(twin.offset - arm.offset)))
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
