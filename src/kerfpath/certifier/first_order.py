"""The cheapest motion known without (6): what no stage can exceed, and what its bound lacks.

A bound without multipliers of (6) holds for every motion that keeps (5). So the cost of one such
motion is a ceiling for it. What the bound lacks below the ceiling has two causes. Between the
layers motions are not bounded: their steps count as straight. And on each cell the joints are only
known to lie in an enclosure. The first is lowered by more nodes, the second by finer cells.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from kerfpath.arrays import Array, Ints, short_repr
from kerfpath.certificate import BASE, cell_bounds
from kerfpath.certifier.cells import CellMaker, CellSet
from kerfpath.certifier.stages import Steps

SAMPLES, ROUNDS, NARROWER = 9, 7, 1 / 4
"""Samples of gamma at a node, how often they are laid about the best ones, and how much closer
each time."""
WIDTH = 2 * np.pi / BASE
"""rad: how far from a known gamma the first samples reach."""
AT_ONCE = 200_000
"""Steps from sample to sample bounded at a time."""
MOST_NODES = 400
"""Most nodes at which gamma is sampled, apart from the layers."""
CHEAPER = 1e-4
"""Share of the cost by which another motion must promise to cost less to be looked at."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class KnownMotion:
    """A motion in one posture that keeps (5), and the ranges and couplings on some turn.

    Parameters
    ----------
    gamma : (K,) rad
    increments : (K - 1, n) rad
    cost : float
    """

    gamma: Array
    increments: Array
    cost: float

    __repr__ = short_repr


class _Straight(NamedTuple):
    """A motion of straight steps from layer to layer (M,): gamma (M,) there, and its cost.

    ``width`` (M,) is how far from gamma to look between the layers, in rad.
    """

    layers: Ints
    gamma: Array
    width: Array
    cost: float


