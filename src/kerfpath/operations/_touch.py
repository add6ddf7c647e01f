"""Move a path to poses taught by a person, with a gradual return to the original path."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from kerfpath._arrays import Array, Ints, floats, freeze, integers, scalar
from kerfpath.contour import Contour, angle_between, unit
from kerfpath.errors import InputError

__all__ = ["touched_up"]

PARTS = 16
"""Number of parts into which the moved path divides each step between nodes."""


def touched_up(
    path: Contour,
    nodes: Contour,
    moved: ArrayLike,
    points: ArrayLike,
    axes: ArrayLike,
    *,
    ease: float = 0.01,
) -> tuple[Contour, Ints]:
    """Return the path through poses taught at some nodes, and the indices (m,) of these in it.

    The shift of the points and the turn of the axes fade out over `ease` from each taught pose, or
    blend into those of the next pose if it is closer than twice `ease`. Speed and curvature stay
    continuous (a polynomial of degree five, flat at both ends). Before cutting, sample the path
    with the returned indices as `keep`.

    Parameters
    ----------
    path : Contour
        The path, densely sampled.
    nodes : Contour
        The contour sampled from `path`, in whose nodes the poses were taught.
    moved : (m,) int
        Nodes that were moved, increasing; never the first, nor the last of a path that returns.
    points : (m, 3) m
        Taught positions of the tip.
    axes : (m, 3)
        Taught tool axes.
    ease : float m
        Distance along the path over which the changes fade out.

    Raises
    ------
    InputError
        No nodes, or nodes that are out of range or out of order.
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
            f"contour {nodes.name!r}: expected increasing moved nodes from 1 to {most}, got "
            f"{moved.tolist()}"
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
