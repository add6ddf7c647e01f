"""Loops of a face, points and normals along them, and the healed surface around them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import Literal

import numpy as np
from OCP.Bnd import Bnd_Box
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve, BRepAdaptor_Surface
from OCP.BRepBndLib import BRepBndLib
from OCP.BRepTools import BRepTools, BRepTools_WireExplorer
from OCP.collections import Array1_double
from OCP.GCPnts import GCPnts_AbscissaPoint
from OCP.Geom2d import Geom2d_Curve
from OCP.Geom2dAdaptor import Geom2dAdaptor_Curve
from OCP.GeomAbs import GeomAbs_CurveType, GeomAbs_Shape, GeomAbs_SurfaceType
from OCP.gp import gp_Ax3, gp_Pnt, gp_Vec, gp_XYZ
from OCP.ShapeAnalysis import ShapeAnalysis_Surface
from OCP.TopAbs import TopAbs_Orientation, TopAbs_ShapeEnum
from OCP.TopoDS import TopoDS, TopoDS_Edge, TopoDS_Face, TopoDS_Shape, TopoDS_Wire
from scipy.spatial import cKDTree

from kerfpath.arrays import Array
from kerfpath.cad.curves import AROUND, EdgeChain
from kerfpath.cad.shape import children, list_shapes
from kerfpath.cad.units import LARGEST, MM
from kerfpath.errors import InputError

# -----------------------------------------------------------------------------
# Points and normals along curves on planes, cylinders and cones, many at once.
#
# Most edges of parts lie on these surfaces, and OCCT evaluates only one point at a time.

LINE, CIRCLE = GeomAbs_CurveType.GeomAbs_Line, GeomAbs_CurveType.GeomAbs_Circle
PLANE = GeomAbs_SurfaceType.GeomAbs_Plane
CYLINDER, CONE = GeomAbs_SurfaceType.GeomAbs_Cylinder, GeomAbs_SurfaceType.GeomAbs_Cone


def parameters_on(curve: Geom2d_Curve, t: Array) -> Array:
    """Return the surface parameters (K, 2) at the parameters t (K,) of a curve on the surface."""
    adaptor = Geom2dAdaptor_Curve(curve)
    if adaptor.GetType() == LINE:
        line = adaptor.Line()
        at, way = line.Location(), line.Direction()
        return np.asarray(np.array([at.X(), at.Y()]) + t[:, None] * (way.X(), way.Y()))
    if adaptor.GetType() == CIRCLE:
        circle = adaptor.Circle()
        at, x, y = circle.Location(), circle.XAxis().Direction(), circle.YAxis().Direction()
        around = np.cos(t)[:, None] * (x.X(), x.Y()) + np.sin(t)[:, None] * (y.X(), y.Y())
        return np.asarray(np.array([at.X(), at.Y()]) + circle.Radius() * around)
    found = [curve.Value(one) for one in t.tolist()]
    return np.array([[p.X(), p.Y()] for p in found])


class ElementarySurface:
    """A plane, a cylinder or a cone: origin + (radius + slope v) e(u) + rise v z, or u x + v y.

    Parameters
    ----------
    position : gp_Ax3
    radius, slope, rise : float
        Radius (mm), and slope and rise (no unit) of a cylinder or cone; all 0 for a plane.
    """

    def __init__(self, position: gp_Ax3, radius: float, slope: float, rise: float) -> None:
        x, y, z = position.XDirection(), position.YDirection(), position.Direction()
        self._origin = _vector(position.Location().XYZ())
        self._x, self._y, self._z = (_vector(axis.XYZ()) for axis in (x, y, z))
        self._xy, self._yz, self._xz = (
            _vector(a.XYZ().Crossed(b.XYZ())) for a, b in ((x, y), (y, z), (x, z))
        )
        self._radius, self._slope, self._rise = radius, slope, rise

    @classmethod
    def of(cls, surface: BRepAdaptor_Surface) -> ElementarySurface | None:
        """Return the surface if it is one of these, else None."""
        kind = surface.GetType()
        if kind == PLANE:
            return cls(surface.Plane().Position(), 0.0, 0.0, 0.0)
        if kind == CYLINDER:
            cylinder = surface.Cylinder()
            return cls(cylinder.Position(), cylinder.Radius(), 0.0, 1.0)
        if kind == CONE:
            cone = surface.Cone()
            half = cone.SemiAngle()
            return cls(cone.Position(), cone.RefRadius(), float(np.sin(half)), float(np.cos(half)))
        return None

    def at(self, uv: Array) -> tuple[Array, Array]:
        """Return points (K, 3) mm and normals du x dv (K, 3), of any length, at uv (K, 2)."""
        u, v = uv[:, :1], uv[:, 1:]
        if not self._rise:
            normals = np.empty((len(uv), 3))
            normals[:] = self._xy
            return self._origin + u * self._x + v * self._y, normals
        cos, sin = np.cos(u), np.sin(u)
        reach = self._radius + self._slope * v
        points = self._origin + reach * (cos * self._x + sin * self._y) + self._rise * v * self._z
        across = self._rise * (cos * self._yz - sin * self._xz) - self._slope * self._xy
        return points, reach * across


def _vector(at: gp_XYZ) -> Array:
    return np.array([at.X(), at.Y(), at.Z()])


# -----------------------------------------------------------------------------
# The loops: wires without seams, with each edge in the direction of travel.

FORWARD, REVERSED = TopAbs_Orientation.TopAbs_FORWARD, TopAbs_Orientation.TopAbs_REVERSED

SINGULAR = 1e-9
"""Area that the two directions of a surface span, as a share of the square of the longer one, below
which they define no normal, as at a pole or the tip of a cone."""
EVENLY = np.linspace(0.0, 1.0, AROUND + 1)
"""Places at which an edge is evaluated, from its start to its end."""
NUDGE = 1e-4
"""Distance from a point without normal at which the normal is taken, as a share of the edge."""


class FaceSurface:
    """The surface of a face.

    Parameters
    ----------
    face : TopoDS_Face
    """

    def __init__(self, face: TopoDS_Face) -> None:
        self.adaptor = BRepAdaptor_Surface(face)
        self.elementary = ElementarySurface.of(self.adaptor)


class OrientedEdge:
    """An edge of a face in the direction of travel, evaluated on the face.

    The face is on the left of the direction of travel, seen with its outward normal up.

    Parameters
    ----------
    edge : TopoDS_Edge
        The edge as oriented in the FORWARD face.
    face : TopoDS_Face
        The face in its own orientation.
    surface : FaceSurface
        Surface of the face; one for all its edges, because building it inspects every edge.
    """

    def __init__(self, edge: TopoDS_Edge, face: TopoDS_Face, surface: FaceSurface) -> None:
        self.edge, self.face, self._on = edge, face, surface
        self.surface = surface.adaptor
        self.outward = -1.0 if face.Orientation() == REVERSED else 1.0
        first, last = BRep_Tool.Range_s(edge, face)
        # A REVERSED face shows its other side, about which its wires run the other way round.
        backward = (edge.Orientation() == REVERSED) != (face.Orientation() == REVERSED)
        self.start, self.end = (last, first) if backward else (first, last)
        self._curve = BRep_Tool.CurveOnSurface_s(edge, face, first, last)
        if self._curve is None:
            raise InputError("an edge has no curve on its face; repair the part in CAD")
        t = self.start + (self.end - self.start) * EVENLY
        t[-1] = self.end
        points, normals = self.evaluate(t)
        self.around, self.ends = points[:-1], points[[0, -1]]
        self.end_normals = {self.start: normals[0], self.end: normals[-1]}

    def evaluate(self, t: Array) -> tuple[Array, Array]:
        """Return points (K, 3) mm and outward unit normals (K, 3) of the face at `t` (K,)."""
        if self._on.elementary is not None:
            points, across = self._on.elementary.at(parameters_on(self._curve, t))
            size = np.sqrt((across * across).sum(axis=1, keepdims=True))
            if size.min() > SINGULAR * max(1.0, float(np.abs(points).max())):
                self._require_near(points)
                return points, across * (self.outward / size)
        points, normals = np.empty((len(t), 3)), np.empty((len(t), 3))
        for k, parameter in enumerate(t.tolist()):
            point, normal = self._at(parameter)
            if normal is None:
                inwards = NUDGE * (self.start + self.end - 2 * parameter)
                normal = self._at(parameter + inwards)[1]
            if normal is None:
                raise InputError(f"a face has no normal at {point} mm; repair the part in CAD")
            points[k], normals[k] = point, normal
        self._require_near(points)
        return points, normals

    @staticmethod
    def _require_near(points: Array) -> None:
        if not (np.abs(points) <= LARGEST).all():
            raise InputError(
                f"an edge reaches further than {LARGEST / 1e6:g} km from the origin; the file is "
                "damaged, or its unit is wrong"
            )

    @property
    def length(self) -> float:
        return GCPnts_AbscissaPoint.Length_s(self._curve_in_space)

    @cached_property
    def _curve_in_space(self) -> BRepAdaptor_Curve:
        return BRepAdaptor_Curve(self.edge)

    def bounds(self) -> Array:
        if self._curve_in_space.GetType() == LINE:
            return np.stack([self.ends.min(axis=0), self.ends.max(axis=0)])
        return bounds_of(self.edge)

    def breaks(self) -> Array:
        curve = BRepAdaptor_Curve(self.edge, self.face)
        count = curve.NbIntervals(GeomAbs_Shape.GeomAbs_C2)
        ends = Array1_double(1, count + 1)
        curve.Intervals(ends, GeomAbs_Shape.GeomAbs_C2)
        low, high = sorted((self.start, self.end))
        inside = [t for t in ends if low < t < high]
        t = np.unique([low, *inside, high])
        return t if self.start < self.end else t[::-1]

    def in_parameters(self) -> Array:
        """Return the change (2,) of the surface parameters (u, v) along the edge."""
        start, end = self._curve.Value(self.start), self._curve.Value(self.end)
        return np.array([end.X() - start.X(), end.Y() - start.Y()])

    def _at(self, parameter: float) -> tuple[tuple[float, float, float], Array | None]:
        uv = self._curve.Value(parameter)
        point, du, dv = gp_Pnt(), gp_Vec(), gp_Vec()
        self.surface.D1(uv.X(), uv.Y(), point, du, dv)
        normal = du.Crossed(dv)
        size = normal.Magnitude()
        at = (point.X(), point.Y(), point.Z())
        if not size > SINGULAR * max(du.SquareMagnitude(), dv.SquareMagnitude()):
            return at, None
        return at, np.array([normal.X(), normal.Y(), normal.Z()]) * (self.outward / size)


FaceLoop = tuple[Literal["outer", "inner"], EdgeChain[OrientedEdge]]
"""Whether a loop runs around its face or around a hole in it, and its edges."""


def bounds_of(shape: TopoDS_Shape) -> Array:
    """Return the least and greatest coordinates (2, 3) mm of a shape."""
    box = Bnd_Box()
    BRepBndLib.AddOptimal_s(shape, box, False, False)
    return np.array([[c.X(), c.Y(), c.Z()] for c in (box.CornerMin(), box.CornerMax())])


def loops_of(face: TopoDS_Face) -> list[FaceLoop]:
    """Return the loops of `face`, each edge in the direction of travel.

    Outer loops run counter-clockwise about its outward normal, inner ones clockwise. Seams are not
    cut: without them, a tube has two outer loops, and a hole across the seam is an inner loop.
    """
    forward = TopoDS.Face(face.Oriented(FORWARD))
    outer_wire = BRepTools.OuterWire_s(forward)
    surface = FaceSurface(face)
    loops: list[FaceLoop] = []
    for found in list_shapes(forward, TopAbs_ShapeEnum.TopAbs_WIRE):
        wire = TopoDS.Wire(found)
        runs, has_seam = _runs(wire, forward, face, surface)
        for edges in join_runs(runs):
            chain = EdgeChain(edges=edges)
            if _winds(edges):  # the rim of a tube, or a hole about the pole of a sphere
                outer = not is_hole(chain)
            else:
                outer = wire.IsSame(outer_wire) and not has_seam
            loops.append(("outer" if outer else "inner", chain))
    return loops


def _runs(
    wire: TopoDS_Wire, forward: TopoDS_Face, face: TopoDS_Face, surface: FaceSurface
) -> tuple[list[list[OrientedEdge]], bool]:
    """Return the edges of `wire` in travel order, split at each seam, and whether it has a seam."""
    turned = (FORWARD, REVERSED)
    everything = [TopoDS.Edge(e) for e in children(wire) if e.Orientation() in turned]
    ordered = everything if len(everything) == 1 else list(_in_order(wire, forward))
    connected = len(ordered) == len(everything)
    runs: list[list[OrientedEdge]] = [[]]
    has_seam = False
    for edge in ordered if connected else everything:
        if BRep_Tool.IsClosed_s(edge, forward):
            has_seam = True
            runs.append([])
        elif not BRep_Tool.Degenerated_s(edge):
            runs[-1].append(OrientedEdge(edge, face, surface))
        if not connected:
            runs.append([])
    if face.Orientation() == REVERSED:
        runs = [run[::-1] for run in runs[::-1]]
    return [run for run in runs if run], has_seam


def _in_order(wire: TopoDS_Wire, face: TopoDS_Face) -> Iterator[TopoDS_Edge]:
    explorer = BRepTools_WireExplorer(wire, face)
    while explorer.More():
        yield explorer.Current()
        explorer.Next()


def join_runs(runs: list[list[OrientedEdge]]) -> Iterator[list[OrientedEdge]]:
    """Join runs into closed chains: each end continues at the nearest start, its own included."""
    if len(runs) == 1:
        yield runs[0]
        return
    starts = np.array([run[0].ends[0] for run in runs]).reshape(-1, 3)
    left = np.ones(len(runs), dtype=bool)
    while left.any():
        first = int(np.argmax(left))
        chain: list[OrientedEdge] = []
        following = first
        while following != first or not chain:
            chain = chain + runs[following]
            left[following] = following == first
            far = np.linalg.norm(starts - chain[-1].ends[1], axis=1)
            far[~left] = np.inf
            # If several starts are equally near, the chain is closed.
            following = first if far[first] <= far.min() else int(np.argmin(far))
        left[first] = False
        yield chain


HOLE = -0.25
"""Cosine between a loop's vector area and its mean normal below which it runs about a hole: for
holes it is near -1, for a trim line near 1, for the rim of a tube near 0."""


def is_hole(loop: EdgeChain[OrientedEdge]) -> bool:
    """Return whether a closed chain runs about a hole of its skin, by its normals."""
    area = loop.area
    middles = [(edge.start + edge.end) / 2 for edge in loop.edges]
    normals = [e.evaluate(np.array([t]))[1][0] for e, t in zip(loop.edges, middles, strict=True)]
    facing = loop.lengths @ np.array(normals) / loop.lengths.sum()
    return bool(area @ facing < HOLE * np.linalg.norm(area))


def _winds(edges: list[OrientedEdge]) -> bool:
    """Return whether the loop goes around its surface, as the rim of a tube does."""
    surface = edges[0].surface
    if surface.GetType() == PLANE:
        return False
    around = np.sum([edge.in_parameters() for edge in edges], axis=0)
    u = surface.UPeriod() if surface.IsUPeriodic() else _width(surface, "U")
    v = surface.VPeriod() if surface.IsVPeriodic() else _width(surface, "V")
    return bool((np.abs(around) > np.array([u, v]) / 2).any())


def _width(surface: BRepAdaptor_Surface, direction: Literal["U", "V"]) -> float:
    """Return the parameter range of a surface closed in `direction`, else infinity."""
    if direction == "U":
        closed, width = surface.IsUClosed(), surface.LastUParameter() - surface.FirstUParameter()
    else:
        closed, width = surface.IsVClosed(), surface.LastVParameter() - surface.FirstVParameter()
    return width if closed else float("inf")


# -----------------------------------------------------------------------------
# The healed surface around a loop, which continues over holes and past the ends of faces.

STEP = 0.5
"""Distance (mm) between the places on the loop from which the nearest face is found."""
PRECISION = 1e-6
"""Precision (mm) of a projection."""
BESIDE = 1e-3
"""A point farther than this (mm) from the normal at its foot is beyond the end of a surface."""
ENDS = 0.3
"""How far a surface may be from its tangent plane at the loop, as a share of the distance from the
loop plus `STEP`; beyond that, it counts as ended."""


class HealedSurface:
    """The untrimmed surfaces of the faces along a loop; each is valid nearest to its own edges.

    Where such a surface ends, the tangent plane at the nearest place of the loop continues it.

    Parameters
    ----------
    edges : sequence of OrientedEdge
        Edges of the loop.
    """

    def __init__(self, edges: Sequence[OrientedEdge]) -> None:
        self._surfaces = [UntrimmedSurface(edge.face, edge.surface) for edge in edges]
        counts = [int(edge.length / STEP) + 2 for edge in edges]
        along = [
            edge.evaluate(np.linspace(edge.start, edge.end, count))
            for edge, count in zip(edges, counts, strict=True)
        ]
        self._edge = np.repeat(np.arange(len(edges)), counts)
        self._points = np.vstack([points for points, _ in along])
        self._normals = np.vstack([normals for _, normals in along])
        self._tree = cKDTree(self._points)

    def project(self, points: Array) -> tuple[Array, Array]:
        asked = np.asarray(points, dtype=np.float64) / MM
        away, nearest = (np.asarray(found) for found in self._tree.query(asked))
        at, flat = self._points[nearest], self._normals[nearest]
        on, normals = np.empty_like(asked), np.empty_like(asked)
        for k in np.unique(self._edge[nearest]).tolist():
            own = self._edge[nearest] == k
            on[own], normals[own] = self._surfaces[k].nearest(asked[own])
        foot = asked - ((asked - at) * flat).sum(1, keepdims=True) * flat
        way = asked - on
        beside = way - (way * normals).sum(1, keepdims=True) * normals
        ended = np.linalg.norm(beside, axis=1) > BESIDE
        ended |= np.linalg.norm(on - foot, axis=1) > ENDS * (away + STEP)
        found = np.where(ended[:, None], foot, on)
        normals = np.where(ended[:, None], flat, normals)
        return found * MM, normals


class UntrimmedSurface:
    """The surface of a face without its bounds.

    Parameters
    ----------
    face : TopoDS_Face
    adaptor : BRepAdaptor_Surface
        Of that face.
    """

    def __init__(self, face: TopoDS_Face, adaptor: BRepAdaptor_Surface) -> None:
        self._adaptor = adaptor
        self._outward = -1.0 if face.Orientation() == REVERSED else 1.0
        self._surface = ShapeAnalysis_Surface(BRep_Tool.Surface_s(face))

    def nearest(self, points: Array) -> tuple[Array, Array]:
        """Return the nearest points (K, 3) mm and the outward normals (K, 3) there."""
        if self._adaptor.GetType() == PLANE:
            plane = self._adaptor.Plane().Position()
            normal = _vector(plane.XDirection().XYZ().Crossed(plane.YDirection().XYZ()))
            off = (points - _vector(plane.Location().XYZ())) @ normal
            normals = np.tile(self._outward * normal, (len(points), 1))
            return points - off[:, None] * normal, normals
        on, normals = np.empty_like(points), np.empty_like(points)
        for k, point in enumerate(points.tolist()):
            uv = self._surface.ValueOfUV(gp_Pnt(*point), PRECISION)
            at, du, dv = gp_Pnt(), gp_Vec(), gp_Vec()
            self._adaptor.D1(uv.X(), uv.Y(), at, du, dv)
            normal = _vector(du.Crossed(dv).XYZ())
            size = float(np.linalg.norm(normal))
            on[k], normals[k] = _vector(at.XYZ()), normal * (self._outward / (size or 1.0))
        return on, normals
