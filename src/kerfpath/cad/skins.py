"""Skins: faces that join smoothly, their loops, and the two sides of a sheet."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from OCP.BRepAdaptor import BRepAdaptor_Surface
from OCP.BRepGProp import BRepGProp
from OCP.BRepTools import BRepTools
from OCP.collections import IndexedMap_TopoDS_Shape_TopTools_ShapeMapHasher as ShapeMap
from OCP.GeomAbs import GeomAbs_SurfaceType
from OCP.gp import gp_Pnt, gp_Pnt2d, gp_Vec
from OCP.GProp import GProp_GProps
from OCP.IntTools import IntTools_FClass2d
from OCP.TopAbs import TopAbs_State
from OCP.TopoDS import TopoDS_Face
from scipy.spatial import cKDTree

from kerfpath.arrays import Array, Ints, short_repr
from kerfpath.cad.curves import EdgeChain, label_connected
from kerfpath.cad.loops import REVERSED, FaceLoop, OrientedEdge, join_runs
from kerfpath.cad.part import Side

# -----------------------------------------------------------------------------
# Depth of a side of a sheet inside the part, which distinguishes its outer and inner sides.
#
# Seen along the outward normal, nothing of a channel lies beyond its outer side, and all of it
# lies beyond its inner side. Holes, countersinks and flanges hardly change that, unlike the
# length of the rims or the areas.

GRID = 5
"""Number of patches in each direction of a face that is not plane."""
ACCURACY = 1e-2
"""Relative accuracy of areas, which only distinguish sheets from blocks and are not shown."""
EDGE = 1e-9
"""A point this close to an edge, in the parameters of the surface, is on it."""
CHUNK = 256
"""Points treated together: memory does not grow with the part, and BLAS starts no threads."""
DIRECTIONS = 512
"""Number of directions in which the ends of a sheet are searched, one within 5 deg of any."""


class Patches(NamedTuple):
    """Patches of a face: areas (K,) mm^2, middles (K, 3) mm, outward unit normals (K, 3)."""

    area: Array
    middle: Array
    normal: Array


def area_and_middle(face: TopoDS_Face) -> tuple[float, gp_Pnt]:
    """Return the area of a face, mm^2, and its centre of mass."""
    props = GProp_GProps()
    BRepGProp.SurfaceProperties_s(face, props, ACCURACY)
    return abs(props.Mass()), props.CentreOfMass()  # negative for some damaged faces


def patches_of(face: TopoDS_Face, area: float, middle: gp_Pnt) -> Patches:
    """Return the patches of a face of known area and centre: one for a plane, else a grid."""
    surface = BRepAdaptor_Surface(face)
    out = -1.0 if face.Orientation() == REVERSED else 1.0
    if surface.GetType() == GeomAbs_SurfaceType.GeomAbs_Plane:
        normal = surface.Plane().Axis().Direction()
        if not surface.Plane().Direct():
            out = -out
        return Patches(
            np.array([area]),
            np.array([[middle.X(), middle.Y(), middle.Z()]]),
            out * np.array([[normal.X(), normal.Y(), normal.Z()]]),
        )
    u0, u1, v0, v1 = BRepTools.UVBounds_s(face)
    part, within = (np.arange(GRID) + 0.5) / GRID, IntTools_FClass2d(face, EDGE)
    middles, normals, inside = [], [], []
    point, du, dv = gp_Pnt(), gp_Vec(), gp_Vec()
    for u in (u0 + (u1 - u0) * part).tolist():
        for v in (v0 + (v1 - v0) * part).tolist():
            surface.D1(u, v, point, du, dv)
            across = du.Crossed(dv)
            middles.append((point.X(), point.Y(), point.Z()))
            normals.append((across.X(), across.Y(), across.Z()))
            inside.append(within.Perform(gp_Pnt2d(u, v)) != TopAbs_State.TopAbs_OUT)
    normal = np.array(normals)
    size = np.linalg.norm(normal, axis=1)
    kept = (size > 0) & (inside if any(inside) else True)  # a narrow strip may miss the grid
    size = size[kept]
    return Patches(
        size * (area / max(size.sum(), np.finfo(float).tiny)),
        np.array(middles)[kept],
        out * normal[kept] / size[:, None],
    )


def concatenated(parts: Sequence[Patches]) -> Patches:
    """Return the patches of several faces in one."""
    return Patches(*map(np.concatenate, zip(*parts, strict=True)))


def depth_of(patches: Patches, points: Array) -> float:
    """Return the mean distance (mm) that points (K, 3) mm reach beyond patches, along normals."""
    ends = points[_farthest(points)]
    beyond = (patches.normal @ ends.T).max(axis=1) - (patches.normal * patches.middle).sum(axis=1)
    return float(patches.area @ np.maximum(beyond, 0.0) / patches.area.sum())


def _farthest(points: Array) -> Ints:
    """Return the indices of points (K, 3) that lie farthest in one of many directions."""
    directions = _directions()
    best, which = np.full(len(directions), -np.inf), np.zeros(len(directions), dtype=np.int64)
    for first in range(0, len(points), CHUNK):
        along = directions @ points[first : first + CHUNK].T
        here = np.argmax(along, axis=1)
        farther = along[np.arange(len(directions)), here] > best
        which[farther] = here[farther] + first
        best[farther] = along[farther, here[farther]]
    return np.unique(which)


def _directions() -> Array:
    """Return unit vectors (D, 3) that are evenly spread, on a spiral."""
    z = 1 - (2 * np.arange(DIRECTIONS) + 1) / DIRECTIONS
    turn = np.pi * (3 - np.sqrt(5)) * np.arange(DIRECTIONS)
    r = np.sqrt(1 - z * z)
    return np.stack([r * np.cos(turn), r * np.sin(turn), z], axis=1)


# -----------------------------------------------------------------------------
# Skins, their loops and their sides.

SMOOTH = float(np.radians(2.0))
"""Faces whose normals differ by less (rad) along their whole shared edge belong to one skin."""
OPPOSITE = 0.2
"""How far the vector areas of a sheet's two sides may be from cancelling, as a share of an area,
and how much the areas may differ."""
THIN = 0.2
"""A sheet is thinner than this share of the square root of its area."""
EVEN, UNSURE = 0.01, 0.1
"""Differences of the depths of two sides, as shares of their sum: below the first, their direction
distinguishes them; below the second, a note says that the outer side is not certain."""
FLATNESS = 1e-3
"""Sides that lie less deep in a sheet than this share of the square root of its area are flat."""
LEANING = 0.05
"""Share of its area that a side must show in the direction given for the outer side."""
LEVEL = 1e-4
"""Coordinates of a vector area below this share of its length count as zero."""
NOWHERE = 1e9
"""Place (mm) of skins without loops, far from all others."""
HOLE = -0.25
"""Cosine between a loop's vector area and its mean normal below which it runs about a hole: for
holes it is near -1, for a trim line near 1, for the rim of a tube near 0."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Skin:
    """Faces that join smoothly.

    Parameters
    ----------
    faces : tuple of int
        Indices of the faces.
    side : {"outer", "inner", "edge", ""}
        Side of a sheet; "" if it is no sheet.
    inside : set of (int, int, int)
        Face, loop and edge numbers of the edges inside the skin, which are not cut.
    doubt : str
        Why `side` might be the other one; "" if it is certain.
    """

    faces: tuple[int, ...]
    side: Side
    inside: frozenset[tuple[int, int, int]]
    doubt: str = ""

    __repr__ = short_repr

    def loops(self, found: Sequence[list[FaceLoop]]) -> list[FaceLoop]:
        """Return the loops around the skin and its holes, over all its faces."""
        if len(self.faces) == 1:
            return found[self.faces[0]]
        runs = [
            run
            for f in self.faces
            for k, (_, loop) in enumerate(found[f])
            for run in _outside(
                loop.edges, [(f, k, e) in self.inside for e in range(len(loop.edges))]
            )
        ]
        chains = [EdgeChain(edges=edges) for edges in join_runs(runs)]
        loops = [(_is_hole(chain), chain) for chain in chains]
        if loops and all(hole for hole, _ in loops):
            # A trim line may face away from its sheet, as on a C-shaped channel.
            longest = max(loops, key=lambda loop: float(loop[1].lengths.sum()))
            loops = [(hole and loop is not longest[1], loop) for hole, loop in loops]
        return [("inner" if hole else "outer", loop) for hole, loop in loops]


