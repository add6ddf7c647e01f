"""Corners: round them within a tolerance, loop around them in the scrap, or slow down."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from kerfpath.arrays import Array, Ints, floats, not_negative, scalar
from kerfpath.contour import KINDS, Contour, angle_between, join, slerp, unit
from kerfpath.errors import InputError
from kerfpath.operations.kerf import is_plain, smoothest_start, start_at, with_nodes
from kerfpath.operations.surface import Side, Surface, lateral, lay_on, lean_axes, require_in_scrap

STRAIGHT_BACK = np.radians(179)
ARC_STEP = np.radians(5)
"""Turn between the nodes of an arc."""
SHRUNK, ROUNDING = 8, 1e-9
"""Most attempts at shrinking an arc until it keeps its tolerance, and the extra share that each
attempt takes off against rounding."""

Corner = Callable[[int, Array, Array, float], tuple[float, Array] | None]
"""A function of a node, the directions before and after it, and the room on each side (m). It
returns how far before and after the node (m) the contour is replaced, and the points (m, 3) m to
put there; or None to keep the corner."""


def round_corners(contour: Contour, tolerance: float, *, surface: Surface | None = None) -> Contour:
    """Return the contour with each corner replaced by an arc that passes it at `tolerance` (m).

    Where corners are close together, the arc is smaller; it never passes farther from the corner,
    on curved paths neither. Sampling keeps the node in the middle of the arc, as it keeps corners.
    A closed contour that begins at a corner is changed to begin at its smoothest place.

    Parameters
    ----------
    contour : Contour
    tolerance : float m
    surface : Surface, optional
        Surface that the arcs are laid on; default: the plane of the two directions at each corner.

    Raises
    ------
    InputError
        A corner that turns straight back; a contour that already has leads, micro joints or loops;
        an arc that leaves the surface.
    """
    tolerance = scalar(tolerance, "corner tolerance", unit="m", above=0.0)
    contour = _begin_off_corners(contour)

    def arc(k: int, t0: Array, t1: Array, room: float) -> tuple[float, Array]:
        turn = float(angle_between(t0, t1))
        radius = tolerance / (1 / np.cos(turn / 2) - 1)
        reach = min(radius * np.tan(turn / 2), room)
        return reach, _arc(contour.points[k], t0, t1, reach)

    return _replace_corners(contour, arc, KINDS.index("corner"), surface, tolerance)


def loop_corners(
    contour: Contour, radius: float, *, side: Side = "right", surface: Surface | None = None
) -> Contour:
    """Return the contour with a loop in the scrap added at each outer corner.

    The cut runs straight past the corner and returns to it in the loop. A closed contour that
    begins at a corner is changed to begin at its smoothest place.

    Parameters
    ----------
    contour : Contour
    radius : float m
        Radius of the loop.
    side : {"left", "right"}
        Side of the scrap; corners that turn towards it have no room for a loop and stay as they
        are.
    surface : Surface, optional
        Surface that the loops are laid on; default: the plane across the tool axis at each corner.

    Raises
    ------
    InputError
        A loop that touches the part or leaves the surface; a corner that turns straight back; a
        contour that already has leads, micro joints or loops.
    """
    radius = scalar(radius, "loop radius", unit="m", above=0.0)
    contour = _begin_off_corners(contour)
    axes = contour.axes

    def loop(k: int, t0: Array, t1: Array, room: float) -> tuple[float, Array] | None:
        away = lateral(axes[k : k + 1], t0[None], side)[0]
        if t1 @ away >= 0:
            return None
        turn = float(angle_between(t0, t1))
        reach = radius / np.tan((np.pi - turn) / 2)
        centre = contour.points[k] + reach * t0 + radius * away
        swept = np.linspace(0, 2 * np.pi - turn, int(np.ceil((2 * np.pi - turn) / ARC_STEP)) + 1)
        ring = np.sin(swept)[:, None] * t0 - np.cos(swept)[:, None] * away
        corner, ring = contour.points[k][None], centre + radius * ring
        require_in_scrap(contour, ring, side, "loop")
        return 0.0, np.vstack([corner, ring, corner])

    return _replace_corners(contour, loop, KINDS.index("loop"), surface)


def slow_corners(
    contour: Contour, share: float, *, distance: float = 1e-3, ramp: float = 2e-3
) -> Contour:
    """Return the contour with a lower speed around each corner.

    Parameters
    ----------
    contour : Contour
    share : float
        Share of the speed at a corner, above 0 and below 1.
    distance : float m
        Length before and after the corner that is cut at that share.
    ramp : float m
        Length over which the speed changes, before and after that.

    Raises
    ------
    InputError
        A share, distance or ramp out of range.
    """
    share = scalar(share, "corner speed share", above=0.0)
    if share >= 1:
        raise InputError(f"corner speed share: expected less than 1, got {share:g}")
    distance = not_negative(distance, "distance", unit="m")
    ramp = scalar(ramp, "ramp", unit="m", above=0.0)
    at = contour.s[contour.corners]
    if not at.size:
        return contour
    ends = np.concatenate(
        [at + d for d in (-distance - ramp, -distance, distance, distance + ramp)]
    )
    marked = with_nodes(contour, _within(contour, ends))
    apart = np.abs(marked.s[:, None] - at)
    if contour.closed:
        apart = np.minimum(apart, contour.length - apart)
    slowed = share + (1 - share) * np.clip((apart.min(axis=1) - distance) / ramp, 0.0, 1.0)
    return replace(marked, speed_share=np.minimum(marked.speed_share, slowed))


AT_ONCE = float(np.radians(9.0))
"""rad: turn of the axis from node to node at the speed for sharp edges; with more, a head that also
turns about the beam would not turn the axis evenly."""
BESIDE = 1.5
"""Distance from a sharp edge at which a turn still belongs to it, as a share of that within which
the axis of the drawn loop turns: a path with kerf runs beside the loop."""


def quick_turns(
    contour: Contour, edges: ArrayLike, *, distance: float, step: float
) -> tuple[Ints, Array]:
    """Return where the axis turns about sharp edges, and the shares of the speed to use there.

    Parameters
    ----------
    contour : Contour
    edges : (E, 3) m
        Where the loop crosses sharp edges (`at` of `Loop.edge_turns`).
    distance : float m
        Distance from them within which the axis turns (`Part.edge_turn`).
    step : float m
        Distance between nodes at the full speed.

    Returns
    -------
    segments : (T,) int
        Segments of the path near edges along which the axis turns by more than 9 deg per step.
    shares : (T,)
        Shares of the speed, below 1, at which it turns by 9 deg.
    """
    distance = scalar(distance, "distance", unit="m", above=0.0)
    step = scalar(step, "step", unit="m", above=0.0)
    places = floats(edges, "edges", (None, 3)) if len(np.asarray(edges)) else np.empty((0, 3))
    if not len(places):
        return np.empty(0, dtype=np.int64), np.empty(0)
    middle = (contour.points[1:] + contour.points[:-1]) / 2
    near = cKDTree(places).query(middle)[0] <= BESIDE * distance
    turn = angle_between(contour.axes[1:], contour.axes[:-1])
    allowed = AT_ONCE / step * np.diff(contour.s)
    found = np.flatnonzero(near & (turn > allowed))
    return found, allowed[found] / turn[found]


def slow_turns(
    contour: Contour, edges: ArrayLike, *, distance: float, step: float, ramp: float = 2e-3
) -> Contour:
    """Return the contour with a lower speed where its axis turns about sharp edges.

    A robot is slow there in any case. At this speed nodes that are evenly spaced in time follow the
    turn, by 9 deg each, and are far apart elsewhere.

    Parameters
    ----------
    contour : Contour
    edges : (E, 3) m
        Where the loop crosses sharp edges (`at` of `Loop.edge_turns`).
    distance : float m
        Distance from them within which the axis turns (`Part.edge_turn`).
    step : float m
        Distance between nodes at the full speed.
    ramp : float m
        Length over which the speed changes, before and after a turn.

    Raises
    ------
    InputError
        A distance, step or ramp that is not positive.
    """
    ramp = scalar(ramp, "ramp", unit="m", above=0.0)
    found, shares = quick_turns(contour, edges, distance=distance, step=step)
    if not found.size:
        return contour
    start, end = contour.s[found], contour.s[found + 1]
    marked = with_nodes(contour, _within(contour, np.concatenate([start - ramp, end + ramp])))
    slowed = np.ones(len(marked))
    shifts = (-contour.length, 0.0, contour.length) if contour.closed else (0.0,)
    for a, b, share in zip(start, end, shares, strict=True):
        for shift in shifts:
            off = np.maximum(a + shift - marked.s, marked.s - b - shift)
            slow = share + (1 - share) * np.clip(off / ramp, 0.0, 1.0)
            slowed = np.minimum(slowed, slow)
    return replace(marked, speed_share=np.minimum(marked.speed_share, slowed))


def _within(contour: Contour, s: Array) -> Array:
    """Return those of arc lengths (M,) m that lie inside a contour, around a closed one."""
    if contour.closed:
        s = contour.s[0] + np.mod(s - contour.s[0], contour.length)
    return np.unique(s[(s > contour.s[0]) & (s < contour.s[-1])])


def _begin_off_corners(contour: Contour) -> Contour:
    """Return the contour begun at its smoothest place if it is closed and begins in a corner."""
    if not is_plain(contour.kind):
        raise InputError(
            f"corners of {contour.name!r}: expected a cut without leads, micro joints or loops; "
            "treat its corners before adding those"
        )
    if 0 in contour.corners:
        begun = start_at(contour, smoothest_start(contour))
        if 0 not in begun.corners:
            return begun
        side = int(np.argmax(np.diff(contour.s)))  # a polygon: every node is a corner
        return start_at(contour, float(contour.s[side : side + 2].mean()))
    return contour


def _replace_corners(
    contour: Contour, corner: Corner, kind: int, surface: Surface | None, most: float = np.inf
) -> Contour:
    """Return the contour with each corner replaced by what `corner` returns, of one kind.

    The middle of each replacement is at most `most` (m) from the corner.
    """
    nodes = contour.corners
    if not nodes.size:
        return contour
    s = contour.s
    bounds = np.concatenate([s[:1], s[nodes], s[-1:]])
    room = np.diff(bounds)
    room[1:-1] /= 2  # shared with the next corner
    pieces, here = [], s[0]
    for i, k in enumerate(nodes.tolist()):
        t0, t1 = unit(np.diff(contour.points[k - 1 : k + 2], axis=0))
        if angle_between(t0, t1) > STRAIGHT_BACK:
            raise InputError(
                f"corners of {contour.name!r}: the path turns straight back at "
                f"{(contour.points[k] * 1e3).round(2).tolist()} mm; cut it as two contours"
            )
        free = 0.99 * min(room[i], room[i + 1])
        for _ in range(SHRUNK):
            made = corner(k, t0, t1, free)
            if made is None:
                break
            reach, points, axes = _laid(contour, k, *made, surface)
            off = float(np.linalg.norm(points[len(points) // 2] - contour.points[k]))
            if off <= most:
                break
            free = reach * most / off * (1 - ROUNDING)
        if made is None:
            continue
        share = np.full(len(points), np.interp(s[k], s, contour.speed_share))
        kinds = np.full(len(points), kind)
        pieces += [contour.between(here, s[k] - reach)]
        pieces += [Contour(points, axes, kind=kinds, speed_share=share, name="corner")]
        here = s[k] + reach
    if not pieces:
        return contour
    pieces.append(contour.between(here, s[-1]))
    return join(pieces, closed=contour.closed, name=contour.name)


def _laid(
    contour: Contour, k: int, reach: float, points: Array, surface: Surface | None
) -> tuple[float, Array, Array]:
    """Return reach (m), points and axes of what replaces corner k, laid on the surface."""
    ends, axes = contour.at(contour.s[k] + reach * np.array([-1.0, 1.0]))
    part = np.linspace(0, 1, len(points))[:, None]
    # On a curved path, an arc tangent to the directions at the corner ends slightly beside it.
    points = _shift_between(ends, points, part)
    if surface is None:
        before, after = (np.tile(axis, (len(part), 1)) for axis in axes)
    else:
        points, normals = lay_on(surface, points, contour, "corner")
        points = _shift_between(ends, points, part)  # the cut may lie beside the surface
        before, after = (lean_axes(normals, normals[e], axes[e]) for e in (0, -1))
    return reach, points, slerp(before, after, part)


def _shift_between(ends: Array, points: Array, part: Array) -> Array:
    """Return points (m, 3) shifted evenly, at shares (m, 1), so as to begin and end in `ends`."""
    moved: Array = points + (1 - part) * (ends[0] - points[0]) + part * (ends[1] - points[-1])
    return moved


def _arc(corner: Array, t0: Array, t1: Array, reach: float) -> Array:
    """Return the arc (m, 3) tangent to both directions at `reach` (m) from the corner."""
    turn = float(angle_between(t0, t1))
    radius = reach / np.tan(turn / 2)
    inwards = t1 - (t1 @ t0) * t0
    inwards /= np.linalg.norm(inwards)
    swept = np.linspace(0, turn, 2 * int(np.ceil(turn / ARC_STEP / 2)) + 1)[:, None]
    start = corner - reach * t0
    return np.asarray(start + radius * (np.sin(swept) * t0 + (1 - np.cos(swept)) * inwards))
