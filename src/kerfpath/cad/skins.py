"""Skins: faces that join smoothly, their loops, the two sides of a sheet, and what is no hole."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from OCP.collections import IndexedMap_TopoDS_Shape_TopTools_ShapeMapHasher as ShapeMap

from kerfpath.arrays import Array, Ints, short_repr
from kerfpath.cad.curves import EdgeChain
from kerfpath.cad.loops import FaceLoop, OrientedEdge, is_hole, join_runs
from kerfpath.cad.part import Side
from kerfpath.cad.rims import SHEET, Bore, Rims, SkinLoop, Use, edge_of, groups
from kerfpath.cad.sides import Sides, Surfaces, sides_of

SMOOTH = float(np.radians(2.0))
"""Faces whose normals differ by less (rad) along their whole shared edge belong to one skin."""
FREE = 0.25
"""A body with a larger share of its edges at one face only is an open surface, and no sheet."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Skin:
    """Faces that join smoothly, or all that join on one side of a sheet, over sharp edges, too.

    Parameters
    ----------
    faces : tuple of int
        Indices of the faces.
    side : {"outer", "inner", "edge", ""}
        Side of a sheet; "" if it is no sheet.
    loops : sequence of SkinLoop
        Around the skin and its holes, over all its faces; those over sharp edges only if they
        cross one.
    is_bent : bool
        Whether its faces join over sharp edges.
    doubt : str
        Why `side` might be the other one; "" if it is certain.
    """

    faces: tuple[int, ...]
    side: Side
    loops: Sequence[SkinLoop]
    is_bent: bool = False
    doubt: str = ""

    __repr__ = short_repr


def skins_of(
    found: Sequence[list[FaceLoop]],
    corners: Array,
    face: Ints,
    outer_towards: Array | None = None,
) -> tuple[list[Skin], list[list[SkinLoop]]]:
    """Return the skins of a part and the loops of each face.

    The skins of faces that join smoothly come first, in the order of their first faces.

    Parameters
    ----------
    found : sequence of list of FaceLoop
        The loops of each face.
    corners : (M, 3, 3) mm
        Triangles of the faces, counter-clockwise about the outward normal.
    face : (M,) int
        The face of each triangle.
    outer_towards : (3,), optional
        Direction that the outer sides of sheets face on the whole; default: by their shape.
    """
    uses = _uses(found)
    pairs = [(a, b) for at in uses if len(at) == 2 for a, b in [at] if a[0] != b[0]]
    smooth = [pair for pair in pairs if _is_smooth(*(edge_of(found, use) for use in pair))]
    body = groups(pairs, len(found))
    sides = _sides(found, uses, smooth, body, (corners, face), outer_towards)
    for f in Rims(found, pairs, sides.side, sides.across).floors():
        sides.side[f], sides.doubt[f] = "edge", ""
    smooth = [pair for pair in smooth if sides.side[pair[0][0]] == sides.side[pair[1][0]]]
    known = set(smooth)
    sharp = [
        (a, b)
        for a, b in pairs
        if (a, b) not in known
        and sides.side[a[0]] in SHEET
        and sides.side[a[0]] == sides.side[b[0]]
    ]
    group, shell = groups(smooth, len(found)), groups([*smooth, *sharp], len(found))
    firsts = np.unique(group, return_index=True)[1]
    side = list(sides.side)
    is_alone = np.bincount(body[firsts], minlength=len(found))[body] == 1
    for f in np.flatnonzero(is_alone).tolist():
        side[f] = side[f] or "outer"
    rims = Rims(found, pairs, side, sides.across)
    within = {use for pair in smooth for use in pair}
    creases = {use for pair in sharp for use in pair}
    crease_edges = {id(edge_of(found, use)) for use in creases}
    group_of = {
        id(e): int(group[f]) for f, loops in enumerate(found) for _, c in loops for e in c.edges
    }

    def looked_at(kind: Literal["outer", "inner"], chain: EdgeChain[OrientedEdge]) -> SkinLoop:
        is_piece = any(id(edge) in crease_edges for edge in chain.edges)
        return SkinLoop(kind, chain, rims.side_of(kind, chain), is_piece)

    skins: list[Skin] = []
    for members in _members(group):
        loops = found[members[0]] if len(members) == 1 else _rejoined(found, members, within)
        skins.append(
            Skin(
                faces=members,
                side=side[members[0]],
                loops=[looked_at(*loop) for loop in loops],
                doubt=next((sides.doubt[f] for f in members if sides.doubt[f]), ""),
            )
        )
    bent_shells = {int(shell[a[0]]) for a, _ in sharp}
    for members in _members(shell):
        if int(shell[members[0]]) not in bent_shells:
            continue
        around = [
            looked_at(kind, chain)
            for kind, chain in _rejoined(found, members, within | creases)
            if len({group_of[id(edge)] for edge in chain.edges}) > 1
        ]
        skins.append(Skin(faces=members, side=side[members[0]], loops=around, is_bent=True))
    of_faces = [[looked_at(*loop) for loop in loops] for loops in found]
    holes = [
        (loop.chain, loop.side) for skin in skins for loop in skin.loops if loop.kind == "inner"
    ]
    bores = rims.bores(holes)
    return [replace(skin, loops=_with_bores(skin.loops, bores)) for skin in skins], [
        _with_bores(loops, bores) for loops in of_faces
    ]


