"""Deviation of a contour's chords from the curve that it samples."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.spatial import cKDTree

from kerfpath.arrays import Array, Bools, Ints, short_repr
from kerfpath.cad.curves import (
    DirectedCurve,
    Points,
    Polyline,
    Trace,
    creases,
    off_chord,
    sample_curve,
)
from kerfpath.cad.sharp_edges import SMOOTH, Walls, half_turns
from kerfpath.cad.units import MM
from kerfpath.contour import Contour, angle_between, slerp
from kerfpath.errors import InputError
from kerfpath.operations import IN_SCRAP

Reference = Literal["CAD curve", "points of the drawing", "path as cut"]

TINY = np.finfo(float).tiny

ON_CURVE = 1e-5
"""Largest distance (m) of a node from the curve that it lies on; a contour that was sampled twice
is off by some micrometres."""
CHORD, ANGLE = 0.02, 0.05
"""Largest bend of the curve within a cell (mm, rad), so that few points are enough."""
CELLS = 200
"""Smallest number of cells along a loop; the place of a node is searched in the nearby ones."""
POLISH = 6
"""Iterations for the place of a node in its cell; each leaves a small share of the error, because
the curve is nearly straight there."""
LOOKS = 8
"""Intervals of each piece in a first search; an even bend is worst in its middle."""
CLOSER, PEAKS = 128, 16
"""Intervals for a finer search of the pieces with the largest errors, and the number of these."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Departure:
    """Largest errors of a contour, as chords between its nodes, against what it samples.

    Tool axes turn evenly along each chord. Nodes are counted from 0; an error between two nodes has
    the index of the first.

    Parameters
    ----------
    against : "CAD curve", "points of the drawing" or "path as cut"
        Reference of the measurement: the curve; the lines through the points of a table, which
        defines nothing between them; or the path that operations made from a loop.
    chord_error : float m
        Largest distance of the curve from its chord.
    chord_node : int
        Node of that error.
    axis_error : float rad
        Largest angle between the axis along a chord and that of the curve beside it.
    axis_node : int
        Node of that error.
    axis_step : float rad
        Largest angle between the axes of two consecutive nodes.
    step_node : int
        First of these nodes.
    path : Departure or None
        Departure of the path as cut from the loop that it was made from, before operations.
    """

    against: Reference
    chord_error: float
    chord_node: int
    axis_error: float
    axis_node: int
    axis_step: float
    step_node: int
    path: Departure | None = None

    __repr__ = short_repr


def departure(trace: Trace, contour: Contour, tolerance: float, edge_turn: float) -> Departure:
    """Return how far a contour deviates from the trace of a loop, see `Part.departure`.

    Parameters
    ----------
    trace : Trace
    contour : Contour
    tolerance : float m
        Largest distance of a node from the trace.
    edge_turn : float m
        Distance from sharp edges within which the tool axis turns.
    """
    against: Reference = "points of the drawing" if isinstance(trace, Points) else "CAD curve"
    nodes, beside = _cut_nodes(contour), tolerance / MM
    cells = _cells(trace.curves, edge_turn / MM, is_closed=trace.is_closed)
    at = _places(cells, contour.points / MM, nodes, beside, contour.name)
    around = cells.s[-1] if trace.is_closed else np.inf
    length = float(np.diff(contour.s)[_chords(contour)].sum()) / MM
    at = _unroll_places(at, around, length, beside, contour.name)
    return _measure_chords(cells, at, nodes, contour, against)


