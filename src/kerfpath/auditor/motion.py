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
from kerfpath.auditor.enclosure import (
    POINT,
    fixed_poses,
    joints_of,
    require_closed_form,
    seen_from_foot,
)
from kerfpath.auditor.jets import Interval, Jet, angle_from, constant, exact, joined
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


class CarryingAxes:
    """The external axes of a robot in the frame of its model's base, with all axes at zero."""

    def __init__(self, robot: Robot) -> None:
        numbered = list(enumerate(robot.externals))
        part = [(i, axis) for i, axis in numbered if axis.carries == "part"]
        carriers = [(i, axis) for i, axis in numbered if axis.carries == "robot"]
        # On the way from the part to the base, the part's innermost axis comes first, and the
        # outermost of the axes under the robot comes before the inner ones.
        self._passed = [_Axis(robot, *each) for each in [*part[::-1], *carriers]]

    def moved(self, columns: Jet, values: Jet) -> Jet:
        """Return axes x, y, z and a point of a frame that moves with the part, in the moved base.

        Parameters
        ----------
        columns : Jet (3, 4, S)
            x, y, z and the point with all axes at zero.
        values : Jet (E, S)
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
        direction, point = seen_from_foot(robot, unit / size, exact(axis.point))
        self._direction, self._point = direction[:, None, None], point[:, None, None].scaled(POINT)

    def moved(self, columns: Jet, value: Jet) -> Jet:
        """Return axes and point (3, 4, S) of a frame moved by this axis to a value (S,)."""
        value = value.scaled(self._sign)
        if not self._turns:
            return columns + value.times(self._direction.scaled(POINT))
        return self._turned(columns.plus(-self._point), *value.cos_sin()).plus(self._point)

    def _turned(self, r: Jet, c: Jet, s: Jet) -> Jet:
        """Return vectors (3, ...) turned about the direction k by an angle of cosine c and sine s.

        By Rodrigues' formula the part along k stays, and the rest r' becomes c r' + s (k x r).
        """
        k = self._direction
        along = r[0].times(k[0]) + r[1].times(k[1]) + r[2].times(k[2])
        own = along.times(k)
        across = r[CYCLE[2]].times(k[CYCLE[1]]) - r[CYCLE[1]].times(k[CYCLE[2]])
        return own + c * (r - own) + s * across


CYCLE = np.array([[0, 1, 2], [1, 2, 0], [2, 0, 1]])
"""Axes, the axes after them, and those before them."""


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
    depth = 0
    while len(k):
        # The parts overlap a little, so that rounding leaves no gap between them.
        joints, none = task.joints(k, middle, half * (1 + 1e-12))
        if depth == 0:
            posture = _nearest(joints, none, q)
        fast, sharp = _rates(joints, none, posture[k])
        if robot.limits.acceleration_table is not None:
            sharp = sharp * scarcity(robot, *_spans(joints, none, posture[k], q[k]))
        done = ((fast <= enough[0]) & (sharp <= enough[1])).all(axis=1) | (depth == deepest)
        np.maximum.at(velocity, k[done], fast[done])
        np.maximum.at(acceleration, k[done], sharp[done])
        # Few spans take as long as many: then two halvings are one step.
        step = min(2 if 4 * len(k[~done]) <= AT_ONCE else 1, deepest - depth)
        depth, parts = depth + step, 2**step
        part = np.arange(1 - parts, parts, 2)
        half = half[~done] / parts
        middle = (middle[~done, None] + part * half[:, None]).ravel()
        k, half = np.repeat(k[~done], parts), np.repeat(half, parts)
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
                values = _polynomial(self._pieces.external[k[rows]], time)
                arm, absent = joints_of(self._robot, self._pose(k[rows], time, values))
                external = [values[i] for i in range(len(self._robot.externals))]
                parts.append(([*arm, *external], absent))
        none = np.concatenate([np.broadcast_to(n, (2, 2, 2, n.shape[-1])) for _, n in parts], -1)
        if len(parts) == 1:
            return parts[0][0], none
        batches = [[q.broadcast_to((2, 2, 2, len(q.half))) for q in joints] for joints, _ in parts]
        return [joined(each, axis=-1) for each in zip(*batches, strict=True)], none

    def _pose(self, k: Ints, time: Jet, values: Jet) -> Pose:
        """Return the pose of the model's end over time, with external axes at values (E, S)."""
        pieces, before, after = self._pieces, self._before, self._after
        turn = _polynomial(pieces.turn[k], time)
        R = exact(np.moveaxis(pieces.R[k], 0, -1))
        c, s = time.times(exact(pieces.rate[k])).cos_sin()
        tip = (
            _polynomial(pieces.point[k], time)
            + c.times(exact(pieces.x[k].T))
            + s.times(exact(pieces.y[k].T))
        )
        E = _swung(turn) if pieces.two_angles else _rotation(turn)
        own = [E[:, m, None].times(after[m]) for m in range(3)]
        inside = _times(R, own[0] + own[1] + own[2]) + tip[:, None].scaled(POINT)
        columns = _times(before, inside).plus(before[:, 3, None].scaled(POINT))
        return Pose(self._axes.moved(columns, values))


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


