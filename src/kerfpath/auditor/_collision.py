"""The re-check of a plan in its cell: dense samples of the motion, placed by the second kinematics.

Distances come from the same solids as in planning, for there is but one cell; where they stand
and which joint vectors are looked at owes nothing to the planner and its proofs.
"""

from __future__ import annotations

import numpy as np

from kerfpath._arrays import Array, Ints
from kerfpath.auditor._chain import JointChain
from kerfpath.auditor._motion import Motion
from kerfpath.auditor._nearest import nearest
from kerfpath.auditor._swept import Moves
from kerfpath.auditor._table import Check
from kerfpath.cell import Cell

__all__ = ["collision_along", "collisions"]

TOUCHING = -1e-9
"""m: to touch is not to be clear."""


def collisions(cell: Cell, motion: Motion, chain: JointChain) -> list[Check]:
    """Return the checks of a motion: by how much near-miss distances are missed.

    One of the pairs that keep that of the cell, one of those with a distance of their own, as
    nozzle and part. The value is what the nearest pair falls short by, negative where all are
    farther apart.
    """
    nodes, samples, _ = motion.q.shape
    node = np.repeat(np.arange(nodes), samples - 1)
    return collision_along(cell, _rows(motion.q[:, :-1]), _rows(motion.q[:, 1:]), node, chain)


def collision_along(cell: Cell, q0: Array, q1: Array, node: Ints, chain: JointChain) -> list[Check]:
    """Return the same checks of motions from q0 to q1 (S, n) rad, each of a node (S,).

    They are divided until nothing nearer can hide; where that cannot be said, it is counted.
    """
    moves = Moves(cell, chain, q0, q1)
    between, nodes, open_ = moves.in_between(q0, q1, node)
    q, first = np.unique(np.vstack([q0, q1, between]), axis=0, return_index=True)
    node = np.concatenate([node, node, nodes])[first]
    frames = chain.links(q)
    left = Check(
        code="collision-open",
        title="steps between samples in which bodies may come nearer than is seen",
        value=float(len(open_)),
        limit=0.0,
        unit="count",
        node=int(open_[0]) if len(open_) else 0,
    )
    rows = [("collision", "", ~cell.own), ("collision-own", " of their own", cell.own)]
    found = [
        _check(cell, nearest(cell, moves.rates, q, frames, wanted), code, whose, node)
        for code, whose, wanted in rows
        if wanted.any()
    ]
    return [*found, left]


def _rows(q: Array) -> Array:
    return q.reshape(-1, q.shape[-1])


def _check(cell: Cell, found: tuple[int, int, float], code: str, whose: str, node: Ints) -> Check:
    """Return the check of what `nearest` found."""
    row, pair, beyond = found
    (one, two), needed = cell.pair_names[pair], float(cell.required[pair])
    whence = "left by design" if needed < cell.asked[pair] else "asked"
    return Check(
        code=code,
        title=f"shortfall of near-miss distances{whose} (nearest: {one} and {two}, "
        f"{(needed + beyond) * 1e3:.2f} mm apart, {needed * 1e3:.4g} mm {whence})",
        value=-beyond,
        limit=TOUCHING,
        unit="m",
        node=int(node[row]),
        advice="move the part or the fixture, or plan with the cell",
    )
