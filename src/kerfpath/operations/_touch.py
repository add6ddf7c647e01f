"""A path moved to poses that a person has taught, and eased back to where it was."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from kerfpath._arrays import Array, Ints, floats, freeze, integers, scalar
from kerfpath.contour import Contour, angle_between, unit
from kerfpath.errors import InputError

__all__ = ["touched_up"]

PARTS = 16
"""Parts of a step between nodes at which the eased path has points of its own."""


def touched_up(
    path: Contour,
    nodes: Contour,
    moved: ArrayLike,
    points: ArrayLike,
    axes: ArrayLike,
    *,
    ease: float = 0.01,
) -> tuple[Contour, Ints]:
    """Return the path through poses taught at some of its nodes, and which of its nodes they are.

    From each taught pose the shift of the points and the turn of the axes fade out over `ease`, or
    go over to those of the next pose where that is nearer than twice as far, with speed and
    curvature continuous (the polynomial of degree five that is flat at both ends). To cut it,
    sample it with the second answer as `keep`.

    Parameters
    ----------
    path : Contour
        The path, densely sampled.
    nodes : Contour
        Sampled from it.
    moved : (m,) int
        Nodes that were moved, increasing; never the first, nor the last of a path that returns.
    points : (m, 3) m
    axes : (m, 3)
        Taught there.
    ease : float m
        Distance along the path.

    Raises
    ------
    InputError
        No or other nodes.
    """
    ease = scalar(ease, "ease", unit="m", above=0.0)
    moved = integers(moved, "moved", (None,))
    points = floats(points, "points", (len(moved), 3))
    axes = unit(floats(axes, "axes", (len(moved), 3)))
    last = len(nodes) - 1
    ordered = len(moved) > 0 and (np.diff(moved) > 0).all()
    most = last - nodes.returns
    if not (ordered and moved[0] > 0 and moved[-1] <= most):
        raise InputError(
            f"contour {nodes.name!r}: expected nodes from 1 to {most} that were moved, increasing, "
            f"got {moved.tolist()}"
        )
    step = np.arange(last * PARTS + 1) / PARTS
    s = np.unique(np.concatenate([np.interp(step, np.arange(last + 1), nodes.s), nodes.s]))
    base = path.at_nodes(s)
    shift = np.hstack([points - nodes.points[moved], _turns(nodes.axes[moved], axes)])
    eased = _ease_shifts(s, nodes.s[moved], shift, ease)
    touched = Contour(
        base.points + eased[:, :3],
        Rotation.from_rotvec(eased[:, 3:]).apply(np.array(base.axes)),
        closed=base.closed,
        kind=base.kind,
        speed_share=base.speed_share,
        name=nodes.name,
    )
    return touched, freeze(np.searchsorted(s, nodes.s[moved]))


def _turns(before: Array, after: Array) -> Array:
    """Return the rotation vectors (m, 3) that turn unit vectors the shortest way."""
    normal = np.cross(before, after)
    sine = np.linalg.norm(normal, axis=1, keepdims=True)
    angle = angle_between(before, after)[:, None]
    return np.asarray(normal * np.where(sine > 0, angle / np.where(sine > 0, sine, 1.0), 1.0))


def _ease_shifts(s: Array, at: Array, values: Array, ease: float) -> Array:
    """Return values (m, d) given at some arc lengths, faded out over `ease`, at all s (K,) m."""
    faded = np.concatenate([at - ease, at + ease])
    alone = np.abs(faded[:, None] - at).min(axis=1) >= ease * (1 - 1e-9)  # no other pose nearer
    faded = np.clip(faded[alone], s[0], s[-1])
    where, first = np.unique(np.concatenate([at, faded]), return_index=True)
    known_at = np.vstack([values, np.zeros((len(faded), values.shape[1]))])[first]
    k = np.clip(np.searchsorted(where, s, side="right") - 1, 0, len(where) - 2)
    t = np.clip((s - where[k]) / (where[k + 1] - where[k]), 0.0, 1.0)
    share = (t**3 * (10 - 15 * t + 6 * t**2))[:, None]
    return np.asarray(known_at[k] + share * (known_at[k + 1] - known_at[k]))
