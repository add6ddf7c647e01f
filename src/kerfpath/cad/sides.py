"""Which faces of a part are sheet, on which side of it they are, and what goes through it.

All is judged by rays through a mesh, not by the kinds of surfaces, so sharp bends, broken edges,
ribs, webs and pockets need no rules of their own.

1. A face is sheet if rays into it meet other faces of its body nearly squarely, at one distance:
   its thickness. The roundings of broken edges meet them at an angle, and rims far away.
2. Sheet faces of like thickness that share an edge, sharp or not, are one shell. A face of which
   rays are not sure, such as the patch at a corner, belongs to the shell around it.
3. Of two shells that meet through the sheet, the outer one is that from which more of the rays in
   all directions leave the body: nothing hides the outside of a tube, its inside is hidden.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from kerfpath.arrays import Array, Bools, Ints
from kerfpath.cad.curves import label_connected
from kerfpath.cad.part import Side
from kerfpath.kernels.rays import LEAF, first_met

# -----------------------------------------------------------------------------
# The first triangle that each ray meets.


class Triangles:
    """Triangles that rays meet.

    Parameters
    ----------
    corners : (M, 3, 3) mm
        Counter-clockwise about their outward normals.
    body : (M,) int
        Number of the body of each: rays meet only triangles of their own.
    """

    def __init__(self, corners: Array, body: Ints) -> None:
        self._order = _spread(corners)
        self._corners, self._body = corners[self._order], body[self._order]
        leaves = 1 << max(0, (-(-len(corners) // LEAF) - 1).bit_length())
        filled = self._corners[np.minimum(np.arange(LEAF * leaves), len(corners) - 1)]
        filled = filled.reshape(leaves, -1, 3)
        self._boxes = np.empty((2 * leaves, 2, 3))
        self._boxes[leaves:] = np.stack([filled.min(axis=1), filled.max(axis=1)], axis=1)
        while leaves > 1:
            pairs = self._boxes[leaves : 2 * leaves].reshape(-1, 2, 2, 3)
            leaves //= 2
            self._boxes[leaves : 2 * leaves, 0] = pairs[:, :, 0].min(axis=1)
            self._boxes[leaves : 2 * leaves, 1] = pairs[:, :, 1].max(axis=1)

    def first(self, origins: Array, directions: Array, body: Ints) -> tuple[Array, Ints]:
        """Return distance (K,) mm and triangle (K,) that rays (K, 3) meet; inf and -1 for none."""
        far, met = first_met(origins, directions, body, self._corners, self._body, self._boxes)
        return far, np.where(met >= 0, self._order[met], -1)


def _spread(corners: Array) -> Ints:
    """Return an order of triangles in which neighbours lie close together: halved by middles."""
    middle = corners.mean(axis=1)
    order = np.arange(len(corners))
    runs = [(0, len(corners))]
    while runs:
        low, high = runs.pop()
        if high - low <= LEAF:
            continue
        own = order[low:high]
        along = int(np.argmax(np.ptp(middle[own], axis=0)))
        # Halves end at the borders of the boxes, which hold a power of two of leaves.
        leaves = -(-(high - low) // LEAF)
        half = LEAF << max(0, (leaves - 1).bit_length() - 1)
        order[low:high] = own[np.argpartition(middle[own, along], half)]
        runs += [(low, low + half), (low + half, high)]
    return order


# -----------------------------------------------------------------------------
# Sheet faces, shells and sides.

RAYS = 32
"""Number of rays into each face."""
ALL_ROUND = 1024
"""Number of rays in all directions from each shell, and 4 more from each of its faces."""
SQUARE = 0.9
"""Least cosine between a ray and the normal of what it meets squarely."""
MOST, EVEN, LIKE = 0.7, 0.3, 0.3
"""Least share of rays that meet squarely and evenly; deviation of distances that are even, and of
thicknesses that are alike, as a share."""
THIN = 0.2
"""A sheet is thinner than this share of the square root of the area of its shell."""
AROUND = 0.7
"""Least share of the border of a face that a shell around it has."""
CLOSER = 32
"""How many times as many rays leave shells that are about as open."""
SURE = 3.0
"""Standard deviations by which the shares of rays that leave must differ."""
OPEN = 0.99
"""Share of rays that leave flat sheets at least."""
LEANING = 0.05
"""Share of its area that a side must show in the direction given for the outer side."""
LEVEL = 1e-4
"""Coordinates of a vector area below this share of its length count as zero."""
OFF = 1e-4
"""Distance (mm) from a face at which its rays start."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Surfaces:
    """A mesh of the faces of a part.

    Parameters
    ----------
    corners : (M, 3, 3) mm
        Triangles, counter-clockwise about the outward normal.
    face : (M,) int
        The face of each.
    body : (F,) int
        The body of each face.
    borders : sequence of mapping of int to float
        For each face, the length (mm) of the border that it shares with each other face.
    smooth : sequence of mapping of int to float
        Of that, the length over which the faces join without an edge.
    around : (F,) mm
        Length of the whole border of each face.
    """

    corners: Array
    face: Ints
    body: Ints
    borders: Sequence[Mapping[int, float]]
    smooth: Sequence[Mapping[int, float]]
    around: Array


