"""One round of elimination: the steps and pairs of steps between cells that motions may make."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np

from kerfpath.arrays import Bools, Ints, short_repr
from kerfpath.certifier.cells import CellSet
from kerfpath.certifier.stages import Steps, arranged, bend_of
from kerfpath.effort import current_effort
from kerfpath.errors import Closed
from kerfpath.kernels.cell_elimination import (
    blame_bends,
    count_rejections,
    keep_back,
    keep_on,
    list_steps,
)

EACH_PAIRS = 1_000_000
"""Most pairs of steps at one node for which (6) is tested in a round."""


@dataclass(slots=True, eq=False)
class _Layer:
    """The steps from the cells of one layer: begin (C_k + 1,), to (E,), and which are kept (E,)."""

    begin: Ints
    to: Ints
    kept: Bools

    __repr__ = short_repr


class Elimination:
    """One forward and one backward sweep over cells of all nodes."""

    def __init__(self, cells: CellSet, steps: Steps) -> None:
        self.cells, self._packed, nodes, _ = arranged(cells, steps)
        spans = np.diff(nodes).tolist()
        self._steps = [steps.over(span) for span in spans]
        self._bends = [bend_of(*pair) for pair in pairwise(spans)]
        moved = np.abs(self.cells.slope)
        self._lead_v = np.argmax(moved / steps.velocity, axis=1)
        self._lead_a = np.argmax(moved / steps.acceleration, axis=1)
        self._layers: list[_Layer] = []
        self.pairs, self.left, self.number = 0, False, 0  # pairs tested, whether too many, steps

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

    def steps(self) -> tuple[Ints, Ints]:
        """Return the steps kept: those of cell a are begin[a]..begin[a+1]-1, (C + 1,), (E,)."""
        count = np.zeros(len(self.cells), np.int64)
        for k, layer in enumerate(self._layers):
            first, last = self._packed.start[k], self._packed.start[k + 1]
            cell = np.repeat(np.arange(last - first), np.diff(layer.begin))[layer.kept]
            count[first:last] = np.bincount(cell, minlength=last - first)
        to = np.concatenate([layer.to[layer.kept] for layer in self._layers])
        return np.append(0, np.cumsum(count)), to

    def _steps_from(self, k: int, live: Bools) -> _Layer | None:
        """Return the steps from the live cells of layer k; None if there are too many."""
        start = self._packed.start
        count = np.zeros(start[k + 1] - start[k], np.int64)
        most = current_effort().infeasibility_steps - self.number
        to = list_steps(self._packed, self._steps[k], self._lead_v, k, live, most, count)
        self.number += len(to)
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
