"""Meshes of files and of other packages as solids; the caller gives their unit."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from kerfpath._arrays import Array, Ints, floats, integers, require_one_of
from kerfpath._extras import imported
from kerfpath.apart import call_apart
from kerfpath.cell._mesh import SAME, Mesh, size_of, weld
from kerfpath.errors import InputError

__all__ = ["UNITS", "close_surface", "mesh_of", "read_stl", "read_surface"]

UNITS = {"mm": 1e-3, "cm": 1e-2, "m": 1.0, "in": 0.0254}
"""Metres in each unit."""

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


def read_stl(path: str | Path, unit: str) -> Mesh:
    """Return the solid in an STL file whose numbers are in `unit`: mm, cm, m or in.

    Raises
    ------
    InputError
        An unknown unit, a file that cannot be read or is cut short, or a mesh that `Mesh` refuses.
    """
    path = Path(path)
    if unit not in UNITS:
        raise InputError(
            f"{path.name}: an STL file does not state its unit; expected one of "
            f"{', '.join(UNITS)}, got {unit!r}"
        )
    return close_surface(*_stl(_bytes(path), path.name), UNITS[unit], path.name)


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
    points, triangles = weld(points, triangles, SAME * size, name)
    return Mesh(vertices=points, triangles=triangles, name=name)


def read_surface(path: Path, name: str) -> tuple[Array, Ints]:
    """Return vertices (V, 3) and triangles (F, 3) of an STL, COLLADA (.dae) or Wavefront file.

    Vertices are in the file's own unit; those of a COLLADA file, which states its unit, are in m.
    Like other readers of robot descriptions, this one ignores the up axis of a COLLADA file.

    Raises
    ------
    InputError
        Another format, a file that cannot be read or is cut short, a number that is not finite.
    """
    if path.suffix.lower() == ".stl":
        return _stl(_bytes(path), name)
    if path.suffix.lower() in (".dae", ".obj"):
        return _load_with_coal(path, name)
    raise InputError(f"{name}: expected a mesh as .stl, .dae or .obj, got {path.suffix!r}")


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
