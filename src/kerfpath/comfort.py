"""Distances of joint vectors from singularities and limits, and the cost of small distances.

The measures, for an arm whose model angles are sign * q - offset:

==============  ====  ======================================================================
wrist           rad   angle by which axes 4 and 6 (with seven axes: 5 and 7) are out of line
elbow           rad   angle by which the upper arm (axis 2 to 3) and the forearm (axis 3 to the
                      wrist centre, or of a UR arm to axis 4) are out of line, stretched or
                      folded; the offset a2 of the forearm is included
shoulder        m     distance of the wrist centre (of a UR arm: of the point where axes 5 and 6
                      meet) from the plane through axis 1 parallel to axis 2: sqrt(r^2 - b^2) at
                      the distance r from axis 1, with a1 and the offset b of the arm included
limits          rad   distance to the nearest limit of a joint that is not endless, or of a coupling
manipulability  m^3   Yoshikawa's, sqrt(det J J^T), see `jacobian`
==============  ====  ======================================================================

The determinant of an ortho-parallel arm with a spherical wrist is, up to its sign, c2 sqrt(a2^2 +
c3^2) sin(elbow) shoulder sin(wrist), that of a UR arm a2 a3 sin(elbow) shoulder sin(wrist): at
these three zeros, and only there, such arms lose a direction of motion. Sources: B. Siciliano et
al., "Robotics: Modelling, Planning and Control" (2009), section 3.3; T. Yoshikawa, "Manipulability
of robotic mechanisms", IJRR 4(2), 1985. The singularities of a five-axis wrist depend on the tool,
which its manipulability includes. An arm of seven axes with a spherical shoulder and
wrist has those of its other joints with joint 3 held.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field, fields
from functools import partial
from typing import Any, TypedDict

import numpy as np
from numpy.typing import ArrayLike

from kerfpath.arrays import (
    Array,
    Bools,
    as_pose,
    floats,
    freeze,
    not_negative,
    require_one_of,
    short_repr,
)
from kerfpath.errors import InputError
from kerfpath.kernels.turns import JointLimits
from kerfpath.losses import Loss, Reason
from kerfpath.robots import Robot

__all__ = [
    "MEASURES",
    "Band",
    "BandData",
    "Comfort",
    "Measure",
    "Reversals",
    "ReversalsData",
    "jacobian",
    "measure",
    "measures",
]

AT_ONCE = 100_000
"""Jacobians computed at a time: many enough to hide the overhead, few enough for the memory."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Measure:
    """A measure of joint vectors: its name in messages, its unit, and its largest value.

    `of` takes an arm without external axes, joint vectors (B, n) rad and T_flange_tip or None, and
    returns the values (B,). If `families` is None, every arm has the measure.
    """

    words: str
    unit: str
    of: Callable[[Robot, Array, ArrayLike | None], Array] = field(repr=False)
    most: float = np.inf
    families: tuple[str, ...] | None = None

    __repr__ = short_repr

    def has(self, robot: Robot) -> bool:
        """Return whether the measure is defined for the arm."""
        return self.families is None or robot.kinematics in self.families


class BandData(TypedDict):
    """A `Band` as JSON data, in rad, m and m^3."""

    margin: float
    width: float
    cost: float


class ReversalsData(TypedDict):
    """A `Reversals` as JSON data."""

    cost: float
    joints: list[int]


@dataclass(frozen=True, slots=True, kw_only=True)
class Band:
    """A hard margin of a measure, and the soft band beyond it.

    Parameters
    ----------
    margin : float, unit of the measure
        Joint vectors below this value are not used.
    width : float, unit of the measure
        Width of the band beyond the margin.
    cost : float
        Cost of a node at the margin, falling linearly to 0 at the end of the band; in the unit of
        the objective: with the default weights, a joint at full speed from node to node costs 1.

    Raises
    ------
    InputError
        A negative number, or a cost without a width.
    """

    margin: float = 0.0
    width: float = 0.0
    cost: float = 0.0

    def __post_init__(self) -> None:
        for name in ("margin", "width", "cost"):
            object.__setattr__(self, name, not_negative(getattr(self, name), f"comfort {name}"))
        if self.cost and not self.width:
            raise InputError("comfort cost: needs a width over which it falls to zero, got width 0")

    def price(self, value: Array) -> Array:
        """Return the cost (B,) of values (B,) of the measure."""
        if not self.cost:
            return np.zeros(len(value))
        return np.asarray(self.cost * np.clip(1 - (value - self.margin) / self.width, 0.0, 1.0))


