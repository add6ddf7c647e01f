"""Loops of triangle meshes: around their open border, and around faces between sharp edges."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from kerfpath.arrays import Array, Ints, freeze
from kerfpath.cad.build import kind_of_points, named_loops, part_without_faces
from kerfpath.cad.curves import Points, Trace, label_connected
from kerfpath.cad.part import Kind, Part
from kerfpath.cad.units import LARGEST, MM, UNITS_MM
from kerfpath.cell import read_surface, weld
from kerfpath.contour import angle_between, unit
from kerfpath.errors import InputError

SHARP = float(np.radians(25))
"""rad: edges between triangles that turn by more bound faces."""
WELDED = 1e-6
"""Distance within which vertices are one, as a share of the size of the mesh."""
MOST = 300_000
"""Most triangles that are read."""
MOST_FACES = 2_000
"""Most faces: a mesh with more is rough, and its loops would be those of its noise."""
WHOLE = "mesh"
"""Name of the whole surface, of which the faces are pieces if it is open."""


def read_mesh(path: Path, length_unit: str | None, gap: float) -> Part:
    """Return the loops of a triangle mesh: STL, OBJ or PLY.

    Raises
    ------
    InputError
        No unit given, a file that cannot be read, too many triangles or faces, no loop.
    """
    if length_unit is None:
        raise InputError(f"states no length unit; give it with unit= one of {', '.join(UNITS_MM)}")
    vertices, triangles = read_surface(path, path.name)
    if not 0 < len(triangles) <= MOST:
        raise InputError(f"expected 1 to {MOST} triangles, got {len(triangles)}; simplify the mesh")
    vertices = vertices * UNITS_MM[length_unit]
    if not (np.abs(vertices) <= LARGEST).all():
        raise InputError(f"reaches further than {LARGEST / 1e6:g} km; check its unit")
    size = float(np.ptp(vertices, axis=0).max())
    points, corners = weld(vertices, triangles, WELDED * size, path.name)
    one, other = (points[corners[:, k]] - points[corners[:, 0]] for k in (1, 2))
    across = np.cross(one, other)
    area = np.linalg.norm(across, axis=1)
    corners, across = corners[area > 0], across[area > 0]
    normals = unit(across, "triangles") if len(across) else across
    edges = _Edges(corners)
    smooth = edges.pairs[angle_between(*(normals[edges.pairs[:, k]] for k in (0, 1))) <= SHARP]
    face = label_connected(smooth, len(corners))
    _, first, face = np.unique(face, return_index=True, return_inverse=True)
    order = np.argsort(np.argsort(first))  # faces are numbered by their first triangles
    face = order[face]
    count = int(face.max(initial=-1)) + 1
    if count > MOST_FACES:
        raise InputError(
            f"has {count} faces between edges sharper than {np.degrees(SHARP):.0f} deg, at most "
            f"{MOST_FACES} are read; smooth the mesh"
        )
    loops = []
    body = np.zeros(len(corners), dtype=np.int64)
    is_open = len(edges.free) > 0
    for name, group, own in (
        *([(WHOLE, body, 0)] if is_open else []),
        *((f"face{k + 1}", face, k) for k in range(count if count > 1 or not is_open else 0)),
    ):
        found: list[tuple[Kind, Trace, str]] = []
        beside = _normals(corners[group == own], across[group == own], len(points))
        for ring in edges.rings(group, own):
            normals = unit(beside[ring], "normals")
            trace = Points(points=points[ring], normals=normals, is_closed=True)
            found.append((kind_of_points(trace), trace, ""))
        named = named_loops(found, face=name, surface="mesh", gap=gap, layer="")
        skin = WHOLE if is_open and name != WHOLE else ""
        loops += [replace(loop, skin=skin) for loop in named]
    if not loops:
        raise InputError(
            "is a closed surface without sharp edges, so nothing bounds a cut; draw the cut as a "
            "curve, or cut the mesh off there"
        )
    part = part_without_faces(path, length_unit, loops, gap=gap, notes=[])
    by_face = np.argsort(face, kind="stable")
    drawn = points, corners[by_face], np.bincount(face, minlength=count)
    names = (WHOLE,) * count if is_open else tuple(f"face{k + 1}" for k in range(count))
    box = freeze(np.stack([points.min(axis=0), points.max(axis=0)]) * MM)
    return replace(
        part, faces=count, bounding_box=box, _triangulate=lambda _: drawn, _face_names=names
    )


class _Edges:
    """The half-edges of triangles (F, 3), each with the triangle on its left."""

    def __init__(self, corners: Ints) -> None:
        self._tail = corners.ravel()
        self._head = np.roll(corners, -1, axis=1).ravel()
        self._of = np.repeat(np.arange(len(corners)), 3)
        ends = list(zip(self._tail.tolist(), self._head.tolist(), strict=True))
        key = {pair: k for k, pair in enumerate(ends)}
        self._twin = np.array([key.get((b, a), -1) for a, b in ends], dtype=np.int64)
        self.free = np.flatnonzero(self._twin < 0)
        """Half-edges without a triangle on their right."""
        one = np.flatnonzero(self._twin > np.arange(len(self._twin)))
        self.pairs = np.stack([self._of[one], self._of[self._twin[one]]], axis=1)
        """Pairs (P, 2) of triangles that share an edge."""

    def rings(self, group: Ints, own: int) -> Iterator[Ints]:
        """Yield the vertices of each closed loop around the triangles of a group, on its left."""
        ours = group[self._of] == own
        border = ours & ((self._twin < 0) | (group[self._of[self._twin]] != own))
        following: dict[int, list[int]] = {}
        for k in np.flatnonzero(border).tolist():
            following.setdefault(int(self._tail[k]), []).append(int(self._head[k]))
        while following:
            start = at = next(iter(following))
            ring = [start]
            while at in following:
                heads = following[at]
                here = heads.pop()
                if not heads:
                    del following[at]
                at = here
                if at == start:
                    break
                ring.append(at)
            if at == start and len(ring) > 2:
                yield np.array(ring)


def _normals(corners: Ints, across: Array, count: int) -> Array:
    """Return normals (count, 3) of any length at vertices, by the areas of the triangles there."""
    total = [np.bincount(corners.ravel(), np.repeat(x, 3), count) for x in across.T]
    return np.stack(total, axis=1)