class Sides(NamedTuple):
    """For each face its side, the faces across the sheet from it, and why it is not certain, or "".

    Faces that rays are not sure about have none across.
    """

    side: list[Side]
    across: list[set[int]]
    doubt: list[str]


class _Mesh:
    """The triangles of a part with their areas, and the rays from its faces."""

    def __init__(self, of: Surfaces) -> None:
        self.face, self.body = of.face, of.body
        self._corners = of.corners
        edge1, edge2 = (of.corners[:, k] - of.corners[:, 0] for k in (1, 2))
        across = np.cross(edge1, edge2)
        twice = np.linalg.norm(across, axis=1)
        self.area, self.normal = twice / 2, across / np.maximum(twice, 1e-15)[:, None]
        self.size = np.bincount(of.face, self.area, len(of.body))
        self.vector = np.stack(
            [np.bincount(of.face, self.area * n, len(of.body)) for n in self.normal.T], axis=1
        )
        self._met = Triangles(of.corners, of.body[of.face])
        self._order = np.argsort(of.face, kind="stable")
        self._ends = np.searchsorted(of.face[self._order], np.arange(len(of.body) + 1))
        self._rng = np.random.default_rng(0)

    def places(self, face: int, count: int) -> tuple[Array, Ints]:
        """Return points (count, 3) evenly spread on a face, and the triangles that they are on."""
        own = self._order[self._ends[face] : self._ends[face + 1]]
        shares = np.cumsum(self.area[own])
        at = shares[-1] * (np.arange(count) + self._rng.random(count)) / count
        k = own[np.minimum(np.searchsorted(shares, at), len(own) - 1)]
        low, high = np.sort(self._rng.random((2, count)), axis=0)
        a, b, c = self._corners[k].transpose(1, 0, 2)
        return a + low[:, None] * (b - a) + (high - low)[:, None] * (c - a), k

    def inwards(self, faces: Ints) -> tuple[Array, Ints, Bools]:
        """Return distance, face met (-1: none) and whether squarely (F, RAYS) of rays inwards."""
        if not len(faces):
            none = np.empty((0, RAYS))
            return none, none.astype(np.int64), none.astype(bool)
        found = [self.places(f, RAYS) for f in faces.tolist()]
        points, k = (np.concatenate(each) for each in zip(*found, strict=True))
        body = self.body[self.face[k]]
        far, hit = self._met.first(points - OFF * self.normal[k], -self.normal[k], body)
        square = (hit >= 0) & ((self.normal[hit] * -self.normal[k]).sum(1) > SQUARE)
        met = np.where(hit >= 0, self.face[hit], -1)
        shape = len(faces), RAYS
        return (far + OFF).reshape(shape), met.reshape(shape), square.reshape(shape)

    def openness(self, faces: Sequence[int], times: int = 1) -> tuple[float, int]:
        """Return the share of rays in all directions from faces that leave, and their number."""
        counts = 4 + np.round(
            times * ALL_ROUND * self.size[list(faces)] / self.size[list(faces)].sum()
        )
        points, k = (
            np.concatenate(each)
            for each in zip(*map(self.places, faces, counts.astype(np.int64).tolist()), strict=True)
        )
        weight = np.repeat(self.size[list(faces)] / counts, counts.astype(np.int64))
        # Normal plus a point of the unit sphere: directions with the cosine as their density.
        aside = self._rng.normal(size=points.shape)
        aside /= np.linalg.norm(aside, axis=1)[:, None]
        way = aside + self.normal[k] * (1 + 1e-6)
        way /= np.linalg.norm(way, axis=1)[:, None]
        far, _ = self._met.first(points + OFF * self.normal[k], way, self.body[self.face[k]])
        return float(np.average(np.isinf(far), weights=weight)), len(points)