@dataclass(frozen=True, slots=True, kw_only=True)
class Reversals:
    """The cost of joints that turn back under way, where backlash and friction mark the cut.

    Parameters
    ----------
    cost : float
        Cost of each reversal of each joint, in the unit of the objective: with the default weights,
        a joint at full speed from node to node costs 1.
    joints : sequence of int
        The joints that count, from 1; default: those that place the wrist centre.

    Raises
    ------
    InputError
        A negative cost, or joints that are not different whole numbers from 1.
    """

    cost: float
    joints: tuple[int, ...] = (1, 2, 3)

    __repr__ = short_repr

    def __post_init__(self) -> None:
        cost = not_negative(self.cost, "comfort reversals cost")
        object.__setattr__(self, "cost", cost)
        joints = np.asarray(self.joints)
        whole = joints.ndim == 1 and joints.size > 0 and np.issubdtype(joints.dtype, np.integer)
        if not whole or joints.min() < 1 or len(np.unique(joints)) < len(joints):
            raise InputError(
                f"comfort reversals joints: expected different numbers from 1, got {self.joints!r}"
            )
        object.__setattr__(self, "joints", tuple(joints.tolist()))

    def per_joint(self, robot: Robot) -> Array:
        """Return the cost (n,) of a reversal of each joint of a robot.

        Raises
        ------
        InputError
            The robot has no such joint.
        """
        if max(self.joints) > robot.joints:
            raise InputError(
                f"comfort reversals joints: expected joints from 1 to {robot.joints}, got "
                f"{max(self.joints)}"
            )
        price = np.zeros(robot.joints)
        price[np.array(self.joints) - 1] = self.cost
        return freeze(price)


