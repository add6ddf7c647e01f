"""Forward and inverse kinematics of arms of the Universal Robots type, batched.

Axes 2, 3 and 4 are parallel, axis 1 is square to them and meets axis 2, axis 5 is square to axis 4
and meets it, axis 6 is square to axis 5 and meets it. Lengths d1, a2, a3, d4, d5, d6 are the
Denavit-Hartenberg parameters that the maker publishes (alpha = 90, 0, 0, 90, -90, 0 deg). The
order of solution follows Hawkins, "Analytic inverse kinematics for the Universal Robots UR-5/UR-10
arms" (Georgia Tech, 2013): joint 1, joint 5, the sum of joints 2 to 4, the elbow. As in
`kinematics`, sines and cosines are computed algebraically, and joint 6 follows from that sum, so
that poses near the wrist singularity keep full accuracy.

In the plane of the arm, square to axis 2, x is the direction ahead at q = 0, turned by joint 1, and
y points upwards.

Posture mu = 4 * shoulder + 2 * elbow + wrist: shoulder front 0 (axis 4 on the side of axis 1 that
the arm reaches to at q2 = 0), rear 1; elbow up 0, down 1; wrist plus 0, minus 1 (sign of sin q5).
"""

from __future__ import annotations

from math import atan2, copysign, cos, sin, sqrt
from typing import NamedTuple

import numpy as np

from kerfpath.arrays import Array, Bools, Ints
from kerfpath.kernels.jit import jit, jit_part
from kerfpath.kernels.kinematics import EVERY, ON_AXIS, POSTURES, REACH, wrap

__all__ = ["UrArm", "forward", "forward_all", "inverse", "inverse_all", "inverse_one"]


class UrArm(NamedTuple):
    """Lengths of the arm (m) and its joint convention: q_model = sign * q - offset (rad)."""

    d1: float
    a2: float
    a3: float
    d4: float
    d5: float
    d6: float
    sign: Array
    offset: Array


@jit_part
def forward(arm: UrArm, q: Array, out_T: Array) -> None:
    """Pose of the flange in the robot base, the product of the link transforms written out."""
    q1 = arm.sign[0] * q[0] - arm.offset[0]
    q2 = arm.sign[1] * q[1] - arm.offset[1]
    q3 = arm.sign[2] * q[2] - arm.offset[2]
    q5 = arm.sign[4] * q[4] - arm.offset[4]
    q6 = arm.sign[5] * q[5] - arm.offset[5]
    theta = q2 + q3 + arm.sign[3] * q[3] - arm.offset[3]
    s1, k1, st, kt = sin(q1), cos(q1), sin(theta), cos(theta)
    s5, k5, s6, k6 = sin(q5), cos(q5), sin(q6), cos(q6)
    for j in range(3):
        # Column j of Rx(90) Rz(q5) Rx(-90) Rz(q6), then turned by theta in the plane of the arm.
        if j == 0:
            u, v, w = k5 * k6, s6, s5 * k6
        elif j == 1:
            u, v, w = -k5 * s6, k6, -s5 * s6
        else:
            u, v, w = -s5, 0.0, k5
        x, y = kt * u - st * v, st * u + kt * v
        out_T[0, j] = k1 * x + s1 * w
        out_T[1, j] = s1 * x - k1 * w
        out_T[2, j] = y
    x = arm.a2 * cos(q2) + arm.a3 * cos(q2 + q3) + arm.d5 * st
    y = arm.a2 * sin(q2) + arm.a3 * sin(q2 + q3) - arm.d5 * kt
    out_T[0, 3] = k1 * x + s1 * arm.d4 + arm.d6 * out_T[0, 2]
    out_T[1, 3] = s1 * x - k1 * arm.d4 + arm.d6 * out_T[1, 2]
    out_T[2, 3] = arm.d1 + y + arm.d6 * out_T[2, 2]
    out_T[3, 0], out_T[3, 1], out_T[3, 2], out_T[3, 3] = 0.0, 0.0, 0.0, 1.0


@jit_part
def _free_wrist(arm: UrArm, x: float, y: float, side: float) -> tuple[float, float]:
    """Return sine and cosine of theta where axes 4 and 6 are parallel and theta is free.

    Axis 5 is taken square to the line from shoulder to wrist (x, y), on the given `side`, or as
    near to that as keeps axis 4 within reach of the two links.
    """
    D = sqrt(x * x + y * y)
    if D < ON_AXIS or abs(arm.d5) < ON_AXIS:
        return 0.0, 1.0
    outer, inner = abs(arm.a2) + abs(arm.a3), abs(abs(arm.a2) - abs(arm.a3))
    base, twice = D * D + arm.d5 * arm.d5, 2.0 * D * arm.d5
    most = (base - inner * inner) / twice
    least = (base - outer * outer) / twice
    if twice < 0.0:
        least, most = most, least
    cosine = max(-1.0, min(1.0, max(least, min(most, 0.0))))
    sine = side * sqrt(1.0 - cosine * cosine)
    # Axis 5 points along (sin theta, -cos theta).
    return (cosine * x - sine * y) / D, -(cosine * y + sine * x) / D


