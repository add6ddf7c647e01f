"""Rims of loops: what goes through a sheet, and the bores of holes that are countersunk."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Literal, NamedTuple

import numpy as np

from kerfpath.arrays import Array, Ints
from kerfpath.cad.curves import EdgeChain, label_connected, off_chord
from kerfpath.cad.laid import LaidEdge
from kerfpath.cad.loops import FaceLoop, HealedSurface, OrientedEdge, join_runs
from kerfpath.cad.part import Side
from kerfpath.errors import InputError

BROKEN = 0.5
"""Width (mm) of broken edges: a hole that is wider by more at its border is sunk."""
COUNTERBORED = 3.0
"""A step is the floor of a counterbore if its outline is at most so many times as long as the hole
in it; a wider one is a pocket with a hole."""
DEEP = 1e-3
"""Depth (mm) of a step."""
AS_NARROW = 1e-6
"""Share by which the lengths of equally narrow loops of a rim differ at most."""
SHEET: tuple[Side, ...] = ("outer", "inner")
"""The two sides of a sheet."""

Use = tuple[int, int, int]
"""The numbers of a face, of its loop, and of an edge of that."""
Chain = EdgeChain[OrientedEdge]


class SkinLoop(NamedTuple):
    """A loop of a skin.

    Its side is "blind" if it does not go through, "sunk" if it is the border of a countersink,
    counterbore or chamfer. A piece runs partly along a sharp edge inside the side of a sheet, which
    is not cut. A countersunk hole has a border, on its own side or else on the other; if on its
    own, `bore` is cut instead of the chain.
    """

    kind: Literal["outer", "inner"]
    chain: Chain
    side: Side
    is_piece: bool = False
    border: Chain | None = None
    bore: EdgeChain[LaidEdge] | None = None


class Bore(NamedTuple):
    """The border of the countersink of a hole, and the line to cut on that side of the sheet."""

    border: Chain
    line: EdgeChain[LaidEdge]


def edge_of(found: Sequence[list[FaceLoop]], use: Use) -> OrientedEdge:
    """Return the edge of a use."""
    face, loop, edge = use
    return found[face][loop][1].edges[edge]


def groups(pairs: Iterable[tuple[Use, Use]], count: int) -> Ints:
    """Return the number (F,) of the group of each face, which pairs of edges join."""
    return label_connected(np.array([[a[0], b[0]] for a, b in pairs], dtype=np.int64), count)


class Rims:
    """The rims around loops of a sheet: connected faces that are no sheet.

    Parameters
    ----------
    found : sequence of list of FaceLoop
    pairs : sequence of (Use, Use)
        Edges that two faces share.
    side : sequence of Side
        Side of each face.
    across : sequence of set of int
        The faces across the sheet from each face.
    """

    def __init__(
        self,
        found: Sequence[list[FaceLoop]],
        pairs: Sequence[tuple[Use, Use]],
        side: Sequence[Side],
        across: Sequence[set[int]],
    ) -> None:
        self._found, self._side, self._across = found, side, across
        self._own = {
            id(e): f for f, loops in enumerate(found) for _, chain in loops for e in chain.edges
        }
        self._faces: dict[int, tuple[int, int]] = {}
        for a, b in pairs:
            self._faces[id(edge_of(found, a))] = a[0], b[0]
            self._faces[id(edge_of(found, b))] = b[0], a[0]
        self._within = [pair for pair in pairs if all(side[f] == "edge" for f, _, _ in pair)]
        self._rim = groups(self._within, len(side))
        self._at: dict[int, set[int]] = {}  # by rim, and by face of one: the sheet faces there
        self._beside: dict[int, set[int]] = {}
        for a, b in pairs:
            for rim, sheet in ((a[0], b[0]), (b[0], a[0])):
                if side[rim] == "edge" and side[sheet] in SHEET:
                    self._at.setdefault(int(self._rim[rim]), set()).add(sheet)
                    self._beside.setdefault(rim, set()).add(sheet)

    def side_of(self, kind: str, chain: Chain) -> Side:
        """Return the side of a loop: "blind" if it lies on a sheet but its rim ends within it."""
        sharing = [self._faces[id(edge)] for edge in chain.edges if id(edge) in self._faces]
        side = self._side[self._own[id(chain.edges[0])]]
        if side not in SHEET or len(sharing) < len(chain.edges):
            return side
        for own, other in sharing:
            if self._side[other] == side and kind == "outer":
                return side  # a crease: the sheet goes on
            if self._side[other] == "edge":
                ends = self._at.get(int(self._rim[other]), set())
                across = self._across[own] or {f for f in ends if self._side[f] != side}
                if any(f in across and self._side[f] in SHEET for f in ends):
                    return side
        return "blind"

    def floors(self) -> list[int]:
        """Return the floors of counterbores and flat countersinks, which are no sheet themselves.

        They have one hole, one side of the sheet is all around and above them, and what lies across
        is plain or such a floor, unlike that of a hollow that is formed.
        """
        around = {
            f: sheet for f, loops in enumerate(self._found) if (sheet := self._above(f, loops))
        }
        return [
            f
            for f, sheet in around.items()
            if self._across[f] <= {*around, *(h for g in sheet for h in self._across[g])}
        ]

    def _above(self, f: int, loops: Sequence[FaceLoop]) -> set[int]:
        """Return the sheet around a step in it that lies deeper and has one hole."""
        outlines = [chain for kind, chain in loops if kind == "outer"]
        if self._side[f] not in SHEET or len(loops) != 2 or len(outlines) != 1:
            return set()
        (outline,), (hole,) = outlines, [chain for kind, chain in loops if kind == "inner"]
        others = {self._faces[id(e)][1] for e in outline.edges if id(e) in self._faces}
        walls = {g for g in others if self._side[g] == "edge"}
        sheet = others - walls
        sheet |= {g for wall in walls for g in self._at.get(int(self._rim[wall]), ())} - {f}
        if outline.lengths.sum() > COUNTERBORED * hole.lengths.sum():
            return set()
        rising = [chain.around for g in walls for _, chain in self._found[g]] or [outline.around]
        deep = (np.vstack(rising).mean(axis=0) - hole.around.mean(axis=0)) @ outline.edges[
            0
        ].end_normals[outline.edges[0].start]
        return sheet if deep > DEEP and len({self._side[g] for g in sheet}) == 1 else set()

    # -------------------------------------------------------------------------
    # Countersinks.

    def bores(self, loops: Iterable[tuple[Chain, Side]]) -> dict[int, Bore]:
        """Return the bores of countersunk holes, by the ids of all edges of their two loops.

        Of a hole that is wider at its border than within, the narrowest loop is laid on the side of
        the border. What lies next to such a border ends within the sheet or is a cone around all of
        the hole across, unlike the wall of a hole drilled askew or across a bend.

        Parameters
        ----------
        loops : iterable of (Chain, Side)
            The loops around holes.
        """
        of_rim: dict[int, list[tuple[Chain, Side]]] = {}
        for chain, side in loops:
            for rim in {int(self._rim[f]) for f in self._walls(chain)} if side in SHEET else ():
                of_rim.setdefault(rim, []).append((chain, side))
        found = dict[int, Bore]()
        for rim, around in of_rim.items():
            bores = [self._bore(rim, *one, around) for one in around]
            any_of = next((bore for bore in bores if bore is not None), None)
            for (chain, _), bore in zip(around, bores, strict=True):
                if told := bore or any_of:
                    found |= {id(edge): told for edge in chain.edges}
        return found

    def _walls(self, chain: Chain) -> set[int]:
        others = {self._faces[id(e)][1] for e in chain.edges if id(e) in self._faces}
        return {f for f in others if self._side[f] == "edge"}

    def _bore(
        self, rim: int, border: Chain, side: Side, around: Sequence[tuple[Chain, Side]]
    ) -> Bore | None:
        """Return the bore of a hole if its loop on one side is wider than the hole."""
        across = [chain for chain, its in around if its != side]
        if not across:
            return None
        within = [*self._within_rim(rim, side), *across]
        least = (1 + AS_NARROW) * min(chain.lengths.sum() for chain in within)
        narrow = next(chain for chain in within if chain.lengths.sum() <= least)
        if border.lengths.sum() - narrow.lengths.sum() <= 2 * np.pi * BROKEN:
            return None
        way = narrow.area / np.linalg.norm(narrow.area)
        beside = {g for f in self._walls(border) for g in self._beside[f]}
        is_wall = any(self._side[g] != side for g in beside)
        if is_wall and not _is_inside(narrow.around, border.around, way):
            return None
        normals = [edge.end_normals[edge.start] for edge in border.edges]
        is_backward = bool(narrow.area @ border.area < 0)
        way = way if way @ np.mean(normals, axis=0) > 0 else -way
        surface = HealedSurface(border.edges)
        edges = [
            LaidEdge(edge, surface, way, is_backward=is_backward)
            for edge in (narrow.edges[::-1] if is_backward else narrow.edges)
        ]
        line = EdgeChain(edges=edges)
        try:
            line.bounds()
        except InputError:  # the surface is too much bent for what lies across
            return None
        return Bore(border, line)

    def _within_rim(self, rim: int, side: Side) -> Iterator[Chain]:
        """Yield the closed chains between the faces of a rim, from one side of the sheet on."""
        own = [(a, b) for a, b in self._within if self._rim[a[0]] == rim]
        depth = {f: 0 for a in own for f, _, _ in a if self._is_beside(f, side)}
        last = list(depth)
        while last:
            following = []
            for f in last:
                for a, b in own:
                    for one, other in ((a[0], b[0]), (b[0], a[0])):
                        if one == f and other not in depth:
                            depth[other] = depth[f] + 1
                            following.append(other)
            last = following
        for level in range(max(depth.values(), default=0)):
            between = [
                edge_of(self._found, use)
                for pair in own
                for use, other in (pair, pair[::-1])
                if depth[use[0]] > level >= depth[other[0]]
            ]
            chains = list(join_runs([[edge] for edge in between])) if between else []
            if len(chains) == 1:
                yield EdgeChain(edges=chains[0])

    def _is_beside(self, f: int, side: Side) -> bool:
        return any(self._side[g] == side for g in self._beside.get(f, ()))


def _is_inside(points: Array, around: Array, way: Array) -> bool:
    """Return whether points (K, 3) lie inside a loop (M, 3) seen along `way`, and not near it."""
    flat = [each - (each @ way)[:, None] * way for each in (points, around)]
    after = np.roll(flat[1], -1, axis=0)
    for point in flat[0]:
        if off_chord(flat[1], after, point).min() <= BROKEN:
            return False
        # The angles under which the sides are seen add up to a turn inside, and to 0 outside.
        to, of = flat[1] - point, after - point
        seen = np.arctan2(np.cross(to, of) @ way, (to * of).sum(1)).sum()
        if abs(seen) < np.pi:
            return False
    return True
