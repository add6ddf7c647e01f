"""Warn of contours that are cut through the part itself, from below, or from both sides."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from kerfpath.arrays import Array, Ints, spread
from kerfpath.cad import Part, Triangles
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
OPPOSITE, ALIKE = -0.9, 0.05
"""Largest product of the mean axes of loops that face each other, and the share of their lengths by
which these differ at most, and by which one lies beside the other."""
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


def both_sides(part: Part, picked: Sequence[str]) -> list[str]:
    """Return a warning if loops on both sides of a sheet are picked that are the same cut.

    They face each other: opposite axes, nearly the same length, one behind the other.

    Parameters
    ----------
    part : Part
    picked : sequence of str
        Names of the loops.
    """
    loops = [part.loop(name) for name in picked]
    one, other = ([each for each in loops if each.side == s] for s in ("outer", "inner"))
    if not (one and other):
        return []
    axes = {each.name: part.contour(each.name).axes.mean(axis=0) for each in (*one, *other)}
    twice = list[tuple[str, str]]()
    for a in other:
        for b in one:
            away = (b.bounding_box - a.bounding_box).mean(axis=0)
            aside = np.linalg.norm(np.cross(away, axes[a.name]))
            is_behind = axes[a.name] @ axes[b.name] < OPPOSITE and aside < ALIKE * a.length
            if is_behind and abs(a.length - b.length) < ALIKE * b.length:
                twice.append((a.name, b.name))
                break
    if not twice:
        return []
    which = listed([" and ".join(each) for each in twice], MOST_LISTED)
    return [
        f"{which}: the job cuts through the sheet from both sides, twice at the same place; pick "
        'the loops of one side, with side = "outer" in [contour.pick_all] or by their names'
    ]


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
