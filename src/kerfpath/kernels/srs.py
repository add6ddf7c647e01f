"""Forward and inverse kinematics of seven-axis arms of type S-R-S, with joint 3 given, batched.

Shoulder (axes 1 to 3) and wrist (axes 5 to 7) are spherical; the elbow (axis 4) is between them.
With all angles at zero the arm is upright, its axes alternately along z and y: the shoulder is c1
above the foot, the elbow c2 further, then the wrist centre c3 and the end c4. A pose leaves one
parameter free. It is often the angle of the elbow's plane; here it is joint 3, so that the limits
of joint 3 are those of the free parameter (compare M. Shimizu, H. Kakuya, W.-K. Yoon, K. Kitagaki
and K. Kosuge, "Analytical inverse kinematic computation for 7-DOF redundant manipulators with joint
limits and its application to redundancy resolution", IEEE Transactions on Robotics 24(5), 2008).

Posture mu = 4 * shoulder + 2 * elbow + wrist: wrist centre ahead of axis 1 (front) 0, behind it
(rear) 1; joint 4 bent forwards in front or backwards in the rear (up) 0, else (down) 1; wrist
plus 0, minus 1 (sign of the model's sixth angle). With joint 3 at zero they are the postures of
an ortho-parallel arm (`kernels.kinematics`).
"""

from __future__ import annotations

from math import atan2, cos, pi, sin, sqrt
from typing import NamedTuple

import numpy as np

from kerfpath.arrays import Array, Bools
from kerfpath.kernels.jit import jit, jit_part
from kerfpath.kernels.kinematics import ON_AXIS, REACH, wrap

__all__ = ["SrsArm", "forward_all", "inverse_all"]


class SrsArm(NamedTuple):
    """Lengths of an S-R-S arm (m) and its joint convention: q_model = sign * q - offset (rad)."""

    c1: float
    c2: float
    c3: float
    c4: float
    sign: Array
    offset: Array


@jit_part
def _turn_z(R: Array, angle: float) -> None:
    """Turn the frame R (3, 3) about its own z-axis."""
    c, s = cos(angle), sin(angle)
    for i in range(3):
        x, y = R[i, 0], R[i, 1]
        R[i, 0], R[i, 1] = c * x + s * y, c * y - s * x


@jit_part
def _turn_y(R: Array, angle: float) -> None:
    """Turn the frame R (3, 3) about its own y-axis."""
    c, s = cos(angle), sin(angle)
    for i in range(3):
        x, z = R[i, 0], R[i, 2]
        R[i, 0], R[i, 2] = c * x - s * z, c * z + s * x


@jit_part
def forward(arm: SrsArm, q: Array, out_T: Array) -> None:
    """Pose of the end in the foot: joints turn about z, y, z, y, z, y and z, one after another."""
    R = out_T[:3, :3]
    out_T[:] = 0.0
    out_T[0, 0] = out_T[1, 1] = out_T[2, 2] = out_T[3, 3] = 1.0
    out_T[2, 3] = arm.c1
    for j in range(7):
        angle = arm.sign[j] * q[j] - arm.offset[j]
        if j % 2 == 0:
            _turn_z(R, angle)
        else:
            _turn_y(R, angle)
        length = arm.c2 if j == 2 else arm.c3 if j == 4 else arm.c4 if j == 6 else 0.0
        for i in range(3):
            out_T[i, 3] += length * R[i, 2]


@jit_part
def _wrist(arm: SrsArm, T: Array, F: Array, out_q: Array) -> None:
    """Fill joints 5 to 7 of both wrist postures, out_q (2, 7), for the forearm's frame F (3, 3)."""
    x, y, z = 0.0, 0.0, 0.0
    for i in range(3):
        x, y, z = x + T[i, 2] * F[i, 0], y + T[i, 2] * F[i, 1], z + T[i, 2] * F[i, 2]
    s6 = sqrt(x * x + y * y)
    k5, s5 = (x / s6, y / s6) if s6 > ON_AXIS else (1.0, 0.0)
    s7, k7 = 0.0, 0.0
    for i in range(3):
        side = k5 * F[i, 1] - s5 * F[i, 0]
        s7, k7 = s7 + side * T[i, 0], k7 + side * T[i, 1]
    q6 = atan2(s6, z)
    out_q[0, 4] = wrap(arm.sign[4] * (atan2(s5, k5) + arm.offset[4]))
    out_q[0, 5] = wrap(arm.sign[5] * (q6 + arm.offset[5]))
    out_q[0, 6] = wrap(arm.sign[6] * (atan2(s7, k7) + arm.offset[6]))
    out_q[1, 4] = wrap(out_q[0, 4] + pi)
    out_q[1, 5] = wrap(arm.sign[5] * (arm.offset[5] - q6))
    out_q[1, 6] = wrap(out_q[0, 6] + pi)


