"""Cuts: their start and direction, micro joints, kerf compensation, lead-in and lead-out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple, TypedDict, Unpack, get_args

import numpy as np

from kerfpath.arrays import Array, Bools, Ints, floats, lengths_along, scalar, short_repr
from kerfpath.contour import CORNER, KINDS, Contour, angle_between, join, slerp, unit
from kerfpath.errors import InputError
from kerfpath.operations.surface import (
    TOUCH,
    Ribbon,
    Side,
    Surface,
    edge,
    lateral,
    lay_on,
    lean_axes,
    nearest,
    require_in_scrap,
)

# -----------------------------------------------------------------------------
# Starts, directions, overlaps and micro joints of cuts.

SAME_START = 1e-7
"""m: nodes closer than this are the same."""
ALIKE = 1e-6
"""rad: windows whose turns differ by less are equally smooth."""
CUT, MICRO_JOINT, OVERLAP, CORNER_ARC = (
    KINDS.index(word) for word in ("cut", "micro joint", "overlap", "corner")
)


class _Chain(NamedTuple):
    """Offset points (M, 3) m and axes, the kind of the stretch from each, and its source node."""

    points: Array
    axes: Array
    kind: Ints
    source: Ints

    def at(self, nodes: Ints | Bools | slice) -> _Chain:
        """Return some of its nodes, in that order."""
        return _Chain(self.points[nodes], self.axes[nodes], self.kind[nodes], self.source[nodes])


def reverse(contour: Contour) -> Contour:
    """Return the contour in the opposite direction, with the scrap on its other side.

    Raises
    ------
    InputError
        A contour that has a pierce; reverse it before adding the lead-in.
    """
    if contour.kind[0] == KINDS.index("pierce"):
        raise InputError(
            f"reverse: contour {contour.name!r} has a pierce; reverse it before adding the lead-in"
        )
    return replace(
        contour,
        points=contour.points[::-1],
        axes=contour.axes[::-1],
        s=contour.s[-1] - contour.s[::-1],
        time=None if contour.time is None else contour.time[-1] - contour.time[::-1],
        kind=np.append(contour.kind[-2::-1], contour.kind[0]),
        speed_share=contour.speed_share[::-1],
        x=None if contour.x is None else contour.x[::-1],
    )


def start_at(contour: Contour, s: float) -> Contour:
    """Return a closed contour that begins at arc length s (m) of this one.

    Raises
    ------
    InputError
        An open contour, or an arc length outside it.
    """
    _require_closed(contour, "start_at")
    s = scalar(s, "s", unit="m")
    if not contour.s[0] <= s <= contour.s[-1]:
        raise InputError(
            f"start_at: expected 0 to {contour.length * 1e3:g} mm along {contour.name!r}, got "
            f"{s * 1e3:g} mm"
        )
    opened = with_nodes(contour, np.array([s]))
    k = int(np.argmin(np.abs(opened.s - s))) % (len(opened) - 1)
    order = np.append(np.roll(np.arange(len(opened) - 1), -k), k)
    kind = opened.kind[order]
    kind[-1] = kind[-2]
    return replace(
        opened,
        points=opened.points[order],
        axes=opened.axes[order],
        s=None,  # type: ignore[arg-type]  # filled in along the polyline
        time=None,
        kind=kind,
        speed_share=opened.speed_share[order],
        x=None,
    )


def smoothest_start(contour: Contour, *, window: float = 5e-3) -> float:
    """Return the arc length (m) around which path and tool axis turn least, for `start_at`.

    Parameters
    ----------
    contour : closed Contour
    window : float m
        Length of path over which the turn around each node is summed.

    Raises
    ------
    InputError
        An open contour, or a window that is not positive.
    """
    _require_closed(contour, "smoothest_start")
    half = scalar(window, "window", unit="m", above=0.0) / 2
    axes, along = contour.axes[:-1], unit(np.diff(contour.points, axis=0))
    turn = angle_between(np.roll(along, 1, axis=0), along)
    turn += angle_between(axes, np.roll(axes, 1, axis=0)) / 2
    turn += angle_between(axes, np.roll(axes, -1, axis=0)) / 2
    s, length = contour.s[:-1] - contour.s[0], contour.length
    half = min(half, length / 2)
    around = np.concatenate([s - length, s, s + length])
    sums = np.concatenate([[0.0], np.cumsum(np.tile(turn, 3))])
    total = (
        sums[np.searchsorted(around, s + half, side="right")]
        - sums[np.searchsorted(around, s - half, side="left")]
    )
    smooth = total <= total.min() + ALIKE
    if smooth.all():
        return float(contour.s[0])
    # Take the middle of the longest stretch of equally smooth places.
    rough = np.flatnonzero(~smooth)
    gap = np.diff(np.append(s[rough], s[rough[0]] + length))
    k = int(np.argmax(gap))
    middle = s[rough[k]] + gap[k] / 2
    return float(contour.s[0] + s[int(np.argmin(np.abs(s - middle % length)))])


def overlap(contour: Contour, length: float) -> Contour:
    """Return a closed contour as an open one that continues past its start by `length` (m).

    Raises
    ------
    InputError
        An open contour, an overlap as long as the contour or longer, or one that would cut a micro
        joint.
    """
    _require_closed(contour, "overlap")
    length = scalar(length, "overlap", unit="m", above=0.0)
    if length >= contour.length:
        raise InputError(
            f"overlap: expected less than the contour's {contour.length * 1e3:g} mm, got "
            f"{length * 1e3:g} mm"
        )
    again = contour.between(contour.s[0], contour.s[0] + length)
    if (again.kind == MICRO_JOINT).any():
        raise InputError(
            f"overlap: the first {length * 1e3:g} mm of {contour.name!r} hold a micro joint, which "
            "would be cut through"
        )
    kind = np.concatenate([contour.kind[:-1], np.full(len(again), OVERLAP)])
    return Contour(
        np.vstack([contour.points, again.points[1:]]),
        np.vstack([contour.axes, again.axes[1:]]),
        kind=kind,
        speed_share=np.append(contour.speed_share, again.speed_share[1:]),
        name=contour.name,
    )


def micro_joints(
    contour: Contour, width: float, *, count: int | None = None, at: Sequence[float] | None = None
) -> Contour:
    """Return the contour with stretches that are not cut through, so that the part stays in place.

    Parameters
    ----------
    contour : Contour
    width : float m
        Width of each joint.
    count : int
        Number of joints, evenly spaced; the first is half a spacing after the start.
    at : sequence of float m
        Arc lengths of the middles of the joints, instead of `count`.

    Raises
    ------
    InputError
        Both or neither of `count` and `at`; joints that overlap, pass the ends, or lie in a lead.
    """
    if (count is None) == (at is None):
        raise InputError("micro_joints: give either count= or at=")
    width = scalar(width, "micro joint width", unit="m", above=0.0)
    if at is not None:
        middles = np.sort(floats(at, "at", (None,)))
        if not middles.size:
            raise InputError("micro_joints: expected at least one place, got at=[]")
    else:
        if not count or count < 1:
            raise InputError(f"micro_joints: expected a count of at least 1, got {count}")
        middles = contour.s[0] + (np.arange(count) + 0.5) * contour.length / count
    ends = np.c_[middles - width / 2, middles + width / 2].ravel()
    if (np.diff(ends) <= 0).any() or ends[0] <= contour.s[0] or ends[-1] >= contour.s[-1]:
        raise InputError(
            f"micro_joints: {len(middles)} joints of {width * 1e3:g} mm do not fit into "
            f"{contour.length * 1e3:g} mm of {contour.name!r} without overlap"
        )
    marked = with_nodes(contour, ends)
    place = np.searchsorted(ends, marked.s + SAME_START, side="right")
    joint = place % 2 == 1
    if not is_plain(marked.kind[joint]):
        raise InputError(
            f"micro_joints: a joint of {contour.name!r} lies in a lead, loop or overlap; add "
            "micro joints before those, or elsewhere"
        )
    kind = np.where(joint, MICRO_JOINT, marked.kind)
    return replace(marked, kind=kind)


def is_plain(kind: Ints) -> bool:
    """Return whether stretches are cut and no more: neither leads, joints, overlaps nor loops."""
    return bool(np.isin(kind, (CUT, CORNER_ARC)).all())


def with_nodes(contour: Contour, s: Array) -> Contour:
    """Return the contour with nodes added at arc lengths s (m) where it has none."""
    known = np.abs(contour.s - s[:, None]).min(axis=1) <= SAME_START
    every = np.sort(np.concatenate([contour.s, s[~known]]))
    return replace(contour, x=None, time=None).at_nodes(every)


def _require_closed(contour: Contour, what: str) -> None:
    if not contour.closed:
        raise InputError(f"{what}: expected a closed contour, but {contour.name!r} is open")


# -----------------------------------------------------------------------------
# Kerf compensation: the contour moved sideways on the surface.

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
SAME_NODE = 1e-9
"""m: nodes closer than this are the same."""


def offset(
    contour: Contour, distance: float, *, side: Side = "right", sharp: bool = False
) -> Contour:
    """Return the contour moved sideways by `distance` (m) in the planes across its tool axes.

    Outer corners become arcs around the corner, of which sampling keeps the middle; at inner
    corners the sides are cut back to where they meet. A closed contour begins at the point nearest
    to its previous start.

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
    if not is_plain(contour.kind) or (contour.speed_share < 1).any():
        raise InputError(
            f"offset: contour {contour.name!r} already has leads, micro joints, loops or slow "
            "corners; offset it before adding those"
        )
    contour = _with_middles(contour)
    chain = _move_nodes(contour, distance, side, sharp)
    if contour.closed:
        k, count = _amid_what_fits(contour, chain.points, distance), len(chain.points)
        chain = chain.at((np.arange(count + 1) + k) % count)
    chain = _without_loops(contour, chain, distance, side)
    apart = np.append(np.linalg.norm(np.diff(chain.points, axis=0), axis=1) > SAME_NODE, True)
    chain = chain.at(apart)
    points, count = chain.points, len(chain.points) - 1
    if count < (3 if contour.closed else 1):
        raise _too_tight(contour, contour.points[0], distance, "is too small")
    middles = (points[:-1] + points[1:]) / 2
    gap = np.linalg.norm(middles - nearest(contour, middles)[0], axis=1)
    if (gap < ENOUGH * distance).any():
        raise _too_tight(
            contour, middles[np.argmin(gap)], distance, "has a slot or neck too narrow"
        )
    if contour.closed:
        k = int(np.argmin(np.linalg.norm(points[:-1] - contour.points[0], axis=1)))
        k = _middle_of_arc(chain.kind[:-1], k)
        chain = chain.at((np.arange(count) + k) % count)
    else:
        chain.kind[-1] = chain.kind[-2]
    return Contour(
        chain.points, chain.axes, closed=contour.closed, kind=chain.kind, name=contour.name
    )


