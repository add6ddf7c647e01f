"""The part in a drawing: its loops, by name or by their properties, and contours along them."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from kerfpath.arrays import Array, Ints, floats, freeze, places_within, scalar, short_repr
from kerfpath.cad.curves import EdgeChain, Trace, distance
from kerfpath.cad.departure import ON_CURVE, Departure, departure
from kerfpath.cad.laid import LaidEdge
from kerfpath.cad.left_out import LeftOut
from kerfpath.cad.sharp_edges import EdgeTurn, edge_turns, turn_at_edges
from kerfpath.cad.units import EDGE_TURN, MM
from kerfpath.contour import Contour
from kerfpath.errors import InputError, about
from kerfpath.names import listed
from kerfpath.operations import Ribbon, Surface

# -----------------------------------------------------------------------------
# Places at which a closed or open polyline meets itself.

APART = 20.0
"""Stretches closer than this along the line, in tolerances, are neighbours and may be close."""


def find_crossing(points: Array, tolerance: float) -> Array | None:
    """Return a point (3,) where two distant stretches of a polyline meet, None if they never do.

    Parameters
    ----------
    points : (K, 3)
        Nodes; a closed polyline repeats the first at the end.
    tolerance : float
        Stretches that are this close meet.
    """
    a, b = points[:-1], points[1:]
    length = np.linalg.norm(b - a, axis=1)
    s = np.concatenate([[0.0], np.cumsum(length)])
    total = s[-1]
    is_closed = bool(np.linalg.norm(points[0] - points[-1]) <= tolerance)
    i, j = _near(points, s, tolerance)
    keep = i < j
    i, j = i[keep], j[keep]
    between = s[j] - s[i + 1]
    if is_closed:
        between = np.minimum(between, total - (s[j + 1] - s[i]))
    keep = between > APART * tolerance
    i, j = i[keep], j[keep]
    distance, place = _distance(a[i], b[i], a[j], b[j])
    if not (distance <= tolerance).any():
        return None
    return np.asarray(place[int(np.argmin(distance))])


def _near(points: Array, s: Array, tolerance: float) -> tuple[Ints, Ints]:
    """Return pairs of segments that may meet, found by cells of equal length along the line."""
    count = max(8, (len(points) - 1) // 2)
    cell = s[-1] / count
    middle = (np.arange(count) + 0.5) * cell
    middles = np.stack([np.interp(middle, s, x) for x in points.T], axis=1)
    pairs = cKDTree(middles).query_pairs(cell + tolerance, output_type="ndarray")
    same = np.arange(count)
    pairs = np.vstack([pairs, np.stack([same, same], axis=1)])
    # Segments of each cell, including those that its start and end cut.
    first = np.maximum(np.searchsorted(s, same * cell, side="right") - 1, 0)
    last = np.minimum(np.searchsorted(s, (same + 1) * cell, side="left"), len(s) - 1)
    sizes = last - first
    n, m = sizes[pairs[:, 0]], sizes[pairs[:, 1]]
    which = np.repeat(np.arange(len(pairs)), n * m)
    inside = places_within(n * m)
    i = first[pairs[which, 0]] + inside // m[which]
    j = first[pairs[which, 1]] + inside % m[which]
    return np.minimum(i, j), np.maximum(i, j)


def _distance(p0: Array, p1: Array, q0: Array, q1: Array) -> tuple[Array, Array]:
    """Return the distances between segments, row by row, and the closest points on the first.

    Closest points of two segments: C. Ericson, Real-Time Collision Detection, section 5.1.9.
    """
    u, v, r = p1 - p0, q1 - q0, p0 - q0
    a, e, b = (u * u).sum(1), (v * v).sum(1), (u * v).sum(1)
    c, f = (u * r).sum(1), (v * r).sum(1)
    across = a * e - b * b
    parallel = across <= 1e-12 * a * e
    s = np.clip((b * f - c * e) / np.where(parallel, 1.0, across), 0.0, 1.0)
    s[parallel] = 0.0
    t = np.clip((b * s + f) / e, 0.0, 1.0)
    s = np.clip((b * t - c) / a, 0.0, 1.0)
    on_p = p0 + s[:, None] * u
    return np.asarray(np.linalg.norm(on_p - q0 - t[:, None] * v, axis=1)), on_p


# -----------------------------------------------------------------------------
# Loops, and the part that has them.

COARSE_CHORD, COARSE_ANGLE = 1.0, 0.05
"""Chord error (mm) and turn of the normal (rad) of samples among which sharp edges are found."""

Kind = Literal["outer", "inner", "open"]
Side = Literal["outer", "inner", "edge", "blind", "sunk", ""]
NO_CUT: tuple[Side, ...] = ("edge", "blind", "sunk")
"""Sides of loops that are picked only if asked for: they are not to be cut as they are."""

TOUCH = 1e-5
"""Stretches of one loop that are closer than this (m) cross or touch."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Loop:
    """A line to cut: around a face or a skin, around one of its holes, or open.

    Parameters
    ----------
    name : str
        Unique in the part: the face's name, then /outer, /hole1, /sunk1, /line1, or /curve1 if it
        is drawn on the face.
    face : str
        Name of the face or skin whose normal the tool axis opposes; in a DXF the layer.
    kind : "outer", "inner" or "open"
        Around the face (counter-clockwise about its outward normal), around a hole (clockwise), or
        drawn as an open line.
    surface : str
        Kind of surface: plane, cylinder, cone, sphere, torus, bspline, ...; skin for several faces,
        points for a table or tool path, lines for lines in space, curves for those drawn on faces.
    length : float m
    bounding_box : (2, 3) m
        Least and greatest coordinates.
    edges : int
        Number of edges.
    shortest_edge : float m
    largest_gap : float m
        Largest distance between the end of an edge and the start of the next.
    closed : bool
        Whether it is a closed line whose largest gap is small enough to be cut.
    diameter : float m or None
        Diameter, if the loop is a circle seen along its mean normal.
    side : {"outer", "inner", "edge", "blind", "sunk", ""}
        Side of a sheet that the loop is on: outer, inner, or its thickness; blind for a loop that
        does not go through it, around a pocket, a blind hole or an engraving; sunk for the border
        of a countersink, counterbore or chamfer; "" if it is no sheet.
    countersink : str
        Name of the loop at the border of its countersink, counterbore or chamfer, on its own side
        of the sheet or on the other; "" for a plain hole. If on its own, the loop is the narrowest
        line of the hole, moved along the hole to the surface of this side.
    skin : str
        Name of the skin that the face of the loop is a piece of, or "".
    layer, colour : str
        Layer and colour (red, ..., white, #ff8000, aci30) in a DXF or of a STEP face; "" if the
        file has none, or if they differ within a skin.
    feeds : tuple of float m/s
        Speeds that the program it is read from says along it, each once in their order; empty if it
        says none, or not those of the tip in the part.
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
    side: Side = ""
    countersink: str = ""
    skin: str = ""
    layer: str = ""
    colour: str = ""
    feeds: tuple[float, ...] = ()
    _trace: Trace = field(repr=False)

    __repr__ = short_repr

    @property
    def is_main(self) -> bool:
        """Whether it is picked by default: no piece of a skin, and to be cut as it is."""
        return not self.skin and self.side not in NO_CUT

    @property
    def edge_turns(self) -> tuple[EdgeTurn, ...]:
        """The sharp edges that it crosses, at which the beam turns by more than 2 deg."""
        if self.surface == "plane":
            return ()
        return edge_turns(self._trace.sample(COARSE_CHORD, COARSE_ANGLE), MM)

    def line(self, chord_tolerance: float = 1e-4) -> Array:
        """Return points (K, 3) m along the loop for pictures, even if it cannot be cut.

        Parameters
        ----------
        chord_tolerance : float m
            Largest distance between the chords and the curve.
        """
        chord = scalar(chord_tolerance, "chord_tolerance", unit="m", above=0.0)
        points = self._trace.sample(chord / MM, np.pi).points * MM
        return freeze(points if self.kind == "open" else np.vstack([points, points[:1]]))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Part:
    """The part in a drawing: its named loops, in the part's own frame.

    Parameters
    ----------
    path : Path
        The file that it was read from.
    unit : str
        Length unit of the numbers in the file.
    bounding_box : (2, 3) m
        Least and greatest coordinates.
    faces : int
        Number of faces; 0 in a drawing of lines.
    loops : tuple of Loop
        Loops of the skins, then of the faces in their order; outer before inner.
    notes : tuple of str
        What was assumed, repaired or left out in reading.
    left_out : tuple of LeftOut
        What was left out, by kind and reason; the notes list it, too.
    frames : mapping of str to (4, 4) m
        T_part_frame of the named coordinate systems of a STEP or DXF file.
    edge_turn : float m
        Distance before and behind a sharp edge within which the beam turns, see `read`.
    """

    path: Path
    unit: str
    bounding_box: Array
    faces: int
    loops: tuple[Loop, ...]
    notes: tuple[str, ...] = ()
    left_out: tuple[LeftOut, ...] = ()
    frames: Mapping[str, Array] = field(default_factory=dict, repr=False)
    edge_turn: float = EDGE_TURN
    _gap: float = field(repr=False)
    _triangulate: Callable[[float], tuple[Array, Ints, Ints]] | None = field(
        default=None, repr=False
    )
    _face_names: tuple[str, ...] = field(default=(), repr=False)

    def frame(self, name: str) -> Array:
        """Return T_part_frame (4, 4) m of a named coordinate system of the drawing.

        Raises
        ------
        InputError
            No such coordinate system.
        """
        if name not in self.frames:
            known = ", ".join(map(repr, self.frames)) or "none"
            raise InputError(
                f"{self.path}: expected the name of a coordinate system of the drawing, got "
                f"{name!r}; it names {known}"
            )
        return self.frames[name]

    def __repr__(self) -> str:
        size = (self.bounding_box[1] - self.bounding_box[0]) * 1e3
        return (
            f"Part({self.path.name!r}, {self.faces} faces, {len(self.loops)} loops, "
            f"{' x '.join(f'{v:.1f}' for v in size)} mm)"
        )

    @property
    def largest_gap(self) -> float:
        """Largest gap (m) of any loop, bridged or not."""
        return max((loop.largest_gap for loop in self.loops), default=0.0)

    @property
    def shortest_edge(self) -> float:
        """Shortest edge (m) of any loop."""
        return min((loop.shortest_edge for loop in self.loops), default=0.0)

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

    def pick(
        self,
        *,
        face: str | None = None,
        kind: Kind | None = None,
        side: Side | None = None,
        diameter: tuple[float, float] | None = None,
        length: tuple[float, float] | None = None,
        layer: str | None = None,
        colour: str | None = None,
        near: ArrayLike | None = None,
    ) -> tuple[Loop, ...]:
        """Return the loops that meet all given criteria, in the order of `loops`.

        Loops of faces that are pieces of a skin are left out unless `face` selects them, and those
        around the thickness of a sheet, blind and sunk ones unless `face` or `side` does.

        Parameters
        ----------
        face : str
            Name of a face or a skin.
        kind : {"outer", "inner", "open"}
            Trim lines, holes, or open lines.
        side : {"outer", "inner", "edge", "blind", "sunk"}
            Side of a sheet.
        diameter : (float, float) m
            Smallest and largest diameter of round loops, both included.
        length : (float, float) m
            Smallest and largest length, both included.
        layer, colour : str
            Layer and colour in a DXF or STEP.
        near : (3,) m
            Of the loops that meet the other criteria, only the one that passes closest to this
            point.

        Raises
        ------
        InputError
            No loop meets the criteria, or a range whose limits are reversed.
        """
        asked: dict[str, object] = {
            "face": face, "kind": kind, "side": side, "layer": layer, "colour": colour,
        }  # fmt: skip
        ranges = {"diameter": _range(diameter, "diameter"), "length": _range(length, "length")}
        found = [
            loop
            for loop in self.loops
            if (
                face is not None
                or (not loop.skin and (side is not None or loop.side not in NO_CUT))
            )
            and all(want is None or getattr(loop, key) == want for key, want in asked.items())
            and all(_within(getattr(loop, key), want) for key, want in ranges.items())
        ]
        if not found:
            wanted = {**asked, "diameter": diameter, "length": length}
            words = ", ".join(f"{key}={want!r}" for key, want in wanted.items() if want is not None)
            raise InputError(
                f"{self.path}: no loop among {len(self.loops)} fits {words or 'a pick'}; "
                "list them with: kerfpath contours"
            )
        if near is not None:
            point = floats(near, "near", (3,)) / MM
            found = [min(found, key=lambda loop: distance(loop._trace, point))]
        return tuple(found)

    def contour(
        self,
        name: str,
        *,
        closed: bool = True,
        chord_tolerance: float = 2e-6,
        axis_tolerance: float = 0.002,
    ) -> Contour:
        """Return the loop called `name` as a contour of dense points and tool axes.

        The tool axis is opposite to the face's outward normal: from the nozzle into the part. Where
        the loop crosses a sharp edge, the axis turns within the `edge_turn` of `read` on both
        sides, at an even rate on each, and is halfway at the edge; where it begins and ends to turn
        are nodes, see `Contour.bend_ends`.

        Parameters
        ----------
        name : str
            Name of one of the part's loops.
        closed : bool
            Whether the loop must be closed; False also accepts a line that was drawn open.
        chord_tolerance : float m
            Largest distance between the contour's chords and the curve.
        axis_tolerance : float rad
            Largest angle between the axes of neighbouring nodes on an edge. Where faces meet, the
            axis may turn by up to 0.1 deg at once.

        Raises
        ------
        InputError
            No such loop, a tolerance that is not positive, a loop that is not closed, or a closed
            one that crosses itself (the message has the place).
        """
        loop = self.loop(name)
        chord = scalar(chord_tolerance, "chord_tolerance", unit="m", above=0.0)
        angle = scalar(axis_tolerance, "axis_tolerance", unit="rad", above=0.0)
        if not loop.closed and (closed or loop.kind != "open"):
            raise InputError(
                f"{self.path}: loop {name!r} {loop._trace.break_at()} (allowed "
                f"{self._gap / MM:g} mm); close it in CAD"
                + (", or ask for an open one" if loop.kind == "open" else "")
            )
        try:
            points, normals = turn_at_edges(
                loop._trace.sample(chord / MM, angle), self.edge_turn / MM, is_closed=loop.closed
            )
        except InputError as error:
            raise InputError(f"{self.path}: loop {name!r}: {error}") from None
        contour = Contour(points * MM, -normals, closed=loop.closed, name=name)
        if not loop.closed:
            return contour  # a line may cross itself: it separates nothing
        if (place := find_crossing(contour.points, min(2 * chord, TOUCH))) is not None:
            raise InputError(
                f"{self.path}: loop {name!r} crosses or touches itself at "
                f"{(place / MM).round(3).tolist()} mm; repair it in CAD"
            )
        return contour

    def departure(self, name: str, contour: Contour, *, tolerance: float = ON_CURVE) -> Departure:
        """Return the largest deviation of a contour from the loop called `name`.

        It is measured between the nodes against the CAD curve itself, not against samples of it;
        at sharp edges against the axis that turns there, as in `contour`. A table defines nothing
        between its points, so the lines through them are the reference.

        Parameters
        ----------
        name : str
            Name of one of the part's loops.
        contour : Contour
            Contour with nodes on that loop or a part of it, with any start, sampling and direction.
            Its leads and loops in the scrap are not measured.
        tolerance : float m
            How far a node may lie off the curve, in addition to half the loop's largest gap.

        Raises
        ------
        InputError
            No such loop, or a contour that does not lie on it (the message names the node).
        """
        loop = self.loop(name)
        beside = scalar(tolerance, "tolerance", unit="m", above=0.0) + loop.largest_gap / 2
        try:
            return departure(loop._trace, contour, beside, self.edge_turn)
        except InputError as error:
            raise InputError(f"{self.path}: loop {name!r}: {error}") from None

    def surface(self, name: str) -> Surface:
        """Return the healed surface around a loop, for leads (see `kerfpath.operations`).

        The surfaces of its faces continue over holes. Where they end, and in drawings of lines and
        points, the tangent plane at the nearest place of the loop continues them.

        Raises
        ------
        InputError
            No such loop.
        """
        trace = self.loop(name)._trace
        if isinstance(trace, EdgeChain):
            # OCP takes half a second to load, and drawings of points do not need it.
            from kerfpath.cad.loops import HealedSurface, OrientedEdge

            if all(isinstance(edge, OrientedEdge) for edge in trace.edges):
                return HealedSurface(trace.edges)
            if isinstance(trace.edges[0], LaidEdge):
                return trace.edges[0].surface
        return Ribbon(self.contour(name, closed=False))

    def mesh(self, deflection: float = 5e-4) -> tuple[Array, Ints]:
        """Return vertices (V, 3) m and triangles (F, 3) of the part's faces, for pictures.

        Triangles run counter-clockwise about the outward normal; a drawing of lines has none.

        Parameters
        ----------
        deflection : float m
            Largest distance between triangles and faces.

        Raises
        ------
        InputError
            It takes more time or memory than any sound part; a coarser mesh takes less.
        """
        size = scalar(deflection, "deflection", unit="m", above=0.0)
        if self._triangulate is None:
            return freeze(np.empty((0, 3))), freeze(np.empty((0, 3), dtype=np.int64))
        with about(self.path):
            vertices, triangles, _ = self._triangulate(size / MM)
        return freeze(vertices * MM), freeze(triangles)

    def mesh_faces(self, deflection: float = 5e-4) -> tuple[tuple[str, int], ...]:
        """Return which faces the triangles of `mesh` belong to, as runs in their order.

        Each run is the name of a face, or of the skin that the face is a piece of, and the number
        of its triangles. The name of a face that could not be read is "".

        Parameters
        ----------
        deflection : float m
            Deflection of the mesh.
        """
        size = scalar(deflection, "deflection", unit="m", above=0.0)
        if self._triangulate is None:
            return ()
        counts = self._triangulate(size / MM)[2].tolist()
        return tuple(zip(self._face_names, counts, strict=True))


def _range(value: tuple[float, float] | None, name: str) -> tuple[float, float] | None:
    if value is None:
        return None
    low, high = floats(value, name, (2,), infinite=True).tolist()
    if low > high:
        raise InputError(f"{name}: expected (least, greatest) in m, got ({low:g}, {high:g})")
    return low, high


def _within(value: float | None, bounds: tuple[float, float] | None) -> bool:
    # A nanometre is tolerated: a hole of 10 mm measures 9.9999999996 mm.
    return bounds is None or (value is not None and bounds[0] - 1e-9 <= value <= bounds[1] + 1e-9)


# -----------------------------------------------------------------------------
# Sharp edges, about which the beam turns.

MOST_LISTED, MOST_PLACES = 6, 4
"""Most loops that the note on sharp edges names, and most places for each."""


def turning_at_edges(part: Part, edge_turn: float) -> Part:
    """Return the part with the beam turned within a distance (m) of sharp edges, and a note."""
    said = []
    for loop in part.loops:
        try:
            turns = loop.edge_turns if loop.is_main else ()
        except InputError:  # the curve cannot be evaluated, and `contour` says why
            continue
        if turns:
            most = np.degrees(max(turn.angle for turn in turns))
            where = [" ".join(f"{x:.6g}" for x in (t.at / MM).round(2) + 0.0) for t in turns]
            said.append(f"{loop.name} by up to {most:.0f} deg at {listed(where, MOST_PLACES)} mm")
    note = (
        f"the beam turns within {edge_turn / MM:g} mm before and behind sharp edges: "
        f"{listed(said, MOST_LISTED, '; ')}; the robot is slow there: a larger edge_turn "
        "(edge_turn_mm in [part] of a job, --edge-turn-mm) gives the head more room"
    )
    notes = (*part.notes, note) if said else part.notes
    return replace(part, notes=notes, edge_turn=edge_turn)
