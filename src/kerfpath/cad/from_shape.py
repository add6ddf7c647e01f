"""Build a part from a shape: from its faces and the skins that they make up, or from its lines."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import lru_cache, partial
from pathlib import Path

import numpy as np
from OCP.BRepAdaptor import BRepAdaptor_Surface
from OCP.collections import IndexedMap_TopoDS_Shape_TopTools_ShapeMapHasher as ShapeMap
from OCP.GeomAbs import GeomAbs_SurfaceType
from OCP.Standard import Standard_Failure
from OCP.TopAbs import TopAbs_ShapeEnum
from OCP.TopoDS import TopoDS

from kerfpath.arrays import Array, Ints, freeze
from kerfpath.cad.build import STEMS, SUNK, named_loops
from kerfpath.cad.chains import part_of_strokes
from kerfpath.cad.left_out import LeftOut, counted, nothing_drawn
from kerfpath.cad.loops import FaceLoop, bounds_of, loops_of
from kerfpath.cad.on_faces import LaidLoop, curve_of, curves_on_faces
from kerfpath.cad.part import Loop, Part
from kerfpath.cad.rims import SkinLoop
from kerfpath.cad.shape import (
    Mesh,
    NamedFace,
    NamedShape,
    list_shapes,
    triangulate,
    triangulate_apart,
    unique,
)
from kerfpath.cad.skins import Skin, skins_of
from kerfpath.cad.units import MM
from kerfpath.errors import InputError
from kerfpath.names import listed
from kerfpath.progress import Progress

MESHES = 3
"""Number of meshes of a part that are kept: for its sides, for its cell, and for its pictures."""
MOST_LISTED = 8
"""Most loops that a note names."""

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


def part_of_shape(
    path: Path,
    drawn: NamedShape,
    gap: float,
    *,
    outer_towards: tuple[float, float, float] | None,
    axis: Array | None,
    progress: Progress,
    size: int | None = None,
) -> Part:
    """Return the part that faces make up, or if there are none, lines cut along an axis.

    Parameters
    ----------
    path : Path
    drawn : NamedShape
    gap : float m
        Distance between ends that a loop bridges.
    outer_towards : (3,), optional
        Direction that the outer sides of sheets face.
    axis : (3,), optional
        The tool axis of all lines.
    progress : callable
    size : int, optional
        Bytes of the file that it comes from: its mesh is made in another process, with limits.

    Raises
    ------
    InputError
        Nothing is drawn, or an axis is given for faces.
    """
    if not drawn.faces:
        if axis is None:
            raise nothing_drawn(drawn.left_out)
        return _part_of_lines(path, drawn, gap, axis)
    if axis is not None:
        raise InputError("axis: expected a drawing of lines, got one of faces")
    mesh = triangulate if size is None else partial(triangulate_apart, size=size)
    triangulated = lru_cache(MESHES)(partial(mesh, drawn.shape))
    part = _part_of_faces(path, drawn, gap, outer_towards, triangulated, progress)
    return replace(part, _triangulate=triangulated)


# -----------------------------------------------------------------------------
# The loops of faces and of skins.


def _part_of_faces(
    path: Path,
    drawn: NamedShape,
    gap: float,
    outer_towards: tuple[float, float, float] | None,
    triangulated: Callable[[float], Mesh],
    progress: Progress,
) -> Part:
    """Return the part, with names for every face, skin and loop."""
    faces, found, unread = _readable(drawn.faces, progress)
    towards = None if outer_towards is None else np.array(outer_towards)
    progress("looking for the sides of sheets", 0, 0)
    numbers = _in_order(drawn, faces)
    box = bounds_of(drawn.shape)
    deflection = max(DEFLECTION, COARSE * float(np.linalg.norm(box[1] - box[0])))
    try:
        corners, owner = _triangles(triangulated(deflection), numbers)
        unsure = list[str]()
    except InputError as error:
        corners, owner = np.empty((0, 3, 3)), np.empty(0, dtype=np.int64)
        unsure = [f"sides of sheets, and what goes through, are not looked for: {error}"]
    skins, of_faces = skins_of(found, corners, owner, towards)
    names = _names(faces)
    skin_names = _skin_names(skins, set(names))
    piece_of, bent_of = dict[int, str](), dict[int, str]()
    for skin, name in zip(skins, skin_names, strict=True):
        (bent_of if skin.is_bent else piece_of).update(dict.fromkeys(skin.faces, name))
    named: list[tuple[Loop, SkinLoop]] = []

    def add(
        name: str, surface: str, around: Sequence[SkinLoop], of: Sequence[int], skin: str
    ) -> None:
        named.extend(
            _named(name, surface, around, gap, [faces[f] for f in of], skin, bent_of.get(of[0], ""))
        )

    for skin, name in zip(skins, skin_names, strict=True):
        if name:
            add(name, "skin", skin.loops, skin.faces, "")
    for f, name in enumerate(names):
        surface = SURFACES[BRepAdaptor_Surface(faces[f].face).GetType()]
        add(name, surface, of_faces[f], [f], piece_of[f])
    borders: dict[int, str] = {}  # those of skins come first
    for loop, around in named:
        if around.side == "sunk":
            borders.setdefault(id(around.chain), loop.name)
    loops = [
        loop if around.border is None else replace(loop, countersink=borders[id(around.border)])
        for loop, around in named
    ]
    laid = curves_on_faces(
        drawn.curves, [named.face for named in faces], _sheets(skins, len(faces)), gap
    )
    names_of = [bent_of.get(f) or piece_of[f] or names[f] for f in range(len(faces))]
    loops += _laid_loops(laid.loops, names, names_of, gap)
    left_out = tuple(
        sorted([*drawn.left_out, *unread, *laid.left_out], key=lambda each: not each.may_cut)
    )
    return Part(
        path=path,
        unit=drawn.unit,
        bounding_box=freeze(box * MM),
        faces=len(faces),
        loops=tuple(loops),
        notes=(
            *drawn.notes,
            *map(str, left_out),
            *unsure,
            *_doubts(skins, skin_names, names),
            *_blind_notes(loops),
            *laid.notes,
        ),
        left_out=left_out,
        frames=drawn.frames,
        _gap=gap,
        _face_names=tuple("" if f < 0 else piece_of[f] or names[f] for f in numbers),
    )


DEFLECTION, COARSE = 0.2, 1e-4
"""Largest distance from faces of the mesh on which sides are found: mm, below half a sheet, or that
share of the diagonal of a large part."""


def _in_order(drawn: NamedShape, faces: Sequence[NamedFace]) -> list[int]:
    """Return the indices of faces in the order in which they are meshed, -1 for those left out."""
    numbered = ShapeMap()
    for named in faces:
        numbered.Add(named.face)
    meshed = list_shapes(drawn.shape, TopAbs_ShapeEnum.TopAbs_FACE)
    return [numbered.FindIndex(face) - 1 for face in meshed]  # FindIndex: from 1 on, 0: not there


def _triangles(mesh: Mesh, numbers: Sequence[int]) -> tuple[Array, Ints]:
    """Return the corners (M, 3, 3) mm of triangles, and the face (M,) of each."""
    vertices, triangles, sizes = mesh
    face = np.repeat(np.array(numbers, dtype=np.int64), sizes)
    return vertices[triangles[face >= 0]].reshape(-1, 3, 3), face[face >= 0]


def _sheets(skins: Sequence[Skin], count: int) -> list[int]:
    """Return a number for each face, the same for those of a skin, also over sharp edges."""
    sheet = list(range(count))
    for skin in skins:  # bent ones come last
        for f in skin.faces:
            sheet[f] = min(skin.faces)
    return sheet


def _laid_loops(
    found: Sequence[LaidLoop], names: Sequence[str], wide: Sequence[str], gap: float
) -> list[Loop]:
    """Return the loops drawn on faces, numbered for each face, or for the skin if on several."""
    on: dict[str, list[LaidLoop]] = {}
    for each in found:
        first, *others = each.faces
        on.setdefault(wide[first] if others else names[first], []).append(each)
    return [
        replace(loop, name=f"{face}/curve{number}")
        for face, own in on.items()
        for number, loop in enumerate(
            named_loops(
                [(each.kind, each.chain, "") for each in own],
                face=face, surface="curves", gap=gap, layer="",
            ),
            start=1,
        )
    ]  # fmt: skip


def _readable(
    faces: Sequence[NamedFace], progress: Progress
) -> tuple[list[NamedFace], list[list[FaceLoop]], list[LeftOut]]:
    """Return the faces whose loops can be read, their loops, and the faces that are left out."""
    kept: list[NamedFace] = []
    loops: list[list[FaceLoop]] = []
    left_out: Counter[tuple[str, str, bool]] = Counter()
    for number, named in enumerate(faces, start=1):
        progress("looking for loops", number, len(faces))
        try:
            found = loops_of(named.face)
        except (InputError, Standard_Failure, RuntimeError) as error:
            reason = " ".join(str(error).split())[:120] or type(error).__name__
            left_out["face", reason, True] += 1
        else:
            kept.append(named)
            loops.append(found)
    if faces and not kept:
        raise nothing_drawn(counted(left_out))
    return kept, loops, counted(left_out)


def _doubts(skins: Sequence[Skin], skin_names: Sequence[str], names: Sequence[str]) -> list[str]:
    """Return a note for each sheet whose outer side is not certain."""
    return [
        f"{name or names[skin.faces[0]]}: the outer side of its sheet is not certain: "
        f"{skin.doubt}; check it, and set outer_towards if it is the other side"
        for skin, name in zip(skins, skin_names, strict=True)
        if skin.doubt
    ]


def _blind_notes(loops: Sequence[Loop]) -> list[str]:
    """Return notes on the holes that do not go through, or are wider at their border."""
    blind = [loop.name for loop in loops if loop.side == "blind" and loop.kind == "inner"]
    sunk = [
        f"{loop.name} ({loop.countersink})"
        for loop in loops
        if loop.is_main and loop.side == "outer" and loop.countersink
    ]
    return [
        f"{listed(names, MOST_LISTED)}: {words}"
        for names, words in (
            (
                blind,
                "does not go through (pocket, blind hole or engraving); picked only by name or "
                "side",
            ),
            (
                sunk,
                "has a countersink, counterbore or chamfer, the loop in brackets, which is picked "
                "only by name or side; what is cut is the hole in it",
            ),
        )
        if names
    ]


def _named(
    name: str,
    surface: str,
    found: Sequence[SkinLoop],
    gap: float,
    faces: Sequence[NamedFace],
    skin: str,
    bent: str,
) -> list[tuple[Loop, SkinLoop]]:
    """Return the loops of a face or skin, with the layer and colour that all its faces have."""
    layers, colours = {named.layer for named in faces}, {named.colour for named in faces}
    layer = layers.pop() if len(layers) == 1 else ""
    colour = colours.pop() if len(colours) == 1 else ""
    of = {id(loop.bore or loop.chain): loop for loop in found}
    loops = [
        loop
        for is_sunk, stems in ((False, STEMS), (True, SUNK))
        for loop in named_loops(
            [
                (its.kind, its.bore or its.chain, colour)
                for its in found
                if (its.side == "sunk") == is_sunk
            ],
            face=name, surface=surface, gap=gap, layer=layer, stems=stems,
        )
    ]  # fmt: skip
    return [
        (replace(loop, side=its.side, skin=skin or (bent if its.is_piece else "")), its)
        for loop, its in ((loop, of[id(loop._trace)]) for loop in loops)
    ]


def _names(faces: Sequence[NamedFace]) -> list[str]:
    counts: dict[str, int] = {}
    names = []
    for named in faces:
        counts[named.component] = counts.get(named.component, 0) + 1
        own = named.name or f"face{counts[named.component]}"
        names.append(f"{named.component}/{own}" if named.component else own)
    return unique(names)


def _skin_names(skins: Sequence[Skin], taken: set[str]) -> list[str]:
    """Return a name for each skin of several faces, "" for the rest."""
    names, number = [], 0
    for skin in skins:
        name = ""
        if len(skin.faces) > 1 and skin.side != "edge":
            while not name or name in taken:
                number += 1
                name = f"skin{number}"
        names.append(name)
    return names


# -----------------------------------------------------------------------------
# Lines that bound no face.

WIRE_STYLE = ("curves", "")
"""Layer and colour of these lines, by which loops are named."""


def _part_of_lines(path: Path, drawn: NamedShape, gap: float, axis: Array) -> Part:
    """Return the part that the lines of a shape without faces make up."""
    edges = ShapeMap()
    for edge in list_shapes(drawn.shape, TopAbs_ShapeEnum.TopAbs_EDGE):
        edges.Add(edge)
    numbers = range(1, edges.Extent() + 1)
    strokes = [(curve_of(TopoDS.Edge(edges.FindKey(number))),) for number in numbers]
    part = part_of_strokes(
        path, drawn.unit, {WIRE_STYLE: strokes}, gap=gap, notes=drawn.notes,
        left_out=drawn.left_out, axis=axis,
    )  # fmt: skip
    return replace(part, frames=drawn.frames)
