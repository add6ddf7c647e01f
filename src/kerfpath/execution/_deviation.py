"""Deviation of a run from the contour that it cuts, at its targets and in its zones."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from kerfpath.contour import Contour
from kerfpath.execution._executed import Executed

__all__ = ["Deviation", "deviation_of"]

SAMPLES = 8
"""Number of samples of the path for each of its nodes, or each target."""


class Deviation(NamedTuple):
    """Largest distance of the tip, m, and largest angle of the tool axis, rad, with times, s."""

    tip: float
    tip_time: float
    axis: float
    axis_time: float


def deviation_of(run: Executed, path: Contour) -> Deviation:
    """Return how far the tip is from the path, and the tool axis from that of the nearest point.

    Parameters
    ----------
    run : Executed
        Evaluated at its samples.
    path : Contour
        The contour as drawn, in the part.
    """
    tip, axis = run.T[:, :3, 3], run.T[:, :3, 2]
    even = np.linspace(path.s[0], path.s[-1], SAMPLES * max(len(path), len(run.course.T)))
    at = np.unique(np.concatenate([path.s, even]))
    points = path.at(at)[0]
    near = np.asarray(cKDTree(points).query(tip)[1])
    # On one of the two chords beside the nearest sample.
    starts = np.clip(near[:, None] + [-1, 0], 0, len(at) - 2)
    chord = points[starts + 1] - points[starts]
    along = ((tip[:, None] - points[starts]) * chord).sum(-1) / (chord**2).sum(-1)
    along = np.clip(along, 0.0, 1.0)
    apart = np.linalg.norm(points[starts] + along[..., None] * chord - tip[:, None], axis=-1)
    row, side = np.arange(len(tip)), np.argmin(apart, axis=1)
    s = at[starts] + along * (at[starts + 1] - at[starts])
    points, axes = path.at(s[row, side])
    off = np.linalg.norm(tip - points, axis=1)
    turned = np.arctan2(np.linalg.norm(np.cross(axes, axis), axis=1), (axes * axis).sum(axis=1))
    k, m = int(np.argmax(off)), int(np.argmax(turned))
    return Deviation(float(off[k]), float(run.time[k]), float(turned[m]), float(run.time[m]))
