"""Compile the kernels of the main job before the first run, in parallel processes."""

from __future__ import annotations

import subprocess
from collections.abc import Callable, Collection
from pathlib import Path

import numpy as np

from kerfpath.arrays import freeze
from kerfpath.certifier import compile_bound
from kerfpath.contour import FRAME_KINDS, Contour
from kerfpath.graph import build, gamma_grid
from kerfpath.isolated import start_python
from kerfpath.kernels import CACHE, is_kept
from kerfpath.kernels.metric import MANHATTAN, maximum_distance, total_distance
from kerfpath.kernels.rays import first_met
from kerfpath.kernels.screening import Energy, energies, newton_steps
from kerfpath.robots import Robot, robot
from kerfpath.search import compile_exact, compile_search

__all__ = ["LATER", "compile_stage", "finish_compiling", "is_compiled", "warm_up"]

EXAMPLES = {"opw": "abb_irb4600_60_205", "ur": "ur_ur10e"}
"""One robot of each kinematic family whose kernels are compiled in advance."""


def _example(kinematics: str) -> tuple[Robot, Contour]:
    """Return a robot of the family, and a closed contour of four nodes (m) in its reach."""
    corners = np.array([[1.0, 0.0, 0.4], [1.0, 0.001, 0.4], [1.001, 0.001, 0.4], [1.001, 0.0, 0.4]])
    axes = np.tile([0.0, 0.0, -1.0], (4, 1))
    return robot(EXAMPLES[kinematics]), Contour(corners, axes, closed=True)


def _compile_poses(kinematics: str) -> None:
    """Compile the kernels of frames, poses, their layered graph, measures of a path, and rays."""
    robot, contour = _example(kinematics)
    for kind in FRAME_KINDS:
        frames = contour.frames(kind)
        graph = build(frames, robot, T_flange_tip=np.eye(4), gamma=gamma_grid(np.pi / 2))
    poses = robot.forward(graph.q[:1])
    robot.inverse(poses)
    robot.arm.follow(poses, graph.q[:1], np.zeros(1, np.int64))
    increments = np.diff(graph.q, axis=0)
    for distance in (total_distance, maximum_distance):
        distance(increments, graph.q[0], MANHATTAN)
        distance(freeze(increments.copy()), graph.q[0], MANHATTAN)
    ray, body = np.ones((1, 3)), np.zeros(1, np.int64)
    first_met(ray, ray, body, np.zeros((1, 3, 3)), body, np.zeros((2, 2, 3)))


def _compile_searches(_: str) -> None:
    """Compile the kernels of the searches over continuous gamma."""
    compile_search()
    q, ones, one = np.zeros((1, 3, 6)), freeze(np.ones(6)), np.ones(1)
    energy = Energy(ones, MANHATTAN, False, 1.0, 1.0, ones, ones, freeze(-ones), ones, 1.0)
    energies(q, energy, one, np.empty(1))
    newton_steps(q, q, q, energy, one, 1.0, np.ones(1), np.empty((1, 3)))


def _compile_cells(kinematics: str) -> None:
    """Compile the kernels that enclose the joints on cells of gamma."""
    robot, contour = _example(kinematics)
    node, gamma = np.zeros(1, np.int64), np.zeros(1)
    robot.arm.enclose(contour.frames(), node, gamma, np.full(1, 0.1), np.eye(4))


STAGES: dict[str, Callable[[str], None]] = {
    "search": _compile_searches,
    "poses": _compile_poses,
    "bound": lambda _: compile_bound(),
    "cells": _compile_cells,
    "exact": lambda _: compile_exact(),
}
"""The functions that compile the kernels of each stage of the main job; they share almost none."""

LATER = frozenset({"bound", "cells", "exact"})
"""Stages whose kernels a plan needs only once it has a motion; what uses them waits for them."""

_running: dict[str, tuple[str, subprocess.Popen[bytes]]] = {}
"""Stages that are being compiled: the kinematic family and the process of each."""


def _note(stage: str, kinematics: str) -> Path:
    """Return the file that marks the kernels of a stage as present in the cache."""
    return CACHE / f"{stage}-{kinematics}.compiled"


def _missing(kinematics: str) -> list[str]:
    """Return the stages to compile in advance: none without an example or without a cache."""
    if kinematics not in EXAMPLES:
        return []
    missing = [stage for stage in STAGES if not _note(stage, kinematics).exists()]
    return missing if missing and is_kept() else []


def compile_stage(stage: str, kinematics: str) -> None:
    """Compile the kernels of a stage in this process, and mark them as present in the cache."""
    STAGES[stage](kinematics)
    if is_kept():
        _note(stage, kinematics).touch()


def is_compiled(kinematics: str = "opw") -> bool:
    """Return whether the kernels of the main job are compiled, or being compiled, for a robot.

    Families that are not in `EXAMPLES`, and all kernels if compiled code cannot be kept, are
    compiled at the first call.
    """
    return all(stage in _running for stage in _missing(kinematics))


def warm_up(kinematics: str = "opw", *, later: Collection[str] = ()) -> bool:
    """Compile the kernels of the main job if the cache lacks them; return whether it did.

    Each stage is compiled in a separate Python process, all at the same time; those of `later`
    start when the others are done.

    Parameters
    ----------
    kinematics : str
        The kinematic family of the robot, as `Robot.kinematics` names it.
    later : collection of str
        Stages that may still be compiling when this function returns: `LATER` or none.
        `kerfpath.plan` waits for them before it uses them.
    """
    missing = [stage for stage in _missing(kinematics) if stage not in _running]
    for stages in ([s for s in missing if s not in later], [s for s in missing if s in later]):
        for stage in stages:
            _running[stage] = kinematics, _started(stage, kinematics)
        finish_compiling(set(STAGES) - set(later))
    return bool(missing)


def _started(stage: str, kinematics: str) -> subprocess.Popen[bytes]:
    call = f"import {__name__} as own; own.compile_stage({stage!r}, {kinematics!r})"
    return start_python(call)


def finish_compiling(stages: Collection[str] = tuple(STAGES)) -> None:
    """Wait for stages that are being compiled; compile a failed one here, to raise its error."""
    for stage in stages:
        if stage in _running:
            kinematics, process = _running.pop(stage)
            if process.wait() != 0:
                compile_stage(stage, kinematics)
