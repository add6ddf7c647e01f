"""Groups of cells that no step joins, without groups that only repeat another one."""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from kerfpath._arrays import Bools, Ints
from kerfpath.certifier._cells import CellMaker, CellSet
from kerfpath.certifier._stage import StageResult

__all__ = ["distinct_groups"]


def distinct_groups(result: StageResult, kept: Bools, maker: CellMaker) -> list[Bools]:
    """Return the groups of kept cells that no step joins, (C,) bool each.

    A group is left out if another one contains it up to whole turns of the joints or a flipped
    wrist (`Robot.flip`): each motion through it then has a counterpart through the other one at the
    same cost, as (5), (6) and the cost depend only on the sizes of increments.
    """
    labels, count = _joined(result, kept)
    if count < 2:
        return [labels == 0]
    which, turn = _codes(result.cells, maker)
    order = np.argsort(labels, kind="stable")
    groups = np.split(order, np.searchsorted(labels[order], np.arange(count)))[1:]
    found: list[Ints] = []
    for cells in sorted(groups, key=len, reverse=True):
        images = [cells + first for first in range(0, len(which), len(labels))]
        if not any(_contains(which, turn, one, others) for others in found for one in images):
            found.append(cells)
    return [labels == labels[cells[0]] for cells in found]


def _joined(result: StageResult, kept: Bools) -> tuple[Ints, int]:
    """Return the group (C,) of each cell, -1 if it is not kept, and the number of groups."""
    cell = np.repeat(np.arange(len(kept)), np.diff(result.begin))
    both = kept[cell] & kept[result.to]
    size = (len(kept),) * 2
    steps = sparse.csr_array((np.ones(both.sum()), (cell[both], result.to[both])), shape=size)
    group = connected_components(steps, directed=False)[1]
    labels = np.full(len(kept), -1)
    alone, labels[kept] = np.unique(group[kept], return_inverse=True)
    return labels, len(alone)


def _codes(cells: CellSet, maker: CellMaker) -> tuple[Ints, Ints]:
    """Return a number for each cell up to turns of its joints, and one for the turns, (C,) each.

    Shifting the turns of all cells shifts the second numbers of all by the same amount. If the
    wrist can be flipped, the numbers of the cells with the wrist flipped follow, (2 C,) each.
    """
    sets = [cells] if maker.flip is None else [cells, cells.flipped(*maker.flip)]
    name = np.concatenate([np.stack([c.node, c.posture, c.level, c.index], axis=1) for c in sets])
    center = np.concatenate([c.center for c in sets])
    _, first, which = np.unique(name, axis=0, return_index=True, return_inverse=True)
    which = which.ravel()
    halves = np.rint((center - center[first[which]]) / np.pi).astype(np.int64)
    halves[:, maker.endless] = 0  # all turns are equivalent
    digits = 4 * np.abs(halves).max() + 1  # keeps turns, shifts and their sums distinct
    return which, halves @ digits ** np.arange(halves.shape[1])


def _contains(which: Ints, turn: Ints, cells: Ints, others: Ints) -> bool:
    """Return whether cells (A,), with their turns shifted, are all among others (B,)."""
    if len(cells) > len(others):
        return False
    shifts = turn[others[which[others] == which[cells[0]]]] - turn[cells[0]]
    known = set(zip(which[others].tolist(), turn[others].tolist(), strict=True))
    return any(
        known.issuperset(zip(which[cells].tolist(), (turn[cells] + shift).tolist(), strict=True))
        for shift in np.unique(shifts)
    )