def departure_from(path: Contour, contour: Contour, drawn: Departure) -> Departure:
    """Return how far a contour deviates from the dense path that operations made from a loop.

    Parameters
    ----------
    path : Contour
        The dense path that was sampled.
    contour : Contour
        All its nodes or some consecutive ones; `s` is their arc length on the path.
    drawn : Departure
        Departure of the dense loop from the drawing.

    Raises
    ------
    InputError
        A contour that does not lie on the path (the message names the node), or that is entirely in
        the scrap.
    """
    off = np.linalg.norm(path.at(contour.s)[0] - contour.points, axis=1)
    if off.max() > ON_CURVE:
        k = int(np.argmax(off))
        raise InputError(
            f"node {k} of contour {contour.name!r} lies {off[k] / MM:.3g} mm off the path "
            f"{path.name!r} at its s (allowed {ON_CURVE / MM:g} mm); give a contour that samples "
            "this path"
        )
    nodes = _cut_nodes(contour)
    line = Polyline(line=replace(path, points=path.points / MM, time=None, x=None))
    cells = _cells([line], 0.0, is_closed=False)
    at = np.interp(contour.s[nodes], np.append(cells.t[:, 0], cells.t[-1, 1]), cells.s)
    return replace(_measure_chords(cells, at, nodes, contour, "path as cut"), path=drawn)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _ShortSpans:
    """Consecutive curves, divided into short cells.

    Parameters
    ----------
    curves : sequence of Curve
    of : (C,) int
        Curve of each cell.
    t : (C, 2)
        Parameters at its start and end.
    ends : (C, 2, 3) mm
        Points there.
    s : (C + 1,) mm
        Length along all cells; gaps between curves count as zero.
    wall : (C,) int
        Stretch between sharp edges that each cell is on.
    walls : Walls
    crease : (C,) bool
        Cells in which the normal jumps; there the reference has no axis.
    """

    curves: Sequence[DirectedCurve]
    of: Ints
    t: Array
    ends: Array
    s: Array
    wall: Ints
    walls: Walls
    crease: Bools

    def at(self, cell: Ints, share: Array) -> tuple[Array, Array]:
        """Return points (..., 3) mm and tool axes (..., 3) at a share (...,) of each cell's t."""
        t = self.t[cell, 0] + share * (self.t[cell, 1] - self.t[cell, 0])
        points, normals = np.empty((*t.shape, 3)), np.empty((*t.shape, 3))
        for k in np.unique(self.of[cell]).tolist():
            here = self.of[cell] == k
            points[here], normals[here] = self.curves[k].evaluate(t[here])
        s = self.s[cell] + share * (self.s[cell + 1] - self.s[cell])
        turned = self.walls.turned(self.wall[cell].ravel(), s.ravel(), normals.reshape(-1, 3))
        return points, -turned.reshape(normals.shape)


def _chords(contour: Contour) -> Ints:
    """Return the first nodes of the chords that are not in the scrap."""
    return np.flatnonzero(~np.isin(contour.kind[:-1], IN_SCRAP))


def _cut_nodes(contour: Contour) -> Ints:
    """Return the nodes at the ends of those chords."""
    chords = _chords(contour)
    if not chords.size:
        raise InputError(f"contour {contour.name!r} is entirely in the scrap; nothing is cut")
    return np.union1d(chords, chords + 1)


def _measure_chords(
    cells: _ShortSpans, at: Array, nodes: Ints, contour: Contour, against: Reference
) -> Departure:
    """Return how far the chords deviate from the cells; `at` (mm) are the places of `nodes`."""
    points, axes, chords = contour.points / MM, contour.axes, _chords(contour)
    a, b, cell, chord = _pieces(cells.s, at)
    chord = nodes[chord]
    keep = np.isin(chord, chords) & ~cells.crease[cell]
    a, b, cell, chord = a[keep], b[keep], cell[keep], chord[keep]

    def errors(of: Ints, looks: int) -> Array:
        """Return chord errors (mm) and axis errors (rad) along some pieces, (2, P, looks + 1)."""
        part = np.linspace(0.0, 1.0, looks + 1)
        share = a[of, None] + (b - a)[of, None] * part
        k = np.broadcast_to(chord[of, None], share.shape)
        p, n = cells.at(np.broadcast_to(cell[of, None], share.shape), share)
        d = points[k + 1] - points[k]
        along = np.clip(((p - points[k]) * d).sum(-1) / (d * d).sum(-1), 0.0, 1.0)[..., None]
        off = np.linalg.norm(points[k] + along * d - p, axis=-1)
        return np.stack([off, angle_between(slerp(axes[k], axes[k + 1], along), n)])

    rough = errors(np.arange(len(chord)), LOOKS).max(axis=-1)
    worst = []
    for i, each in enumerate(rough):
        peaks = np.argsort(-each, kind="stable")[:PEAKS]
        close = errors(peaks, CLOSER)[i].max(axis=-1)
        worst.append((float(close.max()), int(chord[peaks[int(np.argmax(close))]])))
    steps = angle_between(axes[chords], axes[chords + 1])
    return Departure(
        against=against,
        chord_error=worst[0][0] * MM,
        chord_node=worst[0][1],
        axis_error=worst[1][0],
        axis_node=worst[1][1],
        axis_step=float(steps.max()),
        step_node=int(chords[int(np.argmax(steps))]),
    )


