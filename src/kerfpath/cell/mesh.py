"""Closed triangle meshes as solids, read from files or taken from other packages."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from kerfpath.arrays import (
    Array,
    Bools,
    Ints,
    as_pose,
    floats,
    freeze,
    integers,
    not_negative,
    places_within,
    require_one_of,
    scalar,
    short_repr,
)
from kerfpath.errors import InputError
from kerfpath.extras import imported
from kerfpath.isolated import call_apart

# -----------------------------------------------------------------------------
# Test whether points are inside a closed surface, by the triangles that an upward line crosses.
#
# Triangles are sorted into columns along z, so that a line meets only a few of them. If it passes
# too close to an edge, the winding number over all triangles decides: the solid angle of the
# surface is a full one from inside and zero from outside (van Oosterom and Strackee 1983).

CLOSE = 1e-9
"""Twice the area of a triangle that is too thin to count, as a share of the body's size squared."""
MOST_COLUMNS = 256
"""Largest number of columns along x and along y."""
SPREAD = 64
"""Columns that a triangle may be in on average; with wide triangles there are fewer columns."""


class TriangleColumns:
    """Triangles with corners (F, 3, 3) m, sorted into columns by x and y."""

    def __init__(self, corners: Array) -> None:
        self._corners = corners
        self.low, self.high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
        size = self.high - self.low
        self._close = CLOSE * float(size.max()) ** 2
        n = int(np.clip(np.sqrt(len(corners)), 1, MOST_COLUMNS))
        while True:
            self._n, self._step = n, np.maximum(size[:2] / n, 1e-300)
            first = self._column(corners[..., :2].min(axis=1))
            wide = self._column(corners[..., :2].max(axis=1)) - first + 1
            count = wide.prod(axis=1)
            if count.sum() <= SPREAD * len(corners):  # as it is with n = 1 at the latest
                break
            n //= 2
        triangle = np.repeat(np.arange(len(corners)), count)
        place = places_within(count)
        x, y = first[triangle].T + np.divmod(place, wide[triangle, 1])
        key = x * n + y
        order = np.argsort(key, kind="stable")
        self._triangle = triangle[order]
        self._start = np.searchsorted(key[order], np.arange(n * n + 1))

    def contains(self, point: Array) -> bool:
        """Return whether a point (3,) m that is not on the surface lies inside."""
        if not ((point > self.low) & (point < self.high)).all():
            return False
        x, y = self._column(point[:2])
        a, b = self._start[x * self._n + y : x * self._n + y + 2]
        corners = self._corners[self._triangle[a:b]] - point
        (ax, ay, az), (bx, by, bz), (cx, cy, cz) = np.moveaxis(corners, 0, 2)
        areas = np.array([bx * cy - by * cx, cx * ay - cy * ax, ax * by - ay * bx])
        least, most = areas.min(axis=0), areas.max(axis=0)
        over, under = least > self._close, most < -self._close
        if (((least > -self._close) & ~over) | ((most < self._close) & ~under)).any():
            return self._winds(point)
        hit = over | under
        height = (areas * np.array([az, bz, cz])).sum(axis=0)[hit] / areas.sum(axis=0)[hit]
        return bool(np.where(over[hit], 1, -1)[height > 0].sum() != 0)

    def _column(self, xy: Array) -> Ints:
        column = ((xy - self.low[:2]) / self._step).astype(np.int64)
        return np.asarray(np.clip(column, 0, self._n - 1))

    def _winds(self, point: Array) -> bool:
        a, b, c = np.moveaxis(self._corners - point, 1, 0)
        la, lb, lc = (np.linalg.norm(x, axis=1) for x in (a, b, c))
        volume = (a * np.cross(b, c)).sum(1)
        base = la * lb * lc + (a * b).sum(1) * lc + (b * c).sum(1) * la + (c * a).sum(1) * lb
        turns = np.arctan2(volume, base).sum() / (2 * np.pi)
        return not abs(turns) < 0.5


# -----------------------------------------------------------------------------
# Turn a sheet that is drawn as a surface into a closed solid.


