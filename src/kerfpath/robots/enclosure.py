"""Proven bounds on the joints over cells of gamma, and the frames that they are computed from."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kerfpath.arrays import Array, Ints, short_repr
from kerfpath.errors import InputError
from kerfpath.kernels import enclosure

ROUNDING = 4.0 * 2.0**-52
"""Error of a sum of four products as a share of the sum of their sizes; twice the true bound."""
MORE = 1.0 + 1e-12
"""Factor on a radius that covers its own rounding."""
GRAM = 2e-15
"""Rounding error of the norm of R^T R - 1, 3 x 3: 9 entries of 3 products of numbers up to 1."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Enclosure:
    """Proven bounds on the joints of each posture over cells of gamma, rounding included.

    On cell c, where gamma = m + t and |t| <= h, joint i of every solution of posture p lies, modulo
    full turns, within `radius` of center + slope t + [low, high] t^2 / 2. A solution is a joint
    vector whose flange pose is that of the task. Where the given rotation matrices are not exactly
    orthogonal, the bounds hold for every rotation within that error. Limits are ignored.

    Parameters
    ----------
    status : (C, P) uint8
        `NONE` (0): the posture has no solution anywhere on the cell. `SMOOTH` (1): it has one
        solution for each t, which moves continuously. `BOX` (2): slopes and curvatures are zero,
        and the radius covers all solutions that exist; it is pi where an angle is free.
    center : (C, P, n) rad
        Value at t = 0, in (-pi, pi].
    slope : (C, P, n) rad/rad
    low, high : (C, P, n) rad/rad^2
    radius : (C, P, n) rad
    """

    status: NDArray[np.uint8]
    center: Array
    slope: Array
    low: Array
    high: Array
    radius: Array

    __repr__ = short_repr


def require_cells(frames: int, node: Ints, gamma: Array, half: Array) -> None:
    """Raise InputError unless each cell has a valid frame, middle and half-width (0 to 1 rad)."""
    if not node.shape == gamma.shape == half.shape == (len(node),):
        raise InputError(
            "enclose: expected node, gamma and half of the same length, got shapes "
            f"{node.shape}, {gamma.shape}, {half.shape}"
        )
    bad = np.flatnonzero(~((node >= 0) & (node < frames)))
    if bad.size:
        raise InputError(
            f"enclose: expected frames from 0 to {frames - 1}, got frame {node[bad[0]]} for cell "
            f"{bad[0]}"
        )
    bad = np.flatnonzero(~(np.isfinite(gamma) & (half >= 0.0) & (half <= 1.0)))
    if bad.size:
        i = int(bad[0])
        raise InputError(
            f"enclose: expected cells with a half-width from 0 to 1 rad, got {gamma[i]:g} +- "
            f"{half[i]:g} rad for cell {i}"
        )


def ball_frames(
    H: Array, T_flange_tip: Array, T_base_foot: Array, T_end_flange: Array, wrist: float
) -> enclosure.Frames:
    """Return task frames H (K, 4, 4) and the tool in the form of the kernels, with error radii.

    `wrist` is the distance (m) of the wrist centre behind the end of the model.
    """
    base = _rigid(H)
    if not np.array_equal(T_base_foot, np.eye(4)):
        base = _product(_inverse(_rigid(T_base_foot)), base)
    end = _inverse(_rigid(T_flange_tip))
    if not np.array_equal(T_end_flange, np.eye(4)):
        end = _product(end, _inverse(_rigid(T_end_flange)))
    to_wrist = np.eye(4)
    to_wrist[2, 3] = -wrist
    end = _product(end, (to_wrist, np.zeros((4, 4))))
    (B, rB), (E, rE) = base, end
    return enclosure.Frames(
        np.ascontiguousarray(B[:, :3]),
        np.ascontiguousarray(rB[:, :3]),
        np.ascontiguousarray(E[:3]),
        np.ascontiguousarray(rE[:3]),
    )


def _rigid(T: Array) -> tuple[Array, Array]:
    """Return poses (..., 4, 4) and radii that enclose the poses with the nearest rotation.

    A singular value s of R has |s - 1| <= |s^2 - 1|, which the norm of R^T R - 1 bounds; the same
    holds for the inverse, down to s = 0.62.
    """
    R = T[..., :3, :3]
    gram = np.swapaxes(R, -1, -2) @ R - np.eye(3)
    radius = np.zeros(T.shape)
    norm = np.linalg.norm(gram, axis=(-2, -1))
    radius[..., :3, :3] = ((norm + GRAM) * MORE)[..., None, None]
    return T, radius


def _inverse(T: tuple[Array, Array]) -> tuple[Array, Array]:
    """Return the inverse of rigid motions, the rotation transposed."""
    m, r = (np.swapaxes(a, -1, -2).copy() for a in T)
    m[..., 3, :3] = r[..., 3, :3] = 0.0
    place, around = T[0][..., :3, 3:], T[1][..., :3, 3:]
    p, rp = _product((m[..., :3, :3], r[..., :3, :3]), (place, around))
    m[..., :3, 3:], r[..., :3, 3:] = -p, rp
    return m, r


def _product(a: tuple[Array, Array], b: tuple[Array, Array]) -> tuple[Array, Array]:
    """Return the product of two matrices and its radius; each is given as (matrix, radius)."""
    (A, rA), (B, rB) = a, b
    size = np.abs(A) @ np.abs(B)
    radius = np.abs(A) @ rB + rA @ (np.abs(B) + rB) + ROUNDING * size
    return A @ B, radius * MORE
