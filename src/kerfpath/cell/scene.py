"""Distances between the bodies of a cell, by coal where cheap bounds are not enough.

A distance here is a lower bound on the true one. It is exact to coal's tolerance if it is below
`enough`, reduced by the deviation of meshes from their true surfaces, and negative if solids
overlap.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from kerfpath.arrays import Array, Bools, Ints, short_repr
from kerfpath.cell.mesh import Mesh
from kerfpath.cell.shapes import Capsule, Hull, Shape, box_between
from kerfpath.errors import InputError
from kerfpath.extras import imported

# -----------------------------------------------------------------------------
# A body of a cell: a solid fixed in one frame of its chain.

Kind = Literal["robot", "head", "part", "fixture", "floor"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Body:
    """A solid fixed in one of the frames that the robot and its external axes move.

    Parameters
    ----------
    name : str
        Name of the body, unique in the cell.
    shape : Shape
        Shape in coordinates of the frame, m.
    frame : int
        Index of the frame: 0 is the robot base, which does not move, i the link that joint i moves.
        With external axes, the frames that they carry come first, see
        `kerfpath.robots.CarriedChain`.
    kind : {"robot", "head", "part", "fixture", "floor"}
    approximate : bool
        Whether the shape replaces an unknown one, or is the hull around the real one.
    holds : bool
        Whether the shape encloses the real body. If not, clearance to the shape proves nothing
        about the body.
    """

    name: str
    shape: Shape
    frame: int
    kind: Kind
    approximate: bool = False
    holds: bool = True

    __repr__ = short_repr

    @property
    def size(self) -> Array:
        """Edges (3,) m of the box around the shape, along the axes of its frame."""
        corners = self.shape.corners
        return np.asarray(np.ptp(corners, axis=0) + 2 * self.shape.radius)


# -----------------------------------------------------------------------------
# Distances between many line segments, such as the axes of capsules, by a formula.

PARALLEL = 1e-12
"""Squared sine of the angle below which two segments are parallel, and nearest at an end."""


class CapsuleAxes:
    """The axes of capsules, each in a frame of an arm.

    Parameters
    ----------
    frames : (R,) int
        Frame of each capsule.
    capsules : sequence of Capsule

    Attributes
    ----------
    thick : (R,) m
        Radii of the capsules.
    """

    def __init__(self, frames: Sequence[int], capsules: Sequence[Capsule]) -> None:
        self._frames = np.array(frames, dtype=np.int64)
        self._start = np.array([c.start for c in capsules])
        self._along = np.array([c.end - c.start for c in capsules])
        self.thick = np.array([c.radius for c in capsules])

    def at(self, frames: Array) -> tuple[Array, Array]:
        """Return starts and vectors to the ends, (B, R, 3) m, at link poses (B, n+1, 4, 4)."""
        T = frames[:, self._frames]
        turned = T[..., :3, :3]
        start = (turned @ self._start[:, :, None])[..., 0] + T[..., :3, 3]
        return start, (turned @ self._along[:, :, None])[..., 0]


def segment_distances(p: Array, u: Array, q: Array, v: Array) -> Array:
    """Return distances (...) m between segments from p to p + u and from q to q + v, (..., 3) m."""
    uu, vv, uv = (u * u).sum(-1), (v * v).sum(-1), (u * v).sum(-1)
    ends = [
        _square_to_segment(p - q, v, vv), _square_to_segment(p + u - q, v, vv),
        _square_to_segment(q - p, u, uu), _square_to_segment(q + v - p, u, uu),
    ]  # fmt: skip
    # If the nearest points lie between the ends of both segments, their distance is smaller.
    w = p - q
    uw, vw = (u * w).sum(-1), (v * w).sum(-1)
    sine = uu * vv - uv**2
    skew = sine > PARALLEL * uu * vv
    whole = np.where(skew, sine, 1.0)
    s, t = (uv * vw - vv * uw) / whole, (uu * vw - uv * uw) / whole
    inside = skew & (s > 0) & (s < 1) & (t > 0) & (t < 1)
    between = w + s[..., None] * u - t[..., None] * v
    square = np.where(inside, (between**2).sum(-1), np.inf)
    return np.asarray(np.sqrt(np.minimum(np.min(ends, axis=0), square)))


def _square_to_segment(w: Array, v: Array, vv: Array) -> Array:
    """Return squared distances of points w from segments from the origin to v; vv is v . v."""
    t = np.clip((w * v).sum(-1) / np.where(vv > 0, vv, 1.0), 0.0, 1.0)
    return np.asarray(((w - t[..., None] * v) ** 2).sum(-1))


# -----------------------------------------------------------------------------
# Distances between bodies.

coal = imported("coal", "cells", "cells and their distances")

ACCURACY = 1e-6
"""m: accuracy at which coal stops; every bound made from distances subtracts it."""
THIN = 1e-5
"""m: thickness added to the box around a flat mesh, so that it is a solid."""

AT_ONCE = 500
"""Number of poses for which cheap bounds are computed together, limited by the caches."""


@dataclass(frozen=True, slots=True, eq=False)
class _Solid:
    """A body for coal: a geometry, its pose in the body's frame, and bounds around it."""

    geometry: Any
    place: Array
    frame: int
    centre: Array
    ball: float
    low: Array
    high: Array
    mesh: Mesh | None
    hull: Any
    seeds: Array


