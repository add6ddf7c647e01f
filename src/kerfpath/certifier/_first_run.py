"""Compile the kernels of the certified bound by a small stage."""

from __future__ import annotations

import numpy as np

from kerfpath._arrays import freeze
from kerfpath.certifier._cells import CellSet
from kerfpath.certifier._stage import linked, solve_stage
from kerfpath.certifier._steps import Steps
from kerfpath.kernels.metric import MANHATTAN
from kerfpath.kernels.reduced import tangents

__all__ = ["compile_bound"]


def compile_bound() -> None:
    """Compile the kernels of `certify` by a stage of three nodes with one cell each."""
    nodes, joints = 3, 6
    none = np.zeros((nodes, joints))
    cells = CellSet(
        node=np.arange(nodes, dtype=np.int32),
        posture=np.zeros(nodes, np.int8),
        level=np.zeros(nodes, np.int8),
        index=np.zeros(nodes, np.int32),
        half=np.full(nodes, 0.1),
        center=none,
        slope=none,
        bend=none,
        spread=none,
        floor=np.full(nodes, -np.inf),
    )
    ones = freeze(np.ones(joints))
    steps = Steps(
        weight=ones, velocity=ones, acceleration=ones, metric=MANHATTAN, endless=freeze(ones > 2)
    )
    solve_stage(cells, steps, care=1.0)
    linked(cells, steps)
    tangents(none, steps.over(1), none.copy())
