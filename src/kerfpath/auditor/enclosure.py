"""Rigorous enclosures of all inverse kinematics solutions on cells of gamma.

They serve to check the lower bound that a plan states on the cost of any motion. They hold for
every real gamma of a cell, rounding included, and use no samples. No code is shared with the closed
form used for planning.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from kerfpath.arrays import Array, Bools, Ints, short_repr
from kerfpath.auditor.jets import UNIT, Interval, Jet, angle_from, exact, stack
from kerfpath.auditor.postures import POSTURES_OF, TO_WRIST, Pose
from kerfpath.errors import InputError
from kerfpath.robots import Robot

POSTURES = 8
AT_ONCE = 2048
"""Cells that are enclosed together: enough to hide overhead, few enough to fit the cache."""
WRAPPED = 4e-15
"""rad: error of subtracting a few turns of the floating-point 2 pi from an angle."""
CURVED = 2.0
"""Factor by which a curve may be wider than a box; beyond it the box is used."""
ANY = float(np.nextafter(np.pi, 4.0))
"""rad: radius that covers every angle."""
POINT = np.array([[0.0], [0.0], [0.0], [1.0]])
"""One for the point of columns x, y, z, point, and zero for the axes."""


class Status(IntEnum):
    """The kind of enclosure of a posture on a cell."""

    NONE = 0
    """The posture has no solution anywhere in the cell."""
    SMOOTH = 1
    """It has one smooth solution everywhere in the cell."""
    BOX = 2
    """Its solutions, if any, are in a box."""


@dataclass(frozen=True, slots=True, eq=False)
class Enclosure:
    """Enclosures of the robot's joints on C cells, in each of P postures mu.

    For all t in [-h, h], up to full turns, joint i at gamma = m + t is in
    center + slope t + [low, high] t^2 / 2 +- radius. Where smooth it is one continuous function; in
    a box slope, low and high are zero, and the radius is just over pi where nothing is known.

    Parameters
    ----------
    status : (C, P) int
        Values of `Status`; all other arrays are zero where there is no solution.
    center : (C, P, n) rad
        In [-pi, pi].
    slope : (C, P, n)
        Derivative by gamma.
    low, high : (C, P, n) 1/rad
        Bounds of the second derivative.
    radius : (C, P, n) rad
    """

    status: Ints
    center: Array
    slope: Array
    low: Array
    high: Array
    radius: Array

    __repr__ = short_repr


def enclose(
    robot: Robot, frames: Array, node: Ints, gamma: Array, half: Array, T_flange_tip: Array
) -> Enclosure:
    """Enclose every joint vector that brings the tip to its task frame, turned by any gamma.

    Together the postures contain every joint vector that reaches a pose exactly: at a singularity
    those of both postures that meet there, and all of a continuum of solutions. Matrices whose
    rotations are not exact are widened to contain the nearest exact ones.

    Parameters
    ----------
    robot : Robot
        A robot of family "opw" or "ur" without external axes; its limits are ignored.
    frames : (K, 4, 4) m
        Task frames in the robot base.
    node : (C,) int
        Index of the task frame of each cell.
    gamma, half : (C,) rad
        A cell is [gamma - half, gamma + half].
    T_flange_tip : (4, 4) m

    Raises
    ------
    InputError
        The robot is of another family, or has an external axis.
    """
    require_closed_form(robot)
    if robot.externals:
        raise InputError(
            f"robot {robot.id!r}: enclosures need a robot without external axes, but it has "
            f"{robot.externals[0].name}; use robot.held(x)"
        )
    pieces = []
    before, after = fixed_poses(robot, frames, T_flange_tip)
    for i in range(0, max(len(node), 1), AT_ONCE):
        part = slice(i, i + AT_ONCE)
        with np.errstate(all="ignore"):
            turn = angle_from(gamma[part], half[part])
            pieces.append(_enclose(robot, before[..., node[part]], after, turn))
    names = Enclosure.__dataclass_fields__
    return Enclosure(**{name: np.concatenate([getattr(p, name) for p in pieces]) for name in names})


def linear_minimum(
    slope: Array, low: Array, high: Array, radius: Array, half: Array, z: Array, axis: int = -1
) -> Array:
    """Return a lower bound (...) over t in [-h, h] of z . (q(t) - center), rounding included.

    Parameters
    ----------
    slope, low, high, radius : (..., n)
        As in `Enclosure`.
    half : (...) rad
        Half-width h of each cell.
    z : (..., n)
        Weights of the joints, which are all on the turn of the enclosure.
    axis : int
        Array axis of the joints: the last, or the first, where sums are faster.
    """
    run = z * slope
    bend = z * np.where(z >= 0, low, high)
    # A sum of n products is off by less than (n + 1) units of the sum of their sizes.
    unit = (z.shape[axis] + 2) * UNIT
    steep = np.abs(run.sum(axis)) + unit * np.abs(run).sum(axis)
    curve = bend.sum(axis) - unit * np.abs(bend).sum(axis)
    off = (np.abs(z) * radius).sum(axis) * (1 + unit)
    # Minimum of curve t^2 / 2 - steep t on [0, h]: inside if the parabola turns upwards before h.
    end = (0.5 * curve * half - steep) * half
    inside = (curve > 0) & (steep < curve * half)
    vertex = -0.5 * steep * steep / np.where(inside, curve, 1.0)
    least = np.where(inside, vertex, end) - off
    rounded = 8 * UNIT * ((np.abs(curve) * half + steep) * half + off)
    return np.asarray(least - rounded)


def require_closed_form(robot: Robot) -> None:
    """Raise InputError if the family of a robot has no enclosures."""
    if robot.kinematics not in POSTURES_OF:
        raise InputError(
            f"robot {robot.id!r}: enclosures need a robot of family "
            f"{' or '.join(POSTURES_OF)}, got {robot.kinematics!r}"
        )


def fixed_poses(robot: Robot, frames: Array, T_flange_tip: Array) -> tuple[Interval, Interval]:
    """Return the fixed poses before and after the rotation of the tool, rows first.

    They are the task frames in the model's base (3, 4, K), and the axes and the wrist point of the
    model's end in the tip's frame, as columns x, y, z, point (3, 4, 1).
    """
    before = _product(_foot(robot), _rigid(np.moveaxis(frames, 0, -1)))
    flange = _inverse(_rigid(T_flange_tip[..., None]))
    after = _product(flange, _inverse(_rigid(robot.T_end_flange[..., None])))
    axis = after[:, 2]
    back = axis.scaled(-float(robot.geometry[TO_WRIST[robot.kinematics]]))
    wrist = after[:, 3] + back
    columns = stack([after[:, 0], after[:, 1], axis, wrist])
    return before, Interval(np.swapaxes(columns.lo, 0, 1), np.swapaxes(columns.hi, 0, 1))


def seen_from_foot(robot: Robot, direction: Interval, point: Interval) -> tuple[Interval, Interval]:
    """Return a direction and a point of the robot base in the model's base, (3,) each."""
    foot = _foot(robot)[..., 0]

    def turned(v: Interval) -> Interval:
        return foot[:, 0] * v[0] + foot[:, 1] * v[1] + foot[:, 2] * v[2]

    return turned(direction), turned(point) + foot[:, 3]


