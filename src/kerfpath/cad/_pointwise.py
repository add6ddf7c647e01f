"""Contours through given points: repeated points, flipped axes, closed ends."""

from __future__ import annotations

import numpy as np

from kerfpath._arrays import Array
from kerfpath.cad._part import Kind
from kerfpath.cad._sample import Points, vector_area
from kerfpath.contour import angle_between
from kerfpath.errors import InputError

__all__ = ["REPEATED", "kind_of_points", "trace_of_points"]

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
