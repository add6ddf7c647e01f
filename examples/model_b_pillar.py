"""Model the shipped example part, a hot-stamped B-pillar, and write it as a STEP file.

    python examples/model_b_pillar.py [FILE]

The part frame has x along the pillar from sill to roof rail, y across it and z out of the car.
All lengths are in mm, as in the file. The skin is a height over the plan view, interpolated by one
bicubic B-spline face named "skin"; the trim line and the holes are curves on that face; the sheet
is the skin thickened inwards, its cut faces ruled along the normal.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from OCP.BRep import BRep_Builder, BRep_Tool
from OCP.BRepBuilderAPI import (
    BRepBuilderAPI_MakeEdge,
    BRepBuilderAPI_MakeFace,
    BRepBuilderAPI_MakeSolid,
    BRepBuilderAPI_MakeVertex,
    BRepBuilderAPI_MakeWire,
)
from OCP.BRepCheck import BRepCheck_Analyzer
from OCP.BRepFill import BRepFill
from OCP.BRepLib import BRepLib
from OCP.collections import Array1_double, Array1_gp_Pnt, Array1_gp_Pnt2d, Array1_int, Array2_gp_Pnt
from OCP.Geom import Geom_BSplineCurve, Geom_BSplineSurface, Geom_OffsetSurface, Geom_Surface
from OCP.Geom2d import Geom2d_BSplineCurve
from OCP.gp import gp_Pnt, gp_Pnt2d
from OCP.Interface import Interface_Static
from OCP.Message import Message
from OCP.ShapeFix import ShapeFix_Shell
from OCP.STEPConstruct import STEPConstruct
from OCP.STEPControl import STEPControl_StepModelType, STEPControl_Writer
from OCP.TCollection import TCollection_HAsciiString
from OCP.TopAbs import TopAbs_ShapeEnum
from OCP.TopExp import TopExp_Explorer
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS, TopoDS_Edge, TopoDS_Shape, TopoDS_Shell, TopoDS_Solid, TopoDS_Wire
from scipy.interpolate import BSpline, make_interp_spline

Array = NDArray[np.float64]

FILE = Path(__file__).parents[1] / "src" / "kerfpath" / "demo" / "b_pillar.step"
LENGTH = 1200.0
WALL = 1.5
JOIN = 3e-3
"""Edges closer than this, mm, count as one."""
FLANGE = 26.0
"""Distance from the middle of the hat's side wall to the trim line, mm."""
V_TRIM = 150.0
"""Surface parameter v of the nominal trim line; u is x in mm."""


def half_width(x: Array) -> Array:
    """Half the width of the pillar at `x`: it flares towards the sill and the roof rail."""
    return np.asarray(
        72 + 100 * np.exp(-((x / 185) ** 2)) + 38 * np.exp(-(((LENGTH - x) / 120) ** 2))
    )


def centre(x: Array) -> Array:
    """Middle of the pillar at `x`: its upper half leans back."""
    return np.asarray(9 * np.tanh((x - 620) / 260))


def height(x: Array, y: Array) -> Array:
    """Height z of the skin over the plan view (x, y): bow, hat, rounded crown and bead."""
    end = np.exp(-((x / 130) ** 2)) + np.exp(-(((LENGTH - x) / 110) ** 2))
    bow = 78 * (1 - ((x - 560) / 640) ** 2)
    side = y - centre(x)
    depth = 50 - 22 * end
    softness = 6.5 + 6.5 * end
    wall = half_width(x) - FLANGE - 6 * end
    hat = _step((wall - side) / softness) * _step((wall + side) / softness)
    crown = -(side**2) / 1600 * hat
    bead = -5 * np.exp(-((side / 20) ** 2)) * _step((x - 430) / 25) * _step((1010 - x) / 25)
    return np.asarray(bow + depth * hat + crown + bead)


def _step(t: Array) -> Array:
    return np.asarray(1 / (1 + np.exp(-t)))


def plan(uv: Array) -> Array:
    """Return the points (..., 3) of the skin at parameters `uv` (..., 2)."""
    x = uv[..., 0]
    y = centre(x) + uv[..., 1] / V_TRIM * half_width(x)
    return np.stack([x, y, height(x, y)], axis=-1)


