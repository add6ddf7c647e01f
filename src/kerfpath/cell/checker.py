"""Check vertices and motions of a search in a cell with as few distance queries as proofs allow.

If a pair is d apart at one joint vector, it is between d - delta and d + delta apart wherever no
corner of its second body, seen from the first, has moved by more than delta. So a distance measured
at one joint vector proves its neighbours, along gamma and along the contour, clear or blocked for
that pair; only what stays open is measured.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from kerfpath.arrays import Array, Bools, Ints, floats, not_negative
from kerfpath.cell.cell import Cell
from kerfpath.cell.pairs import TOLERANCE
from kerfpath.cell.scene import ACCURACY
from kerfpath.errors import InputError

FAR = 0.1
"""m beyond what is required: larger distances are not refined, as they clear enough already."""
STRIDE = 64
"""Of a run of vertices, one in `STRIDE` is measured first, to clear those between; then one in a
quarter of that, and so on."""
NEAREST = 4
"""Number of joint vectors measured before that a new one is compared with."""


class CollisionChecker:
    """The checks that `kerfpath.search.find_clear` asks for.

    Parameters
    ----------
    cell : Cell
    q : (N, n) rad
        Joint vectors of the vertices.
    comfort : float m
        Clearance below which a vertex costs something; pairs that have their own near-miss distance
        do not count.
    comfort_cost : float
        Cost at zero clearance; it falls linearly to zero at `comfort`.

    Attributes
    ----------
    asked, measured : int
        Number of vertices checked, and of those at which a distance had to be measured.
    motions_asked, motions_measured : int
        The same for motions.
    """

    def __init__(
        self, cell: Cell, q: Array, *, comfort: float = 0.0, comfort_cost: float = 0.0
    ) -> None:
        self._cell = cell
        self._q = floats(q, "q", (None, cell.chain.joints), copy=False)
        if not cell.chain.bounded(self._q).all():
            raise InputError("cell: it was built with less travel of external axes than asked")
        self._comfort = not_negative(comfort, "comfort", unit="m")
        self._comfort_cost = not_negative(comfort_cost, "comfort_cost")
        self._needed = cell.required + np.where(cell.own, 0.0, comfort if comfort_cost else 0.0)
        self._apart: dict[int, tuple[Array, Array]] = {}
        self._price: dict[int, float] = {}
        self._at: list[int] = []
        self._arms = cell.sweep.arms
        self._closing = np.zeros(len(cell.required), bool)
        self._tree: tuple[int, cKDTree] | None = None
        self.asked = self.measured = self.motions_asked = self.motions_measured = 0

    def price(self, vertices: Ints) -> Array:
        """Return the cost (B,) of vertices, infinite if they are not clear."""
        new = np.unique([v for v in vertices.tolist() if v not in self._price]).astype(np.int64)
        self.asked += len(new)
        stride = STRIDE
        while new.size:
            first = np.arange(len(new)) % stride == 0
            self._look(new[first])
            new, stride = new[~first], max(stride // 4, 1)
        return np.array([self._price[v] for v in vertices.tolist()])

    def passable(self, p: Ints, j: Ints) -> Bools:
        """Return which of the motions from vertices p to vertices j, (B,) each, are clear.

        Pairs that blocked a motion before are checked half way first, where most motions collide.
        """
        cell = self._cell
        self.motions_asked += len(p)
        passable = np.isfinite(self.price(p)) & np.isfinite(self.price(j))
        q0 = self._q[p]
        q1 = q0 + cell.increments(q0, self._q[j])
        d0, d1 = (np.array([self._apart[v][0] for v in ends.tolist()]) for ends in (p, j))
        least, _ = cell.sweep.least(d0, d1, cell.frames(q0), cell.frames(q1), q1 - q0)
        # A motion that bisection alone would refuse for its tolerance is not cleared here either.
        open_ = ~(least > cell.required + TOLERANCE)
        left = passable & open_.any(axis=1)
        self.motions_measured += int(left.sum())
        q0, q1, open_ = q0[left], q1[left], open_[left]
        half = cell.frames((q0 + q1) / 2)
        clear: Bools = ~np.asarray(self._hit(half, open_ & self._closing).any(axis=1))
        rest = np.flatnonzero(clear)
        clear[rest] = cell.sweep.clear(
            q0[rest], q1[rest], cell.required, cell.scene.distances, open_[rest]
        )
        lost = rest[~clear[rest]]
        self._closing |= self._hit(half[lost], open_[lost]).any(axis=0)
        passable[left] = clear
        return passable

    def blocked(self, p: Ints, j: Ints) -> Bools:
        """Return which motions from p to j, (B,) each, are found not to be clear at little effort.

        Only pairs that blocked a motion before are checked, half way.
        """
        self.motions_asked += len(p)
        self.motions_measured += len(p) if self._closing.any() else 0
        q0 = self._q[p]
        half = self._cell.frames(q0 + self._cell.increments(q0, self._q[j]) / 2)
        return np.asarray(self._hit(half, np.tile(self._closing, (len(p), 1))).any(axis=1))

    def _hit(self, frames: Array, wanted: Bools) -> Bools:
        """Return which of the wanted pairs (B, P) are too close; at least one of each such row."""
        required = self._cell.required
        low, _ = self._cell.scene.bounds(frames, required, wanted, required)
        return np.asarray(wanted & (low <= required))

    def _look(self, vertices: Ints) -> None:
        """Find the costs of vertices from distances measured nearby, or by measuring."""
        cell, q = self._cell, self._q[vertices]
        frames = cell.frames(q)
        low, high = self._known(q, frames)
        round_ = cell.scene.round
        low[:, round_] = high[:, round_] = cell.scene.cheap(frames)[:, round_]
        open_ = ~(low > self._needed) & ~(high <= cell.required).any(axis=1, keepdims=True)
        rows = open_.any(axis=1)
        if rows.any():
            enough = cell.required + FAR + self._comfort
            found = cell.scene.bounds(frames[rows], enough, open_[rows], cell.required)
            low[rows] = np.where(open_[rows], found[0], low[rows])
            high[rows] = np.where(open_[rows], found[1], high[rows])
            self.measured += int(rows.sum())
            self._at += vertices[rows].tolist()
        hit = (np.minimum(low, high) <= cell.required) & (high < np.inf)
        price = np.where(hit.any(axis=1), np.inf, self._cost(low))
        for i, v in enumerate(vertices.tolist()):
            self._price[v], self._apart[v] = float(price[i]), (low[i], high[i])

    def _cost(self, apart: Array) -> Array:
        if self._comfort == 0 or self._comfort_cost == 0 or self._cell.own.all():
            return np.zeros(len(apart))
        over = (apart - self._cell.required)[:, ~self._cell.own].min(axis=1)
        return np.asarray(self._comfort_cost * np.clip(1 - over / self._comfort, 0.0, 1.0))

    def _known(self, q: Array, frames: Array) -> tuple[Array, Array]:
        """Return bounds (B, P) m on the distances at q, from what was measured nearby."""
        B, P = len(q), len(self._cell.pairs)
        if not self._at:
            return np.full((B, P), -np.inf), np.full((B, P), np.inf)
        if self._tree is None or self._tree[0] < len(self._at):
            self._tree = len(self._at), cKDTree(self._q[self._at] * self._arms)
        count = min(NEAREST, len(self._at))
        _, near = self._tree[1].query(q * self._arms, count)
        there = np.array(self._at)[np.asarray(near).ravel()]
        known = np.array([self._apart[v] for v in there.tolist()]).reshape(B, count, 2, P)
        at, here = self._cell.frames(self._q[there]), np.repeat(frames, count, axis=0)
        moved = self._cell.sweep.shift(at, here).reshape(B, count, P) + ACCURACY
        return (known[:, :, 0] - moved).max(axis=1), (known[:, :, 1] + moved).min(axis=1)
