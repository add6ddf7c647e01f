"""Proven bounds on joint velocities and accelerations along a motion of the tool, at every instant.

The motion consists of smooth pieces, each a closed formula of time. The joints and their first two
derivatives are enclosed over short spans of time, rounding included, and spans are divided until
the bounds suffice. No code is shared with the kinematics used for planning.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import factorial

import numpy as np
from scipy.spatial.transform import Rotation

from kerfpath.arrays import Array, Bools, Ints, short_repr
from kerfpath.auditor.acceleration import scarcity
from kerfpath.auditor.chain import JointChain
from kerfpath.auditor.enclosure import fixed_poses, joints_of, require_closed_form, seen_from_foot
from kerfpath.auditor.jets import Interval, Jet, angle_from, constant, exact
from kerfpath.auditor.postures import POSTURES_OF, Pose
from kerfpath.errors import InputError
from kerfpath.options import Interpolation
from kerfpath.plans import Plan
from kerfpath.robots import ExternalAxis, Robot

# -----------------------------------------------------------------------------
# The motion between the nodes of a plan, as the controller interpolates it.

NEWTON_STEPS = 12
"""Newton's method doubles its digits each step; a pose not reached after these is not reached."""

REACHED = 1e-9
"""Residual (m and rad) below which a pose counts as reached."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Motion:
    """Joints and tool at f = 0, 1/m, ..., 1 of the way from each node to the next.

    Parameters
    ----------
    q : (K-1, m+1, n) rad
        Joints; external axes come last, a rail in m.
    tip : (K-1, m+1, 3) m
        Tool tip in the robot base.
    axis : (K-1, m+1, 3)
        Tool axis in the robot base.
    residual : (K-1, m+1)
        Error of the commanded pose, the larger of m and rad.
    """

    q: Array
    tip: Array
    axis: Array
    residual: Array

    __repr__ = short_repr


def joint_increments(plan: Plan) -> Array:
    """Return joint increments (K-1, n) rad; an endless joint goes the short way round (13).

    Half a turn is equally long either way; it goes the way that the values go.
    """
    dq = np.diff(plan.q, axis=0)
    turns = np.round(dq / (2 * np.pi))
    return np.where(plan.robot.endless, dq - turns * 2 * np.pi, dq)


def motion_of(plan: Plan, chain: JointChain, interpolation: Interpolation, parts: int) -> Motion:
    """Return the motion between the nodes, each interval divided into `parts` equal times.

    "linear": from pose to pose the tip moves straight and the tool turns evenly about one axis, as
    in linear moves; the joints follow by inverse kinematics. "joint": the joints move evenly. In
    both, external axes and the free joint of a seven-axis arm move evenly; the line is straight in
    the part.
    """
    K, dq = len(plan.q), joint_increments(plan)
    f = np.linspace(0.0, 1.0, parts + 1)
    q = plan.q[:-1, None, :] + f[None, :, None] * dq[:, None, :]
    flat = q.reshape(-1, plan.q.shape[1])
    chain = replace(chain, tip=chain.tip @ plan.T_flange_tip)
    residual = np.zeros(len(flat))
    if interpolation == "linear":
        poses = chain.forward(plan.q)
        k = np.repeat(np.arange(K - 1), len(f))
        wanted = straight(poses[:-1], poses[1:], k, np.tile(f, K - 1))
        flat, residual = follow(chain, wanted, flat)
    tool = chain.forward(flat)
    shape = (K - 1, parts + 1)
    return Motion(
        q=flat.reshape(*shape, -1),
        tip=tool[:, :3, 3].reshape(*shape, 3),
        axis=tool[:, :3, 2].reshape(*shape, 3),
        residual=residual.reshape(shape),
    )


def straight(start: Array, end: Array, k: Ints, f: Array) -> Array:
    """Return the poses (B, 4, 4) m at shares f (B,) of the linear moves k (B,) from start to end.

    start, end : (M, 4, 4) m, the ends of each move.
    """
    R0 = start[:, :3, :3]
    turn = Rotation.from_matrix(R0.transpose(0, 2, 1) @ end[:, :3, :3]).as_rotvec()
    T = np.zeros((len(f), 4, 4))
    T[:, :3, :3] = R0[k] @ Rotation.from_rotvec(f[:, None] * turn[k]).as_matrix()
    T[:, :3, 3] = start[k, :3, 3] + f[:, None] * (end[:, :3, 3] - start[:, :3, 3])[k]
    T[:, 3, 3] = 1.0
    return T


def follow(chain: JointChain, wanted: Array, q: Array) -> tuple[Array, Array]:
    """Solve for the tool poses `wanted` (B, 4, 4) by Newton's method from the joints q (B, n).

    A five-axis arm only has to match tip and tool axis. External axes and the joint that runs
    evenly keep their values. Returns the joints and their errors (B,), m and rad.
    """
    q, n = q.copy(), len(chain.axes)
    residual = np.full(len(q), np.inf)
    open_ = np.arange(len(q))
    for _ in range(NEWTON_STEPS):
        T, J = chain.jacobian(q[open_])
        error = np.empty((len(open_), 6))
        error[:, :3] = wanted[open_, :3, 3] - T[:, :3, 3]
        turn = wanted[open_, :3, :3] @ T[:, :3, :3].transpose(0, 2, 1)
        error[:, 3:] = Rotation.from_matrix(turn).as_rotvec()
        if n < 6:
            z = T[:, :3, 2]
            error[:, 3:] = np.cross(z, wanted[open_, :3, 2])
            J[:, 3:] -= z[:, :, None] * np.einsum("bi,bij->bj", z, J[:, 3:])[:, None]
        if chain.even is not None:
            J[:, :, chain.even] = 0.0
        residual[open_] = np.abs(error).max(axis=1)
        late = residual[open_] > REACHED
        if not late.any():
            break
        open_, J, error = open_[late], J[late], error[late]
        # Damped least squares: at a singularity the step stays bounded, and the residual shows it.
        Jt = J.transpose(0, 2, 1)
        step = np.linalg.solve(Jt @ J + 1e-12 * np.eye(n), Jt @ error[..., None])[..., 0]
        q[open_, :n] += np.clip(step, -0.5, 0.5)
    return q, residual


# -----------------------------------------------------------------------------
# Enclosures of a pose that moves with the part, as seen from the robot base on external axes.

Column = tuple[Jet, Jet, Jet]
"""A direction or a point."""


class CarryingAxes:
    """The external axes of a robot in the frame of its model's base, with all axes at zero."""

    def __init__(self, robot: Robot) -> None:
        numbered = list(enumerate(robot.externals))
        part = [(i, axis) for i, axis in numbered if axis.carries == "part"]
        carriers = [(i, axis) for i, axis in numbered if axis.carries == "robot"]
        # On the way from the part to the base, the part's innermost axis comes first, and the
        # outermost of the axes under the robot comes before the inner ones.
        self._passed = [_Axis(robot, *each) for each in [*part[::-1], *carriers]]

    def moved(self, columns: list[Column], values: list[Jet]) -> list[Column]:
        """Return axes x, y, z and a point of a frame that moves with the part, in the moved base.

        Parameters
        ----------
        columns : four columns of jets
            x, y, z and the point with all axes at zero.
        values : list of Jet
            Values of the axes, rad or m.
        """
        for axis in self._passed:
            columns = axis.moved(columns, values[axis.number])
        return columns


