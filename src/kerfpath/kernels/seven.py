"""Kinematics of seven-axis arms with an offset shoulder or wrist, one end joint given, batched.

With joint 1 given, an arm whose axes 2 and 3 meet in S, and whose axes 5, 6 and 7 meet in W, is
solved by the subproblems of Paden and Kahan (R. M. Murray, Z. Li and S. S. Sastry, A Mathematical
Introduction to Robotic Manipulation, 1994, section 3.3), whatever the directions of the axes and
the offsets between them:

    joint 4          turns W until its distance from S is that of the pose (subproblem 3);
    joints 2 and 3   take W there (subproblem 2);
    joints 5 and 6   take the direction of axis 7 where it belongs (subproblem 2);
    joint 7          turns the rest (subproblem 1).

An arm whose axes 1, 2 and 3 meet, and 5 and 6 meet, is such an arm from the other end: read
backwards, with joint 7 given.

Posture mu = 4 * shoulder + 2 * elbow + wrist: the number of the solution for the joints at the
shoulder, for joint 4, and at the wrist. It changes only where two solutions are one, at a
singularity.
"""

from __future__ import annotations

from math import acos, atan2, cos, sin, sqrt
from typing import NamedTuple

import numpy as np

from kerfpath.arrays import Array, Bools
from kerfpath.kernels.general import turn, turn_pose
from kerfpath.kernels.jit import jit, jit_part
from kerfpath.kernels.kinematics import REACH, wrap

__all__ = ["SevenArm", "forward_all", "inverse_all"]


class SevenArm(NamedTuple):
    """The joint axes at angle zero, in the base, in the order in which they are solved.

    From the other end, `along` has the opposite directions, and base and tip change places.
    """

    place: Array
    """(7, 3) m: a point of each axis; of the second and third S, of the last three W."""
    along: Array
    """(7, 3): unit directions of the axes."""
    tip: Array
    """(4, 4) m: tip pose at angle zero, in the base."""
    backwards: bool
    """Whether the first axis in order is joint 7."""


@jit_part
def _dot(u: Array, v: Array) -> float:
    return float(u[0] * v[0] + u[1] * v[1] + u[2] * v[2])


@jit_part
def _turned(v: Array, along: Array, angle: float) -> Array:
    """Return the vector v (3,) turned about a direction by an angle."""
    out = v.copy()
    turn(out, along, sin(angle), cos(angle))
    return out


@jit_part
def _angle(along: Array, u: Array, v: Array) -> float:
    """Return the angle about a direction that takes u (3,) to v (3,) (subproblem 1)."""
    a, b = _dot(along, u), _dot(along, v)
    sine = 0.0
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        sine += along[i] * (u[j] * v[k] - u[k] * v[j])
    return atan2(sine, _dot(u, v) - a * b)


@jit_part
def _two_angles(
    one: Array, two: Array, u: Array, v: Array, side: float
) -> tuple[bool, float, float]:
    """Return whether turns about `two`, and then about `one`, take u (3,) to v (3,); and by what.

    The side, 1 or -1, chooses between the solutions (subproblem 2).
    """
    both = _dot(one, two)
    across = np.empty(3)
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        across[i] = one[j] * two[k] - one[k] * two[j]
    sine = _dot(across, across)
    first, second = _dot(one, v), _dot(two, u)
    a, b = (first - both * second) / sine, (second - both * first) / sine
    size = _dot(u, u)
    rest = (size - a * a - b * b - 2.0 * a * b * both) / sine
    if rest < -REACH * size:
        return False, 0.0, 0.0
    c = side * sqrt(max(rest, 0.0))
    between = a * one + b * two + c * across
    return True, _angle(one, between, v), _angle(two, u, between)


@jit_part
def forward(arm: SevenArm, q: Array, out_T: Array) -> None:
    """Tip pose (4, 4) of a joint vector (7,)."""
    out_T[:] = arm.tip
    for k in range(7):
        i, angle = (k, -q[6 - k]) if arm.backwards else (6 - k, q[6 - k])
        turn_pose(out_T, arm.place[i], arm.along[i], sin(angle), cos(angle))


