"""Build a robot from its description: family and model from the geometry, limits as written."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from difflib import get_close_matches
from functools import cache, partial
from importlib.resources import files
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from kerfpath.arrays import Array, floats
from kerfpath.errors import InputError
from kerfpath.robots.arm import Manipulator
from kerfpath.robots.families import FAMILIES
from kerfpath.robots.general import Coupling, require_solver
from kerfpath.urdf import Description, KinematicChain, read_urdf

# -----------------------------------------------------------------------------
# The library of robots, one TOML file each, with their sources and notes.

_HERE = files("kerfpath.robots")


@cache
def robot_ids() -> tuple[str, ...]:
    """Return the ids of all robots in the library, sorted."""
    names = (f.name for f in (_HERE / "library").iterdir())
    return tuple(sorted(n.removesuffix(".toml") for n in names if n.endswith(".toml")))


@cache
def acceleration_ratios() -> dict[str, tuple[float, ...]]:
    """Return the named ratios of acceleration to velocity, 1/s, for joints 1 to 6.

    They serve for robots whose maker publishes no accelerations; the file gives their source.
    """
    text = (_HERE / "acceleration_ratios.toml").read_text(encoding="utf-8")
    return {name: tuple(values) for name, values in tomllib.loads(text).items()}


def read_robot(kind: type[A], name: str, acceleration_ratio: str | None = None) -> A:
    """Return a robot of the library by its id, as an instance of `kind`.

    Parameters
    ----------
    kind : type
        `Robot`, or a base of it.
    name, acceleration_ratio
        As in `kerfpath.robots.robot`.

    Raises
    ------
    InputError
        As `kerfpath.robots.robot`.
    """
    if name not in robot_ids():
        raise InputError(
            f"robot {name!r} is not in the library of {len(robot_ids())} robots; "
            f"{nearest(name, robot_ids())}; 'kerfpath robots' lists all"
        )
    data = tomllib.loads((_HERE / "library" / f"{name}.toml").read_text(encoding="utf-8"))
    joints = data["joints"]
    found = kind(
        id=data["id"],
        manufacturer=data["manufacturer"],
        model=data["model"],
        kinematics=data["kinematics"],
        geometry=data["geometry_m"],
        sign=np.array(joints["sign"], dtype=float),
        offset=np.radians(joints["offset_deg"]),
        lower=_radians(joints.get("lower_deg")),
        upper=_radians(joints.get("upper_deg")),
        velocity=_radians(joints.get("velocity_deg_s")),
        acceleration=_radians(joints.get("acceleration_deg_s2")),
        endless=np.isin(np.arange(1, len(joints["sign"]) + 1), joints["endless"]),
        couplings=tuple(
            Coupling(
                row=np.array(c["row"], dtype=float),
                lower=float(np.radians(c["lower_deg"])),
                upper=float(np.radians(c["upper_deg"])),
                note=c["note"],
            )
            for c in data.get("coupling", ())
        ),
        axis_3=joints["axis_3"],
        payload=data["payload_kg"],
        reach=data["reach_m"],
        acceleration_source=joints.get("acceleration_source", ""),
        acceleration_ratio=joints["acceleration_ratio"],
        limits_missing=data.get("limits_missing", ""),
        notes=tuple(data.get("notes", ())),
        frames=data["frames"],
        sources=data["source"],
    )
    if acceleration_ratio is None:
        return found
    ratios = acceleration_ratios()
    if acceleration_ratio not in ratios:
        raise InputError(
            f"acceleration_ratio: expected one of {', '.join(ratios)}, got {acceleration_ratio!r}"
        )
    if (n := len(ratios[acceleration_ratio])) != found.joints:
        raise InputError(
            f"acceleration_ratio: {acceleration_ratio!r} is for {n} joints, but robot {name!r} has "
            f"{found.joints}; give its accelerations with robot.with_limits(acceleration=...)"
        )
    if found.velocity is None:
        raise InputError(
            f"robot {name!r}: its joint velocities are not known, so acceleration_ratio cannot be "
            "applied"
        )
    return replace(
        found,
        acceleration=np.multiply(ratios[acceleration_ratio], found.velocity),
        acceleration_source=f"assumed: ratio {acceleration_ratio} times the speeds",
    )


def _radians(values: list[float] | None) -> Array | None:
    return None if values is None else np.radians(values)


def nearest(name: str, known: tuple[str, ...]) -> str:
    """Return the known names most similar to `name`, in words for messages."""
    near = get_close_matches(name, known, n=3, cutoff=0.4)
    return f"nearest: {', '.join(near)}" if near else "no id there is similar"


# -----------------------------------------------------------------------------
# The meaning of a controller's axis 3: the elbow, or the upper arm from the horizontal.
#
# In an arm with a parallel rod (IRB 2400, 4400) the upper arm keeps its orientation while axis 2
# moves, and every FANUC pendant shows J3 this way: axis 3 then combines joints 2 and 3 of the
# serial model, and its limits bound both. A robot description does not say which convention
# applies. For an arm read from a description, axis 3 is taken from a library robot with the same
# lengths, or it is given by the user. Otherwise it is unknown, and languages that contain axis 3
# refuse the arm.

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


# -----------------------------------------------------------------------------
# Recognise the kinematic family of an arm from its joint axes.
#
# The joint axes at angle zero suffice: they give the lengths of the model, and the model's angles
# at that pose become the joint offsets. The model is then compared with the chain of the
# description at random joint angles. An arm that belongs to no family with a closed form is
# "general", and its chain is its model.

EXACT = 1e-9
"""m and rotation entries: largest difference between a model and its description."""
NEARLY = 1e-3
"""m and sine: largest distance or angle between axes for a family to be tried."""
NONE = 1e-12
"""A transform that differs from the identity by less than this rounding error is the identity."""
ROUNDED = 1e-4
"""Difference up to which a family is assumed to be meant and the description to be rounded."""
POSES_COMPARED = 64
"""Number of random poses at which model and description are compared."""


@dataclass(frozen=True, slots=True)
class _Lines:
    """The joint axes of an arm at angle zero, in the frame of its foot.

    The foot is the point of axis 1 nearest to the base origin, with z along axis 1 and up, and x
    near that of the base.
    """

    foot: Array
    """(4, 4) m: the foot frame in the base."""
    place: Array
    """(n, 3) m: a point of each axis."""
    along: Array
    """(n, 3): direction of each axis."""
    tip: Array
    """(4, 4) m: the tip frame in the foot frame."""
    sign_1: float
    """-1 where joint 1 turns about -z of the foot frame, otherwise +1."""

    def meet(self, i: int, j: int) -> Array:
        """Return the point (3,) of axis i nearest to axis j."""
        normal = np.cross(self.along[j], np.cross(self.along[i], self.along[j]))
        gap = self.place[j] - self.place[i]
        return np.asarray(self.place[i] + self.along[i] * (gap @ normal) / (self.along[i] @ normal))

    def distance(self, point: Array, i: int) -> float:
        """Return the distance of a point from axis i, m."""
        return float(np.linalg.norm(np.cross(point - self.place[i], self.along[i])))

    def misfit(self, parallel: Sequence[int], square: Sequence[int]) -> str:
        """Say which axes i and i + 1 are not parallel, or not square, as given; "" if all are."""
        for i in parallel:
            if float(np.linalg.norm(np.cross(*self.along[i : i + 2]))) > NEARLY:
                return f"axes {i + 1} and {i + 2} are not parallel"
        for i in square:
            if abs(float(np.dot(*self.along[i : i + 2]))) > NEARLY:
                return f"axes {i + 1} and {i + 2} are not at right angles"
        return ""


def in_closed_form(chain: KinematicChain) -> bool:
    """Return whether a chain matches a closed-form family that descriptions can be read as."""
    lines = _lines(chain)
    return any(
        not isinstance(derived := derive(lines), str)
        and _miss(chain, _fit_end(name, lines, *derived)) <= EXACT
        for name, derive in DERIVED.get(len(chain.axes), ())
    )


def recognise(chain: KinematicChain, *, as_written: bool = False) -> Manipulator:
    """Return family, geometry, joint convention and frames of a chain.

    Parameters
    ----------
    chain : KinematicChain
    as_written : bool
        Take a six-axis arm that misses a closed form only by rounding as a general arm.

    Raises
    ------
    InputError
        The chain has neither six nor seven joints; it misses a closed form only by rounding; the
        solver of general arms is not installed; or it is a seven-axis arm without a spherical
        shoulder and wrist.
    """
    n = len(chain.axes)
    if n not in DERIVED:
        raise InputError(
            f"expected 6 or 7 joints between base and tip, got {n}: other arms are not recognised "
            "from descriptions"
        )
    lines, misfits = _lines(chain), []
    for name, derive in DERIVED[n]:
        derived = derive(lines)
        words = FAMILIES[name].words
        if isinstance(derived, str):
            misfits.append(f"not an {words}, because {derived}")
            continue
        model = _fit_end(name, lines, *derived)
        miss = _miss(chain, model)
        if miss <= EXACT:
            return model
        misfits.append(f"not an {words}, from which it differs by {miss:.1e} (m and rad)")
        if miss > ROUNDED or (as_written and n == 6):
            continue
        raise InputError(
            f"nearly an {words}, but it differs by {miss:.1e} (m and rad, at most {EXACT:g} is "
            "allowed); write its axes and lengths with more digits"
            + (", or read the arm as written with snap=0" if n == 6 else "")
        )
    if n == 7:
        raise InputError(
            f"{'; '.join(misfits)}: other seven-axis arms are not supported. If the first joint is "
            "an external axis, name the link that the arm is mounted on as mount"
        )
    try:
        require_solver()
    except InputError as error:
        raise InputError(f"{'; '.join(misfits)}: {error}") from None
    notes = (f"General arm: {'; '.join(misfits)}.",)
    return Manipulator(id="", kinematics="general", geometry={}, notes=notes, chain=chain)


def _lines(chain: KinematicChain) -> _Lines:
    T = chain.frames(np.zeros((1, len(chain.axes))))[0, 1:]
    along = np.einsum("nij,nj->ni", T[:, :3, :3], chain.axes)
    place = T[:, :3, 3]
    sign = -1.0 if along[0, 2] < -NEARLY else 1.0
    z = sign * along[0]
    x = np.eye(3)[0] if abs(z[0]) < 0.9 else -np.eye(3)[2]
    x = x - (x @ z) * z
    x /= np.linalg.norm(x)
    foot = np.eye(4)
    foot[:3, :3] = np.c_[x, np.cross(z, x), z]
    foot[:3, 3] = place[0] - (place[0] @ z) * z
    foot = _tidy(foot)
    R = foot[:3, :3]
    return _Lines(
        foot, (place - foot[:3, 3]) @ R, along @ R, np.linalg.inv(foot) @ T[-1] @ chain.end, sign
    )


def _opw(at: _Lines) -> tuple[dict[str, float], list[float], list[float]] | str:
    """Return lengths, signs and model angles at zero, or why the axes are not those of an OPW arm.

    Directions are chosen so that a1, c3 and c4 are not negative; c2 never is.
    """
    if misfit := at.misfit(parallel=(1,), square=(0, 2, 3, 4)):
        return misfit
    wrist = at.meet(4, 3)
    off = max(at.distance(wrist, 3), at.distance(wrist, 5))
    if off > NEARLY:
        return f"axes 4, 5 and 6 miss a common point by {off * 1e3:.3g} mm"
    z = np.array([0.0, 0.0, 1.0])
    y, sign_2 = _turned(at.along[1], lambda y: float(at.place[1] @ np.cross(y, z)))
    x = np.cross(y, z)
    flat = np.array([x, z])
    shoulder, elbow = flat @ at.place[1], flat @ at.place[2]
    upper, fore = elbow - shoulder, flat @ wrist - elbow
    up, sign_4 = _turned(at.along[3], lambda up: float(flat @ up @ fore))
    ahead = np.cross(y, up)
    side, sign_5 = _turned(at.along[4], lambda side: float(side @ y))
    out, sign_6 = _turned(
        at.along[5], lambda out: float(out @ (at.tip[:3, 3] - wrist)), lambda out: float(out @ up)
    )
    q23 = np.arctan2(*(flat @ up))
    q2 = np.arctan2(*upper)
    q4 = np.arctan2(-side @ ahead, side @ y)
    lengths = {
        "a1": shoulder[0],
        "a2": flat @ ahead @ fore,
        "b": wrist @ y,
        "c1": shoulder[1],
        "c2": np.linalg.norm(upper),
        "c3": flat @ up @ fore,
        "c4": out @ (at.tip[:3, 3] - wrist),
    }
    sign_3 = 1.0 if at.along[2] @ y > 0 else -1.0
    q5 = np.arctan2(out @ np.cross(side, up), out @ up)
    signs = [at.sign_1, sign_2, sign_3, sign_4, sign_5, sign_6]
    return lengths, signs, [np.arctan2(x[1], x[0]), q2, q23 - q2, q4, q5, 0.0]


def _ur(at: _Lines) -> tuple[dict[str, float], list[float], list[float]] | str:
    """Return lengths, signs and model angles at zero, or why the axes are not those of a UR.

    Directions are chosen so that d4, d5 and d6 are not negative; a2 and a3 always are negative, as
    in the maker's tables.
    """
    if misfit := at.misfit(parallel=(1, 2), square=(0, 3, 4)):
        return misfit
    fourth, fifth = at.meet(4, 3), at.meet(4, 5)
    z = np.array([0.0, 0.0, 1.0])
    n, sign_2 = _turned(at.along[1], lambda n: float(fourth @ n))
    x = np.cross(z, n)
    apart = (abs(x @ at.place[1]), at.distance(fourth, 3), at.distance(fifth, 5))
    for (i, j), off in zip(((1, 2), (4, 5), (5, 6)), apart, strict=True):
        if off > NEARLY:
            return f"axes {i} and {j} miss each other by {off * 1e3:.3g} mm"
    flat = np.array([x, z])
    upper, fore = np.diff(at.place[1:4] @ flat.T, axis=0)
    e5, sign_5 = _turned(at.along[4], lambda e: float(e @ (fifth - fourth)))
    out, sign_6 = _turned(at.along[5], lambda out: float(out @ (at.tip[:3, 3] - fifth)))
    q2, q23 = (np.arctan2(-v[1], -v[0]) for v in (upper, fore))
    theta = np.arctan2(x @ e5, -z @ e5)
    q5 = np.arctan2(-(np.cos(theta) * x + np.sin(theta) * z) @ out, out @ n)
    lengths = {
        "d1": at.place[1, 2],
        "a2": -np.linalg.norm(upper),
        "a3": -np.linalg.norm(fore),
        "d4": fourth @ n,
        "d5": e5 @ (fifth - fourth),
        "d6": out @ (at.tip[:3, 3] - fifth),
    }
    sign_3, sign_4 = (1.0 if at.along[i] @ n > 0 else -1.0 for i in (2, 3))
    signs = [at.sign_1, sign_2, sign_3, sign_4, sign_5, sign_6]
    return lengths, signs, [np.arctan2(x[1], x[0]), q2, q23 - q2, theta - q23, q5, 0.0]


def _srs(at: _Lines) -> tuple[dict[str, float], list[float], list[float]] | str:
    """Return lengths, signs and model angles at zero, or why the axes are not those of S-R-S.

    Directions are chosen so that c2, c3 and c4 are not negative.
    """
    if misfit := at.misfit(parallel=(), square=range(6)):
        return misfit
    centres = [at.meet(i, i - 1) for i in (1, 3, 5)]
    for centre, i in zip(centres, (1, 3, 5), strict=True):
        off = max(at.distance(centre, i - 1), at.distance(centre, i + 1))
        if off > NEARLY:
            return f"axes {i}, {i + 1} and {i + 2} miss a common point by {off * 1e3:.3g} mm"
    steps = np.diff([*centres, at.tip[:3, 3]], axis=0)
    z, y = np.array([0.0, 0.0, 1.0]), np.array([0.0, 1.0, 0.0])
    signs, zero, lengths = [at.sign_1], [], [centres[0][2]]
    for i, step in zip((1, 3, 5), steps, strict=True):
        before_y, before_z = y, z
        y, sign_y = _turned(at.along[i], partial(_along, before_y))
        z, sign_z = _turned(at.along[i + 1], partial(_along, step), partial(_along, before_z))
        # The turn about z takes the previous y to this y; the turn about y takes z to z.
        zero.append(np.arctan2(before_z @ np.cross(before_y, y), before_y @ y))
        zero.append(np.arctan2(y @ np.cross(before_z, z), before_z @ z))
        signs += [sign_y, sign_z]
        lengths.append(z @ step)
    names = FAMILIES["srs"].lengths
    return dict(zip(names, lengths, strict=True)), signs, [*zero, 0.0]


def _along(one: Array, other: Array) -> float:
    return float(one @ other)


def _turned(direction: Array, *wanted: Callable[[Array], float]) -> tuple[Array, float]:
    """Return a direction or its opposite, and the sign, so that `wanted` of it is positive.

    The first of the functions that is not zero decides; if all are zero, then y, x or z, the first
    of them that is not zero, is made positive.
    """
    values = [*(want(direction) for want in wanted), *direction[[1, 0, 2]]]
    sign = 1.0 if next(value for value in values if abs(value) > NEARLY) > 0 else -1.0
    return sign * direction, sign


def _fit_end(
    family: str, at: _Lines, lengths: dict[str, float], signs: list[float], zero: list[float]
) -> Manipulator:
    """Return the model with the last joint's offset and the end frame fitted to the tip."""
    model = Manipulator(
        id="",
        kinematics=family,
        geometry={k: _round(float(v)) for k, v in lengths.items()},
        sign=np.array(signs),
        offset=np.array([_round(-float(q)) for q in zero]),
        T_base_foot=at.foot,
    )
    want = at.foot @ at.tip
    still = np.zeros(model.joints)
    left = np.linalg.inv(model.forward(still)) @ want
    if np.hypot(left[0, 2], left[1, 2]) < NEARLY and left[2, 2] > 0:
        last = _round(-float(np.arctan2(left[1, 0], left[0, 0])))
        model = replace(model, offset=np.append(model.offset[:-1], last))
        left = np.linalg.inv(model.forward(still)) @ want
    return replace(model, T_end_flange=_tidy(left))


