"""Check a job without planning it: its cell, and the poses at the start of its contours."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from kerfpath._repr import short_repr
from kerfpath.cad import Part
from kerfpath.cell import Cell
from kerfpath.job.format import Job, cell_of_job, places_of

__all__ = ["ContourStart", "JobPreview", "check_job"]

FAR = 0.05
"""Distance in m beyond the near-miss distance up to which clearances are measured."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ContourStart:
    """The poses at the start of a contour.

    Parameters
    ----------
    name : str
    nodes : int
    poses : int
        Admissible poses at its first node.
    clear : int
        Poses among them that keep every near-miss distance.
    clearance : float m
        Least distance of the best pose, over the pairs that must keep the near-miss distance of
        the cell, up to 50 mm more than that; NaN without poses.
    pair : (str, str) or None
        The two bodies at this distance.
    """

    name: str
    nodes: int
    poses: int
    clear: int
    clearance: float
    pair: tuple[str, str] | None

    __repr__ = short_repr


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class JobPreview:
    """A job with its part, its cell if it has one, and the start of every contour."""

    job: Job
    part: Part
    cell: Cell | None
    starts: tuple[ContourStart, ...]

    __repr__ = short_repr


def check_job(job: Job, part: Part | None = None) -> JobPreview:
    """Return the cell of a job and the start of its contours; `part` if it is read already.

    Raises
    ------
    InputError
        As `run_job`.
    """
    part = part or job.read_part()
    cell = cell_of_job(job, part)
    starts = []
    for task in job.tasks(part):
        nodes = task.sample(task.candidates(part)[0])
        first = nodes.part(0, 1, job.options.frames)
        plain = replace(job.options, comfort=None, retract=None, floor=None)
        graph = job.graph(first, plain, external=places_of(job, first))
        q = graph.q[: graph.start[1]]
        starts.append(_start(task.name, len(nodes), q, cell))
    return JobPreview(job=job, part=part, cell=cell, starts=tuple(starts))


def _start(name: str, nodes: int, q: np.ndarray, cell: Cell | None) -> ContourStart:
    clear, clearance, pair = len(q), np.nan, None
    if cell is not None and len(q) and len(cell.pairs):
        apart = cell.distances(q, enough=cell.required + FAR)
        clear = int((apart > cell.required).all(axis=1).sum())
        common = np.flatnonzero(~cell.own)
        if common.size:
            apart = np.minimum(apart[:, common], cell.near_miss + FAR)
            best = int(np.argmax(apart.min(axis=1)))
            nearest = int(np.argmin(apart[best]))
            clearance, pair = float(apart[best, nearest]), cell.pair_names[common[nearest]]
    return ContourStart(
        name=name, nodes=nodes, poses=len(q), clear=clear, clearance=clearance, pair=pair
    )