def _with_bores(loops: Sequence[SkinLoop], bores: Mapping[int, Bore]) -> list[SkinLoop]:
    """Return loops, with those to cut of countersunk holes, whose borders have the side "sunk"."""
    told = []
    for loop in loops:
        bore = bores.get(id(loop.chain.edges[0]))
        if bore is None:
            told.append(loop)
            continue
        border, own = ({id(edge) for edge in chain.edges} for chain in (bore.border, loop.chain))
        if own <= border:
            told.append(loop._replace(side="sunk"))
        if own == border:
            told.append(loop._replace(border=bore.border, bore=bore.line))
        if not own & border:
            told.append(loop._replace(border=bore.border))
    return told


def _members(group: Ints) -> list[tuple[int, ...]]:
    """Return the faces of each group, in the order of their first ones."""
    order = np.argsort(group, kind="stable")
    runs = np.split(order, np.flatnonzero(np.diff(group[order])) + 1) if len(group) else []
    return sorted(tuple(run.tolist()) for run in runs)


def _rejoined(
    found: Sequence[list[FaceLoop]], faces: Sequence[int], inside: set[Use]
) -> list[FaceLoop]:
    """Return the loops around several faces and their holes, without the edges inside."""
    runs = [
        run
        for f in faces
        for k, (_, loop) in enumerate(found[f])
        for run in _outside(loop.edges, [(f, k, e) in inside for e in range(len(loop.edges))])
    ]
    chains = [EdgeChain(edges=edges) for edges in join_runs(runs)]
    loops = [(is_hole(chain), chain) for chain in chains]
    if loops and all(hole for hole, _ in loops):
        # A trim line may face away from its sheet, as on a C-shaped channel.
        longest = max(loops, key=lambda loop: float(loop[1].lengths.sum()))
        loops = [(hole and loop is not longest[1], loop) for hole, loop in loops]
    return [("inner" if hole else "outer", loop) for hole, loop in loops]


def _sides(
    found: Sequence[list[FaceLoop]],
    uses: Sequence[Sequence[Use]],
    smooth: Sequence[tuple[Use, Use]],
    body: Ints,
    mesh: tuple[Array, Ints],
    outer_towards: Array | None,
) -> Sides:
    """Return the sides of the faces; those of open surfaces have none."""
    count = len(found)
    borders: list[dict[int, float]] = [{} for _ in range(count)]
    joined: list[dict[int, float]] = [{} for _ in range(count)]
    around, free = np.zeros(count), np.zeros(count)
    is_smooth = set(smooth)
    for at in uses:
        for f, k, e in at:
            length = float(found[f][k][1].lengths[e])
            around[f] += length
            free[f] += length if len(at) == 1 else 0.0
        if len(at) == 2 and at[0][0] != at[1][0]:
            (f, k, e), (g, _, _) = at
            length = float(found[f][k][1].lengths[e])
            kinds = (borders, joined) if (at[0], at[1]) in is_smooth else (borders,)
            for kind in kinds:
                kind[f][g] = kind[g][f] = kind[f].get(g, 0.0) + length
    of_body = [np.bincount(body, each, minlength=count)[body] for each in (free, around)]
    is_open = of_body[0] > FREE * of_body[1]
    corners, face = mesh
    closed = ~is_open[face]
    return sides_of(
        Surfaces(
            corners=corners[closed], face=face[closed], body=body, borders=borders, smooth=joined,
            around=around,
        ),
        outer_towards,
    )  # fmt: skip


def _uses(found: Sequence[list[FaceLoop]]) -> list[list[Use]]:
    """Return, for each edge of the shape, the (face, loop, edge) numbers that run along it."""
    known, uses = ShapeMap(), list[list[Use]]()
    for f, loops in enumerate(found):
        for k, (_, loop) in enumerate(loops):
            for e, edge in enumerate(loop.edges):
                number = known.Add(edge.edge)
                if number > len(uses):
                    uses.append([])
                uses[number - 1].append((f, k, e))
    return uses


def _is_smooth(a: OrientedEdge, b: OrientedEdge) -> bool:
    most = 2 * np.sin(SMOOTH / 2)
    for end, normal in a.end_normals.items():  # most edges are sharp, at their ends too
        if end in b.end_normals and np.linalg.norm(normal - b.end_normals[end]) > most:
            return False
    t = np.linspace(a.start, a.end, 5)
    turned = np.linalg.norm(a.evaluate(t)[1] - b.evaluate(t)[1], axis=1)
    return bool(turned.max() <= most)


def _outside(edges: Sequence[OrientedEdge], inside: list[bool]) -> list[list[OrientedEdge]]:
    """Return the stretches of a closed loop without its inside edges."""
    if not any(inside):
        return [list(edges)]
    runs: list[list[OrientedEdge]] = []
    first = inside.index(True)
    is_new = True
    for k in range(len(edges)):
        at = (first + k) % len(edges)
        if inside[at]:
            is_new = True
            continue
        if is_new:
            runs.append([])
        runs[-1].append(edges[at])
        is_new = False
    return runs