def _miss(chain: KinematicChain, model: Manipulator) -> float:
    """Return the largest entry by which the model's poses differ from the chain's."""
    q = np.random.default_rng(2008).uniform(-np.pi, np.pi, (POSES_COMPARED, model.joints))
    return float(np.abs(model.forward(q) - chain.forward(q)).max())


def _round(value: float) -> float:
    """Return the number without its last digits, which are only rounding."""
    return round(value, 13) + 0.0


def _tidy(T: Array) -> Array:
    return np.eye(4) if np.abs(T - np.eye(4)).max() < NONE else T


DERIVED = {6: (("opw", _opw), ("ur", _ur)), 7: (("srs", _srs),)}
"""For each number of joints, the closed-form families and the function that fits each to axes."""


# -----------------------------------------------------------------------------
# Build a robot from its description: family and model from the geometry, limits as written.

SNAPS = (5e-6, 5e-5, 5e-4, 5e-3)
"""rad: the rounding errors of angles written with five, four, three and two decimals."""
POSES = 256


def read_description(
    path: str | Path,
    snap: float | None,
    *,
    base: str | None,
    tip: str | None,
    mount: str | None,
    part: str | None,
    packages: Mapping[str, str | Path] | None,
    meshes: bool,
) -> Description:
    """Return the description of an arm, its angles as written or, within snap, rounded to 15 deg.

    Raises
    ------
    InputError
        As `read_urdf`. Also without snap where the arm as written belongs to no family with a
        closed form, but does with its angles rounded: the message says how far that moves the tip.
    """
    found = read_urdf(
        path,
        base=base,
        tip=tip,
        mount=mount,
        part=part,
        packages=packages,
        meshes=meshes,
        snap=0.0 if snap is None else snap,
    )
    if snap is not None or in_closed_form(found.chain):
        return found
    meant = {
        snap: read_urdf(path, base=base, tip=tip, mount=mount, meshes=False, snap=snap).chain
        for snap in SNAPS
    }
    whole = meant[SNAPS[-1]]
    if not in_closed_form(whole):
        return found
    least = next(snap for snap, chain in meant.items() if _alike(chain, whole))
    off, turned = _moved(found, whole)
    raise InputError(
        f"{found.path} ({found.base} to {found.tip}): the arm as written belongs to no family "
        "with a closed form, but it does with its angles rounded to 15 deg. Use "
        f"snap={least:g} to round them, which moves the tip by up to {off * 1e3:.2g} mm and "
        f"{np.degrees(turned):.2g} deg"
        + (
            "; or snap=0 to keep the angles as a general arm, whose solver may need minutes to "
            "prepare"
            if len(found.joints) == 6
            else ""
        )
    )


