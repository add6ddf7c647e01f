"""Warn of contours that are surely cut from the wrong side: through the part, or from below."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from kerfpath.arrays import Array, Ints, spread
from kerfpath.cad import Triangles
from kerfpath.contour import Contour
from kerfpath.job.format import Job
from kerfpath.names import listed

CLEAR, BESIDE = 2e-3, 1e-3
"""m: the beam is looked at from this distance before the tip on, in the middle and this far beside
it to all sides, so that walls along which it passes are not in its way."""
MOST_NODES = 200
"""Most nodes of a contour that are looked at."""
FROM_BELOW = 0.5
"""Least rise of the mean tool axis, a sine, at which a contour is cut from below."""
MOST_LISTED = 3
"""Most contours that a warning names."""


def sides_in_doubt(
    job: Job, contours: Iterable[tuple[str, Contour]], mesh: tuple[Array, Ints]
) -> list[str]:
    """Return a warning for contours whose beam passes the part first, and for a part turned over.

    Parameters
    ----------
    job : Job
    contours : iterable of (str, Contour)
        Name and nodes of each contour, in the part.
    mesh : (V, 3) m and (F, 3)
        Vertices and triangles of the part; none for a drawing of lines.
    """
    vertices, faces = mesh
    corners = vertices[faces] * 1e3
    part = Triangles(corners, np.zeros(len(faces), np.int64)) if len(faces) else None
    through, below = dict[str, float](), list[str]()
    for name, nodes in contours:
        if part is not None and np.isfinite(distance := _before_the_tip(part, nodes)):
            through[name] = distance
        if (job.placement[:3, :3] @ nodes.axes.mean(axis=0))[2] > FROM_BELOW:
            below.append(name)
    said = [
        f"{name}: the beam passes the part itself {distance * 1e3:.0f} mm before the tip, so the "
        "head would stand inside or behind it; pick the loop on the outer side of the sheet, or "
        "set outer_towards in [part]"
        for name, distance in through.items()
    ]
    turned = any(axis.carries == "part" and axis.kind == "rotary" for axis in job.robot.externals)
    if below and not turned:
        said.append(
            f"{listed(below, MOST_LISTED)}: the beam comes from below, in the robot base, through "
            "whatever the part lies on; turn the part over (rpy_deg in [part]), or pick loops of "
            "its other side"
        )
    return said


def _before_the_tip(part: Triangles, nodes: Contour) -> float:
    """Return how far before the tip the beam meets the part, m, at the nearest; inf if nowhere."""
    some = spread(len(nodes), min(len(nodes), MOST_NODES))
    axes = nodes.axes[some]
    across = np.cross(axes, np.eye(3)[np.abs(axes).argmin(axis=1)])
    across /= np.linalg.norm(across, axis=1)[:, None]
    along = np.cross(axes, across)
    met = np.zeros(len(some))
    for side in (0 * across, across, -across, along, -along):
        origins = nodes.points[some] - CLEAR * axes + BESIDE * side
        body = np.zeros(len(some), np.int64)
        met = np.maximum(met, part.first(origins * 1e3, -axes, body)[0])
    return float(met.min()) * 1e-3 + CLEAR
