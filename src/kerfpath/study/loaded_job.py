"""The job of a study: the same for every worker, its robot evaluated on its contours."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from pathlib import Path

import numpy as np

from kerfpath.arrays import Ints, short_repr
from kerfpath.cad import Part
from kerfpath.cell import Cell, CollisionChecker
from kerfpath.contour import Contour, FrameKind
from kerfpath.errors import InputError
from kerfpath.graph import LayeredGraph
from kerfpath.job import Job, cell_of_job, fastest_along, places_of, read_job
from kerfpath.options import PlanOptions
from kerfpath.planner import (
    FastestSpeed,
    longest_step,
    node_interval,
    require_rates_alone,
)
from kerfpath.sweep import UnfitWorker

# -----------------------------------------------------------------------------
# The job of a study: loaded by every worker, and checked to be the same everywhere.


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LoadedJob:
    """A job and its part, read from the drawing."""

    job: Job
    part: Part

    __repr__ = short_repr


def job_key(path: Path) -> dict[str, str]:
    """Return the parameters of `load_job` for a job file: its resolved path and its digest.

    Raises
    ------
    InputError
        As `digest_of`.
    """
    path = path.resolve()
    return {"job": str(path), "digest": digest_of(path)}


def digest_of(path: Path) -> str:
    """Return the SHA-256 hash of a job file and of every file that it names.

    Raises
    ------
    InputError
        As `read_job`; also where a file cannot be read.
    """
    job = read_job(path)
    rows = job.source.get("process")  # of charts, which may be in the user's folder
    whole = hashlib.sha256(b"" if rows is None else repr(rows).encode())
    for file in _files(job):
        try:
            whole.update(hashlib.sha256(file.read_bytes()).digest())
        except OSError as error:
            raise InputError(f"{file}: cannot be read ({error.strerror})") from None
    return whole.hexdigest()


def _files(job: Job) -> Iterator[Path]:
    yield job.path
    for text in _texts(job.source):
        if "\n" not in text and (file := job.path.parent / text).is_file():
            yield file
    meshes = {body.path for body in job.robot.bodies if body.path is not None}
    yield from sorted(meshes)


def _texts(value: object) -> Iterator[str]:
    """Yield all texts in a tree of plain data, in order."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, list | dict):
        for each in value.values() if isinstance(value, dict) else value:
            yield from _texts(each)


@lru_cache(maxsize=2)
def load_job(job: str, digest: str) -> LoadedJob:
    """Return a job and its part, cached for the next task of a worker.

    Parameters
    ----------
    job : str
        The job file, at the same path on every worker.
    digest : str
        The `digest_of` the job where the study was started.

    Raises
    ------
    UnfitWorker
        The files on this worker differ or are missing.
    """
    try:
        here = digest_of(Path(job))
    except InputError as error:
        raise UnfitWorker(
            f"{error}; every worker needs the job and its files at the same path"
        ) from None
    if here != digest:
        raise UnfitWorker(
            f"{job}: this job or a file that it names has changed since the study began, or "
            "differs on this worker; start the study again"
        )
    read = read_job(job)
    return LoadedJob(job=read, part=read.read_part())


# -----------------------------------------------------------------------------
# Evaluate the robot of a job on its contours: reachable nodes, clear poses and fastest speeds.
#
# Both studies that change a job use this: one changes the robot, the other the placement.

