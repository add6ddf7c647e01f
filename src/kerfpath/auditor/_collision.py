"""The collision checks: dense samples of the motion, placed by the second kinematics.

The solids and their distances are those of the same cell as in planning; the poses of the bodies
and the choice of joint vectors are independent of the planner and its proofs.
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
"""m: bodies that touch are not clear."""


def collisions(cell: Cell, motion: Motion, chain: JointChain) -> list[Check]:
    """Return the checks of the near-miss distances along a motion.

    One check covers the pairs with the near-miss distance of the cell, another the pairs with their
    own distance, such as nozzle and part. The value is the shortfall of the nearest pair, negative
    if all are farther apart.
    """
    nodes, samples, _ = motion.q.shape
    node = np.repeat(np.arange(nodes), samples - 1)
    return collision_along(cell, _rows(motion.q[:, :-1]), _rows(motion.q[:, 1:]), node, chain)


def collision_along(cell: Cell, q0: Array, q1: Array, node: Ints, chain: JointChain) -> list[Check]:
    """Return the same checks for motions from q0 to q1 (S, n) rad, each with its node (S,).

    Motions are divided until no pair can come nearer unnoticed; those for which this cannot be
    shown are counted.
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
    """Return the check for a result of `nearest`."""
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