def skin_surface() -> Geom_BSplineSurface:
    """Interpolate the skin on a grid of 31 mm along the pillar and 4 to 9 mm across it."""
    u = np.linspace(-25.0, LENGTH + 25, 41)
    v = np.linspace(-1.1 * V_TRIM, 1.1 * V_TRIM, 45)
    points = plan(np.stack(np.meshgrid(u, v, indexing="ij"), axis=-1))
    along = make_interp_spline(u, points, k=3)
    across = make_interp_spline(v, along.c.transpose(1, 0, 2), k=3)
    return spline_surface(across.c.transpose(1, 0, 2), along, across)


def spline_surface(poles: Array, along: BSpline, across: BSpline) -> Geom_BSplineSurface:
    """Return the surface of `poles` (U, V, 3) over the knots of the two splines."""
    net = Array2_gp_Pnt(1, poles.shape[0], 1, poles.shape[1])
    for i, j in np.ndindex(*poles.shape[:2]):
        net.SetValue(i + 1, j + 1, gp_Pnt(*_rounded(poles[i, j])))
    (u_knots, u_mults), (v_knots, v_mults) = _knots(along), _knots(across)
    return Geom_BSplineSurface(net, u_knots, v_knots, u_mults, v_mults, along.k, across.k)


def interpolate(points: Array) -> BSpline:
    """Return the cubic spline through `points` (K, d), smooth also where its ends agree."""
    t = np.arange(float(len(points)))
    if np.linalg.norm(points[0] - points[-1]) > JOIN:
        return make_interp_spline(t, points, k=3)
    points = np.vstack([points[:-1], points[:1]])
    # The same curve as the periodic spline, but on clamped knots, which every CAD system reads.
    tangent = make_interp_spline(t, points, k=3, bc_type="periodic")(0.0, 1)
    ends: Any = ([(1, tangent)], [(1, tangent)])  # scipy's stubs know only conditions by name
    return make_interp_spline(t, points, k=3, bc_type=ends)


def _knots(spline: BSpline) -> tuple[Array1_double, Array1_int]:
    values, counts = np.unique(spline.t, return_counts=True)
    knots, multiplicities = Array1_double(1, len(values)), Array1_int(1, len(values))
    for k, (value, count) in enumerate(zip(values, counts, strict=True), start=1):
        knots.SetValue(k, float(value))
        multiplicities.SetValue(k, int(count))
    return knots, multiplicities


def _rounded(values: Array) -> Array:
    """Round to a nanometre, so that another machine's last bits do not change the file."""
    return np.round(values, 6)


def trim_line() -> list[Array]:
    """Return the trim line: the uniform cubic B-spline of a coarse frame, as points in (u, v).

    Such a curve rounds a square corner of its frame with about a third of the frame's spacing.
    """
    side = np.linspace(0.0, LENGTH, 13)
    frame = np.concatenate(
        [
            [(0.0, v) for v in np.linspace(V_TRIM, -V_TRIM, 4)],
            [(u, -V_TRIM) for u in side[1:]],
            [(LENGTH, 0.0)],
            [(u, V_TRIM) for u in side[:0:-1]],
        ]
    )
    count = len(frame)
    periodic = BSpline(np.arange(-3.0, count + 4), np.vstack([frame, frame[:3]]), 3)
    return [periodic(np.linspace(0.0, count, 12 * count + 1))]


def disc(diameter: float) -> list[Array]:
    """Return a round hole as one piece of points (K, 2) about its centre."""
    angle = np.linspace(0.0, 2 * np.pi, 33)
    return [diameter / 2 * np.stack([np.cos(angle), np.sin(angle)], axis=1)]


