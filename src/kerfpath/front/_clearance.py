"""Clearance as a criterion: what robot and head keep from what stands around them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kerfpath._arrays import Bools
from kerfpath.cell import Cell
from kerfpath.plans import Plan

__all__ = ["clearance", "counted", "roomier"]

MOVING = ("robot", "head")


def counted(cell: Cell) -> Bools:
    """Return which judged pairs (P,) count: robot or head with what stands around.

    Pairs with a near-miss distance of their own, as nozzle and part, work near each other by
    design, and links may be near each other whatever the arm does.
    """
    moving = np.array([cell.bodies[b].kind in MOVING for b in cell.pairs.ravel()])
    one, two = moving.reshape(-1, 2).T
    return np.asarray((one != two) & ~cell.own, dtype=np.bool_)


def clearance(plan: Plan, cell: Cell) -> float:
    """Return the least distance of these pairs at the nodes beyond what is to be kept, m."""
    wanted = counted(cell)
    apart = cell.distances(plan.q, wanted=np.broadcast_to(wanted, (len(plan.q), len(wanted))))
    return float((apart - cell.required)[:, wanted].min())


def roomier(cell: Cell, more: float) -> Cell:
    """Return the cell in which these pairs have to keep `more` m beyond its near-miss distance."""
    names = [cell.pair_names[p] for p in np.flatnonzero(counted(cell))]
    asked = dict.fromkeys(names, cell.near_miss + more)
    return replace(cell, near_miss_of={**cell.near_miss_of, **asked})
