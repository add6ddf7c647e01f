"""Kerf compensation: the contour moved sideways on the surface."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kerfpath._arrays import Array, Ints, scalar
from kerfpath.contour import CORNER, Contour, angle_between, turned, unit
from kerfpath.errors import InputError
from kerfpath.operations._surface import Side, lateral

__all__ = ["offset"]

ARC_STEP = np.radians(10)
"""Turn between the nodes of an arc around an outer corner; a smaller turn needs no arc."""
LOOK = 10.0
"""How many kerfs along the path an inner corner may reach."""


def offset(contour: Contour, distance: float, *, side: Side = "right") -> Contour:
    """Return the contour moved sideways by `distance` (m) in the planes across its tool axes.

    Outer corners become arcs around the corner; at inner corners the sides are cut back to where
    they meet.

    Parameters
    ----------
    contour : Contour
        All of one kind; closed or open.
    distance : float m
        Half the kerf.
    side : {"left", "right"}
        Seen from the nozzle along the travel; the scrap of loops from CAD is on the right.

    Raises
    ------
    InputError
        A radius on that side smaller than the distance (with its place), or nothing left.
    """
    distance = scalar(distance, "offset distance", unit="m", above=0.0)
    points, axes, source = _moved(contour, distance, side)
    keep = np.ones(len(points), bool)
    along = np.diff(contour.points, axis=0)
    # Segments that join the images of one node, in an arc, run as the contour does around it.
    back = (np.diff(points, axis=0) * along[np.minimum(source[:-1], len(along) - 1)]).sum(1) < 0
    back &= source[1:] != source[:-1]
    if contour.closed and back.any():
        points, axes, source, back = _opened_where_forward(points, axes, source, back)
    for first, last in _runs(back):
        if not keep[first : last + 2].any():
            continue
        a, b, meet = _meeting(points, axes, first, last, distance, contour.name)
        _require_corner(contour, source[a + 1 : b + 1], distance)
        keep[a + 1 : b + 1] = False
        keep[b], points[b] = True, meet
    points, axes = points[keep], axes[keep]
    if len(points) < (4 if contour.closed else 2):
        raise InputError(
            f"offset: contour {contour.name!r} is too small for {distance * 1e3:g} mm; nothing "
            "would be left of it"
        )
    if contour.closed:
        points[-1], axes[-1] = points[0], axes[0]
    apart = np.append(np.linalg.norm(np.diff(points, axis=0), axis=1) > 1e-9, True)
    return replace(
        contour,
        points=points[apart],
        axes=axes[apart],
        s=None,  # type: ignore[arg-type]  # filled in along the polyline
        time=None,
        kind=None,  # type: ignore[arg-type]  # all cut
        speed_share=None,  # type: ignore[arg-type]  # all one
        x=None,
    )


def _moved(contour: Contour, distance: float, side: Side) -> tuple[Array, Array, Ints]:
    """Return the images of all nodes, their axes, and the node of each; corners make several."""
    along = unit(np.diff(contour.points, axis=0))
    ends = (along[-1], along[0]) if contour.closed else (along[0], along[-1])
    before, after = np.vstack([ends[:1], along]), np.vstack([along, ends[1:]])
    across = [lateral(contour.axes, t, side) for t in (before, after)]
    turn = angle_between(*across)
    outer = (after * across[0]).sum(1) < 0
    points, axes, source = [], [], []
    for k, (p, n) in enumerate(zip(contour.points, contour.axes, strict=True)):
        l0, l1 = across[0][k], across[1][k]
        if outer[k] and turn[k] > ARC_STEP:
            part = np.linspace(0, 1, int(np.ceil(turn[k] / ARC_STEP - 1e-9)) + 1)[:, None]
            ways = turned(np.tile(l0, (len(part), 1)), np.tile(l1, (len(part), 1)), part)
        else:
            ways = (l0 + l1)[None] / max(1.0 + float(l0 @ l1), 1e-6)
        points.append(p + distance * ways)
        axes.append(np.tile(n, (len(ways), 1)))
        source += [k] * len(ways)
    return np.vstack(points), np.vstack(axes), np.array(source)


def _runs(back: Array) -> list[tuple[int, int]]:
    """Return first and last of each run of segments that are turned back."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], back.astype(np.int8), [0]])))
    return [(int(a), int(b) - 1) for a, b in edges.reshape(-1, 2)]


