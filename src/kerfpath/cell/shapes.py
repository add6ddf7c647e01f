"""Solids: capsules, convex hulls, and closed triangle meshes, each in the frame of its body."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import ConvexHull, QhullError, cKDTree
from scipy.spatial.transform import Rotation

from kerfpath.arrays import Array, Ints, as_pose, floats, freeze, positive, scalar, short_repr
from kerfpath.cell.mesh import Mesh
from kerfpath.errors import InputError

RING = 24
"""Corners of the polygon drawn around a circle; it projects by less than 1 % of the radius."""
SAME_CORNER = 1e-7
"""m: corners that differ by less are the same, except for rounding."""

MOST_NEIGHBOURS = 254
"""Most neighbours of a corner of a convex solid in coal, which counts them in a byte."""
CORNERS = 64
"""A hull with more corners is bounded along motions by the box around it, which has far fewer and
is hardly larger."""
BALL = 48
"""Number of points on each ball from which a capsule is drawn."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Capsule:
    """A ball swept along a line segment; a ball if both ends are the same.

    Parameters
    ----------
    start, end : (3,) m
        Ends of the line.
    radius : float m
    """

    start: Array
    end: Array
    radius: float

    __repr__ = short_repr

    def __post_init__(self) -> None:
        for name in ("start", "end"):
            object.__setattr__(self, name, floats(getattr(self, name), f"capsule {name}", (3,)))
        object.__setattr__(self, "radius", scalar(self.radius, "radius", unit="m", above=0.0))

    @property
    def corners(self) -> Array:
        """Points (c, 3) m whose hull, swept by the radius, holds the shape."""
        return freeze(np.array([self.start, self.end]))

    @property
    def seeds(self) -> Array:
        """A point (1, 3) m inside."""
        return freeze((self.start + self.end)[None] / 2)

    def moved(self, T: ArrayLike) -> Capsule:
        """Return the shape in coordinates b of a pose T (4, 4) that maps its own into b."""
        start, end = _moved(self.corners, T)
        return Capsule(start=start, end=end, radius=self.radius)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Hull:
    """The convex hull of points (P, 3) m that do not lie in one plane.

    If the points are rings of `RING` evenly spaced corners about a line, `axis` (2, 3) m may be two
    points of that line: the solid is then known to be almost round.

    Raises
    ------
    InputError
        Fewer than four points, points in one plane, or an axis that the points do not fit.
    """

    points: Array
    triangles: Ints
    axis: Array | None

    __repr__ = short_repr

    def __init__(self, points: ArrayLike, *, axis: ArrayLike | None = None) -> None:
        given = floats(points, "hull points", (None, 3))
        try:
            hull = ConvexHull(given)
        except (QhullError, ValueError):
            raise InputError(
                f"hull: expected 4 points or more that do not lie in one plane, got {len(given)}"
            ) from None
        kept = hull.vertices
        place = np.full(len(given), -1)
        place[kept] = np.arange(len(kept))
        a, b, c = (given[hull.simplices[:, i]] for i in range(3))
        inward = (np.cross(b - a, c - a) * hull.equations[:, :3]).sum(1) < 0
        corners = np.where(inward[:, None], hull.simplices[:, ::-1], hull.simplices)
        object.__setattr__(self, "points", freeze(given[kept]))
        object.__setattr__(self, "triangles", freeze(place[corners]))
        object.__setattr__(self, "axis", None if axis is None else _axis(axis, given))

    @property
    def radius(self) -> float:
        """Zero: nothing is swept around the points."""
        return 0.0

    @property
    def corners(self) -> Array:
        """Points (c, 3) m whose hull holds the shape: its own, or those of the box around many."""
        if len(self.points) <= CORNERS:
            return self.points
        return box_between(self.points.min(axis=0), self.points.max(axis=0)).points

    @property
    def seeds(self) -> Array:
        """A point (1, 3) m inside."""
        return freeze(self.points.mean(axis=0, keepdims=True))

    @property
    def crowded(self) -> bool:
        """Whether a corner has too many neighbours for coal's convex solids, as a cone's tip."""
        # A corner of a closed surface has as many triangles as neighbours.
        return int(np.bincount(self.triangles.ravel()).max()) > MOST_NEIGHBOURS

    def moved(self, T: ArrayLike) -> Hull:
        """Return the shape in coordinates b of a pose T (4, 4) that maps its own into b."""
        axis = None if self.axis is None else _moved(self.axis, T)
        return Hull(_moved(self.points, T), axis=axis)