def rounded_box(length: float, width: float, radius: float) -> list[Array]:
    """Return a rectangle with round corners, or a slot, as lines and arcs in turn."""
    a, b = length / 2 - radius, width / 2 - radius
    pieces: list[Array] = []
    corners = np.array([(a, -b), (a, b), (-a, b), (-a, -b)])
    for k, corner in enumerate(corners):
        angle = np.pi / 2 * (k - 1 + np.linspace(0.0, 1.0, 11))
        arc = corner + radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        following = np.roll(corners, -1, axis=0)[k] - corner
        pieces.append(arc)
        if np.linalg.norm(following) > 0:
            pieces.append(arc[-1] + np.linspace(0.0, 1.0, 9)[:, None] * following)
    return pieces


def on_skin(pieces: list[Array], u: float, v: float, angle_deg: float = 0.0) -> list[Array]:
    """Project flat `pieces` from the tangent plane at (u, v) on the skin, as points (u, v)."""
    origin, step = np.array([u, v]), 1e-3 * np.eye(2)
    along, across = (plan(origin + step) - plan(origin - step)) / 2e-3
    e1 = along / np.linalg.norm(along)
    normal = np.cross(along, across)
    e2 = np.cross(normal / np.linalg.norm(normal), e1)
    turn = np.deg2rad(angle_deg)
    basis = np.stack([np.cos(turn) * e1 + np.sin(turn) * e2, np.cos(turn) * e2 - np.sin(turn) * e1])
    to_uv = np.linalg.inv(np.stack([along, across], axis=1).T @ basis.T)
    projected = []
    for piece in pieces:
        uv = origin + piece @ to_uv
        for _ in range(60):
            uv = uv + (piece - (plan(uv) - plan(origin)) @ basis.T) @ to_uv
        projected.append(uv)
    return projected


def openings() -> list[list[Array]]:
    """Return every hole of the skin: round ones, slots and the access opening."""
    return [
        on_skin(rounded_box(120, 60, 15), 265, 0),  # belt retractor
        on_skin(rounded_box(40, 18, 9), 470, 0, 90),  # lower hinge
        on_skin(disc(30), 100, -72),  # harness
        on_skin(disc(30), 100, 72),
        on_skin(disc(16), 105, 0),  # locating hole
        on_skin(disc(12), 425, -42),  # hinge bolts
        on_skin(disc(12), 425, 42),
        on_skin(disc(20), 600, 0),  # striker
        on_skin(disc(10), 720, 0),  # trim clip
        on_skin(rounded_box(36, 14, 7), 860, 0),  # belt height adjuster
        on_skin(disc(25), 1040, 0),  # belt anchor
        on_skin(disc(16), 1120, 0),  # locating hole
        *(on_skin(disc(8), 200, v) for v in (-137, 137)),  # flange: door seal
        *(on_skin(disc(14), 340, v) for v in (-74, 74)),  # flank: tooling holes, 43 deg
        on_skin(rounded_box(24, 9, 4.5), 560, 74),  # flank: harness clip, 46 deg
        *(on_skin(disc(11), 660, v) for v in (-52, 52)),  # weld nuts
        on_skin(rounded_box(24, 9, 4.5), 780, -74),  # flank: harness clip, 46 deg
        *(on_skin(disc(8), 900, v) for v in (-136, 136)),  # flange: door seal
        *(on_skin(disc(10), 1080, v) for v in (-52, 52)),  # weld nuts
    ]


def wire(pieces: list[Array], surface: Geom_Surface) -> tuple[TopoDS_Wire, list[TopoDS_Edge]]:
    """Return the closed wire through `pieces` of points (K, 2) in (u, v) of `surface`."""
    starts = [_rounded(np.array(surface.Value(*uv[0]).Coord())) for uv in pieces]
    corners = [BRepBuilderAPI_MakeVertex(gp_Pnt(*start)).Vertex() for start in starts]
    builder, edges = BRepBuilderAPI_MakeWire(), []
    for uv, start, end in zip(pieces, corners, corners[1:] + corners[:1], strict=True):
        spline = interpolate(np.array([surface.Value(*p).Coord() for p in uv]))
        poles = Array1_gp_Pnt(1, len(spline.c))
        for k, pole in enumerate(_rounded(spline.c), start=1):
            poles.SetValue(k, gp_Pnt(*pole))
        curve = Geom_BSplineCurve(poles, *_knots(spline), 3)
        edges.append(BRepBuilderAPI_MakeEdge(curve, start, end, 0.0, len(uv) - 1.0).Edge())
        builder.Add(edges[-1])
    return builder.Wire(), edges