class Scene:
    """The bodies ready for distance queries.

    Parameters
    ----------
    bodies : sequence of Body
    pairs : (P, 2) int
        Indices of the bodies that are judged against each other; the frame of the first is not
        later than that of the second.
    still : int
        Index of the fixed frame, whose pose is always the identity.
    """

    round: Bools
    """(P,): whether a pair is two capsules, whose distance a formula gives."""

    def __init__(self, bodies: Sequence[Body], pairs: Ints, still: int) -> None:
        self._names = [body.name for body in bodies]
        self._solids = [_solid(body) for body in bodies]
        self._pairs = [(int(a), int(b)) for a, b in pairs]
        self._slack = np.array(
            [sum(_deviation(bodies[i].shape) for i in pair) for pair in self._pairs]
        )
        self._ends = np.array(self._pairs, np.int64).reshape(-1, 2).T
        self._frame = np.array([s.frame for s in self._solids])
        self._centre = np.array([s.centre for s in self._solids])
        self._low = np.array([s.low for s in self._solids])
        self._high = np.array([s.high for s in self._solids])
        ball = np.array([s.ball for s in self._solids])
        self._still = (self._frame[self._ends[0]] == still)[:, None]
        self._held = ball[self._ends[1]] + np.where(self._still[:, 0], 0.0, ball[self._ends[0]])
        with_mesh = [any(self._solids[i].mesh for i in pair) for pair in self._pairs]
        self._order = np.argsort(with_mesh, kind="stable")
        round_ = [all(isinstance(bodies[i].shape, Capsule) for i in pair) for pair in self._pairs]
        self.round = np.array(round_, dtype=np.bool_)
        self._lines = [
            CapsuleAxes([bodies[i].frame for i in side], [bodies[i].shape for i in side])
            for side in self._ends[:, self.round]
            if side.size
        ]
        self._request, self._result = coal.DistanceRequest(), coal.DistanceResult()
        self.queries = 0

    @property
    def order(self) -> Ints:
        """Indices (P,) of the pairs, those with meshes last, as they take longest."""
        return np.asarray(self._order)

    def distances(self, frames: Array, enough: float | Array, wanted: Bools | None = None) -> Array:
        """Return distances (B, P) m at link poses (B, n+1, 4, 4).

        Parameters
        ----------
        frames : (B, n+1, 4, 4)
        enough : float or (B, P) m
            Above it, any lower bound may be returned.
        wanted : (B, P) bool, optional
            Which distances to find; the others are NaN.
        """
        wanted = np.ones((len(frames), len(self._pairs)), bool) if wanted is None else wanted
        low, _ = self.bounds(frames, enough, wanted)
        return np.where(wanted, low, np.nan)

    def bounds(
        self, frames: Array, enough: float | Array, wanted: Bools, stop: Array | None = None
    ) -> tuple[Array, Array]:
        """Return distances (B, P) m, and upper bounds (B, P) m on them.

        The upper bound also holds for neighbours: a pair that has moved by at most delta is at most
        delta farther apart. It is infinite where only a lower bound was found.

        Parameters
        ----------
        frames, enough, wanted
            As in `distances`; pairs that are not wanted have cheap lower bounds.
        stop : (P,) m, optional
            If a pair is this close or closer, the others of its row need not be found.
        """
        low = self.cheap(frames)
        high = np.where(self.round, low, np.inf)
        enough = np.broadcast_to(np.asarray(enough, dtype=np.float64), low.shape)
        near = wanted & (low < enough) & ~self.round
        if stop is not None:
            near &= ~(wanted & self.round & (low <= stop)).any(axis=1, keepdims=True)
        for row in np.flatnonzero(near.any(axis=1)):
            poses: dict[int, Any] = {}
            for p in self._order[near[row, self._order]]:
                low[row, p], high[row, p] = self._pair(p, frames[row], poses, enough[row, p])
                if stop is not None and low[row, p] <= stop[p]:
                    break
        return low, high

    def pair_bounds(self, p: int, frames: Array, enough: Array) -> tuple[Array, Array]:
        """Return the result of `bounds` for pair p, (B,) m each, with `enough` (B,) m."""
        if self.round[p]:
            apart = self.cheap(frames)[:, p]
            return apart, apart
        found = [self._pair(p, T, {}, e) for T, e in zip(frames, enough.tolist(), strict=True)]
        low, high = np.array(found).reshape(-1, 2).T
        return low, high

    def cheap(self, frames: Array) -> Array:
        """Return lower bounds (B, P) m from balls around bodies and boxes around fixed ones.

        For `round` pairs, of two capsules, these are the distances themselves.
        """
        parts = range(0, max(len(frames), 1), AT_ONCE)
        return np.vstack([self._cheap(frames[i : i + AT_ONCE]) for i in parts])

    def _cheap(self, frames: Array) -> Array:
        a, b = self._ends
        T = frames[:, self._frame]
        centres = (T[..., :3, :3] @ self._centre[:, :, None])[..., 0] + T[..., :3, 3]
        there = np.where(
            self._still, np.clip(centres[:, b], self._low[a], self._high[a]), centres[:, a]
        )
        apart = centres[:, b] - there
        low = np.sqrt((apart**2).sum(axis=2)) - self._held - self._slack
        if self._lines:
            one, two = self._lines
            low[:, self.round] = (
                segment_distances(*one.at(frames), *two.at(frames)) - one.thick - two.thick
            )
        return np.asarray(low)

    def _pair(
        self, p: int, frames: Array, poses: dict[int, Any], enough: float
    ) -> tuple[float, float]:
        a, b = self._pairs[p]
        one, two = self._solids[a], self._solids[b]
        for i, solid in ((a, one), (b, two)):
            if i not in poses:
                T = frames[solid.frame] @ solid.place
                poses[i] = coal.Transform3s(T[:3, :3], T[:3, 3])
        if one.mesh is None and two.mesh is None:
            # The depth of an overlap of convex solids also changes by no more than they move.
            apart = self._query(one.geometry, poses[a], two.geometry, poses[b], p)
            return apart, apart
        around = self._query(one.hull, poses[a], two.hull, poses[b], p)
        if around >= enough:
            return around, np.inf
        slack = float(self._slack[p])
        apart = self._query(one.geometry, poses[a], two.geometry, poses[b], p)
        # What lies inside a mesh lies inside the box around it.
        nested = around <= -slack and apart > -slack
        if nested and (_inside(one, two, frames) or _inside(two, one, frames)):
            apart = -apart - 2 * slack
        return apart, max(apart, -slack)

    def _query(self, one: Any, T_one: Any, two: Any, T_two: Any, p: int) -> float:
        self._result.clear()
        self.queries += 1
        apart = coal.distance(one, T_one, two, T_two, self._request, self._result)
        if not np.isfinite(apart):
            a, b = (self._names[i] for i in self._pairs[p])
            raise InputError(
                f"cell: the distance between {a!r} and {b!r} came out as {apart}, which proves "
                "nothing clear; check their shapes"
            )
        return float(apart) - float(self._slack[p])


