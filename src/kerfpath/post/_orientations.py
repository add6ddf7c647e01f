"""Distances between the poses of many targets, and orientations without jumps."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from kerfpath._arrays import Array, freeze

__all__ = ["distances", "pose_of", "quaternions", "rotation_vectors"]

UNIT = 1e-6
"""Largest error of the length of a quaternion: eight printed decimals pass."""


def pose_of(position: ArrayLike, wxyz: ArrayLike) -> Array | None:
    """Return the pose (4, 4) at a position (3,) m; None where the quaternion (4,) is not unit."""
    quaternion = np.asarray(wxyz, dtype=np.float64)
    if abs(np.linalg.norm(quaternion) - 1) > UNIT:
        return None
    T = np.eye(4)
    T[:3, :3] = Rotation.from_quat(quaternion, scalar_first=True).as_matrix()
    T[:3, 3] = position
    return freeze(T)


def distances(one: Array, two: Array) -> tuple[Array, Array]:
    """Return distances (m) and angles (rad) between poses (K, 4, 4)."""
    off = np.linalg.norm(one[:, :3, 3] - two[:, :3, 3], axis=1)
    between = np.swapaxes(one[:, :3, :3], 1, 2) @ two[:, :3, :3]
    return off, np.asarray(Rotation.from_matrix(between).magnitude())


def quaternions(T: Array) -> Array:
    """Return unit quaternions (K, 4), w first, of poses (K, 4, 4).

    The first has w >= 0; each other has the sign that brings it closer to the one before.
    """
    wxyz = Rotation.from_matrix(T[:, :3, :3]).as_quat(canonical=True, scalar_first=True)
    turned = (wxyz[1:] * wxyz[:-1]).sum(axis=1) < 0
    sign = np.cumprod(np.concatenate([np.ones(min(len(T), 1)), np.where(turned, -1.0, 1.0)]))
    return np.asarray(wxyz * sign[:, None])


def rotation_vectors(T: Array) -> Array:
    """Return axis times angle (K, 3) rad of poses (K, 4, 4).

    Angles go up to 2 pi, by the signs of `quaternions`, so that vectors do not jump at pi.
    """
    wxyz = quaternions(T)
    sine = np.linalg.norm(wxyz[:, 1:], axis=1)
    angle = 2 * np.arctan2(sine, wxyz[:, 0])
    scale = np.divide(angle, sine, out=np.full(len(T), 2.0), where=sine > 0)
    return np.asarray(wxyz[:, 1:] * scale[:, None])