@dataclass(frozen=True, slots=True, kw_only=True)
class Comfort:
    """Margins and bands of a plan, one for each measure; None: the measure does not matter.

    Parameters
    ----------
    wrist, elbow, limits : Band rad, optional
    shoulder : Band m, optional
    manipulability : Band m^3, optional
    clearance : Band m, optional
        Band beyond the near-miss distances of a cell, which are the hard margin; without a margin.
    reversals : Reversals, optional
        Cost of joints that turn back.

    Raises
    ------
    InputError
        A margin that no joint vector keeps, a margin of clearance, or a value of another type.
    """

    wrist: Band | None = None
    elbow: Band | None = None
    shoulder: Band | None = None
    limits: Band | None = None
    manipulability: Band | None = None
    clearance: Band | None = None
    reversals: Reversals | None = None

    __repr__ = short_repr

    def __post_init__(self) -> None:
        for name in (each.name for each in fields(self)):
            value, kind = getattr(self, name), Reversals if name == "reversals" else Band
            if not (value is None or isinstance(value, kind)):
                raise InputError(f"comfort {name}: expected a {kind.__name__}, got {value!r}")
        for name, band in self.bands.items():
            if band.margin >= MEASURES[name].most:
                raise InputError(
                    f"comfort {name}: the margin must be below {MEASURES[name].most:.4g} "
                    f"{MEASURES[name].unit}, the largest possible value, got {band.margin:g}"
                )
        if self.clearance is not None and self.clearance.margin:
            raise InputError(
                "comfort clearance: its margin is the near-miss distance of the cell; set the "
                "margin there, and only width and cost here"
            )

    def to_data(self) -> dict[str, BandData | ReversalsData]:
        """Return bands and reversals as JSON data, which `from_data` reads."""
        return {name: each for name, each in asdict(self).items() if each is not None}

    @classmethod
    def from_data(cls, data: Mapping[str, BandData | ReversalsData]) -> Comfort:
        """Return the bands and reversals that `to_data` wrote."""
        made: dict[str, Any] = {
            name: (Reversals if name == "reversals" else Band)(**each)
            for name, each in data.items()
        }
        return cls(**made)

    @property
    def bands(self) -> dict[str, Band]:
        """The bands of measures of joint vectors, by name."""
        return {name: band for name in MEASURES if (band := getattr(self, name)) is not None}

    @property
    def costs(self) -> bool:
        """Whether anything has a cost."""
        bands = (*self.bands.values(), *filter(None, [self.clearance]))
        return self.prices_reversals or any(band.cost for band in bands)

    @property
    def prices_reversals(self) -> bool:
        """Whether reversals cost; the cost depends on two steps, not on a node."""
        return self.reversals is not None and self.reversals.cost > 0

    def price_of_reversals(self, robot: Robot) -> Array:
        """Return the cost (n,) of a reversal of each joint of a robot; 0 if it does not count.

        Raises
        ------
        InputError
            The robot has no such joint.
        """
        if self.reversals is None:
            return freeze(np.zeros(robot.joints))
        return self.reversals.per_joint(robot)

    @property
    def prices_clearance(self) -> bool:
        """Whether small clearance costs; the cost is known only at the vertices of a graph."""
        return self.clearance is not None and self.clearance.cost > 0

    @property
    def hard(self) -> Comfort:
        """The margins alone, without costs."""
        bands: dict[str, Any] = {
            name: Band(margin=band.margin) for name, band in self.bands.items()
        }
        return Comfort(**bands)

    def too_near(self, robot: Robot, q: Array, tool: Array) -> dict[Reason, Bools]:
        """Return which of joint vectors q (B, n) rad break each hard margin, (B,) by reason.

        Raises
        ------
        InputError
            A measure that the arm does not have.
        """
        return {
            Reason(Loss.MARGIN, MEASURES[name].words): measure(name, robot, q, tool=tool)
            < band.margin
            for name, band in self.bands.items()
            if band.margin
        }

    def broken(self, robot: Robot, q: Array, tool: Array) -> tuple[Reason, ...]:
        """Return the hard margins that any of joint vectors q (B, n) rad break."""
        return tuple(why for why, near in self.too_near(robot, q, tool).items() if near.any())

    def bent(self, robot: Robot) -> list[int]:
        """Return the joints that keep the margins of wrist and elbow, by number."""
        return [joint for _, joint in self._bends(robot)]

    def _bends(self, robot: Robot) -> list[tuple[str, int]]:
        """Return wrist and elbow with the joint of each, where they have a margin."""
        kept = (name for name, band in self.bands.items() if band.margin)
        bends = _BENDS.get(robot.kinematics, {})
        return [(name, bends[name][0]) for name in kept if name in bends]

    def narrowed(self, robot: Robot, q: Array) -> JointLimits:
        """Return joint limits narrowed so that the margins of limits, wrist and elbow are kept.

        They keep to the side of each singularity that joint vectors q (B, n) rad are on. If these
        are on both sides, or the joint is endless, nothing is narrowed.
        """
        limits = robot.joint_limits()
        lower, upper, room = limits.lower.copy(), limits.upper.copy(), 0.0
        if self.limits is not None:
            room, own = self.limits.margin, slice(robot.family.joints)
            lower[own] += room
            upper[own] -= room
        for name, joint in self._bends(robot):
            bend = _bend(name, robot, q)
            side = np.floor(bend / np.pi)
            if (side == side[0]).all():
                margin = self.bands[name].margin
                ends = np.pi * (side[0] + np.arange(2)) + margin * np.array([1.0, -1.0])
                ends = q[0, joint] + robot.sign[joint] * (ends - bend[0])
                lower[joint] = max(lower[joint], ends.min())
                upper[joint] = min(upper[joint], ends.max())
        return limits._replace(
            lower=lower,
            upper=upper,
            row_lower=limits.row_lower + room,
            row_upper=limits.row_upper - room,
        )

    def price(self, robot: Robot, q: Array, tool: Array) -> Array:
        """Return the cost (B,) of joint vectors q (B, n) rad, without that of clearance.

        Raises
        ------
        InputError
            A measure that the arm does not have.
        """
        total = np.zeros(len(q))
        for name, band in self.bands.items():
            if band.cost:
                total += band.price(measure(name, robot, q, tool=tool))
        return total