def sides_of(of: Surfaces, outer_towards: Array | None = None) -> Sides:
    """Return the side of each face: "outer" or "inner" of a sheet, "edge" of one, "" without one.

    Parameters
    ----------
    of : Surfaces
    outer_towards : (3,), optional
        Direction that the outer sides of sheets face on the whole.
    """
    count = len(of.body)
    if not len(of.corners):
        return Sides([""] * count, [set() for _ in range(count)], [""] * count)
    mesh = _Mesh(of)
    asked = np.flatnonzero(mesh.size > 0)
    far, met, square = mesh.inwards(asked)
    rays = {int(f): (far[k][square[k]], met[k][square[k]]) for k, f in enumerate(asked.tolist())}
    thickness = _thickness(mesh, of.borders, rays)
    shell = _shells(mesh, of.borders, thickness, rays)
    partners = _partners(shell, thickness, rays)
    side: list[Side] = [""] * count
    doubt = [""] * count
    for number, why in _ordered(mesh, shell, partners, outer_towards):
        for f in np.flatnonzero(shell == number).tolist():
            if not side[f]:
                side[f], doubt[f] = "outer", why
                for g in partners[f]:
                    if not side[g] and shell[g] != number:
                        side[g] = "inner"
    _join_surrounded(of, shell, side)
    sheets = {int(of.body[f]) for f in range(count) if side[f]}
    for f in range(count):
        if not side[f] and int(of.body[f]) in sheets:
            side[f] = "edge"
    across = [{g for g in partners.get(f, ()) if side[g] != side[f]} for f in range(count)]
    return Sides(side, across, doubt)


Rays = Mapping[int, tuple[Array, Ints]]
"""For each face, how far its rays go that meet another face squarely, and the face."""


def _even(rays: Rays, face: int) -> tuple[float, Ints]:
    """Return the median distance (mm) of what a face meets, and what it meets about there."""
    far, met = rays.get(face, (np.empty(0), np.empty(0, dtype=np.int64)))
    if not len(far):
        return np.inf, met
    across = float(np.median(far))
    return across, met[np.abs(far - across) <= EVEN * across + OFF]


def _thickness(mesh: _Mesh, borders: Sequence[Mapping[int, float]], rays: Rays) -> Array:
    """Return the thickness (F,) mm of each sheet face, inf for others."""
    thickness = np.full(len(mesh.size), np.inf)
    for f in rays:
        across, met = _even(rays, f)
        if len(met) >= MOST * RAYS and across < np.sqrt(mesh.size[f]):
            thickness[f] = across
    # The rim of something thinner, a strip as wide as that, is no sheet, though its ends are even.
    for f in np.argsort(-thickness, kind="stable").tolist():
        thin = {g for g in borders[f] if thickness[g] < (1 - LIKE) * thickness[f]}
        strip = sum(borders[f][g] * float(thickness[g]) for g in thin)
        is_strip = np.isfinite(thickness[f]) and strip > mesh.size[f]
        if is_strip and any(thin & set(_even(rays, g)[1].tolist()) for g in thin):
            thickness[f] = np.inf
    return thickness


def _shells(
    mesh: _Mesh, borders: Sequence[Mapping[int, float]], thickness: Array, rays: Rays
) -> Ints:
    """Return the number (F,) of the shell of each face, -1 for faces that are no sheet."""
    pairs = [
        (f, g)
        for f in np.flatnonzero(np.isfinite(thickness)).tolist()
        for g in borders[f]
        if g > f
        and abs(thickness[f] - thickness[g]) <= LIKE * min(thickness[f], thickness[g])
        and max((_even(rays, f)[1] == g).sum(), (_even(rays, g)[1] == f).sum()) < EVEN * RAYS
    ]
    shell = label_connected(np.array(pairs, dtype=np.int64), len(thickness))
    shell[np.isinf(thickness)] = -1
    for number in np.unique(shell[shell >= 0]).tolist():
        own = shell == number
        if np.median(thickness[own]) >= THIN * np.sqrt(mesh.size[own].sum()):
            shell[own] = -1
    return shell


