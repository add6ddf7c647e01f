"""A fast speed of a contour at which its program also keeps the limits between the nodes."""

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
"""Bisections between a speed that keeps the limits and one that was not found to."""
SLOWER = 0.97
"""Factor on a speed that does not keep the limits, for the next one that is tried."""
TRIES = 4


def speed_as_run(job: Job, nodes: Contour, cell: Cell | None, fastest: float) -> float | None:
    """Return a speed, m/s, at which the program of a plan keeps the limits between the nodes.

    It is at most `fastest`, m/s, at which a path exists at the nodes. It is found by planning, and
    proved for that speed; a faster one may exist. None if the job does not ask for it, or if none
    is found.
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
    """Return an estimate of the share of its speed at which a plan keeps the limits."""
    run: Executed | None = None if kept is None else kept.run
    if run is None:
        return SLOWER
    slower = max(run.velocity_bound, np.sqrt(run.acceleration_bound))
    return float(0.999 / slower) if np.isfinite(slower) else SLOWER


def _keeps(job: Job, nodes: Contour, cell: Cell | None, speed: float) -> bool:
    kept = _kept(job, nodes, cell, speed)
    return kept is not None and kept.done


def _kept(job: Job, nodes: Contour, cell: Cell | None, speed: float) -> Kept | None:
    """Return a plan at a speed with the limits kept between its nodes; None without a plan."""
    try:
        made = plan(
            nodes, job.robot, tool=job.tool, placement=job.placement, speed=speed,
            options=replace(job.options, certify=None, between_nodes="reported"), cell=cell,
        )  # fmt: skip
    except NoFeasiblePath:
        return None
    return kept_between_nodes(job, made)
