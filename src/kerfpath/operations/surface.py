"""The surface beside a contour, and the tool axes along it: smoothed, tilted or as taught."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal, Protocol, get_args

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from kerfpath.arrays import Array, Ints, floats, freeze, integers, scalar
from kerfpath.contour import KINDS, Contour, angle_between, slerp, unit
from kerfpath.errors import InputError
from kerfpath.tolerances import SAME_POINT

# -----------------------------------------------------------------------------
# Sides of a contour, and the surface that leads are laid on.

TOUCH = 1e-5
"""m: how far a path in the scrap may lie on the part's side; a lead that is tangent to a curve
deviates from the curve's first chord by some micrometres."""
SURFACE_ENDS = 1e-3
"""m: a point farther than this from the surface has left it."""

IN_SCRAP = [KINDS.index(word) for word in ("pierce", "lead-in", "lead-out", "loop")]
"""Kinds of the stretches that run in the scrap."""

Side = Literal["left", "right"]
"""Side of a contour, seen from the nozzle along the direction of travel."""


class Surface(Protocol):
    """The healed surface of a sheet: it extends over holes and past the edges of the part."""

    def project(self, points: Array) -> tuple[Array, Array]:
        """Return the nearest points (B, 3) m of the surface, and its outward normals (B, 3)."""


class Ribbon:
    """A surface made from a contour: the plane across the tool axis at the nearest node."""

    def __init__(self, contour: Contour) -> None:
        self._contour = contour

    def project(self, points: Array) -> tuple[Array, Array]:
        """Return points projected onto those planes (B, 3) m, and the outward normals (B, 3)."""
        where, k = nearest(self._contour, points)
        axis = self._contour.axes[k]
        return points - ((points - where) * axis).sum(1, keepdims=True) * axis, -axis


def lay_on(surface: Surface, flat: Array, contour: Contour, what: str) -> tuple[Array, Array]:
    """Return points (B, 3) m laid on a surface, and its outward normals (B, 3).

    Raises
    ------
    InputError
        A point too far from the surface.
    """
    points, normals = surface.project(flat)
    far = float(np.linalg.norm(points - flat, axis=1).max())
    if far > SURFACE_ENDS:
        raise InputError(
            f"{what} of {contour.name!r} leaves the surface by {far * 1e3:.3g} mm; make it smaller"
        )
    return points, normals


def lean_axes(normals: Array, normal: Array, axis: Array) -> Array:
    """Return tool axes (B, 3) that lean from the normals as `axis` (3,) does from `normal` (3,)."""
    tilt, _ = Rotation.align_vectors(axis[None], -normal[None])
    return np.asarray(tilt.apply(-normals))


def lateral(axes: Array, along: Array, side: Side) -> Array:
    """Return unit directions (K, 3) across the travel `along`, to one side.

    Raises
    ------
    InputError
        Another side than left or right.
    """
    if side not in get_args(Side):
        raise InputError(f"side: expected left or right, got {side!r}")
    # Steps may be very short: only travel along the tool axis has no side.
    along = along / np.linalg.norm(along, axis=-1, keepdims=True)
    across = unit(np.cross(axes, along), "side")
    return across if side == "right" else -across


def nearest(contour: Contour, points: Array) -> tuple[Array, Array]:
    """Return the points (B, 3) m of a contour nearest to `points`, and the node before each."""
    start, step = contour.points[:-1], np.diff(contour.points, axis=0)
    # Segments whose middle is farther than the nearest node by at most half the longest segment.
    bound, _ = cKDTree(contour.points).query(points)
    size = np.linalg.norm(step, axis=1)
    near = cKDTree(start + step / 2).query_ball_point(points, bound + 0.5001 * size.max())
    many = np.array([len(segments) for segments in near])
    row, k = np.repeat(np.arange(len(points)), many), np.concatenate(near).astype(np.int64)
    part = np.clip(((points[row] - start[k]) * step[k]).sum(1) / size[k] ** 2, 0.0, 1.0)
    foot = start[k] + part[:, None] * step[k]
    order = np.lexsort((k, np.linalg.norm(points[row] - foot, axis=1), row))
    best = order[np.cumsum(many) - many]
    return foot[best], k[best]


def edge(contour: Contour) -> Contour:
    """Return the part's edge: the contour without its leads and loops in the scrap."""
    on = ~np.isin(contour.kind[:-1], IN_SCRAP)
    keep = np.append(on, False) | np.append(False, on)
    points, axes = contour.points[keep], contour.axes[keep]
    new = np.append(np.linalg.norm(np.diff(points, axis=0), axis=1) > SAME_POINT, True)
    return Contour(points[new], axes[new], closed=contour.closed, name=contour.name)


def require_in_scrap(contour: Contour, points: Array, side: Side, what: str) -> None:
    """Raise InputError if one of the points (B, 3) m lies on the part's side of the contour."""
    where, k = nearest(contour, points)
    across = lateral(contour.axes[:-1], np.diff(contour.points, axis=0), side)
    last, nodes = len(across) - 1, contour.points
    ring = np.linalg.norm(nodes[0] - nodes[-1]) <= SAME_POINT
    before = np.where(k > 0, k - 1, last if ring else 0)
    after = np.where(k < last, k + 1, 0 if ring else last)
    # Close to a corner, one of its segments alone may give the wrong side.
    at_start, at_end = (np.linalg.norm(where - nodes[i], axis=1) <= SAME_POINT for i in (k, k + 1))
    other = np.where(at_start, before, np.where(at_end, after, k))
    depth = ((points - where) * (across[k] + across[other]) / 2).sum(1)
    if (depth < -TOUCH).any():
        i = int(np.argmin(depth))
        raise InputError(
            f"{what} of {contour.name!r} hits the part near {(points[i] * 1e3).round(2).tolist()} "
            f"mm, {-depth[i] * 1e3:.3g} mm deep; make it smaller, place it elsewhere, or change "
            "side"
        )


# -----------------------------------------------------------------------------
# The tool axis along a contour: smoothed within a bound, or tilted for a bevel.

TAIL = 3.0
"""Neighbours farther away than this many standard deviations are ignored."""
CLOSE = 0.25
"""Largest distance between the nodes that are averaged, in standard deviations."""
MOST_BEVEL = np.radians(60)


def smooth_axes(contour: Contour, distance: float, *, limit: float) -> Contour:
    """Return the contour with its axes averaged along the path, none turned by more than `limit`.

    At a bend between two faces, the axis then turns over about twice the distance instead of at
    once; the noise of triangulated surfaces disappears. Nodes that are farther apart than a quarter
    of the distance get others between them, unless the contour carries times.

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
    if contour.time is None:
        parts = np.maximum(1, np.ceil(np.diff(contour.s) / (CLOSE * sigma))).astype(np.int64)
        places = np.arange(parts.sum() + 1)
        ends = np.concatenate([[0], np.cumsum(parts)])
        contour = contour.at_nodes(np.interp(places, ends, contour.s))
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


# -----------------------------------------------------------------------------
# Move a path to poses taught by a person, with a gradual return to the original path.

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
