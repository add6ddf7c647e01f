"""The kernels of the main job, compiled before the first run by processes side by side."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Collection
from pathlib import Path

import numpy as np

from kerfpath._arrays import freeze
from kerfpath.certifier import compile_bound
from kerfpath.contour import FRAME_KINDS, Contour
from kerfpath.graph import build, gamma_grid
from kerfpath.kernels import CACHE
from kerfpath.kernels.metric import MANHATTAN, maximum_distance, total_distance
from kerfpath.robots import Robot, robot
from kerfpath.search import compile_search

__all__ = ["FOR_BOUNDS", "compile_stage", "finish_compiling", "is_compiled", "warm_up"]

EXAMPLES = {"opw": "abb_irb4600_60_205", "ur": "ur_ur10e"}
"""A robot of each kinematic family whose kernels are compiled in advance."""


def _example(kinematics: str) -> tuple[Robot, Contour]:
    """Return a robot of the family, and a closed contour of four nodes in its reach, m."""
    corners = np.array([[1.0, 0.0, 0.4], [1.0, 0.001, 0.4], [1.001, 0.001, 0.4], [1.001, 0.0, 0.4]])
    axes = np.tile([0.0, 0.0, -1.0], (4, 1))
    return robot(EXAMPLES[kinematics]), Contour(corners, axes, closed=True)


def _compile_poses(kinematics: str) -> None:
    """Compile what makes frames, poses and their layered graph, and what measures a path."""
    arm, contour = _example(kinematics)
    for kind in FRAME_KINDS:
        frames = contour.frames(kind)
        graph = build(frames, arm, T_flange_tip=np.eye(4), gamma=gamma_grid(np.pi / 2))
    arm.inverse(arm.forward(graph.q[:1]))
    increments = np.diff(graph.q, axis=0)
    for distance in (total_distance, maximum_distance):
        distance(increments, graph.q[0], MANHATTAN)
        distance(freeze(increments.copy()), graph.q[0], MANHATTAN)


def _compile_cells(kinematics: str) -> None:
    """Compile what encloses the joints on cells of gamma."""
    arm, contour = _example(kinematics)
    node, gamma = np.zeros(1, np.int64), np.zeros(1)
    arm.enclose(contour.frames(), node, gamma, np.full(1, 0.1), np.eye(4))


STAGES: dict[str, Callable[[str], None]] = {
    "search": lambda _: compile_search(),
    "poses": _compile_poses,
    "bound": lambda _: compile_bound(),
    "cells": _compile_cells,
}
"""What compiles the kernels of each stage of the main job; they share next to none."""

FOR_BOUNDS = frozenset({"bound", "cells"})
"""The stages whose kernels only the certified bound needs."""

_running: dict[str, tuple[str, subprocess.Popen[bytes]]] = {}
"""What is being compiled: by stage, the kinematic family and the process."""


def _note(stage: str, kinematics: str) -> Path:
    """Return the file that says that the kernels of a stage are in the cache."""
    return CACHE / f"{stage}-{kinematics}.compiled"


def _missing(kinematics: str) -> list[str]:
    if kinematics not in EXAMPLES:
        return []
    return [stage for stage in STAGES if not _note(stage, kinematics).exists()]


def compile_stage(stage: str, kinematics: str) -> None:
    """Compile the kernels of a stage in this process, and note in the cache that they are there."""
    STAGES[stage](kinematics)
    CACHE.mkdir(parents=True, exist_ok=True)
    _note(stage, kinematics).touch()


def is_compiled(kinematics: str = "opw") -> bool:
    """Return whether the kernels of the main job are compiled, or are being so, for a robot.

    A family that is not among the `EXAMPLES` compiles its kernels when they are first called.
    """
    return all(stage in _running for stage in _missing(kinematics))


def warm_up(kinematics: str = "opw", *, later: Collection[str] = ()) -> bool:
    """Compile the kernels of the main job if the cache lacks them; return whether it did.

    Each stage is compiled by a Python process of its own, as many at a time as there are.

    Parameters
    ----------
    kinematics : str
        The kinematic family of the robot, as `Robot.kinematics` names it.
    later : collection of str
        Stages that are still compiled when this function returns: `FOR_BOUNDS` or none. Before the
        first bound `kerfpath.plan` waits for them.
    """
    missing = [stage for stage in _missing(kinematics) if stage not in _running]
    for stages in ([s for s in missing if s not in later], [s for s in missing if s in later]):
        for stage in stages:
            _running[stage] = kinematics, _started(stage, kinematics)
        finish_compiling(set(stages) - set(later))
    return bool(missing)


def _started(stage: str, kinematics: str) -> subprocess.Popen[bytes]:
    call = f"import {__name__} as own; own.compile_stage({stage!r}, {kinematics!r})"
    none = subprocess.DEVNULL
    return subprocess.Popen([sys.executable, "-c", call], stdin=none, stdout=none, stderr=none)


def finish_compiling(stages: Collection[str] = tuple(STAGES)) -> None:
    """Wait for stages that are being compiled; compile one here, with its error, if that failed."""
    for stage in stages:
        if stage in _running:
            kinematics, process = _running.pop(stage)
            if process.wait() != 0:
                compile_stage(stage, kinematics)
