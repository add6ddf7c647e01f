"""Curves of drawings, and traces of loops along them: their measures and dense samples."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any, Generic, Protocol, TypeVar, cast

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from kerfpath.arrays import Array, Bools, Ints, short_repr
from kerfpath.cad.sharp_edges import SMOOTH, Sampled, edges_of
from kerfpath.contour import Contour
from kerfpath.errors import InputError

# -----------------------------------------------------------------------------
# Connected groups of numbered things.


def label_connected(pairs: NDArray[np.integer], count: int) -> Ints:
    """Return a group number (count,) for each thing, equal for those joined by `pairs` (P, 2)."""
    ends = np.asarray(pairs, dtype=np.int64).reshape(-1, 2)
    links = coo_array((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), shape=(count, count))
    return np.asarray(connected_components(links, directed=False)[1], dtype=np.int64)


# -----------------------------------------------------------------------------
# Traces of loops: a chain of curves, or given points.

FIRST_CELLS = 4
"""First number of cells per smooth stretch: one could hide an S with its middle on its chord."""
MARGIN = 0.8
"""Share of the tolerance allowed at the middle of a cell; a curve may deviate more beside it."""
SHORTEST = 1e-3
"""Cells below this (mm) are not divided, as a crease turns the normal of a surface in no length."""
AT_CREASE = 4.0
"""Least turn of the normal in the cell at a crease, in multiples of that in its neighbours."""
MOST = 500_000
"""Largest number of nodes on one edge; a broken edge would need more without end."""
AROUND = 24
"""Points on each edge for approximate results: middles, and whether a loop is round."""


class DirectedCurve(Protocol):
    """A curve with normals, in the direction of travel; lengths in mm."""

    def breaks(self) -> Array:
        """Return the parameters, in the direction of travel, between which it is smooth."""

    def evaluate(self, t: Array) -> tuple[Array, Array]:
        """Return points (K, 3) mm and outward unit normals (K, 3) at parameters `t` (K,)."""


class Edge(DirectedCurve, Protocol):
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
    def curves(self) -> Sequence[DirectedCurve]:
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

    def sample(self, chord_tolerance: float, axis_tolerance: float) -> Sampled:
        """Return nodes along the trace; the first is not repeated.

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
    def curves(self) -> Sequence[DirectedCurve]:
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
        if len(self.edges) == 1:
            return self.edges[0].around
        return np.vstack([edge.around for edge in self.edges])

    @cached_property
    def area(self) -> Array:
        """Vector area (3,) mm^2 of the polygon `around`, for a closed chain."""
        return vector_area(self.around)

    def bounds(self) -> Array:
        if len(self.edges) == 1:
            return self.edges[0].bounds()
        boxes = np.array([edge.bounds() for edge in self.edges])
        return np.stack([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)])

    def break_at(self) -> str:
        if not self.is_closed:
            return self.next_end
        k = int(np.argmax(self.gaps))
        place = self.edges[k].ends[1].round(3).tolist()
        return f"has a gap of {self.gaps[k]:.3f} mm after its edge {k + 1}, at {place} mm"

    def sample(self, chord_tolerance: float, axis_tolerance: float) -> Sampled:
        """Return nodes along the chain.

        The end of an edge and the start of the next become one node, halfway.
        """
        each = [_sample_edge(edge, chord_tolerance, axis_tolerance) for edge in self.edges]
        points, arriving, leaving = [], [], []
        for before, after in zip(each[-1:] + each[:-1], each, strict=True):
            points += [(before.points[-1:] + after.points[:1]) / 2, after.points[1:-1]]
            arriving += [before.arriving[-1:], after.arriving[1:-1]]
            leaving += [after.leaving[:1], after.leaving[1:-1]]
        if not self.is_closed:
            first, last = each[0], each[-1]
            points[0], arriving[0] = first.points[:1], first.leaving[:1]
            points.append(last.points[-1:])
            arriving.append(last.arriving[-1:])
            leaving.append(last.arriving[-1:])
        return Sampled(np.vstack(points), np.vstack(arriving), np.vstack(leaving))


