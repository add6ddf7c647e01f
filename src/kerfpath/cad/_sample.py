"""Traces of loops: a chain of curves, or given points; their measures and dense samples."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Generic, Protocol, TypeVar

import numpy as np

from kerfpath._arrays import Array
from kerfpath._repr import short_repr
from kerfpath.contour import Contour
from kerfpath.errors import InputError

__all__ = [
    "AROUND",
    "Curve",
    "Edge",
    "EdgeChain",
    "Points",
    "Polyline",
    "Trace",
    "distance",
    "off_chord",
    "sample_curve",
    "vector_area",
]

FIRST_CELLS = 4
"""First number of cells per smooth stretch: one could hide an S with its middle on its chord."""
MARGIN = 0.8
"""Share of the tolerance allowed at the middle of a cell; a curve may deviate more beside it."""
SHORTEST = 1e-3
"""Cells below this (mm) are not divided, as a crease turns the normal of a surface in no length."""
MOST = 500_000
"""Largest number of nodes on one edge; a broken edge would need more without end."""
AROUND = 24
"""Points on each edge for approximate results: middles, and whether a loop is round."""


class Curve(Protocol):
    """A curve with normals, in the direction of travel; lengths in mm."""

    def breaks(self) -> Array:
        """Return the parameters, in the direction of travel, between which it is smooth."""

    def evaluate(self, t: Array) -> tuple[Array, Array]:
        """Return points (K, 3) mm and outward unit normals (K, 3) at parameters `t` (K,)."""


class Edge(Curve, Protocol):
    """A curve of a drawing, and its extent."""

    @property
    def start(self) -> float:
        """Parameter where it starts."""

    @property
    def end(self) -> float:
        """Parameter where it ends."""

    @property
    def ends(self) -> Array:
        """First and last point (2, 3) mm."""

    @property
    def around(self) -> Array:
        """Points (AROUND, 3) mm from its start on, evenly in the parameter, without its end."""

    @property
    def length(self) -> float:
        """Arc length, mm."""

    def bounds(self) -> Array:
        """Return the least and greatest coordinates (2, 3) mm."""


E = TypeVar("E", bound=Edge)


class Trace(Protocol):
    """The line that a loop runs along."""

    @property
    def curves(self) -> Sequence[Curve]:
        """Its curves, in the order of travel."""

    @property
    def is_closed(self) -> bool:
        """Whether the last curve ends where the first starts."""

    @property
    def lengths(self) -> Array:
        """Length (E,) of each of its edges, mm."""

    @property
    def gaps(self) -> Array:
        """Distance (mm) from the end of each edge to the start of the next."""

    @property
    def around(self) -> Array:
        """Some points (K, 3) mm along the whole trace."""

    @property
    def area(self) -> Array:
        """Vector area (3,) mm^2 of the polygon `around`, if the trace is closed."""

    def bounds(self) -> Array:
        """Return the least and greatest coordinates (2, 3) mm."""

    def break_at(self) -> str:
        """Return a message on where its largest gap is."""

    def sample(self, chord_tolerance: float, axis_tolerance: float) -> tuple[Array, Array]:
        """Return points (K, 3) mm and outward normals (K, 3); the first point is not repeated.

        Parameters
        ----------
        chord_tolerance : float mm
            Largest distance between the chord of two nodes and the edge.
        axis_tolerance : float rad
            Largest angle between the normals of two consecutive nodes on an edge.
        """


@dataclass(frozen=True, kw_only=True)
class EdgeChain(Generic[E]):
    """Edges in the order of travel; of a closed chain the last ends where the first starts.

    Parameters
    ----------
    edges : sequence of Edge
    is_closed : bool
    next_end : str
        For an open chain: a message on the distance and place of the next end.
    next_away : float mm
        For an open chain: that distance.
    """

    edges: Sequence[E]
    is_closed: bool = True
    next_end: str = ""
    next_away: float = 0.0

    __repr__ = short_repr

    @property
    def curves(self) -> Sequence[Curve]:
        """Its edges."""
        return self.edges

    @cached_property
    def lengths(self) -> Array:
        return np.array([edge.length for edge in self.edges])

    @cached_property
    def gaps(self) -> Array:
        ends = np.array([edge.ends for edge in self.edges])
        apart = np.concatenate([ends[1:, 0], ends[:1, 0]]) - ends[:, 1]
        gaps = np.sqrt((apart * apart).sum(axis=1))
        return np.asarray(gaps if self.is_closed else gaps[:-1])

    @cached_property
    def around(self) -> Array:
        """Points (K, 3) mm along the whole chain, equally many on each edge."""
        return np.vstack([edge.around for edge in self.edges])

    @cached_property
    def area(self) -> Array:
        """Vector area (3,) mm^2 of the polygon `around`, for a closed chain."""
        return vector_area(self.around)

    def bounds(self) -> Array:
        boxes = np.array([edge.bounds() for edge in self.edges])
        return np.stack([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)])

    def break_at(self) -> str:
        if not self.is_closed:
            return self.next_end
        k = int(np.argmax(self.gaps))
        place = self.edges[k].ends[1].round(3).tolist()
        return f"has a gap of {self.gaps[k]:.3f} mm after its edge {k + 1}, at {place} mm"

    def sample(self, chord_tolerance: float, axis_tolerance: float) -> tuple[Array, Array]:
        """Return points (K, 3) mm and outward normals (K, 3).

        The end of an edge and the start of the next become one node, halfway.
        """
        each = [sample_curve(edge, chord_tolerance, axis_tolerance)[1:] for edge in self.edges]
        points, normals = [], []
        for (before_p, before_n), (p, n) in zip(each[-1:] + each[:-1], each, strict=True):
            joint = before_n[-1] + n[0]
            points += [(before_p[-1:] + p[:1]) / 2, p[1:-1]]
            normals += [(joint / np.linalg.norm(joint))[None], n[1:-1]]
        if not self.is_closed:
            points[0], normals[0] = each[0][0][:1], each[0][1][:1]
            points.append(each[-1][0][-1:])
            normals.append(each[-1][1][-1:])
        return np.vstack(points), np.vstack(normals)


@dataclass(frozen=True, kw_only=True)
class Polyline:
    """The straight segments between the nodes of `line`; the axis turns evenly along each.

    Parameters
    ----------
    line : Contour
        In mm; its `s`, of any unit, is the parameter.
    """

    line: Contour

    __repr__ = short_repr

    def breaks(self) -> Array:
        """Return the parameters of the nodes."""
        return self.line.s

    def evaluate(self, t: Array) -> tuple[Array, Array]:
        points, axes = self.line.at(t)
        return points, -axes


@dataclass(frozen=True, kw_only=True)
class Points:
    """Given points (K, 3) mm and outward normals (K, 3)."""

    points: Array
    normals: Array
    is_closed: bool

    __repr__ = short_repr

    @cached_property
    def lengths(self) -> Array:
        points = np.vstack([self.points, self.points[:1]]) if self.is_closed else self.points
        return np.asarray(np.linalg.norm(np.diff(points, axis=0), axis=1))

    @cached_property
    def curves(self) -> Sequence[Curve]:
        """The segments between the points."""
        return [Polyline(line=Contour(self.points, -self.normals, closed=self.is_closed))]

    @property
    def gaps(self) -> Array:
        """Always zero: given points have no gaps."""
        return np.zeros(1)

    @cached_property
    def around(self) -> Array:
        """The points and the middles between them, as any three points alone lie on a circle."""
        following = np.roll(self.points, -1, axis=0)
        both = np.stack([self.points, (self.points + following) / 2], axis=1).reshape(-1, 3)
        return both if self.is_closed else both[:-1]

    @cached_property
    def area(self) -> Array:
        """Vector area (3,) mm^2 of the polygon."""
        return vector_area(self.points)

    def bounds(self) -> Array:
        return np.stack([self.points.min(axis=0), self.points.max(axis=0)])

    def break_at(self) -> str:
        """Return a message on how far its ends are apart."""
        first, last = self.points[[0, -1]]
        return (
            f"ends {np.linalg.norm(last - first):.3f} mm from its start, "
            f"at {last.round(3).tolist()} mm"
        )

    def sample(self, chord_tolerance: float, axis_tolerance: float) -> tuple[Array, Array]:
        """Return the given points and normals, whatever the tolerances."""
        return self.points, self.normals


def sample_curve(
    edge: Curve, chord_tolerance: float, axis_tolerance: float
) -> tuple[Array, Array, Array]:
    """Return parameters, points and normals along one edge, both ends included, by halving cells.

    Parameters are those of `Trace.sample`.

    Raises
    ------
    InputError
        An edge that needs too many nodes.
    """
    stretch = edge.breaks()
    t = np.concatenate(
        [
            *(np.linspace(a, b, FIRST_CELLS, endpoint=False) for a, b in pairwise(stretch)),
            stretch[-1:],
        ]
    )
    points, normals = edge.evaluate(t)
    open_cells = np.arange(len(t) - 1)
    while open_cells.size:
        middle = (t[open_cells] + t[open_cells + 1]) / 2
        mid_points, mid_normals = edge.evaluate(middle)
        p0, p1 = points[open_cells], points[open_cells + 1]
        chord = np.linalg.norm(p1 - p0, axis=1)
        coarse = off_chord(p0, p1, mid_points) > MARGIN * chord_tolerance
        coarse |= _angle(normals[open_cells], normals[open_cells + 1]) > axis_tolerance
        coarse &= chord > SHORTEST
        split = open_cells[coarse]
        t = np.insert(t, split + 1, middle[coarse])
        points = np.insert(points, split + 1, mid_points[coarse], axis=0)
        normals = np.insert(normals, split + 1, mid_normals[coarse], axis=0)
        if len(t) > MOST:
            raise InputError(
                f"an edge needs more than {MOST} nodes near {points[split[0]].tolist()} mm; relax "
                "the tolerances, or repair the edge in CAD"
            )
        left = split + np.arange(split.size)
        open_cells = np.sort(np.concatenate([left, left + 1]))
    return t, points, normals


def off_chord(p0: Array, p1: Array, p: Array) -> Array:
    """Return the distances of `p`, one point or one for each segment, from the segments p0 p1."""
    d = p1 - p0
    along = ((p - p0) * d).sum(1) / np.maximum((d * d).sum(1), np.finfo(float).tiny)
    return np.asarray(np.linalg.norm(p0 + np.clip(along, 0, 1)[:, None] * d - p, axis=1))


def _angle(n0: Array, n1: Array) -> Array:
    """Return the angles between unit vectors, accurate for tiny ones too."""
    return np.asarray(2 * np.arcsin(np.minimum(np.linalg.norm(n1 - n0, axis=1) / 2, 1.0)))


def distance(trace: Trace, point: Array) -> float:
    """Return the distance (mm) of `point` from the chords between the points `around` a trace."""
    off = off_chord(trace.around, np.roll(trace.around, -1, axis=0), point)
    return float((off if trace.gaps.size == len(trace.lengths) else off[:-1]).min())


def vector_area(points: Array) -> Array:
    """Return the vector area (3,) that a closed polygon (K, 3) encloses."""
    middle = points.mean(axis=0)  # about the middle, small loops far away keep their digits
    x, y, z = (points - middle).T
    after = [np.concatenate([values[1:], values[:1]]) for values in (x, y, z)]
    return (
        np.array(
            [y @ after[2] - z @ after[1], z @ after[0] - x @ after[2], x @ after[1] - y @ after[0]]
        )
        / 2
    )