def skins_of(
    faces: Sequence[TopoDS_Face],
    found: Sequence[list[FaceLoop]],
    outer_towards: Array | None = None,
) -> list[Skin]:
    """Return the skins of a part, in the order of their first faces.

    Parameters
    ----------
    faces : sequence of TopoDS_Face
    found : sequence of list of FaceLoop
        The loops of each face.
    outer_towards : (3,), optional
        Direction that the outer sides of sheets face on the whole; default: by their shape.
    """
    uses = _uses(found)
    pairs = [(a, b) for at in uses if len(at) == 2 for a, b in [at] if a[0] != b[0]]
    smooth = [pair for pair in pairs if _is_smooth(*(found[f][k][1].edges[e] for f, k, e in pair))]
    group, whole = (
        label_connected(np.array([[a[0], b[0]] for a, b in of], dtype=np.int64), len(faces))
        for of in (smooth, pairs)
    )
    inside: dict[int, set[tuple[int, int, int]]] = {}
    for pair in smooth:
        inside.setdefault(int(group[pair[0][0]]), set()).update(pair)
    members = [tuple(np.flatnonzero(group == g).tolist()) for g in range(group.max(initial=-1) + 1)]
    insides = [frozenset(inside.get(g, ())) for g in range(len(members))]
    sides = _sides(faces, found, members, whole, outer_towards)
    return [
        Skin(faces=m, side=side, inside=edges, doubt=doubt)
        for m, (side, doubt), edges in zip(members, sides, insides, strict=True)
    ]


