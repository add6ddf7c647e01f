"""Random bent sheets, profiles, tubes, pans and ribbed plates, of which every hole is known."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut, BRepAlgoAPI_Fuse
from OCP.BRepBuilderAPI import (
    BRepBuilderAPI_MakeEdge,
    BRepBuilderAPI_MakeFace,
    BRepBuilderAPI_MakeWire,
)
from OCP.BRepFilletAPI import BRepFilletAPI_MakeFillet
from OCP.BRepPrimAPI import (
    BRepPrimAPI_MakeBox,
    BRepPrimAPI_MakeCone,
    BRepPrimAPI_MakeCylinder,
    BRepPrimAPI_MakePrism,
)
from OCP.GC import GC_MakeArcOfCircle
from OCP.gp import gp_Ax1, gp_Ax2, gp_Dir, gp_Pnt, gp_Trsf, gp_Vec
from OCP.ShapeUpgrade import ShapeUpgrade_UnifySameDomain
from OCP.TopAbs import TopAbs_EDGE
from OCP.TopExp import TopExp_Explorer
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS, TopoDS_Edge, TopoDS_Face, TopoDS_Shape

FAMILIES = ("sheet", "zigzag", "tube", "pan", "beam", "ribbed", "broken")
RADII = (0.0, 0.0, 0.5, 2.0, 5.0)
"""Inner radii of bends, mm, half of them none or small."""


@dataclass
class Hole:
    """A hole: its middle (3,) mm on the outer side, the outward normal there, and its radius, mm.

    Of the holes of a part that has no outer side (a zigzag, a web), `either` says that they may be
    listed on either side. `sunk` says that the hole has a countersink or counterbore.
    """

    at: np.ndarray
    outward: np.ndarray
    radius: float
    either: bool = False
    sunk: bool = False


@dataclass
class BentPart:
    """A part, its holes to cut, and how many others there are that must not be."""

    family: str
    shape: TopoDS_Shape
    holes: list[Hole] = field(default_factory=list)
    blind: int = 0


def bent_part(family: str, seed: int) -> BentPart:
    """Return a random part of a family, anyhow in space."""
    rng = np.random.default_rng([seed, *family.encode()])
    part = _MAKERS[family](rng)
    part.family = family
    turn, move = gp_Trsf(), gp_Trsf()
    axis = gp_Dir(*rng.normal(size=3).tolist())
    turn.SetRotation(gp_Ax1(gp_Pnt(), axis), float(rng.uniform(0, 2 * np.pi)))
    move.SetTranslation(gp_Vec(*rng.uniform(-300, 300, 3).tolist()))
    both = move.Multiplied(turn)
    part.shape = part.shape.Moved(TopLoc_Location(both))
    R = np.array([[both.Value(i, k) for k in (1, 2, 3)] for i in (1, 2, 3)])
    t = np.array([both.Value(i, 4) for i in (1, 2, 3)])
    for hole in part.holes:
        hole.at, hole.outward = R @ hole.at + t, R @ hole.outward
    return part


# -----------------------------------------------------------------------------
# Outlines with rounded corners, in the plane y = 0, drawn out along y.


def _pnt(p: np.ndarray) -> gp_Pnt:
    return gp_Pnt(float(p[0]), 0.0, float(p[1]))


def _outline(corners: np.ndarray, radii: np.ndarray) -> TopoDS_Face:
    """Return the face in a closed polygon (K, 2), each corner rounded by its radius."""
    starts, ends, arcs = [], [], []
    for k, (corner, radius) in enumerate(zip(corners, radii, strict=True)):
        before = corner - corners[k - 1]
        after = corners[(k + 1) % len(corners)] - corner
        before, after = before / np.linalg.norm(before), after / np.linalg.norm(after)
        angle = np.arccos(np.clip(before @ after, -1, 1))
        away = radius * np.tan(angle / 2)
        begin, end = corner - away * before, corner + away * after
        inwards = after - before
        size = np.linalg.norm(inwards)
        middle = corner
        if radius > 0:
            middle = corner + inwards / size * (radius / np.cos(angle / 2) - radius)
        starts.append(begin)
        ends.append(end)
        arcs.append(middle)
    wire = BRepBuilderAPI_MakeWire()
    for k, radius in enumerate(radii):
        if radius > 0:
            wire.Add(_edge(starts[k], arcs[k], ends[k]))
        wire.Add(_edge(ends[k], starts[(k + 1) % len(radii)]))
    return BRepBuilderAPI_MakeFace(wire.Wire()).Face()


def _edge(*points: np.ndarray) -> TopoDS_Edge:
    at = [_pnt(p) for p in points]
    if len(at) == 2:
        return BRepBuilderAPI_MakeEdge(*at).Edge()
    return BRepBuilderAPI_MakeEdge(GC_MakeArcOfCircle(*at).Value()).Edge()


def _offset(line: np.ndarray, left: float, *, closed: bool) -> np.ndarray:
    """Return a polyline (K, 2) at a distance to its left, with mitres."""
    way = np.diff(np.vstack([line, line[:1]]) if closed else line, axis=0)
    way /= np.linalg.norm(way, axis=1)[:, None]
    normal = np.stack([-way[:, 1], way[:, 0]], axis=1)
    before = np.roll(normal, 1, axis=0) if closed else np.vstack([normal[:1], normal])
    after = normal if closed else np.vstack([normal, normal[-1:]])
    mitre = before + after
    return np.asarray(line + left * mitre * (2 / (mitre * mitre).sum(axis=1))[:, None])


def _drawn(face: TopoDS_Face, width: float) -> TopoDS_Shape:
    return BRepPrimAPI_MakePrism(face, gp_Vec(0, width, 0)).Shape()


def _profile(rng: np.random.Generator, line: np.ndarray, wall: float, width: float) -> TopoDS_Shape:
    """Return an open profile: its middle line (K, 2), bent with random radii."""
    turns = np.diff(np.unwrap(np.arctan2(*np.diff(line, axis=0).T[::-1])))
    left, right = (_offset(line, side * wall / 2, closed=False) for side in (1, -1))
    radii = np.zeros((2, len(line)))
    for k, turn in enumerate(turns, start=1):
        inner = float(rng.choice(RADII))
        outer = inner + wall if inner > 0 or rng.random() < 0.5 else 0.0
        radii[:, k] = (inner, outer) if turn > 0 else (outer, inner)
    corners = np.vstack([left, right[::-1]])[::-1]
    return _drawn(_outline(corners, np.concatenate([radii[0], radii[1][::-1]])[::-1]), width)


# -----------------------------------------------------------------------------
# Holes.


def _cylinder(at: np.ndarray, way: np.ndarray, radius: float, depth: float) -> TopoDS_Shape:
    axes = gp_Ax2(gp_Pnt(*at.tolist()), gp_Dir(*way.tolist()))
    return BRepPrimAPI_MakeCylinder(axes, radius, depth).Shape()


def _pierced(
    part: BentPart,
    rng: np.random.Generator,
    at: np.ndarray,
    outward: np.ndarray,
    wall: float,
    room: float,
    *,
    either: bool = False,
) -> None:
    """Make a hole about `at` on the outer side: through, blind, or sunk from one or both sides."""
    radius = float(rng.uniform(0.15, 0.4)) * room
    what = rng.choice(["through", "through", "through", "blind", "sunk"])
    if what == "sunk" and (radius + wall + 0.6 > 0.47 * room or wall < 1.2):
        what = "through"
    depth = wall / 2 if what == "blind" else 1.5 * wall
    top = at + 0.5 * wall * outward
    tool = _cylinder(top, -outward, radius, depth + 0.5 * wall)
    part.shape = BRepAlgoAPI_Cut(part.shape, tool).Shape()
    if what == "blind":
        part.blind += 1
        return
    if what == "sunk":
        ends = [(at, -outward), (at - wall * outward, outward)]  # outside, inside, both
        for start, way in ends[slice(*((0, 1), (1, 2), (0, 2))[rng.integers(3)])]:
            deep = float(rng.uniform(0.2, 0.4)) * wall
            if rng.random() < 0.5:
                step = _cylinder(start - way, way, radius + 0.6 + deep, deep + 1.0)
                part.shape = BRepAlgoAPI_Cut(part.shape, step).Shape()
            else:
                axes = gp_Ax2(gp_Pnt(*start.tolist()), gp_Dir(*way.tolist()))
                cone = BRepPrimAPI_MakeCone(axes, radius + 0.6 + deep, radius, deep).Shape()
                part.shape = BRepAlgoAPI_Cut(part.shape, cone).Shape()
    part.holes.append(Hole(at, outward, radius, either, sunk=what == "sunk"))


def _on_flats(
    part: BentPart,
    rng: np.random.Generator,
    line: np.ndarray,
    wall: float,
    width: float,
    left: float,
    *,
    either: bool = False,
) -> None:
    """Make holes in the flats of a polyline, from its left (1) or right (-1) side."""
    for start, end in pairwise(line):
        along = (end - start) / np.linalg.norm(end - start)
        normal = left * np.array([-along[1], along[0]])
        room = min(float(np.linalg.norm(end - start)) - 18, width / 3)
        for k in range(int(rng.integers(0, 3))):
            at = (start + end) / 2 + normal * wall / 2
            y = width * (k + 1) / 3
            outward = np.array([normal[0], 0.0, normal[1]])
            point = np.array([at[0], y, at[1]])
            _pierced(part, rng, point, outward, wall, room, either=either)


# -----------------------------------------------------------------------------
# Families.


def _line(rng: np.random.Generator, turns: np.ndarray) -> np.ndarray:
    """Return a polyline (K, 2) with the turns (rad) between flats of random lengths."""
    angles = np.concatenate([[0.0], np.cumsum(turns)])
    lengths = rng.uniform(35, 70, len(angles))
    steps = lengths[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    return np.vstack([np.zeros(2), np.cumsum(steps, axis=0)])


def _sheet(rng: np.random.Generator) -> BentPart:
    """Return a sheet with bends to its left: the right side is the outer one."""
    count = int(rng.integers(1, 4))
    turns = np.radians(rng.uniform(30, 95 if count < 3 else 70, count))
    wall, width = float(rng.uniform(0.8, 3)), float(rng.uniform(60, 150))
    line = _line(rng, turns)
    part = BentPart("", _profile(rng, line, wall, width))
    _on_flats(part, rng, line, wall, width, -1)
    return part


def _zigzag(rng: np.random.Generator) -> BentPart:
    turns = np.radians(rng.uniform(40, 90, 2)) * [1, -1]
    wall, width = float(rng.uniform(0.8, 3)), float(rng.uniform(60, 150))
    line = _line(rng, turns)
    part = BentPart("", _profile(rng, line, wall, width))
    _on_flats(part, rng, line, wall, width, 1, either=True)
    return part


def _tube(rng: np.random.Generator) -> BentPart:
    wall, width = float(rng.uniform(1, 4)), float(rng.uniform(100, 300))
    x, z = rng.uniform(35, 90, 2)
    if rng.random() < 0.3:  # an L
        line = np.array([[0, 0], [2 * x, 0], [2 * x, z], [x, z], [x, 2 * z], [0, 2 * z]])
    elif rng.random() < 0.5:
        around = np.arange(6) * np.pi / 3
        line = x * np.stack([np.cos(around), np.sin(around)], axis=1)
    else:
        line = np.array([[0, 0], [x, 0], [x, z], [0, z]], dtype=float)
    inner = float(rng.choice(RADII))
    outer = inner + wall if inner > 0 or rng.random() < 0.3 else 0.0
    way = np.roll(line, -1, axis=0) - line
    back = np.roll(way, 1, axis=0)
    convex = back[:, 0] * way[:, 1] - back[:, 1] * way[:, 0] > 0
    out = _drawn(
        _outline(_offset(line, -wall / 2, closed=True), np.where(convex, outer, inner)), width
    )
    hollow = _outline(_offset(line, wall / 2, closed=True), np.where(convex, inner, outer))
    part = BentPart("", BRepAlgoAPI_Cut(out, _drawn(hollow, width)).Shape())
    _on_flats(part, rng, np.vstack([line, line[:1]]), wall, width, -1)
    return part


def _filleted(shape: TopoDS_Shape, radius: float, wanted: str) -> TopoDS_Shape:
    """Return a box with its upright edges and those of its bottom, or all edges, rounded."""
    if radius <= 0:
        return shape
    tool, explorer = BRepFilletAPI_MakeFillet(shape), TopExp_Explorer(shape, TopAbs_EDGE)
    low = _lowest(shape)
    while explorer.More():
        edge = TopoDS.Edge(explorer.Current())
        ends = _ends(edge)
        if wanted == "all" or not (np.abs(ends[:, 2] - low) > 1e-6).all():
            tool.Add(radius, edge)
        explorer.Next()
    return tool.Shape()


def _ends(edge: TopoDS_Edge) -> np.ndarray:
    curve = BRepAdaptor_Curve(edge)
    ends = [curve.Value(t) for t in (curve.FirstParameter(), curve.LastParameter())]
    return np.array([[p.X(), p.Y(), p.Z()] for p in ends])


def _lowest(shape: TopoDS_Shape) -> float:
    explorer, least = TopExp_Explorer(shape, TopAbs_EDGE), np.inf
    while explorer.More():
        least = min(least, _ends(TopoDS.Edge(explorer.Current()))[:, 2].min())
        explorer.Next()
    return float(least)


def _pan(rng: np.random.Generator) -> BentPart:
    """Return a drawn pan, open at its top; its corners have the radius of its bottom, or none."""
    wall = float(rng.uniform(0.8, 3))
    x, y, z = (float(v) for v in (*rng.uniform(70, 160, 2), rng.uniform(35, 70)))
    inner = float(rng.choice((0.0, 3.0, 8.0, 12.0)))
    outer = inner + wall if inner > 0 else 0.0
    outside = _filleted(BRepPrimAPI_MakeBox(x, y, z).Shape(), outer, "lower")
    box = BRepPrimAPI_MakeBox(gp_Pnt(wall, wall, wall), x - 2 * wall, y - 2 * wall, z + 50).Shape()
    part = BentPart("", BRepAlgoAPI_Cut(outside, _filleted(box, inner, "lower")).Shape())
    room = min(x, y, 2 * z) / 2 - 2 * outer
    sides = [
        (np.array([x / 2, y / 2, 0.0]), np.array([0.0, 0.0, -1.0])),
        (np.array([x / 2, 0.0, z / 2 + outer / 2]), np.array([0.0, -1.0, 0.0])),
        (np.array([x, y / 2, z / 2 + outer / 2]), np.array([1.0, 0.0, 0.0])),
    ]
    for at, outward in sides:
        if rng.random() < 0.7:
            _pierced(part, rng, at, outward, wall, min(room, z - outer - 6))
    return part


def _beam(rng: np.random.Generator) -> BentPart:
    """Return an I section: its flanges are cut from outside, its web from either side."""
    wall = float(rng.uniform(3, 6))
    width, height, length = (
        float(rng.uniform(*each)) for each in ((60, 100), (70, 120), (150, 300))
    )
    shape = BRepPrimAPI_MakeBox(length, width, wall).Shape()
    top = BRepPrimAPI_MakeBox(gp_Pnt(0, 0, height - wall), length, width, wall).Shape()
    web = BRepPrimAPI_MakeBox(
        gp_Pnt(0, (width - wall) / 2, wall / 2), length, wall, height - wall
    ).Shape()
    one = BRepAlgoAPI_Fuse(BRepAlgoAPI_Fuse(shape, top).Shape(), web).Shape()
    unify = ShapeUpgrade_UnifySameDomain(one, True, True, False)
    unify.Build()
    part = BentPart("", unify.Shape())
    room = (width - wall) / 2 - 6
    x = length / 3
    for at, outward in (
        (np.array([x, width / 4, 0.0]), np.array([0.0, 0.0, -1.0])),
        (np.array([x, 3 * width / 4, height]), np.array([0.0, 0.0, 1.0])),
    ):
        _pierced(part, rng, at, outward, wall, room)
    at = np.array([2 * x, (width + wall) / 2, height / 2])
    _pierced(part, rng, at, np.array([0.0, 1.0, 0.0]), wall, height / 2, either=True)
    return part


def _ribbed(rng: np.random.Generator) -> BentPart:
    """Return a plate with a rib across its top: cut from below, where nothing is in the way."""
    wall = float(rng.uniform(1.5, 4))
    x, y = rng.uniform(90, 160, 2).tolist()
    plate = BRepPrimAPI_MakeBox(x, y, wall).Shape()
    thick = wall * float(rng.choice((0.5, 1.0, 1.0, 1.5)))
    margin = float(rng.choice((0.0, 10.0)))
    rib = BRepPrimAPI_MakeBox(
        gp_Pnt(x / 2 - thick / 2, margin, wall / 2), thick, y - 2 * margin, 30.0
    ).Shape()
    part = BentPart("", BRepAlgoAPI_Fuse(plate, rib).Shape())
    for at in ([x / 4, y / 3, 0.0], [3 * x / 4, 2 * y / 3, 0.0]):
        _pierced(part, rng, np.array(at), np.array([0.0, 0.0, -1.0]), wall, x / 4)
    return part


def _broken(rng: np.random.Generator) -> BentPart:
    """Return a flat sheet all of whose edges are rounded; it has no outer side."""
    wall = float(rng.uniform(1.5, 4))
    x, y = rng.uniform(60, 160, 2).tolist()
    part = BentPart("", BRepPrimAPI_MakeBox(x, y, wall).Shape())
    for k in range(int(rng.integers(1, 4))):
        radius = float(rng.uniform(3, 8))
        at = np.array([x * (k + 1) / 4, y / 2, 0.0])
        down = np.array([0.0, 0.0, -1.0])
        part.shape = BRepAlgoAPI_Cut(
            part.shape, _cylinder(at + wall * down, -down, radius, 3 * wall)
        ).Shape()
        part.holes.append(Hole(at, down, radius, either=True))
    part.shape = _filleted(part.shape, float(rng.uniform(0.1, 0.4)), "all")
    return part


_MAKERS = {
    "sheet": _sheet, "zigzag": _zigzag, "tube": _tube, "pan": _pan, "beam": _beam,
    "ribbed": _ribbed, "broken": _broken,
}  # fmt: skip
