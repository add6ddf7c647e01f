"""Inverse kinematics of five-axis arms: tool tip and tool axis are given, no rotation is free.

The arm is that of `kinematics` without axis 6: three axes to the forearm, axis 4 along it, axis 5
square to axis 4 and meeting it in the wrist centre, the head rigid behind. It is solved as an OPW
arm whose sixth angle is zero: turn the tool about its own axis by psi, and require of the forearm
that belongs to this wrist centre

    g(psi) = y_end . z_forearm = sin q5 sin q6 = 0 .

Where the tool axis passes through the wrist centre, that centre stays where it is and g is a sine
with two zeros, the two wrist postures. With an offset the centre runs on a circle, parts of which
may be out of reach; the zeros are bracketed on a grid of psi and the ends of the arcs in reach.

Posture mu = 4 * shoulder + 2 * elbow + wrist as in `kinematics`, but the wrist is plus where axis
5 is beyond the angle at which the tool axis is nearest to the forearm's, and minus below it. With
an offset, near the stretched wrist, g has up to four zeros: further zeros of the same kind become
the third and fourth, mu = 8 + 4 * shoulder + 2 * elbow and one more; a fourth of the same kind
takes the row of the other kind. Zeros within a grid step of the stretched or folded elbow, where
the arc in reach ends, may be missed.
"""

from __future__ import annotations

from math import atan2, cos, pi, sin

import numpy as np

from kerfpath.arrays import Array, Bools
from kerfpath.kernels.frames import location
from kerfpath.kernels.jit import jit, jit_part
from kerfpath.kernels.kinematics import EVERY, ON_AXIS, POSTURES, OpwArm, forward, inverse, wrap

__all__ = ["forward_all", "inverse_all", "inverse_nodes"]

ROWS = 2 * POSTURES
SAMPLES = 96
"""Grid of psi. Two zeros inside one step are found from the minimum that g has there."""
HALVINGS = 40
"""Bisections of a grid step towards the end of reach; the step left is 6e-14 rad."""
STEPS = 60
"""Most steps of the bracketing iteration; a dozen are usual."""
ZERO = 1e-15


@jit_part
def _turned(
    arm: OpwArm, H: Array, T_tip_end: Array, psi: float, L: Array, T: Array, q: Array, reach: Bools
) -> None:
    """Solve the OPW arm for the tool turned by psi: q (8, 6), reach (8,); L and T are scratch."""
    location(H, cos(psi), sin(psi), L)
    for r in range(3):
        for c in range(4):
            T[r, c] = (
                L[r, 0] * T_tip_end[0, c] + L[r, 1] * T_tip_end[1, c] + L[r, 2] * T_tip_end[2, c]
            )
        T[r, 3] += L[r, 3]
    inverse(arm, T, EVERY, q, reach)


@jit_part
def _g(arm: OpwArm, q: Array) -> float:
    """Return sin q5 sin q6 of one solution (6,) of the OPW arm."""
    return sin(arm.sign[4] * q[4] - arm.offset[4]) * sin(q[5])


@jit_part
def _zero(
    arm: OpwArm,
    H: Array,
    T_tip_end: Array,
    branch: int,
    a: float,
    ga: float,
    b: float,
    gb: float,
    room: tuple[Array, Array, Array, Bools],
) -> bool:
    """Find the zero of g between a and b (regula falsi, Illinois); leave its solutions in `room`.

    Returns False if the branch ends in between.
    """
    L, T, q, reach = room
    for _ in range(STEPS):
        psi = (a * gb - b * ga) / (gb - ga)
        _turned(arm, H, T_tip_end, psi, L, T, q, reach)
        if not reach[branch]:
            return False
        g = _g(arm, q[branch])
        if abs(g) < ZERO or abs(b - a) < ZERO:
            return True
        if g * gb < 0.0:
            a, ga = b, gb
        else:
            ga *= 0.5
        b, gb = psi, g
    return abs(gb) < ON_AXIS


@jit_part
def _end(
    arm: OpwArm,
    H: Array,
    T_tip_end: Array,
    branch: int,
    inside: float,
    outside: float,
    room: tuple[Array, Array, Array, Bools],
) -> tuple[float, float]:
    """Return the last psi in reach between one inside and one outside, and g there."""
    L, T, q, reach = room
    g = 0.0
    for _ in range(HALVINGS):
        psi = 0.5 * (inside + outside)
        _turned(arm, H, T_tip_end, psi, L, T, q, reach)
        if reach[branch]:
            inside, g = psi, _g(arm, q[branch])
        else:
            outside = psi
    return inside, g


@jit_part
def _dip(
    arm: OpwArm,
    H: Array,
    T_tip_end: Array,
    branch: int,
    a: float,
    b: float,
    sign: float,
    room: tuple[Array, Array, Array, Bools],
) -> tuple[float, float]:
    """Return psi between a and b where sign g is least, or has become negative, and g there."""
    L, T, q, reach = room
    psi, g = 0.5 * (a + b), sign
    for _ in range(HALVINGS):
        values = (1.0, 1.0)
        for right in range(2):
            psi = a + (0.382 + 0.236 * right) * (b - a)
            _turned(arm, H, T_tip_end, psi, L, T, q, reach)
            if not reach[branch]:
                return psi, sign
            g = _g(arm, q[branch])
            if sign * g < 0.0:
                return psi, g
            values = (sign * g, 1.0) if right == 0 else (values[0], sign * g)
        if values[0] < values[1]:
            b = a + 0.618 * (b - a)
        else:
            a = a + 0.382 * (b - a)
    return psi, g