def measures(robot: Robot, q: ArrayLike, *, tool: ArrayLike | None = None) -> dict[str, Array]:
    """Return the values (B,) of every measure that the arm has, at joints q (B, n) rad, by name.

    The units are those of `MEASURES`; arguments and errors as in `measure`.
    """
    return {name: measure(name, robot, q, tool=tool) for name in _measures_of(robot)}


def measure(name: str, robot: Robot, q: ArrayLike, *, tool: ArrayLike | None = None) -> Array:
    """Return one measure (B,) of joint vectors, for the arm without its external axes.

    Parameters
    ----------
    name : str
        One of `MEASURES`.
    robot : Robot
        With joint limits, for "limits".
    q : (B, n) rad
    tool : (4, 4), optional
        T_flange_tip, m; only the manipulability of an arm without free rotation depends on it.

    Raises
    ------
    InputError
        An unknown measure, one that this kind of arm does not have, or limits that are not known.
    """
    q = floats(q, "q", (None, robot.joints), copy=False)[:, : robot.family.joints]
    robot = robot.alone()
    require_one_of(name, "comfort", MEASURES)
    if not MEASURES[name].has(robot):
        raise InputError(
            f"comfort {name}: no {MEASURES[name].words} is defined for this kind of arm "
            f"({robot.family.words}); use {' or '.join(_measures_of(robot))}"
        )
    return freeze(MEASURES[name].of(robot, q, tool))


def jacobian(robot: Robot, q: ArrayLike, *, tool: ArrayLike | None = None) -> Array:
    """Return the geometric Jacobians (B, 6, n) of the tool tip, in the robot base.

    Of joint vectors q (B, n) rad of a robot without external axes; linear (m/rad) over angular
    velocity. Every entry of a pose is a sinusoid of each joint's angle, so its derivative is half
    the difference between its values 90 deg ahead and 90 deg behind, exactly, for every family.
    """
    q = floats(q, "q", (None, robot.joints), copy=False)
    if robot.externals:
        name = robot.externals[0].name
        raise InputError(f"jacobian: expected no external axis, got {name}; use robot.held(x)")
    T_flange_tip = np.eye(4) if tool is None else as_pose(tool, "tool")
    turned = robot.forward(q)[:, :3, :3] @ T_flange_tip[:3, :3]
    J = np.empty((len(q), 6, robot.joints))
    for i in range(robot.joints):
        quarter = np.zeros(robot.joints)
        quarter[i] = np.pi / 2
        slope = (robot.forward(q + quarter) - robot.forward(q - quarter)) @ T_flange_tip / 2
        spin = slope[:, :3, :3] @ turned.transpose(0, 2, 1)
        J[:, :3, i] = slope[:, :3, 3]
        J[:, 3, i], J[:, 4, i], J[:, 5, i] = spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]
    return freeze(J)


def _measures_of(robot: Robot) -> list[str]:
    """Return the names of the measures that the arm has."""
    return [name for name, each in MEASURES.items() if each.has(robot)]


def _manipulability(robot: Robot, q: Array, tool: ArrayLike | None) -> Array:
    """Return Yoshikawa's measure (B,) m^3.

    For an arm without free rotation, it is that of the tool tip and the direction of the tool axis.
    """
    found = np.empty(len(q))
    T_flange_tip = np.eye(4) if tool is None else as_pose(tool, "tool")
    for first in range(0, len(q), AT_ONCE):
        part = slice(first, first + AT_ONCE)
        J = jacobian(robot, q[part], tool=T_flange_tip)
        if not robot.family.free_rotation:
            tip = robot.forward(q[part])[:, :3, :3] @ T_flange_tip[:3, :3]
            J = np.concatenate([J[:, :3], tip.transpose(0, 2, 1)[:, :2] @ J[:, 3:]], axis=1)
        if J.shape[1] == J.shape[2]:
            found[part] = np.abs(np.linalg.det(J))
        else:
            found[part] = np.sqrt(np.maximum(np.linalg.det(J @ J.transpose(0, 2, 1)), 0.0))
    return found