@jit_part
def _to_from(T: Array, U: Array) -> Array:
    """Return T (4, 4) times the inverse of U (4, 4)."""
    out = np.zeros((4, 4))
    out[3, 3] = 1.0
    for i in range(3):
        out[i, 3] = T[i, 3]
        for j in range(3):
            for k in range(3):
                out[i, j] += T[i, k] * U[j, k]
            out[i, 3] -= out[i, j] * U[j, 3]
    return out


@jit_part
def inverse(arm: SevenArm, T: Array, given: float, out_q: Array, out_reach: Bools) -> None:
    """All postures of a tip pose with the first joint in order at `given`, others in (-pi, pi].

    Fills out_q (8, 7) and out_reach (8,); rows out of reach are left at zero.
    """
    out_q[:] = 0.0
    out_reach[:] = False
    place, along = arm.place, arm.along
    g = _to_from(arm.tip, T) if arm.backwards else _to_from(T, arm.tip)
    turn_pose(g, place[0], along[0], -sin(given), cos(given))
    S, W = place[1], place[6]
    # The place of W, from S; and its distance from S, by joint 4 alone.
    wanted = g[:3, 3] - S
    for k in range(3):
        wanted += g[:3, k] * W[k]
    up = along[3]
    u, v = W - place[3], S - place[3]
    high, low = _dot(up, u), _dot(up, v)
    u = u - high * up
    v = v - low * up
    uu, vv = _dot(u, u), _dot(v, v)
    flat = _dot(wanted, wanted) - (high - low) * (high - low)
    cosine = (uu + vv - flat) / (2.0 * sqrt(uu * vv))
    if abs(cosine) > 1.0 + REACH:
        return
    bend = acos(min(1.0, max(-1.0, cosine)))
    middle = _angle(up, u, v)
    aside = along[5] - _dot(along[5], along[6]) * along[6]
    for elbow in range(2):
        q4 = middle + bend if elbow == 0 else middle - bend
        there = place[3] + _turned(W - place[3], up, q4) - S
        for shoulder in range(2):
            side = 1.0 if shoulder == 0 else -1.0
            found, q2, q3 = _two_angles(along[1], along[2], there, wanted, side)
            if not found:
                continue
            # What is left to the wrist: its directions, turned back by joints 2 to 4.
            axis, other = np.zeros(3), np.zeros(3)
            for k in range(3):
                axis += g[:3, k] * along[6, k]
                other += g[:3, k] * aside[k]
            for i, angle in ((1, q2), (2, q3), (3, q4)):
                axis = _turned(axis, along[i], -angle)
                other = _turned(other, along[i], -angle)
            for wrist in range(2):
                side = 1.0 if wrist == 0 else -1.0
                found, q5, q6 = _two_angles(along[4], along[5], along[6], axis, side)
                if not found:
                    continue
                rest = _turned(_turned(other, along[4], -q5), along[5], -q6)
                q7 = _angle(along[6], aside, rest)
                mu = 4 * shoulder + 2 * elbow + wrist
                if arm.backwards:
                    mu = 4 * wrist + 2 * elbow + shoulder
                out_reach[mu] = True
                for i, angle in enumerate((given, q2, q3, q4, q5, q6, q7)):
                    k = 6 - i if arm.backwards else i
                    out_q[mu, k] = angle if i == 0 else wrap(angle)


@jit
def forward_all(arm: SevenArm, q: Array, out_T: Array) -> None:
    """Poses of the tip (B, 4, 4) of joint vectors (B, 7)."""
    for i in range(len(q)):
        forward(arm, q[i], out_T[i])


@jit
def inverse_all(arm: SevenArm, T: Array, given: Array, out_q: Array, out_reach: Bools) -> None:
    """All postures (B, 8, 7) of poses (B, 4, 4), with the joint at one end at `given` (B,) rad."""
    for i in range(len(T)):
        inverse(arm, T[i], given[i], out_q[i], out_reach[i])