def _partners(shell: Ints, thickness: Array, rays: Rays) -> dict[int, dict[int, int]]:
    """Return for each face of a shell the faces across the sheet, and how many rays meet them."""
    found: dict[int, dict[int, int]] = {f: {} for f in np.flatnonzero(shell >= 0).tolist()}
    for f in found:
        met, times = np.unique(_even(rays, f)[1], return_counts=True)
        for g, count in zip(met.tolist(), times.tolist(), strict=True):
            if count > 1 and g in found:
                found[f][g] = found[f].get(g, 0) + count
                found[g][f] = found[g].get(f, 0) + count
    return found


def _ordered(
    mesh: _Mesh, shell: Ints, partners: Mapping[int, Mapping[int, int]], towards: Array | None
) -> list[tuple[int, str]]:
    """Return the shells, of two that meet the outer one first, and why that is not certain."""
    across: dict[int, dict[int, int]] = {}
    for f, met in partners.items():
        for g, times in met.items():
            if shell[g] != shell[f]:
                own = across.setdefault(int(shell[f]), {})
                own[int(shell[g])] = own.get(int(shell[g]), 0) + times
    members = {number: np.flatnonzero(shell == number).tolist() for number in across}
    leave = {number: mesh.openness(own) for number, own in members.items()}
    vector = {number: mesh.vector[own].sum(axis=0) for number, own in members.items()}
    area = {number: float(mesh.size[own].sum()) for number, own in members.items()}
    order: list[tuple[int, str]] = []
    left = sorted(across, key=lambda number: -leave[number][0])
    while left:
        best, why = left[0], ""
        other = max(across[best], key=lambda number: across[best][number])
        if other in left:
            if _is_unsure(leave[best], leave[other]) and leave[other][0] < OPEN:
                for each in (best, other):
                    leave[each] = mesh.openness(members[each], CLOSER)
                best, other = sorted((best, other), key=lambda number: -leave[number][0])
            share, its = leave[best][0], leave[other][0]
            leaning = 0.0
            if towards is not None:
                leaning = float((vector[best] - vector[other]) @ towards)
                leaning /= (area[best] + area[other]) * float(np.linalg.norm(towards))
            if abs(leaning) > LEANING:
                best = best if leaning > 0 else other
            elif _is_unsure(leave[best], leave[other]):
                best = best if _faces_up(vector[best]) else other
                if min(share, its) < OPEN:
                    why = (
                        f"both of its sides are as open, {100 * share:.1f} and {100 * its:.1f} % "
                        "of rays leave the part; the one that faces up is taken"
                    )
        left.remove(best)
        order.append((best, why))
    return order


def _is_unsure(one: tuple[float, int], other: tuple[float, int]) -> bool:
    """Return whether two shares of rays may be the same, by the numbers of rays."""
    (a, count), (b, number) = one, other
    noise = np.sqrt(a * (1 - a) / count + b * (1 - b) / number)
    return bool(abs(a - b) <= SURE * noise + 1 / min(count, number))


def _join_surrounded(of: Surfaces, shell: Ints, side: list[Side]) -> None:
    """Give faces that are mostly surrounded by a side of a shell, without an edge, to it."""
    waiting = {g for f in np.flatnonzero(shell >= 0).tolist() for g in of.smooth[f]}
    while waiting:
        f = waiting.pop()
        if side[f]:
            continue
        of_side: dict[Side, float] = {}
        for g, length in of.smooth[f].items():
            of_side[side[g]] = of_side.get(side[g], 0.0) + length
        for one in ("outer", "inner"):
            if of_side.get(one, 0.0) >= AROUND * of.around[f]:
                side[f] = one
                waiting |= {g for g in of.smooth[f] if not side[g]}


def _faces_up(vector: Array) -> bool:
    """Return whether a vector area points towards +z or, if it is level, towards +y, then +x."""
    level = LEVEL * np.linalg.norm(vector)
    return bool(next((v > 0 for v in vector[::-1] if abs(v) > level), True))