def _alike(one: KinematicChain, two: KinematicChain) -> bool:
    """Return whether two chains have the same frames."""
    return np.array_equal(one.origins, two.origins) and np.array_equal(one.end, two.end)


def _moved(found: Description, meant: KinematicChain) -> tuple[float, float]:
    """Return how far rounding moves the tip, m, and turns it, rad, over random joint vectors."""
    q = np.random.default_rng(1571).uniform(-np.pi, np.pi, (POSES, len(found.joints)))
    here, there = found.chain.forward(q), meant.forward(q)
    off = np.linalg.norm(there[:, :3, 3] - here[:, :3, 3], axis=1)
    between = np.swapaxes(here[:, :3, :3], 1, 2) @ there[:, :3, :3]
    return float(off.max()), float(Rotation.from_matrix(between).magnitude().max())


def build_robot(
    kind: type[A],
    description: Description,
    *,
    as_written: bool = False,
    manufacturer: str = "",
    axis_3: str = "",
    axis_3_limits: ArrayLike | None = None,
    lower: ArrayLike | None = None,
    upper: ArrayLike | None = None,
    velocity: ArrayLike | None = None,
    acceleration: ArrayLike | None = None,
    jerk: ArrayLike | None = None,
    torque: ArrayLike | None = None,
    endless: ArrayLike | None = None,
) -> A:
    """Return the robot of a description; given limits (rad, s, N m) replace those written there.

    Raises
    ------
    InputError
        The chain belongs to no family; a limit is missing or zero there and is not given; and as
        `with_axis_3`.
    """
    where = f"{description.path} ({description.base} to {description.tip})"
    try:
        model = recognise(description.chain, as_written=as_written)
    except InputError as error:
        raise InputError(f"{where}: {error}") from None
    continuous = np.array([joint.kind == "continuous" for joint in description.joints])
    left_out = ", ".join(description.left_out)
    outside = [f"Links on joints outside the chain are ignored: {left_out}."] if left_out else []
    low, high = _ranges(description, lower, upper, endless)
    source = "given by the user"
    if acceleration is None and (acceleration := _acceleration(description)) is not None:
        source = f"URDF {Path(description.path).name}"
    found = kind(
        id=description.name,
        manufacturer=manufacturer,
        notes=(*model.notes, *outside),
        kinematics=model.kinematics,
        geometry=model.geometry,
        sign=model.sign,
        offset=model.offset,
        T_base_foot=model.T_base_foot,
        T_end_flange=model.T_end_flange,
        lower=low,
        upper=high,
        velocity=_velocity(description) if velocity is None else np.asarray(velocity),
        acceleration=None if acceleration is None else np.asarray(acceleration),
        acceleration_source="" if acceleration is None else source,
        jerk=_jerk(description) if jerk is None else np.asarray(jerk),
        torque=_torque(description) if torque is None else np.asarray(torque),
        endless=continuous if endless is None else np.asarray(endless),
        chain=description.chain,
        bodies=description.bodies,
        inertia=description.inertia,
        inertia_missing=description.inertia_missing,
        frames={"base": description.base, "tip": description.tip},
        sources={"geometry_limits_velocity": f"URDF {Path(description.path).name}"},
    )
    return with_axis_3(found, axis_3, axis_3_limits)


