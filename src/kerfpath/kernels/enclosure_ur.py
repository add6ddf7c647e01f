"""Proven bounds of the joints of an arm of the Universal Robots type on a cell of gamma.

The closed form of `ur` is evaluated with jets as numbers, as in `enclosure` for OPW arms. Near the
wrist singularity the sum of joints 2 to 4 is free, and the bounds hold for every value of it.
"""

from __future__ import annotations

from math import copysign, cos, pi, sin

from kerfpath.arrays import Array, Ints
from kerfpath.kernels.enclosure import (
    NONE,
    Curves,
    Frames,
    X,
    Y,
    Z,
    lean,
    side,
    turned,
    turned_point,
    wrist_sine,
    write_posture,
)
from kerfpath.kernels.intervals import (
    DOWN,
    EPS,
    LIBM,
    Jet,
    add,
    angle,
    arc,
    arc_between,
    cosine_of,
    least_norm,
    mul,
    root,
    scale,
    shift,
    sine_of,
)
from kerfpath.kernels.jit import jit, jit_part
from kerfpath.kernels.kinematics import REACH
from kerfpath.kernels.ur import UrArm

__all__ = ["enclose_all"]


@jit_part
def _elbows(
    arm: UrArm,
    x: Jet,
    y: Jet,
    front: float,
    ends: tuple[Jet, Jet, Jet, Jet],
    h: float,
    cell: int,
    first: int,
    out: Curves,
) -> None:
    """Write both elbow postures, rows `first` and `first` + 2, for axis 4 at (x, y).

    `ends` are joint 1, the sum of joints 2 to 4, joint 5 and joint 6.
    """
    links = arm.a2 * arm.a2 + arm.a3 * arm.a3
    twice = 2.0 * arm.a2 * arm.a3
    reach = add(mul(x, x, h), mul(y, y, h))
    cosine = scale(shift(reach, -links, 4.0 * EPS * links), 1.0 / twice, 8.0 * EPS / abs(twice))
    if abs(cosine.v) - cosine.rv > 1.0 + 2.0 * REACH:
        return
    bend = arc_between(cosine, h)
    leant = lean(arm.a2, arm.a3, bend, reach, h)
    phi = angle(y, x, 0.0, h)
    q1, theta, q5, q6 = ends
    for elbow in range(2):
        up = front if elbow == 0 else -front
        turn = -copysign(up, up * arm.a3)
        q3 = scale(bend, turn, 0.0)
        q2 = add(phi, scale(leant, -turn, 0.0))
        q4 = add(theta, scale(add(q2, q3), -1.0, 0.0))
        angles = (q1, q2, q3, q4, q5, q6)
        write_posture(out, cell, first + 2 * elbow, angles, arm.sign, arm.offset, h)


@jit_part
def _enclose(
    arm: UrArm, frames: Frames, node: int, gamma: float, h: float, cell: int, out: Curves
) -> None:
    """Write all postures of one cell."""
    k, s = cos(gamma), sin(gamma)
    x0, x1 = turned(frames, node, X, X, k, s, h), turned(frames, node, Y, X, k, s, h)
    y0, y1 = turned(frames, node, X, Y, k, s, h), turned(frames, node, Y, Y, k, s, h)
    z0, z1 = turned(frames, node, X, Z, k, s, h), turned(frames, node, Y, Z, k, s, h)
    z2 = turned(frames, node, Z, Z, k, s, h)
    px, py = turned_point(frames, node, X, k, s, h), turned_point(frames, node, Y, k, s, h)
    height = shift(turned_point(frames, node, Z, k, s, h), -arm.d1, 0.0)
    rr = add(mul(px, px, h), mul(py, py, h))
    square = arm.d4 * arm.d4
    dd = shift(rr, -square, EPS * square)
    for i in range(8):
        out.status[cell, i] = NONE
    if dd.v + dd.rv < -2.0 * REACH:
        return
    least = least_norm(px, py)
    ray = angle(py, px, least, h)
    d = root(dd, max(0.0, (least - square) * DOWN - EPS * square), h)
    for shoulder in range(2):
        front = 1.0 if shoulder == 0 else -1.0
        ahead = copysign(front, front * arm.a2)
        radial = scale(d, ahead, 0.0)
        if arm.d4 != 0.0:
            q1 = add(ray, side(rr, d, -arm.d4, ahead, h))
        else:
            q1 = shift(ray, 0.0 if ahead > 0.0 else pi, LIBM)
        k1, s1 = cosine_of(q1, h), sine_of(q1, h)
        # The flange's axes along axis 2 (across), and its z-axis ahead in the plane of the arm.
        across_x = add(mul(s1, x0, h), scale(mul(k1, x1, h), -1.0, 0.0))
        across_y = add(mul(s1, y0, h), scale(mul(k1, y1, h), -1.0, 0.0))
        across_z = add(mul(s1, z0, h), scale(mul(k1, z1, h), -1.0, 0.0))
        z = add(mul(k1, z0, h), mul(s1, z1, h))
        sine, es, rs, low = wrist_sine(across_z, z, z2)
        q5 = arc(across_z, sine, es, rs, low, h)
        theta = angle(scale(z2, -1.0, 0.0), scale(z, -1.0, 0.0), low * low * DOWN, h)
        q6 = angle(scale(across_y, -1.0, 0.0), across_x, low * low * DOWN, h)
        kt, st = cosine_of(theta, h), sine_of(theta, h)
        for wrist in range(2):
            plus = 1.0 if wrist == 0 else -1.0
            half_turn = 0.0 if wrist == 0 else pi
            x = add(radial, scale(st, -plus * arm.d5, 0.0))
            y = add(height, scale(kt, plus * arm.d5, 0.0))
            ends = (
                q1,
                shift(theta, half_turn, LIBM),
                scale(q5, plus, 0.0),
                shift(q6, half_turn, LIBM),
            )
            _elbows(arm, x, y, front, ends, h, cell, 4 * shoulder + wrist, out)


@jit
def enclose_all(
    arm: UrArm, frames: Frames, node: Ints, gamma: Array, half: Array, out: Curves
) -> None:
    """Fill the curves of every posture on the cells gamma (C,) +- half (C,) of frames `node`."""
    for cell in range(len(node)):
        _enclose(arm, frames, node[cell], gamma[cell], half[cell], cell, out)