def _cells(curves: Sequence[DirectedCurve], edge_turn: float, *, is_closed: bool) -> _ShortSpans:
    """Divide the curves into cells that bend little and are at most 1 / `CELLS` of the length.

    `edge_turn` (mm) is the distance from sharp edges within which the axis turns.
    """
    fine = [sample_curve(curve, CHORD, ANGLE)[:2] for curve in curves]
    lengths = [np.linalg.norm(np.diff(points, axis=0), axis=1) for _, points in fine]
    longest = sum(float(each.sum()) for each in lengths) / CELLS
    of, t, ends, sides, crease = [], [], [], [], []
    for k, (curve, (coarse, _), each) in enumerate(zip(curves, fine, lengths, strict=True)):
        parts = np.maximum(1, np.ceil(each / longest)).astype(np.int64)
        at = np.cumsum(np.concatenate([[0.0], np.repeat(1 / parts, parts)]))
        cut = np.interp(at, np.arange(len(coarse)), coarse)
        points, normals = curve.evaluate(cut)
        of.append(np.full(len(cut) - 1, k))
        t.append(np.stack([cut[:-1], cut[1:]], axis=1))
        ends.append(np.stack([points[:-1], points[1:]], axis=1))
        sides.append(np.stack([normals[:-1], normals[1:]], axis=1))
        crease.append(creases(points, normals))
    whole = np.concatenate(ends)
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(whole[:, 1] - whole[:, 0], axis=1))])
    wall, walls = _walls(s, np.concatenate(sides), np.concatenate(crease), edge_turn, is_closed)
    return _ShortSpans(
        curves=curves, of=np.concatenate(of), t=np.concatenate(t), ends=whole, s=s,
        wall=wall, walls=walls, crease=np.concatenate(crease),
    )  # fmt: skip


def _walls(
    s: Array, sides: Array, crease: Bools, edge_turn: float, is_closed: bool
) -> tuple[Ints, Walls]:
    """Return the stretch between edges that each cell is on, and the stretches.

    `sides` (C, 2, 3) are the normals at both ends of the cells.
    """
    # A crease belongs to what is before it: the edge is at its end, from its first normal on.
    arriving = np.where(crease[:, None], sides[:, 0], sides[:, 1])
    leaving = np.roll(sides[:, 0], -1, axis=0)
    jumps = angle_between(arriving, leaving) > SMOOTH
    if not is_closed:
        jumps[-1] = False
    edges = np.flatnonzero(jumps)
    about = half_turns(arriving[edges], leaving[edges])
    wall = np.searchsorted(edges, np.arange(len(sides)))  # an edge is at the end of its cell
    start = np.concatenate([[s[0]], s[edges + 1]])
    end = np.concatenate([s[edges + 1], [s[-1]]])
    none = np.zeros((1, 3))
    first, last = np.vstack([none, -about]), np.vstack([about, none])
    if is_closed and edges.size:  # the first and the last stretch are one
        around = s[-1] - s[0]
        start[0], first[0] = s[edges[-1] + 1] - around, -about[-1]
        end[-1], last[-1] = s[edges[0] + 1] + around, about[0]
    return wall, Walls(start=start, end=end, first=first, last=last, reach=edge_turn)


