"""Sample contours finely enough to keep the tolerances of the audit between the nodes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from kerfpath.contour import Contour
from kerfpath.errors import InputError
from kerfpath.job.format._contour import ContourSpec
from kerfpath.job.format._program import Tolerances

__all__ = ["chord_error", "closer_nodes"]

MOST_TIMES = 8
"""Largest factor on the number of nodes that was asked for."""
KEPT = 0.9
"""Share of a tolerance that finer sampling aims at, as the curvature varies along a contour."""
LEAST, MOST = 0.2, 0.9
"""Least and largest factor on the distance between nodes in one step."""


def closer_nodes(
    task: ContourSpec, paths: Sequence[Contour], tolerances: Tolerances
) -> ContourSpec | None:
    """Return the task with its nodes close enough to keep the tolerances.

    This is the task itself if its nodes are close enough. If the tool axis turns too fast for its
    tolerance, only the tolerance of the path is kept; None if that is impossible, too.

    Parameters
    ----------
    task : ContourSpec
    paths : sequence of Contour
        The paths to sample.
    tolerances : Tolerances
    """
    found = _closer(task, paths, tolerances)
    return found or _closer(task, paths, replace(tolerances, axis=np.inf))


def chord_error(path: Contour, nodes: Contour) -> float:
    """Return the largest distance (m) of a path's own points from the chords of its nodes."""
    return _between(path, nodes)[0]


def _closer(
    task: ContourSpec, paths: Sequence[Contour], tolerances: Tolerances
) -> ContourSpec | None:
    times = 1.0
    while times < MOST_TIMES:
        try:
            excess = max(_excess(path, task.sample(path), tolerances) for path in paths)
        except InputError:
            return None
        if excess <= 1:
            return task
        # The chord error grows with the square of the chord length.
        share = float(np.clip(np.sqrt(KEPT / excess), LEAST, MOST))
        task, times = task.finer(share), times / share
    return None


def _excess(path: Contour, nodes: Contour, tolerances: Tolerances) -> float:
    off, turned = _between(path, nodes)
    return max(off / tolerances.path, turned / tolerances.axis)


def _between(path: Contour, nodes: Contour) -> tuple[float, float]:
    """Return the largest errors between nodes: of the path's points (m) and of its axes (rad).

    Along a chord the tip moves straight and the axis turns evenly, as in a linear robot motion.
    """
    k = np.clip(np.searchsorted(nodes.s, path.s, side="right") - 1, 0, len(nodes) - 2)
    start, chord = nodes.points[k], np.diff(nodes.points, axis=0)[k]
    part = ((path.points - start) * chord).sum(axis=1) / (chord**2).sum(axis=1)
    part = np.clip(part, 0.0, 1.0)[:, None]
    off = np.linalg.norm(path.points - start - part * chord, axis=1)
    axes = (1 - part) * nodes.axes[k] + part * nodes.axes[k + 1]
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    turned = 2 * np.arcsin(np.clip(np.linalg.norm(axes - path.axes, axis=1) / 2, 0.0, 1.0))
    return float(off.max()), float(turned.max())