def _ranges(
    description: Description,
    lower: ArrayLike | None,
    upper: ArrayLike | None,
    endless: ArrayLike | None,
) -> tuple[Array, Array]:
    """Return lower and upper limits; an endless joint has none and gets one turn."""
    n = len(description.joints)
    free = np.zeros(n, bool) if endless is None else np.asarray(endless, bool)
    low, high = -np.pi * np.ones(n), np.pi * np.ones(n)
    for i, joint in enumerate(description.joints):
        if joint.kind == "continuous" or free[i]:
            continue
        if (joint.lower is None and lower is None) or (joint.upper is None and upper is None):
            raise _lacks(description, joint.name, "has no position limits", "lower= and upper=")
        if joint.lower == joint.upper and (lower is None or upper is None):
            raise _lacks(
                description,
                joint.name,
                f"has the same lower and upper limit, {joint.lower:g} rad, so it cannot move",
                "lower= and upper=",
            )
        low[i], high[i] = joint.lower or 0.0, joint.upper or 0.0
    return (
        low if lower is None else np.asarray(lower),
        high if upper is None else np.asarray(upper),
    )


def _acceleration(description: Description) -> Array | None:
    """Return the accelerations (n,) written there (URDF 1.2); None unless all joints have one."""
    found = [joint.acceleration for joint in description.joints]
    _require_positive(description, found, "acceleration", "rad/s^2")
    return None if None in found else np.array(found, dtype=float)


