"""Proof that no motion exists: cells of gamma are eliminated until a node has none left."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kerfpath.arrays import Array, Ints, freeze
from kerfpath.certifier.cells import CellMaker, CellSet
from kerfpath.certifier.elimination import Elimination
from kerfpath.certifier.empty_tubes import EmptyTubes, binding_window
from kerfpath.certifier.stages import Steps
from kerfpath.effort import current_effort
from kerfpath.errors import Closed
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
STALLED, FROM_HALVING = 0.2, 3
"""Share of the halves that a round of a brief test must rule out, from which halving on: rounds
that end in a proof rule out more, and those of other tests less and less."""
MANY_STEPS, MANY_HALVINGS = 100_000, 4
"""Steps between cells above which motions are divided into tubes rather than cells into halves, and
the number of halvings from which on they are."""


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
        self,
        limits: Limits,
        dt: float,
        around: int | None = None,
        *,
        brief: bool = False,
        tubes: int = 0,
        binding: tuple[Array, Ints] | None = None,
    ) -> Closed | None:
        """Return the place that no motion passes, with nodes `dt` s apart; None if not proved.

        Motions that keep (5) and (6) at the nodes, ranges and couplings cannot pass a cell from
        which, or to which, no step or pair of steps leads. The other cells are halved until a node
        has none left, or until the limit of work. With `around`, only the part of the contour
        around that node is tested, with finer cells: a motion that cannot pass a part cannot pass
        the whole contour. More than `MOST_NODES` nodes are not tested as a whole. Cells are at some
        nodes only where joints take many intervals to reach their velocity limit (`Steps.layers`).
        With `brief`, it ends as soon as halving rules out little. With ``tubes``, motions are
        divided into at most so many (`EmptyTubes`), once finer cells have too many steps; the part
        then grows to more nodes where motions pass it. With ``binding``, gamma and posture (K,) of
        a motion that exceeds the limits, it begins with the part where limits bind this motion.
        """
        steps = Steps.within(
            limits,
            dt,
            weight=freeze(np.zeros(len(self._endless))),
            metric=MANHATTAN,
            endless=self._endless,
        )
        most_pairs = current_effort().infeasibility_pairs
        first, last = 0, self._count - 1
        if around is not None:
            near = NODES_AROUND * int(np.diff(steps.layers(first, last)).max(initial=1))
            first, last = max(first, around - near), min(last, around + near)
        window = None if binding is None else binding_window(self._maker, steps, *binding)
        if window is not None:
            first, last = window
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
            one = Elimination(cells, steps)
            found = one.forward()
            if found is not None:
                return replace(found, node=int(nodes[found.node]))
            work += one.pairs
            if one.left or work > most_pairs:
                return None
            passed, before = one.cells.take(one.backward()), len(one.cells)
            if brief and halved >= FROM_HALVING - 1 and len(passed) > (1 - STALLED) * before:
                return None
            many = one.number > MANY_STEPS or halved >= MANY_HALVINGS
            if tubes and len(nodes) > 2 and many:
                node = EmptyTubes(self._maker, steps, self._count - 1, tubes).closed(passed, nodes)
                return None if node is None else Closed(node=node - 1, joint=None, limit="both")
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
