"""What is proved of the joints while gamma runs over a cell, and the frames it is proved from."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kerfpath._arrays import Array, Ints
from kerfpath._repr import short_repr
from kerfpath.errors import InputError
from kerfpath.kernels import enclosure

__all__ = ["Enclosure", "ball_frames", "require_cells"]

ROUNDING = 4.0 * 2.0**-52
"""Error of a sum of four products, as a share of the sum of their sizes; twice what it can be."""
MORE = 1.0 + 1e-12
"""Factor on a radius for its own rounding."""
GRAM = 2e-15
"""Rounding in the norm of R^T R - 1, 3 x 3: 9 entries of 3 products of numbers up to 1."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Enclosure:
    """Where the joints of each posture may be on cells of gamma, proved, rounding included.

    On cell c, gamma = m + t with |t| <= h, every solution of posture p has each joint i, modulo
    whole turns, within `radius` of center + slope t + [low, high] t^2 / 2. A solution is a joint
    vector whose flange pose is the task's: where the rotation matrices that were given are
    orthogonal to an error only, for any rotation within that error. Limits are ignored.

    Parameters
    ----------
    status : (C, P) uint8
        `NONE` (0): the posture has no solution anywhere on the cell. `SMOOTH` (1): one solution
        for each t, and it moves continuously. `BOX` (2): slopes and curvatures are zero, and the
        radius holds whatever solutions there are; pi where an angle is free.
    center : (C, P, n) rad
        In (-pi, pi].
    slope, low, high, radius : (C, P, n)
        rad/rad, rad/rad^2 twice, and rad.
    """

    status: NDArray[np.uint8]
    center: Array
    slope: Array
    low: Array
    high: Array
    radius: Array

    __repr__ = short_repr


def require_cells(frames: int, node: Ints, gamma: Array, half: Array) -> None:
    """Raise InputError unless each cell is of one of the frames and has a middle and a width."""
    if not node.shape == gamma.shape == half.shape == (len(node),):
        raise InputError(
            f"enclose: expected node, gamma and half of one length, got {node.shape}, "
            f"{gamma.shape}, {half.shape}"
        )
    bad = np.flatnonzero(~((node >= 0) & (node < frames)))
    if bad.size:
        raise InputError(f"enclose: cell {bad[0]} is of frame {node[bad[0]]}, of {frames} frames")
    bad = np.flatnonzero(~(np.isfinite(gamma) & (half >= 0.0) & (half <= 1.0)))
    if bad.size:
        i = int(bad[0])
        raise InputError(
            f"enclose: expected cells of a half-width from 0 to 1 rad, but cell {i} is "
            f"{gamma[i]:g} +- {half[i]:g}"
        )


def ball_frames(
    H: Array, T_flange_tip: Array, T_base_foot: Array, T_end_flange: Array, wrist: float
) -> enclosure.Frames:
    """Return task frames H (K, 4, 4) and the tool as the kernels take them, with their errors.

    `wrist` is how far the wrist centre is behind the model's end, m.
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
    """Return poses (..., 4, 4) and radii that hold those with the nearest rotation.

    A singular value s of R has |s - 1| <= |s^2 - 1|, which the norm of R^T R - 1 bounds; so has its
    inverse, down to s = 0.62.
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
    """Return the product of matrices known to a radius."""
    (A, rA), (B, rB) = a, b
    size = np.abs(A) @ np.abs(B)
    radius = np.abs(A) @ rB + rA @ (np.abs(B) + rB) + ROUNDING * size
    return A @ B, radius * MORE
