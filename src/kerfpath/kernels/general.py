"""Kinematics of any six-axis arm from the lines that its joints turn about.

Forward kinematics is the product of the rotations about those lines at angle zero. The inverse has
no closed form: a solver elsewhere supplies candidates; here Newton's method brings each onto its
pose, drops those that do not get there, and gives the others a posture number.

Posture mu = 4 * shoulder + 2 * elbow + wrist, + 8. Let W be the point of axis 5 nearest to axis 4.
Shoulder is the sign of the volume of axes 1, 2 and the vector from axis 1 to W; shoulder times
elbow is that of the speeds that joints 1 to 3 give W; wrist is that of the directions of axes 4 to
6. For an almost spherical wrist these are the usual shoulder, elbow and wrist. With a spherical
wrist the determinant of all six joints has the sign of the product of the last two; a solution
where it has the other sign is one of 8 to 15. Two with the same number take whichever row is free.
"""

from __future__ import annotations

from math import cos, sin
from typing import NamedTuple

import numpy as np

from kerfpath.arrays import Array, Bools, Ints
from kerfpath.kernels.jit import jit, jit_part
from kerfpath.kernels.kinematics import wrap

__all__ = ["EXACT", "POSTURES", "GeneralArm", "follow_all", "forward_all", "sort_in"]

POSTURES = 16
"""Most solutions of a pose (Primrose 1986)."""
EXACT = 1e-9
"""Largest distance of a solution from its pose: m, and entries of a rotation."""
CLOSED = 1e-12
"""Pose error below which Newton's method stops."""
STEPS = 12
"""Most Newton steps; one or two are usual, and near a singularity each halves the error."""
DAMPING = 1e-14
"""Added to the squares of the Jacobian, so that a singular one can be solved."""
SAME = 1e-5
"""rad: solutions nearer than this count as one, found twice at a singularity."""
NOTHING = 1e-9
"""Volume below which it has no sign."""


class GeneralArm(NamedTuple):
    """The joint axes at angle zero, in the base, and the tip."""

    place: Array
    """(6, 3) m: a point of each axis; on the fifth, the one nearest to the fourth."""
    along: Array
    """(6, 3): unit directions of the axes."""
    tip: Array
    """(4, 4) m: tip pose at angle zero."""


@jit_part
def turn(v: Array, along: Array, s: float, c: float) -> None:
    """Turn the vector v (3,) about a direction by an angle with sine s and cosine c."""
    x, y, z = v
    a, b, e = along
    d = (1.0 - c) * (a * x + b * y + e * z)
    v[0] = c * x + s * (b * z - e * y) + d * a
    v[1] = c * y + s * (e * x - a * z) + d * b
    v[2] = c * z + s * (a * y - b * x) + d * e


@jit_part
def turn_about(v: Array, place: Array, along: Array, s: float, c: float) -> None:
    """Turn the point v (3,) about a line."""
    for r in range(3):
        v[r] -= place[r]
    turn(v, along, s, c)
    for r in range(3):
        v[r] += place[r]


@jit_part
def turn_pose(T: Array, place: Array, along: Array, s: float, c: float) -> None:
    """Turn the pose T (4, 4) about a line."""
    for k in range(3):
        turn(T[:3, k], along, s, c)
    turn_about(T[:3, 3], place, along, s, c)


@jit_part
def _chain(arm: GeneralArm, q: Array, out_place: Array, out_along: Array, out_T: Array) -> None:
    """Axes (6, 3) and tip pose (4, 4) of the arm at q (6,): the last joint turns first."""
    out_place[:], out_along[:], out_T[:] = arm.place, arm.along, arm.tip
    for i in range(5, -1, -1):
        place, along, s, c = arm.place[i], arm.along[i], sin(q[i]), cos(q[i])
        for j in range(i + 1, 6):
            turn(out_along[j], along, s, c)
            turn_about(out_place[j], place, along, s, c)
        turn_pose(out_T, place, along, s, c)


@jit_part
def _jacobian(place: Array, along: Array, T: Array, out_J: Array) -> None:
    """Fill the Jacobian (6, 6): speed of the tip by each joint, linear above angular."""
    for i in range(6):
        for r in range(3):
            y, z = (r + 1) % 3, (r + 2) % 3
            out_J[r, i] = along[i, y] * (T[z, 3] - place[i, z])
            out_J[r, i] -= along[i, z] * (T[y, 3] - place[i, y])
            out_J[r + 3, i] = along[i, r]