def _middle_of_arc(kind: Ints, k: int) -> int:
    """Return the middle of the arc that a node of a closed chain belongs to, or the node itself."""
    first = last = k
    while kind[first - 1] == CORNER_ARC and first > k - len(kind):
        first -= 1
    while kind[last % len(kind)] == CORNER_ARC and last < k + len(kind):
        last += 1
    return (first + last) // 2 % len(kind)


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
        kind=np.insert(contour.kind, amid + 1, contour.kind[amid]),
        name=contour.name,
    )


def _ways_at(contour: Contour) -> tuple[Array, Array]:
    """Return the unit directions (K, 3) of the path before and after each node.

    At the ends of an open contour they are the same.
    """
    along = unit(np.diff(contour.points, axis=0))
    ends = (along[-1], along[0]) if contour.closed else (along[0], along[-1])
    return np.vstack([ends[:1], along]), np.vstack([along, ends[1:]])


def _move_nodes(contour: Contour, distance: float, side: Side, sharp: bool) -> _Chain:
    """Return the offset nodes; corners give several."""
    before, after = _ways_at(contour)
    across = [lateral(contour.axes, t, side) for t in (before, after)]
    turn = angle_between(*across)
    outer = (after * across[0]).sum(1) < 0
    points, axes, kind, source = [], [], list[int](), list[int]()
    for k in range(len(contour) - contour.closed):
        l0, l1 = across[0][k], across[1][k]
        if turn[k] <= ARC_STEP or (sharp and outer[k] and turn[k] <= SLOT):
            ways = (l0 + l1)[None] / (1.0 + float(l0 @ l1))
        elif outer[k]:
            part = np.linspace(0, 1, 2 * int(np.ceil(turn[k] / ARC_STEP / 2 - 1e-9)) + 1)[:, None]
            ways = slerp(np.tile(l0, (len(part), 1)), np.tile(l1, (len(part), 1)), part)
        else:
            ways = np.array([l0, l1])  # what lies between them is cut off where the sides meet
        points.append(contour.points[k] + distance * ways)
        axes.append(np.tile(contour.axes[k], (len(ways), 1)))
        is_corner = outer[k] and turn[k] > CORNER
        own = int(contour.kind[k])
        kind += [CORNER_ARC if is_corner else own] * (len(ways) - 1) + [own]
        source += [k] * len(ways)
    return _Chain(np.vstack(points), np.vstack(axes), np.array(kind), np.array(source))


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


