"""Proven bounds on the joints over regions: cells of gamma, of a tilt and of external axes.

A region is a box of parameters: gamma; where the tool axis may tilt, the rotation vector of the
tilt in the x-y-plane of the task frame; and the values of the external axes. The closed form of the
arm is evaluated with Taylor models (`kerfpath.robots.taylor`).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import copysign, factorial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kerfpath.arrays import Array, Bools, Ints, short_repr
from kerfpath.errors import InputError
from kerfpath.kernels.kinematics import REACH
from kerfpath.robots.arm import Arm
from kerfpath.robots.enclosure import ball_frames
from kerfpath.robots.external_axes import ExternalAxis
from kerfpath.robots.taylor import UNIT, Region, Taylor, angle_of

__all__ = ["Regions", "enclose_regions"]

AT_ONCE = 2048
"""Regions enclosed together: enough to hide overhead, few enough to fit the cache."""
ANGLE_ERROR = 2e-14
"""rad: error of an offset and of the removal of full turns, per rad of the offset and per rad."""
TERMS = 6
"""Terms of the series of sine and cosine of a tilt."""
NONE, KNOWN = 0, 1
Pose = list[list[Taylor]]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Regions:
    """Bounds on the joints of C regions in P postures.

    For all parameters s with |s_j| <= h_j, joint i of every solution of a posture is, modulo full
    turns, within `radius` of center + slope s_0 + sum_j tied_j s_j, where s_0 belongs to gamma.

    Parameters
    ----------
    status : (C, P) uint8
        0 where the posture has no solution anywhere on the region.
    center, slope, bend, radius : (C, P, n)
    tied : (C, P, M, n)
        Slopes by the M other parameters, rad per unit.
    """

    status: NDArray[np.uint8]
    center: Array
    slope: Array
    bend: Array
    tied: Array
    radius: Array

    __repr__ = short_repr


def enclose_regions(
    arm: Arm,
    axes: Sequence[ExternalAxis],
    frames: Array,
    T_flange_tip: Array,
    node: Ints,
    gamma: Array,
    half: Array,
    at: Array,
    reach: Array,
) -> Regions:
    """Return bounds on the joints of every posture over regions; limits are ignored.

    The tip is at frames[node] . exp(w) . R_z(gamma), where w = (w_x, w_y, 0) is the tilt, as the
    external axes place the frame relative to the robot base.

    Parameters
    ----------
    arm : Arm
        An arm with `Family.enclose_all`.
    axes : sequence of ExternalAxis
    frames : (K, 4, 4) m
        Task frames without tilt, in the robot base at zero of all axes.
    T_flange_tip : (4, 4) m
    node, gamma, half : (C,), (C,) rad, (C,) rad
    at, reach : (C, M)
        Middle and half-width of the other parameters: w_x and w_y, rad, if there is a tilt, and
        then the values of the axes, rad or m.

    Raises
    ------
    InputError
        The family has no proven bounds.
    """
    if arm.kinematics not in _POSTURES:
        raise InputError(f"enclose: its family ({arm.family.words}) has no proven bounds")
    parts = []
    for first in range(0, max(len(node), 1), AT_ONCE):
        some = slice(first, first + AT_ONCE)
        with np.errstate(all="ignore"):
            parts.append(
                _enclosed(
                    arm,
                    axes,
                    frames,
                    T_flange_tip,
                    node[some],
                    gamma[some],
                    half[some],
                    at[some],
                    reach[some],
                )
            )
    names = Regions.__dataclass_fields__
    return Regions(**{k: np.concatenate([getattr(p, k) for p in parts]) for k in names})


def _enclosed(
    arm: Arm,
    axes: Sequence[ExternalAxis],
    frames: Array,
    T_flange_tip: Array,
    node: Ints,
    gamma: Array,
    half: Array,
    at: Array,
    reach: Array,
) -> Regions:
    """Return the bounds of regions that are few enough for the cache."""
    C, M, n = len(node), at.shape[1], arm.joints + len(axes)
    region = Region.of(np.vstack([half, reach.T]))
    s = region.parameters(np.vstack([gamma, at.T]))
    spin, tilt, x = s[0], s[1 : M + 1 - len(axes)], s[M + 1 - len(axes) :]
    pose = _pose(arm, axes, frames[node], T_flange_tip, spin, tilt, x)
    size = (C, arm.postures)
    status = np.zeros(size, np.uint8)
    center, slope, bend, radius = np.zeros((4, *size, n))
    # The square of a parameter is from 0 to h^2; the other products are within their bounds.
    j, k = region.first, region.second
    own, mixed = np.flatnonzero((j == k) & (j > 0)), np.flatnonzero(j != k)
    tied = np.zeros((*size, M, n))
    for posture, none, angles in _POSTURES[arm.kinematics](arm.model(), pose):
        status[:, posture] = np.where(none, NONE, KNOWN)
        for i, angle in enumerate(angles):
            known = angle.away < np.pi
            sign, offset = arm.sign[i], arm.offset[i]
            error = ANGLE_ERROR * (4.0 + abs(offset))
            parts = angle.quad * region.both
            middle, around = 0.5 * parts[own].sum(axis=0), 0.5 * np.abs(parts[own]).sum(axis=0)
            around = around + np.abs(parts[mixed]).sum(axis=0)
            value = sign * (np.where(known, angle.value + middle, 0.0) + offset)
            value -= 2 * np.pi * np.round(value / (2 * np.pi))
            rest = (angle.rest + around) * (1 + 64 * UNIT) + error
            rest = np.where(known, rest, np.pi * (1 + 4 * UNIT))
            center[:, posture, i] = np.where(known, value, 0.0)
            slope[:, posture, i] = np.where(known, sign * angle.line[1], 0.0)
            bend[:, posture, i] = np.where(known, 2.0 * sign * angle.quad[0], 0.0)
            tied[:, posture, :, i] = np.where(known, sign * angle.line[2:], 0.0).T
            radius[:, posture, i] = rest
    for axis in range(len(axes)):
        i, m = arm.joints + axis, M - len(axes) + axis
        center[:, :, i] = at[:, None, m]
        tied[:, :, m, i] = 1.0
        radius[:, :, i] = 4 * UNIT * (1.0 + np.abs(at[:, None, m]))
    return Regions(status=status, center=center, slope=slope, bend=bend, tied=tied, radius=radius)


# -----------------------------------------------------------------------------
# The pose of the model's end: its axes and the wrist centre, in the model's base.


def _pose(
    arm: Arm,
    axes: Sequence[ExternalAxis],
    H: Array,
    T_flange_tip: Array,
    spin: Taylor,
    tilt: Sequence[Taylor],
    x: Sequence[Taylor],
) -> Pose:
    """Return three rows of four columns: the axes of the model's end, and the wrist centre."""
    wrist = float(arm.geometry[arm.family.wrist])
    eye = np.eye(4)
    foot = arm.T_base_foot if not axes else eye
    balls = ball_frames(H, T_flange_tip, foot, arm.T_end_flange, wrist)
    c, s = spin.cos_sin()
    none = spin.region.constant(0.0)
    turned: Pose = [[c, -s, none], [s, c, none], [none, none, none.plus(1.0)]]
    if tilt:
        turned = _product(_tilted(*tilt), turned)
    end = _right(turned, balls.end, balls.end_radius)
    pose = _left(np.moveaxis(balls.base, 0, -1), np.moveaxis(balls.base_radius, 0, -1), end)
    if not axes:
        return pose
    for each, value in zip(reversed(axes), reversed(x), strict=True):
        if each.carries == "part":
            pose = _moved(each, value, pose)
    for each, value in zip(axes, x, strict=True):
        if each.carries == "robot":
            pose = _moved(each, -value, pose)
    foot_balls = ball_frames(eye[None], eye, arm.T_base_foot, eye, 0.0)
    return _left(foot_balls.base[0], foot_balls.base_radius[0], pose)


