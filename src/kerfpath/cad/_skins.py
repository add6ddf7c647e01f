"""Skins: faces that go on smoothly into each other, their loops, and the two sides of a sheet."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from OCP.BRepGProp import BRepGProp
from OCP.collections import IndexedMap_TopoDS_Shape_TopTools_ShapeMapHasher as ShapeMap
from OCP.GProp import GProp_GProps
from OCP.TopoDS import TopoDS_Face
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from kerfpath._arrays import Array, Ints
from kerfpath.cad._loops import FaceLoop, OrientedEdge, chained
from kerfpath.cad._part import Side
from kerfpath.cad._sample import Chain

__all__ = ["SMOOTH", "Skin", "skins_of"]

SMOOTH = float(np.radians(2.0))
"""Faces whose normals differ by less (rad) all along their shared edge belong to one skin."""
ACCURACY = 1e-2
"""Relative accuracy of areas and volumes: they tell sheets from blocks, and are not shown."""
OPPOSITE = 0.2
"""How far the vector areas of a sheet's two sides may be from cancelling, as a part of an area;
by how much the areas may differ."""
THIN = 0.2
"""A sheet is thinner than this part of the square root of its area."""
EVEN = 1e-4
"""Sides whose rims differ by less in length, as a part, are told apart by where they face."""
HOLE = -0.25
"""Cosine between a loop's vector area and its mean normal below which it runs about a hole: for
holes it is near -1, for a trim line near 1, for the rim of a tube near 0."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Skin:
    """Faces that go on smoothly into each other.

    Parameters
    ----------
    faces : tuple of int
        Numbers of the faces.
    side : {"outer", "inner", "edge", ""}
        Of a sheet; "" if it is none.
    inside : set of (int, int, int)
        Face, loop and edge numbers of what lies inside the skin, and is no cut.
    """

    faces: tuple[int, ...]
    side: Side
    inside: frozenset[tuple[int, int, int]]

    def loops(self, found: Sequence[list[FaceLoop]]) -> list[FaceLoop]:
        """Return the loops around the skin and its holes, over all its faces."""
        if len(self.faces) == 1:
            return found[self.faces[0]]
        runs = [
            run
            for f in self.faces
            for k, (_, edges) in enumerate(found[f])
            for run in _outside(edges, [(f, k, e) in self.inside for e in range(len(edges))])
        ]
        loops = [(is_hole(chain), chain) for chain in chained(runs)]
        if loops and all(hole for hole, _ in loops):
            # A trim line may face away from its sheet, as that of a C-shaped channel does.
            longest = max(loops, key=lambda loop: sum(edge.length for edge in loop[1]))
            loops = [(hole and edges is not longest[1], edges) for hole, edges in loops]
        return [("inner" if hole else "outer", edges) for hole, edges in loops]


def skins_of(faces: Sequence[TopoDS_Face], found: Sequence[list[FaceLoop]]) -> list[Skin]:
    """Return the skins of a part, in the order of their first faces.

    Parameters
    ----------
    faces : sequence of TopoDS_Face
    found : sequence of list of FaceLoop
        The loops of each.
    """
    uses = _uses(found)
    pairs = [(a, b) for at in uses if len(at) == 2 for a, b in [at] if a[0] != b[0]]
    smooth = [pair for pair in pairs if _is_smooth(*(found[f][k][1][e] for f, k, e in pair))]
    group = _connected(smooth, len(faces))
    whole = _connected(pairs, len(faces))
    inside: dict[int, set[tuple[int, int, int]]] = {}
    for pair in smooth:
        inside.setdefault(int(group[pair[0][0]]), set()).update(pair)
    members = [tuple(np.flatnonzero(group == g).tolist()) for g in range(group.max(initial=-1) + 1)]
    insides = [frozenset(inside.get(g, ())) for g in range(len(members))]
    sides = _sides(faces, found, members, insides, whole)
    return [
        Skin(faces=m, side=side, inside=edges)
        for m, side, edges in zip(members, sides, insides, strict=True)
    ]


def _uses(found: Sequence[list[FaceLoop]]) -> list[list[tuple[int, int, int]]]:
    """Return, for each edge of the shape, the (face, loop, edge) numbers that run along it."""
    known, uses = ShapeMap(), list[list[tuple[int, int, int]]]()
    for f, loops in enumerate(found):
        for k, (_, edges) in enumerate(loops):
            for e, edge in enumerate(edges):
                number = known.Add(edge.edge)
                if number > len(uses):
                    uses.append([])
                uses[number - 1].append((f, k, e))
    return uses


def _is_smooth(a: OrientedEdge, b: OrientedEdge) -> bool:
    t = np.linspace(a.start, a.end, 5)
    turned = np.linalg.norm(a.evaluate(t)[1] - b.evaluate(t)[1], axis=1)
    return bool(turned.max() <= 2 * np.sin(SMOOTH / 2))


