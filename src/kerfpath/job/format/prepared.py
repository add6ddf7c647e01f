"""Prepare a job: read its drawing and cell, and list the ways to cut each contour."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import repeat

import numpy as np

from kerfpath.arrays import short_repr
from kerfpath.auditor import Check
from kerfpath.cad import Part
from kerfpath.cell import (
    Cell,
)
from kerfpath.contour import Contour, angle_between
from kerfpath.errors import InputError
from kerfpath.front import Subproblem
from kerfpath.job.format.cell import cell_of_job
from kerfpath.job.format.contour import ContourSpec
from kerfpath.job.format.process import contours_of, sheet_of, with_cuts, with_small_holes
from kerfpath.job.format.reading import Job
from kerfpath.job.format.tables import ProgramTable
from kerfpath.job.format.tables.job import Tolerances
from kerfpath.job.format.tables.process import NORMAL
from kerfpath.job.format.toml_file import all_of
from kerfpath.operations import edge, nearest, quick_turns
from kerfpath.options import PlanOptions
from kerfpath.planner import node_interval
from kerfpath.sequence import inner_first
from kerfpath.tolerances import SAME_PLACE

# -----------------------------------------------------------------------------
# Sample contours finely enough to keep the tolerances of the audit between the nodes.

MOST_TIMES = 8
"""Largest factor on the number of nodes that was asked for."""
KEPT = 0.9
"""Share of a tolerance that finer sampling aims at, as the curvature varies along a contour."""
BEND_STEP = np.radians(10.0)
"""Largest turn (rad) of the tool axis between two nodes in a bend. The head turns about the beam on
the way, too, so the axis does not turn quite evenly."""
LEAST, MOST = 0.2, 0.9
"""Least and largest factor on the distance between nodes in one step."""


def closer_nodes(
    task: ContourSpec, paths: Sequence[Contour], tolerances: Tolerances
) -> ContourSpec | None:
    """Return the task with its nodes close enough to keep the tolerances.

    This is the task itself if its nodes are close enough. Nodes at the ends of bends come before
    nodes that are closer together. If the tool axis turns too fast for its tolerance, only the
    tolerance of the path is kept; None if that is impossible, too.

    Parameters
    ----------
    task : ContourSpec
    paths : sequence of Contour
        The paths to sample.
    tolerances : Tolerances
    """
    if all(_excess(path, task.sample(path), tolerances) <= 1 for path in paths):
        return task
    at_bends = task
    if task.sampled_by in ("spacing_mm", "time_step_ms"):
        at_bends = replace(task, bend_ends=any(len(path.bend_ends) for path in paths))
    return (
        _closer(at_bends, paths, tolerances)
        or _closer(task, paths, tolerances)
        or _closer(task, paths, replace(tolerances, axis=np.inf))
    )


def chord_error(path: Contour, nodes: Contour) -> float:
    """Return the largest distance (m) of a path's own points from the chords of its nodes."""
    return _between(path, nodes)[0]


def _closer(
    task: ContourSpec, paths: Sequence[Contour], tolerances: Tolerances
) -> ContourSpec | None:
    times = 1.0
    while times < MOST_TIMES:
        try:
            nodes = [task.sample(path) for path in paths]
            excess = max(map(_excess, paths, nodes, repeat(tolerances)))
            if task.bend_ends:
                step = max(float(angle_between(n.axes[1:], n.axes[:-1]).max()) for n in nodes)
                excess = max(excess, (step / BEND_STEP) ** 2)
        except InputError:
            return None
        if excess <= 1:
            return task
        # The chord error grows with the square of the chord length.
        share = float(np.clip(np.sqrt(KEPT / excess), LEAST, MOST))
        task, times = task.finer(share), times / share
    return None


def _excess(path: Contour, nodes: Contour, tolerances: Tolerances) -> float:
    off, turned = _between(path, nodes)
    return max(off / tolerances.path, turned / tolerances.axis)


def _between(path: Contour, nodes: Contour) -> tuple[float, float]:
    """Return the largest errors between nodes: of the path's points (m) and of its axes (rad).

    Along a chord the tip moves straight and the axis turns evenly, as in a linear robot motion.
    """
    k = np.clip(np.searchsorted(nodes.s, path.s, side="right") - 1, 0, len(nodes) - 2)
    start, chord = nodes.points[k], np.diff(nodes.points, axis=0)[k]
    part = ((path.points - start) * chord).sum(axis=1) / (chord**2).sum(axis=1)
    part = np.clip(part, 0.0, 1.0)[:, None]
    off = np.linalg.norm(path.points - start - part * chord, axis=1)
    axes = (1 - part) * nodes.axes[k] + part * nodes.axes[k + 1]
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    turned = 2 * np.arcsin(np.clip(np.linalg.norm(axes - path.axes, axis=1) / 2, 0.0, 1.0))
    return float(off.max()), float(turned.max())


