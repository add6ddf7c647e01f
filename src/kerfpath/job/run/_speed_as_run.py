"""The fastest speed of a contour at which its program, too, keeps the limits between the nodes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kerfpath.cell import Cell
from kerfpath.contour import Contour
from kerfpath.errors import NoFeasiblePath
from kerfpath.execution import Executed, Kept
from kerfpath.job.as_run import keeps_between_nodes, kept_between_nodes
from kerfpath.job.format import Job
from kerfpath.planner import plan

__all__ = ["speed_as_run"]

HALVINGS = 2
"""Of what lies between a speed that keeps the limits and one that was not found to."""
SLOWER = 0.97
"""Share of a speed that is tried where the limits are not kept at it."""
TRIES = 4


def speed_as_run(job: Job, nodes: Contour, cell: Cell | None, fastest: float) -> float | None:
    """Return a speed, m/s, at which a plan of the job keeps the limits as its program has it run.

    No faster than `fastest`, at which a path exists at the nodes. It is found by planning, and
    proved for that speed; a faster one may exist. None where the job does not ask for it, or where
    none is found.
    """
    if not keeps_between_nodes(job):
        return None
    first = _kept(job, nodes, cell, fastest)
    if first is not None and first.done:
        return fastest
    low, high = fastest * _share(first), fastest
    for _ in range(TRIES):
        if _keeps(job, nodes, cell, low):
            break
        low, high = SLOWER * low, low
    else:
        return None
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        if _keeps(job, nodes, cell, middle):
            low = middle
        else:
            high = middle
    return low


def _share(kept: Kept | None) -> float:
    """Return at which share of its speed a plan keeps the limits as it is, as far as is known."""
    run: Executed | None = None if kept is None else kept.run
    if run is None:
        return SLOWER
    slower = max(run.velocity_bound, np.sqrt(run.acceleration_bound))
    return float(0.999 / slower) if np.isfinite(slower) else SLOWER


def _keeps(job: Job, nodes: Contour, cell: Cell | None, speed: float) -> bool:
    kept = _kept(job, nodes, cell, speed)
    return kept is not None and kept.done


def _kept(job: Job, nodes: Contour, cell: Cell | None, speed: float) -> Kept | None:
    """Return what comes of keeping the limits of a plan at a speed; None without one."""
    try:
        made = plan(
            nodes, job.robot, tool=job.tool, placement=job.placement, speed=speed,
            options=replace(job.options, certify=None, between_nodes="reported"), cell=cell,
        )  # fmt: skip
    except NoFeasiblePath:
        return None
    return kept_between_nodes(job, made)