def _foot(robot: Robot) -> Interval:
    """Return the robot base in the model's base, (3, 4, 1)."""
    return _inverse(_rigid(robot.T_base_foot[..., None]))


def _rigid(T: Array) -> Interval:
    """Return poses (4, 4, ...), rows first, as (3, 4, ...) that contain the nearest exact rotation.

    In the Frobenius norm, a matrix R is no farther from a rotation than R^T R is from 1.
    """
    R = exact(T[:3, :3])
    off = np.zeros(T.shape[2:])
    for i in range(3):
        for j in range(3):
            dot = R[0, i] * R[0, j] + R[1, i] * R[1, j] + R[2, i] * R[2, j]
            off = off + (dot - exact(float(i == j))).magnitude() ** 2
    off = np.sqrt(off) * (1 + 32 * UNIT)
    lo, hi = T[:3].copy(), T[:3].copy()
    lo[:, :3] -= off + UNIT
    hi[:, :3] += off + UNIT
    return Interval(lo, hi)


def _inverse(T: Interval) -> Interval:
    """Return the inverse of poses (3, 4, ...)."""
    turned = [
        [T[0, i], T[1, i], T[2, i], -(T[0, i] * T[0, 3] + T[1, i] * T[1, 3] + T[2, i] * T[2, 3])]
        for i in range(3)
    ]
    return stack([stack(row) for row in turned])