class _Axis:
    """One external axis: a direction and a point on it, enclosed."""

    def __init__(self, robot: Robot, number: int, axis: ExternalAxis) -> None:
        self.number = number
        self._sign = 1.0 if axis.carries == "part" else -1.0
        self._turns = axis.kind == "rotary"
        unit = exact(axis.axis)
        size = (unit[0].square() + unit[1].square() + unit[2].square()).sqrt()
        direction = [unit[i] / size for i in range(3)]
        self._direction, self._point = seen_from_foot(robot, direction, exact(axis.point))

    def moved(self, columns: list[Column], value: Jet) -> list[Column]:
        """Return axes and point of a frame moved by this axis to a value."""
        *axes, point = columns
        value = value.scaled(self._sign)
        if not self._turns:
            way = [p + value.times(k) for p, k in zip(point, self._direction, strict=True)]
            return [*axes, (way[0], way[1], way[2])]
        c, s = value.cos_sin()
        x, y, z = (p.plus(-o) for p, o in zip(point, self._point, strict=True))
        u, v, w = self._turned((x, y, z), c, s)
        a, b, d = self._point
        return [*(self._turned(each, c, s) for each in axes), (u.plus(a), v.plus(b), w.plus(d))]

    def _turned(self, r: Column, c: Jet, s: Jet) -> Column:
        """Return a vector turned about the direction k by an angle of cosine c and sine s.

        By Rodrigues' formula the part along k stays, and the rest r' becomes c r' + s (k x r).
        """
        k = self._direction
        along = r[0].times(k[0]) + r[1].times(k[1]) + r[2].times(k[2])
        turned = []
        for i in range(3):
            m, n = (i + 1) % 3, (i + 2) % 3
            own = along.times(k[i])
            turned.append(own + c * (r[i] - own) + s * (r[n].times(k[m]) - r[m].times(k[n])))
        return turned[0], turned[1], turned[2]


