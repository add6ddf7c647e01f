"""Proven bounds of the joints of an OPW arm while gamma runs over a cell.

The closed form of `kinematics` is evaluated with jets as numbers (`intervals`): the result encloses
every solution of a posture, at every gamma of the cell, rounding included. Angles are computed from
their cosine or tangent and differentiated without the branch; an angle that a singularity leaves
free has a full turn. Cells are gamma = m + t, |t| <= h.

A rotation matrix that is orthogonal only up to rounding stands for the nearest rotation: the radii
of `Frames` enclose that rotation, the matrix itself and its inverse.
"""

from __future__ import annotations

from math import atan2, ceil, cos, inf, pi, sin, sqrt
from typing import Any, NamedTuple

from kerfpath.arrays import Array, Ints
from kerfpath.kernels.intervals import (
    DOWN,
    EPS,
    LIBM,
    TINY,
    UP,
    Jet,
    add,
    angle,
    arc,
    arc_between,
    boxed,
    cosine_of,
    least_norm,
    mul,
    over,
    plus,
    root,
    scale,
    settled,
    shift,
    sine_of,
    spread,
    times,
    turning,
)
from kerfpath.kernels.jit import jit, jit_inline, jit_part, smaller, variable
from kerfpath.kernels.kinematics import REACH, OpwArm

__all__ = [
    "BOX",
    "NONE",
    "SMOOTH",
    "Curves",
    "Frames",
    "enclose_all",
    "lean",
    "side",
    "turned",
    "turned_point",
    "wrist_sine",
    "write_posture",
]

NONE, SMOOTH, BOX = 0, 1, 2
"""Status of a posture on a cell: it has no solution there; it has curves; it has boxes only."""
ANGLE_ERROR = 1e-14
"""Error that the offset (of 1 rad) and the removal of full turns add, rad: the model's angles are
below 16 rad, and each of three operations errs by half a unit in the last place."""

X, Y, Z, CENTER = variable(0), variable(1), variable(2), variable(3)
"""Indices of the rows and columns of a frame."""


class Frames(NamedTuple):
    """Task frames in the model's base, and its end in the tip, each with the radius of its error.

    The pose of the model's end at gamma is base[k] . R_z(gamma) . end. Columns 0 to 2 of end (3, 4)
    are the end's axes, its column 3 is the wrist centre: a length behind its origin on its z-axis.
    """

    base: Array
    base_radius: Array
    end: Array
    end_radius: Array


class Curves(NamedTuple):
    """Joints on cells, (C, P, n) rad and, status, (C, P); see `kerfpath.robots.Enclosure`."""

    status: Any
    center: Array
    slope: Array
    low: Array
    high: Array
    radius: Array


@jit_inline
def turned(frames: Frames, node: int, i: int, j: int, k: float, s: float, h: float) -> Jet:
    """Return row i of base . R_z(gamma + t) . end's column j; k, s are cosine and sine of gamma.

    The translation of the base is left out.
    """
    B, rB, E, rE = frames.base, frames.base_radius, frames.end, frames.end_radius
    m1, r1 = times(B[node, i, 0], rB[node, i, 0], E[0, j], rE[0, j])
    m2, r2 = times(B[node, i, 1], rB[node, i, 1], E[1, j], rE[1, j])
    along, r_along = plus(m1, r1, m2, r2)
    m1, r1 = times(B[node, i, 1], rB[node, i, 1], E[0, j], rE[0, j])
    m2, r2 = times(B[node, i, 0], rB[node, i, 0], E[1, j], rE[1, j])
    beside, r_beside = plus(m1, r1, -m2, r2)
    m1, r1 = times(along, r_along, k, LIBM)
    m2, r2 = times(beside, r_beside, s, LIBM)
    p, rp = plus(m1, r1, m2, r2)
    m1, r1 = times(beside, r_beside, k, LIBM)
    m2, r2 = times(along, r_along, s, LIBM)
    q, rq = plus(m1, r1, -m2, r2)
    a, ra = times(B[node, i, 2], rB[node, i, 2], E[2, j], rE[2, j])
    return turning(a, ra, p, rp, q, rq, h)


