"""The robot of a simulated station: by its name, trusted where its forward kinematics agree."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from kerfpath.arrays import Array, floats, positive
from kerfpath.errors import InputError
from kerfpath.names import listed, nearest, squeezed
from kerfpath.robots import Coupling, Robot, robot, robot_ids

LARGEST_MM, LARGEST_DEG = 0.1, 0.01
"""Largest difference of two forward kinematics of the same robot: both round their lengths."""
MOST_CANDIDATES = 8
"""Most robots of the library that a message names."""


class StationRobot(NamedTuple):
    """A robot of the library that moves as one of a station does.

    Where the joints of the station are ``counts @ q``, its flange is at ``T_station_base @
    robot.forward(q) @ T_end_flange`` in its robot base, but for the differences.

    Parameters
    ----------
    robot : Robot
        With the joint ranges of the station.
    counts : (n, n)
        The unit matrix, but for an axis 3 that is counted from the horizontal.
    T_station_base, T_end_flange : (4, 4) m
    apart_mm, apart_deg : float
        The largest differences at the joints that were compared.
    """

    robot: Robot
    counts: Array
    T_station_base: Array
    T_end_flange: Array
    apart_mm: float
    apart_deg: float


def station_robot(station: Mapping[str, Any], acceleration: Any) -> StationRobot:
    """Return the robot of the library that a robot of a station is.

    Base and flange may be placed otherwise than in the library: where they are is fitted.

    Parameters
    ----------
    station : mapping
        "name" of the robot, "model" (its id in the library, or None: by its name), "lower" and
        "upper" (n,) rad, and the poses "T" (m, 4, 4) m of the flange in the base at joints "q"
        (m, n) rad, m at least 8.
    acceleration : float or (n,) rad/s^2, or str, or None
        Limits of the joints; a str names a ratio of the library to the speeds; None takes the
        limits of the library.

    Raises
    ------
    InputError
        The robot is not in the library, moves otherwise than there, has other joints, or the
        library has no accelerations of it and none are given.
    """
    name, asked = str(station["name"]), station.get("model")
    q = floats(station["q"], f"robot {name!r}: joints", (None, len(station["lower"])))
    T = floats(station["T"], f"robot {name!r}: poses", (len(q), 4, 4))
    found = _named(str(asked or name))
    if found is None:
        raise InputError(
            f"robot {asked or name!r} is not in the library ({nearest(name, robot_ids())}); "
            f"{_alike(q, T)}"
        )
    if found.joints != q.shape[1]:
        raise InputError(
            f"robot {name!r}: expected the {found.joints} joints of {found.id}, got {q.shape[1]}; "
            "synchronized external axes are not supported"
        )
    fitted = _nearest_fit(found, q, T)
    if not _agree(fitted):
        raise InputError(
            f"robot {name!r} moves otherwise than {found.id} of the library: at equal joints up to "
            f"{fitted.apart_mm:.3g} mm and {fitted.apart_deg:.2g} deg apart, at most "
            f"{LARGEST_MM:g} mm and {LARGEST_DEG:g} deg are accepted; {_alike(q, T)}"
        )
    limited = _limited(found, fitted.counts, station["lower"], station["upper"])
    return fitted._replace(robot=_accelerated(limited, acceleration))


def _named(name: str) -> Robot | None:
    """Return the robot of the library with this id, model or both maker and model."""
    for one in robot_ids():
        found = robot(one)
        spellings = (one, one.partition("_")[2], found.model, found.manufacturer + found.model)
        if squeezed(name) in map(squeezed, spellings):
            return found
    return None


def _limited(found: Robot, counts: Array, lower: Any, upper: Any) -> Robot:
    """Return a robot with the joint ranges of a station; those that are coupled bound both."""
    ends = [floats(each, "joint ranges", (found.joints,)).copy() for each in (lower, upper)]
    couplings = list[Coupling]()
    for i in np.flatnonzero((counts != np.eye(found.joints)).any(axis=1)):
        note = f"range of axis {i + 1} of the station"
        couplings.append(Coupling(row=counts[i], lower=ends[0][i], upper=ends[1][i], note=note))
        for end, own, none in zip(ends, (found.lower, found.upper), (-np.inf, np.inf), strict=True):
            end[i] = none if own is None else own[i]
    return found.with_limits(
        lower=ends[0],
        upper=ends[1],
        endless=np.zeros(found.joints, bool),
        couplings=couplings or None,
    )


def _accelerated(found: Robot, given: Any) -> Robot:
    if isinstance(given, str):
        ratio = robot(found.id, acceleration_ratio=given)
        limits = replace(found.limits, acceleration=ratio.acceleration)
        return replace(found, limits=limits, acceleration_source=ratio.acceleration_source)
    if given is not None:
        each = positive(np.atleast_1d(given), "acceleration", (None,))
        return found.with_limits(acceleration=np.tile(each, found.joints if len(each) == 1 else 1))
    if found.acceleration is None:
        raise InputError(
            f"acceleration: the library has none for {found.id}, nor has a station; give those of "
            f"your robot, or ask for the ratio {found.acceleration_ratio!r} to the speeds"
        )
    return found


def _alike(q: Array, T: Array) -> str:
    """Return in words which robots of the library move as the poses say."""
    alike = [
        one
        for one in robot_ids()
        if (known := robot(one)).joints == q.shape[1] and _agree(_nearest_fit(known, q, T))
    ]
    if not alike:
        return "no robot of the library moves as it does"
    return f"by its motion it could be {listed(alike, MOST_CANDIDATES)}: give one as model"


def _agree(fitted: StationRobot) -> bool:
    return fitted.apart_mm <= LARGEST_MM and fitted.apart_deg <= LARGEST_DEG


def _nearest_fit(known: Robot, q: Array, T: Array) -> StationRobot:
    """Return the fit to poses T (m, 4, 4) at joints q (m, n) by either count of axis 3."""
    counts = [np.eye(known.joints)]
    if known.axis_3 == "horizontal":
        shown = [one.row for one in known.couplings if one.row[1] and one.row[2] == 1.0]
        counts += [np.vstack([counts[0][:2], row, counts[0][3:]]) for row in shown]
    fits = [_fitted(known, each, q @ np.linalg.inv(each).T, T) for each in counts]
    return min(fits, key=lambda fit: fit.apart_mm)


def _fitted(known: Robot, counts: Array, q: Array, T: Array) -> StationRobot:
    """Return base and flange of a station for which T (m, 4, 4) is nearest at joints q (m, n).

    With X the base and Y the flange, T[i] = X @ forward(q[i]) @ Y. Rotations from pose 0 to pose i
    share their angles, so their axes give X; the rest is linear.
    """
    own = known.forward(q)
    R, S = own[:, :3, :3], T[:, :3, :3]
    turned = [Rotation.from_matrix(each @ each[0].T).as_rotvec() for each in (S, R)]
    # Near half a turn the sign of the axis is open; the first pose has no axis.
    angle = np.linalg.norm(turned[1], axis=1)
    clear = (angle > 0.1) & (angle < 3.0)
    X = Rotation.align_vectors(*(each[clear] for each in turned))[0].as_matrix()
    Y = Rotation.from_matrix(np.swapaxes(X @ R, 1, 2) @ S).mean().as_matrix()
    # X (R y + p) + x = t, for the shifts x of the base and y of the flange.
    unknown = np.concatenate([X @ R, np.broadcast_to(np.eye(3), R.shape)], axis=2).reshape(-1, 6)
    rest = T[:, :3, 3] - own[:, :3, 3] @ X.T
    shift = np.linalg.lstsq(unknown, rest.reshape(-1), rcond=None)[0]
    before, behind = np.eye(4), np.eye(4)
    before[:3, :3], behind[:3, :3] = X, Y
    before[:3, 3], behind[:3, 3] = shift[3:], shift[:3]
    made = before @ own @ behind
    off = Rotation.from_matrix(np.swapaxes(made[:, :3, :3], 1, 2) @ S).magnitude()
    return StationRobot(
        robot=known,
        counts=counts,
        T_station_base=before,
        T_end_flange=behind,
        apart_mm=1e3 * float(np.linalg.norm(made[:, :3, 3] - T[:, :3, 3], axis=1).max()),
        apart_deg=float(np.degrees(off.max())),
    )