def _uses(found: Sequence[list[FaceLoop]]) -> list[list[tuple[int, int, int]]]:
    """Return, for each edge of the shape, the (face, loop, edge) numbers that run along it."""
    known, uses = ShapeMap(), list[list[tuple[int, int, int]]]()
    for f, loops in enumerate(found):
        for k, (_, loop) in enumerate(loops):
            for e, edge in enumerate(loop.edges):
                number = known.Add(edge.edge)
                if number > len(uses):
                    uses.append([])
                uses[number - 1].append((f, k, e))
    return uses


def _is_smooth(a: OrientedEdge, b: OrientedEdge) -> bool:
    most = 2 * np.sin(SMOOTH / 2)
    for end, normal in a.end_normals.items():  # most edges are sharp, at their ends too
        if end in b.end_normals and np.linalg.norm(normal - b.end_normals[end]) > most:
            return False
    t = np.linspace(a.start, a.end, 5)
    turned = np.linalg.norm(a.evaluate(t)[1] - b.evaluate(t)[1], axis=1)
    return bool(turned.max() <= most)


def _outside(edges: Sequence[OrientedEdge], inside: list[bool]) -> list[list[OrientedEdge]]:
    """Return the stretches of a closed loop without its inside edges."""
    if not any(inside):
        return [list(edges)]
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


def _is_hole(loop: EdgeChain[OrientedEdge]) -> bool:
    """Return whether a closed chain runs about a hole of its skin, by its normals."""
    area = loop.area
    middles = [(edge.start + edge.end) / 2 for edge in loop.edges]
    normals = [e.evaluate(np.array([t]))[1][0] for e, t in zip(loop.edges, middles, strict=True)]
    facing = loop.lengths @ np.array(normals) / loop.lengths.sum()
    return bool(area @ facing < HOLE * np.linalg.norm(area))