@jit_part
def inverse(arm: SrsArm, T: Array, q3: float, out_q: Array, out_reach: Bools) -> None:
    """All postures of a pose of the end with joint 3 at q3, the others in (-pi, pi].

    Fills out_q (8, 7) and out_reach (8,); rows out of reach are left at zero.
    """
    out_q[:] = 0.0
    out_reach[:] = False
    wx = T[0, 3] - arm.c4 * T[0, 2]
    wy = T[1, 3] - arm.c4 * T[1, 2]
    wz = T[2, 3] - arm.c4 * T[2, 2] - arm.c1
    ww = wx * wx + wy * wy
    reach = ww + wz * wz
    k4 = (reach - arm.c2 * arm.c2 - arm.c3 * arm.c3) / (2.0 * arm.c2 * arm.c3)
    if abs(k4) > 1.0 + REACH:
        return
    k4 = min(1.0, max(-1.0, k4))
    bend = sqrt(1.0 - k4 * k4)
    angle_3 = arm.sign[2] * q3 - arm.offset[2]
    s3, k3 = sin(angle_3), cos(angle_3)
    F = np.empty((3, 3))
    for shoulder in range(2):
        front = 1.0 if shoulder == 0 else -1.0
        for elbow in range(2):
            s4 = (front if elbow == 0 else -front) * bend
            # The wrist centre in the frame of joint 2; then turned by joint 2, and by joint 1.
            ux, uy, uz = arm.c3 * s4 * k3, arm.c3 * s4 * s3, arm.c2 + arm.c3 * k4
            rr, vv = ux * ux + uz * uz, ww - uy * uy
            if vv < -REACH * reach:
                continue
            v = front * sqrt(max(vv, 0.0))
            s2, k2 = 0.0, 1.0
            if rr > ON_AXIS * ON_AXIS:
                s2, k2 = (uz * v - ux * wz) / rr, (uz * wz + ux * v) / rr
                size = sqrt(s2 * s2 + k2 * k2)
                s2, k2 = s2 / size, k2 / size
            s1, k1 = wy * v - wx * uy, wx * v + wy * uy
            size = sqrt(s1 * s1 + k1 * k1)
            s1, k1 = (s1 / size, k1 / size) if size > ON_AXIS * ON_AXIS else (0.0, 1.0)
            angle_2, angle_4 = atan2(s2, k2), atan2(s4, k4)
            F[:] = 0.0
            F[0, 0], F[0, 1], F[1, 0], F[1, 1], F[2, 2] = k1, -s1, s1, k1, 1.0
            _turn_y(F, angle_2)
            _turn_z(F, angle_3)
            _turn_y(F, angle_4)
            i = 4 * shoulder + 2 * elbow
            _wrist(arm, T, F, out_q[i : i + 2])
            for w in range(i, i + 2):
                out_q[w, 0] = wrap(arm.sign[0] * (atan2(s1, k1) + arm.offset[0]))
                out_q[w, 1] = wrap(arm.sign[1] * (angle_2 + arm.offset[1]))
                out_q[w, 2] = q3
                out_q[w, 3] = wrap(arm.sign[3] * (angle_4 + arm.offset[3]))
                out_reach[w] = True


@jit
def forward_all(arm: SrsArm, q: Array, out_T: Array) -> None:
    """Poses of the end (B, 4, 4) of joint vectors (B, 7)."""
    for i in range(len(q)):
        forward(arm, q[i], out_T[i])


@jit
def inverse_all(arm: SrsArm, T: Array, given: Array, out_q: Array, out_reach: Bools) -> None:
    """All postures (B, 8, 7) of poses (B, 4, 4), with joint 3 at `given` (B,) rad."""
    for i in range(len(T)):
        inverse(arm, T[i], given[i], out_q[i], out_reach[i])
