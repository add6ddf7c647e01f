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
from kerfpath.cad.part import Kind, Loop, Part, Side
from kerfpath.cad.sides import Surfaces, sides_of
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


def read_mesh(
    path: Path,
    length_unit: str | None,
    gap: float,
    section: Array | None = None,
    heights: Sequence[float] = (),
    outer_towards: Array | None = None,
) -> Part:
    """Return the loops of a triangle mesh: STL, OBJ or PLY.

    `section` (3,) is the normal of planes at `heights` (m) along it; only their loops are read. In
    a closed mesh, `outer_towards` (3,) is the direction that the outer sides of sheets face.

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
    loops: list[Loop] = []
    notes: list[str] = []
    mesh = _Mesh(points, corners, across, face, edges)
    is_open = len(edges.free) > 0
    if outer_towards is not None and (is_open or section is not None):
        got = "an open one" if is_open else "sections"
        raise InputError(f"outer_towards: expected a closed mesh, got {got}; remove it")
    names = [WHOLE] * count if is_open else [f"face{k + 1}" for k in range(count)]
    if section is not None:
        for k, height in enumerate(heights):
            loops += _section(mesh, section, height / MM, f"section{k + 1}", gap)
    elif is_open:
        loops = _loops(mesh, WHOLE, np.zeros_like(face), 0, gap)
        for k in range(count if count > 1 else 0):
            named = _loops(mesh, f"face{k + 1}", face, k, gap)
            loops += [replace(loop, skin=WHOLE) for loop in named]
    else:
        sheet = _sheet(mesh, outer_towards)
        notes = sheet.notes
        for name, own in sheet.skins.items():
            named = _loops(mesh, name, sheet.skin[face], own, gap)
            side = sheet.side[sheet.skin.tolist().index(own)]
            loops += [replace(loop, side=side) for loop in named]
        skin_of = {own: name for name, own in sheet.skins.items()}
        for k, name in enumerate(names):
            skin = skin_of.get(int(sheet.skin[k]), "")
            named = _loops(mesh, name, face, k, gap)
            loops += [replace(loop, skin=skin, side=sheet.side[k]) for loop in named]
            names[k] = skin or name
    if not loops:
        raise InputError(
            "is a closed surface without sharp edges, so nothing bounds a cut; give a section, "
            "draw the cut as a curve, or cut the mesh off there"
        )
    part = part_without_faces(path, length_unit, loops, gap=gap, notes=notes)
    by_face = np.argsort(face, kind="stable")
    drawn = points, corners[by_face], np.bincount(face, minlength=count)
    box = freeze(np.stack([points.min(axis=0), points.max(axis=0)]) * MM)
    return replace(
        part, faces=count, bounding_box=box, _triangulate=lambda _: drawn, _face_names=tuple(names)
    )


def _loops(mesh: _Mesh, name: str, group: Ints, own: int, gap: float) -> list[Loop]:
    """Return the loops around the triangles of a group, with normals smooth within each face."""
    found: list[tuple[Kind, Trace, str]] = []
    for ring in mesh.edges.rings(group, own):
        smooth = _smooth(mesh, ring // 3)
        each, corner = np.arange(len(ring)), ring % 3
        trace = Points(
            points=mesh.points[mesh.edges.tail[ring]],
            normals=smooth[each, corner],
            is_closed=True,
            arriving=np.roll(smooth[each, (corner + 1) % 3], 1, axis=0),
        )
        found.append((kind_of_points(trace), trace, ""))
    return named_loops(found, face=name, surface="mesh", gap=gap, layer="")


# -----------------------------------------------------------------------------
# Closed meshes of sheets: their sides, and the loops around faces of one side.


class _Sheet(NamedTuple):
    """The faces of a closed mesh.

    Parameters
    ----------
    skin : (F,) int
        The same number for faces of one skin.
    skins : mapping of str to int
        Number of each skin of several faces, by its name.
    side : sequence of str
        Side of each face.
    notes : list of str
    """

    skin: Ints
    skins: dict[str, int]
    side: list[Side]
    notes: list[str]


def _sheet(mesh: _Mesh, outer_towards: Array | None) -> _Sheet:
    """Return the sides of the faces; neighbours on one side of a sheet are one skin."""
    points, face, edges = mesh.points, mesh.face, mesh.edges
    count = int(face.max()) + 1
    borders: list[dict[int, float]] = [{} for _ in range(count)]
    lengths = np.linalg.norm(points[edges.ends[:, 0]] - points[edges.ends[:, 1]], axis=1)
    meets = face[edges.pairs]
    for k in np.flatnonzero(meets[:, 0] != meets[:, 1]).tolist():
        f, g = meets[k].tolist()
        borders[f][g] = borders[g][f] = borders[f].get(g, 0.0) + float(lengths[k])
    body = np.empty(count, dtype=np.int64)
    body[face] = label_connected(edges.pairs, len(mesh.corners))
    side, _, doubt = sides_of(
        Surfaces(
            corners=points[mesh.corners],
            face=face,
            body=body,
            borders=borders,
            smooth=[{} for _ in range(count)],
            around=np.array([sum(each.values()) for each in borders]),
        ),
        outer_towards,
    )
    alike = [
        (f, g)
        for f, beside in enumerate(borders)
        for g in beside
        if f < g and side[f] == side[g] and side[f] in ("outer", "inner")
    ]
    skin = label_connected(np.array(alike, dtype=np.int64).reshape(-1, 2), count)
    several = [k for k in dict.fromkeys(skin.tolist()) if (skin == k).sum() > 1]
    skins = {f"skin{number}": k for number, k in enumerate(several, start=1)}
    notes = [
        f"face{f + 1}: the outer side of its sheet is not certain: {why}; check it, and set "
        "outer_towards if it is the other side"
        for f, why in enumerate(doubt)
        if why and f == skin.tolist().index(skin[f])
    ]
    return _Sheet(skin, skins, side, notes)


class _Edges:
    """The half-edges of triangles (F, 3), each with the triangle on its left."""

    def __init__(self, corners: Ints) -> None:
        self.tail = corners.ravel()
        """Vertex that each begins at."""
        self._head = np.roll(corners, -1, axis=1).ravel()
        self._of = np.repeat(np.arange(len(corners)), 3)
        ends = list(zip(self.tail.tolist(), self._head.tolist(), strict=True))
        key = {pair: k for k, pair in enumerate(ends)}
        self._twin = np.array([key.get((b, a), -1) for a, b in ends], dtype=np.int64)
        self.free = np.flatnonzero(self._twin < 0)
        """Half-edges without a triangle on their right."""
        one = np.flatnonzero(self._twin > np.arange(len(self._twin)))
        self.pairs = np.stack([self._of[one], self._of[self._twin[one]]], axis=1)
        """Pairs (P, 2) of triangles that share an edge."""
        self.ends = np.stack([self.tail[one], self._head[one]], axis=1)
        """Vertices (P, 2) at the ends of these edges."""

    def rings(self, group: Ints, own: int) -> Iterator[Ints]:
        """Yield the half-edges of each closed loop around the triangles of a group, on its left."""
        ours = group[self._of] == own
        border = ours & ((self._twin < 0) | (group[self._of[self._twin]] != own))
        following: dict[int, list[int]] = {}
        for k in np.flatnonzero(border).tolist():
            following.setdefault(int(self.tail[k]), []).append(k)
        while following:
            start = at = next(iter(following))
            ring = []
            while at in following:
                out = following[at]
                ring.append(k := out.pop())
                if not out:
                    del following[at]
                at = int(self._head[k])
                if at == start:
                    break
            if at == start and len(ring) > 2:
                yield np.array(ring)


# -----------------------------------------------------------------------------
# Sections: where planes cut the triangles.


class _Mesh(NamedTuple):
    """Points (P, 3) mm, triangles (F, 3), their normals by area (F, 3), faces (F,), and edges."""

    points: Array
    corners: Ints
    across: Array
    face: Ints
    edges: _Edges


def _section(mesh: _Mesh, normal: Array, height: float, name: str, gap: float) -> list[Loop]:
    """Return the loops where a plane cuts a mesh; `height` in mm."""
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
    for chain, is_closed in _chains(mesh, mesh.points @ way >= height):
        trace = _line(mesh, chain, way, height, is_closed=is_closed)
        if len(trace.points) < (3 if is_closed else 2):
            continue
        kind: Kind = "open"
        if is_closed:
            kind = "outer" if vector_area(trace.points) @ way > 0 else "inner"
        found.append((kind, trace, ""))
    return named_loops(found, face=name, surface="mesh", gap=gap, layer="")


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
) -> Points:
    """Return the trace of a line, without repeated points."""
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
    (points, leaving), (after, arriving) = ends
    if not is_closed:
        points, leaving = np.vstack([points, after[-1:]]), np.vstack([leaving, arriving[-1:]])
        arriving = np.vstack([arriving, leaving[:1]])
    arriving = np.roll(arriving, 1, axis=0)
    # Of points at one place, the first arrives and the last leaves.
    new = np.linalg.norm(points - np.roll(points, 1, axis=0), axis=1) > REPEATED
    if not is_closed:
        new[0] = True
    last = np.roll(new, -1)
    return Points(
        points=points[new], normals=leaving[last], is_closed=is_closed, arriving=arriving[new]
    )


def _smooth(mesh: _Mesh, chosen: Ints) -> Array:
    """Return the unit normals (K, 3, 3) at the corners of triangles, smooth within their face."""
    keys = mesh.face[:, None] * len(mesh.points) + mesh.corners
    names, place = np.unique(keys.ravel(), return_inverse=True)
    total = np.stack(
        [np.bincount(place, np.repeat(x, 3), len(names)) for x in mesh.across.T], axis=1
    )
    found = total[place.reshape(-1, 3)[chosen]]
    return unit(found.reshape(-1, 3), "normals").reshape(-1, 3, 3)