Shape = Capsule | Hull | Mesh


def surface(shape: Shape) -> tuple[Array, Ints]:
    """Return vertices (V, 3) m and triangles (F, 3) for drawing a shape; balls have few corners."""
    if isinstance(shape, Mesh):
        return shape.vertices, shape.triangles
    if isinstance(shape, Capsule):
        k = np.arange(BALL) + 0.5
        z, turn = 1 - 2 * k / BALL, np.pi * (1 + np.sqrt(5)) * k  # evenly spread, by Fibonacci
        ring = np.sqrt(1 - z**2)
        ball = shape.radius * np.c_[ring * np.cos(turn), ring * np.sin(turn), z]
        shape = Hull(np.vstack([shape.start + ball, shape.end + ball]))
    return shape.points, shape.triangles


def box(size: ArrayLike, T: ArrayLike | None = None) -> Hull:
    """Return a box with edges `size` (3,) m, centred at the origin of pose T (4, 4) m."""
    half = positive(size, "box size", (3,)) / 2
    whole = box_between(-half, half)
    return whole if T is None else whole.moved(T)


def box_between(low: ArrayLike, high: ArrayLike) -> Hull:
    """Return the box along the axes between two opposite corners `low` and `high` (3,) m."""
    a, b = floats(low, "box corner", (3,)), floats(high, "box corner", (3,))
    if not (a < b).all():
        raise InputError(f"box: {a.tolist()} must lie below {b.tolist()} on every axis")
    return Hull(np.array(np.meshgrid(*np.array([a, b]).T)).reshape(3, -1).T)


def cylinder(size: ArrayLike, T: ArrayLike | None = None) -> Hull:
    """Return a solid that holds a cylinder, its diameter and height `size` (2,) m, as `frustum`.

    Its axis is the z axis of pose T (4, 4) m, with its middle at the origin.
    """
    diameter, height = positive(size, "cylinder size", (2,))
    end = np.array([0.0, 0.0, height / 2])
    whole = frustum(-end, end, (diameter / 2, diameter / 2))
    return whole if T is None else whole.moved(T)


def frustum(start: ArrayLike, end: ArrayLike, radii: tuple[float, float]) -> Hull:
    """Return a truncated cone from `start` to `end` (3,) m with a radius (m) at each end.

    Each circle is replaced by a polygon of 24 corners around it, so that the solid holds the cone.

    Raises
    ------
    InputError
        Both ends at the same point, or a radius that is not positive.
    """
    a, b = floats(start, "frustum start", (3,)), floats(end, "frustum end", (3,))
    radii = tuple(positive(radii, "frustum radii", (2,)))
    length = float(np.linalg.norm(b - a))
    if length == 0:
        raise InputError("frustum: both ends are the same point")
    axis = (b - a) / length
    u = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    u /= np.linalg.norm(u)
    turn = np.arange(RING) * 2 * np.pi / RING
    ring = (np.cos(turn)[:, None] * u + np.sin(turn)[:, None] * np.cross(axis, u)) / np.cos(
        np.pi / RING
    )
    return Hull(np.vstack([a + radii[0] * ring, b + radii[1] * ring]), axis=[a, b])


def _axis(value: ArrayLike, points: Array) -> Array:
    """Return the axis (2, 3) m of a hull; a turn by one corner maps the points to themselves."""
    axis = floats(value, "hull axis", (2, 3))
    along = axis[1] - axis[0]
    turn = Rotation.from_rotvec(2 * np.pi / RING * along / np.linalg.norm(along))
    off, _ = cKDTree(points).query(turn.apply(points - axis[0]) + axis[0])
    if not np.max(off) < SAME_CORNER:
        raise InputError(
            f"hull axis: the points are not rings of {RING} evenly spaced corners about it"
        )
    return axis


def _moved(points: Array, T: ArrayLike) -> Array:
    pose = as_pose(T, "pose")
    return np.asarray(points @ pose[:3, :3].T + pose[:3, 3])
