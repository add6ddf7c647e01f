"""Torques of an arm: tau = M(q) q'' + C(q, q') q' + g(q), by the recursive Newton-Euler algorithm.

Luh, Walker and Paul 1980; Featherstone 2008, section 5.3. All vectors are in the axes of the
robot base, so that the geometry of a posture is computed once for every motion through it.
Links are rigid, without friction and rotor inertia.
"""

from __future__ import annotations

from math import cos, sin
from typing import NamedTuple

import numpy as np

from kerfpath.arrays import Array
from kerfpath.kernels.jit import jit, jit_inline, jit_part

__all__ = ["ArmBodies", "Posed", "fill_torque", "pose_arm", "room_for", "torques"]


class ArmBodies(NamedTuple):
    """The rigid bodies of an arm, one on each joint, and the joint frames."""

    rotation: Array
    """(n, 3, 3): axes of the joint frames at angle zero, in the frame of the joint before."""
    position: Array
    """(n, 3) m: origins of the joint frames, in the frame of the joint before."""
    axis: Array
    """(n, 3): unit joint axes, each in its own frame."""
    mass: Array
    """(n,) kg: masses."""
    centre: Array
    """(n, 3) m: centres of mass in the turned joint frames."""
    tensor: Array
    """(n, 3, 3) kg m^2: inertias about the centres of mass."""
    gravity: Array
    """(3,) m/s^2: gravity in the robot base."""


class Posed(NamedTuple):
    """The bodies posed by a joint vector, in the robot base, with scratch for the recursion."""

    frame: Array
    """(n+1, 3, 3): the base, then the turned joint frames."""
    axis: Array
    """(n, 3): joint axes."""
    step: Array
    """(n, 3) m: from the joint before to this one."""
    lever: Array
    """(n, 3) m: from the joint to the centre of mass."""
    tensor: Array
    """(n, 3, 3) kg m^2: inertias."""
    force: Array
    """(n, 3) N: force on each body."""
    moment: Array
    """(n, 3) N m: moment about its joint."""


@jit_part
def room_for(n: int) -> Posed:
    """Return scratch arrays for an arm of n joints."""
    frame = np.empty((n + 1, 3, 3))
    frame[0] = np.eye(3)
    return Posed(
        frame, np.empty((n, 3)), np.empty((n, 3)), np.empty((n, 3)),
        np.empty((n, 3, 3)), np.empty((n, 3)), np.empty((n, 3)),
    )  # fmt: skip


@jit_inline
def _turn(frame: Array, i: int, axis: Array, angle: float) -> None:
    """Turn frame i of (n, 3, 3) about one of its axes: R <- R rot(axis, angle), Rodrigues."""
    s, c = sin(angle), cos(angle)
    u, v, w = axis[0], axis[1], axis[2]
    d = 1.0 - c
    for r in range(3):
        x, y, z = frame[i, r, 0], frame[i, r, 1], frame[i, r, 2]
        along = d * (x * u + y * v + z * w)
        frame[i, r, 0] = c * x + s * (y * w - z * v) + along * u
        frame[i, r, 1] = c * y + s * (z * u - x * w) + along * v
        frame[i, r, 2] = c * z + s * (x * v - y * u) + along * w


@jit_inline
def _apply(frame: Array, i: int, vector: Array, row: int, out: Array) -> None:
    """Turn a row of `vector` (n, 3) from frame i into the base, into the same row of out (n, 3)."""
    for r in range(3):
        total = 0.0
        for x in range(3):
            total += frame[i, r, x] * vector[row, x]
        out[row, r] = total


@jit_inline
def pose_arm(arm: ArmBodies, q: Array, out: Posed) -> None:
    """Pose the bodies by the joints q (n,) rad."""
    for i in range(len(arm.mass)):
        _apply(out.frame, i, arm.position, i, out.step)
        for r in range(3):
            for c in range(3):
                total = 0.0
                for x in range(3):
                    total += out.frame[i, r, x] * arm.rotation[i, x, c]
                out.frame[i + 1, r, c] = total
        _apply(out.frame, i + 1, arm.axis, i, out.axis)
        _turn(out.frame, i + 1, arm.axis[i], q[i])
        _apply(out.frame, i + 1, arm.centre, i, out.lever)
        _pose_tensor(arm, i, out)


