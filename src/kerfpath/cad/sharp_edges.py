"""Sharp edges that a cut crosses: the beam is normal to its wall, and turns close to the edge.

Where two walls meet at an angle, the normal jumps. The beam cannot, so within a distance before and
behind the edge it turns evenly about the edge: it leaves the normal of one wall, is halfway at the
edge itself, and arrives at the normal of the other wall. If that distance is the thickness of a
sheet bent by 90 deg, the beam turns about the inner edge. Between two edges that are closer to each
other than twice the distance, it turns from edge to edge.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from kerfpath.arrays import Array, Ints, lengths_along, short_repr
from kerfpath.contour import angle_between, unit
from kerfpath.errors import InputError

SMOOTH = float(np.radians(0.1))
"""rad: where walls meet at a smaller angle, one normal halfway between theirs is enough."""
SHARP = float(np.radians(2.0))
"""rad: edges that turn the beam by more are told to the user."""
FOLDED = float(np.radians(179.0))
"""rad: beyond this the walls fold back on each other, and there is no way from one to the other."""
SAME = 1e-6
"""mm: nodes closer than this are one."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class EdgeTurn:
    """A sharp edge that a loop crosses.

    Parameters
    ----------
    at : (3,) m
        Where it crosses the edge.
    angle : float rad
        Angle by which the beam turns there.
    """

    at: Array
    angle: float

    __repr__ = short_repr


class Sampled(NamedTuple):
    """Nodes along a trace; at an edge the normal before the node differs from that behind it."""

    points: Array
    """(K, 3) mm."""
    arriving: Array
    """(K, 3): outward normals just before the nodes."""
    leaving: Array
    """(K, 3): outward normals just behind the nodes."""


class Walls(NamedTuple):
    """Stretches of a line between edges, on each of which the normal of the wall is continuous."""

    start: Array
    """(S,) mm: arc lengths at which they begin."""
    end: Array
    """(S,) mm: arc lengths at which they end."""
    first: Array
    """(S, 3) rad: rotation vectors from the wall's normal to the beam's at their beginnings."""
    last: Array
    """(S, 3) rad: the same at their ends; 0 where there is no edge."""
    reach: float
    """mm: largest distance from an edge at which the beam turns."""

    @property
    def near(self) -> tuple[Array, Array]:
        """Distances (S,) mm, from the start and from the end, within which the beam turns."""
        edges = [each.any(axis=1) for each in (self.first, self.last)]
        room = (self.end - self.start) / np.where(edges[0] & edges[1], 2.0, 1.0)
        near = np.minimum(self.reach, room)
        return np.where(edges[0], near, 0.0), np.where(edges[1], near, 0.0)

    def turned(self, wall: Ints, s: Array, normals: Array) -> Array:
        """Return normals (K, 3) of walls (K,) at arc lengths s (K,) mm, turned near the edges."""
        turn = np.zeros_like(normals)
        for near, away, about in zip(
            self.near,
            (s - self.start[wall], self.end[wall] - s),
            (self.first, self.last),
            strict=True,
        ):
            width = near[wall]
            share = np.clip(1 - away / np.where(width > 0, width, 1.0), 0.0, 1.0)
            turn += np.where(width > 0, share, 0.0)[:, None] * about[wall]
        return np.asarray(Rotation.from_rotvec(turn).apply(normals))


def half_turns(arriving: Array, leaving: Array) -> Array:
    """Return the rotation vectors (E, 3) rad by half the angles from unit vectors to others."""
    way = np.cross(arriving, leaving)
    sine = np.linalg.norm(way, axis=1, keepdims=True)
    half = angle_between(arriving, leaving)[:, None] / 2
    return np.asarray(way * np.where(sine > 0, half / np.where(sine > 0, sine, 1.0), 0.5))


def edges_of(line: Sampled) -> Ints:
    """Return the nodes (E,) at which the normal jumps."""
    return np.flatnonzero(angle_between(line.arriving, line.leaving) > SMOOTH)


