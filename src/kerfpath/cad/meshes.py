"""Loops of triangle meshes: around their border, around faces between sharp edges, in sections."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from kerfpath.arrays import Array, Bools, Ints, freeze
from kerfpath.cad.build import REPEATED, kind_of_points, named_loops, part_without_faces
from kerfpath.cad.curves import Points, Trace, label_connected, vector_area
from kerfpath.cad.part import Kind, Loop, Part
from kerfpath.cad.units import LARGEST, MM, NO_UNIT, UNITS_MM
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


AT_CORNER = 1.0
"""mm: so far before and after a sharp edge in a section the axis turns, at most a third of a
segment."""


def read_mesh(
    path: Path,
    length_unit: str | None,
    gap: float,
    section: Array | None = None,
    heights: Sequence[float] = (),
) -> Part:
    """Return the loops of a triangle mesh: STL, OBJ or PLY.

    `section` (3,) is the normal of planes at `heights` (m) along it; only their loops are read.

    Raises
    ------
    InputError
        No unit given, a file that cannot be read, too many triangles or faces, no loop, a plane
        that misses the mesh.
    """
    if length_unit is None:
        raise InputError(NO_UNIT)
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
    if count > MOST_FACES and section is None:
        raise InputError(
            f"has {count} faces between edges sharper than {np.degrees(SHARP):.0f} deg, at most "
            f"{MOST_FACES} are read; smooth the mesh"
        )
    loops = []
    body = np.zeros(len(corners), dtype=np.int64)
    notes: list[str] = []
    if section is not None:
        mesh = _Mesh(points, corners, across, face, edges)
        for k, height in enumerate(heights):
            named, said = _section(mesh, section, height / MM, f"section{k + 1}", gap)
            loops += named
            notes += said
    is_open = len(edges.free) > 0
    around = [(WHOLE, body, 0)] if is_open else []
    if count > 1 or not is_open:
        around += [(f"face{k + 1}", face, k) for k in range(count)]
    for name, group, own in around if section is None else []:
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
            "is a closed surface without sharp edges, so nothing bounds a cut; give a section, "
            "draw the cut as a curve, or cut the mesh off there"
        )
    part = part_without_faces(path, length_unit, loops, gap=gap, notes=notes)
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


# -----------------------------------------------------------------------------
# Sections: where planes cut the triangles.


class _Mesh(NamedTuple):
    """Points (P, 3) mm, triangles (F, 3), their normals by area (F, 3), faces (F,), and edges."""

    points: Array
    corners: Ints
    across: Array
    face: Ints
    edges: _Edges


def _section(
    mesh: _Mesh, normal: Array, height: float, name: str, gap: float
) -> tuple[list[Loop], list[str]]:
    """Return the loops where a plane cuts a mesh, and notes; `height` in mm."""
    way = normal / np.linalg.norm(normal)
    off = mesh.points[np.unique(mesh.corners)] @ way - height
    low, high = float(off.min()), float(off.max())
    margin = WELDED * (high - low)
    if not low < -margin < margin < high:
        raise InputError(
            f"section: expected a plane within the part, which reaches from {low + height:.6g} to "
            f"{high + height:.6g} mm along the normal, got {height:.6g} mm"
        )
    found: list[tuple[Kind, Trace, str]] = []
    turned = 0
    chains = _chains(mesh, mesh.points @ way >= height)
    for chain, is_closed in chains:
        points, normals, sharp = _line(mesh, chain, way, height, is_closed=is_closed)
        keep = np.linalg.norm(np.diff(points, axis=0), axis=1) > REPEATED
        keep = np.concatenate([[True], keep])
        if is_closed and np.linalg.norm(points[keep][-1] - points[0]) <= REPEATED:
            keep[np.flatnonzero(keep)[-1]] = len(points[keep]) <= 1
        points, normals = points[keep], normals[keep]
        if len(points) < (3 if is_closed else 2):
            continue
        turned += sharp
        trace = Points(points=points, normals=unit(normals, "normals"), is_closed=is_closed)
        kind: Kind = "open"
        if is_closed:
            kind = "outer" if vector_area(points) @ way > 0 else "inner"
        found.append((kind, trace, ""))
    notes = []
    if turned:
        notes.append(
            f"{name}: crosses sharp edges at {turned} places, where the axis turns within "
            f"{AT_CORNER:g} mm on both sides"
        )
    return named_loops(found, face=name, surface="mesh", gap=gap, layer=""), notes


def _chains(mesh: _Mesh, above: Bools) -> Iterator[tuple[list[tuple[int, int, int]], bool]]:
    """Yield each line of a section as half-edges, and whether it is closed.

    Half-edges are (triangle, the one down through the plane, the one up): a line enters a triangle
    on the former, and runs with what is above the plane on its left, as seen from outside.
    """
    tail, head = mesh.corners, np.roll(mesh.corners, -1, axis=1)
    down, up = above[tail] & ~above[head], ~above[tail] & above[head]
    crossed = np.flatnonzero(down.any(axis=1))
    enters, leaves = down[crossed].argmax(axis=1), up[crossed].argmax(axis=1)
    starts: dict[tuple[int, int], tuple[int, int, int]] = {}
    ends: set[tuple[int, int]] = set()
    for k, i, j in zip(crossed.tolist(), enters.tolist(), leaves.tolist(), strict=True):
        start, end = (int(tail[k, i]), int(head[k, i])), (int(head[k, j]), int(tail[k, j]))
        if start in starts or end in ends:
            x, y, z = mesh.points[start[0] if start in starts else end[0]].tolist()
            raise InputError(
                f"section: more than two triangles meet near {x:.6g}, {y:.6g}, {z:.6g} mm, or they "
                "are turned opposite ways; repair the mesh"
            )
        starts[start] = k, i, j
        ends.add(end)
    left = dict(starts)
    for first in [*(start for start in starts if start not in ends), *starts]:
        chain = []
        at = first
        while at in left:
            k, i, j = left.pop(at)
            chain.append((k, i, j))
            at = int(head[k, j]), int(tail[k, j])
        if chain:
            yield chain, at == first


def _line(
    mesh: _Mesh,
    chain: Sequence[tuple[int, int, int]],
    way: Array,
    height: float,
    *,
    is_closed: bool,
) -> tuple[Array, Array, int]:
    """Return points (K, 3) mm and normals (K, 3) along a line, and how often it crosses an edge."""
    k, i, j = np.array(chain).T
    smooth = _smooth(mesh, k)
    ends = []
    for here in (i, j):
        a, b = mesh.corners[k, here], mesh.corners[k, (here + 1) % 3]
        below, over = ((mesh.points[each] @ way - height)[:, None] for each in (a, b))
        share = below / (below - over)
        at = mesh.points[a] + share * (mesh.points[b] - mesh.points[a])
        one, other = smooth[np.arange(len(k)), here], smooth[np.arange(len(k)), (here + 1) % 3]
        ends.append((at, unit((1 - share) * one + share * other, "normals")))
    (start, from_normal), (end, to_normal) = ends
    turns = angle_between(to_normal, np.roll(from_normal, -1, axis=0)) > SHARP
    if not is_closed:
        turns[-1] = False
    points, normals = [], []
    for n in range(len(k)):
        step = end[n] - start[n]
        length = float(np.linalg.norm(step))
        near = min(AT_CORNER, length / 3) / length if length > REPEATED else 0.0
        before = turns[n - 1] if n or is_closed else False
        mean = from_normal[n] + to_normal[n - 1] if before else from_normal[n]
        for share, there in ((0.0, True), (near, before), (1 - near, turns[n])):
            if there and (share == 0 or near > 0):
                points.append(start[n] + share * step)
                mixed = (1 - share) * from_normal[n] + share * to_normal[n]
                normals.append(mixed if share else mean)
    if not is_closed:
        points.append(end[-1])
        normals.append(to_normal[-1])
    return np.array(points), np.array(normals), int(turns.sum())


def _smooth(mesh: _Mesh, chosen: Ints) -> Array:
    """Return the unit normals (K, 3, 3) at the corners of triangles, smooth within their face."""
    keys = mesh.face[:, None] * len(mesh.points) + mesh.corners
    names, place = np.unique(keys.ravel(), return_inverse=True)
    total = np.stack(
        [np.bincount(place, np.repeat(x, 3), len(names)) for x in mesh.across.T], axis=1
    )
    found = total[place.reshape(-1, 3)[chosen]]
    return unit(found.reshape(-1, 3), "normals").reshape(-1, 3, 3)
