"""Build named loops, and parts without faces, from the traces that the readers find."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from kerfpath.arrays import Array, freeze
from kerfpath.cad.curves import Arc, Points, Trace, vector_area
from kerfpath.cad.left_out import LeftOut
from kerfpath.cad.part import Kind, Loop, Part
from kerfpath.cad.units import LARGEST, MM
from kerfpath.contour import angle_between
from kerfpath.errors import InputError

# -----------------------------------------------------------------------------
# Recognise round holes among loops.

ROUND = 5e-5
"""Largest deviation (m) of a round hole from a circle."""
FLAT = 0.1
"""Largest deviation of a round hole from its mean plane, as a share of its diameter; a hole drilled
into a curved sheet deviates."""


LONG = 1.2
"""Largest ratio of the area of a circle as long as a loop to that of the loop; a square: 1.27."""


def may_be_round(length: float, area: float) -> bool:
    """Return whether a loop encloses nearly as much as a circle of the same length."""
    return length * length <= LONG * 4 * np.pi * area


def diameter(points: Array) -> float | None:
    """Return the diameter (m) of the circle through `points` (K, 3) m, or None if there is none."""
    centred = points - points.mean(axis=0)
    axes = np.linalg.svd(centred, full_matrices=False)[2]
    x, y, height = (centred @ axes.T).T
    # A circle about (a, b): x^2 + y^2 = 2 a x + 2 b y + c, linear in its three unknowns.
    a, b, c = np.linalg.lstsq(
        np.stack([2 * x, 2 * y, np.ones_like(x)], axis=1), x**2 + y**2, rcond=None
    )[0]
    radius = float(np.sqrt(max(c + a**2 + b**2, 0.0)))
    off = np.abs(np.hypot(x - a, y - b) - radius).max()
    is_round = off <= min(ROUND, radius / 20) and np.ptp(height) <= FLAT * 2 * radius
    return 2 * radius if is_round else None


# -----------------------------------------------------------------------------
# Contours through given points: repeated points, flipped axes, closed ends.

REPEATED = 1e-6
"""mm: consecutive points closer than this are one, because they define no direction."""
TURNED = float(np.radians(2.0))
"""rad: axes at the same point that differ by less are the same."""
FLIP = float(np.radians(90.0))
"""rad: an axis that turns by more from one point to the next has flipped."""


def trace_of_points(
    points: Array, normals: Array, lines: Array, gap: float
) -> tuple[Points, list[str]]:
    """Return the trace of points without repeated ones, closed if its ends meet, and notes.

    Parameters
    ----------
    points, normals : (K, 3) mm, unit vectors
    lines : (K,) int
        Line of each point in the file.
    gap : float mm
        Largest distance between the ends of a closed trace.

    Raises
    ------
    InputError
        A single point, an axis that flips or turns on the spot, ends that meet with different axes.
    """
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    turns = angle_between(normals[:-1], normals[1:])
    repaired = []
    again = steps <= REPEATED
    if (bad := np.flatnonzero(again & (turns > TURNED))).size:
        raise InputError(
            f"line {lines[bad[0] + 1]}: the same point as line {lines[bad[0]]} with another axis; "
            "a contour cannot turn on the spot"
        )
    if again.any():
        first = int(np.argmax(again)) + 1
        repaired.append(f"{again.sum()} repeated points left out, the first in line {lines[first]}")
        keep = np.concatenate([[True], ~again])
        points, normals, lines = points[keep], normals[keep], lines[keep]
    if len(points) < 2:
        raise InputError(f"line {lines[0]}: a contour needs at least 2 points, got {len(points)}")
    for k, angle in enumerate(angle_between(normals[:-1], normals[1:])):
        if angle > FLIP:
            raise InputError(
                f"line {lines[k + 1]}: the axis turns by {np.degrees(angle):.0f} deg from line "
                f"{lines[k]}; reverse it, or add points between"
            )
    is_closed = len(points) > 3 and float(np.linalg.norm(points[-1] - points[0])) <= gap
    if is_closed:
        if angle_between(normals[-1:], normals[:1])[0] > TURNED:
            raise InputError(
                f"line {lines[-1]}: ends where it began, line {lines[0]}, but with another axis"
            )
        points, normals = points[:-1], normals[:-1]
    return Points(points=points, normals=normals, is_closed=is_closed), repaired


def kind_of_points(trace: Points) -> Kind:
    """Return the kind of a trace: a closed one is outer if counter-clockwise about its normals."""
    if not trace.is_closed:
        return "open"
    area = vector_area(trace.points)
    return "outer" if area @ trace.normals.mean(axis=0) >= 0 else "inner"


# -----------------------------------------------------------------------------
# Named loops, and parts without faces.

STEMS: Mapping[Kind, str] = {"outer": "outer", "inner": "hole", "open": "line"}
"""Last part of the names of loops, before their number."""
SUNK: Mapping[Kind, str] = {"inner": "sunk"}
"""The same, of the borders of countersinks."""


def loop_of(
    *,
    name: str,
    face: str,
    kind: Kind,
    trace: Trace,
    surface: str,
    gap: float,
    layer: str = "",
    colour: str = "",
    feeds: tuple[float, ...] = (),
) -> Loop:
    """Return the loop along `trace` with its measures; it is closed if no gap is above `gap` (m).

    Raises
    ------
    InputError
        A trace that is too long or reaches too far for any part.
    """
    length, box, widest = float(trace.lengths.sum()), trace.bounds(), trace.gaps.max(initial=0.0)
    if not (length <= LARGEST and (np.abs(box) <= LARGEST).all()):
        raise InputError(
            f"loop {name!r} reaches further than {LARGEST / 1e6:g} km; the file is damaged, or its "
            "unit is wrong"
        )
    is_round = kind != "open" and may_be_round(length, float(np.linalg.norm(trace.area)))
    return Loop(
        name=name,
        face=face,
        kind=kind,
        surface=surface,
        length=length * MM,
        bounding_box=freeze(box * MM),
        edges=len(trace.lengths),
        shortest_edge=float(trace.lengths.min()) * MM,
        largest_gap=float(widest) * MM,
        closed=kind != "open" and float(widest) * MM <= gap,
        diameter=_diameter_of(trace) if is_round else None,
        layer=layer,
        colour=colour,
        feeds=feeds,
        _trace=trace,
    )


def _diameter_of(trace: Trace) -> float | None:
    """Return the diameter (m) of a round loop, None for another."""
    first = trace.curves[0]
    if len(trace.curves) == 1 and isinstance(first, Arc) and first.radius is not None:
        return 2 * first.radius * MM
    return diameter(trace.around * MM)


def named_loops(
    found: Sequence[tuple[Kind, Trace, str]],
    *,
    face: str,
    surface: str,
    gap: float,
    layer: str,
    stems: Mapping[Kind, str] = STEMS,
) -> list[Loop]:
    """Return the loops of a face, a skin or a layer, outer before inner, numbered by position.

    Parameters
    ----------
    found : sequence of (kind, trace, colour)
    face, surface, gap, layer
        As in `loop_of`.
    stems : mapping of kind to str
        Last part of the names, before their number.
    """
    loops = []
    for kind, stem in stems.items():
        alike = [(trace, colour) for k, trace, colour in found if k == kind]
        middles = np.array([trace.around.mean(axis=0) for trace, _ in alike]).reshape(-1, 3)
        # Middles are rounded, so that last bits do not decide an order.
        order = np.lexsort(middles.round(3).T[::-1]).tolist()
        for number, (trace, colour) in enumerate((alike[k] for k in order), start=1):
            last = stem if kind == "outer" and len(alike) == 1 else f"{stem}{number}"
            loops.append(
                loop_of(
                    name=f"{face}/{last}", face=face, kind=kind, trace=trace, surface=surface,
                    gap=gap, layer=layer, colour=colour,
                )
            )  # fmt: skip
    return loops


def part_without_faces(
    path: Path,
    unit: str,
    loops: Sequence[Loop],
    *,
    gap: float,
    notes: Sequence[str],
    left_out: Sequence[LeftOut] = (),
) -> Part:
    """Return a part that is drawn by lines or points only."""
    boxes = np.array([loop.bounding_box for loop in loops])
    return Part(
        path=path,
        unit=unit,
        bounding_box=freeze(np.stack([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)])),
        faces=0,
        loops=tuple(loops),
        notes=tuple(notes),
        left_out=tuple(left_out),
        _gap=gap,
    )
