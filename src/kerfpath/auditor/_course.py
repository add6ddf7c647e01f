"""Proven bounds on joint velocities and accelerations along a course of the tool, at every instant.

The course consists of smooth pieces, each a closed formula of time. The joints and their first two
derivatives are enclosed over short spans of time, rounding included, and spans are divided until
the bounds suffice. No code is shared with the kinematics used for planning.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import factorial

import numpy as np

from kerfpath._arrays import Array, Bools, Ints
from kerfpath._repr import short_repr
from kerfpath.auditor._carried import CarryingAxes, Column
from kerfpath.auditor._enclosure import fixed_poses, joints_of, require_closed_form
from kerfpath.auditor._intervals import Interval, exact
from kerfpath.auditor._jets import Jet, angle_from, constant
from kerfpath.auditor._postures import POSTURES_OF, Pose
from kerfpath.errors import InputError
from kerfpath.robots import Robot

__all__ = ["ENCLOSED", "CoursePieces", "rates_along"]

ENCLOSED = tuple(POSTURES_OF)
"""Families of arms whose rates can be bounded."""
AT_ONCE = 1024
"""Number of spans that are enclosed together."""
TERMS = 16
"""Number of terms of the series of sine and cosine: enough for half a revolution."""
CUT_OFF = 1e-15
"""Bound on the remainder of the series and its first two derivatives, up to half a revolution."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CoursePieces:
    """The pose of the tip over time, in P smooth pieces.

    At time t (s) from the zero of the piece, the tip is at point + velocity t + acceleration
    t^2 / 2 + cos(rate t) x + sin(rate t) y in the part. Its frame is `R` turned, in its own axes,
    by the rotation vector r = turn[0] + turn[1] t + turn[2] t^2 / 2 of less than half a revolution;
    with two angles it is turned about z by r_z, and then by (r_x, r_y, 0) about an axis of `R`.

    Parameters
    ----------
    begin, end : (P,) s
        Begin and end of each piece, from its own zero of time.
    R : (P, 3, 3)
        Orientation of the tip at r = 0.
    turn : (P, 3, 3) rad, rad/s, rad/s^2
        Coefficients of the rotation vector.
    point : (P, 3, 3) m, m/s, m/s^2
        Point, velocity, acceleration.
    x, y : (P, 3) m
        Half-axes of an arc; zero where there is none.
    rate : (P,) rad/s
        Angular rate of the arc.
    external : (P, 3, E) rad or m, and per s and s^2
        External axes are at external[0] + external[1] t + external[2] t^2 / 2.
    two_angles : bool
        Whether the frame turns by two angles, see above.
    """

    begin: Array
    end: Array
    R: Array
    turn: Array
    point: Array
    x: Array
    y: Array
    rate: Array
    external: Array
    two_angles: bool = False

    __repr__ = short_repr