def _sides(
    faces: Sequence[TopoDS_Face],
    found: Sequence[list[FaceLoop]],
    members: Sequence[tuple[int, ...]],
    whole: Ints,
    outer_towards: Array | None,
) -> list[tuple[Side, str]]:
    """Return which side of a sheet each skin is, and why it might be the other one, or "".

    Two opposite skins that are large and close are the sides of a sheet.
    """
    weights = [area_and_middle(face) for face in faces]
    areas = np.array([sum(weights[f][0] for f in numbers) for numbers in members])
    vector = np.zeros((len(members), 3))
    low, high = np.full((len(members), 3), NOWHERE), np.full((len(members), 3), -NOWHERE)
    points: list[Array] = []
    for g, numbers in enumerate(members):
        around = [np.empty((0, 3))]
        for f in numbers:
            for _, loop in found[f]:
                vector[g] += loop.area
                around.append(loop.around)
        points.append(np.vstack(around))
        if len(points[g]):
            low[g], high[g] = points[g].min(axis=0), points[g].max(axis=0)
    sides: list[Side] = [""] * len(members)
    doubts = [""] * len(members)
    body = whole[[numbers[0] for numbers in members]]
    is_alone = np.bincount(body)[body] == 1
    beside = _beside(low, high, areas)
    for g in np.argsort(-areas, kind="stable").tolist():
        if is_alone[g]:
            sides[g] = "outer"
        if sides[g]:
            continue
        alike = beside[g][body[beside[g]] == body[g]]
        apart = np.maximum(low[alike] - high[g], low[g] - high[alike]).max(axis=1)
        opposite = np.linalg.norm(vector[alike] + vector[g], axis=1) <= OPPOSITE * areas[g]
        near = alike[(apart < THIN * np.sqrt(areas[g])) & opposite].tolist()
        away = {h: _usual_distance(points[g], points[h]) for h in near if h != g and not sides[h]}
        h = min(away, key=away.__getitem__, default=g)
        if h != g and away[h] < THIN * np.sqrt(areas[g]):
            both = [
                concatenated([patches_of(faces[f], *weights[f]) for f in members[skin]])
                for skin in (g, h)
            ]
            ends = np.vstack([points[g], points[h], *(patches.middle for patches in both)])
            depths = [depth_of(patches, ends) for patches in both]
            is_outer, doubts[g] = _is_outer(depths, vector[g], areas[g], outer_towards)
            sides[g], sides[h] = ("outer", "inner") if is_outer else ("inner", "outer")
    sheets = {body[g] for g, side in enumerate(sides) if side}
    rest: list[Side] = [
        side or ("edge" if body[g] in sheets else "") for g, side in enumerate(sides)
    ]
    return list(zip(rest, doubts, strict=True))


def _beside(low: Array, high: Array, areas: Array) -> list[Ints]:
    """Return for each skin the others, not much smaller, that are close enough for a sheet.

    Skins of similar size are looked up together, by the middles of their boxes (K, 3).
    """
    has_loops = np.asarray((low <= high).all(axis=1))
    middle = np.where(has_loops[:, None], (low + high) / 2, NOWHERE)
    half = np.where(has_loops, np.linalg.norm(high - low, axis=1) / 2, 0.0)
    reach = half + THIN * np.sqrt(areas)
    none = np.empty(0, dtype=np.int64)  # all that a skin without area has
    found = [[none] for _ in range(len(areas))]
    size = np.floor(np.log2(np.maximum(areas, np.finfo(float).tiny)))
    for one in np.unique(size):
        those = np.flatnonzero(size == one)
        largest = areas[those].max()
        asking = np.flatnonzero(largest > (1 - OPPOSITE) * areas)
        tree = cKDTree(middle[those])
        near = tree.query_ball_point(middle[asking], reach[asking] + float(half[those].max()))
        for g, places in zip(asking.tolist(), near, strict=True):
            here = those[np.array(places, dtype=np.int64)]
            found[g].append(here[areas[here] > (1 - OPPOSITE) * areas[g]])
    return [np.sort(np.concatenate(each)) for each in found]


def _is_outer(
    depths: Sequence[float], vector: Array, area: float, outer_towards: Array | None
) -> tuple[bool, str]:
    """Return whether a side of a sheet is its outer one, and why that is not certain, or "".

    ``depths`` (mm) are those of this side and of the other one, ``vector`` (3,) mm^2 and ``area``
    mm^2 are the areas of this side.
    """
    if outer_towards is not None:
        along = float(vector @ outer_towards)
        if abs(along) > LEANING * area * np.linalg.norm(outer_towards):
            return along > 0, ""
    mine, other = depths
    if mine + other <= FLATNESS * np.sqrt(area):
        return _faces_up(vector), ""
    share = (other - mine) / (other + mine)
    is_even = abs(share) < EVEN
    chosen = "the one that faces up" if is_even else "the one that lies less deep"
    doubt = (
        f"its sides lie {min(depths):.1f} and {max(depths):.1f} mm deep in it on average; "
        f"{chosen} is taken"
    )
    return (_faces_up(vector) if is_even else share > 0), doubt if abs(share) < UNSURE else ""


def _usual_distance(a: Array, b: Array) -> float:
    """Return the median distance of points (K, 3) from the nearest of others."""
    if not len(a) or not len(b):
        return float("inf")
    return float(np.median(cKDTree(b).query(a)[0]))


def _faces_up(vector: Array) -> bool:
    """Return whether a vector area points towards +z or, if it is level, towards +y, then +x."""
    level = LEVEL * np.linalg.norm(vector)
    return bool(next((v > 0 for v in vector[::-1] if abs(v) > level), True))
