"""What inverse kinematics finds."""

from __future__ import annotations

from dataclasses import dataclass

from kerfpath._arrays import Array, Ints

__all__ = ["Solutions"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Solutions:
    """Inverse kinematics of B poses: one row per solution.

    Parameters
    ----------
    q : (N, n) rad
        Joint vectors.
    pose : (N,) int
        Which of the B poses each row solves, increasing.
    posture : (N,) int
        Posture mu of each row; see `Family.postures`.
    turn : (N, n) int
        How many turns of 2 pi each joint is away from (-pi, pi].
    """

    q: Array
    pose: Ints
    posture: Ints
    turn: Ints

    def __len__(self) -> int:
        return len(self.q)
