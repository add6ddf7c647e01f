"""Which cells to divide: those about which too little is known, as long as these decide."""

from __future__ import annotations

import numpy as np

from kerfpath._arrays import Array, Bools
from kerfpath.certifier._cells import CellSet

__all__ = ["cells_to_divide"]

DECIDES = 0.5
"""Share of what the cheapest motions lack that what is not known of their joints must be worth."""
HALF = 0.5
"""Share of what is not known that goes into the cells to divide."""
AIM, MOST = 0.5, 0.25
"""Share of what is lacking that the cells to divide are to gain; and the most that one is worth."""
WIDE = 0.02
"""What the box of a cell is worth beside what is not known of the joints on it."""


def cells_to_divide(
    cells: CellSet, through: Array, target: float, weight: Array
) -> tuple[Bools, bool]:
    """Return which cells (C,) to divide, and whether others, as coarse, may wait.

    Near a singularity the joints turn fast with gamma: a few cells there, on which they may be
    almost anywhere, let motions look cheap that there are not. As long as they decide, only they
    are divided (those that are worth half of what is not known, as finite elements are refined:
    Doerfler, SIAM J. Numer. Anal. 33 (1996) 1106); else all that lack something.

    Parameters
    ----------
    cells : CellSet
    through : (C,)
        What motions through each cell cost at least.
    target : float
        What is wanted of them.
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