def _tilted(x: Taylor, y: Taylor) -> Pose:
    """Return the rotation by the rotation vector (x, y, 0)."""
    xx, yy, xy = x * x, y * y, x * y
    square = xx + yy
    _, most = square.bounds()
    # sin(a) / a and (1 - cos a) / a^2, alternating series in the square of the angle.
    a, b = _series(square, most, 1).plus(1.0), _series(square, most, 2).plus(0.5)
    p, q, both = (b * yy).scaled(-1.0).plus(1.0), (b * xx).scaled(-1.0).plus(1.0), b * xy
    ax, ay, z = a * x, a * y, (b * square).scaled(-1.0).plus(1.0)
    return [[p, both, ay], [both, q, -ax], [-ay, ax, z]]


def _series(x: Taylor, most: Array, first: int) -> Taylor:
    """Return the sum of (-x)^k / (2 k + first)! for k from 1 on, where x is at most 6.

    The terms alternate and fall, so that the first one left out bounds the rest.
    """
    total = x.scaled(0.0)
    for k in range(TERMS, 0, -1):
        total = total.plus(1.0) * x.scaled(-1.0)
        scale = factorial(2 * k + first) / factorial(2 * k + first - 2)
        total = total.scaled(1.0 / scale, UNIT / scale)
    total = total.scaled(1.0 / factorial(first), UNIT)
    left_out = np.abs(most) ** (TERMS + 1) / factorial(2 * TERMS + 2 + first)
    return total.plus(0.0, left_out * (1 + 16 * UNIT))


