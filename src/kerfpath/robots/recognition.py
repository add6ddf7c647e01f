"""Recognise the kinematic family of an arm from its joint axes.

The joint axes at angle zero suffice: they give the lengths of the model, and the model's angles
at that pose become the joint offsets. The model is then compared with the chain of the
description at random joint angles. An arm that belongs to no family with a closed form is
"general", and its chain is its model.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise

import numpy as np

from kerfpath.arrays import Array
from kerfpath.errors import InputError
from kerfpath.robots.arm import Arm
from kerfpath.robots.families import FAMILIES
from kerfpath.robots.general import require_solver
from kerfpath.urdf import KinematicChain

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

    def apart(self, groups: Sequence[Sequence[int]]) -> str:
        """Say which axes of the groups do not meet in one point each; "" if all do."""
        for group in groups:
            which = list(group)
            words = ", ".join(str(i + 1) for i in which[:-1]) + f" and {which[-1] + 1}"
            for i, j in pairwise(which):
                if np.linalg.norm(np.cross(self.along[i], self.along[j])) < NEARLY:
                    return f"axes {i + 1} and {j + 1} are parallel"
            point = self.meet(which[1], which[0])
            off = max(self.distance(point, i) for i in which)
            if off > EXACT:
                return f"axes {words} miss a common point by {off * 1e3:.3g} mm"
            if self.distance(point, 3) < NEARLY:
                return f"axes {words} meet on axis 4"
        return ""

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


def recognise(chain: KinematicChain, *, as_written: bool = False) -> tuple[Arm, tuple[str, ...]]:
    """Return an arm of the family of a chain, its geometry and joint convention; and remarks.

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
            return model, ()
        misfits.append(f"not an {words}, from which it differs by {miss:.1e} (m and rad)")
        if miss > ROUNDED or (as_written and n == 6):
            continue
        raise InputError(
            f"nearly an {words}, but it differs by {miss:.1e} (m and rad, at most {EXACT:g} is "
            "allowed); write its axes and lengths with more digits"
            + (", or read the arm as written with a snap of 0" if n == 6 else "")
        )
    if n == 7:
        for name, meeting in MEETING.items():
            misfit = lines.apart(meeting)
            if not misfit:
                return Arm(kinematics=name, geometry={}, chain=chain), ()
            misfits.append(f"not an {FAMILIES[name].words}, because {misfit}")
        raise InputError(
            f"{'; '.join(misfits)}: other seven-axis arms are not supported. If the first joint is "
            "an external axis, name the link that the arm is mounted on as mount"
        )
    try:
        require_solver()
    except InputError as error:
        raise InputError(f"{'; '.join(misfits)}: {error}") from None
    notes = (f"General arm: {'; '.join(misfits)}.",)
    return Arm(kinematics="general", geometry={}, chain=chain), notes


def _lines(chain: KinematicChain) -> _Lines:
    place, along, tip = chain.lines()
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
    return _Lines(foot, (place - foot[:3, 3]) @ R, along @ R, np.linalg.inv(foot) @ tip, sign)


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
) -> Arm:
    """Return the model with the last joint's offset and the end frame fitted to the tip."""
    model = Arm(
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


def _miss(chain: KinematicChain, model: Arm) -> float:
    """Return the largest entry by which the model's poses differ from the chain's."""
    q = np.random.default_rng(2008).uniform(-np.pi, np.pi, (POSES_COMPARED, model.joints))
    return float(np.abs(model.forward(q) - chain.forward(q)).max())


def _round(value: float) -> float:
    """Return the number without its last digits, which are only rounding."""
    return round(value, 13) + 0.0


def _tidy(T: Array) -> Array:
    return np.eye(4) if np.abs(T - np.eye(4)).max() < NONE else T


MEETING = {
    "offset_shoulder": ((1, 2), (4, 5, 6)),
    "offset_wrist": ((0, 1, 2), (4, 5)),
}
"""Families of seven axes that the chain itself models: the axes (from 0) that meet in a point."""
DERIVED = {6: (("opw", _opw), ("ur", _ur)), 7: (("srs", _srs),)}
"""For each number of joints, the closed-form families and the function that fits each to axes."""
