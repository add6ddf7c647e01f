"""Bent sheets of known sides: a profile of lines and bends, given thickness and width."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut
from OCP.BRepBuilderAPI import (
    BRepBuilderAPI_MakeEdge,
    BRepBuilderAPI_MakeFace,
    BRepBuilderAPI_MakePolygon,
    BRepBuilderAPI_MakeWire,
)
from OCP.BRepPrimAPI import BRepPrimAPI_MakeCone, BRepPrimAPI_MakeCylinder, BRepPrimAPI_MakePrism
from OCP.GC import GC_MakeArcOfCircle
from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt, gp_Vec
from OCP.TopoDS import TopoDS_Edge, TopoDS_Shape

WALL, BEND, WIDTH = 2.0, 3.0, 60.0
"""Thickness, inner radius of every bend, and width, mm."""
PROFILES = {
    "L": (50, 90, 40),
    "U": (30, 90, 50, 90, 30),
    "shallow U": (12, 90, 120, 90, 12),
    "C with returns": (10, 90, 30, 90, 60, 90, 30, 90, 10),
    "V": (60, 30, 60),
    "hat": (20, 90, 35, -90, 60, -90, 35, 90, 20),
    "hat with wide flanges": (45, 60, 30, -60, 50, -60, 30, 60, 45),
}
"""Lengths of the flats, mm, and the angles of the bends between them, deg, to the left."""
OUTER = {name: "left" if name.startswith("hat") else "right" for name in PROFILES}
"""Their outer sides, seen along the profile."""


def _side(profile: tuple[float, ...], left: float) -> list[tuple[np.ndarray, ...]]:
    """Return the pieces of the profile at a distance to its left: ends, and a middle of a bend."""
    at, turn, pieces = np.zeros(2), 0.0, []
    for k, value in enumerate(profile):
        normal = np.array([-np.sin(turn), np.cos(turn)])
        if k % 2 == 0:
            start, at = at, at + value * np.array([np.cos(turn), np.sin(turn)])
            pieces.append((start + left * normal, at + left * normal))
            continue
        angle, sign = np.radians(value), np.sign(value)
        radius = BEND + WALL / 2
        centre = at + sign * radius * normal
        arms = [turn + part * angle for part in (0.0, 0.5, 1.0)]
        points = [
            centre + (left - sign * radius) * np.array([-np.sin(arm), np.cos(arm)]) for arm in arms
        ]
        pieces.append(tuple(points))
        at = centre - sign * radius * np.array([-np.sin(arms[2]), np.cos(arms[2])])
        turn += angle
    return pieces


def _point(p: np.ndarray) -> gp_Pnt:
    return gp_Pnt(float(p[0]), 0.0, float(p[1]))


def _edge(piece: tuple[np.ndarray, ...]) -> TopoDS_Edge:
    if len(piece) == 2:
        return BRepBuilderAPI_MakeEdge(_point(piece[0]), _point(piece[1])).Edge()
    return BRepBuilderAPI_MakeEdge(GC_MakeArcOfCircle(*map(_point, piece)).Value()).Edge()


def sheet(profile: tuple[float, ...]) -> TopoDS_Shape:
    """Return a sheet of a profile in the plane y = 0, as wide as `WIDTH` along y."""
    left, right = _side(profile, WALL / 2), _side(profile, -WALL / 2)
    back = [piece[::-1] for piece in reversed(right)]
    ends = [(left[-1][-1], right[-1][-1]), (right[0][0], left[0][0])]
    wire = BRepBuilderAPI_MakeWire()
    for piece in (*left, ends[0], *back, ends[1]):
        wire.Add(_edge(piece))
    face = BRepBuilderAPI_MakeFace(wire.Wire()).Face()
    return BRepPrimAPI_MakePrism(face, gp_Vec(0, WIDTH, 0)).Shape()


def rim_point(profile: tuple[float, ...], side: str) -> np.ndarray:
    """Return a point (3,) m on the trim line of one side: in the middle of its first flat."""
    start, end = _side(profile, WALL / 2 if side == "left" else -WALL / 2)[0]
    x, z = (start + end) / 2
    return np.array([x, 0.0, z]) / 1000


def sunk(shape: TopoDS_Shape, profile: tuple[float, ...], side: str, count: int) -> TopoDS_Shape:
    """Return a sheet with holes along its middle flat, each countersunk from one side."""
    flat = len(profile) // 4 * 2
    start, end = _side(profile, 0.0)[flat]
    along = (end - start) / np.linalg.norm(end - start)
    normal = np.array([-along[1], along[0]]) * (1 if side == "left" else -1)
    for k in range(count):
        at = (start + end) / 2
        y = WIDTH * (k + 1) / (count + 1)
        top = at + normal * WALL / 2
        axes = gp_Ax2(gp_Pnt(float(top[0]), y, float(top[1])), gp_Dir(-normal[0], 0.0, -normal[1]))
        shape = BRepAlgoAPI_Cut(
            shape, BRepPrimAPI_MakeCylinder(axes, 1.5, 2 * WALL).Shape()
        ).Shape()
        cone = BRepPrimAPI_MakeCone(axes, 3.0, 1.5, 1.5).Shape()
        shape = BRepAlgoAPI_Cut(shape, cone).Shape()
    return shape


class Folded(NamedTuple):
    """A sheet folded without radii; the convex sides of its folds are its outer side.

    Parameters
    ----------
    shape : TopoDS_Shape
    corners : (K, 2) mm
        Ends and folds of its outer side, in the plane y = 0 (x, z).
    normals : (K - 1, 3)
        Outward normals of the walls between them.
    """

    shape: TopoDS_Shape
    corners: np.ndarray
    normals: np.ndarray


def folded(seed: int) -> Folded:
    """Return a random folded sheet with a round hole across each of its folds."""
    rng = np.random.default_rng(seed)
    angles = np.radians(rng.uniform(30, 90, rng.integers(1, 4)))
    heading = np.concatenate([[0.0], -np.cumsum(angles)])
    ways = np.stack([np.cos(heading), np.sin(heading)], axis=1)
    lengths = rng.uniform(20, 60, len(ways))
    corners = np.vstack([np.zeros(2), np.cumsum(lengths[:, None] * ways, axis=0)])
    across = np.stack([-ways[:, 1], ways[:, 0]], axis=1)  # outward, as it folds to the right
    mitre = across[1:] + across[:-1]
    mitre *= (2 / (mitre * mitre).sum(axis=1))[:, None]
    mitre = np.vstack([across[:1], mitre, across[-1:]])
    wall = rng.uniform(0.8, 3.0)
    polygon = BRepBuilderAPI_MakePolygon()
    for x, z in np.vstack([corners, (corners - wall * mitre)[::-1]]).tolist():
        polygon.Add(gp_Pnt(x, 0.0, z))
    polygon.Close()
    face = BRepBuilderAPI_MakeFace(polygon.Wire()).Face()
    shape = BRepPrimAPI_MakePrism(face, gp_Vec(0, WIDTH, 0)).Shape()
    for corner, out in zip(corners[1:-1], mitre[1:-1], strict=True):
        out = out / np.linalg.norm(out)
        x, z = (corner + 5 * wall * out).tolist()
        axes = gp_Ax2(gp_Pnt(x, WIDTH / 2, z), gp_Dir(-out[0], 0.0, -out[1]))
        drill = BRepPrimAPI_MakeCylinder(axes, float(rng.uniform(3, 8)), 10 * wall).Shape()
        shape = BRepAlgoAPI_Cut(shape, drill).Shape()
    normals = np.stack([across[:, 0], 0 * across[:, 0], across[:, 1]], axis=1)
    return Folded(shape, corners, normals)