def _moved(axis: ExternalAxis, x: Taylor, pose: Pose) -> Pose:
    """Return the pose (3, 4) moved by an external axis at x."""
    a = axis.axis
    error = 4 * UNIT
    if axis.kind == "linear":
        return [[*row[:3], row[3] + x.scaled(a[i], error)] for i, row in enumerate(pose)]
    c, s = x.cos_sin()
    rest = (-c).plus(1.0)
    K = np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])
    turn: Pose = [
        [
            s.scaled(K[i, j], error)
            + rest.scaled(a[i] * a[j], error)
            + (c if i == j else c.scaled(0.0))
            for j in range(3)
        ]
        for i in range(3)
    ]
    there = [[*row[:3], row[3].plus(-axis.point[i])] for i, row in enumerate(pose)]
    back = _product(turn, there)
    return [[*row[:3], row[3].plus(axis.point[i])] for i, row in enumerate(back)]


def _product(A: Pose, B: Pose) -> Pose:
    """Return the product of a 3 x 3 matrix and one of three rows."""
    return [
        [A[i][0] * B[0][j] + A[i][1] * B[1][j] + A[i][2] * B[2][j] for j in range(len(B[0]))]
        for i in range(3)
    ]


def _right(A: Pose, m: Array, r: Array) -> Pose:
    """Return the product of a 3 x 3 matrix and numbers m (3, 4) +- r."""
    return [
        [
            A[i][0].scaled(m[0, j], r[0, j])
            + A[i][1].scaled(m[1, j], r[1, j])
            + A[i][2].scaled(m[2, j], r[2, j])
            for j in range(4)
        ]
        for i in range(3)
    ]


def _left(m: Array, r: Array, B: Pose) -> Pose:
    """Return the product of a pose of numbers m (3, 4, ...) +- r and a pose."""
    rows = []
    for i in range(3):
        row = [
            B[0][j].scaled(m[i, 0], r[i, 0])
            + B[1][j].scaled(m[i, 1], r[i, 1])
            + B[2][j].scaled(m[i, 2], r[i, 2])
            for j in range(4)
        ]
        rows.append([*row[:3], row[3].plus(m[i, 3], r[i, 3])])
    return rows


# -----------------------------------------------------------------------------
# The closed forms of the arms: postures, where each has no solution, and its angles.

Solved = Iterator[tuple[int, Bools, list[Taylor]]]