@jit_inline
def _pose_tensor(arm: ArmBodies, i: int, out: Posed) -> None:
    """Turn the inertia of body i into the base: R I R^T."""
    for r in range(3):
        for c in range(r + 1):
            total = 0.0
            for x in range(3):
                part = 0.0
                for y in range(3):
                    part += arm.tensor[i, x, y] * out.frame[i + 1, c, y]
                total += out.frame[i + 1, r, x] * part
            out.tensor[i, r, c] = out.tensor[i, c, r] = total


@jit_inline
def _cross(a: tuple[float, ...], b: tuple[float, ...]) -> tuple[float, float, float]:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@jit_inline
def _row(rows: Array, i: int) -> tuple[float, float, float]:
    return rows[i, 0], rows[i, 1], rows[i, 2]


@jit_inline
def _moved(
    a: tuple[float, ...], w: tuple[float, ...], dw: tuple[float, ...], arm: tuple[float, ...]
) -> tuple[float, float, float]:
    """Acceleration at the end of a lever: a + w' x arm + w x (w x arm)."""
    t, c = _cross(dw, arm), _cross(w, _cross(w, arm))
    return a[0] + t[0] + c[0], a[1] + t[1] + c[1], a[2] + t[2] + c[2]


@jit_inline
def _times(tensor: Array, i: int, v: tuple[float, ...]) -> tuple[float, float, float]:
    """Product of an inertia, of (n, 3, 3), and a vector."""
    return (
        tensor[i, 0, 0] * v[0] + tensor[i, 0, 1] * v[1] + tensor[i, 0, 2] * v[2],
        tensor[i, 1, 0] * v[0] + tensor[i, 1, 1] * v[1] + tensor[i, 1, 2] * v[2],
        tensor[i, 2, 0] * v[0] + tensor[i, 2, 1] * v[1] + tensor[i, 2, 2] * v[2],
    )


@jit_inline
def fill_torque(arm: ArmBodies, at: Posed, dq: Array, ddq: Array, out_tau: Array) -> None:
    """Fill the torques (n,) N m of velocities dq rad/s and accelerations ddq rad/s^2, (n,) each.

    Gravity enters as an opposite acceleration of the base.
    """
    n = len(arm.mass)
    w, dw = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    a = (-arm.gravity[0], -arm.gravity[1], -arm.gravity[2])
    for i in range(n):
        a = _moved(a, w, dw, _row(at.step, i))
        z, v, c = _row(at.axis, i), dq[i], ddq[i]
        bent = _cross(w, z)
        dw = (
            dw[0] + bent[0] * v + z[0] * c,
            dw[1] + bent[1] * v + z[1] * c,
            dw[2] + bent[2] * v + z[2] * c,
        )
        w = w[0] + z[0] * v, w[1] + z[1] * v, w[2] + z[2] * v
        lever = _row(at.lever, i)
        there, m = _moved(a, w, dw, lever), arm.mass[i]
        force = m * there[0], m * there[1], m * there[2]
        spin, gyro = _times(at.tensor, i, dw), _cross(w, _times(at.tensor, i, w))
        by_force = _cross(lever, force)
        for x in range(3):
            at.force[i, x] = force[x]
            at.moment[i, x] = spin[x] + gyro[x] + by_force[x]
    for i in range(n - 1, -1, -1):
        force, z = _row(at.force, i), _row(at.axis, i)
        out_tau[i] = z[0] * at.moment[i, 0] + z[1] * at.moment[i, 1] + z[2] * at.moment[i, 2]
        if i > 0:
            by_force = _cross(_row(at.step, i), force)
            for x in range(3):
                at.force[i - 1, x] += force[x]
                at.moment[i - 1, x] += at.moment[i, x] + by_force[x]


@jit
def torques(arm: ArmBodies, q: Array, dq: Array, ddq: Array, out_tau: Array) -> None:
    """Fill the torques (B, n) N m of joints q, velocities dq and accelerations ddq, (B, n) each."""
    at = room_for(q.shape[1])
    for b in range(len(q)):
        pose_arm(arm, q[b], at)
        fill_torque(arm, at, dq[b], ddq[b], out_tau[b])
