"""Sew loose faces together, body by body."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np
from OCP.BRep import BRep_Builder, BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.BRepBuilderAPI import (
    BRepBuilderAPI_MakeSolid,
    BRepBuilderAPI_MakeVertex,
    BRepBuilderAPI_Sewing,
)
from OCP.BRepExtrema import BRepExtrema_DistShapeShape
from OCP.BRepLib import BRepLib
from OCP.collections import IndexedMap_TopoDS_Shape_TopTools_ShapeMapHasher as ShapeMap
from OCP.GCPnts import GCPnts_AbscissaPoint
from OCP.gp import gp_Pnt
from OCP.TopAbs import TopAbs_ShapeEnum
from OCP.TopoDS import TopoDS, TopoDS_Compound, TopoDS_Edge, TopoDS_Face, TopoDS_Shape
from scipy.spatial import cKDTree

from kerfpath.arrays import Array, Ints
from kerfpath.cad.curves import label_connected
from kerfpath.cad.left_out import LeftOut, nothing_drawn
from kerfpath.cad.shape import NamedFace, NamedShape, list_shapes
from kerfpath.cad.units import MM

# -----------------------------------------------------------------------------
# Find which loose faces make up a body, so that bodies that touch are not sewn to each other.
#
# Two faces of a body meet along each of its edges. Where bodies touch, four or more faces end
# along one line; there, each face is assigned to the body that it closes.

TIGHT = 1e-3
"""Edges closer than this (mm) are joined before those that are within the gap."""
ALONG = 9
"""Number of points along an edge that must lie on another edge for it to be a piece of that."""


def bodies_of(faces: Sequence[TopoDS_Face], gap: float) -> list[list[int]]:
    """Return the indices of the faces of each body, which meet along edges within a gap.

    Parameters
    ----------
    faces : sequence of TopoDS_Face
    gap : float mm
    """
    found = [(f, edge) for f, face in enumerate(faces) for edge in _edges(face)]
    if not found:
        return [[f] for f in range(len(faces))]
    owner, edges = [f for f, _ in found], [edge for _, edge in found]
    places = np.array([_place(edge) for edge in edges])
    body = list(range(len(faces)))
    for tolerance in sorted({min(TIGHT, gap), gap}):
        line = _lines(places, tolerance).tolist()
        meeting = _Meeting([body[f] for f in owner], line)
        meeting.join()
        body = [meeting.root(b) for b in body]
    count = Counter(zip((body[f] for f in owner), line, strict=True))
    loose = [k for k, (f, at) in enumerate(zip(owner, line, strict=True)) if count[body[f], at] % 2]
    pieces = [(body[owner[i]], body[owner[j]]) for i, j in _pieces(edges, loose, gap)]
    group = label_connected(np.array(pieces, dtype=np.int64), len(faces))[body]
    return [np.flatnonzero(group == b).tolist() for b in dict.fromkeys(group.tolist())]


def _edges(face: TopoDS_Face) -> Iterator[TopoDS_Edge]:
    """Yield the edges that bound a face, without seams and poles."""
    for found in list_shapes(face, TopAbs_ShapeEnum.TopAbs_EDGE):
        edge = TopoDS.Edge(found)
        if not (BRep_Tool.Degenerated_s(edge) or BRep_Tool.IsClosed_s(edge, face)):
            yield edge


def _place(edge: TopoDS_Edge) -> Array:
    """Return the start, middle and end (3, 3) mm of an edge."""
    curve = BRepAdaptor_Curve(edge)
    first, last = curve.FirstParameter(), curve.LastParameter()
    half = GCPnts_AbscissaPoint.Length_s(curve) / 2
    return _points(curve, [first, GCPnts_AbscissaPoint(curve, half, first).Parameter(), last])


def _points(curve: BRepAdaptor_Curve, at: Sequence[float]) -> Array:
    found = [curve.Value(t) for t in at]
    return np.array([[p.X(), p.Y(), p.Z()] for p in found])


def _lines(places: Array, tolerance: float) -> Ints:
    """Return a number (E,) for each edge, the same for edges that coincide in either direction.

    ``places`` (E, 3, 3) mm are their starts, middles and ends.
    """
    both = np.concatenate([places, places[:, ::-1]]).reshape(-1, 9)
    pairs = cKDTree(both).query_pairs(tolerance, output_type="ndarray") % len(places)
    return label_connected(pairs, len(places))


class _Meeting:
    """Bodies while they are assembled, and the lines along which their edges lie.

    Parameters
    ----------
    body, line : sequence of int
        Body and line of each edge.
    """

    def __init__(self, body: Sequence[int], line: Sequence[int]) -> None:
        self.on: dict[int, Counter[int]] = defaultdict(Counter)
        self.lines: dict[int, set[int]] = defaultdict(set)
        self.into: dict[int, int] = {}
        for b, number in zip(body, line, strict=True):
            self.on[number][b] += 1
            self.lines[b].add(number)
        alike: dict[frozenset[int], list[int]] = defaultdict(list)
        for b in self.lines:
            if all(len(self._ending(number)) > 2 for number in self._open(b)):
                alike[self._open(b)].append(b)
        self.twins = {pair for same in alike.values() for pair in combinations(sorted(same), 2)}
        """Pairs of bodies that lie on each other all around."""

    def root(self, b: int) -> int:
        """Return the body that b is a part of."""
        while b in self.into:
            b = self.into[b]
        return b

    def join(self) -> None:
        """Join bodies that each have an odd number of edges on a common line.

        Two bodies that are alone on a line belong together. If there are more, the pair that closes
        most of its body with fewer lines comes first, and of several the one with fewest lines.
        """
        waiting = sorted(self.on)
        while waiting:
            still, is_joined = [], False
            for number in waiting:
                ends = self._ending(number)
                if len(ends) == 2:
                    self._unite(*ends)
                    is_joined = True
                elif len(ends) > 2:
                    still.append(number)
            waiting = still
            if not is_joined:
                pairs = {pair for n in still for pair in combinations(self._ending(n), 2)}
                if not (chosen := min(map(self._rank, pairs - self.twins), default=None)):
                    return
                self._unite(*chosen[2:])

    def _open(self, b: int) -> frozenset[int]:
        """Return the lines with an odd number of edges of a body."""
        return frozenset(number for number in self.lines[b] if self.on[number][b] % 2)

    def _ending(self, number: int) -> list[int]:
        """Return the bodies with an odd number of edges on a line."""
        return sorted(b for b, count in self.on[number].items() if count % 2)

    def _rank(self, pair: tuple[int, int]) -> tuple[float, int, int, int]:
        a, b = sorted(pair, key=lambda one: (len(self.lines[one]), one))
        left = self._open(a)
        closed = sum(self.on[n][b] % 2 for n in left) / len(left)
        return -closed, len(self.lines[a]) + len(self.lines[b]), *pair

    def _unite(self, a: int, b: int) -> None:
        """Merge b into a."""
        for number in self.lines.pop(b):
            self.on[number][a] += self.on[number].pop(b)
            self.lines[a].add(number)
        self.into[b] = a


def _pieces(
    edges: Sequence[TopoDS_Edge], loose: Sequence[int], gap: float
) -> Iterator[tuple[int, int]]:
    """Yield pairs of loose edges of which the first is a piece of the second."""
    curves = {k: BRepAdaptor_Curve(edges[k]) for k in loose}
    along = [
        _points(curve, np.linspace(curve.FirstParameter(), curve.LastParameter(), ALONG).tolist())
        for curve in curves.values()
    ]
    boxes = np.array([[p.min(axis=0), p.max(axis=0)] for p in along]).reshape(-1, 2, 3)
    for i, points in enumerate(along):
        around = (boxes[:, 0] - gap <= boxes[i, 0]).all(axis=1)
        around &= (boxes[:, 1] + gap >= boxes[i, 1]).all(axis=1)
        around[i] = False
        for j in np.flatnonzero(around).tolist():
            if _lies_on(points, edges[loose[j]], gap):
                yield loose[i], loose[j]


def _lies_on(points: Array, edge: TopoDS_Edge, gap: float) -> bool:
    """Return whether all points (K, 3) lie within a gap (mm) of an edge."""
    for point in points.tolist():
        vertex = BRepBuilderAPI_MakeVertex(gp_Pnt(*point)).Vertex()
        if not BRepExtrema_DistShapeShape(vertex, edge).Value() <= gap:
            return False
    return True


# -----------------------------------------------------------------------------
# Sew the faces of each body.

EDGE, FACE = TopAbs_ShapeEnum.TopAbs_EDGE, TopAbs_ShapeEnum.TopAbs_FACE


def sewn_shape(
    unit: str,
    shape: TopoDS_Shape,
    faces: Sequence[NamedFace],
    *,
    gap: float,
    notes: Sequence[str] = (),
    left_out: Sequence[LeftOut] = (),
) -> NamedShape:
    """Return a shape and its faces, which are sewn within `gap` (m) if there is no solid.

    The shape may have lines instead of faces.

    Raises
    ------
    InputError
        Neither faces nor lines, or no face left after sewing.
    """
    lines = list_shapes(shape, EDGE, avoid=FACE)
    if not (faces or lines):
        raise nothing_drawn(left_out)
    solids = list_shapes(shape, TopAbs_ShapeEnum.TopAbs_SOLID)
    if not solids and len(faces) > 1:
        loose = len(faces)
        shape, faces, note = _sewn(faces, gap)
        notes = [*notes, note]
        if gone := loose - len(faces):
            reason = f"it vanishes when sewn over {gap / MM:g} mm: try a smaller gap"
            vanished = LeftOut(kind="face", reason=reason, count=gone, may_cut=True)
            left_out = [*left_out, vanished]
        if not faces:
            raise nothing_drawn(left_out)
    return NamedShape(
        unit=unit, shape=shape, faces=faces, notes=notes, left_out=left_out,
        curves=[TopoDS.Edge(line) for line in lines] if faces else (),
    )  # fmt: skip


def _sewn(faces: Sequence[NamedFace], gap: float) -> tuple[TopoDS_Shape, list[NamedFace], str]:
    """Return the sewn shape, its faces, and a note; edges within `gap` (m) are shared.

    Each body is sewn separately, so that bodies that touch stay apart.
    """
    bodies = bodies_of([named.face for named in faces], gap / MM)
    whole, builder = TopoDS_Compound(), BRep_Builder()
    builder.MakeCompound(whole)
    lying: dict[int, NamedFace] = {}
    joined = free = 0
    for body in bodies:
        sewing = BRepBuilderAPI_Sewing(gap / MM)
        for f in body:
            sewing.Add(faces[f].face)
        sewing.Perform()
        shape = sewing.SewedShape()
        if not sewing.NbFreeEdges() and shape.ShapeType() == TopAbs_ShapeEnum.TopAbs_SHELL:
            solid = BRepBuilderAPI_MakeSolid(TopoDS.Shell(shape)).Solid()
            BRepLib.OrientClosedSolid_s(solid)
            shape = solid
        builder.Add(whole, shape)
        joined, free = joined + sewing.NbContigousEdges(), free + sewing.NbFreeEdges()
        # Sewing reverses faces so that neighbours agree: take each as oriented in the result.
        sewn = ShapeMap()
        for face in list_shapes(shape, FACE):
            sewn.Add(face)
        for f in body:
            if place := sewn.FindIndex(sewing.ModifiedSubShape(faces[f].face)):
                lying[f] = replace(faces[f], face=TopoDS.Face(sewn.FindKey(place)))
    edges = list_shapes(whole, EDGE)
    widest = max((BRep_Tool.Tolerance_s(TopoDS.Edge(edge)) for edge in edges), default=0.0)
    apart = f" to {len(bodies)} bodies" if len(bodies) > 1 else ""
    note = (
        f"{len(faces)} loose faces sewn{apart} within {gap / MM:g} mm: {joined} edges "
        f"joined, the widest gap {np.round(widest, 4):g} mm; {free} edges are free"
    )
    shape = shape if len(bodies) == 1 else whole
    return shape, [lying[f] for f in sorted(lying)], note
