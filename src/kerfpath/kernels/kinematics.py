"""Forward and inverse kinematics of ortho-parallel arms with a spherical wrist (OPW), batched.

Geometry and names a1..c4 after Brandstoetter, Angerer and Hofbaur, "An analytical solution of the
inverse kinematics problem of industrial serial manipulators with an ortho-parallel basis and a
spherical wrist" (2014). Sines and cosines are computed algebraically, so that a posture needs only
arctangents, and the sixth angle follows from the fourth, so that poses near the wrist singularity
keep full accuracy.

Posture mu = 4 * shoulder + 2 * elbow + wrist: shoulder front 0, rear 1; elbow up 0, down 1; wrist
plus 0, minus 1 (sign of the model's fifth angle).
"""

from __future__ import annotations

from math import atan2, cos, pi, sin, sqrt
from typing import NamedTuple

import numpy as np

from kerfpath.arrays import Array, Bools, Ints
from kerfpath.kernels.frames import location
from kerfpath.kernels.jit import jit, jit_part

__all__ = [
    "POSTURES",
    "OpwArm",
    "forward",
    "forward_all",
    "inverse",
    "inverse_all",
    "inverse_nodes",
    "inverse_one",
    "wrap",
]

POSTURES = 8
EVERY = -1
"""In place of a posture: all of them."""

REACH = 1e-12
"""Excess of a cosine over 1 that rounding may leave at the stretched arm; it is clipped."""
ON_AXIS = 1e-12
"""Length (m) or sine below which an angle about an axis is free; it is then set to zero."""


class OpwArm(NamedTuple):
    """Lengths of an OPW arm (m) and its joint convention: q_model = sign * q - offset (rad)."""

    a1: float
    a2: float
    b: float
    c1: float
    c2: float
    c3: float
    c4: float
    sign: Array
    offset: Array


@jit_part
def forward(arm: OpwArm, q: Array, out_T: Array) -> None:
    """Pose of the flange in the robot base, the product of the link transforms (Eq. 3).

    Base and tool matrices multiply it from left and right: T_base . prod T . T_tool.
    """
    q1 = arm.sign[0] * q[0] - arm.offset[0]
    q2 = arm.sign[1] * q[1] - arm.offset[1]
    q3 = arm.sign[2] * q[2] - arm.offset[2]
    q4 = arm.sign[3] * q[3] - arm.offset[3]
    q5 = arm.sign[4] * q[4] - arm.offset[4]
    q6 = arm.sign[5] * q[5] - arm.offset[5]
    s1, k1, s2, k2 = sin(q1), cos(q1), sin(q2), cos(q2)
    s23, k23 = sin(q2 + q3), cos(q2 + q3)
    s4, k4, s5, k5, s6, k6 = sin(q4), cos(q4), sin(q5), cos(q5), sin(q6), cos(q6)
    # Wrist orientation in the forearm frame, Rz(q4) Ry(q5) Rz(q6), column by column.
    for j in range(3):
        if j == 0:
            x, y, z = k4 * k5 * k6 - s4 * s6, s4 * k5 * k6 + k4 * s6, -s5 * k6
        elif j == 1:
            x, y, z = -k4 * k5 * s6 - s4 * k6, k4 * k6 - s4 * k5 * s6, s5 * s6
        else:
            x, y, z = k4 * s5, s4 * s5, k5
        radial = k23 * x + s23 * z
        out_T[0, j] = k1 * radial - s1 * y
        out_T[1, j] = s1 * radial + k1 * y
        out_T[2, j] = k23 * z - s23 * x
    radial = arm.a1 + arm.c2 * s2 + arm.c3 * s23 + arm.a2 * k23
    out_T[0, 3] = k1 * radial - s1 * arm.b + arm.c4 * out_T[0, 2]
    out_T[1, 3] = s1 * radial + k1 * arm.b + arm.c4 * out_T[1, 2]
    out_T[2, 3] = arm.c1 + arm.c2 * k2 + arm.c3 * k23 - arm.a2 * s23 + arm.c4 * out_T[2, 2]
    out_T[3, 0], out_T[3, 1], out_T[3, 2], out_T[3, 3] = 0.0, 0.0, 0.0, 1.0


@jit_part
def wrap(angle: float) -> float:
    """Bring an angle of (-3 pi, 3 pi) into (-pi, pi]."""
    if angle > pi:
        return angle - 2.0 * pi
    return angle + 2.0 * pi if angle <= -pi else angle


@jit_part
def _wrist(
    arm: OpwArm, R: Array, s1: float, k1: float, s23: float, k23: float, out_q: Array
) -> None:
    """Fill joints 4 to 6 of both wrist postures, out_q (2, 6), for a forearm given by q1, q2+q3."""
    x0, x1, x2 = k23 * k1, k23 * s1, -s23
    x = R[0, 2] * x0 + R[1, 2] * x1 + R[2, 2] * x2
    y = R[1, 2] * k1 - R[0, 2] * s1
    z = R[0, 2] * s23 * k1 + R[1, 2] * s23 * s1 + R[2, 2] * k23
    s5 = sqrt(x * x + y * y)
    k4, s4 = (x / s5, y / s5) if s5 > ON_AXIS else (1.0, 0.0)
    v0, v1, v2 = -s4 * x0 - k4 * s1, -s4 * x1 + k4 * k1, -s4 * x2
    q4 = atan2(s4, k4)
    q5 = atan2(s5, z)
    q6 = atan2(
        v0 * R[0, 0] + v1 * R[1, 0] + v2 * R[2, 0], v0 * R[0, 1] + v1 * R[1, 1] + v2 * R[2, 1]
    )
    out_q[0, 3] = wrap(arm.sign[3] * (q4 + arm.offset[3]))
    out_q[0, 4] = wrap(arm.sign[4] * (q5 + arm.offset[4]))
    out_q[0, 5] = wrap(arm.sign[5] * (q6 + arm.offset[5]))
    out_q[1, 3] = wrap(out_q[0, 3] + pi)
    out_q[1, 4] = wrap(arm.sign[4] * (arm.offset[4] - q5))
    out_q[1, 5] = wrap(out_q[0, 5] + pi)


