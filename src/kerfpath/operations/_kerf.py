"""Kerf compensation: the contour moved sideways on the surface."""

from __future__ import annotations

import numpy as np

from kerfpath._arrays import Array, Ints, scalar
from kerfpath.contour import CORNER, Contour, angle_between, slerp, unit
from kerfpath.errors import InputError
from kerfpath.operations._surface import Side, lateral, nearest

__all__ = ["offset"]

ARC_STEP = np.radians(10)
"""Turn between the nodes of an arc around an outer corner; a smaller turn needs no arc."""
ENOUGH = 0.98
"""Smallest share of the distance that the result keeps; the chords of an arc keep 0.996 of it."""
FITS = 0.99
"""Share of the distance that the first point of an offset chain must keep. Offset points of inner
corners, which are cut off later, keep at most 0.985 of it, the cosine of `ARC_STEP`."""
LOOK = 20.0
"""Length of path that an inner corner may take up, in multiples of the distance."""
SLOT = np.radians(165)
"""An inner corner that turns by more than this is a slot or notch that the beam does not fit into;
the sides of an outer corner that does would meet too far away."""
PARALLEL = 1e-9
"""Sine of the angle below which two segments count as parallel."""
STRAIGHT = np.radians(0.01)
"""Turn at a node below which the path counts as straight there."""
SAME_PLACE = 1e-9
"""m: nodes closer than this are the same."""


def offset(
    contour: Contour, distance: float, *, side: Side = "right", sharp: bool = False
) -> Contour:
    """Return the contour moved sideways by `distance` (m) in the planes across its tool axes.

    Outer corners become arcs around the corner; at inner corners the sides are cut back to where
    they meet. A closed contour begins at the point nearest to its previous start.

    Parameters
    ----------
    contour : Contour
        A plain cut at one speed, closed or open.
    distance : float m
        Half the kerf.
    side : {"left", "right"}
        Seen from the nozzle along the travel; the scrap of loops from CAD is on the right.
    sharp : bool
        Keep outer corners: extend their sides until they meet, so that `round_corners`,
        `loop_corners` or `slow_corners` can treat them afterwards.

    Raises
    ------
    InputError
        A place where the beam does not fit: a radius on that side smaller than the distance, a slot
        or neck narrower than twice the distance, or nothing left; a contour that already has leads,
        micro joints, loops or slow corners.
    """
    distance = scalar(distance, "offset distance", unit="m", above=0.0)
    if contour.kind.any() or (contour.speed_share < 1).any():
        raise InputError(
            f"offset: contour {contour.name!r} already has leads, micro joints, loops or slow "
            "corners; offset it before adding those"
        )
    contour = _with_middles(contour)
    points, axes, source = _move_nodes(contour, distance, side, sharp)
    if contour.closed:
        k = _amid_what_fits(contour, points, distance)
        around = (np.arange(len(points) + 1) + k) % len(points)
        points, axes, source = points[around], axes[around], source[around]
    points, axes = _without_loops(contour, points, axes, source, distance, side)
    apart = np.append(np.linalg.norm(np.diff(points, axis=0), axis=1) > SAME_PLACE, True)
    points, axes = points[apart], axes[apart]
    if len(points) < (4 if contour.closed else 2):
        raise _too_tight(contour, contour.points[0], distance, "is too small")
    middles = (points[:-1] + points[1:]) / 2
    gap = np.linalg.norm(middles - nearest(contour, middles)[0], axis=1)
    if (gap < ENOUGH * distance).any():
        raise _too_tight(
            contour, middles[np.argmin(gap)], distance, "has a slot or neck too narrow"
        )
    if contour.closed:
        k = int(np.argmin(np.linalg.norm(points[:-1] - contour.points[0], axis=1)))
        points, axes = np.roll(points[:-1], -k, axis=0), np.roll(axes[:-1], -k, axis=0)
    return Contour(points, axes, closed=contour.closed, name=contour.name)


def _with_middles(contour: Contour) -> Contour:
    """Return the contour with a node added in the middle of each side between two corners.

    The beam may fit there even if it does not fit at the corners.
    """
    steps = np.diff(contour.points, axis=0)
    turn = angle_between(*_ways_at(contour))
    amid = np.flatnonzero((turn[:-1] > ARC_STEP) & (turn[1:] > ARC_STEP))
    if not len(amid):
        return contour
    middles = contour.points[amid] + steps[amid] / 2
    axes = slerp(contour.axes[amid], contour.axes[amid + 1], np.full((len(amid), 1), 0.5))
    return Contour(
        np.insert(contour.points, amid + 1, middles, axis=0),
        np.insert(contour.axes, amid + 1, axes, axis=0),
        closed=contour.closed,
        name=contour.name,
    )


def _ways_at(contour: Contour) -> tuple[Array, Array]:
    """Return the unit directions (K, 3) of the path before and after each node.

    At the ends of an open contour they are the same.
    """
    along = unit(np.diff(contour.points, axis=0))
    ends = (along[-1], along[0]) if contour.closed else (along[0], along[-1])
    return np.vstack([ends[:1], along]), np.vstack([along, ends[1:]])


