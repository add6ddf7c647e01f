"""A job made ready: its drawing and cell are read, and each contour has the ways to cut it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from kerfpath._repr import short_repr
from kerfpath.auditor import Check
from kerfpath.cad import Part
from kerfpath.cell import Cell
from kerfpath.contour import Contour
from kerfpath.errors import InputError
from kerfpath.front import Subproblem
from kerfpath.job.format._cell import cell_of_job
from kerfpath.job.format._contour import ContourSpec
from kerfpath.job.format._read import Job
from kerfpath.job.format._refusals import all_of
from kerfpath.job.format._sampling import closer_nodes
from kerfpath.operations import edge, nearest
from kerfpath.options import PlanOptions
from kerfpath.planner import node_interval
from kerfpath.sequence import inner_first

__all__ = ["Candidate", "CutRequest", "PreparedJob", "divide_nodes", "prepare"]


SAME_PLACE = 1e-6
"""m: what is off by no more is so by rounding."""
SHORTER = 0.1
"""Share of a path by which its nodes may be shorter, as chords are, and are still of all of it."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Candidate:
    """One of the ways in which a contour may be cut.

    Parameters
    ----------
    path : Contour
        The path to cut with its operations (leads, micro joints, ...), part frame.
    nodes : Contour
        It, sampled as the job says: points, axes, kinds, speed shares and arc lengths.
    speed : float m/s, optional
        Along the path; None where the nodes carry their own times.
    unrounded : Contour, optional
        The path before its corners were rounded, where they are.
    """

    path: Contour
    nodes: Contour
    speed: float | None = None
    unrounded: Contour | None = None

    __repr__ = short_repr

    @classmethod
    def at(cls, speed: float, path: Contour, nodes: Contour) -> Candidate:
        """Return the candidate with nodes of a path, at a speed (m/s) unless they carry times."""
        return cls(path=path, nodes=nodes, speed=speed if nodes.time is None else None)

    @property
    def dt(self) -> float:
        """Time from node to node at the speed asked for, s."""
        return node_interval(self.nodes, self.speed)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CutRequest:
    """What is asked for one contour: the ways to cut it, and how its plan is to be.

    Parameters
    ----------
    task : ContourSpec
        What the job says of it.
    loop : Contour
        As drawn, part frame.
    candidates : tuple of Candidate
        Of which one is cut.
    options : PlanOptions
    run : Subproblem or None
        The run of a Pareto set that the plan follows, with its windows and clearance.
    touched_up : bool
        Whether targets of the path were moved by hand.
    closer : str
        How its nodes are nearer to each other than the job says, and why; "" where they are not.
    """

    task: ContourSpec
    loop: Contour
    candidates: tuple[Candidate, ...]
    options: PlanOptions
    run: Subproblem | None = None
    touched_up: bool = False
    closer: str = ""

    __repr__ = short_repr

    @property
    def leaves_the_loop(self) -> bool:
        """Whether points or tool axes of the cut are other than those of the loop as drawn."""
        return self.touched_up or self.task.table.moves_the_path

    def drawing_checks(self, candidate: Candidate, nodes: Contour, path: float) -> list[Check]:
        """Return the check of rounded corners against the drawing, where there are any.

        Parameters
        ----------
        candidate : Candidate
            What is cut.
        nodes : Contour
            That sample it: all of it, or nothing is checked.
        path : float m
            How far chords between nodes may be off the path anyway.
        """
        rounded, sharp = self.task.rounded, candidate.unrounded
        whole = abs(nodes.length - candidate.path.length) <= SHORTER * candidate.path.length
        if rounded is None or sharp is None or not whole:
            return []
        drawn = edge(sharp).points
        where, k = nearest(edge(nodes), drawn)
        off = np.linalg.norm(where - drawn, axis=1)
        worst = int(np.argmax(off))
        return [
            Check(
                code="drawing",
                title=f"drawing off the chords of the nodes, its corners rounded by "
                f"{rounded * 1e3:g} mm",
                value=float(off[worst]),
                limit=max(rounded, path) + SAME_PLACE,
                unit="m",
                node=int(k[worst]),
                advice="lower round_mm in [contour.corners], or sample the contour more finely",
            )
        ]

    def picked(self, run: Subproblem, *, refine: bool) -> CutRequest:
        """Return the request for the first candidate, planned as a run of a Pareto set."""
        mine = self.options
        options = run.applied_to(replace(mine, feed="constant", refine=refine))
        if run.continuous:  # it keeps its own shares of the limits, and all else the job's
            options = replace(options, eta_v=mine.eta_v, eta_a=mine.eta_a)
        return replace(self, candidates=self.candidates[:1], options=options, run=run)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PreparedJob:
    """A job with its drawing and its cell: what runs, and what plans and programs are judged by.

    Parameters
    ----------
    job : Job
    part : Part
    cell : Cell or None
    contours : tuple of CutRequest
        In the order of the job, or in that in which they are to be cut.
    inner_first : tuple of (int, int)
        Contours of which the first is to be cut before the second.
    """

    job: Job
    part: Part
    cell: Cell | None
    contours: tuple[CutRequest, ...]
    inner_first: tuple[tuple[int, int], ...]

    __repr__ = short_repr

    @classmethod
    def of(
        cls, job: Job, part: Part, cell: Cell | None, contours: Sequence[CutRequest]
    ) -> PreparedJob:
        """Return the job with its contours; which lie in which follows from their loops."""
        inner: Sequence[tuple[int, int]] = ()
        if job.sequence is not None and job.sequence.inner_first:
            inner = inner_first([contour.loop for contour in contours])
        return cls(
            job=job, part=part, cell=cell, contours=tuple(contours), inner_first=tuple(inner)
        )

    def with_contours(self, contours: Sequence[CutRequest]) -> PreparedJob:
        """Return the job with other requests, in their order."""
        return PreparedJob.of(self.job, self.part, self.cell, contours)

    @property
    def names(self) -> list[str]:
        """The names of the contours."""
        return [contour.task.name for contour in self.contours]


