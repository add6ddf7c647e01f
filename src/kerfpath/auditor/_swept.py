"""Find joint vectors between the samples of a motion at which bodies could be nearer than there.

From one sample to the next, no corner of a body moves farther than delta, seen from the other body
of a pair, and leaves its straight line by at most M / 8, where M bounds its second derivative. So
the distance of the pair is at least (d0 + d1 - delta) / 2 - M / 8 throughout. If that does not
prove the pair clear, the middle is checked too.
"""

from __future__ import annotations

import numpy as np

from kerfpath._arrays import Array, Ints
from kerfpath.auditor._chain import JointChain
from kerfpath.cell import Cell

__all__ = ["Moves"]

HIDDEN = 1e-4
"""m: by how much bodies may come nearer to each other than at the samples unnoticed."""
DEEPEST = 10
"""Largest number of times that a step is halved."""
MOST = 8
"""Largest number of joint vectors checked per first step, on average."""
CURVED = 2.0
"""Factor on the bend, since joints do not move exactly evenly on a straight move."""


class Moves:
    """The judged pairs of a cell, and the motion of their bodies in steps from q0 to q1 (B, n).

    Attributes
    ----------
    rates : (P, n) m/rad
        Largest motion of a corner of each pair per rad of a joint or per m of a linear axis, seen
        from the other body, for joints in the range of the steps.
    """

    def __init__(self, cell: Cell, chain: JointChain, q0: Array, q1: Array) -> None:
        self._cell, self._chain, self._order = cell, chain, chain.order
        self._joints = np.arange(len(self._order))
        self._slides = np.zeros(len(self._order), np.bool_)
        self._slides[: len(chain.passed)] = [axis.kind == "linear" for axis in chain.passed]
        most = np.abs(np.vstack([q0, q1])).max(axis=0, initial=0.0)[self._order]
        bodies = cell.bodies
        pairs = [sorted((int(a), int(b)), key=lambda k: bodies[k].frame) for a, b in cell.pairs]
        self._pairs = [
            (bodies[a].frame, bodies[b].frame, bodies[b].shape.corners) for a, b in pairs
        ]
        self._turns = np.array(
            [(self._joints >= a) & (self._joints < b) for a, b, _ in self._pairs]
        ).reshape(len(pairs), -1)
        self._reach = np.array(
            [_reach(chain, b, corners, most) for _, b, corners in self._pairs]
        ).reshape(len(pairs), -1)
        self.rates = np.empty(self._reach.shape)
        self.rates[:, self._order] = self._turns * self._reach
        # Pairs that are farther apart than this are clear in every step.
        self._enough = cell.required + self._way(q1 - q0).max(axis=0, initial=0.0)

    def in_between(self, q0: Array, q1: Array, node: Ints) -> tuple[Array, Ints, Ints]:
        """Return joints (S, n) to check between samples q0 and q1 of nodes (B,), and their nodes.

        The last result has the nodes of the steps in which bodies may still come nearer by more
        than `HIDDEN`.
        """
        middle: list[Array] = []
        nodes: list[Ints] = []
        # A step begins where the one before ends: each sample is evaluated once.
        samples, place = np.unique(np.vstack([q0, q1]), axis=0, return_inverse=True)
        frames = self._chain.links(samples)
        apart, (at0, at1) = self._apart(frames), place.reshape(2, -1)
        F0, F1, d0, d1 = frames[at0], frames[at1], apart[at0], apart[at1]
        most = MOST * len(q0) + 1000
        for _ in range(DEEPEST):
            left = self._left(q1 - q0, F0, F1, d0, d1)
            q0, q1, node = q0[left], q1[left], node[left]
            if not len(node) or sum(map(len, nodes)) + len(node) > most:
                F0, F1, d0, d1 = F0[left], F1[left], d0[left], d1[left]
                break
            half = (q0 + q1) / 2
            F = self._chain.links(half)
            d = self._apart(F)
            middle.append(half)
            nodes.append(node)
            q0, q1, node = np.vstack([q0, half]), np.vstack([half, q1]), np.tile(node, 2)
            F0, F1 = np.concatenate([F0[left], F]), np.concatenate([F, F1[left]])
            d0, d1 = np.vstack([d0[left], d]), np.vstack([d, d1[left]])
        open_ = node[self._left(q1 - q0, F0, F1, d0, d1)] if len(node) else node
        found = np.vstack(middle) if middle else np.zeros((0, q0.shape[1]))
        return found, np.concatenate([np.zeros(0, np.int64), *nodes]), open_

    def _apart(self, frames: Array) -> Array:
        """Return the distances (B, P) m of the pairs, exact up to where all steps are clear."""
        found = self._cell.scene.distances(frames, self._enough)
        return np.asarray(np.minimum(found, self._enough))

    def _way(self, dq: Array) -> Array:
        """Return the largest motion (B, P) m of a corner of each pair in steps, as in `rates`."""
        return np.asarray(np.abs(dq) @ self.rates.T)

    def _left(self, dq: Array, F0: Array, F1: Array, d0: Array, d1: Array) -> Ints:
        """Return the steps in which a pair may be nearer than required without being noticed."""
        required = self._cell.required
        way = self._way(dq)
        # A pair that is too near at an end of the step has been noticed already.
        seen = (d0 <= required) | (d1 <= required)
        rows, pairs = np.nonzero(~((d0 + d1 - way) / 2 > required) & ~seen & (way / 2 > HIDDEN))
        left = np.zeros(len(dq), bool)
        for p in np.unique(pairs):
            at = rows[pairs == p]
            a, b, corners = self._pairs[p]
            moved = _relative(F1[at], a, b)[:, :3] - _relative(F0[at], a, b)[:, :3]
            shift = moved[:, :, :3] @ corners.T + moved[:, :, 3:]
            delta = np.sqrt((shift**2).sum(axis=1).max(axis=1))
            # A linear joint bends no path of what it carries; the joints that carry it do.
            outer, inner = (f.outer(self._joints, self._joints) for f in (np.maximum, np.minimum))
            t = np.abs(dq[at][:, self._order]) * self._turns[p]
            bend = np.einsum("bi,bj,ij->b", t, t, self._reach[p][outer] * ~self._slides[inner])
            hides = delta / 2 + CURVED * bend / 8
            clear = (d0[at, p] + d1[at, p]) / 2 - hides > required[p]
            left[at] |= ~clear & (hides > HIDDEN)
        return np.flatnonzero(left)


def _relative(frames: Array, a: int, b: int) -> Array:
    """Return the poses (B, 4, 4) of frame b as seen from frame a."""
    return np.asarray(np.linalg.solve(frames[:, a], frames[:, b]))


def _reach(chain: JointChain, frame: int, corners: Array, most: Array) -> Array:
    """Return the largest distance (m) of a corner in a frame from the axis of each joint before it.

    It is 1 for a linear joint; joints are no farther from zero than `most` (E+n,), in their order.
    """
    base = len(chain.externals)
    far, reach = float(np.linalg.norm(corners, axis=1).max()), np.zeros(base + len(chain.axes))
    origins = np.linalg.norm(chain.origins[:, :3, 3], axis=1)
    for place in range(frame - 1, -1, -1):
        if place >= base:
            reach[place] = far
            far += float(origins[place - base])
            continue
        axis = chain.passed[place]
        if axis.kind == "linear":
            reach[place] = 1.0
            far += float(most[place])
        else:
            off = float(np.linalg.norm(np.cross(axis.axis, axis.point)))
            reach[place] = far + off
            far += 2 * off
    return reach