# -----------------------------------------------------------------------------
# Prepare a job: read its drawing and cell, and list the ways to cut each contour.

SHORTER = 0.1
"""Share of its length by which chords may be shorter than a path of which they sample all."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Candidate:
    """One way to cut a contour.

    Parameters
    ----------
    path : Contour
        The path to cut with its operations (leads, micro joints, ...), part frame.
    nodes : Contour
        The path sampled as the job says: points, axes, kinds, speed shares and arc lengths.
    speed : float m/s, optional
        Speed along the path; None if the nodes carry their own times.
    unrounded : Contour, optional
        The path before its corners were rounded; None without rounding.
    rounded : float m, optional
        Distance of the rounded corners from the drawn ones.
    """

    path: Contour
    nodes: Contour
    speed: float | None = None
    unrounded: Contour | None = None
    rounded: float | None = None

    __repr__ = short_repr

    @classmethod
    def at(cls, speed: float, path: Contour, nodes: Contour) -> Candidate:
        """Return the candidate with nodes of a path; `speed` (m/s) unless they carry times."""
        return cls(path=path, nodes=nodes, speed=speed if nodes.time is None else None)

    @property
    def dt(self) -> float:
        """Time from node to node at the requested speed, s."""
        return node_interval(self.nodes, self.speed)

    def drawing_checks(self, nodes: Contour, path: float) -> list[Check]:
        """Return the check of rounded corners against the drawing; empty without such corners.

        Parameters
        ----------
        nodes : Contour
            The nodes that are cut; nothing is checked unless they sample the complete path.
        path : float m
            Tolerance of the chords between nodes from the path.
        """
        rounded, sharp = self.rounded, self.unrounded
        whole = abs(nodes.length - self.path.length) <= SHORTER * self.path.length
        if rounded is None or sharp is None or not whole:
            return []
        drawn = edge(sharp).points
        where, k = nearest(edge(nodes), drawn)
        off = np.linalg.norm(where - drawn, axis=1)
        worst = int(np.argmax(off))
        return [
            Check(
                code="drawing",
                title=f"distance of the drawing from the chords of the nodes, corners rounded by "
                f"{rounded * 1e3:g} mm",
                value=float(off[worst]),
                limit=max(rounded, path) + SAME_PLACE,
                unit="m",
                node=int(k[worst]),
                advice="lower round_mm in [contour.corners], or sample the contour more finely",
            )
        ]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CutRequest:
    """The request to cut one contour: the ways to cut it and the options of its plan.

    Parameters
    ----------
    task : ContourSpec
        The contour as the job describes it.
    loop : Contour
        The loop as drawn, part frame.
    candidates : tuple of Candidate
        The ways to cut it, of which one is chosen.
    options : PlanOptions
        Options of its plan.
    run : Subproblem or None
        The run of a Pareto set that the plan follows, with its windows and clearance.
    touched_up : bool
        Whether targets of the path were moved by hand.
    closer : str
        Note on nodes that are closer together than the job says, and why; "" if they are not.
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
        """Whether points or tool axes of the cut differ from the drawn loop."""
        return self.touched_up or self.task.table.moves_the_path

    def picked(self, run: Subproblem, *, refine: bool) -> CutRequest:
        """Return the request for the first candidate, planned as a run of a Pareto set."""
        mine = self.options
        options = run.applied_to(replace(mine, feed="constant", refine=refine))
        if run.continuous:  # such a run keeps the job's shares of the limits
            options = replace(options, eta_v=mine.eta_v, eta_a=mine.eta_a)
        return replace(self, candidates=self.candidates[:1], options=options, run=run)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PreparedJob:
    """A job with its drawing and cell read, ready to run and to audit plans and programs against.

    Parameters
    ----------
    job : Job
    part : Part
    cell : Cell or None
    contours : tuple of CutRequest
        The contours, in the order of the job or in the order of cutting.
    inner_first : tuple of (int, int)
        Pairs of contours (from 0) of which the first is to be cut before the second.
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
        """Return the job with these contours; their nesting follows from their loops."""
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
    """Return a job with its drawing and cell read; `part` and `cell` if they are read already.

    Raises
    ------
    InputError
        The drawing or the cell cannot be read, a loop does not exist, or contours cannot be
        sampled; the error has a line for each problem.
    """
    part = part or job.read_part()
    tasks = job.tasks(part)  # first, so that a misspelt name is reported before the cell is read
    job = _with_techniques(job, tasks)
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


def _with_techniques(job: Job, tasks: Sequence[ContourSpec]) -> Job:
    """Return the job with the options that its contours have by their techniques."""
    normal, small = job.source.get("process", {}).get("technique", NORMAL), job.small_holes
    cut_by = {task.name: task.table.technique or normal for task in tasks}
    source, program = job.source, job.program
    if small is not None and (taken := _small_holes(job, tasks)):
        source = with_small_holes(job.path, job.text, source, small, taken)
        table = ProgramTable.model_validate(source.get("program", {}))
        program = table.resolve(program.name, job.tolerances.path, sheet_of(source))
    source = with_cuts(source, cut_by)
    return replace(job, source=source, program=replace(program, contours=contours_of(source)))


def _small_holes(job: Job, tasks: Sequence[ContourSpec]) -> dict[int, list[str]]:
    """Return the names of the small holes of each table that has one, by its number from 0."""
    number = {id(spec.small.table): k for k, spec in enumerate(job.contours) if spec.small}
    found: dict[int, list[str]] = {}
    for task in tasks:
        if task.by_size:
            found.setdefault(number[id(task.table)], []).append(task.name)
    return found


def _request(job: Job, task: ContourSpec, part: Part) -> CutRequest:
    loop = task.drawn(part)
    paths = task.candidates(part, loop)
    slow = _slow_at_edges(task, part, paths[0])
    task, closer = _within_tolerances(job, task, paths)
    candidates = tuple(Candidate.at(task.speed, path, task.sample(path)) for path in paths)
    if task.rounded is not None:
        candidates = tuple(
            replace(each, unrounded=sharp, rounded=task.rounded)
            for each, sharp in zip(candidates, task.unrounded(part, loop), strict=True)
        )
    return CutRequest(
        task=task,
        loop=loop,
        candidates=candidates,
        options=task.asked(job.options),
        closer="; ".join(filter(None, (slow, closer))),
    )


def _within_tolerances(
    job: Job, task: ContourSpec, paths: Sequence[Contour]
) -> tuple[ContourSpec, str]:
    """Return the task with nodes close enough for the tolerances of the audit, and notes on it.

    A number of nodes (`count`) is kept, and so are nodes that are divided later (refine_parts).
    """
    if job.options.refine_parts > 1:
        return task, ""
    notes: list[str] = []
    finer = None if task.count is not None else closer_nodes(task, paths, job.tolerances)
    finer = finer or task
    key = task.sampled_by
    off, allowed = max(_between(path, finer.sample(path))[1] for path in paths), job.tolerances.axis
    if finer is not task:
        asked, used = (getattr(each.table, key) for each in (task, finer))
        said = f"{key} = {used:.3g} is used in place of {asked:g}" if used != asked else ""
        if finer.bend_ends:
            said += f"{', with nodes' if said else 'nodes are'} at the ends of bends, too"
        kept = "the tolerances" if off <= allowed else "path_tolerance_mm"
        notes.append(f"{said}, so that the path between its nodes keeps {kept} of [audit]")
    if off > allowed:
        notes.append(
            f"between its nodes the tool axis is up to {np.degrees(off):.1f} deg from that of the "
            f"path, with axis_tolerance_deg = {np.degrees(allowed):g} in [audit]; change {key}, or "
            "turn the beam more slowly (edge_turn_mm in [part], [contour.smooth_axes])"
        )
    return finer, "; ".join(notes)


def _slow_at_edges(task: ContourSpec, part: Part, path: Contour) -> str:
    """Return a note on the speed where the beam turns about sharp edges, "" if it is not lower."""
    if task.turn_step is None:
        return ""
    share = quick_turns(path, task.edges(part), distance=part.edge_turn, step=task.turn_step)[1]
    if not share.size:
        return ""
    return (
        f"the speed falls to {share.min():.0%} where the beam turns about sharp edges, as nodes "
        f"follow the turn; a smaller {task.sampled_by} or a larger edge_turn_mm in [part] keeps "
        "more of it"
    )


def divide_nodes(path: Contour, nodes: Contour, parts: int) -> Contour:
    """Return the nodes of a path that divide every interval between `nodes` into parts."""
    k = np.arange(len(nodes))
    s = np.interp(np.arange(k[-1] * parts + 1) / parts, k, nodes.s)
    return replace(path.at_nodes(s), name=nodes.name)