def _inside(inner: _Solid, outer: _Solid, frames: Array) -> bool:
    """Return whether a body that does not touch the surface of a mesh lies inside it."""
    if outer.mesh is None:
        return False
    T, into = frames[inner.frame], frames[outer.frame]
    seeds = inner.seeds @ T[:3, :3].T + T[:3, 3]
    return bool(outer.mesh.contains((seeds - into[:3, 3]) @ into[:3, :3]).any())


def _solid(body: Body) -> _Solid:
    shape: Shape = body.shape
    if isinstance(shape, Hull) and shape.crowded:
        # Coal has no such convex solid. Its surface bounds the same solid, but queries take longer.
        shape = Mesh(vertices=shape.points, triangles=shape.triangles, name=body.name)
    low, high = (f(shape.corners, axis=0) for f in (np.min, np.max))
    centre = (low + high) / 2
    geometry, place = _geometry(shape, body.name)
    mesh = shape if isinstance(shape, Mesh) else None
    around = geometry
    if mesh is not None:
        around = _convex(box_between(low - THIN, high + THIN))
    return _Solid(
        geometry=geometry,
        place=place,
        frame=body.frame,
        centre=centre,
        ball=float(np.linalg.norm(shape.corners - centre, axis=1).max()) + shape.radius,
        low=low - shape.radius,
        high=high + shape.radius,
        mesh=mesh,
        hull=around,
        seeds=shape.seeds,
    )


