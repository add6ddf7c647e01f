"""The part: faces and loops by name, contours along loops, and triangles for pictures."""

from __future__ import annotations

import difflib
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from OCP.Bnd import Bnd_Box
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.BRepBndLib import BRepBndLib
from OCP.GCPnts import GCPnts_AbscissaPoint
from OCP.GeomAbs import GeomAbs_SurfaceType
from OCP.TopoDS import TopoDS_Face, TopoDS_Shape

from kerfpath._arrays import Array, Ints, freeze, scalar
from kerfpath.cad._loops import Kind, OrientedEdge, loops_of
from kerfpath.cad._mesh import triangulate
from kerfpath.cad._sample import chain
from kerfpath.contour import Contour
from kerfpath.errors import InputError

__all__ = ["Loop", "Part", "part_of"]

MM = 1e-3
"""OCCT works in mm; every length that leaves this package is in m."""
GAP = 5e-5
"""Largest distance (m) between the ends of two edges that a contour bridges: half a kerf."""
ROUND = 5e-5
"""How far (m) a loop may stray from a circle and still be a round hole."""
FLAT = 0.1
"""How far a round hole may stray from its mean plane, as a part of its diameter: one drilled into a
curved sheet does."""

SURFACES = {
    GeomAbs_SurfaceType.GeomAbs_Plane: "plane",
    GeomAbs_SurfaceType.GeomAbs_Cylinder: "cylinder",
    GeomAbs_SurfaceType.GeomAbs_Cone: "cone",
    GeomAbs_SurfaceType.GeomAbs_Sphere: "sphere",
    GeomAbs_SurfaceType.GeomAbs_Torus: "torus",
    GeomAbs_SurfaceType.GeomAbs_BezierSurface: "bezier",
    GeomAbs_SurfaceType.GeomAbs_BSplineSurface: "bspline",
    GeomAbs_SurfaceType.GeomAbs_SurfaceOfRevolution: "revolution",
    GeomAbs_SurfaceType.GeomAbs_SurfaceOfExtrusion: "extrusion",
    GeomAbs_SurfaceType.GeomAbs_OffsetSurface: "offset",
    GeomAbs_SurfaceType.GeomAbs_OtherSurface: "other",
}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Loop:
    """A closed chain of edges around a face, or around one of its holes.

    Parameters
    ----------
    name : str
        Unique in the part: the face's name, then /outer or /hole1, /hole2, ...
    face : str
        Name of the face whose normal the tool axis opposes.
    kind : "outer" or "inner"
        Around the face (counter-clockwise about its outward normal) or a hole (clockwise).
    surface : str
        plane, cylinder, cone, sphere, torus, bspline, ...
    length : float m
    bounding_box : (2, 3) m
        Least and greatest coordinates.
    edges : int
        Number of edges.
    shortest_edge : float m
    largest_gap : float m
        Largest distance between the end of an edge and the start of the next.
    closed : bool
        Whether the largest gap is small enough to cut the loop.
    diameter : float m or None
        Where the loop is a circle, seen along its mean normal.
    """

    name: str
    face: str
    kind: Kind
    surface: str
    length: float
    bounding_box: Array
    edges: int
    shortest_edge: float
    largest_gap: float
    closed: bool
    diameter: float | None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Part:
    """What a CAD file holds: its faces, and their loops by name, in the part's own frame.

    Parameters
    ----------
    path : Path
        The file it came from.
    unit : str
        Length unit as the file's header says.
    bounding_box : (2, 3) m
        Least and greatest coordinates.
    faces : int
        Number of faces.
    loops : tuple of Loop
        In the order of the faces; outer before inner.
    """

    path: Path
    unit: str
    bounding_box: Array
    faces: int
    loops: tuple[Loop, ...]
    _shape: TopoDS_Shape = field(repr=False)
    _edges: dict[str, list[OrientedEdge]] = field(repr=False)

    def loop(self, name: str) -> Loop:
        """Return the loop called `name`.

        Raises
        ------
        InputError
            No such loop; the message lists the names that come closest.
        """
        for loop in self.loops:
            if loop.name == name:
                return loop
        names = [loop.name for loop in self.loops]
        offer = difflib.get_close_matches(str(name), names, n=5, cutoff=0.5) or names[:8]
        raise InputError(
            f"{self.path}: no loop {name!r} among its {len(names)}; "
            + (f"did you mean {', '.join(offer)}?" if names else "no face has an edge")
        )

    def contour(
        self, name: str, *, chord_tolerance: float = 2e-6, axis_tolerance: float = 0.002
    ) -> Contour:
        """Return the loop called `name` as a closed contour: dense points and tool axes.

        The tool axis is the face's outward normal turned round: from the nozzle into the part.

        Parameters
        ----------
        name : str
            Of one of the part's loops.
        chord_tolerance : float m
            Largest distance between the contour's chords and the curve.
        axis_tolerance : float rad
            Largest angle between the axes of neighbouring nodes.

        Raises
        ------
        InputError
            No such loop, a tolerance that is not positive, or a gap in the loop (says where).
        """
        loop, edges = self.loop(name), self._edges[self.loop(name).name]
        chord = scalar(chord_tolerance, "chord_tolerance", unit="m", above=0.0) / MM
        angle = scalar(axis_tolerance, "axis_tolerance", unit="rad", above=0.0)
        if not loop.closed:
            k = int(np.argmax(_gaps(edges)))
            raise InputError(
                f"{self.path}: loop {name!r} has a gap of {loop.largest_gap / MM:.3f} mm after its "
                f"edge {k + 1}, at {edges[k].ends[1].round(3).tolist()} mm (allowed "
                f"{GAP / MM:g} mm); close it in CAD"
            )
        try:
            points, normals = chain(edges, chord, angle)
        except InputError as error:
            raise InputError(f"{self.path}: loop {name!r}: {error}") from None
        return Contour(points * MM, -normals, closed=True, name=name)

    def mesh(self, deflection: float = 5e-4) -> tuple[Array, Ints]:
        """Return vertices (V, 3) m and triangles (F, 3) of the part's faces, for pictures.

        Triangles run counter-clockwise about the outward normal.

        Parameters
        ----------
        deflection : float m
            Largest distance between triangles and faces.
        """
        size = scalar(deflection, "deflection", unit="m", above=0.0)
        vertices, triangles = triangulate(self._shape, size / MM)
        return freeze(vertices * MM), freeze(triangles)


