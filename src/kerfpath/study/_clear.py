"""Whether a node has a clear pose at all: what no path can do without, and cheap to ask."""

from __future__ import annotations

import numpy as np

from kerfpath.cell import Checker
from kerfpath.graph import LayeredGraph

__all__ = ["has_clear_pose"]

TRIED = 8
"""Poses of a node asked at once for a clear one."""


def has_clear_pose(graph: LayeredGraph, checker: Checker, layer: int) -> bool:
    """Return whether any pose of a layer is clear; the checker is one of the graph's vertices."""
    poses = np.arange(graph.start[layer], graph.start[layer + 1])
    rounds = max(1, len(poses) // TRIED)
    # Spread over the layer, as neighbours collide together.
    return any(np.isfinite(checker.price(poses[r::rounds])).any() for r in range(rounds))
