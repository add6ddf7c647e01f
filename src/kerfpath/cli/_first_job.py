"""A job to begin with, for a drawing that has none yet: everything in it is there to be changed."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from kerfpath._arrays import Array
from kerfpath._writing import write_whole
from kerfpath.cad import Loop, Part, read
from kerfpath.errors import InputError
from kerfpath.job import pose

__all__ = ["first_job", "job_text"]

MOST_LOOPS = 8
"""Loops that are cut at first: the longest."""
NODES = 400
"""Nodes of the longest loops, at most; others are spaced by `SPACING`."""
SPACING = 2.0
"""mm."""
TURNS = ((0, 0, 0), (180, 0, 0), (90, 0, 0), (-90, 0, 0), (0, 90, 0), (0, -90, 0))
"""deg, roll, pitch and yaw: ways to lay a part down, the first that serves best."""
PLACE = (1300.0, 0.0, 500.0)
"""mm, in the robot base: middle of the part, and its lowest point; within reach."""
HEAD = """\
# A job to begin with, for {drawing}: robot, head, place, loops and speed are guesses to be changed.

[robot]
model = "abb_irb4600_60_205"                              # kerfpath robots lists the others
endless = [4, 6]
acceleration_deg_s2 = [320, 270, 420, 1300, 1400, 2000]   # assumed: the maker publishes none

[tool]
head = "laser-head-45"

[part]
file = {name}
xyz_mm = {xyz}
rpy_deg = {rpy}

# {count} of {total} loops; kerfpath contours {drawing} lists them all.
"""
TAIL = """\
[plan]
gamma_step_deg = 2
"""


def first_job(drawing: Path) -> Path:
    """Return the job beside a drawing that has its name; where there is none, write one.

    Raises
    ------
    InputError
        The drawing cannot be read or has no closed loop; the job cannot be written.
    """
    job = drawing.with_suffix(".toml")
    if job.exists():
        return job
    text = job_text(read(drawing))
    try:
        write_whole({job: text.encode()})
    except OSError as error:
        raise InputError(
            f"{job}: a job for the drawing cannot be written there ({error.strerror}); copy the "
            "drawing to a folder that can be written to"
        ) from None
    return job


def job_text(part: Part) -> str:
    """Return a job that cuts the longest closed loops of a part, laid down before the robot.

    Raises
    ------
    InputError
        It has no closed loop.
    """
    closed = [loop for loop in part.loops if loop.closed and loop.kind != "open"]
    main = [loop for loop in closed if not loop.skin and loop.side in ("outer", "")] or closed
    if not main:
        raise InputError(
            f"{part.path}: has no closed loop to begin with; write a job that picks its lines"
        )
    chosen = sorted(main, key=lambda loop: loop.length)[-MOST_LOOPS:]
    xyz, rpy = _place(part, chosen)
    head = HEAD.format(
        drawing=part.path.name,
        name=json.dumps(part.path.name, ensure_ascii=False),
        xyz=xyz,
        rpy=list(rpy),
        count=len(chosen),
        total=len(part.loops),
    )
    return head + "".join(map(_contour, chosen)) + TAIL


def _contour(loop: Loop) -> str:
    spacing = max(SPACING, round(loop.length * 1e3 / NODES, 1))
    name = json.dumps(loop.name, ensure_ascii=False)
    return f"[[contour]]\npick = {name}\nspeed_m_min = 3\nspacing_mm = {spacing:g}\n\n"


def _place(part: Part, loops: Sequence[Loop]) -> tuple[list[float], tuple[int, ...]]:
    """Return xyz in mm and rpy in deg such that the beam comes from above on the whole."""
    axes = np.vstack([part.contour(loop.name).axes.mean(axis=0) for loop in loops])
    weighed = (axes * np.array([[loop.length] for loop in loops])).sum(axis=0)

    def turned(rpy: tuple[int, ...]) -> Array:
        return np.asarray(pose((0.0, 0.0, 0.0), rpy)[:3, :3])

    rpy = max(TURNS, key=lambda one: round(float(-(turned(one) @ weighed)[2]), 9))
    corners = np.array(np.meshgrid(*part.bounding_box.T)).reshape(3, -1).T @ turned(rpy).T * 1e3
    low, high = corners.min(axis=0), corners.max(axis=0)
    from_middle = np.array([*(low + high)[:2] / 2, low[2]])
    return (np.array(PLACE) - from_middle).round(1).tolist(), rpy