def _to_limits(robot: Robot, q: Array, tool: ArrayLike | None) -> Array:
    """Return the distance (B,) rad to the nearest limit, negative beyond it; infinite if none."""
    limits = robot.joint_limits()
    bound = ~limits.endless
    combined = q @ limits.rows.T
    room = [
        (q - limits.lower)[:, bound],
        (limits.upper - q)[:, bound],
        combined - limits.row_lower,
        limits.row_upper - combined,
    ]
    return np.asarray(np.concatenate(room, axis=1).min(axis=1, initial=np.inf))


def _from_line(name: str, robot: Robot, q: Array, tool: ArrayLike | None) -> Array:
    """Return the distance (B,) of a bend from the nearest multiple of pi, from 0 to pi / 2."""
    bend = _bend(name, robot, q)
    return np.asarray(np.abs(bend - np.pi * np.round(bend / np.pi)))


def _bend(name: str, robot: Robot, q: Array) -> Array:
    """Return the angle (B,) whose multiples of pi are the wrist's or the elbow's singularities."""
    joint, offset = _BENDS[robot.kinematics][name]
    angle = robot.sign[joint] * q[:, joint] - robot.offset[joint]
    return np.asarray(angle + offset(robot.geometry))


def _shoulder(robot: Robot, q: Array, tool: ArrayLike | None) -> Array:
    """Return the distance (B,) m of the wrist from the plane of axis 1 along axis 2."""
    g, angle = robot.geometry, robot.sign * q - robot.offset
    q2, q23 = angle[:, 1], angle[:, 1] + angle[:, 2]
    if robot.kinematics == "srs":
        x, z = np.sin(angle[:, 3]) * np.cos(angle[:, 2]), np.cos(angle[:, 3])
        along = g["c2"] * np.sin(q2) + g["c3"] * (x * np.cos(q2) + z * np.sin(q2))
    elif robot.kinematics == "ur":
        along = g["a2"] * np.cos(q2) + g["a3"] * np.cos(q23) + g["d5"] * np.sin(q23 + angle[:, 3])
    else:
        along = g["a1"] + g["c2"] * np.sin(q2) + g["c3"] * np.sin(q23) + g["a2"] * np.cos(q23)
    return np.asarray(np.abs(along))


def _straight(g: Mapping[str, float]) -> float:
    return 0.0


def _forearm(g: Mapping[str, float]) -> float:  # rad by which the wrist centre is off its axis
    return float(np.arctan2(g["a2"], g["c3"]))


_BENDS: Mapping[str, Mapping[str, tuple[int, Callable[[Mapping[str, float]], float]]]] = {
    "opw": {"wrist": (4, _straight), "elbow": (2, _forearm)},
    "ur": {"wrist": (4, _straight), "elbow": (2, _straight)},
    "five": {"elbow": (2, _forearm)},
    "srs": {"wrist": (5, _straight), "elbow": (3, _straight)},
}
"""By family and measure: the joint that bends, and the offset of its angle from the lengths."""

MEASURES: Mapping[str, Measure] = {
    **{
        name: Measure(
            words=f"{name} singularity",
            unit="rad",
            of=partial(_from_line, name),
            most=np.pi / 2,
            families=tuple(family for family, bends in _BENDS.items() if name in bends),
        )
        for name in ("wrist", "elbow")
    },
    "shoulder": Measure(
        words="shoulder singularity", unit="m", of=_shoulder, families=tuple(_BENDS)
    ),
    "limits": Measure(words="joint limit", unit="rad", of=_to_limits),
    "manipulability": Measure(words="manipulability", unit="m^3", of=_manipulability),
}
"""All measures, by name."""
