"""Holes that tests of the executed path cut."""

import numpy as np

from kerfpath import Contour


def round_hole(radius, count=2001):
    """A dense circle with arcs of 0.7 of the radius that lead in and out."""
    a, b = np.linspace(0, 2 * np.pi, count), np.linspace(0, np.pi / 2, 201)
    inner, small = 0.3 * radius, 0.7 * radius
    out = np.c_[inner + small * np.cos(b), small * np.sin(b), 0 * b]
    into = out[::-1] * [1.0, -1.0, 1.0]
    circle = radius * np.c_[np.cos(a), np.sin(a), 0 * a]
    points = np.concatenate([into[:-1], circle, out[1:]])
    kind = np.repeat([2, 0, 5], [len(into) - 1, len(circle) - 1, len(out)])
    return Contour(points, np.tile([0.0, 0.0, -1.0], (len(points), 1)), kind=kind, name="hole")
