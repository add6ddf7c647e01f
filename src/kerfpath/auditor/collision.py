"""The collision checks: dense samples of the motion, placed by the second kinematics.

The solids and their distances are those of the same cell as in planning; the poses of the bodies
and the choice of joint vectors are independent of the planner and its proofs.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from kerfpath.arrays import Array, Bools, Ints
from kerfpath.auditor.chain import JointChain
from kerfpath.auditor.motion import Motion
from kerfpath.auditor.table import Check
from kerfpath.cell import Cell

# -----------------------------------------------------------------------------
# Find the pose and pair with the least clearance among many poses, with few distance queries.
#
# From one joint vector to another, no corner of a body moves farther, seen from the other body of
# its pair, than the sum of |dq_j| times its reach from joint j, and the distance changes by no
# more. So each distance found gives lower bounds at all other poses, and a distance must be
# computed only where these bounds are not above the least one found. The result is still exact.

SURE = 1e-5
"""m above the least value found where a bound rules a pose out; distances are exact to 1e-6 m."""
NEIGHBOURS = 4
"""Number of solved poses that give bounds for another pose."""


def nearest(
    cell: Cell, rates: Array, q: Array, frames: Array, wanted: Bools
) -> tuple[int, int, float]:
    """Return the pose and the pair with the least distance beyond the near-miss distance.

    Parameters
    ----------
    cell : Cell
    rates : (P, n) m/rad
        Largest motion of a corner of each pair per joint, seen from the other body.
    q : (B, n) rad
    frames : (B, n+1, 4, 4) m
        Poses of base and links at q.
    wanted : (P,) bool
        The pairs to check, at least one.

    Returns
    -------
    row, pair : int
        Index of the pose and of the pair.
    beyond : float m
        Distance of the pair less its near-miss distance; NaN if a joint vector is NaN.
    """
    pairs = np.flatnonzero(wanted)
    beyond = cell.scene.cheap(frames)[:, pairs] - cell.required[pairs]
    found = np.isnan(beyond) | cell.scene.round[pairs]
    least = float(beyond[found].min(initial=np.inf))
    count = 1
    while True:
        looked = False
        for c in np.argsort(beyond.min(axis=0)):
            p, own = pairs[c], beyond[:, c]
            # The depth of overlapping meshes is no bound: nothing is ruled out below contact.
            clear = max(least, float(-cell.required[p])) + SURE
            open_ = np.flatnonzero(~found[:, c] & (own <= clear))
            if not open_.size:
                continue
            looked = True
            rows = open_[_spread(own[open_], count)]
            enough = np.full(len(rows), clear + cell.required[p])
            own[rows] = cell.scene.pair_bounds(p, frames[rows], enough)[0] - cell.required[p]
            found[rows, c] = True
            least = min(least, float(own[rows].min()))
            near, far = np.flatnonzero(found[:, c]), open_[~found[open_, c]]
            own[far] = np.maximum(own[far], _bounds(q[near], own[near], q[far], rates[p]))
        if not looked:
            break
        count *= 2
    row, c = divmod(int(np.argmin(np.where(found, beyond, np.inf))), len(pairs))
    return row, int(pairs[c]), float(beyond[row, c])


def _spread(bounds: Array, count: int) -> Ints:
    """Return the index of the least bound if `count` is 1, otherwise `count` spread indices."""
    if count == 1:
        return np.array([np.argmin(bounds)])
    return np.unique(np.linspace(0, len(bounds) - 1, min(count, len(bounds))).astype(np.int64))


def _bounds(q: Array, beyond: Array, there: Array, rate: Array) -> Array:
    """Return lower bounds (S,) m at joints `there` (S, n) from values `beyond` at q (F, n) rad."""
    count = min(NEIGHBOURS, len(q))
    moved, at = cKDTree(q * rate).query(there * rate, count, p=1)
    shape = (len(there), count)
    bounds = beyond[np.asarray(at).reshape(shape)] - np.asarray(moved).reshape(shape)
    return np.asarray(bounds.max(axis=1))


# -----------------------------------------------------------------------------
# Find joint vectors between the samples of a motion at which bodies could be nearer than there.
#
# From one sample to the next, no corner of a body moves farther than delta, seen from the other
# body of a pair, and leaves its straight line by at most M / 8, where M bounds its second
# derivative. So the distance of the pair is at least (d0 + d1 - delta) / 2 - M / 8 throughout. If
# that does not prove the pair clear, the middle is checked too.

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


# -----------------------------------------------------------------------------
# The collision checks: dense samples of the motion, placed by the second kinematics.

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