@jit_part
def _keep(
    arm: OpwArm, q: Array, branch: int, nearest: float, out_q: Array, out_reach: Bools
) -> None:
    """Write the solution of a branch whose sixth angle is zero, in the row of its posture."""
    row = q[branch] if cos(q[branch, 5]) > 0.0 else q[branch + 1]
    q4 = row[3]
    q5 = arm.sign[4] * row[4] - arm.offset[4]
    if abs(sin(q5)) < ON_AXIS:
        # Axes 4 and 6 are in line: axis 4 takes over the turn of axis 6.
        q6 = q[branch, 5] if cos(q5) > 0.0 else -q[branch, 5]
        q4, q5 = wrap(q[branch, 3] + arm.sign[3] * q6), arm.sign[4] * q[branch, 4] - arm.offset[4]
        row = q[branch]
    wrist = 0 if sin(q5 - nearest) >= 0.0 else 1
    for mu in (branch + wrist, POSTURES + branch, POSTURES + branch + 1, branch + 1 - wrist):
        if not out_reach[mu]:
            out_q[mu, :5] = row[:5]
            out_q[mu, 3] = q4
            out_reach[mu] = True
            return


@jit_part
def _solve(arm: OpwArm, H: Array, T_tip_end: Array, out_q: Array, out_reach: Bools) -> None:
    """All postures (16, 5) of a tip frame H (4, 4); rows out of reach are left at zero."""
    L, T, q = np.zeros((4, 4)), np.zeros((4, 4)), np.zeros((POSTURES, 6))
    reach = np.zeros(POSTURES, np.bool_)
    room = (L, T, q, reach)
    before, was = np.zeros(POSTURES), np.zeros(POSTURES, np.bool_)
    earlier = np.zeros(POSTURES)
    # Where the tool axis, third row of the inverse, is nearest to the forearm's.
    nearest = atan2(-T_tip_end[2, 0], T_tip_end[2, 2])
    step = 2.0 * pi / SAMPLES
    out_q[:] = 0.0
    out_reach[:] = False
    for j in range(SAMPLES + 2):  # once around, and one step more for a minimum at the seam
        psi = step * j
        _turned(arm, H, T_tip_end, psi, L, T, q, reach)
        now, here = reach.copy(), q.copy()
        for branch in range(0, POSTURES, 2):
            g = _g(arm, here[branch]) if now[branch] else 0.0
            if now[branch] and abs(g) < ON_AXIS:
                g = 0.0
                if j < SAMPLES:
                    _keep(arm, here, branch, nearest, out_q, out_reach)
            if 0 < j <= SAMPLES and (now[branch] or was[branch]):
                a, ga, b, gb = psi - step, before[branch], psi, g
                if not was[branch]:
                    a, ga = _end(arm, H, T_tip_end, branch, b, a, room)
                elif not now[branch]:
                    b, gb = _end(arm, H, T_tip_end, branch, a, b, room)
                if ga * gb < 0.0 and _zero(arm, H, T_tip_end, branch, a, ga, b, gb, room):
                    _keep(arm, q, branch, nearest, out_q, out_reach)
            g0, g1 = earlier[branch], before[branch]
            if g0 * g1 > 0.0 and g1 * g > 0.0 and abs(g1) < min(abs(g0), abs(g)):
                c, gc = _dip(arm, H, T_tip_end, branch, psi - 2.0 * step, psi, g1, room)
                if gc * g1 < 0.0:
                    if _zero(arm, H, T_tip_end, branch, psi - 2.0 * step, g0, c, gc, room):
                        _keep(arm, q, branch, nearest, out_q, out_reach)
                    if _zero(arm, H, T_tip_end, branch, c, gc, psi, g, room):
                        _keep(arm, q, branch, nearest, out_q, out_reach)
            earlier[branch], before[branch] = before[branch], g
        was[:] = now


@jit
def forward_all(arm: OpwArm, q: Array, out_T: Array) -> None:
    """End poses (B, 4, 4) of joint vectors (B, 5)."""
    six = np.zeros(6)
    for i in range(len(q)):
        six[:5] = q[i]
        forward(arm, six, out_T[i])


@jit
def inverse_all(arm: OpwArm, T: Array, out_q: Array, out_reach: Bools) -> None:
    """All postures (B, 16, 5) that bring the end's origin and z-axis to poses (B, 4, 4)."""
    for i in range(len(T)):
        _solve(arm, T[i], np.eye(4), out_q[i], out_reach[i])


@jit
def inverse_nodes(
    arm: OpwArm, H: Array, gamma: Array, T_tip_end: Array, out_q: Array, out_reach: Bools
) -> None:
    """All postures (K, 1, 16, 5) that bring tip and tool axis to task frames H (K, 4, 4).

    `gamma` (1,) keeps the signature of the other families: no rotation is free.
    """
    for k in range(len(H)):
        _solve(arm, H[k], T_tip_end, out_q[k, 0], out_reach[k, 0])
