"""Choice of the cells to divide: first those whose joints are too uncertain, if these decide."""

from __future__ import annotations

import numpy as np

from kerfpath._arrays import Array, Bools
from kerfpath.certifier._cells import CellSet

__all__ = ["cells_to_divide"]

DECIDES = 0.5
"""Uncertain cells decide if the joint uncertainty along the cheapest motion is worth more than this
share of what that motion lacks."""
HALF = 0.5
"""Share of the total worth that the cells to divide have together."""
AIM, MOST = 0.5, 0.25
"""Share of the lack that the division is to gain; and the largest worth of a cell, as a share of
its lack."""
WIDE = 0.02
"""Weight of the box of a cell, compared with the uncertainty of the joints on it."""


def cells_to_divide(
    cells: CellSet, through: Array, target: float, weight: Array
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
    """
    low = through < target
    if not low.any():
        return low, False
    unsure = cells.unsure @ weight
    order = np.lexsort((through, cells.node))
    cheapest = order[np.append(True, np.diff(cells.node[order]) > 0)]
    least = float(through[cheapest].min())
    if unsure[cheapest].sum() <= DECIDES * (target - least):
        return low, False
    lack = np.maximum(least + AIM * (target - least) - through, 0.0)
    worth = np.minimum(unsure + WIDE * (cells.box @ weight), MOST * lack)
    order = np.argsort(-worth, kind="stable")
    total = np.cumsum(worth[order])
    which = np.zeros(len(worth), np.bool_)
    which[order[: np.searchsorted(total, HALF * total[-1]) + 1]] = True
    return which, True
