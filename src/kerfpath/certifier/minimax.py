"""The bound of the objective "max" (15): the least cost of the costliest step of any motion.

Cells of gamma get the least that the costliest step before and after them may cost
(`kernels.minimax`). Those that cost too much drop out, and the others are halved. Joints with a
range of a turn or more count as endless at first: any motion within the range is one modulo turns,
and there are far fewer cells.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from kerfpath.arrays import Array
from kerfpath.certificate import allowance
from kerfpath.certifier.cells import CellSet, cell_maker, foldable
from kerfpath.certifier.parts import SAME_COST
from kerfpath.certifier.stages import Steps, arranged, least_over_layers
from kerfpath.effort import current_effort
from kerfpath.kernels.minimax import LargestStep, lay_largest
from kerfpath.plans import Plan
from kerfpath.progress import Progress

DEEPEST = 14
"""Largest level: cells of 3e-4 deg."""
MOST_CELLS = 500_000
"""Most cells of a round; the bound ends before it exceeds them."""
UNCERTAIN = 0.05
"""Share of the cost of a step that the uncertainty of the joints may be worth on a first cell."""
STALLED = 0.1
"""Share of what the bound lacks that a round must gain; if it gains less, folded turns unfold."""
ROUNDED = 1e-15
"""Relative rounding error of a quotient."""


def largest_step_bound(
    plan: Plan, steps: Steps, gap: float, spent: Callable[[], bool], progress: Progress
) -> tuple[float, int, int]:
    """Return a lower bound on the costliest step of any motion, and how many rounds and steps.

    Parameters
    ----------
    plan : Plan
        With the objective "max".
    steps : Steps
        Bound (5), weights and metric; (6) is not used.
    gap : float
        Value of (cost - bound) / cost at which it stops.
    spent : callable
        Returns whether the time is over, so that no further round begins.
    progress : Progress
    """
    target = plan.cost * min(1.0, 1 - gap + allowance(gap, checkable=False) + SAME_COST)
    most_pairs = current_effort().minimax_pairs
    steps = _capped(steps, target)
    folded = foldable(plan.robot, steps.velocity)
    maker = cell_maker(plan, steps.weight, folded=folded)
    unfolded = cell_maker(plan, steps.weight) if folded.any() else None
    cells = maker.coarsest(np.arange(len(plan.q)))
    cells = maker.certain(cells, steps.weight, UNCERTAIN * target)
    best, rounds, pairs, more = 0.0, 0, 0, 0.0
    while not spent() and len(cells) <= MOST_CELLS and pairs + more <= most_pairs:
        floor, tried = _floors(cells, replace(steps, endless=maker.endless))
        cells = replace(cells, floor=floor)
        pairs, rounds, before = pairs + tried, rounds + 1, best
        best = max(best, min(least_over_layers(cells.node, floor), target))
        progress("certificate", int(1000 * best / target), 1000)
        live = floor < target
        which = live & (cells.grain < DEEPEST)
        if best >= target or not which.any():
            break
        more = tried * (2 * live.mean()) ** 2
        cells, which = cells.take(live), which[live]
        if unfolded is not None and best - before < STALLED * (target - before):
            maker, unfolded = unfolded, None
            cells = maker.lifted(cells)
            which = cells.grain < DEEPEST
        cells = maker.divided(cells, which)
    return best, rounds, pairs


def _floors(cells: CellSet, steps: Steps) -> tuple[Array, int]:
    """Return the least cost of the costliest step of motions through each cell; and the steps."""
    floor, pairs = cells.floor.copy(), 0
    for node in (cells.node, cells.node.max() - cells.node):  # onward, and in reverse
        _, packed, nodes, order = arranged(replace(cells, node=node), steps)
        lead = np.argmax(np.abs(packed.slope) / steps.velocity, axis=1)
        C = len(order)
        found = LargestStep(np.zeros((C, 2)), np.zeros((C, 2)), np.zeros(C))
        for k in range(len(nodes) - 2, -1, -1):
            pairs += lay_largest(packed, steps.over(1), lead, k, found)
        floor[order] = np.maximum(floor[order], found.least)
    return floor, pairs


def _capped(steps: Steps, cost: float) -> Steps:
    """Return the steps with a largest cost, which also bounds the increment of each joint."""
    alone: Array = np.divide(
        cost, steps.weight, out=np.full_like(steps.weight, np.inf), where=steps.weight > 0
    )
    farthest = np.minimum(steps.velocity, alone * (1 + ROUNDED))
    return replace(steps, velocity=farthest, most=cost)