def _without_loops(contour: Contour, chain: _Chain, distance: float, side: Side) -> _Chain:
    """Return the chain without the loops at its crossings with itself."""
    points, axes, kind, source = chain
    kept = list[_Chain]()
    first, place = 0, 0.0  # the next node to keep, and its place along the chain, in nodes
    far = min(LOOK * distance, contour.length / 2)
    for i, f, j, g in _crossings(points, axes, far):
        if i + f < place:
            continue
        _require_corner(contour, np.unique(source[i + 1 : j + 1]), distance, side)
        crossing = points[[i]] + f * (points[[i + 1]] - points[[i]])
        axis = slerp(axes[[i]], axes[[i + 1]], np.array([[f]]))
        kept += [chain.at(slice(first, i + 1)), _Chain(crossing, axis, kind[[j]], source[[j]])]
        first, place = j + 1, j + g
    kept.append(chain.at(slice(first, None)))
    return _Chain(*(np.concatenate(each) for each in zip(*kept, strict=True)))


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
    place = lengths_along(contour.points)
    apart = np.diff(place[bent], append=place[bent[:1]] + place[-1])
    nearer = np.minimum(apart, np.roll(apart, 1))
    is_here = np.isin(bent, nodes % count)
    return float((nearer[is_here] / turn[bent[is_here]]).min(initial=np.inf))


