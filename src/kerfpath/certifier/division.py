"""Nodes and cells of the next stage: where the plan turns, and the cells that decide the bound."""

from __future__ import annotations

from heapq import heapify, heappush, heapreplace
from itertools import pairwise

import numpy as np

from kerfpath.arrays import Array, Bools, Ints
from kerfpath.certifier.cells import CellSet
from kerfpath.kernels.metric import rho

DECIDES = 0.5
"""Uncertain cells decide if the joint uncertainty along the cheapest motion is worth more than this
share of what that motion lacks."""
HALF = 0.5
"""Share of the total worth that the cells to divide have together."""
AIM, MOST = 0.5, 0.25
"""Share of the lack that the division is to gain; and the largest worth of a cell, as a share of
its lack."""
BOX_WEIGHT = 0.02
"""Weight of the box of a cell, compared with the uncertainty of the joints on it."""


def turning_nodes(increments: Array, weight: Array, metric: int, share: float, ends: Ints) -> Ints:
    """Return nodes (M,) such that straight steps between them cost about as much as a motion.

    Parameters
    ----------
    increments : (K - 1, n) rad
        Of the motion, from node to node.
    weight : (n,) 1/rad
    metric : int
        Code of the metric.
    share : float
        Largest share of the motion's cost that the straight steps may lose.
    ends : (E,)
        Nodes that are among them, the first and the last with them.
    """
    q = np.vstack([np.zeros_like(increments[:1]), np.cumsum(increments, axis=0)])
    upto = np.append(0.0, np.cumsum([rho(step, weight, metric) for step in increments]))

    def lost(a: int, b: int) -> float:
        """Return the cost that a straight step from node a to b loses."""
        return float(upto[b] - upto[a] - rho(q[b] - q[a], weight, metric))

    steps = [(-lost(a, b), a, b) for a, b in pairwise(ends.tolist())]
    heapify(steps)
    left = -sum(step[0] for step in steps)
    while left > share * upto[-1]:
        loss, a, b = steps[0]
        if b - a < 2:
            break
        middle = max(range(a + 1, b), key=lambda m: (-lost(a, m) - lost(m, b), -abs(2 * m - a - b)))
        heapreplace(steps, (-lost(a, middle), a, middle))
        heappush(steps, (-lost(middle, b), middle, b))
        left += loss + lost(a, middle) + lost(middle, b)
    return np.array(sorted({node for _, a, b in steps for node in (a, b)}))


def evenly(last: int, longest: int) -> Ints:
    """Return nodes from 0 to the last one that are at most so many intervals apart."""
    return np.unique(np.append(np.arange(0, last, longest), last))


def between(nodes: Ints) -> Ints:
    """Return the nodes plus one in the middle of each step that spans several intervals."""
    return np.unique(np.append(nodes, (nodes[:-1] + nodes[1:]) // 2))


def cells_to_divide(
    cells: CellSet, through: Array, target: float, weight: Array, deepest: int
) -> tuple[Bools, bool]:
    """Return which cells (C,) to divide, and whether only uncertain ones are divided.

    Near a singularity the joints turn fast with gamma: a few cells there, on which the joints may
    be almost anywhere, make motions look cheap that do not exist. As long as such cells decide,
    only the most uncertain ones are divided, with half of the total worth (as finite elements are
    refined: Doerfler, SIAM J. Numer. Anal. 33 (1996) 1106); else all cells below the target.

    Parameters
    ----------
    cells : CellSet
    through : (C,)
        Lower bound on the cost of motions through each cell.
    target : float
        Lower bound to reach.
    weight : (n,) 1/rad
    deepest : int
        Level of the cells that are not divided any more; what is uncertain on them stays so.
    """
    divisible = cells.grain < deepest
    low = (through < target) & divisible
    if not low.any():
        return low, False
    unsure = np.where(divisible, cells.unsure @ weight, 0.0)
    order = np.lexsort((through, cells.node))
    cheapest = order[np.append(True, np.diff(cells.node[order]) > 0)]
    least = float(through[cheapest].min())
    if unsure[cheapest].sum() <= DECIDES * (target - least):
        return low, False
    lack = np.maximum(least + AIM * (target - least) - through, 0.0)
    size = np.where(divisible, cells.box @ weight, 0.0)
    worth = np.minimum(unsure + BOX_WEIGHT * size, MOST * lack)
    order = np.argsort(-worth, kind="stable")
    total = np.cumsum(worth[order])
    which = np.zeros(len(worth), np.bool_)
    which[order[: np.searchsorted(total, HALF * total[-1]) + 1]] = True
    return which & divisible, True