def _move_nodes(
    contour: Contour, distance: float, side: Side, sharp: bool
) -> tuple[Array, Array, Ints]:
    """Return the offset points, the axis and the source node of each; corners give several."""
    before, after = _ways_at(contour)
    across = [lateral(contour.axes, t, side) for t in (before, after)]
    turn = angle_between(*across)
    outer = (after * across[0]).sum(1) < 0
    points, axes, source = [], [], []
    for k in range(len(contour) - contour.closed):
        l0, l1 = across[0][k], across[1][k]
        if turn[k] <= ARC_STEP or (sharp and outer[k] and turn[k] <= SLOT):
            ways = (l0 + l1)[None] / (1.0 + float(l0 @ l1))
        elif outer[k]:
            part = np.linspace(0, 1, int(np.ceil(turn[k] / ARC_STEP - 1e-9)) + 1)[:, None]
            ways = slerp(np.tile(l0, (len(part), 1)), np.tile(l1, (len(part), 1)), part)
        else:
            ways = np.array([l0, l1])  # what lies between them is cut off where the sides meet
        points.append(contour.points[k] + distance * ways)
        axes.append(np.tile(contour.axes[k], (len(ways), 1)))
        source += [k] * len(ways)
    return np.vstack(points), np.vstack(axes), np.array(source)


def _amid_what_fits(contour: Contour, points: Array, distance: float) -> int:
    """Return the middle of the longest run of offset points (M, 3) m that keep the distance."""
    gap = np.linalg.norm(points - nearest(contour, points)[0], axis=1)
    tight = np.flatnonzero(gap < FITS * distance)
    if len(tight) == len(points):
        raise _too_tight(contour, contour.points[0], distance, "is too small")
    if not len(tight):
        return 0
    runs = np.diff(np.append(tight, tight[0] + len(points)))
    k = int(np.argmax(runs))
    return int(tight[k] + runs[k] // 2) % len(points)


def _without_loops(
    contour: Contour, points: Array, axes: Array, source: Ints, distance: float, side: Side
) -> tuple[Array, Array]:
    """Return the chain without the loops at its crossings with itself."""
    kept, kept_axes = [], []
    first, place = 0, 0.0  # the next node to keep, and its place along the chain, in nodes
    far = min(LOOK * distance, contour.length / 2)
    for i, f, j, g in _crossings(points, axes, far):
        if i + f < place:
            continue
        _require_corner(contour, np.unique(source[i + 1 : j + 1]), distance, side)
        part = np.array([[f]])
        kept += [points[first : i + 1], points[[i]] + f * (points[[i + 1]] - points[[i]])]
        kept_axes += [axes[first : i + 1], slerp(axes[[i]], axes[[i + 1]], part)]
        first, place = j + 1, j + g
    return np.vstack([*kept, points[first:]]), np.vstack([*kept_axes, axes[first:]])


def _crossings(points: Array, axes: Array, far: float) -> list[tuple[int, float, int, float]]:
    """Return the crossings (i, f, j, g) of a chain: segments i < j, at shares f and g of them.

    Crossings are seen along the axis. Only those with less than `far` (m) of chain between them
    count; they are in order along the chain.
    """
    step = np.diff(points, axis=0)
    size = np.linalg.norm(step, axis=1)
    s = np.concatenate([[0.0], np.cumsum(size)])
    found = []
    for apart in range(2, len(step)):
        near = s[apart:-1] - s[1:-apart] < far
        if not near.any():
            break
        i = np.flatnonzero(near)
        j = i + apart
        r, q, w, n = step[i], step[j], points[j] - points[i], axes[i]
        det = (np.cross(r, q) * n).sum(1)
        crosses = np.abs(det) > PARALLEL * size[i] * size[j]
        safe = np.where(crosses, det, 1.0)
        f, g = (np.cross(w, q) * n).sum(1) / safe, (np.cross(w, r) * n).sum(1) / safe
        meets = crosses & (f >= 0) & (f <= 1) & (g >= 0) & (g <= 1)
        found += list(zip(i[meets], f[meets], j[meets], g[meets], strict=True))
    return sorted((int(i), float(f), int(j), float(g)) for i, f, j, g in found)


def _require_corner(contour: Contour, nodes: Ints, distance: float, side: Side) -> None:
    """Raise InputError if the loop that is cut off is a tight curve or slot, not a corner."""
    before, after = (ways[nodes] for ways in _ways_at(contour))
    turn = angle_between(before, after)
    if turn.max() < CORNER and (radius := _radius(contour, nodes)) < distance:
        raise _too_tight(
            contour, contour.points[nodes[len(nodes) // 2]], distance,
            f"has a radius of about {radius * 1e3:.3g} mm",
        )  # fmt: skip
    inwards = (after * lateral(contour.axes[nodes], before, side)).sum(1) > 0
    if turn[inwards].sum() > SLOT:
        worst = contour.points[nodes[np.argmax(turn)]]
        raise _too_tight(contour, worst, distance, "has a slot or neck too narrow")


def _radius(contour: Contour, nodes: Ints) -> float:
    """Return the smallest radius (m) of a curve that the path may approximate at some nodes.

    At a node this is the distance to the nearer of the neighbouring turns, divided by the turn: for
    a regular polygon, about the radius of its inscribed circle.
    """
    turn, count = angle_between(*_ways_at(contour)), len(contour) - 1
    bent = np.flatnonzero(turn[:count] > STRAIGHT)
    place = np.concatenate(
        [[0.0], np.cumsum(np.linalg.norm(np.diff(contour.points, axis=0), axis=1))]
    )
    apart = np.diff(place[bent], append=place[bent[:1]] + place[-1])
    nearer = np.minimum(apart, np.roll(apart, 1))
    is_here = np.isin(bent, nodes % count)
    return float((nearer[is_here] / turn[bent[is_here]]).min(initial=np.inf))


def _too_tight(contour: Contour, place: Array, distance: float, what: str) -> InputError:
    return InputError(
        f"offset: contour {contour.name!r} {what} near {(place * 1e3).round(2).tolist()} mm; the "
        f"beam does not fit in there, {distance * 1e3:g} mm beside it"
    )