def _opw(arm: Any, pose: Pose) -> Solved:
    """Yield the postures of an OPW arm, as `kerfpath.kernels.enclosure`."""
    px, py, z = pose[0][3], pose[1][3], pose[2][3].plus(-arm.c1)
    rr = px * px + py * py
    dd = rr.plus(-arm.b * arm.b, UNIT * arm.b * arm.b)
    gone = dd.value + dd.away < -2.0 * REACH
    ray, d = angle_of(py, px), dd.sqrt()
    link, psi = np.hypot(arm.a2, arm.c3), np.arctan2(arm.a2, arm.c3)
    for shoulder, front in enumerate((1.0, -1.0)):
        x = d.scaled(front).plus(-arm.a1)
        bend, leant, none = _triangle(x * x + z * z, arm.c2, link)
        phi = angle_of(x, z)
        q1 = ray.plus(shoulder * np.pi, 4 * UNIT)
        if arm.b != 0.0:
            q1 = ray + angle_of(d.region.constant(-arm.b), d.scaled(front))
        k1, s1 = q1.cos_sin()
        ahead = [k1 * pose[0][j] + s1 * pose[1][j] for j in range(3)]
        across = k1 * pose[1][2] - s1 * pose[0][2]
        for elbow, up in enumerate((front, -front)):
            q2, q3 = phi - leant.scaled(up), bend.scaled(up).plus(-psi, 8 * UNIT)
            k, s = (q2 + q3).cos_sin()
            wx, wz = (
                k * ahead[2] - s * pose[2][2],
                s * ahead[2] + k * pose[2][2],
            )
            g, e = s * ahead[0] + k * pose[2][0], s * ahead[1] + k * pose[2][1]
            sine = (wx * wx + across * across).sqrt()
            q4, q5, q6 = angle_of(across, wx), angle_of(sine, wz), angle_of(e, -g)
            first = 4 * shoulder + 2 * elbow
            yield first, gone | none, [q1, q2, q3, q4, q5, q6]
            flipped = [q4.plus(np.pi, 4 * UNIT), -q5, q6.plus(np.pi, 4 * UNIT)]
            yield first + 1, gone | none, [q1, q2, q3, *flipped]


def _ur(arm: Any, pose: Pose) -> Solved:
    """Yield the postures of an arm of the Universal Robots type (`kernels.enclosure_ur`)."""
    px, py, height = pose[0][3], pose[1][3], pose[2][3].plus(-arm.d1)
    dd = (px * px + py * py).plus(-arm.d4 * arm.d4, UNIT * arm.d4 * arm.d4)
    gone = dd.value + dd.away < -2.0 * REACH
    ray, d = angle_of(py, px), dd.sqrt()
    for shoulder, front in enumerate((1.0, -1.0)):
        ahead = copysign(front, front * arm.a2)
        radial = d.scaled(ahead)
        if arm.d4 != 0.0:
            q1 = ray + angle_of(d.region.constant(arm.d4), d.scaled(ahead))
        else:
            q1 = ray.plus(0.0 if ahead > 0.0 else np.pi, 4 * UNIT)
        k1, s1 = q1.cos_sin()
        across = [s1 * pose[0][j] - k1 * pose[1][j] for j in range(3)]
        z, z2 = k1 * pose[0][2] + s1 * pose[1][2], pose[2][2]
        q5 = angle_of((z * z + z2 * z2).sqrt(), across[2])
        theta, q6 = angle_of(-z2, -z), angle_of(-across[1], across[0])
        kt, st = theta.cos_sin()
        for wrist, plus in enumerate((1.0, -1.0)):
            x, y = radial - st.scaled(plus * arm.d5), height + kt.scaled(plus * arm.d5)
            bend, leant, none = _triangle(x * x + y * y, arm.a2, arm.a3)
            phi, half = angle_of(y, x), wrist * np.pi
            for elbow, up in enumerate((front, -front)):
                turn = -copysign(up, up * arm.a3)
                q3, q2 = bend.scaled(turn), phi - leant.scaled(turn)
                q4 = theta.plus(half, 4 * UNIT) - (q2 + q3)
                angles = [q1, q2, q3, q4, q5.scaled(plus), q6.plus(half, 4 * UNIT)]
                yield 4 * shoulder + 2 * elbow + wrist, gone | none, angles


def _triangle(reach: Taylor, a: float, b: float) -> tuple[Taylor, Taylor, Bools]:
    """Return the bend between links a and b and the lean of b behind a, and where there is none.

    `reach` is the square of the distance that they span; the bend is from 0 to pi.
    """
    links = a * a + b * b
    factor = 1.0 / (2.0 * a * b)
    cosine = reach.plus(-links, 8 * UNIT * links).scaled(factor, 16 * UNIT * abs(factor))
    none = np.abs(cosine.value) - cosine.away > 1.0 + 2.0 * REACH
    bend = cosine.arccos()
    k, s = bend.cos_sin()
    error = 4 * UNIT * abs(b)
    return bend, angle_of(s.scaled(b, error), k.scaled(b, error).plus(a)), none


_POSTURES = {"opw": _opw, "ur": _ur}
