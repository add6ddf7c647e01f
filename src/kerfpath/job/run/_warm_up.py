"""A first run that compiles the kernels."""

from __future__ import annotations

import numpy as np

from kerfpath.contour import FRAME_KINDS, Contour
from kerfpath.kernels import is_compiled
from kerfpath.planner import plan
from kerfpath.robots import robot

__all__ = ["is_compiled", "warm_up"]


def warm_up() -> bool:
    """Compile the kernels if this copy has not yet; return whether that was needed."""
    if is_compiled():
        return False
    arm = robot("abb_irb4600_60_205", acceleration_ratio="iontec_20_to_70kg")
    corners = np.array([[1.2, 0.0, 0.5], [1.2, 0.001, 0.5], [1.201, 0.001, 0.5], [1.201, 0.0, 0.5]])
    contour = Contour(corners, np.tile([0.0, 0.0, -1.0], (4, 1)), closed=True)
    for frames in FRAME_KINDS:
        made = plan(
            contour,
            arm,
            tool=np.eye(4),
            placement=np.eye(4),
            speed=0.001,
            gamma_step=np.pi / 2,
            frames=frames,
        )
        _ = made.criteria
    arm.inverse(arm.forward(made.q))
    return True