def _too_tight(contour: Contour, place: Array, distance: float, what: str) -> InputError:
    return InputError(
        f"offset: contour {contour.name!r} {what} near {(place * 1e3).round(2).tolist()} mm; the "
        f"beam does not fit in there, {distance * 1e3:g} mm beside it"
    )


# -----------------------------------------------------------------------------
# Lead-in and lead-out on the scrap side, laid on the healed surface.

LeadShape = Literal["line", "arc"]

STEP = 2e-4
"""Distance (m) between the nodes of a lead."""


class LeadKeywords(TypedDict, total=False):
    """The keywords of `lead_in` and `lead_out`: fields of `Lead`."""

    shape: LeadShape
    angle: float
    side: Side
    surface: Surface | None
    fan: float | None
    speed_share: float
    clearance: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Lead:
    """A lead: its shape, and the surface that it is laid on.

    Parameters
    ----------
    length : float m
        Length of the lead.
    shape : {"line", "arc"}
        A line at `angle` to the first step, or an arc that turns by `angle` and joins it
        tangentially.
    angle : float rad
        At most pi / 2 for a line, pi for an arc; 0 is a tangent lead, for outer corners.
    side : {"left", "right"}
        Where the scrap is, seen from the nozzle along the travel.
    surface : Surface, optional
        Surface that the lead is laid on; default: the planes across the contour's own axes.
    fan : float m, optional
        Length over which the axis fans; default: the length of the lead.
    speed_share : float
        Share of the speed at the outer end of the lead; it changes evenly along the lead.
    clearance : float m
        Distance that the outer end of the lead must keep from the contour.
    """

    length: float
    shape: LeadShape = "line"
    angle: float = np.pi / 4
    side: Side = "right"
    surface: Surface | None = None
    fan: float | None = None
    speed_share: float = 1.0
    clearance: float = 0.0

    __repr__ = short_repr


def lead_in(contour: Contour, length: float, **keywords: Unpack[LeadKeywords]) -> Contour:
    """Return the contour with a lead-in from a pierce in the scrap to its first node.

    The tool axis is normal to the surface at the pierce and fans to the axis of the cut. A closed
    contour becomes an open one that ends where its cut began.

    Parameters
    ----------
    contour : Contour
    length : float m
        Length of the lead.
    **keywords
        Other fields of `Lead`; the default clearance of the pierce is 2e-4 m.

    Raises
    ------
    InputError
        A lead that touches the part, leaves the surface or ends too close to the part; a contour
        that already has a pierce; values out of range.
    """
    if contour.kind[0] == KINDS.index("pierce"):
        raise InputError(f"lead_in: contour {contour.name!r} already has a pierce")
    keywords.setdefault("clearance", 2e-4)
    lead = Lead(length=length, **keywords)
    points, axes = _lay_lead(contour, lead, lead.surface or Ribbon(contour), "lead-in")
    kind = np.full(len(points), KINDS.index("lead-in"))
    kind[0] = KINDS.index("pierce")
    share = _share(points, lead.speed_share, float(contour.speed_share[0]))
    before = Contour(points, axes, kind=kind, speed_share=share, name=contour.name)
    return join([before, replace(contour, closed=False, x=None, time=None)], name=contour.name)


