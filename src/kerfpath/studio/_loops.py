"""The message about the part: its loops, cut or not, and the face of each of its triangles."""

from __future__ import annotations

import numpy as np

from kerfpath.cad import Loop, Part
from kerfpath.job import Job
from kerfpath.studio._messages import FaceEntry, LoopEntry, PartMessage
from kerfpath.studio._numbers import flat

__all__ = ["part_message"]

MOST_LOOPS = 3000
"""Number of loops that a page gets, the longest ones: more could not be distinguished."""
FINEST = 2e-5
"""Least chord error of a drawn loop, m: smaller errors are not visible."""
SHARE = 2e-3
"""Chord error as a share of the length of the loop, so that small holes look round."""
COARSEST = 2e-4
"""Largest chord error of a drawn loop, m."""


def part_message(job: Job, part: Part, revision: int) -> PartMessage:
    """Return the pickable loops of a part, in the robot base, and the faces of its mesh.

    As in `Part.pick`, loops of the pieces of a skin and loops around the thickness of a sheet are
    left out.
    """
    asked = [loop for loop in part.loops if not loop.skin and loop.side != "edge"]
    told = sorted(asked, key=lambda loop: -loop.length)[:MOST_LOOPS]
    kept = {loop.name for loop in told}
    return PartMessage(
        revision=revision,
        loops=[_entry(loop, job) for loop in asked if loop.name in kept],
        faces=[FaceEntry(name=name, triangles=count) for name, count in part.mesh_faces()],
        left_out=len(part.loops) - len(told),
    )


def _entry(loop: Loop, job: Job) -> LoopEntry:
    off = float(np.clip(SHARE * loop.length, FINEST, COARSEST))
    points = loop.line(off) @ job.placement[:3, :3].T + job.placement[:3, 3]
    return LoopEntry(
        name=loop.name,
        face=loop.face,
        kind=loop.kind,
        side=loop.side,
        closed=loop.closed,
        length=loop.length,
        diameter=loop.diameter,
        gap=loop.largest_gap,
        points=flat(points, 6),
    )
