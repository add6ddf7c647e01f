"""From faces to a part: the loops of every face, and those of the skins that faces make up."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache, partial
from pathlib import Path
from typing import get_args

from OCP.BRepAdaptor import BRepAdaptor_Surface
from OCP.GeomAbs import GeomAbs_SurfaceType

from kerfpath._arrays import freeze
from kerfpath.cad._loops import FaceLoop, bounds_of, loops_of
from kerfpath.cad._mesh import triangulate
from kerfpath.cad._part import Kind, Loop, Part, Side, loop_of
from kerfpath.cad._sample import Trace, numbered
from kerfpath.cad._shape import Drawn, NamedFace, unique
from kerfpath.cad._skins import Skin, skins_of
from kerfpath.cad._units import MM

__all__ = ["part_of"]

MESHES = 2
"""Meshes of a part that are kept: one for its cell, one for its pictures."""

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


def part_of(path: Path, drawn: Drawn, gap: float) -> Part:
    """Return the part that is drawn, every face, skin and loop given its name; `gap` in m."""
    faces = drawn.faces
    found = [loops_of(named.face) for named in faces]
    skins = skins_of([named.face for named in faces], found)
    names = _names(faces)
    skin_names = _skin_names(skins, set(names))
    piece_of = {f: name for skin, name in zip(skins, skin_names, strict=True) for f in skin.faces}
    loops: list[Loop] = []
    for skin, name in zip(skins, skin_names, strict=True):
        if name:
            look = _look([faces[f] for f in skin.faces])
            loops += _named(name, "skin", skin.side, skin.loops(found), gap, look)
    side_of = {f: skin.side for skin in skins for f in skin.faces}
    for f, (name, named) in enumerate(zip(names, faces, strict=True)):
        surface = SURFACES[BRepAdaptor_Surface(named.face).GetType()]
        made = _named(name, surface, side_of[f], found[f], gap, _look([named]))
        loops += [replace(loop, skin=piece_of[f]) for loop in made]
    return Part(
        path=path,
        unit=drawn.unit,
        bounding_box=freeze(bounds_of(drawn.shape) * MM),
        faces=len(faces),
        loops=tuple(loops),
        notes=tuple(drawn.notes),
        _gap=gap,
        _triangulate=lru_cache(MESHES)(partial(triangulate, drawn.shape)),
    )


def _look(faces: Sequence[NamedFace]) -> tuple[str, str]:
    """Return the layer and the colour that all of the faces have, "" where they differ."""
    layers, colours = {named.layer for named in faces}, {named.colour for named in faces}
    return layers.pop() if len(layers) == 1 else "", colours.pop() if len(colours) == 1 else ""


def _named(
    name: str, surface: str, side: Side, found: list[FaceLoop], gap: float, look: tuple[str, str]
) -> list[Loop]:
    """Return the loops of one face or skin, outer before inner, numbered by their places."""
    loops = []
    for kind in get_args(Kind):
        traces: list[Trace] = [chain for k, chain in found if k == kind]
        alone, stem = ("outer", "outer") if kind == "outer" else (None, "hole")
        for last, trace in numbered(traces, stem, alone=alone).items():
            made = loop_of(
                name=f"{name}/{last}", face=name, kind=kind, trace=trace, surface=surface, gap=gap,
                layer=look[0], colour=look[1],
            )  # fmt: skip
            loops.append(replace(made, side=side))
    return loops


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
