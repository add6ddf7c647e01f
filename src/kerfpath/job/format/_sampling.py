"""Nodes so near to each other that what lies between them keeps the tolerances of the audit."""

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
"""How many times as many nodes there may be as were asked for."""
KEPT = 0.9
"""Share of a tolerance that a finer sampling is to keep: what is drawn does not bend evenly."""
LEAST, MOST = 0.2, 0.9
"""Shares of the distance between nodes, the least and the most that is tried next."""


def closer_nodes(
    task: ContourSpec, paths: Sequence[Contour], tolerances: Tolerances
) -> ContourSpec | None:
    """Return the task with its nodes as near to each other as the tolerances ask for.

    The task itself where they are near enough. Where the tool axis turns too fast for its
    tolerance, only that of the path is kept; None where that cannot be, either.

    Parameters
    ----------
    task : ContourSpec
    paths : sequence of Contour
        That it is to sample.
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
        # What a chord leaves out grows with the square of its length.
        share = float(np.clip(np.sqrt(KEPT / excess), LEAST, MOST))
        task, times = task.finer(share), times / share
    return None


def _excess(path: Contour, nodes: Contour, tolerances: Tolerances) -> float:
    off, turned = _between(path, nodes)
    return max(off / tolerances.path, turned / tolerances.axis)


def _between(path: Contour, nodes: Contour) -> tuple[float, float]:
    """Return how far (m) a path's own points lie off the chords of its nodes, and the axes (rad).

    Along a chord the tip goes straight and the axis turns evenly, as a robot moves them.
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
