"""The part: what a drawing holds, its loops by name and by what they are, contours along them."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from kerfpath._arrays import Array, Ints, floats, freeze, scalar
from kerfpath._repr import short_repr
from kerfpath.cad._crossing import find_crossing
from kerfpath.cad._departure import ON_CURVE, Departure, departure
from kerfpath.cad._left_out import LeftOut
from kerfpath.cad._sample import EdgeChain, Trace, distance
from kerfpath.cad._units import MM
from kerfpath.contour import Contour
from kerfpath.errors import InputError
from kerfpath.operations import Ribbon, Surface

__all__ = ["Kind", "Loop", "Part", "Side"]

Kind = Literal["outer", "inner", "open"]
Side = Literal["outer", "inner", "edge", ""]

TOUCH = 1e-5
"""Stretches of one loop that come nearer to each other than this (m) cross or touch."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Loop:
    """A line to cut: around a face or a skin, around one of its holes, or an open one.

    Parameters
    ----------
    name : str
        Unique in the part: the face's name, then /outer or /hole1, /hole2, ... or /line1, ...
    face : str
        Name of the face or skin whose normal the tool axis opposes; in a DXF the layer.
    kind : "outer", "inner" or "open"
        Around the face (counter-clockwise about its outward normal), a hole (clockwise), or a line
        that was drawn open.
    surface : str
        plane, cylinder, cone, sphere, torus, bspline, ...; skin where it is made of several;
        points; lines in space.
    length : float m
    bounding_box : (2, 3) m
        Least and greatest coordinates.
    edges : int
        Number of edges.
    shortest_edge : float m
    largest_gap : float m
        Largest distance between the end of an edge and the start of the next.
    closed : bool
        Whether it is a closed line, its largest gap small enough to be cut.
    diameter : float m or None
        Where the loop is a circle, seen along its mean normal.
    side : {"outer", "inner", "edge", ""}
        Of a sheet: its outer (larger) side, its inner side, or its thickness; "" if no sheet.
    skin : str
        Of the loop of a face that is a piece of a skin: the skin's name.
    layer, colour : str
        In a DXF and of a STEP's face: where and how it is drawn (red, ..., white, #ff8000, aci30),
        "" where that is not said, or not the same all over a skin.
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
    skin: str = ""
    layer: str = ""
    colour: str = ""
    _trace: Trace = field(repr=False)

    __repr__ = short_repr

    def line(self, chord_tolerance: float = 1e-4) -> Array:
        """Return points (K, 3) m along the loop for pictures, whether or not it can be cut.

        Parameters
        ----------
        chord_tolerance : float m
            Largest distance between the chords and the curve.
        """
        chord = scalar(chord_tolerance, "chord_tolerance", unit="m", above=0.0)
        points = self._trace.sample(chord / MM, np.pi)[0] * MM
        return freeze(points if self.kind == "open" else np.vstack([points, points[:1]]))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Part:
    """A drawing as read: its loops by name, in the part's own frame.

    Parameters
    ----------
    path : Path
        The file it came from.
    unit : str
        Length unit that the file's numbers were taken for.
    bounding_box : (2, 3) m
        Least and greatest coordinates.
    faces : int
        Number of faces; 0 in a drawing of lines.
    loops : tuple of Loop
        Those of the skins, then those of the faces in their order; outer before inner.
    notes : tuple of str
        What was assumed, repaired or left out in reading.
    left_out : tuple of LeftOut
        What was left out, by kind and reason; in the notes, too.
    frames : mapping of str to (4, 4) m
        T_part_frame of the coordinate systems that a STEP or DXF file names.
    """

    path: Path
    unit: str
    bounding_box: Array
    faces: int
    loops: tuple[Loop, ...]
    notes: tuple[str, ...] = ()
    left_out: tuple[LeftOut, ...] = ()
    frames: Mapping[str, Array] = field(default_factory=dict, repr=False)
    _gap: float = field(repr=False)
    _triangulate: Callable[[float], tuple[Array, Ints, Ints]] | None = field(
        default=None, repr=False
    )
    _face_names: tuple[str, ...] = field(default=(), repr=False)

    def frame(self, name: str) -> Array:
        """Return T_part_frame (4, 4) m of a coordinate system that the drawing names.

        Raises
        ------
        InputError
            There is none of that name.
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
        """Return the loops that are all that is asked for, in the order of `loops`.

        Loops of faces that are pieces of a skin, and those around the thickness of a sheet, are
        left out unless `face` or `side` asks for them.

        Parameters
        ----------
        face : str
            Name of a face or a skin.
        kind : {"outer", "inner", "open"}
            Trim lines, holes, or open lines.
        side : {"outer", "inner", "edge"}
            Of a sheet.
        diameter : (float, float) m
            Round ones from the one to the other, both included.
        length : (float, float) m
            Their length, likewise.
        layer, colour : str
            As drawn in a DXF or STEP.
        near : (3,) m
            Of all the others that fit, the one that passes this point most closely.

        Raises
        ------
        InputError
            Nothing fits, or a range that is none.
        """
        asked: dict[str, object] = {
            "face": face, "kind": kind, "side": side, "layer": layer, "colour": colour,
        }  # fmt: skip
        ranges = {"diameter": _range(diameter, "diameter"), "length": _range(length, "length")}
        found = [
            loop
            for loop in self.loops
            if (face is not None or (not loop.skin and (side is not None or loop.side != "edge")))
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
        """Return the loop called `name` as a contour: dense points and tool axes.

        The tool axis is the face's outward normal turned round: from the nozzle into the part.

        Parameters
        ----------
        name : str
            Of one of the part's loops.
        closed : bool
            Whether it must be closed; False lets a line pass that was drawn open.
        chord_tolerance : float m
            Largest distance between the contour's chords and the curve.
        axis_tolerance : float rad
            Largest angle between the axes of neighbouring nodes on an edge. Where the faces of a
            skin meet, it may turn by up to 2 deg at once.

        Raises
        ------
        InputError
            No such loop, a tolerance that is not positive, a loop that is not closed, or one that
            crosses itself (says where).
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
            points, normals = loop._trace.sample(chord / MM, angle)
        except InputError as error:
            raise InputError(f"{self.path}: loop {name!r}: {error}") from None
        contour = Contour(points * MM, -normals, closed=loop.closed, name=name)
        if (place := find_crossing(contour.points, min(2 * chord, TOUCH))) is not None:
            raise InputError(
                f"{self.path}: loop {name!r} crosses or touches itself at "
                f"{(place / MM).round(3).tolist()} mm; repair it in CAD"
            )
        return contour

    def departure(self, name: str, contour: Contour, *, tolerance: float = ON_CURVE) -> Departure:
        """Return how far the nodes of a contour leave the loop called `name`, at most.

        Measured against the CAD curve itself, between the nodes, not against samples of it; of a
        table, which knows nothing between its points, against the lines through them.

        Parameters
        ----------
        name : str
            Of one of the part's loops.
        contour : Contour
            Nodes on that loop or a part of it: begun and sampled anyhow, either way round. Its
            leads and loops in the scrap are not measured.
        tolerance : float m
            How far a node may lie off the curve, besides half the loop's largest gap.

        Raises
        ------
        InputError
            No such loop, or a contour that does not lie on it (says where).
        """
        loop = self.loop(name)
        beside = scalar(tolerance, "tolerance", unit="m", above=0.0) + loop.largest_gap / 2
        try:
            return departure(loop._trace, contour, beside)
        except InputError as error:
            raise InputError(f"{self.path}: loop {name!r}: {error}") from None

    def surface(self, name: str) -> Surface:
        """Return the surface around a loop, healed, for leads (see `kerfpath.operations`).

        The surfaces of its faces go on where the loop cuts a hole; where they end, and in drawings
        of lines and points, the plane tangent at the nearest place of the loop does.

        Raises
        ------
        InputError
            No such loop.
        """
        trace = self.loop(name)._trace
        if isinstance(trace, EdgeChain):
            # OCP takes half a second to load, and drawings of points are read without it.
            from kerfpath.cad._healed import HealedSurface
            from kerfpath.cad._loops import OrientedEdge

            if all(isinstance(edge, OrientedEdge) for edge in trace.edges):
                return HealedSurface(trace.edges)
        return Ribbon(self.contour(name, closed=False))

    def mesh(self, deflection: float = 5e-4) -> tuple[Array, Ints]:
        """Return vertices (V, 3) m and triangles (F, 3) of the part's faces, for pictures.

        Triangles run counter-clockwise about the outward normal; a drawing of lines has none.

        Parameters
        ----------
        deflection : float m
            Largest distance between triangles and faces.
        """
        size = scalar(deflection, "deflection", unit="m", above=0.0)
        if self._triangulate is None:
            return freeze(np.empty((0, 3))), freeze(np.empty((0, 3), dtype=np.int64))
        vertices, triangles, _ = self._triangulate(size / MM)
        return freeze(vertices * MM), freeze(triangles)

    def mesh_faces(self, deflection: float = 5e-4) -> tuple[tuple[str, int], ...]:
        """Return whose the triangles of `mesh` are: runs of them in their order.

        Each run has the name of a face, or of the skin that the face is a piece of, and the number
        of its triangles. A face that could not be read is called "".

        Parameters
        ----------
        deflection : float m
            That of the mesh.
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
    # A nanometre of leave: a hole of 10 mm measures 9.9999999996 mm.
    return bounds is None or (value is not None and bounds[0] - 1e-9 <= value <= bounds[1] + 1e-9)
