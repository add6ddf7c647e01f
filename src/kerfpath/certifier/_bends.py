"""Least cost of motions through each cell, without pairs of steps that break (6)."""

from __future__ import annotations

import numpy as np

from kerfpath._arrays import Array, Ints
from kerfpath.certifier._steps import Steps
from kerfpath.kernels.bends import cross_back, cross_on
from kerfpath.kernels.limits import LIMIT_TOLERANCE
from kerfpath.kernels.reduced import Cells

__all__ = ["cross_bends"]


def cross_bends(
    packed: Cells, steps: Steps, begin: Ints, to: Ints, cost: Array,
    behind: Array, ahead: Array, most: float,
) -> tuple[Array, int]:  # fmt: skip
    """Return the least cost through each cell (C,), infinite beyond `most`; and the tests of (6).

    Parameters
    ----------
    packed : Cells
        Cells at neighbouring nodes.
    steps : Steps
    begin, to, cost : (C + 1,), (E,), (E,)
        The steps of cell a are begin[a]..begin[a+1]-1, each to a cell and at a reduced cost.
    behind, ahead : (C,)
        Least reduced cost up to each cell and from it on, without (6).
    most : float
        Largest cost of the motions of interest.
    """
    start, step = packed.start, steps.over(1)
    bound = steps.acceleration + 2 * LIMIT_TOLERANCE
    lead = np.argmax(np.abs(packed.slope) / bound, axis=1)
    origin = np.repeat(np.arange(len(behind)), np.diff(begin))
    until = np.full(len(to), np.inf)  # up to the end of each step
    onward = np.full(len(to), np.inf)  # from there on
    tests = 0
    layers = len(start) - 1
    edges = [slice(int(begin[start[k]]), int(begin[start[k + 1]])) for k in range(layers - 1)]
    until[edges[0]] = behind[origin[edges[0]]] + cost[edges[0]]
    for k in range(1, layers - 1):
        first, last = int(start[k]), int(start[k + 1])
        ending = np.arange(edges[k - 1].start, edges[k - 1].stop)
        ending = ending[np.isfinite(until[ending])]
        ending = ending[np.lexsort((until[ending], to[ending]))]
        in_begin = np.searchsorted(to[ending], np.arange(first, last + 1))
        tests += cross_on(
            packed, step, bound, lead, first, last, begin, to, origin, ending, in_begin,
            cost, ahead, most, until,
        )  # fmt: skip
    onward[edges[-1]] = 0.0
    for k in range(layers - 2, 0, -1):
        first, last = int(start[k]), int(start[k + 1])
        leaving = np.arange(edges[k].start, edges[k].stop)
        total = cost[leaving] + onward[leaving]
        some = np.isfinite(total) & np.isfinite(until[leaving])
        leaving, total = leaving[some], total[some]
        leaving = leaving[np.lexsort((total, origin[leaving]))]
        on_begin = np.searchsorted(origin[leaving], np.arange(first, last + 1))
        ending = np.arange(edges[k - 1].start, edges[k - 1].stop)
        tests += cross_back(
            packed, step, bound, lead, first, last, to, origin, leaving, on_begin,
            ending[np.isfinite(until[ending])], cost, until, most, onward,
        )  # fmt: skip
    through = np.full(len(behind), np.inf)
    whole = until + onward
    np.minimum.at(through, origin, whole)
    np.minimum.at(through, to[edges[-1]], until[edges[-1]])
    return through, tests