@jit_inline
def turned_point(frames: Frames, node: int, i: int, k: float, s: float, h: float) -> Jet:
    """Return coordinate i of the wrist centre in the base."""
    f = turned(frames, node, i, CENTER, k, s, h)
    return shift(f, frames.base[node, i, 3], frames.base_radius[node, i, 3])


@jit_part
def side(rr: Jet, d: Jet, b: float, front: float, h: float) -> Jet:
    """Angle atan2(-b, front d) by which the arm stands beside the line to the wrist centre.

    d = sqrt(rr - b^2); the rate is front b d' / rr, with 2 d d' = rr'.
    """
    low = max((d.v - d.rv) * DOWN, 0.0)
    near, far = atan2(-b, front * low), atan2(-b, front * (d.v + d.rv) * UP)
    least, most = min(near, far), max(near, far)
    if low <= 0.0 or not d.rs < inf:
        return boxed(least - 2.0 * LIBM, most + 2.0 * LIBM)
    v = atan2(-b, front * d.v)
    ev = spread(d.ev, sqrt(d.v * d.v + b * b) * DOWN) * UP + 2.0 * LIBM
    rv = max(most - v, v - least) * UP + 4.0 * LIBM
    least = (rr.v - rr.rv) * DOWN
    least = max(least, b * b * DOWN)
    # rr q' = front b d';  rr q'' = front b d'' - rr' q'.
    f = front * b
    m, e = times(f, 0.0, d.d, d.ed)
    _, r = times(f, 0.0, d.d, d.rd)
    g, eg = over(m, e, rr.v, rr.ev, least)
    _, rg = over(m, r, rr.v, rr.rv, least)
    c, rc = times(f, 0.0, d.s, d.rs)
    t, rt = times(rr.d, rr.rd, g, rg)
    c, rc = plus(c, rc, -t, rt)
    s, rs = over(c, rc, rr.v, rr.rv, least)
    return settled(Jet(v, ev, g, eg, rv, rg, s, rs), h)


@jit_part
def lean(c2: float, k: float, bend: Jet, reach: Jet, h: float) -> Jet:
    """Angle atan2(k sin bend, c2 + k cos bend) of a link k, bent by 0 to pi, behind a link c2.

    Its rate is w bend', w = 1/2 + (k^2 - c2^2) / (2 reach); reach is the square of the third side.
    """
    low = (reach.v - reach.rv) * DOWN
    x, y = c2 + k * cos(bend.v), k * sin(bend.v)
    rounding = 16.0 * EPS * (abs(c2) + abs(k))
    size = (sqrt(x * x + y * y) - rounding) * DOWN
    if low <= TINY or size <= TINY:
        return boxed(-4.0 * EPS, pi * UP) if k > 0.0 else boxed(-pi * UP, 4.0 * EPS)
    v = atan2(y, x)
    off = spread(rounding, size) * UP + 2.0 * LIBM
    ev = (off + spread(abs(k) * bend.ev * UP, size)) * UP
    f, ef = 0.5 * (k * k - c2 * c2), 4.0 * EPS * (k * k + c2 * c2)
    w, ew = over(f, ef, reach.v, reach.ev, low)
    _, rw = over(f, ef, reach.v, reach.rv, low)
    t, rt = times(w, rw, reach.d, reach.rd)
    t, rt = over(-t, rt, reach.v, reach.rv, low)
    w, ew = plus(0.5, 0.0, w, ew)
    rw = (rw + EPS * abs(w)) * UP
    d, ed = times(w, ew, bend.d, bend.ed)
    _, rd = times(w, rw, bend.d, bend.rd)
    m1, r1 = times(w, rw, bend.s, bend.rs)
    m2, r2 = times(t, rt, bend.d, bend.rd)
    s, rs = plus(m1, r1, m2, r2)
    rv = smaller(((abs(w) + rw) * bend.rv + off) * UP, pi * UP)
    return settled(Jet(v, ev, d, ed, rv, rd, s, rs), h)


@jit_part
def _wrap(angle: float) -> float:
    """Bring an angle into (-pi, pi], up to rounding."""
    return angle - 2.0 * pi * ceil((angle - pi) / (2.0 * pi))