@jit_part
def _pose_error(T: Array, now: Array, out_e: Array) -> float:
    """Largest entry of the error of a pose against T; fills the twist to T (6,), linear first."""
    off = 0.0
    out_e[3:] = 0.0
    for r in range(3):
        y, z = (r + 1) % 3, (r + 2) % 3
        out_e[r] = T[r, 3] - now[r, 3]
        for c in range(4):
            off = max(off, abs(T[r, c] - now[r, c]))
        for c in range(3):
            out_e[r + 3] += 0.5 * (now[y, c] * T[z, c] - now[z, c] * T[y, c])
    return off


@jit_part
def _solve_pose(arm: GeneralArm, T: Array, q: Array, place: Array, along: Array, J: Array) -> bool:
    """Bring q (6,) onto the pose T (4, 4); return whether it got there, leave axes and Jacobian."""
    now, e = np.empty((4, 4)), np.empty(6)
    for step in range(STEPS):
        _chain(arm, q, place, along, now)
        _jacobian(place, along, now, J)
        off = _pose_error(T, now, e)
        if off < CLOSED or step == STEPS - 1:
            break
        squares = J.T @ J
        for i in range(6):
            squares[i, i] += DAMPING
        q += np.linalg.solve(squares, J.T @ e)
    return bool(off <= EXACT)


@jit_part
def _posture(place: Array, along: Array, J: Array) -> int:
    """Posture 0 to 15 of an arm with these axes (6, 3)."""
    speeds = np.empty((3, 3))
    for i in range(3):
        speeds[i] = np.cross(along[i], place[4] - place[i])
    shoulder = np.cross(place[4] - place[0], along[0]) @ along[1] < -NOTHING
    volume = np.linalg.det(speeds)
    wrist = np.linalg.det(along[3:]) < -NOTHING
    other = (np.linalg.det(J) < 0.0) != ((volume < 0.0) != wrist)
    elbow = (volume < -NOTHING) != shoulder
    return int(8 * other + 4 * shoulder + 2 * elbow + wrist)


@jit_part
def _known(q: Array, rows: Array, reach: Bools) -> bool:
    """Whether q (6,) is already among the rows (P, 6) that are solutions."""
    for mu in range(len(rows)):
        apart = 0.0
        for i in range(6):
            apart = max(apart, abs(wrap(q[i] - rows[mu, i])))
        if reach[mu] and apart < SAME:
            return True
    return False


@jit
def sort_in(
    arm: GeneralArm, T: Array, q: Array, pose: Ints, out_q: Array, out_reach: Bools
) -> None:
    """Write those candidates q (N, 6) of poses T[pose] that are solutions to their posture's row.

    Fills out_q (B, 16, 6), in (-pi, pi], and out_reach (B, 16); no solution is written twice.
    """
    place, along, J = np.empty((6, 3)), np.empty((6, 3)), np.empty((6, 6))
    out_q[:] = 0.0
    out_reach[:] = False
    for v in range(len(q)):
        b, row = pose[v], q[v].copy()
        if not _solve_pose(arm, T[b], row, place, along, J):
            continue
        for i in range(6):
            row[i] = wrap(row[i])
        if _known(row, out_q[b], out_reach[b]):
            continue
        mu = _posture(place, along, J)
        for other in range(POSTURES):  # its own row, the one 8 away, then the others
            slot = (mu + 8 * other + other // 2) % POSTURES
            if not out_reach[b, slot]:
                out_q[b, slot] = row
                out_reach[b, slot] = True
                break


@jit
def follow_all(arm: GeneralArm, T: Array, q: Array) -> None:
    """Bring each q (B, 6) onto its pose T (B, 4, 4) along its own branch; NaN where there is none.

    Joints stay on their turns.
    """
    place, along, J = np.empty((6, 3)), np.empty((6, 3)), np.empty((6, 6))
    for i in range(len(q)):
        if not _solve_pose(arm, T[i], q[i], place, along, J):
            q[i] = np.nan


@jit
def forward_all(arm: GeneralArm, q: Array, out_T: Array) -> None:
    """Tip poses (B, 4, 4) of joint vectors (B, 6)."""
    place, along = np.empty((6, 3)), np.empty((6, 3))
    for i in range(len(q)):
        _chain(arm, q[i], place, along, out_T[i])