def edges_of(triangles: Ints) -> tuple[Ints, Ints]:
    """Return the edges (E, 2) of triangles (F, 3), and how often (E,) each is left open.

    That is how many more triangles use the edge in its given direction than in the opposite one;
    a closed surface leaves no edge open.
    """
    edges = np.vstack([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    forward = edges[:, 0] < edges[:, 1]
    keys, place = np.unique(np.sort(edges, axis=1), axis=0, return_inverse=True)
    balance = np.bincount(place.ravel(), np.where(forward, 1, -1), len(keys)).astype(np.int64)
    keys = np.where(balance[:, None] < 0, keys[:, ::-1], keys)
    return freeze(keys), freeze(np.abs(balance))


def thicken(vertices: ArrayLike, triangles: ArrayLike, thickness: float) -> tuple[Array, Ints]:
    """Return the closed mesh of a sheet, with the material behind the given surface.

    Parameters
    ----------
    vertices : (V, 3) m
    triangles : (F, 3) int
        Counter-clockwise about the normals of the drawn side.
    thickness : float m
        Distance of the other side, along the mean normal of the triangles of each vertex; at sharp
        bends, the sheet is therefore thinner.

    Raises
    ------
    InputError
        A thickness that is not positive; triangles at a vertex that face each other.
    """
    front = floats(vertices, "vertices", (None, 3))
    corners = integers(triangles, "triangles", (None, 3))
    depth = scalar(thickness, "thickness", unit="m", above=0.0)
    a, b, c = (front[corners[:, i]] for i in range(3))
    normal = np.zeros_like(front)
    for i in range(3):
        np.add.at(normal, corners[:, i], np.cross(b - a, c - a))
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    used = np.unique(corners)
    if not (length[used] > 0).all():
        raise InputError("sheet: its triangles face each other at a vertex; repair the surface")
    back = front - depth * normal / np.where(length > 0, length, 1.0)
    V = len(front)
    start, end = np.repeat(*edges_of(corners), axis=0).T
    walls = [np.c_[end, start, start + V], np.c_[end, start + V, end + V]]
    return freeze(np.vstack([front, back])), freeze(
        np.vstack([corners, corners[:, ::-1] + V, *walls])
    )


# -----------------------------------------------------------------------------
# Closed triangle meshes as solids: checks, welding, and which points lie inside.
#
# Collision libraries see only the triangles: to them, a body deep inside a closed mesh is clear.
# A body that does not touch the surface is entirely inside or outside, so one of its points
# decides.

LARGEST = 100.0
"""m: a mesh larger than this has the wrong unit."""
SMALLEST = 1e-4
"""m: a mesh smaller than this has the wrong unit."""
SAME_VERTEX = 1e-6
"""Vertices closer than this share of the body's size are one, as files have single precision."""
CROWDED = 64
"""Average number of vertices within the tolerance of each that welding accepts; memory grows with
it."""
MOST_TRIANGLES = 2_000_000
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
        vertices, corners = weld(points, np.vstack(triangles), SAME_VERTEX * size)
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
    if not 0 < len(triangles) <= MOST_TRIANGLES:
        raise InputError(
            f"{name}: expected 1 to {MOST_TRIANGLES} triangles, got {len(triangles)}; "
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


# -----------------------------------------------------------------------------
# Meshes of files and of other packages; the caller gives their unit.

UNITS = {"mm": 1e-3, "cm": 1e-2, "m": 1.0, "in": 0.0254}
"""Metres in each unit."""
MESHES = (".stl", ".obj", ".ply")
"""Suffixes of meshes whose unit is not in the file."""

_RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_UNIT = re.compile(rb"<unit\b[^>]*?\bmeter\s*=\s*[\"']\s*([0-9.eE+-]+)")
_VERTEX = re.compile(rb"vertex\s+(\S+)\s+(\S+)\s+(\S+)", re.IGNORECASE)


class TriangleMesh(Protocol):
    """A mesh as trimesh and others have it."""

    @property
    def vertices(self) -> ArrayLike:
        """Vertices (V, 3)."""

    @property
    def faces(self) -> ArrayLike:
        """Indices (F, 3) of the vertices of each triangle."""


def read_mesh(path: str | Path, unit: str) -> Mesh:
    """Return the solid in an STL, OBJ or PLY file whose numbers are in `unit`: mm, cm, m or in.

    Raises
    ------
    InputError
        An unknown unit, another format, a file that cannot be read or is cut short, or a mesh that
        `Mesh` refuses.
    """
    path = Path(path)
    if unit not in UNITS:
        raise InputError(
            f"{path.name}: a mesh does not state its unit; expected one of {', '.join(UNITS)}, "
            f"got {unit!r}"
        )
    if path.suffix.lower() not in MESHES:
        raise InputError(
            f"{path.name}: expected a mesh as {', '.join(MESHES)}, got {path.suffix!r}"
        )
    return close_surface(*read_surface(path, path.name), UNITS[unit], path.name)


def mesh_of(mesh: TriangleMesh, unit: str, name: str = "mesh") -> Mesh:
    """Return the solid in a mesh in memory of another package, such as trimesh.

    Parameters
    ----------
    mesh : object with `vertices` (V, 3) and `faces` (F, 3)
        Other attributes, such as a unit or a pose, are ignored.
    unit : {"mm", "cm", "m", "in"}
        Unit of the vertices.
    name : str
        Name in messages.

    Raises
    ------
    InputError
        An unknown unit, no such mesh, faces with more than three corners, a number that is not
        finite, or a mesh that `Mesh` refuses.
    """
    require_one_of(unit, f"{name}: unit", UNITS)
    try:
        given, faces = mesh.vertices, mesh.faces
    except AttributeError:
        raise InputError(
            f"{name}: expected a mesh with vertices and faces, got {type(mesh).__name__}"
        ) from None
    vertices = floats(given, f"{name} vertices", (None, 3))
    triangles = integers(faces, f"{name} faces", (None, 3))
    return close_surface(vertices, triangles, UNITS[unit], name)


def close_surface(vertices: Array, triangles: Ints, scale: Array | float, name: str) -> Mesh:
    """Return the solid inside a surface, scaled and with coincident vertices welded."""
    with np.errstate(over="ignore"):  # infinite values are refused for their size
        points = vertices * scale
    size = size_of(points, triangles, name)
    points, triangles = weld(points, triangles, SAME_VERTEX * size, name)
    return Mesh(vertices=points, triangles=triangles, name=name)


def read_surface(path: Path, name: str) -> tuple[Array, Ints]:
    """Return vertices (V, 3) and triangles (F, 3) of an STL, COLLADA (.dae), OBJ or PLY file.

    Vertices are in the file's own unit; those of a COLLADA file, which states its unit, are in m.
    Like other readers of robot descriptions, this one ignores the up axis of a COLLADA file.

    Raises
    ------
    InputError
        Another format, a file that cannot be read or is cut short, a number that is not finite.
    """
    if path.suffix.lower() == ".stl":
        return _stl(_bytes(path), name)
    if path.suffix.lower() in (".dae", ".obj", ".ply"):
        return _load_with_coal(path, name)
    raise InputError(f"{name}: expected a mesh as .stl, .dae, .obj or .ply, got {path.suffix!r}")


def _bytes(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None


def _stl(data: bytes, name: str) -> tuple[Array, Ints]:
    corners = _corners(data, name)
    if not len(corners):
        raise InputError(f"{name}: the mesh is empty: it has no triangles")
    if not np.isfinite(corners).all():
        raise InputError(f"{name}: a vertex is not a finite number; export the mesh again")
    return corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3)


def _load_with_coal(path: Path, name: str) -> tuple[Array, Ints]:
    """Return what the collision library reads, scaled by the unit of COLLADA, which it ignores."""
    content = _bytes(path)
    unit = _UNIT.search(content) if path.suffix.lower() == ".dae" else None
    try:
        scale = 1.0 if unit is None else float(unit[1])
        vertices, triangles = call_apart(load_mesh, str(path.absolute()), scale, size=len(content))
    except InputError as error:
        raise InputError(f"{name}: {error}") from None
    except ValueError:
        raise InputError(
            f"{name}: the mesh cannot be read as {path.suffix}; export it again"
        ) from None
    if not np.isfinite(vertices).all():
        raise InputError(f"{name}: a vertex is not a finite number; export the mesh again")
    return vertices, triangles


def load_mesh(path: str, scale: float) -> tuple[Array, Ints]:
    """Return the vertices (V, 3), scaled, and triangles (F, 3) of a mesh file; may crash."""
    coal = imported("coal", "cells", "meshes of bodies")
    mesh = coal.MeshLoader().load(path, np.full(3, scale))
    found = [[mesh.tri_indices(i)[k] for k in range(3)] for i in range(mesh.num_tris)]
    return np.array(mesh.vertices()), np.array(found, np.int64).reshape(-1, 3)


def _corners(data: bytes, name: str) -> Array:
    """Return the corners (F, 3, 3) of every triangle, in the file's own unit."""
    if len(data) >= 84:
        count = int.from_bytes(data[80:84], "little")
        if len(data) == 84 + count * _RECORD.itemsize:
            return np.frombuffer(data, _RECORD, count, 84)["corners"].astype(np.float64)
    if not data.lstrip()[:5].lower() == b"solid":
        raise InputError(f"{name}: neither a text STL nor a complete binary one; export it again")
    if b"endsolid" not in data.lower():
        raise InputError(f"{name}: the text STL is cut short, 'endsolid' is missing")
    try:
        numbers = np.array(_VERTEX.findall(data), dtype=np.float64)
    except ValueError:
        raise InputError(f"{name}: a vertex is not three numbers") from None
    if len(numbers) % 3:
        raise InputError(f"{name}: {len(numbers)} vertices do not make whole triangles")
    return numbers.reshape(-1, 3, 3)
