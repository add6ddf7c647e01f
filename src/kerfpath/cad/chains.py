"""Build named, nested, consistently oriented loops from loose flat curves."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise, product
from math import dist
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from kerfpath.arrays import Array, Ints, places_within
from kerfpath.cad.build import named_loops, part_without_faces
from kerfpath.cad.curves import (
    NOTHING,
    UP,
    Curve,
    EdgeChain,
    Mark,
    Trace,
    backwards,
    label_connected,
    measure,
    off_chord,
    sample_curve,
    turned,
)
from kerfpath.cad.left_out import LeftOut
from kerfpath.cad.part import Kind, Loop, Part
from kerfpath.cad.units import MM
from kerfpath.errors import InputError

# -----------------------------------------------------------------------------
# Find loops that lie on each other, however each is drawn.

COINCIDENT = 1e-3
"""Lines whose extent, length and points differ by less (mm) are the same."""
CHORD = 1e-4
"""Deviation (mm) of chords from the curves that are compared."""
MOST_COMPARED = 100
"""Largest number of points of a line that are compared with the other."""
MOST_COINCIDENT = 10_000
"""Largest number of pairs of lines that are compared, which takes milliseconds for each."""
LONG = 10.0
"""Lines longer than this, in gaps, are the same within a gap, as no beam parts them."""


def coincident_pairs(traces: Sequence[Trace], gap: float) -> list[tuple[int, int]]:
    """Return pairs (i, j) of traces with i < j that lie on each other, within `gap` (mm) if long.

    Raises
    ------
    InputError
        Far too many of them.
    """
    if len(traces) < 2:
        return []
    lengths = np.array([float(trace.lengths.sum()) for trace in traces])
    boxes = [trace.bounds().ravel() for trace in traces]
    # A loop around another at some distance is longer by 2 pi times as much.
    facts = np.column_stack([boxes, lengths / (2 * np.pi)])
    found: set[tuple[int, int]] = set()
    for within, those in (
        (COINCIDENT, np.arange(len(traces))),
        (max(gap, COINCIDENT), np.flatnonzero(lengths > LONG * gap)),
    ):
        if not those.size:
            continue
        tree = cKDTree(facts[those])
        if _pair_count(tree, tree, within) > 2 * MOST_COINCIDENT + len(those):
            raise InputError(
                f"more than {MOST_COINCIDENT} pairs of lines lie on each other; draw each line once"
            )
        for pair in tree.query_pairs(within, p=np.inf):
            i, j = sorted(those[list(pair)].tolist())
            one, other = traces[i], traces[j]
            if _lies_on(one.around, other, within) and _lies_on(other.around, one, within):
                found.add((i, j))
    return sorted(found)


def _pair_count(one: cKDTree, other: cKDTree, within: float, p: float = np.inf) -> int:
    """Return how many pairs of a point of each tree are near each other; they are not listed."""
    return int(one.count_neighbors(other, within, p=p))


def _lies_on(points: Array, trace: Trace, within: float) -> bool:
    chords = trace.sample(CHORD, np.pi).points
    if trace.gaps.size == len(trace.lengths):
        chords = np.vstack([chords, chords[:1]])
    step = -(-len(points) // MOST_COMPARED)
    return all(
        off_chord(chords[:-1], chords[1:], point).min() <= within for point in points[::step]
    )


# -----------------------------------------------------------------------------
# Decide which ends of curves continue each other where more than two meet.
#
# If an even number of ends meet at every place, the curves bound the regions that the even-odd
# rule fills. An end is continued by the one across such a region, so that loops that touch at a
# place are separated there: squares drawn side by side, each with all its sides, become squares
# again.

PROBE = 0.02
"""Distance from a place at which curves are ordered around it, as a share of the shortest curve."""
SAMPLED = 0.05
"""Chord error of curves for enclosed regions, as a share of that distance."""
ANGLE_SAMPLES = 257
"""Number of points on a curve among which the one at that distance is searched."""
MOST_CHORDS = 5_000_000
"""Largest number of chords of curves for enclosed regions."""
MOST_CROSSED = 400_000_000
"""Largest number of pairs of a point and a chord at its height; they take about 20 s."""
AT_ONCE = 1_000_000
"""Number of these pairs that are looked at together."""
SMALLEST = 2.0**-30
"""Size of the smallest cells in which boxes are looked for, as a share of all."""


def continuations(
    strokes: Sequence[Sequence[Curve]], alike: Sequence[int], place: Ints
) -> dict[int, int]:
    """Return for each end (2 k: start of stroke k, 2 k + 1: its end) the end that continues it.

    Ends without continuation are left out. These are ends that are alone and, unless an even number
    meet at every place, ends where more than two meet.

    Parameters
    ----------
    strokes : sequence of sequence of Curve
        Connected strokes.
    alike : sequence of int
        A number for each stroke, the same for those that lie on each other.
    place : (2 K,)
        A number for each end, the same for those that meet.
    """
    at: dict[int, list[int]] = {}
    for end, where in enumerate(place.tolist()):
        at.setdefault(where, []).append(end)
    is_even = all(len(ends) % 2 == 0 for ends in at.values())
    crowds = [
        _Crowd(strokes, alike, place, ends) for ends in at.values() if len(ends) > 2 and is_even
    ]
    pairs = [(ends[0], ends[1]) for ends in at.values() if len(ends) == 2]
    if crowds:
        points = np.array([crowd.point for crowd in crowds])
        p, q = _chords(strokes)
        crossed = np.zeros(len(crowds), dtype=np.int64)
        one = np.zeros(len(crowds), dtype=np.int64), np.zeros(len(p), dtype=np.int64)
        for k, _ in ray_crossings(points, p, q, *one):
            crossed += np.bincount(k, minlength=len(crowds))
        for crowd, is_filled in zip(crowds, (crossed % 2).tolist(), strict=True):
            pairs += crowd.pairs(bool(is_filled))
    return dict([*pairs, *((b, a) for a, b in pairs)])


def _chords(strokes: Sequence[Sequence[Curve]]) -> tuple[Array, Array]:
    """Return the chords of all curves, from (K, 3) to (K, 3), which bound the regions.

    Raises
    ------
    InputError
        Far too many, as a curve is tiny beside others.
    """
    curves = [curve for stroke in strokes for curve in stroke]
    chord = SAMPLED * PROBE * min(curve.length for curve in curves)
    lines, count = list[Array](), 0
    for curve in curves:
        lines.append(sample_curve(curve, chord, np.pi)[1])
        count += len(lines[-1])
        if count > MOST_CHORDS:
            raise InputError(
                f"its shortest curve, of {chord / SAMPLED / PROBE:.3g} mm, is too short beside the "
                "others to tell which lines bound a hole; remove it, or draw each loop as one "
                "polyline"
            )
    return np.vstack([line[:-1] for line in lines]), np.vstack([line[1:] for line in lines])


class _Crowd:
    """More than two ends at one place, in their order around it.

    Between the two that are furthest apart is a point near the place, (3,) mm.
    """

    def __init__(
        self,
        strokes: Sequence[Sequence[Curve]],
        alike: Sequence[int],
        place: Ints,
        ends: Sequence[int],
    ) -> None:
        curves = {end: strokes[end // 2][-1 if end % 2 else 0] for end in ends}
        at = np.mean([curve.ends[end % 2] for end, curve in curves.items()], axis=0)
        near = PROBE * min(curve.length for curve in curves.values())
        angle_of: dict[tuple[int, bool], float] = {}
        keys = {}
        for end, curve in curves.items():
            # Strokes that lie on each other have opposite orders at their two ends.
            starts_here = bool(place[end] < place[end ^ 1])
            line = alike[end // 2], starts_here
            if line not in angle_of:
                angle_of[line] = _departure_angle(curve, end % 2, at, near)
            keys[end] = angle_of[line], end if starts_here else -end
        self._around = sorted(ends, key=keys.__getitem__)
        angles = np.array([keys[end][0] for end in self._around])
        wide = np.diff(np.append(angles, angles[0] + 2 * np.pi))
        self._widest = int(np.argmax(wide))
        middle = angles[self._widest] + wide[self._widest] / 2
        self.point = at + near * np.array([np.cos(middle), np.sin(middle), 0.0])

    def pairs(self, is_filled: bool) -> list[tuple[int, int]]:
        """Return the pairs of ends with a filled region between them, as the point is or not."""
        first, count = self._widest if is_filled else self._widest + 1, len(self._around)
        return [
            (self._around[k % count], self._around[(k + 1) % count])
            for k in range(first, first + count, 2)
        ]


def _departure_angle(curve: Curve, is_end: int, at: Array, near: float) -> float:
    """Return the direction (rad) in which a curve leaves a place (3,), at distance `near` (mm)."""
    start, stop = (curve.end, curve.start) if is_end else (curve.start, curve.end)
    points = curve.at(np.linspace(start, stop, ANGLE_SAMPLES)) - at
    away = np.linalg.norm(points[:, :2], axis=1)
    k = max(1, int(np.argmax(away >= near)))
    part = np.clip((near - away[k - 1]) / max(away[k] - away[k - 1], 1e-300), 0.0, 1.0)
    x, y, _ = points[k - 1] + part * (points[k] - points[k - 1])
    return float(np.arctan2(y, x))


def interior_points(polygons: Sequence[Array]) -> Array:
    """Return a point (N, 3) well inside each polygon (K, 3), seen from above."""
    inside = np.empty((len(polygons), 3))
    sizes = np.array([len(polygon) for polygon in polygons])
    for size in np.unique(sizes).tolist():
        own = np.flatnonzero(sizes == size)
        for some in np.array_split(own, -(-len(own) * size // AT_ONCE)):
            inside[some] = _interior_points(np.array([polygons[k] for k in some.tolist()]))
    return inside


def _interior_points(polygons: Array) -> Array:
    """Return a point (N, 3) in each of the polygons (N, K, 3), on the widest part of a level."""
    each = np.arange(len(polygons))
    levels = np.sort(polygons[..., 1], axis=1)
    widest = np.argmax(np.diff(levels, axis=1), axis=1)
    level = (levels[each, widest] + levels[each, widest + 1])[:, None] / 2
    (x, y), (x1, y1) = ((p[..., 0], p[..., 1]) for p in (polygons, np.roll(polygons, -1, axis=1)))
    crosses = (y > level) != (y1 > level)
    part = (level - y) / np.where(crosses, y1 - y, 1.0)
    at = np.sort(np.where(crosses, x + part * (x1 - x), np.inf), axis=1)
    entered, left = at[:, :-1:2], at[:, 1::2]
    wide = np.subtract(left, entered, out=np.full_like(left, -1.0), where=np.isfinite(left))
    k = np.argmax(wide, axis=1)
    found = np.stack([(entered[each, k] + left[each, k]) / 2, level[:, 0], polygons[:, 0, 2]], 1)
    # A polygon of one level has no inside.
    return np.where(crosses.any(axis=1)[:, None], found, polygons[:, 0])


def boxes_around(boxes: Array, within: float) -> Iterator[tuple[Ints, Ints]]:
    """Yield which of the boxes (N, 2, 2) are in which others, or reach out of them `within`.

    Boxes of about one size are looked for in cells of that size, of which each touches four.

    Yields
    ------
    inside, around : (M,) int
        Their numbers; many at a time.

    Raises
    ------
    InputError
        Far too many boxes are in one place.
    """
    low, high = boxes[:, 0] - within, boxes[:, 1] + within
    extent = np.stack([low.min(axis=0), high.max(axis=0)])
    powers = np.ceil(np.log2(np.maximum(high - low, SMALLEST * np.ptp(extent, axis=0))))
    found, count = list[tuple[Ints, Ints]](), 0
    for power in np.unique(powers, axis=0):
        places, first, last, end = (
            np.floor((p - extent[0]) / 2.0**power).astype(np.int64)
            for p in (boxes[:, 0], low, high, extent[1])
        )
        cells = places @ (end[1] + 1, 1)
        order = np.argsort(cells)
        alike = (powers == power).all(axis=1)
        for step in product((0, 1), (0, 1)):
            around = np.flatnonzero(alike & (first + step <= last).all(axis=1))
            cell = (first[around] + step) @ (end[1] + 1, 1)
            there, end_of = (
                np.searchsorted(cells, cell, side, order) for side in ("left", "right")
            )
            for which, at in _ranges(there, end_of - there):
                i, j = order[at], around[which]
                inside = ((low[j] < boxes[i, 0]) & (boxes[i, 1] < high[j])).all(axis=1) & (i != j)
                found.append((i[inside], j[inside]))
                count += len(found[-1][0])
                if count > AT_ONCE:
                    yield _joined(found)
                    found, count = [], 0
    yield _joined(found)


def ray_crossings(
    points: Array, p: Array, q: Array, of_point: Ints, of_segment: Ints
) -> Iterator[tuple[Ints, Ints]]:
    """Yield which rays from points along x cross which segments p q, seen from above.

    Parameters
    ----------
    points : (N, 3)
    p, q : (K, 3)
    of_point, of_segment : (N,), (K,) int
        Numbers of groups: a ray crosses only segments of the group of its point.

    Yields
    ------
    point, segment : (M,) int
        Their numbers; a few at a time.

    Raises
    ------
    InputError
        Far too many points lie at the height of segments.
    """
    levels, rank = np.unique(points[:, 1], return_inverse=True)
    places = of_point * (len(levels) + 1) + rank  # by group, then by level
    order = np.argsort(places)
    first, upto = (
        np.searchsorted(
            places, of_segment * (len(levels) + 1) + np.searchsorted(levels, y), sorter=order
        )
        for y in (np.minimum(p[:, 1], q[:, 1]), np.maximum(p[:, 1], q[:, 1]))
    )
    for segment, at in _ranges(first, upto - first):
        point = order[at]
        (x, y), (x1, y1) = ((end[segment, :2] - points[point, :2]).T for end in (p, q))
        crosses = x - y * (x1 - x) / (y1 - y) > 0
        yield point[crosses], segment[crosses]


def _ranges(first: Ints, count: Ints) -> Iterator[tuple[Ints, Ints]]:
    """Yield the numbers of ranges and what is in them: `count` (R,) integers from `first` (R,) on.

    Raises
    ------
    InputError
        Far too many.
    """
    upto = np.cumsum(count)
    total = int(upto[-1]) if len(upto) else 0
    if total > MOST_CROSSED:
        raise InputError(
            "holds too many lines beside and around each other; leave out what is not to be cut"
        )
    bounds = np.searchsorted(upto, np.arange(0, total + AT_ONCE, AT_ONCE), side="right")
    for low, high in pairwise(np.unique([*bounds, len(first)]).tolist()):
        which = np.repeat(np.arange(low, high), count[low:high])
        yield which, first[which] + places_within(count[low:high])


def _joined(pairs: Sequence[tuple[Ints, Ints]]) -> tuple[Ints, Ints]:
    one, other = (
        np.concatenate([np.zeros(0, np.int64), *each]) for each in zip(*pairs, strict=True)
    )
    return one, other


# -----------------------------------------------------------------------------
# Chain the curves to loops.

MOST_NEAR = 5_000_000
"""Largest number of pairs of ends at different places that may be one."""
MOST_REPORTED = 3
"""Number of open lines whose ends are reported, those with the nearest next end."""
NEARLY = 1.0
"""mm: an end that lies nearer to another may have been meant to meet it."""
LARGER = 1.05
"""Of two loops in the same box, one with an area larger by this factor lies around the other."""
Style = tuple[str, str]
"""Layer and colour; only curves with the same ones are chained."""
Stroke = tuple[Curve, ...]
"""The curves of one entity, each of which ends where the next starts."""
Chain = EdgeChain[Curve]


def part_of_strokes(
    path: Path,
    unit: str,
    drawn: Mapping[Style, Sequence[Stroke]],
    *,
    gap: float,
    notes: Sequence[str],
    left_out: Sequence[LeftOut] = (),
    axis: Array | None = None,
) -> Part:
    """Return the part that strokes, given by layer and colour, make up; `gap` is in m.

    Seen against the tool axis (3,), that is from above, closed loops run counter-clockwise, and
    those around holes, which lie within an odd number of others, run clockwise.

    Raises
    ------
    InputError
        Nothing to cut.
    """
    R = np.eye(3) if axis is None else _rotation_to_axis(axis)
    chains: list[tuple[Style, Chain]] = []
    notes = [*notes, *map(str, left_out)]
    for style, strokes in drawn.items():
        if axis is not None:
            strokes = [tuple(turned(curve, R, UP) for curve in stroke) for stroke in strokes]
        found, repaired = _chained(strokes, gap / MM, R)
        notes += [f"layer {style[0]}, {style[1]}: {what}" for what in repaired]
        chains += [(style, chain) for chain in found]
    if not chains:
        why = f"; {left_out[0]}" if left_out else ""
        raise InputError(f"holds nothing to cut: no line, arc, polyline, ellipse or spline{why}")
    told = _nested([chain for _, chain in chains], gap / MM)
    kinds = [kind for kind, _ in told]
    chains = [(style, chain) for (style, _), (_, chain) in zip(chains, told, strict=True)]
    if axis is not None:
        chains = [(style, _rotated_back(chain, R)) for style, chain in chains]
    loops: list[Loop] = []
    for layer in dict.fromkeys(style[0] for style, _ in chains):
        drawn_here = [
            (kind, chain, style[1])
            for (style, chain), kind in zip(chains, kinds, strict=True)
            if style[0] == layer
        ]
        surface = "plane" if axis is None else "lines"
        loops += named_loops(drawn_here, face=layer, surface=surface, gap=gap, layer=layer)
    if axis is None and (note := _height_note(loops)):
        notes.append(note)
    notes += [*_coincident_notes(loops, gap / MM), *_open_end_notes(loops)]
    return part_without_faces(path, unit, loops, gap=gap, notes=notes, left_out=left_out)


def chains_against(
    strokes: Sequence[Stroke], axis: Array, *, gap: float
) -> tuple[list[tuple[Kind, Chain]], list[str]]:
    """Return the chains of strokes, as of one layer, and what was repaired; `gap` is in m.

    They nest and run as seen against the tool axis (3,), see `part_of_strokes`.
    """
    R = _rotation_to_axis(axis)
    flat = [tuple(turned(curve, R, UP) for curve in stroke) for stroke in strokes]
    chains, repaired = _chained(flat, gap / MM, R)
    told = _nested(chains, gap / MM)
    return [(kind, _rotated_back(chain, R)) for kind, chain in told], repaired


def _nested(chains: Sequence[Chain], gap: float) -> list[tuple[Kind, Chain]]:
    """Return the kind of each chain, and the chain in the direction of that; `gap` is in mm."""
    measure(curve for chain in chains for curve in chain.edges)  # those that were reversed
    holes = iter(_are_holes([chain for chain in chains if chain.is_closed], gap))
    told = list[tuple[Kind, Chain]]()
    for chain in chains:
        kind: Kind = "open"
        if chain.is_closed:
            kind = "inner" if next(holes) else "outer"
            if (chain.area[2] > 0) != (kind == "outer"):
                other_way = tuple(backwards(curve) for curve in chain.edges[::-1])
                chain = EdgeChain(edges=other_way)
        told.append((kind, chain))
    measure(curve for _, chain in told for curve in chain.edges)
    return told


def _rotation_to_axis(axis: Array) -> Array:
    """Return the rotation (3, 3) that turns a tool axis to -z."""
    z = -axis / np.linalg.norm(axis)
    x = np.eye(3)[0 if abs(z[0]) < 0.9 else 1]
    x = x - (x @ z) * z
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z])


def _rotated_back(chain: Chain, R: Array) -> Chain:
    up = tuple(R[2].tolist())
    return replace(chain, edges=[turned(curve, R.T, up) for curve in chain.edges])


def _coincident_notes(loops: Sequence[Loop], gap: float) -> Iterator[str]:
    """Yield a note for each loop that lies on one of another layer or colour."""
    for i, j in coincident_pairs([loop._trace for loop in loops], gap):
        yield f"{loops[i].name} and {loops[j].name} lie on each other: cut twice if both are picked"


HEIGHTS = 1e-3
"""Difference (mm) of the heights of a flat drawing from which a note gives them."""


def _height_note(loops: Sequence[Loop]) -> str:
    """Return a note if a flat drawing has lines at several heights, else ""."""
    z = np.array([loop.bounding_box[:, 2] for loop in loops]) / MM
    if z.max() - z.min() <= HEIGHTS:
        return ""
    return (
        f"lines at several heights, z from {z.min():g} to {z.max():g} mm: loops nest as seen along "
        "the tool axis, and each is cut at its own height; check it"
    )


def _open_end_notes(loops: Sequence[Loop]) -> Iterator[str]:
    """Yield notes on where open lines end."""
    chains = [(loop.name, loop._trace) for loop in loops if loop.kind == "open"]
    hanging = [(c.next_away, name, c.next_end) for name, c in chains if isinstance(c, EdgeChain)]
    for _, name, where in sorted(hanging)[:MOST_REPORTED]:
        yield f"open line: {name} {where}"
    if len(hanging) > MOST_REPORTED:
        yield f"open lines: {len(hanging) - MOST_REPORTED} more"


def _chained(strokes: Sequence[Stroke], gap: float, R: Array) -> tuple[list[Chain], list[str]]:
    """Return the chains of strokes whose ends meet within `gap` (mm), and what was repaired.

    A stroke that lies on another is left out, unless it is a side that two loops share.
    """
    measure(curve for stroke in strokes for curve in stroke)
    drawn = [stroke for given in strokes if (stroke := _head_to_tail(given))]
    same = _same_marks(drawn, gap)
    kept, spare, left = _split_duplicates(drawn, same)
    chains = [EdgeChain(edges=stroke) for stroke in kept if _is_closed(stroke)]
    loose = [stroke for stroke in kept if not _is_closed(stroke)]
    next_end = _OpenEnds(loose, gap, R)
    for own, place, on_others in _connected_groups(loose, spare, gap):
        if _is_even(place):
            chains += _trace_chains(own, place, same, next_end)
            for together, its, _ in _connected_groups(on_others, [], gap):
                if _is_even(its):
                    chains += _trace_chains(together, its, same, next_end)
                else:
                    left += together
            continue
        if on_others:
            together = [*own, *on_others]
            its = _junctions(_ends(together), gap)
            if _is_even(its):
                found = list(_trace_chains(together, its, same, next_end))
                twice = _run_both_ways(found, same)
                if not twice:
                    chains += found
                    continue
                # Lines with the same region on both sides bound nothing: the rest is chained alone.
                within = [twice.issuperset(_marks(stroke, same)) for stroke in together]
                alone = [stroke for stroke, bare in zip(own, within, strict=False) if bare]
                bare = within[len(own) :]
                left += [stroke for stroke, bare in zip(on_others, bare, strict=True) if bare]
                rest = [stroke for stroke, bare in zip(together, within, strict=True) if not bare]
                for apart in (alone, rest):
                    for group, at, _ in _connected_groups(apart, [], gap):
                        chains += _trace_chains(group, at, same, next_end)
                continue
            left += on_others
        chains += _trace_chains(own, place, same, next_end)
    again = {j for _, j in coincident_pairs(chains, gap)}
    repaired = []
    if count := _count_curves(strokes) - _count_curves(drawn):
        repaired.append(f"{count} curves without length left out")
    if count := _count_curves(left) + _count_curves([chains[j].edges for j in again]):
        repaired.append(f"{count} curves drawn twice left out")
    chains = [chain for k, chain in enumerate(chains) if k not in again]
    marks = Counter(mark for chain in chains for mark in _marks(chain.edges, same))
    if count := sum(times > 1 for times in marks.values()):
        repaired.append(f"{count} sides shared by two loops, which are cut twice")
    return chains, repaired


def _count_curves(strokes: Sequence[Sequence[Curve]]) -> int:
    return sum(map(len, strokes))


def _head_to_tail(stroke: Stroke) -> Stroke:
    """Return the curves that have a length, each reversed if needed to continue the one before."""
    left = [curve for curve in stroke if curve.length > NOTHING]
    if len(left) > 1 and _distance_to_end(left[0].ends[1], left[1]) > _distance_to_end(
        left[0].ends[0], left[1]
    ):
        left[0] = backwards(left[0])
    for k in range(1, len(left)):
        end = left[k - 1].ends[1]
        if np.linalg.norm(left[k].ends[1] - end) < np.linalg.norm(left[k].ends[0] - end):
            left[k] = backwards(left[k])
    return tuple(left)


def _distance_to_end(point: Array, curve: Curve) -> float:
    """Return the distance (mm) of a point (3,) from the nearer end of a curve."""
    return float(np.linalg.norm(curve.ends - point, axis=1).min())


def _is_closed(stroke: Stroke) -> bool:
    return dist(stroke[0].ends[0], stroke[-1].ends[1]) <= NOTHING


def _same_marks(strokes: Sequence[Stroke], gap: float) -> dict[Mark, Mark]:
    """Return the mark of the first of the curves that lie on each other, for those after it."""
    alone = {curve.mark: curve for stroke in strokes for curve in stroke}
    marks = list(alone)
    traces = [EdgeChain(edges=(curve,), is_closed=False) for curve in alone.values()]
    same: dict[Mark, Mark] = {}
    for i, j in coincident_pairs(traces, gap):
        same.setdefault(marks[j], same.get(marks[i], marks[i]))
    return same


def _marks(curves: Sequence[Curve], same: Mapping[Mark, Mark]) -> tuple[Mark, ...]:
    return tuple(same.get(curve.mark, curve.mark) for curve in curves)


def _run_both_ways(chains: Sequence[Chain], same: Mapping[Mark, Mark]) -> set[Mark]:
    """Return the marks of curves that one of the chains has more than once."""
    counts = [Counter(_marks(chain.edges, same)) for chain in chains]
    return {mark for count in counts for mark, times in count.items() if times > 1}


def _split_duplicates(
    strokes: Sequence[Stroke], same: Mapping[Mark, Mark]
) -> tuple[list[Stroke], list[Stroke], list[Stroke]]:
    """Return single strokes, open strokes drawn a second time, and those to leave out."""
    marks = [_marks(stroke, same) for stroke in strokes]
    within = {mark for each in marks if len(each) > 1 for mark in each}
    times: Counter[tuple[Mark, ...]] = Counter()
    kept, spare, left = list[Stroke](), list[Stroke](), list[Stroke]()
    for stroke, own in zip(strokes, marks, strict=True):
        key = tuple(sorted(own))
        if len(key) == 1 and key[0] in within:
            times[key] = max(times[key], 1)
        times[key] += 1
        if times[key] == 1:
            kept.append(stroke)
        else:
            (spare if times[key] == 2 and not _is_closed(stroke) else left).append(stroke)
    return kept, spare, left


def _ends(strokes: Sequence[Stroke]) -> Array:
    """Return the first and the last point of each stroke (2 K, 3) mm."""
    ends = [(stroke[0].ends[0], stroke[-1].ends[1]) for stroke in strokes]
    return np.array(ends).reshape(-1, 3)


def _connected_groups(
    loose: Sequence[Stroke], spare: Sequence[Stroke], gap: float
) -> Iterator[tuple[list[Stroke], Ints, list[Stroke]]]:
    """Yield each connected group of strokes, with the spare strokes that end where they do.

    Between the two are the numbers of the junctions (2 K,) at the ends of the K strokes.
    """
    if not (loose or spare):
        return
    places = [_junctions(_ends(strokes), gap) for strokes in (loose, spare)]
    first = len(loose) + len(spare)  # the first number of a place
    links = [[end // 2, first + at] for end, at in enumerate(places[0].tolist())]
    first += len(places[0])
    links += [[len(loose) + end // 2, first + at] for end, at in enumerate(places[1].tolist())]
    if loose and spare:
        links += [[len(loose) + k // 2, end // 2] for k, end in _meeting(spare, loose, gap)]
    group = label_connected(np.array(links, dtype=np.int64), first + len(places[1])).tolist()
    together: dict[int, tuple[list[int], list[Stroke]]] = {}
    for k in range(len(loose)):
        together.setdefault(group[k], ([], []))[0].append(k)
    for k, stroke in enumerate(spare, start=len(loose)):
        together.setdefault(group[k], ([], []))[1].append(stroke)
    for own, others in together.values():
        yield [loose[k] for k in own], places[0].reshape(-1, 2)[own].ravel(), others


def _meeting(spare: Sequence[Stroke], loose: Sequence[Stroke], gap: float) -> Iterator[list[int]]:
    """Yield an end of a spare and one of a loose stroke for each two places where they meet."""
    ends = [np.unique(_ends(strokes), axis=0, return_index=True) for strokes in (spare, loose)]
    tree, other = (cKDTree(places) for places, _ in ends)
    _require_few(_pair_count(tree, other, gap, 2), gap)
    for k, near in enumerate(tree.query_ball_tree(other, gap)):
        yield from ([int(ends[0][1][k]), int(ends[1][1][its])] for its in near)


def _is_even(place: Ints) -> bool:
    """Return whether an even number of ends meet at every junction."""
    return not any(count % 2 for count in Counter(place.tolist()).values())


def _trace_chains(
    strokes: Sequence[Stroke], place: Ints, same: Mapping[Mark, Mark], next_end: _OpenEnds
) -> Iterator[Chain]:
    """Yield the chains of connected open strokes; `place` numbers the junctions of their ends."""
    marks: dict[tuple[Mark, ...], int] = {}
    alike = [
        marks.setdefault(tuple(sorted(_marks(stroke, same))), len(marks)) for stroke in strokes
    ]
    partner = continuations(strokes, alike, place)
    used = np.zeros(len(strokes), dtype=bool)

    def walk(end: int) -> list[int]:
        """Return the ends at which strokes are entered, from `end` until the chain stops."""
        entered: list[int] = []
        while not used[end // 2]:
            used[end // 2] = True
            entered.append(end)
            if end ^ 1 not in partner:
                break
            end = partner[end ^ 1]
        return entered

    # First the chains from places where one must end, then the closed ones.
    for end in range(len(place)):
        if end not in partner and (entered := walk(end)):
            edges = _edges(strokes, entered)
            away, words = next_end.of(edges)
            yield EdgeChain(edges=edges, is_closed=False, next_end=words, next_away=away)
    for k in range(len(strokes)):
        if entered := walk(2 * k):
            for loop in _split_at_repeats(entered, place):
                yield EdgeChain(edges=_edges(strokes, loop))


def _edges(strokes: Sequence[Stroke], entered: Sequence[int]) -> list[Curve]:
    """Return the curves of strokes, each entered at one of its ends."""
    edges: list[Curve] = []
    for end in entered:
        stroke = strokes[end // 2]
        edges += [backwards(curve) for curve in stroke[::-1]] if end % 2 else stroke
    return edges


def _split_at_repeats(entered: Sequence[int], place: Ints) -> Iterator[list[int]]:
    """Split a loop that passes a junction more than once, and yield the parts."""
    path: list[int] = []
    since: dict[int, int] = {}
    for end in entered:
        since[int(place[end])] = len(path)
        path.append(end)
        if (first := since.get(int(place[end ^ 1]), -1)) >= 0:
            yield path[first:]
            for gone in path[first:]:
                since.pop(int(place[gone]), None)
            del path[first:]


def _junctions(ends: Array, gap: float) -> Ints:
    """Return the number (E,) of the junction of each end, the same for ends that meet.

    Ends that coincide meet; only the remaining ends are joined within `gap`, as the two ends of a
    curve shorter than it would meet otherwise.
    """
    if not len(ends):
        return np.empty(0, dtype=np.int64)
    places, at, count = np.unique(ends, axis=0, return_inverse=True, return_counts=True)
    touching = _near_pairs(places, NOTHING)
    alone = np.setdiff1d(np.flatnonzero(count == 1), touching)
    if alone.size:
        touching = np.vstack([touching, alone[_near_pairs(places[alone], gap)]])
    return label_connected(touching, len(places))[at.ravel()]


def _near_pairs(points: Array, within: float) -> Ints:
    """Return the pairs (M, 2) of points (K, 3) mm that are near each other."""
    tree = cKDTree(points)
    _require_few((_pair_count(tree, tree, within, 2) - len(points)) // 2, within)
    return np.asarray(tree.query_pairs(within, output_type="ndarray"))


def _require_few(pairs: int, within: float) -> None:
    if pairs > MOST_NEAR:
        raise InputError(
            f"too many curves end within {within:g} mm of each other; give a smaller gap, or leave "
            "out what is not to be cut"
        )


class _OpenEnds:
    """Where open chains end, and why.

    Parameters
    ----------
    loose : sequence of Stroke
        All open strokes.
    gap : float mm
    R : (3, 3)
        The rotation by which they were turned.
    """

    def __init__(self, loose: Sequence[Stroke], gap: float, R: Array) -> None:
        self._R = R
        ends = _ends(loose)
        place = _junctions(ends, gap)
        self._crowd, self._tree = np.bincount(place)[place], cKDTree(ends)

    def of(self, chain: Sequence[Curve]) -> tuple[float, str]:
        """Return the distance (mm) from an end of a chain to the nearest other end, and a message.

        Of the two ends of the chain, the one with the smaller distance is taken.
        """
        breaks = []
        for end in (chain[0].ends[0], chain[-1].ends[1]):
            away, near = (np.asarray(found) for found in self._tree.query(end, k=2))
            place = (end @ self._R).round(3) + 0.0
            where, crowd = f"at {place.tolist()} mm", self._crowd[near[0]]
            if crowd > 2:
                breaks.append((0.0, f"ends {where}, where {crowd} curves meet"))
            else:
                words = f"is open {where}: the next end is {away[1]:.3f} mm away"
                if away[1] <= NEARLY:
                    words += (
                        f"; to close it, set gap_mm = {_above(away[1]):g} in [part] "
                        "(--gap-mm) or mend the drawing"
                    )
                breaks.append((float(away[1]), words))
        return min(breaks)


def _above(gap: float) -> float:
    """Return a length of two digits above a gap, both in mm."""
    digit = 10.0 ** (np.floor(np.log10(gap)) - 1)
    return float((np.floor(gap / digit) + 1) * digit)


def _are_holes(chains: Sequence[Chain], gap: float) -> list[bool]:
    """Return for each closed chain whether an odd number of the others enclose it, from above.

    Chains may touch or coincide, so a point inside each decides; those whose boxes differ by less
    than `gap` (mm) are the same line, in two layers, unless one is much larger.
    """
    if not chains:
        return []
    boxes = np.array([chain.bounds()[:, :2] for chain in chains])
    areas = np.array([abs(chain.area[2]) for chain in chains])
    points = interior_points([chain.around for chain in chains])
    crossed = np.zeros(len(chains), dtype=np.int64)
    for k, j in boxes_around(boxes, COINCIDENT):
        # Of two chains in one box, such as a circle and an inscribed one, the larger is around.
        wider = np.abs(boxes[k] - boxes[j]).max(axis=(1, 2)) > max(gap, COINCIDENT)
        wider |= areas[j] > LARGER * areas[k]
        k, j = k[wider], j[wider]
        around, group = np.unique(j, return_inverse=True)
        polygons = [chains[one].around for one in around.tolist()]
        p = np.concatenate([np.zeros((0, 3)), *polygons])
        q = np.concatenate([np.zeros((0, 3)), *(np.roll(p, -1, axis=0) for p in polygons)])
        owner = np.repeat(np.arange(len(polygons)), [len(polygon) for polygon in polygons])
        for pair, _ in ray_crossings(points[k], p, q, group, owner):
            crossed += np.bincount(k[pair], minlength=len(chains))
    return [bool(count % 2) for count in crossed]