def prepare(job: Job, part: Part | None = None, cell: Cell | None = None) -> PreparedJob:
    """Return a job with its drawing and cell read; `part`, `cell` where they are already.

    Raises
    ------
    InputError
        The drawing or the cell cannot be read, a loop does not exist, contours cannot be sampled;
        with a line for each of them.
    """
    part = part or job.read_part()
    tasks = job.tasks(part)  # a misspelt name shall not wait for the cell
    requests, faults = list[CutRequest](), list[InputError]()
    try:
        cell = cell_of_job(job, part) if cell is None else cell
    except InputError as fault:
        faults.append(fault)
    for task in tasks:
        try:
            requests.append(_request(job, task, part))
        except InputError as fault:
            faults.append(fault)
    if faults:
        raise all_of(faults)
    return PreparedJob.of(job, part, cell, requests)


def _request(job: Job, task: ContourSpec, part: Part) -> CutRequest:
    loop = task.drawn(part)
    paths = task.candidates(part, loop)
    task, closer = _within_tolerances(job, task, paths)
    candidates = tuple(Candidate.at(task.speed, path, task.sample(path)) for path in paths)
    if task.rounded is not None:
        candidates = tuple(
            replace(each, unrounded=sharp)
            for each, sharp in zip(candidates, task.unrounded(part, loop), strict=True)
        )
    return CutRequest(
        task=task,
        loop=loop,
        candidates=candidates,
        options=task.asked(job.options),
        closer=closer,
    )


def _within_tolerances(
    job: Job, task: ContourSpec, paths: Sequence[Contour]
) -> tuple[ContourSpec, str]:
    """Return the task with nodes as near to each other as the audit asks for, and what changed.

    A number of nodes that the job says is kept, and so are nodes that are divided later.
    """
    if task.count is not None or job.options.refine_parts > 1:
        return task, ""
    finer = closer_nodes(task, paths, job.tolerances)
    if finer is None or finer is task:
        return task, ""
    key = task.sampled_by
    asked, used = (getattr(each.table, key) for each in (task, finer))
    return finer, (
        f"{key} = {used:.3g} in place of {asked:g}, as what lies between its nodes keeps the "
        "tolerances of [audit] only so"
    )


def divide_nodes(path: Contour, nodes: Contour, parts: int) -> Contour:
    """Return the nodes of a path that divide every interval between `nodes` into parts."""
    k = np.arange(len(nodes))
    s = np.interp(np.arange(k[-1] * parts + 1) / parts, k, nodes.s)
    return replace(path.at_nodes(s), name=nodes.name)