def _sample_edge(edge: DirectedCurve, chord_tolerance: float, axis_tolerance: float) -> Sampled:
    """Return nodes along one edge, both ends included; at a crease of its surface there is one."""
    _, points, normals = sample_curve(edge, chord_tolerance, axis_tolerance)
    crease = creases(points, normals) & (_angle(normals[:-1], normals[1:]) > axis_tolerance)
    if not crease.any():
        return Sampled(points, normals, normals)
    first = np.flatnonzero(np.concatenate([[True], ~crease]))
    last = np.append(first[1:] - 1, len(points) - 1)
    return Sampled((points[first] + points[last]) / 2, normals[first], normals[last])


def creases(points: Array, normals: Array) -> Bools:
    """Return which cells (K-1,) between points on an edge are a crease, where the normal jumps.

    Around a tight bend, too, cells are short, but the normal turns in its neighbours as well.
    """
    length = np.linalg.norm(np.diff(points, axis=0), axis=1)
    turn = _angle(normals[:-1], normals[1:])
    beside = np.pad(turn, 1)
    alone = turn > AT_CREASE * np.maximum(beside[:-2], beside[2:])
    return np.asarray((length <= SHORTEST) & alone & (turn > SMOOTH))


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
    """Given points and their normals.

    Parameters
    ----------
    points : (K, 3) mm
    normals : (K, 3)
        Outward normals; at a sharp edge, that just behind the point.
    is_closed : bool
    arriving : (K, 3), optional
        Outward normals just before the points; default: `normals`.
    """

    points: Array
    normals: Array
    is_closed: bool
    arriving: Array | None = None

    __repr__ = short_repr

    @cached_property
    def lengths(self) -> Array:
        points = np.vstack([self.points, self.points[:1]]) if self.is_closed else self.points
        return np.asarray(np.linalg.norm(np.diff(points, axis=0), axis=1))

    @cached_property
    def curves(self) -> Sequence[DirectedCurve]:
        """The segments between the points, as one curve from sharp edge to sharp edge."""
        line = self.sample(0.0, 0.0)
        edges = edges_of(line)
        if not edges.size:
            return [Polyline(line=Contour(self.points, -self.normals, closed=self.is_closed))]
        count = len(self.points)
        ends = (
            np.append(edges, edges[0] + count)
            if self.is_closed
            else np.union1d(edges, [0, count - 1])
        )
        found = list[DirectedCurve]()
        for a, b in pairwise(ends.tolist()):
            nodes = np.arange(a, b + 1) % count
            normals = line.leaving[nodes].copy()
            normals[-1] = line.arriving[nodes[-1]]
            found.append(Polyline(line=Contour(line.points[nodes], -normals)))
        return found

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

    def sample(self, chord_tolerance: float, axis_tolerance: float) -> Sampled:
        """Return the given points and normals, whatever the tolerances."""
        arriving = self.normals if self.arriving is None else self.arriving
        return Sampled(self.points, arriving, self.normals)


