"""What a job asks for, contour by contour: what plans and programs are judged by."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from scipy.spatial import cKDTree

from kerfpath._arrays import Array, freeze
from kerfpath._told import told
from kerfpath.auditor import Check
from kerfpath.cad import Part
from kerfpath.cad import read as read_drawing
from kerfpath.cell import Cell
from kerfpath.contour import Contour
from kerfpath.job.format import ContourTask, Job, cell_of_job
from kerfpath.planner import node_interval
from kerfpath.sequence import inner_first

__all__ = ["Asked", "Candidate", "asked_of", "order_checks"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Candidate:
    """One of the ways in which a contour of a job may be cut.

    Parameters
    ----------
    task : ContourTask
    path : Contour
        The path to cut with its operations (leads, micro joints, ...), part frame.
    nodes : Contour
        It, sampled as the job says: points, axes, kinds, speed shares and arc lengths.
    dt : float s
        From node to node at the speed asked for.
    """

    task: ContourTask
    path: Contour
    nodes: Contour
    dt: float

    __repr__ = told

    @property
    def time(self) -> Array:
        """When each node is reached at the speed asked for, (K,) s."""
        return freeze(self.dt * np.arange(len(self.nodes), dtype=float))


@dataclass(frozen=True, kw_only=True, eq=False)
class Asked:
    """A job with its drawing and its cell, read once.

    Parameters
    ----------
    job : Job
    part : Part
    cell : Cell or None
    tasks : tuple of ContourTask
        In the order of the job.
    """

    job: Job
    part: Part
    cell: Cell | None
    tasks: tuple[ContourTask, ...]

    __repr__ = told

    @cached_property
    def loops(self) -> tuple[Contour, ...]:
        """The loop of each contour as drawn."""
        return tuple(task.drawn(self.part) for task in self.tasks)

    @cached_property
    def candidates(self) -> tuple[tuple[Candidate, ...], ...]:
        """The ways in which each contour may be cut: one, or several starts and directions."""
        return tuple(
            tuple(_candidate(task, path) for path in task.candidates(self.part, loop))
            for task, loop in zip(self.tasks, self.loops, strict=True)
        )

    @cached_property
    def inner_first(self) -> tuple[tuple[int, int], ...]:
        """Pairs of contours of which the first is to be cut before the second."""
        sequence = self.job.sequence
        if sequence is None or not sequence.inner_first:
            return ()
        return tuple(inner_first(self.loops))


def asked_of(job: Job, part: Part | None = None) -> Asked:
    """Return what a job asks for; `part` is what its drawing holds, if that is read already.

    Raises
    ------
    InputError
        The drawing or the cell cannot be read, a loop does not exist.
    """
    part = part or read_drawing(job.part_file, unit=job.part_unit)
    return Asked(job=job, part=part, cell=cell_of_job(job, part), tasks=job.tasks(part))


def _candidate(task: ContourTask, path: Contour) -> Candidate:
    nodes = task.sample(path)
    speed = task.speed if nodes.time is None else None
    return Candidate(task=task, path=path, nodes=nodes, dt=node_interval(nodes, speed))


def order_checks(asked: Asked, done: Sequence[int], paths: Sequence[Contour]) -> list[Check]:
    """Return the checks of an order of cutting; their node is the number of the cut.

    Parameters
    ----------
    asked : Asked
    done : sequence of int
        Which contour of the job each cut is of, in the order of cutting; pieces of one follow each
        other with the same number.
    paths : sequence of Contour
        The nodes of each cut.
    """
    sequence = asked.job.sequence
    early = [
        k
        for k, i in enumerate(done)
        if any(j in done[:k] for a, j in asked.inner_first if a == i)
    ]  # fmt: skip
    rows = [_count("inner-first", "contours cut after the one that they lie in", early)]
    given = sequence is None or sequence.order == "given"
    turned = [k + 1 for k, (a, b) in enumerate(pairwise(done)) if given and b < a]
    rows.append(_count("order", "contours cut before one that the job has first", turned))
    rows.append(
        _count("pieces", "pieces cut before one that lies before them", _early(done, paths))
    )
    spacing = 0.0 if sequence is None else sequence.heat_spacing_mm / 1000
    if spacing > 0:
        warm = _too_warm(asked, done, paths, spacing)
        rows.append(_count("heat-spacing", "contours cut right after one too near to them", warm))
    return rows


def _early(done: Sequence[int], paths: Sequence[Contour]) -> list[int]:
    """Return the pieces that are cut after one that lies farther along the same contour."""
    return [
        k
        for k, (i, path) in enumerate(zip(done, paths, strict=True))
        if any(j == i and other.s[0] > path.s[0] for j, other in zip(done[:k], paths, strict=False))
    ]


def _too_warm(
    asked: Asked, done: Sequence[int], paths: Sequence[Contour], spacing: float
) -> list[int]:
    """Return the cuts that follow one nearer than `spacing` (m), by the first ways to cut each."""
    whole = {i for i in done if list(done).count(i) == 1}
    first = {i: asked.candidates[i][0].nodes for i in whole}
    shapes = [first.get(i, path) for i, path in zip(done, paths, strict=True)]
    found = []
    for k, (one, two) in enumerate(pairwise(shapes)):
        apart, _ = cKDTree(one.points).query(two.points)
        if np.asarray(apart).min() < spacing:
            found.append(k + 1)
    return found


def _count(code: str, title: str, found: Sequence[int]) -> Check:
    node = found[0] if found else 0
    return Check(
        code=code, title=title, value=float(len(found)), limit=0.0, unit="count", node=node
    )
