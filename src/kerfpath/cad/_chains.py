"""From loose flat curves to loops: chained end to end, nested, turned the right way, named."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from kerfpath._arrays import Array, Ints
from kerfpath.cad._build import named_loops, part_without_faces
from kerfpath.cad._connected import label_connected
from kerfpath.cad._curves import Curve, backwards
from kerfpath.cad._left_out import LeftOut
from kerfpath.cad._part import Kind, Loop, Part
from kerfpath.cad._sample import EdgeChain, vector_area
from kerfpath.cad._units import MM
from kerfpath.errors import InputError

__all__ = ["loops_in"]

NOTHING = 1e-6
"""Curves shorter than this, mm, are none; those that lie closer are the same."""
Look = tuple[str, str]
"""Layer and colour: curves that are not drawn alike are not chained."""


def loops_in(
    path: Path,
    unit: str,
    drawn: Mapping[Look, Sequence[Curve]],
    *,
    gap: float,
    notes: Sequence[str],
    left_out: Sequence[LeftOut] = (),
) -> Part:
    """Return the part that flat curves make up, by layer and colour; `gap` in m.

    Closed loops run counter-clockwise about what they enclose, or clockwise about a hole: one that
    lies within an odd number of others.
    """
    chains: list[tuple[Look, EdgeChain[Curve]]] = []
    notes = [*notes, *map(str, left_out)]
    for look, curves in drawn.items():
        kept, repaired = _repair_curves(curves)
        notes += [f"layer {look[0]}, {look[1]}: {what}" for what in repaired]
        chains += [(look, chain) for chain in _chains(kept, gap / MM)]
    if not chains:
        why = f"; {left_out[0]}" if left_out else ""
        raise InputError(
            f"{path}: holds nothing to cut: no line, arc, polyline, ellipse or spline{why}"
        )
    polygons = [chain.around for _, chain in chains if chain.is_closed]
    depth = iter(_depths(polygons))
    kinds: list[Kind] = []
    for k, (look, chain) in enumerate(chains):
        kind: Kind = "open"
        if chain.is_closed:
            kind = "inner" if next(depth) % 2 else "outer"
            if (vector_area(chain.around)[2] > 0) != (kind == "outer"):
                turned = tuple(backwards(curve) for curve in chain.edges[::-1])
                chains[k] = look, EdgeChain(edges=turned)
        kinds.append(kind)
    loops: list[Loop] = []
    for layer in dict.fromkeys(look[0] for look, _ in chains):
        drawn_here = [
            (kind, chain, look[1])
            for (look, chain), kind in zip(chains, kinds, strict=True)
            if look[0] == layer
        ]
        loops += named_loops(drawn_here, face=layer, surface="plane", gap=gap, layer=layer)
    return part_without_faces(path, unit, loops, gap=gap, notes=notes, left_out=left_out)


def _repair_curves(curves: Sequence[Curve]) -> tuple[list[Curve], list[str]]:
    """Return the curves without those that have no length or lie on another, and what was done."""
    long = [curve for curve in curves if curve.length > NOTHING]
    marks = [_mark(curve) for curve in long]
    first = {mark: k for k, mark in reversed(list(enumerate(marks)))}
    kept = [curve for k, curve in enumerate(long) if first[marks[k]] == k]
    repaired = []
    if count := len(curves) - len(long):
        repaired.append(f"{count} curves without length left out")
    if count := len(long) - len(kept):
        repaired.append(f"{count} curves drawn twice left out")
    return kept, repaired


def _mark(curve: Curve) -> tuple[float, ...]:
    """Return numbers that two curves share when they lie on each other, whichever way they run."""
    three = curve.at(np.linspace(curve.start, curve.end, 5)[1:4])
    rounded = (np.round(np.vstack([curve.ends, three]) / (10 * NOTHING)) + 0.0).tolist()
    ends, inner = sorted(rounded[:2]), sorted(rounded[2:])
    return tuple(v for point in (*ends, *inner) for v in point)


def _chains(curves: Sequence[Curve], gap: float) -> Iterator[EdgeChain[Curve]]:
    """Yield the chains of curves whose ends meet within `gap` (mm), two at a place."""
    loose = list(curves)
    if not loose:
        return
    ends = np.array([curve.ends for curve in loose]).reshape(-1, 3)
    place = _places(ends, gap)
    crowd = np.bincount(place)
    at: dict[int, list[int]] = {}
    for end, where in enumerate(place.tolist()):
        at.setdefault(where, []).append(end)
    used = np.zeros(len(loose), dtype=bool)

    def walk(end: int) -> list[Curve]:
        """Return the curves from `end` (2 k: start of curve k, 2 k + 1: its end) to a stop."""
        chain: list[Curve] = []
        while not used[end // 2]:
            used[end // 2] = True
            curve = loose[end // 2]
            chain.append(backwards(curve) if end % 2 else curve)
            there = at[int(place[end ^ 1])]
            if len(there) != 2:
                break
            end = there[0] if there[1] == end ^ 1 else there[1]
        return chain

    # From the places where a chain must end, then around what is closed.
    for end in np.flatnonzero(crowd[place] != 2).tolist():
        if chain := walk(end):
            yield EdgeChain(
                edges=chain, is_closed=False, next_end=_next_end(chain, ends, crowd[place])
            )
    for k in range(len(loose)):
        if chain := walk(2 * k):
            yield EdgeChain(edges=chain)


def _places(ends: Array, gap: float) -> Ints:
    """Return a number (E,) for each end, the same for those that meet.

    Ends that lie on another meet it; only ends left alone look within `gap`, or the two ends of a
    curve shorter than it would meet.
    """
    touching = cKDTree(ends).query_pairs(NOTHING, output_type="ndarray")
    alone = np.setdiff1d(np.arange(len(ends)), touching)
    if alone.size:
        bridged = alone[cKDTree(ends[alone]).query_pairs(gap, output_type="ndarray")]
        touching = np.vstack([touching, bridged])
    return label_connected(touching, len(ends))


def _next_end(chain: Sequence[Curve], ends: Array, crowd: Ints) -> str:
    """Return why an open chain does not go on, at that of its two ends that comes closer to it."""
    mine = [chain[0].ends[0], chain[-1].ends[1]]
    breaks = []
    for end in mine:
        off = np.linalg.norm(ends - end, axis=1)
        here = int(np.argmin(off))
        place = f"at {end.round(3).tolist()} mm"
        if crowd[here] > 2:
            breaks.append((0.0, f"ends {place}, where {crowd[here]} curves meet"))
            continue
        others = off[np.arange(len(off)) != here]
        nearest = float(others.min(initial=np.inf))
        breaks.append((nearest, f"is open {place}: the next end is {nearest:.3f} mm away"))
    return min(breaks)[1]


def _depths(polygons: Sequence[Array]) -> list[int]:
    """Return within how many of the others each closed polygon (K, 3) lies."""
    boxes = np.array([[p.min(axis=0), p.max(axis=0)] for p in polygons]).reshape(-1, 2, 3)
    depths = []
    for k, polygon in enumerate(polygons):
        point = polygon[0]
        around = (boxes[:, 0] <= boxes[k, 0]).all(axis=1) & (boxes[:, 1] >= boxes[k, 1]).all(axis=1)
        around[k] = False
        depths.append(sum(_encloses(polygons[j], point) for j in np.flatnonzero(around).tolist()))
    return depths


def _encloses(polygon: Array, point: Array) -> bool:
    """Return whether a point lies within a polygon: a ray from it crosses the polygon oddly."""
    x, y = polygon[:, 0] - point[0], polygon[:, 1] - point[1]
    x1, y1 = np.roll(x, -1), np.roll(y, -1)
    crosses = (y > 0) != (y1 > 0)
    at = x[crosses] - y[crosses] * (x1[crosses] - x[crosses]) / (y1[crosses] - y[crosses])
    return bool(np.count_nonzero(at > 0) % 2)