class FirstOrder:
    """Looks for the cheapest motions that keep (5), in each posture, near the plan and near cells.

    Parameters
    ----------
    maker : CellMaker
    steps : Steps
    last : int
        The last node.

    Attributes
    ----------
    ceiling : float
        Cost of the cheapest motion known, infinite for none.
    """

    def __init__(self, maker: CellMaker, steps: Steps, last: int) -> None:
        self._maker, self._steps, self._last = maker, steps, last
        self._known = dict[int, KnownMotion]()
        self._straight = dict[int, _Straight]()
        self._followed = dict[int, _Straight]()
        self.ceiling = np.inf

    def add(self, posture: int, gamma: Array, increments: Array) -> None:
        """Add a motion along all nodes with gamma (K,) and increments (K - 1, n) rad."""
        cost = float(self._steps.distance(increments).sum())
        if posture not in self._known or cost < self._known[posture].cost:
            self._known[posture] = KnownMotion(gamma=gamma, increments=increments, cost=cost)
            self.ceiling = min(self.ceiling, cost)

    def look_about(self, layers: Ints, postures: Ints) -> None:
        """Look in each posture alone, from samples of all gamma at layers (M,) on."""
        gamma = np.tile(WIDTH * (np.arange(BASE) + 0.5) - np.pi, (len(layers), 1))
        for posture in postures.tolist():
            found = self._shortest(layers, gamma, posture)
            if found is not None:
                self._look(layers, found[0], np.full(len(layers), WIDTH), posture)

    def look_at(self, cells: CellSet) -> None:
        """Look near cells, one per layer."""
        posture = int(cells.posture[0])
        if (cells.posture == posture).all():
            gamma, half = cell_bounds(cells.level, cells.index)
            self._look(cells.node.astype(np.int64), gamma, 2 * half, posture)

    def cheapest(self, layers: Ints) -> tuple[float, KnownMotion] | None:
        """Return the cost of the cheapest straight steps from layer to layer (M,), if known.

        Also returned is the cheapest motion known in their posture.
        """
        for posture, known in self._known.items():
            if posture not in self._at(layers):
                self._look(layers, known.gamma[layers], np.full(len(layers), WIDTH), posture)
        while at := self._at(layers):
            posture = min(at, key=lambda posture: at[posture].cost)
            if self._followed.get(posture) is not at[posture]:
                self._followed[posture] = at[posture]
                self._follow(posture, at[posture])
            if posture in self._known:
                return at[posture].cost, self._known[posture]
            del self._straight[posture]
        return None

    def _at(self, layers: Ints) -> dict[int, _Straight]:
        """Return the straight steps that are known from layer to layer, by posture."""
        return {p: one for p, one in self._straight.items() if np.array_equal(one.layers, layers)}

    def _look(self, layers: Ints, gamma: Array, width: Array, posture: int) -> None:
        """Look for straight steps near gamma (M,) at layers, as far as some width (M,)."""
        found = self._polished(layers, gamma, width, posture)
        if found is None:
            return
        known = self._at(layers).get(posture)
        if known is None or found[1] < (1 - CHEAPER) * known.cost:
            self._straight[posture] = _Straight(layers, found[0], width, found[1])

    def _follow(self, posture: int, near: _Straight) -> None:
        """Look for a motion along all nodes near straight steps."""
        every = np.arange(self._last + 1)
        more = np.union1d(near.layers, every[:: -(-self._last // MOST_NODES)])
        begin = np.interp(more, near.layers, _course(near.gamma))
        width = np.interp(more, near.layers, near.width)
        found = self._polished(more, begin, width, posture)
        if found is None:
            return
        gamma = np.interp(every, more, _course(found[0]))
        q, _, reached = self._maker.joints(every, gamma, posture)
        course = _course(q)
        dq = np.diff(course, axis=0)
        within = (np.abs(dq) <= self._steps.velocity).all()
        if reached.all() and within and self._maker.fits(course):
            self.add(posture, gamma, dq)

    def _polished(
        self, nodes: Ints, gamma: Array, width: Array, posture: int
    ) -> tuple[Array, float] | None:
        """Return gamma (M,) at nodes of a cheap motion near others, and its cost; None if none."""
        offset, found = np.linspace(-1, 1, SAMPLES), None
        for _ in range(ROUNDS):
            found = self._shortest(nodes, gamma[:, None] + width[:, None] * offset, posture)
            if found is None:
                return None
            gamma, width = found[0], width * NARROWER
        return found

    def _shortest(self, nodes: Ints, gamma: Array, posture: int) -> tuple[Array, float] | None:
        """Return which of the samples of gamma (M, S) a shortest path passes, (M,), and its cost.

        The path keeps (5) from one of the nodes to the next; None if there is none.
        """
        M, S = gamma.shape
        q, _, reached = self._maker.joints(np.repeat(nodes, S), gamma.ravel(), posture)
        q, reached = q.reshape(M, S, -1), reached.reshape(M, S)
        upto, before = np.where(reached[0], 0.0, np.inf), []
        span, at_once = np.diff(nodes), max(1, AT_ONCE // (S * S))
        for first in range(0, M - 1, at_once):
            here = slice(first, min(first + at_once, M - 1))
            there = slice(here.start + 1, here.stop + 1)
            dq = _short(q[there, None] - q[here, :, None])
            fast = np.abs(dq) > span[here, None, None, None] * self._steps.velocity
            cost = self._steps.distance(dq)
            cost[fast.any(axis=-1) | ~reached[there, None]] = np.inf
            for each in cost:
                each += upto[:, None]
                before.append(each.argmin(axis=0))
                upto = each.min(axis=0)
        if not np.isfinite(upto).any():
            return None
        path = [int(upto.argmin())]
        for each in reversed(before):
            path.append(int(each[path[-1]]))
        return gamma[np.arange(M), path[::-1]], float(upto.min())


def _short(angle: Array) -> Array:
    return np.asarray(angle - 2 * np.pi * np.rint(angle / (2 * np.pi)))


def _course(angle: Array) -> Array:
    """Return angles (M, ...) with increments the short way round."""
    ahead = np.cumsum(_short(np.diff(angle, axis=0)), axis=0)
    return np.concatenate([angle[:1], angle[0] + ahead])
