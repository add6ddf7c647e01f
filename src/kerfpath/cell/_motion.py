"""Swept motions: bounds on the distance of bodies between two poses, and bisection by them.

While the joints move evenly from q0 to q1, a point x of a body deviates from the straight line from
x(0) to x(1) by at most M s (1 - s) / 2, where M bounds its second derivative. A body lies in the
hull of its corners. If delta is the largest displacement of a corner, the distance of a pair is at
least

    (d(0) + d(1) - delta) / 2 - M / 8

all the way. If that does not clear a pair, its distance half way is measured, and each half is
judged in the same way: delta is halved, and M falls to a quarter. The second derivatives of a chain
of revolute joints are z_i x (z_j x (x - o_j)) for i <= j, hence M = sum over i, j of
|dq_i| |dq_j| r_max(i,j), where r_j bounds the distance of the point from axis j. A linear joint j
contributes z_i x d_j with the joints before it, and nothing with those after it or with itself.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from kerfpath._arrays import Array, Bools, Ints
from kerfpath.cell._bodies import Body
from kerfpath.cell._scene import ACCURACY
from kerfpath.urdf import KinematicChain

__all__ = ["TOLERANCE", "MotionBounds", "relative"]

TOLERANCE = 1e-4
"""m: a motion that is not proved clear at this resolution is refused."""
HALVINGS = 24
"""Largest number of bisections, which no motion of a robot reaches; then a motion is refused."""

Distances = Callable[[Array, Array, Bools], Array]


class MotionBounds:
    """Bounds on the relative motion of judged pairs.

    Parameters
    ----------
    chain : KinematicChain
    bodies : sequence of Body
    pairs : (P, 2) int
        Indices of bodies; the second of a pair is in the later frame.
    """

    def __init__(self, chain: KinematicChain, bodies: Sequence[Body], pairs: Ints) -> None:
        self._chain = chain
        joints = np.arange(chain.joints)
        self._slides = chain.slides
        self._order = chain.order
        ways = [(bodies[a].frame, int(b)) for a, b in pairs]
        self._ways = sorted(set(ways))
        self._way = np.array([self._ways.index(way) for way in ways], dtype=np.int64)
        self._moves = [(a, bodies[b].frame, bodies[b].shape.corners) for a, b in self._ways]
        between = [(joints >= a) & (joints < frame) for a, frame, _ in self._moves]
        reach = [chain.reach(frame, corners) for _, frame, corners in self._moves]
        self._between = np.array(between).reshape(-1, len(joints))
        self._reach = np.array(reach).reshape(-1, len(joints))

    @property
    def arms(self) -> Array:
        """Largest reach (n,) m of any body from each joint's axis; 1 for a linear joint."""
        longest = np.empty(len(self._order))
        longest[self._order] = self._reach.max(axis=0, initial=0.0)
        return longest

    def shift(self, frames0: Array, frames1: Array) -> Array:
        """Return the largest displacement (B, P) m of any corner between poses (B, n+1, 4, 4).

        It is seen from the first body of the pair; the distance of the pair changes by no more.
        """
        out = np.empty((len(frames0), len(self._ways)))
        seen: dict[tuple[int, int], Array] = {}
        for i, (a, b, corners) in enumerate(self._moves):
            if (a, b) not in seen:
                seen[a, b] = (relative(frames1, a, b) - relative(frames0, a, b))[:, :3]
            moved = seen[a, b][:, :, :3] @ corners.T + seen[a, b][:, :, 3:]
            out[:, i] = np.sqrt((moved**2).sum(axis=1).max(axis=1))
        return out[:, self._way]

    def bend(self, dq: Array) -> Array:
        """Return bounds M (B, P) m on the second derivatives of corners along dq (B, n) rad."""
        step = np.abs(dq)[:, None, self._order] * self._between
        total = np.cumsum(np.where(self._slides, 0.0, step), axis=2)
        before = np.concatenate([np.zeros_like(total[..., :1]), total[..., :-1]], axis=2)
        bend = ((total**2 - before**2) * self._reach).sum(axis=2)
        if self._slides.any():
            bend += 2 * (before * np.where(self._slides, step, 0.0)).sum(axis=2)
        return np.asarray(bend[:, self._way])

    def least(
        self, d0: Array, d1: Array, frames0: Array, frames1: Array, dq: Array
    ) -> tuple[Array, Array]:
        """Return lower bounds (B, P) m on the distances along motions, and their slack (B, P) m."""
        delta, bow = self.shift(frames0, frames1), self.bend(dq) / 8
        return (d0 + d1 - delta) / 2 - bow - ACCURACY, delta / 2 + bow

    def clear(
        self,
        q0: Array,
        q1: Array,
        required: Array,
        distances: Distances,
        wanted: Bools | None = None,
    ) -> Bools:
        """Return which of the motions q0 to q1 (B, n) rad are proved to keep more than `required`.

        Pairs that are not `wanted` (B, P) are known to keep it already.
        """
        clear = self._chain.bounded(q0) & self._chain.bounded(q1)
        if not len(self._way):
            return clear
        motion = np.arange(len(q0))
        wanted = np.ones((len(q0), len(self._way)), bool) if wanted is None else wanted
        T0, T1 = self._chain.frames(q0), self._chain.frames(q1)
        enough = required + self._spent(T0, T1, q1 - q0)
        d0, d1 = distances(T0, enough, wanted), distances(T1, enough, wanted)
        for _ in range(HALVINGS):
            least, doubt = self.least(d0, d1, T0, T1, q1 - q0)
            hit = wanted & ~((d0 > required) & (d1 > required))
            open_ = wanted & ~(least > required)
            lost = hit.any(axis=1) | (open_ & (doubt < TOLERANCE)).any(axis=1)
            clear[motion[lost]] = False
            go = open_.any(axis=1) & clear[motion]
            if not go.any():
                return clear
            motion, wanted, d0, d1 = motion[go], open_[go], d0[go], d1[go]
            q0, q1, T0, T1 = q0[go], q1[go], T0[go], T1[go]
            half = (q0 + q1) / 2
            T_half = self._chain.frames(half)
            d_half = distances(T_half, required + self._spent(T0, T1, q1 - q0), wanted)
            motion, wanted = np.tile(motion, 2), np.tile(wanted, (2, 1))
            d0, d1 = np.vstack([d0, d_half]), np.vstack([d_half, d1])
            q0, q1 = np.vstack([q0, half]), np.vstack([half, q1])
            T0, T1 = np.concatenate([T0, T_half]), np.concatenate([T_half, T1])
        clear[motion] = False
        return clear

    def _spent(self, frames0: Array, frames1: Array, dq: Array) -> Array:
        """Return the distances (B, P) m beyond `required` that clear a motion, at either end."""
        return self.shift(frames0, frames1) + self.bend(dq) / 4 + 4 * ACCURACY


def relative(frames: Array, a: int, b: int) -> Array:
    """Return the poses (B, 4, 4) of frame b in frame a."""
    if (frames[:, a] == np.eye(4)).all():
        return frames[:, b]
    R, at = frames[:, a, :3, :3], frames[:, a, :3, 3:]
    T = np.zeros((len(frames), 4, 4))
    turned = np.swapaxes(R, 1, 2)
    T[:, :3, :3] = turned @ frames[:, b, :3, :3]
    T[:, :3, 3:] = turned @ (frames[:, b, :3, 3:] - at)
    T[:, 3, 3] = 1.0
    return T