EVERY = 8
"""Spacing, in nodes, of the nodes that are checked for a clear pose."""
TRIED = 8
"""Number of poses of a node that are checked at once for a clear one."""
STEPS = (np.radians(90.0), np.radians(15.0))
"""rad: steps of gamma tried before that of the job; most nodes are reached with the first."""
MOST_POSES = 2_000_000
"""Number of poses that are solved together at most."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SampledContour:
    """The nodes of a contour of a job, and the speed (m/s) that the job asks for."""

    name: str
    nodes: Contour
    speed: float

    __repr__ = short_repr

    @property
    def interval(self) -> float:
        """Time from node to node (s) at the speed asked for."""
        return node_interval(self.nodes, self.speed if self.nodes.time is None else None)

    def stretch(self, first: int, last: int, frames: FrameKind, *, timed: bool) -> SampledContour:
        """Return the stretch from node `first` to node `last`, all steps taking the same time.

        With `timed`, each step takes the interval of the contour at the speed asked for. Otherwise
        each step has the length of the contour's longest step, so that speeds found for the stretch
        are comparable to those of the contour.
        """
        run = self.nodes.part(first, last, frames)
        run = replace(run, time=None, speed_share=np.ones(len(run)))
        if timed:
            return replace(self, nodes=run, speed=float(np.diff(run.s).max()) / self.interval)
        step = longest_step(self.nodes)
        return replace(self, nodes=replace(run, s=np.arange(len(run), dtype=float) * step))


def sample_contours(job: Job, part: Part) -> tuple[SampledContour, ...]:
    """Return the contours of a job, sampled as they are planned.

    Raises
    ------
    InputError
        A contour has windows of gamma, which these studies do not support.
    """
    for number, contour in enumerate(job.contours):
        if contour.windows:
            raise InputError(
                f"{job.path}: contour.{number}.gamma_windows: this study does not support windows "
                "of gamma; remove them in a copy of the job"
            )
    return tuple(
        SampledContour(
            name=task.name,
            nodes=task.sample(task.candidates(part)[0]),
            speed=task.speed,
        )
        for task in job.tasks(part)
    )


@dataclass(kw_only=True, eq=False)
class Evaluator:
    """Evaluates the robot of a job by searches on the job's grid, without penalties."""

    job: Job
    part: Part

    __repr__ = short_repr

    def __post_init__(self) -> None:
        require_rates_alone(self.job.robot, "a study of places or robots")
        self.job.robot.require_no_free_joint("a study of places or robots")

    @cached_property
    def cell(self) -> Cell | None:
        """The cell of the job; None where it has none.

        Raises
        ------
        InputError
            The cell is not valid.
        """
        return cell_of_job(self.job, self.part)

    def graph(self, nodes: Contour, only: Ints | None = None) -> LayeredGraph:
        """Return the layered graph of nodes with margins but without penalties."""
        return self.job.graph(nodes, self.job.options.without_penalties, only=only)

    def blocked(self, graph: LayeredGraph, step: int = 1) -> Iterator[int]:
        """Yield the layers without a clear pose among every `step`-th layer."""
        if self.cell is None:
            return
        checker = CollisionChecker(self.cell, graph.q)
        for layer in range(0, len(graph.start) - 1, step):
            poses = np.arange(graph.start[layer], graph.start[layer + 1])
            rounds = max(1, len(poses) // TRIED)
            # Spread over the layer, as neighbours collide together.
            parts = (poses[r::rounds] for r in range(rounds))
            if not any(np.isfinite(checker.price(part)).any() for part in parts):
                yield layer

    def fastest(
        self,
        nodes: Contour,
        graph: LayeredGraph | None,
        *,
        off_grid: bool = False,
        enough: float | None = None,
    ) -> FastestSpeed:
        """Return the fastest constant speed on the grid or off it, clear in the cell.

        Without a graph, external axes start from the gentlest course. Off the grid, a speed of
        `enough` (m/s) or more may be returned although faster ones exist.

        Raises
        ------
        NoFeasiblePath
            There is no path on the grid at any speed.
        """
        return fastest_along(
            self.job, nodes, self.cell, refine=off_grid, graph=graph, enough=enough
        )


def out_of_reach(job: Job, nodes: Contour, options: PlanOptions) -> Ints:
    """Return the nodes without a pose, with external axes sampled on a coarse grid."""
    places = places_of(job, nodes)
    left = np.arange(len(nodes))
    for step in (*(step for step in STEPS if step > options.gamma_step), options.gamma_step):
        each = job.robot.postures * 2 * np.pi / step * (1 if places is None else places.shape[1])
        parts = np.array_split(left, int(len(left) * each / MOST_POSES) + 1)
        sampled = replace(options, gamma_step=step)
        graphs = (job.graph(nodes, sampled, only=p, external=places) for p in parts if p.size)
        empty = [np.diff(graph.start) == 0 for graph in graphs]
        left = left[np.concatenate(empty)] if empty else left
    return left
