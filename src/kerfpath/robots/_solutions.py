"""Solutions of the inverse kinematics: postures and turns of many poses in one table."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kerfpath._arrays import Array, Bools, Ints, freeze
from kerfpath._repr import short_repr
from kerfpath.kernels import turns

__all__ = ["Solutions", "all_solutions", "solutions_within"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Solutions:
    """Inverse kinematics of B poses: one row per solution.

    Parameters
    ----------
    q : (N, n) rad
        Joint vectors.
    pose : (N,) int
        Index of the pose that each row solves, in increasing order.
    posture : (N,) int
        Posture mu of each row; see `Family.postures`.
    turn : (N, n) int
        Number of turns of 2 pi that each joint is away from (-pi, pi].
    """

    q: Array
    pose: Ints
    posture: Ints
    turn: Ints

    __repr__ = short_repr

    def __len__(self) -> int:
        return len(self.q)


def all_solutions(q: Array, reach: Bools) -> Solutions:
    """Return the rows of q (B, P, n) that `reach` (B, P) marks as solutions, limits ignored."""
    pose, posture = np.nonzero(reach)
    found = q[reach]
    turn = np.zeros(found.shape, dtype=np.int64)
    return Solutions(q=freeze(found), pose=freeze(pose), posture=freeze(posture), turn=freeze(turn))


def solutions_within(q: Array, reach: Bools, limits: turns.JointLimits) -> Solutions:
    """Return all turns within the limits of the rows of q (B, P, n) that `reach` (B, P) marks."""
    B, P, n = q.shape
    q, reach = q[:, None], reach[:, None]  # one node a pose, one sample of gamma
    count, reason = np.empty(B, np.int64), np.empty(reach.shape, np.uint8)
    turns.count_admissible(q, reach, freeze(np.ones(P, np.bool_)), limits, count, reason)
    total = int(count.sum())
    found, small = np.empty((total, n)), np.empty((total, n), np.int8)
    sample, posture = np.empty(total, np.int32), np.empty(total, np.int8)
    turns.fill_admissible(q, reason, limits, found, sample, posture, small)
    # One joint alone may have more turns than the small integers of a graph can count.
    pose = np.repeat(np.arange(B), count)
    turn = np.rint((found - q[pose, 0, posture]) / (2 * np.pi))
    return Solutions(
        q=freeze(found),
        pose=freeze(pose),
        posture=freeze(posture.astype(np.int64)),
        turn=freeze(turn.astype(np.int64)),
    )
