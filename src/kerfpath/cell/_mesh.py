"""Closed triangle meshes as solids: checks, welding, and which points lie inside.

Collision libraries see only the triangles: to them, a body deep inside a closed mesh is clear. A
body that does not touch the surface is entirely inside or outside, so one of its points decides.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from kerfpath._arrays import Array, Bools, Ints, as_pose, floats, freeze, integers, not_negative
from kerfpath._repr import short_repr
from kerfpath.cell._columns import TriangleColumns
from kerfpath.cell._sheet import edges_of
from kerfpath.errors import InputError

__all__ = ["SAME", "Mesh", "size_of", "weld"]

LARGEST = 100.0
"""m: a mesh larger than this has the wrong unit."""
SMALLEST = 1e-4
"""m: a mesh smaller than this has the wrong unit."""
SAME = 1e-6
"""Vertices closer than this share of the body's size are one, as files have single precision."""
CROWDED = 64
"""Average number of vertices within the tolerance of each that welding accepts; memory grows with
it."""
MOST = 2_000_000
"""Largest number of triangles; more take minutes and gigabytes, and no cell needs them."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Mesh:
    """The solid inside a closed surface of triangles.

    Parameters
    ----------
    vertices : (V, 3) m
    triangles : (F, 3) int
        Vertices of each triangle; neighbours run through a common edge in opposite directions.
    deviation : float m
        How far the true surface may be from the triangles; it is subtracted from distances.
    name : str
        Name in messages.

    Raises
    ------
    InputError
        No triangles or too many, a size that no body of a cell has, a surface that is not closed.
    """

    vertices: Array
    triangles: Ints
    deviation: float = 0.0
    name: str = "mesh"
    _columns: TriangleColumns = field(init=False, repr=False)

    __repr__ = short_repr

    def __post_init__(self) -> None:
        _set, name = object.__setattr__, self.name
        _set(self, "vertices", floats(self.vertices, f"{name} vertices", (None, 3)))
        _set(self, "triangles", integers(self.triangles, f"{name} triangles", (None, 3)))
        _set(self, "deviation", not_negative(self.deviation, f"{name} deviation", unit="m"))
        size_of(self.vertices, self.triangles, name)
        _require_closed(self.triangles, name)
        _set(self, "_columns", TriangleColumns(self.vertices[self.triangles]))

    @property
    def radius(self) -> float:
        """Zero: nothing is swept around the vertices."""
        return 0.0

    @property
    def bounds(self) -> Array:
        """Least and greatest coordinates, (2, 3) m."""
        return np.array([self._columns.low, self._columns.high])

    @property
    def corners(self) -> Array:
        """The corners (8, 3) m of the box around the mesh."""
        return freeze(np.array(np.meshgrid(*self.bounds.T)).reshape(3, -1).T)

    @property
    def seeds(self) -> Array:
        """One point (s, 3) m of each connected piece."""
        edges = self.triangles[:, [0, 1]], self.triangles[:, [1, 2]]
        pairs = np.vstack(edges)
        V = len(self.vertices)
        links = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(V, V))
        _, piece = connected_components(links, directed=False)
        _, first = np.unique(piece[self.triangles[:, 0]], return_index=True)
        return freeze(self.vertices[self.triangles[first, 0]])

    def moved(self, T: ArrayLike) -> Mesh:
        """Return the mesh in the coordinates b that a pose T (4, 4) m maps its own to."""
        pose = as_pose(T, "pose")
        return Mesh(
            vertices=self.vertices @ pose[:3, :3].T + pose[:3, 3],
            triangles=self.triangles,
            deviation=self.deviation,
            name=self.name,
        )

    def contains(self, points: Array) -> Bools:
        """Return which of the points (m, 3) m, none of them on the surface, lie inside."""
        return freeze(np.array([self._columns.contains(p) for p in points], dtype=np.bool_))

    def cut(self, point: Array, normal: Array) -> tuple[Mesh | None, Mesh | None]:
        """Return the parts of the solid in front of and behind a plane, None for an empty part.

        Parameters
        ----------
        point : (3,) m
            Point in the plane.
        normal : (3,)
            Unit normal, towards the front.
        """
        height = (self.vertices - point) @ normal
        return self._above(height), self._above(-height)

    def _above(self, height: Array) -> Mesh | None:
        """Return the part where the height (V,) m of the vertices above a plane is positive.

        Triangles from the rim to one point of the plane close the section: for any outline, areas
        that they cover twice are covered in opposite directions.
        """
        inside = height > 0
        if inside.all() or not inside.any():
            return self if inside.any() else None
        count = inside[self.triangles].sum(axis=1)
        cut = self.triangles[(count == 1) | (count == 2)]
        alone = inside[cut] == (inside[cut].sum(axis=1) == 1)[:, None]
        # Rotated so that the first corner is the one that is alone on its side.
        turn = (np.argmax(alone, axis=1)[:, None] + np.arange(3)) % 3
        cut = np.take_along_axis(cut, turn, axis=1)
        edges = np.sort(cut[:, [[0, 1], [0, 2]]].reshape(-1, 2), axis=1)
        edges, place = np.unique(edges, axis=0, return_inverse=True)
        one, two = edges.T
        share = (height[one] / (height[one] - height[two]))[:, None]
        rim = self.vertices[one] + share * (self.vertices[two] - self.vertices[one])
        V, (first, b, c) = len(self.vertices), cut.T
        ab, ac = (V + place.reshape(-1, 2)).T
        centre = np.full(len(cut), V + len(rim))
        top, tail = inside[first], ~inside[first]
        triangles = [
            self.triangles[count == 3],
            np.array([first, ab, ac]).T[top],
            np.array([ac, ab, centre]).T[top],
            np.array([ab, b, c]).T[tail],
            np.array([ab, c, ac]).T[tail],
            np.array([ab, ac, centre]).T[tail],
        ]
        points = np.vstack([self.vertices, rim, rim.mean(axis=0)])
        size = float(np.ptp(self.bounds, axis=0).max())
        vertices, corners = weld(points, np.vstack(triangles), SAME * size)
        used, corners = np.unique(corners, return_inverse=True)
        return Mesh(
            vertices=vertices[used],
            triangles=corners.reshape(-1, 3),
            deviation=self.deviation,
            name=self.name,
        )


def size_of(vertices: Array, triangles: Ints, name: str) -> float:
    """Return the longest side (m) of the box around the triangles.

    Raises
    ------
    InputError
        No triangles or too many, a vertex index out of range, a size that no body of a cell has.
    """
    if not 0 < len(triangles) <= MOST:
        raise InputError(
            f"{name}: expected 1 to {MOST} triangles, got {len(triangles)}; "
            + ("simplify the mesh" if len(triangles) else "the mesh is empty")
        )
    if triangles.min() < 0 or triangles.max() >= len(vertices):
        raise InputError(f"{name}: a triangle refers to a vertex that does not exist")
    with np.errstate(over="ignore", invalid="ignore"):
        size = float(np.ptp(vertices[triangles.ravel()], axis=0).max())
    if not SMALLEST <= size <= LARGEST:
        raise InputError(
            f"{name}: {size:g} m across, expected {SMALLEST:g} to {LARGEST:g} m; is its unit right?"
        )
    return size


def weld(
    vertices: ArrayLike, triangles: ArrayLike, tolerance: float, name: str = "mesh"
) -> tuple[Array, Ints]:
    """Merge the vertices of a mesh that are closer than `tolerance` (m), and remove slivers.

    Parameters
    ----------
    vertices : (V, 3) m
    triangles : (F, 3) int
    tolerance : float m
    name : str
        Name in messages.

    Raises
    ------
    InputError
        Too many vertices within the tolerance of each other.
    """
    points = floats(vertices, "vertices", (None, 3))
    corners = integers(triangles, "triangles", (None, 3))
    if not len(points):
        return points, corners
    # An STL file repeats each vertex for each triangle: identical ones need no search.
    points, same = np.unique(points, axis=0, return_inverse=True)
    corners = same.reshape(-1)[corners]
    tree = cKDTree(points)
    if (count := int(tree.count_neighbors(tree, tolerance))) > CROWDED * len(points):
        raise InputError(
            f"{name}: its vertices are too close together, on average {count // len(points)} of "
            f"them within {tolerance:.3g} m of each; simplify the mesh"
        )
    pairs = tree.query_pairs(tolerance, output_type="ndarray")
    links = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(points),) * 2)
    _, one = connected_components(links, directed=False)
    _, first = np.unique(one, return_index=True)
    corners = one[corners].astype(np.int64)
    slivers = (corners == np.roll(corners, 1, axis=1)).any(axis=1)
    return freeze(points[first]), freeze(corners[~slivers])


def _require_closed(triangles: Ints, name: str) -> None:
    """Raise InputError unless every edge is used equally often in both directions."""
    edges, open_ = edges_of(triangles)
    if count := np.count_nonzero(open_):
        raise InputError(
            f"{name}: the surface is not closed, {count} of its {len(edges)} edges have a triangle "
            "on one side only, so its inside is not defined; repair the mesh"
        )
