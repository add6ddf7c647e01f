"""The tool axis along a contour: smoothed within a bound, or tilted for a bevel."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from kerfpath._arrays import Array, floats, scalar
from kerfpath.contour import Contour, angle_between, slerp, unit
from kerfpath.errors import InputError
from kerfpath.operations._surface import Side, lateral

__all__ = ["bevel", "smooth_axes"]

TAIL = 3.0
"""Neighbours farther away than this many standard deviations are ignored."""
MOST_BEVEL = np.radians(60)


def smooth_axes(contour: Contour, distance: float, *, limit: float) -> Contour:
    """Return the contour with its axes averaged along the path, none turned by more than `limit`.

    At a bend between two faces, the axis then turns over about twice the distance instead of at
    once; the noise of triangulated surfaces disappears.

    Parameters
    ----------
    contour : Contour
    distance : float m
        Standard deviation of the Gaussian weights along the path.
    limit : float rad
        Largest angle between the old and the new axis of a node.

    Raises
    ------
    InputError
        A distance or limit that is not positive, or axes whose average is zero.
    """
    sigma = scalar(distance, "smoothing distance", unit="m", above=0.0)
    limit = scalar(limit, "smoothing limit", unit="rad", above=0.0)
    s, axes, length = contour.s - contour.s[0], contour.axes, contour.length
    # Each node is weighted by its length of path.
    stands_for = np.gradient(s)
    if contour.closed:
        turns = int(np.ceil(TAIL * sigma / length))
        shifts = np.arange(-turns, turns + 1) * length
        at = (s[:-1] + shifts[:, None]).ravel()
        around = np.tile(axes[:-1], (len(shifts), 1))
        stands_for[0] = (s[1] + length - s[-2]) / 2
        weights = np.tile(stands_for[:-1], len(shifts))
    else:
        at, around, weights = s, axes, stands_for
    first = np.searchsorted(at, s - TAIL * sigma)
    last = np.searchsorted(at, s + TAIL * sigma, side="right")
    smooth = np.empty_like(axes)
    for k, (a, b) in enumerate(zip(first, last, strict=True)):
        w = weights[a:b] * np.exp(-0.5 * ((at[a:b] - s[k]) / sigma) ** 2)
        smooth[k] = w @ around[a:b]
    if contour.closed:
        smooth[-1] = smooth[0]
    smooth = unit(smooth, "smoothed axes")
    angle = angle_between(axes, smooth)[:, None]
    part = np.where(angle > limit, limit / np.where(angle > 0, angle, 1.0), 1.0)
    return replace(contour, axes=slerp(axes, smooth, part), x=None)


def bevel(contour: Contour, angle: ArrayLike, *, side: Side = "right") -> Contour:
    """Return the contour with its axes tilted about the direction of travel.

    Parameters
    ----------
    contour : Contour
    angle : float or (K,) rad
        Tilt, constant or at each node; if positive, the head leans towards `side`.
    side : {"left", "right"}

    Raises
    ------
    InputError
        An angle of more than 60 deg, or different angles at the ends of a closed contour.
    """
    tilt = floats(np.broadcast_to(np.asarray(angle, dtype=float), len(contour)), "angle", (None,))
    if (np.abs(tilt) > MOST_BEVEL).any():
        raise InputError(
            f"bevel: expected angles up to 60 deg, got {np.degrees(np.abs(tilt).max()):.3g} deg"
        )
    if contour.closed and tilt[0] != tilt[-1]:
        raise InputError(f"bevel: contour {contour.name!r} is closed; give both ends equal angles")
    away = lateral(contour.axes, contour.along, side)
    tilted: Array = np.cos(tilt)[:, None] * contour.axes - np.sin(tilt)[:, None] * away
    return replace(contour, axes=tilted, x=None)
