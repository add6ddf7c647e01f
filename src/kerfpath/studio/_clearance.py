"""The distances of bodies in the cell along each plan, computed once it is found."""

from __future__ import annotations

import numpy as np

from kerfpath.cell import Cell
from kerfpath.job import CutResult
from kerfpath.studio._clearance_messages import ClearanceMessage
from kerfpath.studio._numbers import flat
from kerfpath.studio._work import Stop

__all__ = ["clearance_message"]

AT_ONCE = 32
"""Number of nodes that are measured between two checks for a stop."""


def clearance_message(
    cell: Cell, cut: CutResult, revision: int, stop: Stop
) -> ClearanceMessage | None:
    """Return the nearest pair of bodies at each node of a planned cut, and its distance.

    Only pairs with the near-miss distance of the cell count. Pairs with a distance of their own,
    such as the nozzle and the part or neighbours in the arm, are left out: they are always near,
    and the plan keeps their distance. Return None if there is no other pair.

    Raises
    ------
    Superseded
        Something else has been requested meanwhile.
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