def sample_curve(
    edge: DirectedCurve, chord_tolerance: float, axis_tolerance: float
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
    centred = points - points.mean(axis=0)  # so that small loops far away keep their digits
    m = (centred.T @ np.concatenate([centred[1:], centred[:1]])) / 2
    return np.array([m[1, 2] - m[2, 1], m[2, 0] - m[0, 2], m[0, 1] - m[1, 0]])


# -----------------------------------------------------------------------------
# Lines, arcs and splines; the normal of a flat drawing is +z.

Mark = tuple[float, ...]
NOTHING = 1e-6
"""mm: shorter curves have no length; curves that differ by less are the same."""
UP = (0.0, 0.0, 1.0)
"""The normal of a flat drawing."""
GAUSS = np.polynomial.legendre.leggauss(12)
"""Nodes and weights on (-1, 1); 12 per smooth stretch give the length of drawn curves to 1e-9."""
ROUND = 1e-12
"""Share by which the axes of a circle differ, and are not square to each other, at most."""
LOOK = 64
"""Number of points per stretch of a spline from which its bounding box is taken."""


class _Flat(ABC):
    """Base class of curves (see `Edge`); each has start, end, normal `up`, `at` and `speed`.

    Lines and arcs may be N together, see `measure`: then start and end are (N,), the vectors
    (N, 1, 3), parameters (N, K) and points (N, K, 3).
    """

    start: float
    end: float
    up: tuple[float, ...]

    @cached_property
    def ends(self) -> Array:
        return self.at(np.stack([self.start, self.end], axis=-1))

    @cached_property
    def mark(self) -> Mark:
        """Numbers that are the same for two curves that coincide, in either direction."""
        return _mark(self.rounded.tolist())

    @property
    def rounded(self) -> Array:
        """Five points from its start to its end, in steps of a length that tells curves apart."""
        points = self.at(np.linspace(self.start, self.end, 5, axis=-1))
        return np.asarray(np.round(points / (10 * NOTHING)) + 0.0)

    @cached_property
    def around(self) -> Array:
        return self.at(np.linspace(self.start, self.end, AROUND, endpoint=False, axis=-1))

    @cached_property
    def length(self) -> float:
        breaks = self.breaks()
        half, middle = np.diff(breaks)[:, None] / 2, (breaks[1:] + breaks[:-1])[:, None] / 2
        speed = self.speed((middle + half * GAUSS[0]).ravel()).reshape(len(half), -1)
        return float(np.abs(half[:, 0]) @ (speed @ GAUSS[1]))

    def bounds(self) -> Array:
        return self._box

    @cached_property
    def _box(self) -> Array:
        points = self.at(self.extremes())
        return np.stack([points.min(axis=-2), points.max(axis=-2)], axis=-2)

    def breaks(self) -> Array:
        return np.array([self.start, self.end])

    def extremes(self) -> Array:
        """Return parameters (K,) at which coordinates are least and greatest."""
        return np.stack([self.start, self.end], axis=-1)

    def evaluate(self, t: Array) -> tuple[Array, Array]:
        """Return points (K, 3) mm and normals (K, 3), all the same."""
        return self.at(t), np.tile(self.up, (len(t), 1))

    @abstractmethod
    def at(self, t: Array) -> Array:
        """Return points (K, 3) mm."""

    @abstractmethod
    def speed(self, t: Array) -> Array:
        """Return the length (K,) mm of the derivative."""


@dataclass(frozen=True)
class Line(_Flat):
    """The segment from `p` to `q`, (3,) mm."""

    p: Array
    q: Array
    start: float = 0.0
    end: float = 1.0
    up: tuple[float, ...] = UP

    __repr__ = short_repr

    def at(self, t: Array) -> Array:
        return np.asarray(self.p + t[..., None] * (self.q - self.p))

    def speed(self, t: Array) -> Array:
        return np.full(len(t), np.linalg.norm(self.q - self.p))

    @cached_property
    def length(self) -> float:
        return float(np.linalg.norm(self.q - self.p)) * abs(self.end - self.start)


@dataclass(frozen=True)
class Arc(_Flat):
    """Part of a circle or an ellipse: centre + cos(t) major + sin(t) minor, all (3,) mm."""

    centre: Array
    major: Array
    minor: Array
    start: float
    end: float
    up: tuple[float, ...] = UP

    __repr__ = short_repr

    def at(self, t: Array) -> Array:
        return np.asarray(
            self.centre + np.cos(t)[..., None] * self.major + np.sin(t)[..., None] * self.minor
        )

    @cached_property
    def radius(self) -> float | None:
        """The radius (mm) of a circle; None for an ellipse."""
        a, b = float(np.linalg.norm(self.major)), float(np.linalg.norm(self.minor))
        is_round = abs(a - b) <= ROUND * a and abs(float(self.major @ self.minor)) <= ROUND * a * a
        return a if is_round else None

    @cached_property
    def length(self) -> float:
        turn = abs(self.end - self.start)
        return super().length if self.radius is None else self.radius * turn

    def speed(self, t: Array) -> Array:
        d = np.cos(t)[:, None] * self.minor - np.sin(t)[:, None] * self.major
        return np.asarray(np.linalg.norm(d, axis=1))

    def breaks(self) -> Array:
        """Return quarters, because the flat sides of an ellipse are nearly straight."""
        quarters = int(np.ceil(abs(self.end - self.start) / (np.pi / 2) - 1e-9))
        return np.linspace(self.start, self.end, max(1, quarters) + 1)

    def extremes(self) -> Array:
        """Return the ends, and the extremes of x, y and z between them; some are repeated."""
        ends = np.stack([self.start, self.end], axis=-1)
        low, high = ends.min(axis=-1)[..., None], ends.max(axis=-1)[..., None]
        turns = np.arctan2(self.minor, self.major).reshape(*low.shape[:-1], 3, 1)
        k = np.floor(low / np.pi) - 1 + np.arange(np.ceil((high - low).max() / np.pi) + 3)
        t = (turns + k[..., None, :] * np.pi).reshape(*low.shape[:-1], -1)
        return np.concatenate([low, high, np.where((t > low) & (t < high), t, low)], axis=-1)


@dataclass(frozen=True)
class Spline(_Flat):
    """A rational B-spline: `homogeneous` gives (x w, y w, z w, w)."""

    homogeneous: BSpline
    start: float
    end: float
    up: tuple[float, ...] = UP

    def at(self, t: Array) -> Array:
        p = self.homogeneous(t)
        return np.asarray(p[:, :3] / p[:, 3:])

    def speed(self, t: Array) -> Array:
        p, d = self.homogeneous(t), self.homogeneous(t, 1)
        return np.asarray(
            np.linalg.norm((d[:, :3] - d[:, 3:] * p[:, :3] / p[:, 3:]) / p[:, 3:], axis=1)
        )

    def breaks(self) -> Array:
        """Return the knots between the ends."""
        low, high = sorted((self.start, self.end))
        knots = np.unique(self.homogeneous.t)
        t = np.concatenate([[low], knots[(knots > low) & (knots < high)], [high]])
        return t if self.start < self.end else t[::-1]

    def extremes(self) -> Array:
        """Return many parameters, some within a thousandth of a stretch of the true extremes."""
        breaks = self.breaks()
        part = np.linspace(0.0, 1.0, LOOK, endpoint=False)
        inside = (breaks[:-1, None] + np.diff(breaks)[:, None] * part).ravel()
        return np.append(inside, breaks[-1])


Curve = Line | Arc | Spline


def _mark(rounded: list[list[float]]) -> Mark:
    """Return the mark of a curve from five of its points."""
    ends, inner = sorted(rounded[::4]), sorted(rounded[1:4])
    return (*ends[0], *ends[1], *inner[0], *inner[1], *inner[2])


def measure(curves: Iterable[Curve]) -> None:
    """Find ends, points, boxes and marks of many lines and arcs at once, much faster than of each.

    They are kept in the curves, as if each had been asked for its own.
    """
    new = [curve for curve in curves if "mark" not in vars(curve)]
    for kind, names in ((Line, ("p", "q")), (Arc, ("centre", "major", "minor"))):
        alike = [curve for curve in new if isinstance(curve, kind)]
        if not alike:
            continue
        vectors = [np.array([vars(curve)[name] for curve in alike])[:, None] for name in names]
        start, end = np.array([(curve.start, curve.end) for curve in alike]).T
        together = cast("Any", kind)(*vectors, start=start, end=end)
        found = (together.ends, together.around, together.bounds(), together.rounded.tolist())
        for curve, ends, around, box, rounded in zip(alike, *found, strict=True):
            vars(curve).update(ends=ends, around=around, _box=box, mark=_mark(rounded))


def backwards(curve: Curve) -> Curve:
    """Return the curve in the opposite direction."""
    return replace(curve, start=curve.end, end=curve.start)


def turned(curve: Curve, R: Array, up: tuple[float, ...]) -> Curve:
    """Return the curve turned by a rotation (3, 3), with the normal `up`."""
    if isinstance(curve, Line):
        return replace(curve, p=R @ curve.p, q=R @ curve.q, up=up)
    if isinstance(curve, Arc):
        centre, major, minor = R @ curve.centre, R @ curve.major, R @ curve.minor
        return replace(curve, centre=centre, major=major, minor=minor, up=up)
    spline = curve.homogeneous
    net = np.column_stack([spline.c[:, :3] @ R.T, spline.c[:, 3]])
    return replace(curve, homogeneous=BSpline(spline.t, net, spline.k), up=up)