def _places(cells: _ShortSpans, points: Array, nodes: Ints, tolerance: float, name: str) -> Array:
    """Return the place along the cells (mm) that is nearest to each node."""
    p, ends = points[nodes], cells.ends
    # The middle of the nearest cell is no farther than this from a node that lies on it.
    reach = float(np.diff(cells.s).max()) / 2 + CHORD + tolerance
    tree = cKDTree(ends.mean(axis=1))
    pairs = cKDTree(p).sparse_distance_matrix(tree, reach, output_type="ndarray")
    i, c = pairs["i"], pairs["j"]
    order = np.lexsort((c, off_chord(ends[c, 0], ends[c, 1], p[i]), i))
    found, first = np.unique(i[order], return_index=True)
    if len(found) < len(p):
        off = np.asarray(tree.query(p)[0])
        k = int(np.argmax(off))
        off[k] = off_chord(ends[:, 0], ends[:, 1], p[k]).min()
    else:
        cell = c[order[first]]
        d = ends[cell, 1] - ends[cell, 0]
        share = np.zeros(len(p))
        for _ in range(POLISH):
            ahead = ((p - cells.at(cell, share)[0]) * d).sum(1) / np.maximum((d * d).sum(1), TINY)
            share = np.clip(share + ahead, 0.0, 1.0)
        off = np.asarray(np.linalg.norm(cells.at(cell, share)[0] - p, axis=1))
        k = int(np.argmax(off))
    if off[k] > tolerance:
        raise InputError(
            f"node {nodes[k]} of contour {name!r} lies {off[k]:.3g} mm off it, at "
            f"{p[k].round(3).tolist()} mm (allowed {tolerance:.3g} mm); give a contour that "
            "samples this loop"
        )
    return np.asarray(cells.s[cell] + share * np.diff(cells.s)[cell])


def _unroll_places(at: Array, around: float, length: float, tolerance: float, name: str) -> Array:
    """Return places along a loop as increasing or decreasing values that continue past its end.

    Parameters
    ----------
    at : (M,) mm
    around : float mm
        Length of the loop, infinite for an open one.
    length : float mm
        Length of the contour outside the scrap, which determines its direction.
    tolerance : float mm
        Steps back within twice this are taken as inaccuracy.
    name : str
    """
    slack = 2 * tolerance
    ways = {}
    for sign in (1.0, -1.0):
        steps = np.mod(sign * np.diff(at) + slack, around) - slack
        ways[sign] = at[0] + sign * np.concatenate([[0.0], np.cumsum(np.maximum(steps, 0.0))])
    runs = {sign: abs(abs(each[-1] - each[0]) - length) for sign, each in ways.items()}
    sign = min(runs, key=runs.__getitem__)
    if not runs[sign] <= min(around, length) / 2 + slack:
        raise InputError(
            f"contour {name!r} lies on it, but its nodes run back and forth; give a contour that "
            "samples this loop"
        )
    return np.asarray(ways[sign])


def _pieces(s: Array, at: Array) -> tuple[Array, Array, Ints, Ints]:
    """Return the pieces between cell ends and nodes: from, to (shares), cell and chord of each.

    Parameters
    ----------
    s : (C + 1,) mm
        Places of the ends of the cells along the loop.
    at : (M,) mm
        Places of the nodes, increasing or decreasing.
    """
    falls = at[-1] < at[0]
    nodes = at[::-1] if falls else at
    turns = np.arange(np.floor(nodes[0] / s[-1]), np.floor(nodes[-1] / s[-1]) + 1)
    borders = (s + s[-1] * turns[:, None]).ravel()
    cuts = np.union1d(nodes, borders[(borders > nodes[0]) & (borders < nodes[-1])])
    middle = (cuts[:-1] + cuts[1:]) / 2
    turn = s[-1] * np.floor(middle / s[-1])
    cell = np.clip(np.searchsorted(s, middle - turn, side="right") - 1, 0, len(s) - 2)
    chord = np.clip(np.searchsorted(nodes, middle, side="right") - 1, 0, len(nodes) - 2)
    start, size = s[cell] + turn, np.diff(s)[cell]
    share = [np.clip((each - start) / size, 0.0, 1.0) for each in (cuts[:-1], cuts[1:])]
    return share[0], share[1], cell, len(nodes) - 2 - chord if falls else chord
