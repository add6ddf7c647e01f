"""`kerfpath studio`: open a job or a drawing in the browser."""

from __future__ import annotations

import json
from collections.abc import Sequence
from importlib.resources import as_file, files
from pathlib import Path

import numpy as np
from rich.markup import escape

from kerfpath.arrays import Array
from kerfpath.cad import Loop, Part, read
from kerfpath.cli.show import out
from kerfpath.errors import InputError
from kerfpath.extras import require_extra
from kerfpath.files import write_whole
from kerfpath.job import pose

SHIPPED = ("b_pillar.toml", "b_pillar.step")
"""The demo job and its part; the studio copies them, so that they can be changed."""
DRAWINGS = (
    *(".step", ".stp", ".iges", ".igs", ".dxf", ".csv", ".tsv", ".txt"),
    *(".apt", ".aptsource", ".cl", ".cls", ".h", ".mpf", ".nc", ".spf", ".tap"),
)


def open_studio(job: Path | None, *, host: str, port: int, browser: bool) -> None:
    """Serve a job to the browser until the command is stopped.

    Without a job, a copy of the demo job is served. For a drawing, the job beside it with the same
    name is served, and written if there is none.

    Raises
    ------
    InputError
        The packages for the studio are not installed, there is no job, or the port is in use.
    """
    require_extra("studio", "the studio")
    if job is None:
        path = _copy_of_demo()
    elif job.suffix.lower() in DRAWINGS:
        path = first_job(job)
    else:
        path = job
    from kerfpath.studio import serve

    def show(address: str) -> None:
        out.print(f"{escape(str(path))} at [bold]{escape(address)}[/] (stop with Ctrl-C)")

    serve(path, host=host, port=port, browser=browser, show=show)


def _copy_of_demo() -> Path:
    """Return the demo job in a subfolder of the current folder, copied there if it is missing."""
    folder = Path("kerfpath-studio")
    absent = [name for name in SHIPPED if not (folder / name).exists()]
    with as_file(files("kerfpath").joinpath("demo")) as source:
        texts = {folder / name: (source / name).read_bytes() for name in absent}
    try:
        folder.mkdir(exist_ok=True)
        write_whole(texts)
    except OSError as error:
        raise InputError(
            f"{folder}: cannot copy the demo job there ({error.strerror}); run kerfpath studio in "
            "a writable folder, or name a job"
        ) from None
    return folder / SHIPPED[0]


# -----------------------------------------------------------------------------
# Write a first job for a drawing that has none; all its values are guesses to be changed.

MOST_LOOPS = 8
"""Most loops in a first job; the longest are taken."""
NODES = 400
"""Most nodes of a loop; shorter loops are spaced by `SPACING`."""
SPACING = 2.0
"""Least distance between nodes, mm."""
TURNS = ((0, 0, 0), (180, 0, 0), (90, 0, 0), (-90, 0, 0), (0, 90, 0), (0, -90, 0))
"""Roll, pitch and yaw in deg of the ways to lay a part down; the first of the best is taken."""
PLACE = (1300.0, 0.0, 500.0)
"""x and y of the middle of the part and z of its lowest point, mm, robot base; within reach."""
HEAD = """\
# A first job for {drawing}: robot, head, placement, loops and speed are guesses to be changed.

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
    """Return the job beside a drawing with the same name; write one if there is none.

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
            f"{job}: cannot write a job for the drawing ({error.strerror}); copy the drawing to "
            "a writable folder"
        ) from None
    return job


def job_text(part: Part) -> str:
    """Return a job that cuts the longest closed loops of a part, placed in front of the robot.

    Raises
    ------
    InputError
        The part has no closed loop.
    """
    closed = [loop for loop in part.loops if loop.closed and loop.kind != "open"]
    main = [loop for loop in closed if not loop.skin and loop.side in ("outer", "")] or closed
    if not main:
        raise InputError(
            f"{part.path}: expected a closed loop, got none; write a job that picks its open lines"
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
    """Return xyz in mm and rpy in deg with which the beam comes mainly from above."""
    axes = np.vstack([part.contour(loop.name).axes.mean(axis=0) for loop in loops])
    weighed = (axes * np.array([[loop.length] for loop in loops])).sum(axis=0)

    def turned(rpy: tuple[int, ...]) -> Array:
        return np.asarray(pose((0.0, 0.0, 0.0), rpy)[:3, :3])

    rpy = max(TURNS, key=lambda one: round(float(-(turned(one) @ weighed)[2]), 9))
    corners = np.array(np.meshgrid(*part.bounding_box.T)).reshape(3, -1).T @ turned(rpy).T * 1e3
    low, high = corners.min(axis=0), corners.max(axis=0)
    from_middle = np.array([*(low + high)[:2] / 2, low[2]])
    return (np.array(PLACE) - from_middle).round(1).tolist(), rpy
