"""Build a part from faces: the loops of every face, and of the skins that faces make up."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache, partial
from pathlib import Path

import numpy as np
from OCP.BRepAdaptor import BRepAdaptor_Surface
from OCP.collections import IndexedMap_TopoDS_Shape_TopTools_ShapeMapHasher as ShapeMap
from OCP.GeomAbs import GeomAbs_SurfaceType
from OCP.Standard import Standard_Failure
from OCP.TopAbs import TopAbs_ShapeEnum

from kerfpath.arrays import freeze
from kerfpath.cad.build import named_loops
from kerfpath.cad.left_out import LeftOut, counted, nothing_drawn
from kerfpath.cad.loops import FaceLoop, bounds_of, loops_of
from kerfpath.cad.part import Loop, Part
from kerfpath.cad.shape import NamedFace, NamedShape, list_shapes, triangulate, unique
from kerfpath.cad.skins import Skin, skins_of
from kerfpath.cad.units import MM
from kerfpath.errors import InputError
from kerfpath.progress import Progress, no_progress

MESHES = 2
"""Number of meshes of a part that are kept: one for its cell, one for its pictures."""

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


def part_of(
    path: Path,
    drawn: NamedShape,
    gap: float,
    outer_towards: tuple[float, float, float] | None = None,
    progress: Progress = no_progress,
) -> Part:
    """Return the part in a drawing, with names for every face, skin and loop; `gap` is in m."""
    faces, found, unread = _readable(drawn.faces, progress)
    towards = None if outer_towards is None else np.array(outer_towards)
    skins = skins_of([named.face for named in faces], found, towards)
    names = _names(faces)
    skin_names = _skin_names(skins, set(names))
    piece_of = {f: name for skin, name in zip(skins, skin_names, strict=True) for f in skin.faces}
    loops: list[Loop] = []
    for skin, name in zip(skins, skin_names, strict=True):
        if name:
            around = _named(name, "skin", skin.loops(found), gap, [faces[f] for f in skin.faces])
            loops += [replace(loop, side=skin.side) for loop in around]
    side_of = {f: skin.side for skin in skins for f in skin.faces}
    for f, (name, named) in enumerate(zip(names, faces, strict=True)):
        surface = SURFACES[BRepAdaptor_Surface(named.face).GetType()]
        around = _named(name, surface, found[f], gap, [named])
        loops += [replace(loop, side=side_of[f], skin=piece_of[f]) for loop in around]
    left_out = tuple(sorted([*drawn.left_out, *unread], key=lambda each: not each.may_cut))
    return Part(
        path=path,
        unit=drawn.unit,
        bounding_box=freeze(bounds_of(drawn.shape) * MM),
        faces=len(faces),
        loops=tuple(loops),
        notes=(*drawn.notes, *map(str, left_out), *_doubts(skins, skin_names, names)),
        left_out=left_out,
        frames=drawn.frames,
        _gap=gap,
        _triangulate=lru_cache(MESHES)(partial(triangulate, drawn.shape)),
        _face_names=_in_order(drawn, faces, [piece_of[f] or name for f, name in enumerate(names)]),
    )


def _in_order(
    drawn: NamedShape, faces: Sequence[NamedFace], names: Sequence[str]
) -> tuple[str, ...]:
    """Return the names of faces in the order in which they are meshed, "" for those left out."""
    numbered = ShapeMap()
    for named in faces:
        numbered.Add(named.face)
    meshed = list_shapes(drawn.shape, TopAbs_ShapeEnum.TopAbs_FACE)
    found = [numbered.FindIndex(face) for face in meshed]  # from 1 on, 0: not there
    return tuple(names[number - 1] if number else "" for number in found)


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


def _named(
    name: str, surface: str, found: list[FaceLoop], gap: float, faces: Sequence[NamedFace]
) -> list[Loop]:
    """Return the loops of a face or skin, with the layer and colour that all its faces have."""
    layers, colours = {named.layer for named in faces}, {named.colour for named in faces}
    layer = layers.pop() if len(layers) == 1 else ""
    colour = colours.pop() if len(colours) == 1 else ""
    around = [(kind, chain, colour) for kind, chain in found]
    return named_loops(around, face=name, surface=surface, gap=gap, layer=layer)


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