def _product(A: Interval, B: Interval) -> Interval:
    """Return the product of poses (3, 4, ...)."""
    rows = []
    for i in range(3):
        row = [A[i, 0] * B[0, j] + A[i, 1] * B[1, j] + A[i, 2] * B[2, j] for j in range(4)]
        rows.append(stack([*row[:3], row[3] + A[i, 3]]))
    return stack(rows)


def joints_of(robot: Robot, pose: Pose) -> tuple[list[Jet], Bools]:
    """Return the robot's joints in every posture at poses of its model's end, and where none is.

    The joints are jets that broadcast to (2, 2, 2, C), as in `Postures`; the second result is a
    mask of that shape.
    """
    postures = POSTURES_OF[robot.kinematics](robot.geometry, pose)
    joints = [
        angle.plus(exact(offset)).scaled(sign)
        for angle, offset, sign in zip(postures.angles, robot.offset, robot.sign, strict=True)
    ]
    return joints, postures.none


def _enclose(robot: Robot, before: Interval, after: Interval, turn: Jet) -> Enclosure:
    """Enclose the solutions of cells with task frames `before` (3, 4, C) turned by `turn` (C,)."""
    joints, none = joints_of(robot, _turned_pose(before, after, turn))
    smooth = ~none
    for q in joints:
        smooth = smooth & q.at.known() & q.slope.known() & q.bend.known()
    status = np.where(none, Status.NONE, np.where(smooth, Status.SMOOTH, Status.BOX))
    parts = [_described(q, smooth, none) for q in joints]
    cells = [
        np.stack([np.broadcast_to(p, status.shape).reshape(POSTURES, -1).T for p in part], axis=-1)
        for part in zip(*parts, strict=True)
    ]
    return Enclosure(np.ascontiguousarray(status.reshape(POSTURES, -1).T), *cells)


def _turned_pose(before: Interval, after: Interval, turn: Jet) -> Pose:
    """Return the pose of the model's end: before . Rz(gamma) . after."""
    c, s = turn.cos_sin()
    b, (x, y, z) = before[:, :, None], (after[i] for i in range(3))
    along = b[:, 0] * x + b[:, 1] * y
    across = b[:, 1] * x - b[:, 0] * y
    rest = b[:, 2] * z + b[:, 3].scaled(POINT)
    return Pose((c.times(along) + s.times(across)).plus(rest))


def _described(q: Jet, smooth: Bools, none: Bools) -> tuple[Array, Array, Array, Array, Array]:
    """Return centre, slope, bounds of the second derivative and radius of one joint (2, 2, 2, C).

    All are zero where there is no solution; in a box all except centre and radius are. Close to a
    singularity the bounds of the second derivative are useless while those of the joint are not, so
    a box is returned.
    """
    middle = np.where(smooth, q.at.middle(), q.value.middle())
    box = q.value.radius(middle)
    steep = np.where(smooth, q.slope.middle(), 0.0)
    near = q.at.radius(middle) + q.half * q.slope.radius(steep) * (1 + UNIT)
    far = near + (np.abs(steep) + q.bend.magnitude() * q.half / 2) * q.half
    curved = smooth & ~(far > CURVED * box)
    radius = np.where(curved, near, box) * (1 + 4 * UNIT) + WRAPPED
    free = ~smooth & ~(radius < ANY)
    middle, radius = np.where(free | none, 0.0, middle), np.where(free, ANY, radius)
    return (
        middle - 2 * np.pi * np.round(middle / (2 * np.pi)),
        np.where(curved, steep, 0.0),
        np.where(curved, q.bend.lo, 0.0),
        np.where(curved, q.bend.hi, 0.0),
        np.where(none, 0.0, radius),
    )