def part_of(
    path: Path, unit: str, shape: TopoDS_Shape, faces: Sequence[tuple[str, TopoDS_Face]]
) -> Part:
    """Return the part made of `faces` (name or "", face), every face and loop given its name."""
    names = _unique([name or f"face{k}" for k, (name, _) in enumerate(faces, start=1)])
    loops: list[Loop] = []
    chains: dict[str, list[OrientedEdge]] = {}
    for face_name, (_, face) in zip(names, faces, strict=True):
        found = loops_of(face)
        for kind, stem in (("outer", "outer"), ("inner", "hole")):
            alike = sorted((edges for k, edges in found if k == kind), key=_place)
            for number, edges in enumerate(alike, start=1):
                alone = kind == "outer" and len(alike) == 1
                name = f"{face_name}/{stem}" + ("" if alone else str(number))
                chains[name] = edges
                loops.append(_loop(name, face_name, "outer" if kind == "outer" else "inner", edges))
    return Part(
        path=path,
        unit=unit,
        bounding_box=_bounding_box([shape]),
        faces=len(faces),
        loops=tuple(loops),
        _shape=shape,
        _edges=chains,
    )


def _unique(names: list[str]) -> list[str]:
    """Return `names` with a number behind each repeated one."""
    taken, unique = set(names), []
    for k, name in enumerate(names):
        number, chosen = 1, name
        if name in names[:k]:
            while chosen in taken:
                number += 1
                chosen = f"{name}-{number}"
        taken.add(chosen)
        unique.append(chosen)
    return unique


def _loop(name: str, face: str, kind: Kind, edges: list[OrientedEdge]) -> Loop:
    lengths = [GCPnts_AbscissaPoint.Length_s(BRepAdaptor_Curve(edge.edge)) * MM for edge in edges]
    largest_gap = float(_gaps(edges).max()) * MM
    return Loop(
        name=name,
        face=face,
        kind=kind,
        surface=SURFACES[edges[0].surface.GetType()],
        length=sum(lengths),
        bounding_box=_bounding_box([edge.edge for edge in edges]),
        edges=len(edges),
        shortest_edge=min(lengths),
        largest_gap=largest_gap,
        closed=largest_gap <= GAP,
        diameter=_diameter(_around(edges) * MM),
    )


def _gaps(edges: list[OrientedEdge]) -> Array:
    """Return the distance (mm) from the end of each edge to the start of the next."""
    ends = np.array([edge.ends for edge in edges])
    return np.asarray(np.linalg.norm(np.roll(ends[:, 0], -1, axis=0) - ends[:, 1], axis=1))


def _around(edges: list[OrientedEdge], count: int = 24) -> Array:
    """Return points (K, 3) mm all around the loop, `count` to an edge."""
    return np.vstack(
        [
            edge.evaluate(np.linspace(edge.start, edge.end, count, endpoint=False))[0]
            for edge in edges
        ]
    )


def _place(edges: list[OrientedEdge]) -> tuple[float, ...]:
    """Return the loop's centroid (mm), rounded so that the last bits do not decide an order."""
    return tuple((_around(edges).mean(axis=0).round(3) + 0.0).tolist())


def _diameter(points: Array) -> float | None:
    """Return the diameter (m) of the circle through `points` (K, 3) m, None if they are on none."""
    centred = points - points.mean(axis=0)
    axes = np.linalg.svd(centred, full_matrices=False)[2]
    x, y, height = (centred @ axes.T).T
    # A circle about (a, b): x^2 + y^2 = 2 a x + 2 b y + c, linear in its three unknowns.
    a, b, c = np.linalg.lstsq(
        np.stack([2 * x, 2 * y, np.ones_like(x)], axis=1), x**2 + y**2, rcond=None
    )[0]
    radius = float(np.sqrt(max(c + a**2 + b**2, 0.0)))
    off = np.abs(np.hypot(x - a, y - b) - radius).max()
    is_round = off <= min(ROUND, radius / 20) and np.ptp(height) <= FLAT * 2 * radius
    return 2 * radius if is_round else None


def _bounding_box(shapes: Sequence[TopoDS_Shape]) -> Array:
    box = Bnd_Box()
    for shape in shapes:
        BRepBndLib.AddOptimal_s(shape, box, False, False)
    corners = box.CornerMin(), box.CornerMax()
    return freeze(np.array([[c.X(), c.Y(), c.Z()] for c in corners]) * MM)