def rates_along(
    robot: Robot,
    pieces: CoursePieces,
    q: Array,
    *,
    T_base_part: Array,
    T_flange_tip: Array,
    enough: tuple[Array, Array],
    deepest: int = 10,
) -> tuple[Array, Array]:
    """Return bounds on the absolute velocity and acceleration of every joint over each piece.

    Parameters
    ----------
    robot : Robot
        A robot of family "opw" or "ur", with or without external axes.
    pieces : CoursePieces
    q : (P, n) rad
        Joints in the middle of each piece, which select the posture.
    T_base_part, T_flange_tip : (4, 4) m
    enough : two of (n,) rad/s, rad/s^2
        Values at which the bounds of a piece are good enough.
    deepest : int
        Largest number of times that a piece is halved.

    Returns
    -------
    velocity, acceleration : (P, n) rad/s, rad/s^2
        Infinite where nothing is proved: close to a singularity, or out of reach.

    Raises
    ------
    InputError
        The robot is of another family, or the pieces have another number of external axes.
    """
    require_closed_form(robot)
    if pieces.external.shape[2] != len(robot.externals):
        raise InputError(
            f"pieces: expected values of {len(robot.externals)} external axes of robot "
            f"{robot.id!r}, got {pieces.external.shape[2]}"
        )
    task = _Task(robot, pieces, T_base_part, T_flange_tip)
    middle, half = (pieces.begin + pieces.end) / 2, (pieces.end - pieces.begin) / 2
    k = np.arange(len(middle))
    posture = np.zeros(len(k), dtype=np.int64)
    velocity, acceleration = np.zeros((2, len(middle), robot.joints))
    for depth in range(deepest + 1):
        # The halves overlap a little, so that rounding leaves no gap between them.
        joints, none = task.joints(k, middle, half * (1 + 1e-12))
        if depth == 0:
            posture = _nearest(joints, none, q)
        fast, sharp = _rates(joints, none, posture[k])
        done = ((fast <= enough[0]) & (sharp <= enough[1])).all(axis=1) | (depth == deepest)
        np.maximum.at(velocity, k[done], fast[done])
        np.maximum.at(acceleration, k[done], sharp[done])
        k, half = np.repeat(k[~done], 2), np.repeat(half[~done] / 2, 2)
        middle = np.repeat(middle[~done], 2) + np.tile([-1.0, 1.0], len(k) // 2) * half
        if not len(k):
            break
    return velocity, acceleration


class _Task:
    """The course of a robot, and the fixed poses before and after it."""

    def __init__(
        self, robot: Robot, pieces: CoursePieces, T_base_part: Array, T_flange_tip: Array
    ) -> None:
        self._robot, self._pieces = robot, pieces
        self._before, self._after = fixed_poses(robot, T_base_part[None], T_flange_tip)
        self._axes = CarryingAxes(robot)

    def joints(self, k: Ints, t: Array, half: Array) -> tuple[list[Jet], Bools]:
        """Return the joints over spans t +- half of pieces k (S,), and where there are none.

        They are as in `joints_of`; external axes come last.
        """
        parts = []
        for i in range(0, len(k), AT_ONCE):
            rows = slice(i, i + AT_ONCE)
            with np.errstate(all="ignore"):
                time = angle_from(t[rows], half[rows])
                coefficients = np.moveaxis(self._pieces.external[k[rows]], -1, 0)
                values = [_polynomial(each, time) for each in coefficients]
                arm, absent = joints_of(self._robot, self._pose(k[rows], time, values))
                parts.append(([*arm, *values], absent))
        none = np.concatenate([np.broadcast_to(n, (2, 2, 2, n.shape[-1])) for _, n in parts], -1)
        return [_joined(each) for each in zip(*(joints for joints, _ in parts), strict=True)], none

    def _pose(self, k: Ints, time: Jet, values: list[Jet]) -> Pose:
        """Return the pose of the model's end over time, with external axes at these values."""
        pieces, before, after = self._pieces, self._before[..., 0], self._after
        turn = [_polynomial(pieces.turn[k, :, i], time) for i in range(3)]
        E = _swung(turn) if pieces.two_angles else _rotation(turn)
        c, s = time.times(exact(pieces.rate[k])).cos_sin()
        tip = [
            _polynomial(pieces.point[k, :, i], time)
            + c.times(exact(pieces.x[k, i]))
            + s.times(exact(pieces.y[k, i]))
            for i in range(3)
        ]
        R = exact(np.moveaxis(pieces.R[k], 0, -1))
        columns: list[Column] = []
        for j in range(4):
            own = [after[i, j] for i in range(3)]
            turned = [_sum([E[i][m].times(own[m]) for m in range(3)]) for i in range(3)]
            inside = [_sum([turned[m].times(R[i, m]) for m in range(3)]) for i in range(3)]
            if j == 3:
                inside = [a + b for a, b in zip(inside, tip, strict=True)]
            column = [_sum([inside[m].times(before[i, m]) for m in range(3)]) for i in range(3)]
            if j == 3:
                column = [each.plus(before[i, 3]) for i, each in enumerate(column)]
            columns.append((column[0], column[1], column[2]))
        x, y, z, point = self._axes.moved(columns, values)
        return Pose(x=x, y=y, z=z, point=point)


def _nearest(joints: list[Jet], none: Bools, q: Array) -> Ints:
    """Return the posture (S,) nearest to joints q (S, n) in the middle of spans."""
    off = np.zeros((8, len(q)))
    for joint, own in zip(joints, q.T, strict=True):
        angle = np.broadcast_to(joint.at.middle(), none.shape).reshape(8, -1)
        apart = np.abs((angle - own + np.pi) % (2 * np.pi) - np.pi)
        off = np.maximum(off, np.where(np.isnan(apart), np.inf, apart))
    return np.asarray(np.argmin(off, axis=0))


def _rates(joints: list[Jet], none: Bools, posture: Ints) -> tuple[Array, Array]:
    """Return bounds (S, n) on velocity and acceleration over spans, each in its posture (S,)."""
    rows = np.arange(len(posture))
    found = np.empty((2, len(posture), len(joints)))
    absent = none.reshape(8, -1)[posture, rows]
    for i, joint in enumerate(joints):
        for kind, held in enumerate((joint.rate, joint.bend)):
            size = np.broadcast_to(held.magnitude(), none.shape).reshape(8, -1)[posture, rows]
            found[kind, :, i] = np.where(np.isnan(size) | absent, np.inf, size)
    return found[0], found[1]


def _polynomial(coefficients: Array, time: Jet) -> Jet:
    """Return c0 + c1 t + c2 t^2 / 2 of coefficients (S, 3)."""
    c0, c1, c2 = (exact(c) for c in coefficients.T)
    return (time.times(c1) + time.square().times(c2.scaled(0.5))).plus(c0)


def _swung(r: list[Jet]) -> list[list[Jet]]:
    """Return the rotation about z by r_z, and then by the rotation vector (r_x, r_y, 0)."""
    c, s = r[2].cos_sin()
    flat = constant(exact(np.zeros_like(r[2].half)), r[2])
    return [[u * c + v * s, v * c - u * s, w] for u, v, w in _rotation([r[0], r[1], flat])]


def _rotation(r: list[Jet]) -> list[list[Jet]]:
    """Return the rotation by a rotation vector: 1 + a [r] + b [r]^2 (Rodrigues)."""
    squares = [each.square() for each in r]
    size2 = squares[0] + squares[1] + squares[2]
    a, b = _series(size2, 1), _series(size2, 2)
    x, y, z = r
    ax, ay, az = (a * each for each in r)
    one = constant(exact(np.ones_like(size2.half)), size2)
    xy, xz, yz = (b * (u * v) for u, v in ((x, y), (x, z), (y, z)))
    xx, yy, zz = (b * each for each in squares)
    return [
        [one - (yy + zz), xy - az, xz + ay],
        [xy + az, one - (xx + zz), yz - ax],
        [xz - ay, yz + ax, one - (xx + yy)],
    ]


def _series(s: Jet, first: int) -> Jet:
    """Return the sum over k of (-s)^k / (2 k + first)!: sin(x) / x or (1 - cos x) / x^2 of x^2."""
    out = constant(exact(np.zeros_like(s.half)), s)
    for k in reversed(range(TERMS)):
        term = exact(1.0) / exact(float(factorial(2 * k + first)))
        out = (out * -s).plus(term)
    # By the chain rule the derivatives of the remainder contain those of s.
    off = CUT_OFF * np.maximum(1.0, s.rate.magnitude() ** 2 + s.bend.magnitude())
    rest = Interval(-off, off)
    return Jet(
        out.at + rest, out.slope + rest, out.value + rest, out.rate + rest, out.bend + rest, s.half
    )


def _sum(jets: list[Jet]) -> Jet:
    return jets[0] + jets[1] + jets[2]


def _joined(jets: tuple[Jet, ...]) -> Jet:
    """Return jets of several batches as one, in every posture."""
    if len(jets) == 1:
        return jets[0]

    def along(name: str) -> Interval:
        held = [getattr(each, name) for each in jets]
        ends = [
            np.concatenate([np.broadcast_to(e, (2, 2, 2, e.shape[-1])) for e in end], axis=-1)
            for end in ([h.lo for h in held], [h.hi for h in held])
        ]
        return Interval(*ends)

    half = np.concatenate([each.half for each in jets])
    return Jet(along("at"), along("slope"), along("value"), along("rate"), along("bend"), half)