def lead_out(contour: Contour, length: float, **keywords: Unpack[LeadKeywords]) -> Contour:
    """Return the contour with a lead-out from its last node into the scrap.

    Parameters and exceptions are those of `lead_in`, except that the contour may have a pierce and
    that the default clearance is 0.
    """
    lead = Lead(length=length, **keywords)
    pierced = contour.kind == KINDS.index("pierce")
    kinds = np.where(pierced, KINDS.index("lead-in"), contour.kind)  # for `reverse`
    plain = replace(contour, closed=False, kind=kinds, x=None, time=None)
    backwards = replace(lead, side="left" if lead.side == "right" else "right")
    surface = lead.surface or Ribbon(contour)
    points, axes = _lay_lead(reverse(plain), backwards, surface, "lead-out")
    kind = np.full(len(points), KINDS.index("lead-out"))
    share = _share(points, lead.speed_share, float(contour.speed_share[-1]))[::-1]
    after = Contour(points[::-1], axes[::-1], kind=kind, speed_share=share, name=contour.name)
    return join([replace(contour, closed=False, x=None, time=None), after], name=contour.name)


def _share(points: Array, far: float, near: float) -> Array:
    """Return speed shares (m,) from the outer end of a lead to the contour."""
    s = lengths_along(points)
    return np.asarray(far + (near - far) * s / s[-1])


def _lay_lead(contour: Contour, lead: Lead, surface: Surface, what: str) -> tuple[Array, Array]:
    """Return points (m, 3) m and axes (m, 3) of a lead that ends in the contour's first node."""
    shape, angle, side = lead.shape, lead.angle, lead.side
    length = scalar(lead.length, f"{what} length", unit="m", above=0.0)
    fan = length if lead.fan is None else min(scalar(lead.fan, "fan", unit="m", above=0.0), length)
    if shape not in get_args(LeadShape):
        raise InputError(f"{what} shape: expected line or arc, got {shape!r}")
    most = np.pi / 2 if shape == "line" else np.pi
    if not 0 <= angle <= most:
        raise InputError(
            f"{what} angle: expected 0 to {np.degrees(most):g} deg for a {shape}, got "
            f"{np.degrees(angle):g} deg"
        )
    back = np.linspace(length, 0.0, max(2, int(np.ceil(length / STEP))) + 1)
    start = contour.points[0]
    _, normal = surface.project(start[None])
    travel = (contour.points[1] - start)[None]
    along = unit(travel - (travel * normal).sum() * normal, "travel")
    aside = lateral(-normal, along, side)
    if shape == "line" or angle == 0:
        flat = start - back[:, None] * (np.cos(angle) * along - np.sin(angle) * aside)
    else:
        radius, turn = length / angle, back[:, None] / length * angle
        flat = start - radius * (np.sin(turn) * along - (1 - np.cos(turn)) * aside)
    points, normals = lay_on(surface, flat, contour, what)
    # The cut may lie beside the surface by rounding or kerf: close that gap along the lead.
    points = points + (1 - back / length)[:, None] * (start - points[-1])
    # The tilt of the cut's axis from the surface normal increases along the lead.
    leaning = lean_axes(normals, normal[0], contour.axes[0])
    axes = slerp(-normals, leaning, 1 - np.minimum(back / fan, 1)[:, None])
    _require_clearance(contour, points, side, lead.clearance, what)
    return points, axes


def _require_clearance(
    contour: Contour, points: Array, side: Side, clearance: float, what: str
) -> None:
    """Raise InputError if a lead is on the part's side, or its outer end too close to the part."""
    part = edge(contour)
    require_in_scrap(part, points[:-1], side, what)
    apart = float(np.linalg.norm(points[0] - nearest(part, points[:1])[0]))
    if apart <= max(clearance, TOUCH):
        raise InputError(
            f"{what} of {contour.name!r} ends {apart * 1e3:.3g} mm from the part, expected more "
            f"than {clearance * 1e3:g} mm; make it shorter or change its angle"
        )
