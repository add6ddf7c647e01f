"""A small stage that compiles the kernels of the certified bound."""

from __future__ import annotations

import numpy as np

from kerfpath._arrays import Array, freeze
from kerfpath.certifier._cells import CellMaker
from kerfpath.certifier._stage import linked, solve_stage
from kerfpath.certifier._steps import Steps
from kerfpath.kernels.metric import MANHATTAN
from kerfpath.kernels.reduced import tangents
from kerfpath.robots import Robot

__all__ = ["compile_bound"]


def compile_bound(robot: Robot, frames: Array, T_flange_tip: Array) -> None:
    """Solve one stage at the frames (K, 4, 4), which compiles the kernels of `certify`."""
    cells = CellMaker(robot, frames, T_flange_tip).coarsest(np.arange(len(frames)))
    ones = freeze(np.ones(robot.joints))
    steps = Steps(
        weight=ones, velocity=ones, acceleration=ones, metric=MANHATTAN, endless=robot.endless
    )
    solve_stage(cells, steps, care=1.0)
    linked(cells, steps)
    none = np.zeros((len(frames) - 1, robot.joints))
    tangents(none, steps.over(1), none.copy())