def _jerk(description: Description) -> Array | None:
    """Return the jerks (n,) written there (URDF 1.2), infinity for joints without one."""
    found = [joint.jerk for joint in description.joints]
    _require_positive(description, found, "jerk", "rad/s^3")
    written = np.array([np.inf if jerk is None else jerk for jerk in found])
    return written if np.isfinite(written).any() else None


def _torque(description: Description) -> Array | None:
    """Return the efforts (n,) written there; None unless all joints have one."""
    found = [joint.effort for joint in description.joints]
    return None if None in found else np.array(found, dtype=float)


def _require_positive(
    description: Description, found: list[float | None], name: str, unit: str
) -> None:
    """Raise InputError where a written limit of one kind is zero or negative."""
    for joint, value in zip(description.joints, found, strict=True):
        if value is not None and value <= 0:
            what = f"has the {name} limit {value:g} {unit}, so it cannot move"
            raise _lacks(description, joint.name, what, f"{name}=")


def _velocity(description: Description) -> Array:
    for joint in description.joints:
        if joint.velocity is None:
            raise _lacks(description, joint.name, "has no velocity limit", "velocity=")
        if joint.velocity <= 0:
            what = f"has the velocity limit {joint.velocity:g} rad/s, so it cannot move"
            raise _lacks(description, joint.name, what, "velocity=")
    return np.array([joint.velocity for joint in description.joints], dtype=float)


def _lacks(description: Description, joint: str, what: str, keys: str) -> InputError:
    return InputError(
        f"{description.path}: joint {joint!r} {what}; give {keys} for all "
        f"{len(description.joints)} joints (rad, rad/s)"
    )
