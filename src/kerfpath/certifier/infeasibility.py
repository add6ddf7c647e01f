"""Proof that no motion exists: cells of gamma are eliminated until a node has none left."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Literal

import numpy as np

from kerfpath.arrays import Array, Bools, Ints, freeze, short_repr
from kerfpath.certifier.cells import CellMaker, CellSet
from kerfpath.certifier.stages import Steps, arranged
from kerfpath.effort import current_effort
from kerfpath.errors import Closed
from kerfpath.kernels.cell_elimination import (
    blame_bends,
    count_rejections,
    keep_back,
    keep_on,
    list_steps,
)
from kerfpath.kernels.limits import LIMIT_TOLERANCE
from kerfpath.kernels.metric import MANHATTAN
from kerfpath.limits import Limits
from kerfpath.robots import Robot

DEEPEST = 12
"""Largest level: cells of 0.001 deg."""
NODES_AROUND = 12
"""Nodes on either side of a node in a part of the contour that is tested."""
MOST_NODES = 5_000
"""Most nodes of a contour that is tested as a whole: the cells of all are held, some 200 MB."""
MOST_CELLS = 2_000
"""Most cells of one node that may have a pose, before the test ends undecided."""
EACH_PAIRS = 1_000_000
"""Most pairs of steps at one node for which (6) is tested in a round."""
STALLED, FROM_HALVING = 0.2, 3
"""Share of the halves that a round of a brief test must rule out, from which halving on: rounds
that end in a proof rule out more, and those of other tests less and less."""


def closed_node(
    robot: Robot,
    frames: Array,
    T_flange_tip: Array,
    nodes: Ints,
    postures: tuple[int, ...] | None = None,
) -> Closed | None:
    """Return the first of some nodes that is proved to have no pose within the ranges at any gamma.

    None if this is proved for none of them. Cells of gamma without a solution within ranges and
    couplings drop out, and the others are halved. Arguments are as in `MotionTest`.
    """
    maker = CellMaker(robot, frames, T_flange_tip, postures)
    for node in nodes:
        cells = maker.coarsest(np.array([node]))
        for _ in range(DEEPEST):
            if not 0 < len(cells) <= MOST_CELLS:
                break
            cells = maker.halves(cells)
        if not len(cells):
            return Closed(node=int(node) - 1, joint=None, limit="pose")
    return None


@dataclass(slots=True, eq=False)
class _Layer:
    """The steps from the cells of one layer: begin (C_k + 1,), to (E,), and which are kept (E,)."""

    begin: Ints
    to: Ints
    kept: Bools

    __repr__ = short_repr


class MotionTest:
    """Tests whether any motion along a contour keeps given limits, by an outer approximation.

    Parameters
    ----------
    robot : Robot
        A robot that `encloses`.
    frames : (K, 4, 4) m
        Task frames in the robot base.
    T_flange_tip : (4, 4) m
    postures : sequence of int, optional
        The postures that may be used; default all.
    """

    def __init__(
        self,
        robot: Robot,
        frames: Array,
        T_flange_tip: Array,
        postures: tuple[int, ...] | None = None,
    ) -> None:
        self._endless = robot.endless
        self._maker = CellMaker(robot, frames, T_flange_tip, postures)
        self._count = len(frames)
        self._made, self._coarsest = np.zeros(self._count, np.bool_), list[CellSet]()

    def closed(
        self, limits: Limits, dt: float, around: int | None = None, *, brief: bool = False
    ) -> Closed | None:
        """Return the place that no motion passes, with nodes `dt` s apart; None if not proved.

        Motions that keep (5) and (6) at the nodes, ranges and couplings cannot pass a cell from
        which, or to which, no step or pair of steps leads. The other cells are halved until a node
        has none left, or until the limit of work. With `around`, only the part of the contour
        around that node is tested, with finer cells: a motion that cannot pass a part cannot pass
        the whole contour. More than `MOST_NODES` nodes are not tested as a whole. Cells are at some
        nodes only where joints take many intervals to reach their velocity limit (`Steps.layers`).
        With `brief`, it ends as soon as halving rules out little.
        """
        steps = Steps(
            weight=freeze(np.ones(len(self._endless))),
            velocity=limits.velocity.per_interval(dt) + 2 * LIMIT_TOLERANCE,
            acceleration=limits.acceleration.most_per_interval(dt) + 2 * LIMIT_TOLERANCE,
            metric=MANHATTAN,
            endless=self._endless,
        )
        most_pairs = current_effort().infeasibility_pairs
        first, last = 0, self._count - 1
        if around is not None:
            near = NODES_AROUND * int(np.diff(steps.layers(first, last)).max(initial=1))
            first, last = max(first, around - near), min(last, around + near)
        if last - first >= MOST_NODES:
            return None
        nodes, work = np.arange(first, last + 1), 0
        cells = self._coarsest_at(nodes)
        for halved in range(DEEPEST):
            missing = np.setdiff1d(nodes, cells.node)
            if len(missing):
                # Halves may be missing because limits ruled out the others.
                return Closed(
                    node=int(missing[0]) - 1, joint=None, limit="both" if halved else "pose"
                )
            nodes = steps.layers(first, last)
            cells = cells.take(np.isin(cells.node, nodes))
            one = _Round(cells, steps)
            found = one.forward()
            if found is not None:
                return replace(found, node=int(nodes[found.node]))
            work += one.pairs
            if one.left or work > most_pairs:
                return None
            passed, before = one.cells.take(one.backward()), len(one.cells)
            if brief and halved >= FROM_HALVING - 1 and len(passed) > (1 - STALLED) * before:
                return None
            cells = self._maker.halves(passed)
        return None

    def _coarsest_at(self, nodes: Ints) -> CellSet:
        """Return the coarsest cells at some nodes, which are made once."""
        missing = nodes[~self._made[nodes]]
        if len(missing):
            self._coarsest = [CellSet.join([*self._coarsest, self._maker.coarsest(missing)])]
            self._made[missing] = True
        (cells,) = self._coarsest
        return cells.take(np.isin(cells.node, nodes))


class _Round:
    """One forward and one backward sweep over cells of all nodes."""

    def __init__(self, cells: CellSet, steps: Steps) -> None:
        self.cells, self._packed, nodes, _ = arranged(cells, steps)
        spans = np.diff(nodes).tolist()
        self._steps = [steps.over(span) for span in spans]
        self._bends = [steps.bend(*pair) for pair in pairwise(spans)]
        moved = np.abs(self.cells.slope)
        self._lead_v = np.argmax(moved / steps.velocity, axis=1)
        self._lead_a = np.argmax(moved / steps.acceleration, axis=1)
        self._layers: list[_Layer] = []
        self.pairs, self.left, self._number = 0, False, 0

    def forward(self) -> Closed | None:
        """Keep the steps that motions from the first node may make; return where all end."""
        start = self._packed.start
        live = np.ones(len(self.cells), np.bool_)
        for k in range(len(start) - 2):
            layer = self._steps_from(k, live)
            if layer is None:
                return None
            if not len(layer.to):
                return self._closed(k, "velocity", live)
            if k and self._few(self._layers[-1], layer, k):
                before = self._layers[-1]
                layer.kept[:] = False
                self.pairs += keep_on(
                    self._packed, self._steps[k], self._bends[k - 1], self._lead_a, k - 1,
                    before.begin, before.to, before.kept, layer.begin, layer.to, layer.kept,
                )  # fmt: skip
                if not layer.kept.any():
                    self._layers.append(layer)
                    return self._closed(k, "acceleration", live)
            self._layers.append(layer)
            live[start[k + 1] : start[k + 2]] = False
            live[layer.to[layer.kept]] = True
        return None

    def backward(self) -> Bools:
        """Keep the steps from which motions may reach the end; return the cells (C,) passed."""
        start = self._packed.start
        live = np.zeros(len(self.cells), np.bool_)
        last = self._layers[-1]
        live[last.to[last.kept]] = True
        for k in range(len(self._layers) - 1, -1, -1):
            layer = self._layers[k]
            layer.kept &= live[layer.to]
            if k + 1 < len(self._layers) and self._few(layer, self._layers[k + 1], k + 1):
                ahead = self._layers[k + 1]
                self.pairs += keep_back(
                    self._packed, self._steps[k], self._bends[k], self._lead_a, k,
                    layer.begin, layer.to, ahead.begin, ahead.to, ahead.kept, layer.kept,
                )  # fmt: skip
            # Cells of the next layer stay only if a kept step leads to them, too.
            reached = np.zeros(start[k + 2] - start[k + 1], np.bool_)
            reached[layer.to[layer.kept] - start[k + 1]] = True
            live[start[k + 1] : start[k + 2]] &= reached
            cell = np.repeat(np.arange(start[k], start[k + 1]), np.diff(layer.begin))
            live[cell[layer.kept]] = True
        return live

    def _steps_from(self, k: int, live: Bools) -> _Layer | None:
        """Return the steps from the live cells of layer k; None if there are too many."""
        start = self._packed.start
        count = np.zeros(start[k + 1] - start[k], np.int64)
        most = current_effort().infeasibility_steps - self._number
        to = list_steps(self._packed, self._steps[k], self._lead_v, k, live, most, count)
        self._number += len(to)
        if len(to) > most:
            self.left = True
            return None
        begin = np.concatenate([[0], np.cumsum(count)])
        return _Layer(begin, to, np.ones(len(to), np.bool_))

    def _few(self, layer: _Layer, ahead: _Layer, k: int) -> bool:
        """Return whether the pairs of steps at layer k are few enough to be tested."""
        onward = np.diff(ahead.begin)[layer.to[layer.kept] - self._packed.start[k]]
        return bool(onward.sum() <= EACH_PAIRS)

    def _closed(self, k: int, limit: Literal["velocity", "acceleration"], live: Bools) -> Closed:
        """Return the closed place at node k, from which no step continues."""
        blame = np.zeros(self.cells.center.shape[1], np.int64)
        if limit == "velocity":
            count_rejections(self._packed, self._steps[k], k, live, blame)
        else:
            before, layer = self._layers[-2:]
            blame_bends(
                self._packed, self._steps[k], self._bends[k - 1], self._lead_a, k - 1,
                before.begin, before.to, before.kept, layer.begin, layer.to, blame,
            )  # fmt: skip
        return Closed(node=k, joint=int(np.argmax(blame)), limit=limit)