@jit_part
def inverse(arm: OpwArm, T: Array, posture: int, out_q: Array, out_reach: Bools) -> None:
    """All postures of a flange pose, Q = f^-1(L, mu) in (-pi, pi] (Eq. 4), or one with its flip.

    Fills out_q (8, 6) and out_reach (8,); rows out of reach, or not asked for, are left at zero.
    """
    cx = T[0, 3] - arm.c4 * T[0, 2]
    cy = T[1, 3] - arm.c4 * T[1, 2]
    z = T[2, 3] - arm.c4 * T[2, 2] - arm.c1
    rr = cx * cx + cy * cy
    dd = rr - arm.b * arm.b
    kk = arm.a2 * arm.a2 + arm.c3 * arm.c3
    k = sqrt(kk)
    out_q[:] = 0.0
    out_reach[:] = False
    if dd < -REACH:
        return
    d = sqrt(max(dd, 0.0))
    psi = atan2(arm.a2, arm.c3)
    for shoulder in range(2):
        if posture != EVERY and shoulder != posture // 4:
            continue
        front = 1.0 if shoulder == 0 else -1.0
        k1, s1 = front, 0.0
        if rr > ON_AXIS * ON_AXIS:
            k1 = (front * cx * d + cy * arm.b) / rr
            s1 = (front * cy * d - cx * arm.b) / rr
        x = front * d - arm.a1
        reach = x * x + z * z
        cosine = (reach - arm.c2 * arm.c2 - kk) / (2.0 * arm.c2 * k)
        if abs(cosine) > 1.0 + REACH or reach < ON_AXIS * ON_AXIS:
            continue
        cosine = min(1.0, max(-1.0, cosine))
        sine = sqrt(1.0 - cosine * cosine)
        bend = atan2(sine, cosine)
        q1 = wrap(arm.sign[0] * (atan2(s1, k1) + arm.offset[0]))
        A = arm.c2 + k * cosine
        for elbow in range(2):
            if posture != EVERY and elbow != posture // 2 % 2:
                continue
            up = front if elbow == 0 else -front
            B = up * k * sine
            s2, k2 = (x * A - z * B) / reach, (z * A + x * B) / reach
            q2 = wrap(arm.sign[1] * (atan2(s2, k2) + arm.offset[1]))
            q3 = wrap(arm.sign[2] * (up * bend - psi + arm.offset[2]))
            su, ku = s2 * cosine + up * k2 * sine, k2 * cosine - up * s2 * sine
            s23, k23 = (su * arm.c3 - ku * arm.a2) / k, (ku * arm.c3 + su * arm.a2) / k
            i = 4 * shoulder + 2 * elbow
            _wrist(arm, T, s1, k1, s23, k23, out_q[i : i + 2])
            for w in range(i, i + 2):
                out_q[w, 0], out_q[w, 1], out_q[w, 2], out_reach[w] = q1, q2, q3, True


@jit
def forward_all(arm: OpwArm, q: Array, out_T: Array) -> None:
    """Flange poses (B, 4, 4) of joint vectors (B, 6)."""
    for i in range(len(q)):
        forward(arm, q[i], out_T[i])


@jit
def inverse_all(arm: OpwArm, T: Array, out_q: Array, out_reach: Bools) -> None:
    """All postures (B, 8, 6) of flange poses (B, 4, 4)."""
    pose = np.empty((4, 4))
    for i in range(len(T)):
        for r in range(4):
            for c in range(4):
                pose[r, c] = T[i, r, c]
        inverse(arm, pose, EVERY, out_q[i], out_reach[i])


@jit
def inverse_one(arm: OpwArm, T: Array, posture: Ints, out_q: Array) -> None:
    """Joints (B, 6) of flange poses (B, 4, 4) in one posture (B,) each; NaN out of reach."""
    q, reach = np.empty((POSTURES, 6)), np.empty(POSTURES, np.bool_)
    for i in range(len(T)):
        inverse(arm, T[i], posture[i], q, reach)
        for j in range(6):
            out_q[i, j] = q[posture[i], j] if reach[posture[i]] else np.nan


@jit
def inverse_nodes(
    arm: OpwArm, H: Array, gamma: Array, T_tip_flange: Array, out_q: Array, out_reach: Bools
) -> None:
    """All postures (K, m, 8, 6) of task frames H (K, 4, 4) turned by each gamma (m,), with tool."""
    L = np.zeros((4, 4))
    T = np.zeros((4, 4))
    for j in range(len(gamma)):
        cos_gamma, sin_gamma = cos(gamma[j]), sin(gamma[j])
        for k in range(len(H)):
            location(H[k], cos_gamma, sin_gamma, L)
            for r in range(3):
                for c in range(4):
                    T[r, c] = (
                        L[r, 0] * T_tip_flange[0, c]
                        + L[r, 1] * T_tip_flange[1, c]
                        + L[r, 2] * T_tip_flange[2, c]
                    )
                T[r, 3] += L[r, 3]
            inverse(arm, T, EVERY, out_q[k, j], out_reach[k, j])
