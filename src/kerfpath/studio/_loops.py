"""The part as a message: its loops, to be cut or not, and whose its triangles are."""

from __future__ import annotations

import numpy as np

from kerfpath.cad import Loop, Part
from kerfpath.job import Job
from kerfpath.studio._messages import FaceEntry, LoopEntry, PartMessage
from kerfpath.studio._numbers import flat

__all__ = ["part_message"]

MOST_LOOPS = 3000
"""Loops that a page gets, the longest: no picture shows more of them apart."""
FINEST = 2e-5
"""m: no chord of a line that is drawn need be nearer to its curve."""
SHARE = 2e-3
"""Of the length of a loop: how far the chords may be off it, so that small holes look round."""
COARSEST = 2e-4
"""m: the farthest that they may be off it."""


def part_message(job: Job, part: Part, revision: int) -> PartMessage:
    """Return the loops of a part that can be picked, in the base, and the faces of its mesh.

    Loops of faces that are pieces of a skin are left out, and those around the thickness of a
    sheet: `Part.pick` leaves them out, too.
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
