"""The re-check of a plan in its cell: dense samples of the motion, placed by the second kinematics.

Distances come from the same solids as in planning, for there is but one cell; where they stand
and which joint vectors are looked at owes nothing to the planner and its proofs.
"""

from __future__ import annotations

import numpy as np

from kerfpath._arrays import Array, Ints
from kerfpath.auditor._chain import JointChain
from kerfpath.auditor._motion import Motion
from kerfpath.auditor._table import Check
from kerfpath.cell import Cell

__all__ = ["collision_at", "collisions"]

TOUCHING = -1e-9
"""m: to touch is not to be clear."""
REFINED = 1e-3
"""m beyond the near-miss distance: distances above that are not worth finding exactly."""


def collisions(cell: Cell, motion: Motion, chain: JointChain) -> Check:
    """Return the check of every sample of a motion: by how much any near-miss distance is missed.

    The value is what the nearest pair falls short by, negative where all are farther apart.
    """
    nodes, samples, n = motion.q.shape
    return collision_at(cell, motion.q.reshape(-1, n), np.repeat(np.arange(nodes), samples), chain)


def collision_at(cell: Cell, q: Array, node: Ints, chain: JointChain) -> Check:
    """Return the same check of joint vectors q (S, n) rad, each of a node (S,)."""
    frames = np.stack([np.broadcast_to(np.eye(4), (len(q), 4, 4)), *chain.joints(q)], axis=1)
    enough = cell.required + REFINED
    short = cell.required - cell.scene.distances(np.ascontiguousarray(frames), enough)
    worst = _worst(short)
    row, pair = worst // short.shape[1], worst % short.shape[1]
    one, two = cell.pair_names[pair]
    return Check(
        code="collision",
        title=f"shortfall of the near-miss distance (nearest: {one} and {two})",
        value=float(short[row, pair]),
        limit=TOUCHING,
        unit="m",
        node=int(node[row]),
        advice="move the part or the fixture, or plan with the cell",
    )


def _worst(short: Array) -> int:
    """Return the place of the largest value, NaN counting as the worst of all."""
    return int(np.argmax(np.where(np.isnan(short), np.inf, short)))