def _opened_where_forward(
    points: Array, axes: Array, source: Ints, back: Array
) -> tuple[Array, Array, Ints, Array]:
    """Return a closed chain begun as far from segments that turn back as it can be."""
    n = len(back)
    twice = np.flatnonzero(np.tile(back, 2))
    gaps = np.diff(twice)
    k = int((twice[int(np.argmax(gaps))] + gaps.max() // 2) % n) if len(gaps) else (n // 2)
    order = np.append(np.roll(np.arange(n), -k), k)
    return points[order], axes[order], source[order], np.roll(back, -k)


def _meeting(
    points: Array, axes: Array, first: int, last: int, distance: float, name: str
) -> tuple[int, int, Array]:
    """Return segments a before and b behind a run that meet, and where, seen along the axis."""
    n = axes[first]
    u = points[first + 1] - points[first]
    u = (u - (u @ n) * n) / np.linalg.norm(u - (u @ n) * n)
    flat = points @ np.array([u, np.cross(n, u)]).T
    step = np.linalg.norm(np.diff(points, axis=0), axis=1)
    far = LOOK * distance
    a = first - 1 - np.arange(int(np.searchsorted(np.cumsum(step[:first][::-1]), far)) + 1)
    b = last + 1 + np.arange(int(np.searchsorted(np.cumsum(step[last + 1 :]), far)) + 1)
    a, b = a[a >= 0], b[b < len(step)]
    i, j = (x.ravel() for x in np.meshgrid(a, b, indexing="ij"))
    p, r, q, s = flat[i], flat[i + 1] - flat[i], flat[j], flat[j + 1] - flat[j]
    det = r[:, 0] * s[:, 1] - r[:, 1] * s[:, 0]
    safe = np.where(det == 0, 1.0, det)
    w = q - p
    f = (w[:, 0] * s[:, 1] - w[:, 1] * s[:, 0]) / safe
    g = (w[:, 0] * r[:, 1] - w[:, 1] * r[:, 0]) / safe
    meets = (det != 0) & (f >= 0) & (f <= 1) & (g >= 0) & (g <= 1)
    if not meets.any():
        place = (points[first] * 1e3).round(2).tolist()
        raise InputError(
            f"offset: contour {name!r} near {place} mm has a radius smaller than "
            f"{distance * 1e3:g} mm on that side; the beam does not fit into it"
        )
    m = int(np.argmin(np.where(meets, j - i, len(points))))
    meet = points[i[m]] + f[m] * (points[i[m] + 1] - points[i[m]])
    return int(i[m]), int(j[m]), meet


def _require_corner(contour: Contour, nodes: Ints, distance: float) -> None:
    """Raise InputError where a curve, not a corner, is tighter than the distance."""
    along = unit(np.diff(contour.points, axis=0))
    nodes = np.unique(nodes) % len(along)
    turn = angle_between(along[nodes - 1], along[nodes])
    if turn.max() >= CORNER:
        return
    length = np.linalg.norm(np.diff(contour.points, axis=0), axis=1)[nodes].mean()
    radius = length / max(float(turn.max()), 1e-12)
    place = (contour.points[nodes[len(nodes) // 2]] * 1e3).round(2).tolist()
    raise InputError(
        f"offset: contour {contour.name!r} near {place} mm has a radius of about "
        f"{radius * 1e3:.3g} mm, smaller than {distance * 1e3:g} mm; the beam does not fit into it"
    )