def edge_turns(line: Sampled, mm: float) -> tuple[EdgeTurn, ...]:
    """Return the sharp edges of a line; `mm` is the factor from mm to m."""
    angle = angle_between(line.arriving, line.leaving)
    return tuple(
        EdgeTurn(at=line.points[k] * mm, angle=float(angle[k]))
        for k in np.flatnonzero(angle > SHARP).tolist()
    )


def turn_at_edges(line: Sampled, reach: float, *, is_closed: bool) -> tuple[Array, Array]:
    """Return points (M, 3) mm and normals (M, 3) of a line along which the beam turns at edges.

    There are nodes at the edges and where the beam begins and ceases to turn.

    Parameters
    ----------
    line : Sampled
        A closed one does not repeat its first node.
    reach : float mm
        Distance from an edge within which the beam turns.
    is_closed : bool

    Raises
    ------
    InputError
        Walls that fold back on each other at an edge.
    """
    found = edges_of(line)
    if not found.size:
        return line.points, unit(line.arriving + line.leaving, "normals")
    _require_unfolded(line, found)
    count = len(line.points)
    nodes, cuts = np.arange(count), np.union1d(found, [0, count - 1])
    if is_closed:  # from the first edge round to itself
        nodes = (found[0] + np.arange(count + 1)) % count
        cuts = np.append(found - found[0], count)
    points, arriving, leaving = (each[nodes] for each in line)
    s = lengths_along(points)
    about = half_turns(arriving, leaving) * np.isin(nodes, found)[:, None]
    walls = Walls(
        start=s[cuts[:-1]], end=s[cuts[1:]], first=-about[cuts[:-1]], last=about[cuts[1:]],
        reach=reach,
    )  # fmt: skip
    places, along, normals = list[Array](), list[Array](), list[Array]()
    for wall, (a, b) in enumerate(pairwise(cuts.tolist())):
        own = arriving[a : b + 1] + leaving[a : b + 1]
        own[0], own[-1] = leaving[a], arriving[b]
        own = unit(own, "normals")
        low, high = (float(near[wall]) for near in walls.near)
        at = _with_places(s[a : b + 1], [s[a] + low, s[b] - high])
        k = np.clip(np.searchsorted(s[a : b + 1], at, side="right") - 1, 0, b - a - 1)
        length = s[a + k + 1] - s[a + k]
        part = ((at - s[a + k]) / np.where(length > 0, length, 1.0))[:, None]
        whole = unit((1 - part) * own[k] + part * own[k + 1], "normals")
        places.append(at)
        along.append(points[a + k] + part * (points[a + k + 1] - points[a + k]))
        normals.append(walls.turned(np.full(len(at), wall), at, whole))
    last = len(cuts) - 2
    made = [
        np.concatenate([each[: None if w == last and not is_closed else -1] for w, each in
                        enumerate(values)])
        for values in (places, along, normals)
    ]  # fmt: skip
    first = s[-found[0] % count] if is_closed else 0.0
    begin = int(np.argmin(np.abs(made[0] - first)))
    return np.roll(made[1], -begin, axis=0), np.roll(made[2], -begin, axis=0)


def _with_places(s: Array, more: Sequence[float]) -> Array:
    """Return arc lengths with `more` of them, except those at which there is a node already."""
    new = list[float]()
    for place in sorted(more):
        if min(abs(place - other) for other in (*s.tolist(), *new)) > SAME:
            new.append(place)
    return np.sort(np.append(s, new))


def _require_unfolded(line: Sampled, found: Ints) -> None:
    angle = angle_between(line.arriving[found], line.leaving[found])
    if angle.max() > FOLDED:
        x, y, z = line.points[found[int(np.argmax(angle))]].tolist()
        raise InputError(
            f"the walls fold back on each other near {x:.6g}, {y:.6g}, {z:.6g} mm, so the beam "
            "cannot turn from one to the other; draw the fold with a radius"
        )