# -----------------------------------------------------------------------------
# Proven bounds on joint velocities and accelerations along a course of the tool, at every instant.

ENCLOSED = tuple(POSTURES_OF)
"""Families of arms whose rates can be bounded."""
AT_ONCE = 1024
"""Number of spans that are enclosed together."""
TERMS = 16
"""Number of terms of the series of sine and cosine: enough for half a revolution."""
CUT_OFF = 1e-15
"""Bound on the remainder of the series and its first two derivatives, up to half a revolution."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MotionPieces:
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
    pieces: MotionPieces,
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
    pieces : MotionPieces
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
        Infinite where nothing is proved: close to a singularity, or out of reach. Where limits on
        the acceleration depend on the configuration, it is multiplied by the limit that holds
        everywhere over the least limit on the way: so its share of the former is that of its own.

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
        if robot.limits.acceleration_table is not None:
            sharp = sharp * scarcity(robot, *_spans(joints, none, posture[k], q[k]))
        done = ((fast <= enough[0]) & (sharp <= enough[1])).all(axis=1) | (depth == deepest)
        np.maximum.at(velocity, k[done], fast[done])
        np.maximum.at(acceleration, k[done], sharp[done])
        k, half = np.repeat(k[~done], 2), np.repeat(half[~done] / 2, 2)
        middle = np.repeat(middle[~done], 2) + np.tile([-1.0, 1.0], len(k) // 2) * half
        if not len(k):
            break
    return velocity, acceleration


class _Task:
    """The motion of a robot, and the fixed poses before and after it."""

    def __init__(
        self, robot: Robot, pieces: MotionPieces, T_base_part: Array, T_flange_tip: Array
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


def _spans(joints: list[Jet], none: Bools, posture: Ints, q: Array) -> tuple[Array, Array]:
    """Return the ends (S, 2) of joints 2 and 3 over spans, on the turns of q (S, n)."""
    rows, ends = np.arange(len(posture)), np.empty((2, len(posture), 2))
    for i, joint in enumerate(joints[1:3]):
        for end, held in enumerate((joint.value.lo, joint.value.hi)):
            ends[end, :, i] = np.broadcast_to(held, none.shape).reshape(8, -1)[posture, rows]
    turn = 2 * np.pi * np.round((q[:, 1:3] - ends.mean(axis=0)) / (2 * np.pi))
    return ends[0] + turn, ends[1] + turn


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