@jit_part
def _elbow(
    arm: UrArm, x: float, y: float, front: float, theta: float, out_q: Array, out_reach: Bools
) -> None:
    """Fill joints 2 to 4 of both elbows, rows 0 and 2 of out_q, for axis 4 at (x, y)."""
    reach = x * x + y * y
    cosine = (reach - arm.a2 * arm.a2 - arm.a3 * arm.a3) / (2.0 * arm.a2 * arm.a3)
    if abs(cosine) > 1.0 + REACH or reach < ON_AXIS * ON_AXIS:
        return
    cosine = min(1.0, max(-1.0, cosine))
    sine = sqrt(1.0 - cosine * cosine)
    for elbow in range(2):
        up = front if elbow == 0 else -front
        bend = -up * copysign(sine, arm.a3)
        A, B = arm.a2 + arm.a3 * cosine, arm.a3 * bend
        q2 = atan2(A * y - B * x, A * x + B * y)
        q3 = atan2(bend, cosine)
        row = out_q[2 * elbow]
        row[1] = wrap(arm.sign[1] * (q2 + arm.offset[1]))
        row[2] = wrap(arm.sign[2] * (q3 + arm.offset[2]))
        row[3] = wrap(arm.sign[3] * (wrap(theta - q2 - q3) + arm.offset[3]))
        out_reach[2 * elbow] = True


@jit_part
def inverse(arm: UrArm, T: Array, posture: int, out_q: Array, out_reach: Bools) -> None:
    """All postures of a flange pose, in (-pi, pi], or one with the other elbow.

    Fills out_q (8, 6) and out_reach (8,); rows out of reach, or not asked for, are left at zero.
    """
    px, py = T[0, 3] - arm.d6 * T[0, 2], T[1, 3] - arm.d6 * T[1, 2]
    height = T[2, 3] - arm.d6 * T[2, 2] - arm.d1
    rr = px * px + py * py
    dd = rr - arm.d4 * arm.d4
    out_q[:] = 0.0
    out_reach[:] = False
    if dd < -REACH:
        return
    d = sqrt(max(dd, 0.0))
    for shoulder in range(2):
        if posture != EVERY and shoulder != posture // 4:
            continue
        front = 1.0 if shoulder == 0 else -1.0
        radial = front * copysign(d, arm.a2)
        k1, s1 = 1.0, 0.0
        if rr > ON_AXIS * ON_AXIS:
            k1, s1 = (px * radial - py * arm.d4) / rr, (py * radial + px * arm.d4) / rr
        q1 = wrap(arm.sign[0] * (atan2(s1, k1) + arm.offset[0]))
        x, y = T[0, 2] * k1 + T[1, 2] * s1, T[2, 2]
        s5 = sqrt(x * x + y * y)
        q5 = atan2(s5, T[0, 2] * s1 - T[1, 2] * k1)
        for wrist in range(2):
            if posture != EVERY and wrist != posture % 2:
                continue
            plus = 1.0 if wrist == 0 else -1.0
            if s5 > ON_AXIS:
                st, kt = -plus * y / s5, -plus * x / s5
            else:
                st, kt = _free_wrist(arm, radial, height, plus)
            q6 = atan2(
                kt * T[2, 0] - st * (k1 * T[0, 0] + s1 * T[1, 0]),
                kt * T[2, 1] - st * (k1 * T[0, 1] + s1 * T[1, 1]),
            )
            i = 4 * shoulder + wrist
            _elbow(
                arm,
                radial - arm.d5 * st,
                height + arm.d5 * kt,
                front,
                atan2(st, kt),
                out_q[i : i + 3],
                out_reach[i : i + 3],
            )
            for row in range(i, i + 3, 2):
                if out_reach[row]:
                    out_q[row, 0] = q1
                    out_q[row, 4] = wrap(arm.sign[4] * (plus * q5 + arm.offset[4]))
                    out_q[row, 5] = wrap(arm.sign[5] * (q6 + arm.offset[5]))


@jit
def forward_all(arm: UrArm, q: Array, out_T: Array) -> None:
    """Flange poses (B, 4, 4) of joint vectors (B, 6)."""
    for i in range(len(q)):
        forward(arm, q[i], out_T[i])


@jit
def inverse_all(arm: UrArm, T: Array, out_q: Array, out_reach: Bools) -> None:
    """All postures (B, 8, 6) of flange poses (B, 4, 4)."""
    for i in range(len(T)):
        inverse(arm, T[i], EVERY, out_q[i], out_reach[i])


@jit
def inverse_one(arm: UrArm, T: Array, posture: Ints, out_q: Array) -> None:
    """Joints (B, 6) of flange poses (B, 4, 4) in one posture (B,) each; NaN out of reach."""
    q, reach = np.empty((POSTURES, 6)), np.empty(POSTURES, np.bool_)
    for i in range(len(T)):
        inverse(arm, T[i], posture[i], q, reach)
        for j in range(6):
            out_q[i, j] = q[posture[i], j] if reach[posture[i]] else np.nan