def _connected(pairs: Sequence[Sequence[tuple[int, int, int]]], count: int) -> Ints:
    """Return a number (F,) for each face, the same for faces that pairs connect."""
    ends = np.array([[a[0], b[0]] for a, b in pairs], dtype=np.int64).reshape(-1, 2)
    links = coo_array((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), shape=(count, count))
    labels: Ints = connected_components(links, directed=False)[1]
    return labels


def _outside(edges: list[OrientedEdge], inside: list[bool]) -> list[list[OrientedEdge]]:
    """Return the stretches of a closed loop that are no inside edges."""
    if not any(inside):
        return [edges]
    runs: list[list[OrientedEdge]] = []
    first = inside.index(True)
    is_new = True
    for k in range(len(edges)):
        at = (first + k) % len(edges)
        if inside[at]:
            is_new = True
            continue
        if is_new:
            runs.append([])
        runs[-1].append(edges[at])
        is_new = False
    return runs


def is_hole(edges: list[OrientedEdge]) -> bool:
    """Return whether a closed chain runs about a hole of its skin, by its normals."""
    area = vector_area(edges)
    normals = [edge.evaluate(np.array([(edge.start + edge.end) / 2]))[1][0] for edge in edges]
    normals = [n * edge.length for n, edge in zip(normals, edges, strict=True)]
    facing = np.sum(normals, axis=0) / sum(edge.length for edge in edges)
    return bool(area @ facing < HOLE * np.linalg.norm(area))


def vector_area(edges: list[OrientedEdge]) -> Array:
    """Return the vector area (3,) mm^2 that a closed chain encloses, by chords."""
    points = Chain(edges=edges).around
    return np.asarray(np.cross(points, np.roll(points, -1, axis=0)).sum(axis=0) / 2)


def _sides(
    faces: Sequence[TopoDS_Face],
    found: Sequence[list[FaceLoop]],
    members: Sequence[tuple[int, ...]],
    inside: Sequence[frozenset[tuple[int, int, int]]],
    whole: Ints,
) -> list[Side]:
    """Return which side of a sheet each skin is: opposite ones, large and close, are a sheet's."""
    areas, volume = np.zeros(len(members)), np.zeros(int(whole.max(initial=-1)) + 1)
    rims, centre = np.zeros(len(members)), np.zeros((len(members), 3))
    vector = np.zeros((len(members), 3))
    for g, numbers in enumerate(members):
        for f in numbers:
            of_area, of_volume = GProp_GProps(), GProp_GProps()
            BRepGProp.SurfaceProperties_s(faces[f], of_area, ACCURACY)
            BRepGProp.VolumeProperties_s(faces[f], of_volume, ACCURACY)
            areas[g] += of_area.Mass()
            centre[g] += of_area.Mass() * np.array(of_area.CentreOfMass().Coord())
            volume[whole[f]] += of_volume.Mass()
            for k, (_, edges) in enumerate(found[f]):
                vector[g] += vector_area(edges)
                rims[g] += sum(
                    edge.length for e, edge in enumerate(edges) if (f, k, e) not in inside[g]
                )
        centre[g] /= max(areas[g], np.finfo(float).tiny)
    sides: list[Side] = [""] * len(members)
    body = [int(whole[numbers[0]]) for numbers in members]
    for g in np.argsort(-areas, kind="stable").tolist():
        alike = [h for h in range(len(members)) if body[h] == body[g]]
        if len(alike) == 1:
            sides[g] = "outer"
        if sides[g] or abs(volume[body[g]]) > THIN * areas[g] ** 1.5:
            continue
        partners = [
            h
            for h in alike
            if h != g
            and not sides[h]
            and areas[h] > (1 - OPPOSITE) * areas[g]
            and np.linalg.norm(vector[g] + vector[h]) <= OPPOSITE * areas[g]
        ]
        if partners:
            h = min(partners, key=lambda h: float(np.linalg.norm(centre[h] - centre[g])))
            even = abs(rims[g] - rims[h]) <= EVEN * rims[g]
            is_outer = _faces_up(vector[g]) if even else rims[g] > rims[h]
            sides[g], sides[h] = ("outer", "inner") if is_outer else ("inner", "outer")
    sheets = {body[g] for g, side in enumerate(sides) if side}
    return [side or ("edge" if body[g] in sheets else "") for g, side in enumerate(sides)]


def _faces_up(vector: Array) -> bool:
    """Return whether a vector area points up, along +z; if it is level, along +y, then +x."""
    level = EVEN * np.linalg.norm(vector)
    return bool(next((v > 0 for v in vector[::-1] if abs(v) > level), True))