def lay(edge: TopoDS_Edge, uv: Array, surface: Geom_Surface) -> None:
    """Give `edge` its curve in (u, v) of `surface`, with the parameter of its curve in space."""
    spline = interpolate(uv)
    poles = Array1_gp_Pnt2d(1, len(spline.c))
    for k, pole in enumerate(_rounded(spline.c), start=1):
        poles.SetValue(k, gp_Pnt2d(*pole))
    curve = Geom2d_BSplineCurve(poles, *_knots(spline), 3)
    BRep_Builder().UpdateEdge(edge, curve, surface, TopLoc_Location(), JOIN)


def faces(shape: TopoDS_Shape) -> Iterator[TopoDS_Shape]:
    """Yield the faces of `shape`."""
    explorer = TopExp_Explorer(shape, TopAbs_ShapeEnum.TopAbs_FACE)
    while explorer.More():
        yield explorer.Current()
        explorer.Next()


def sheet() -> tuple[TopoDS_Solid, Geom_Surface]:
    """Return the pillar as a solid, and the surface of its skin."""
    outside = skin_surface()
    inside = Geom_OffsetSurface(outside, -WALL)
    shell, builder = TopoDS_Shell(), BRep_Builder()
    builder.MakeShell(shell)
    wires = []
    for pieces in [trim_line(), *openings()]:
        (above, upper), (below, lower) = wire(pieces, outside), wire(pieces, inside)
        # Before the edges know the skin: BRepFill would refit their curves there, for many poles.
        for cut in faces(BRepFill.Shell_s(above, below)):
            builder.Add(shell, cut)
        for over, under, uv in zip(upper, lower, pieces, strict=True):
            lay(over, uv, outside)
            lay(under, uv, inside)
        wires.append((above, below))
    for k, surface in enumerate((outside, inside)):
        face = BRepBuilderAPI_MakeFace(surface, wires[0][k], True)
        for pair in wires[1:]:
            face.Add(TopoDS.Wire(pair[k].Reversed()))
        builder.Add(shell, face.Face())
    oriented = ShapeFix_Shell(shell)
    oriented.FixFaceOrientation(shell)
    solid = BRepBuilderAPI_MakeSolid(oriented.Shell()).Solid()
    BRepLib.OrientClosedSolid_s(solid)
    if not BRepCheck_Analyzer(solid).IsValid():
        raise RuntimeError("the sheet is not a valid solid; look for curves that meet")
    return solid, outside


def write(path: Path) -> None:
    """Write the pillar to `path`, the same bytes each time."""
    Message.DefaultMessenger_s().ChangePrinters().Clear()
    writer = STEPControl_Writer()
    Interface_Static.SetCVal_s("write.step.product.name", "B-pillar")
    solid, skin = sheet()
    writer.Transfer(solid, STEPControl_StepModelType.STEPControl_AsIs)
    for face in faces(solid):
        if BRep_Tool.Surface_s(TopoDS.Face(face)) is skin:
            entity = STEPConstruct.FindEntity_s(writer.WS().TransferWriter().FinderProcess(), face)
            entity.SetName(TCollection_HAsciiString("skin"))
    writer.CleanDuplicateEntities()
    path.parent.mkdir(parents=True, exist_ok=True)
    writer.Write(str(path))
    header = "FILE_NAME('b_pillar.step','2026-01-01T00:00:00',(''),(''),'','kerfpath','');"
    text = re.sub(r"FILE_NAME\(.*?\);", header, path.read_text("ascii"), count=1, flags=re.DOTALL)
    # OCCT counts the products that a process has written.
    path.write_text(re.sub(r"'B-pillar \d+'", "'B-pillar'", text), "ascii", newline="\n")


if __name__ == "__main__":
    target = Path(sys.argv[1]) if len(sys.argv) > 1 else FILE
    write(target)
    print(f"wrote {target} ({target.stat().st_size} bytes)")
