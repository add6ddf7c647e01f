"""Tesseract's Descartes: the shortest path through a ladder of poses, sampled about the beam."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

from benchmarks._tesseract import environment, plugins, request, solved, waypoints
from benchmarks.public.check import Array, Instance
from benchmarks.public.outside._chain import urdf

__all__ = ["SETTINGS", "plan"]

SAMPLES = 36
SETTINGS = (
    f"tesseract-robotics, DescartesMotionPlannerD; {SAMPLES} samples about the beam, inverse "
    "kinematics of OPW arms, edges by its own measure (joint distance); it knows ranges, and no "
    "limits of velocity or acceleration; endless joints turn by three half turns either way"
)


def plan(task: Instance, _: np.random.Generator) -> tuple[Array | None, str]:
    """Return its path, and a remark."""
    if task.external or task.closed_form["family"] != "opw":
        return None, "not run: it has inverse kinematics of OPW arms alone"
    form, ends = task.closed_form, {"base": "part", "tip": "flange"}
    with tempfile.TemporaryDirectory() as folder:
        named = plugins(
            Path(folder),
            **ends,
            lengths=form["lengths"],
            offsets=form["offset"],
            signs=form["sign"],
        )
        srdf = f'<robot name="{task.name}" version="1.0.0">{named}</robot>'
        made = environment(urdf(task), srdf)
    if made is None:
        return None, "its environment refused the description"
    response = solved(request(made, **ends, tool=task.tool, frames=_frames(task), samples=SAMPLES))
    if not response.successful:
        return None, f"it found no plan ({response.message})"
    return waypoints(response), "planned"


def _frames(task: Instance) -> list[Array]:
    """Return a frame with its z along the beam for each node, (4, 4)."""
    frames = []
    for point, z in zip(task.points, task.axes, strict=True):
        x = np.cross(np.eye(3)[np.argmin(np.abs(z))], z)
        x /= np.linalg.norm(x)
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = np.array([x, np.cross(z, x), z]).T, point
        frames.append(T)
    return frames