def _deviation(shape: Shape) -> float:
    return shape.deviation if isinstance(shape, Mesh) else 0.0


def _geometry(shape: Shape, name: str) -> tuple[Any, Array]:
    """Return a shape's coal geometry and the pose of its own coordinates in the body's frame."""
    if isinstance(shape, Hull):
        return _convex(shape), np.eye(4)
    if isinstance(shape, Capsule):
        return _capsule(shape)
    tree = coal.BVHModelOBBRSS()
    tree.beginModel(len(shape.triangles), len(shape.vertices))
    tree.addVertices(shape.vertices)
    tree.addTriangles(shape.triangles)
    tree.endModel()
    if tree.num_tris != len(shape.triangles):
        raise InputError(f"{name}: the collision library accepted only {tree.num_tris} triangles")
    return tree, np.eye(4)


def _convex(hull: Hull) -> Any:
    points, triangles = coal.StdVec_Vec3s(), coal.StdVec_Triangle()
    for point in hull.points:
        points.append(point)
    for corners in hull.triangles.tolist():
        triangles.append(coal.Triangle(*corners))
    return coal.Convex(points, triangles)


def _capsule(shape: Capsule) -> tuple[Any, Array]:
    """Return coal's capsule, which lies along z about the origin."""
    along = shape.end - shape.start
    length = float(np.linalg.norm(along))
    T = np.eye(4)
    T[:3, 3] = (shape.start + shape.end) / 2
    if length == 0:
        return coal.Sphere(shape.radius), T
    z = along / length
    x = np.cross(np.eye(3)[np.argmin(np.abs(z))], z)
    x /= np.linalg.norm(x)
    T[:3, :3] = np.array([x, np.cross(z, x), z]).T
    return coal.Capsule(shape.radius, length), T