def _times(A: Interval, M: Jet) -> Jet:
    """Return the product of A (3, 3 or more, S) and M (3, 4, S)."""
    return M[0].times(A[:, 0, None]) + M[1].times(A[:, 1, None]) + M[2].times(A[:, 2, None])


def _polynomial(coefficients: Array, time: Jet) -> Jet:
    """Return c0 + c1 t + c2 t^2 / 2 of coefficients (S, 3, D) as jets (D, S)."""
    c0, c1, c2 = (exact(each) for each in np.moveaxis(coefficients, 0, -1))
    return (time.times(c1) + time.square().times(c2.scaled(0.5))).plus(c0)


def _swung(r: Jet) -> Jet:
    """Return the rotation (3, 3, S) about z by r_z, and then by the vector (r_x, r_y, 0)."""
    c, s = r[2].cos_sin()
    E = _rotation(r.scaled([[1.0], [1.0], [0.0]]))
    u, v, w = (E[:, j, None] for j in range(3))
    return joined([u * c + v * s, v * c - u * s, w], axis=1)


def _rotation(r: Jet) -> Jet:
    """Return the rotation (3, 3, S) by a vector r (3, S): 1 + a [r] + b [r]^2 (Rodrigues)."""
    squares = r.square()
    a, b = _series(squares[0] + squares[1] + squares[2])
    product = b * (r * r[CYCLE[1]])  # xy, yz, zx
    turned = a * r[CYCLE[2]]  # z, x, y
    squares = b * squares
    diagonal = (-(squares[CYCLE[1]] + squares[CYCLE[2]])).plus(exact(1.0))
    parts = joined([diagonal, product + turned, product - turned])
    return parts[np.array([[0, 6, 5], [3, 1, 7], [8, 4, 2]])]


def _series(s: Jet) -> tuple[Jet, Jet]:
    """Return sin(x) / x and (1 - cos x) / x^2 of x^2 = s: sums of (-s)^k / (2 k + 1 or 2)!."""
    out = constant(exact(np.zeros((2, len(s.half)))), s)
    for k in reversed(range(_terms(s.value.hi.max()))):
        out = (out * -s).plus(exact(1.0) / exact([[factorial(2 * k + 1)], [factorial(2 * k + 2)]]))
    # By the chain rule the derivatives of the remainder contain those of s.
    off = CUT_OFF * np.maximum(1.0, s.rate.magnitude() ** 2 + s.bend.magnitude())
    rest = Interval(-off, off)
    whole = Jet(
        out.at + rest, out.slope + rest, out.value + rest, out.rate + rest, out.bend + rest, s.half
    )
    return whole[0], whole[1]


def _terms(largest: float) -> int:
    """Return how many terms leave a remainder of `CUT_OFF` up to this value of x^2.

    From the third on, the terms and their first two derivatives fall to less than a third each;
    those of the first left out are at most n^2 / (2 n + 1)! times a power of x^2.
    """
    for n in range(3, TERMS):
        power = max(largest ** (n - 2), largest**n)
        if 1.5 * n * n * power <= CUT_OFF * factorial(2 * n + 1):
            return n
    return TERMS