@jit_inline
def _known(f: Jet, h: float) -> bool:
    """Whether curve and curvature of an angle are known better than by its box."""
    reach = h * (abs(f.d) + f.ed + 0.5 * h * (abs(f.s) + f.rs))
    return reach <= 2.0 * f.rv + ANGLE_ERROR


@jit_inline
def _write(
    out: Curves, cell: int, posture: int, joint: int, f: Jet, sign: float, offset: float, h: float
) -> None:
    """Write the model's angle f as the robot's joint, sign * (f + offset), by the status set."""
    at = (cell, posture, joint)
    error = ANGLE_ERROR * (1.0 + abs(offset))
    out.center[at] = _wrap(sign * (f.v + offset))
    if out.status[cell, posture] == SMOOTH:
        out.slope[at] = sign * f.d
        middle = sign * f.s
        wide = (f.rs + EPS * abs(f.s)) * UP
        out.low[at] = middle - wide
        out.high[at] = middle + wide
        out.radius[at] = (f.ev + h * f.ed) * UP + error
    else:
        out.slope[at] = 0.0
        out.low[at] = 0.0
        out.high[at] = 0.0
        out.radius[at] = smaller(f.rv * UP + error, pi * UP)


@jit_part
def write_posture(
    out: Curves,
    cell: int,
    posture: int,
    angles: tuple[Jet, Jet, Jet, Jet, Jet, Jet],
    sign: Array,
    offset: Array,
    h: float,
) -> None:
    """Write the model's six angles of a posture: as curves if all of them are known, else boxes."""
    smooth = True
    for joint in range(6):
        smooth = smooth and _known(angles[joint], h)
    out.status[cell, posture] = SMOOTH if smooth else BOX
    for joint in range(6):
        _write(out, cell, posture, joint, angles[joint], sign[joint], offset[joint], h)


@jit_part
def wrist_sine(c: Jet, x: Jet, y: Jet) -> tuple[float, float, float, float]:
    """Sine of the angle in [0, pi] with cosine c, where x^2 + y^2 is the square of the sine.

    Returns the sine, its error at the middle, its spread over the cell, and its least value there.
    """
    s = sqrt(x.v * x.v + y.v * y.v)
    es = (sqrt(x.ev * x.ev + y.ev * y.ev) + 4.0 * EPS * s) * UP + TINY
    rs = (sqrt(x.rv * x.rv + y.rv * y.rv) + 4.0 * EPS * s) * UP + TINY
    low = max(sqrt(max(least_norm(x, y), 0.0)) * DOWN, (s - rs) * DOWN)
    most = (abs(c.v) + c.rv) * UP
    if most < 1.0:
        least = sqrt((1.0 - most) * (1.0 + most)) * DOWN
        low = max(low, least)
        rs = smaller(rs, max(1.0 - s, s - least) * UP + 4.0 * EPS) if s < 1.0 else rs
    return s, es, rs, low


@jit_part
def _postures(
    arm: OpwArm,
    q1: Jet,
    q2: Jet,
    q3: Jet,
    columns: tuple[Jet, Jet, Jet, Jet],
    thirds: tuple[Jet, Jet, Jet],
    h: float,
    cell: int,
    first: int,
    out: Curves,
) -> None:
    """Write both wrist postures for a forearm given by q1 to q3.

    In the frame turned by q1, `columns` are the x of the flange's axes and the y of its z-axis;
    `thirds` are the z of the axes. R = R_z(q1) R_y(q2 + q3) R_z(q4) R_y(q5) R_z(q6).
    """
    q23 = add(q2, q3)
    k, s = cosine_of(q23, h), sine_of(q23, h)
    ux, uy, uz, across = columns
    x = add(mul(k, uz, h), scale(mul(s, thirds[2], h), -1.0, 0.0))
    z = add(mul(s, uz, h), mul(k, thirds[2], h))
    g = add(mul(s, ux, h), mul(k, thirds[0], h))
    e = add(mul(s, uy, h), mul(k, thirds[1], h))
    sine, es, rs, low = wrist_sine(z, x, across)
    square = low * low * DOWN
    q4 = angle(across, x, square, h)
    q5 = arc(z, sine, es, rs, low, h)
    q6 = angle(e, scale(g, -1.0, 0.0), square, h)
    for wrist in range(2):
        flip = 1.0 if wrist == 0 else -1.0
        half_turn = 0.0 if wrist == 0 else pi
        angles = (
            q1,
            q2,
            q3,
            shift(q4, half_turn, LIBM),
            scale(q5, flip, 0.0),
            shift(q6, half_turn, LIBM),
        )
        write_posture(out, cell, first + wrist, angles, arm.sign, arm.offset, h)


