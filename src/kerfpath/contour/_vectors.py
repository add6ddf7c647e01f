"""Arrays of unit vectors: normalisation, angles and interpolation."""

from __future__ import annotations

import numpy as np

from kerfpath._arrays import Array
from kerfpath.errors import InputError

__all__ = ["angle_between", "slerp", "unit"]

ZERO = 1e-9
"""A vector shorter than this (any unit) has no direction."""


def unit(vectors: Array, name: str = "axes") -> Array:
    """Return vectors (K, 3) scaled to unit length.

    Raises
    ------
    InputError
        A vector without direction (with its index).
    """
    size = np.abs(vectors).max(axis=1, initial=0.0)
    if (zero := np.flatnonzero(size <= ZERO)).size:
        what = "the tool axis" if name == "axes" else "the direction normal to the tool axis"
        raise InputError(f"{name}: {what} of node {zero[0]} is zero; it needs a direction")
    scaled = vectors / size[:, None]  # no square overflows
    return np.asarray(scaled / np.linalg.norm(scaled, axis=1)[:, None])


def angle_between(n0: Array, n1: Array) -> Array:
    """Return the angle (...,) rad between unit vectors (..., 3), accurate for tiny ones too."""
    sine = np.linalg.norm(np.cross(n0, n1), axis=-1)
    return np.asarray(np.arctan2(sine, (n0 * n1).sum(-1)))


def slerp(n0: Array, n1: Array, part: Array) -> Array:
    """Turn unit vectors n0 (..., 3) towards n1 by a share `part` (..., 1) of their angle."""
    angle = angle_between(n0, n1)[..., None]
    small = angle < 1e-7
    sine = np.where(small, 1.0, np.sin(angle))
    w0 = np.where(small, 1 - part, np.sin((1 - part) * angle) / sine)
    w1 = np.where(small, part, np.sin(part * angle) / sine)
    mixed = w0 * n0 + w1 * n1
    return np.asarray(mixed / np.linalg.norm(mixed, axis=-1, keepdims=True))
