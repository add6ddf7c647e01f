"""How near the robot comes to what stands in its cell, along each plan: after it is found."""

from __future__ import annotations

import numpy as np

from kerfpath.cell import Cell
from kerfpath.job import CutResult
from kerfpath.studio._clearance_messages import ClearanceMessage
from kerfpath.studio._numbers import flat
from kerfpath.studio._work import Stop

__all__ = ["clearance_message"]

AT_ONCE = 32
"""Nodes that are measured between two looks at whether that is still wanted."""


def clearance_message(
    cell: Cell, cut: CutResult, revision: int, stop: Stop
) -> ClearanceMessage | None:
    """Return the nearest pair of bodies at each node of a cut that is planned, and its distance.

    Of all pairs that keep the near-miss distance of the cell. Those with one of their own, as the
    nozzle and the part or neighbours in the arm, are always near: the plan keeps it, and nothing
    could be told by them. None where there is no other pair.

    Raises
    ------
    Superseded
        Meanwhile something else was asked for.
    """
    assert cut.plan is not None
    q, general = cut.plan.unwrapped, ~cell.own
    if not general.any():
        return None
    distance, pair = np.empty(len(q)), np.empty(len(q), dtype=np.int64)
    for begin in range(0, len(q), AT_ONCE):
        stop.check()
        part = slice(begin, begin + AT_ONCE)
        wanted = np.broadcast_to(general, (len(q[part]), len(general)))
        found = cell.distances(q[part], wanted=wanted)
        pair[part] = np.nanargmin(found, axis=1)
        distance[part] = np.nanmin(found, axis=1)
    used, index = np.unique(pair, return_inverse=True)
    return ClearanceMessage(
        revision=revision,
        contour=cut.contour,
        name=cut.plan.name,
        distance=flat(distance),
        over=flat(distance - cell.required[pair]),
        pair=index.tolist(),
        pairs=[list(cell.pair_names[k]) for k in used.tolist()],
    )