@jit_part
def _enclose(
    arm: OpwArm, frames: Frames, node: int, gamma: float, h: float, cell: int, out: Curves
) -> None:
    """Write all postures of one cell."""
    k, s = cos(gamma), sin(gamma)
    x0, x1 = turned(frames, node, X, X, k, s, h), turned(frames, node, Y, X, k, s, h)
    y0, y1 = turned(frames, node, X, Y, k, s, h), turned(frames, node, Y, Y, k, s, h)
    z0, z1 = turned(frames, node, X, Z, k, s, h), turned(frames, node, Y, Z, k, s, h)
    x2, y2 = turned(frames, node, Z, X, k, s, h), turned(frames, node, Z, Y, k, s, h)
    z2 = turned(frames, node, Z, Z, k, s, h)
    px, py = turned_point(frames, node, X, k, s, h), turned_point(frames, node, Y, k, s, h)
    z = shift(turned_point(frames, node, Z, k, s, h), -arm.c1, 0.0)
    rr = add(mul(px, px, h), mul(py, py, h))
    dd = shift(rr, -arm.b * arm.b, EPS * arm.b * arm.b)
    for i in range(8):
        out.status[cell, i] = NONE
    if dd.v + dd.rv < -2.0 * REACH:
        return
    least = least_norm(px, py)
    ray = angle(py, px, least, h)
    d = root(dd, max(0.0, (least - arm.b * arm.b) * DOWN - EPS * arm.b * arm.b), h)
    kk = arm.a2 * arm.a2 + arm.c3 * arm.c3
    link = sqrt(kk)
    psi = atan2(arm.a2, arm.c3)
    links = arm.c2 * arm.c2 + kk
    factor, error = 1.0 / (2.0 * arm.c2 * link), 8.0 * EPS / abs(2.0 * arm.c2 * link)
    for shoulder in range(2):
        front = 1.0 if shoulder == 0 else -1.0
        x = shift(scale(d, front, 0.0), -arm.a1, 0.0)
        reach = add(mul(x, x, h), mul(z, z, h))
        cosine = scale(shift(reach, -links, 4.0 * EPS * links), factor, error)
        if abs(cosine.v) - cosine.rv > 1.0 + 2.0 * REACH:
            continue
        bend = arc_between(cosine, h)
        leant = lean(arm.c2, link, bend, reach, h)
        phi = angle(x, z, 0.0, h)
        q1 = add(ray, side(rr, d, arm.b, front, h)) if arm.b != 0.0 else ray
        if arm.b == 0.0 and shoulder == 1:
            q1 = shift(ray, pi, LIBM)
        k1, s1 = cosine_of(q1, h), sine_of(q1, h)
        ux = add(mul(k1, x0, h), mul(s1, x1, h))
        uy = add(mul(k1, y0, h), mul(s1, y1, h))
        uz = add(mul(k1, z0, h), mul(s1, z1, h))
        across = add(mul(k1, z1, h), scale(mul(s1, z0, h), -1.0, 0.0))
        for elbow in range(2):
            up = front if elbow == 0 else -front
            q2 = add(phi, scale(leant, -up, 0.0))
            q3 = shift(scale(bend, up, 0.0), -psi, 2.0 * LIBM)
            i = 4 * shoulder + 2 * elbow
            _postures(arm, q1, q2, q3, (ux, uy, uz, across), (x2, y2, z2), h, cell, i, out)


@jit
def enclose_all(
    arm: OpwArm, frames: Frames, node: Ints, gamma: Array, half: Array, out: Curves
) -> None:
    """Fill the curves of every posture on the cells gamma (C,) +- half (C,) of frames `node`."""
    for cell in range(len(node)):
        _enclose(arm, frames, node[cell], gamma[cell], half[cell], cell, out)
