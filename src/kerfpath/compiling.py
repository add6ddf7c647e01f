"""The kernels of the main job, compiled before the first run by processes side by side."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable

import numpy as np

from kerfpath.certifier import compile_bound
from kerfpath.contour import FRAME_KINDS, Contour
from kerfpath.graph import build, gamma_grid
from kerfpath.kernels import CACHE
from kerfpath.kernels.metric import MANHATTAN, maximum_distance, total_distance
from kerfpath.robots import Robot, robot
from kerfpath.search import compile_search

__all__ = ["compile_stage", "is_compiled", "warm_up"]

EXAMPLES = {"opw": "abb_irb4600_60_205", "ur": "ur_ur10e"}
"""A robot of each kinematic family whose kernels are compiled in advance."""


def _example(kinematics: str) -> tuple[Robot, Contour]:
    """Return a robot of the family, and a closed contour of four nodes in its reach, m."""
    corners = np.array([[1.0, 0.0, 0.4], [1.0, 0.001, 0.4], [1.001, 0.001, 0.4], [1.001, 0.0, 0.4]])
    axes = np.tile([0.0, 0.0, -1.0], (4, 1))
    return robot(EXAMPLES[kinematics]), Contour(corners, axes, closed=True)


def _compile_poses(kinematics: str) -> None:
    """Compile what makes frames, poses and their layered graph."""
    arm, contour = _example(kinematics)
    for kind in FRAME_KINDS:
        frames = contour.frames(kind)
        graph = build(frames, arm, T_flange_tip=np.eye(4), gamma=gamma_grid(np.pi / 2))
    arm.inverse(arm.forward(graph.q[:1]))
    increments = np.diff(graph.q, axis=0)
    for distance in (total_distance, maximum_distance):
        distance(increments, graph.q[0], MANHATTAN)
        distance(graph.q, graph.q[0], MANHATTAN)


def _compile_search(_kinematics: str) -> None:
    compile_search()


def _compile_bound(kinematics: str) -> None:
    """Compile what proves the bound of a plan."""
    arm, contour = _example(kinematics)
    compile_bound(arm, contour.frames(FRAME_KINDS[0]), np.eye(4))


STAGES: dict[str, Callable[[str], None]] = {
    "bound": _compile_bound,
    "search": _compile_search,
    "poses": _compile_poses,
}
"""What compiles the kernels of each stage of the main job; they share next to none."""


def compile_stage(stage: str, kinematics: str) -> None:
    """Compile the kernels of a stage in this process, and note in the cache that they are there."""
    STAGES[stage](kinematics)
    CACHE.mkdir(parents=True, exist_ok=True)
    (CACHE / f"{stage}-{kinematics}.compiled").touch()


def _missing(kinematics: str) -> list[str]:
    if kinematics not in EXAMPLES:
        return []
    return [stage for stage in STAGES if not (CACHE / f"{stage}-{kinematics}.compiled").exists()]


def is_compiled(kinematics: str = "opw") -> bool:
    """Return whether the main job of a kinematic family has nothing left to compile in advance.

    A family that is not among the `EXAMPLES` compiles its kernels when they are first called.
    """
    return not _missing(kinematics)


def warm_up(kinematics: str = "opw") -> bool:
    """Compile the kernels of the main job where that is still to do; return whether it was.

    Each stage is compiled by a Python process of its own; one whose process fails is compiled here,
    so that what is wrong shows.

    Parameters
    ----------
    kinematics : str
        The kinematic family of the robot, as `Robot.kinematics` names it.
    """
    missing = _missing(kinematics)
    call = "from kerfpath.compiling import compile_stage; compile_stage({!r}, {!r})"
    running = {
        stage: subprocess.Popen([sys.executable, "-c", call.format(stage, kinematics)])
        for stage in missing
    }
    for stage, process in running.items():
        if process.wait() != 0:
            compile_stage(stage, kinematics)
    return bool(missing)
