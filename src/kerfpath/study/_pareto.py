"""The Pareto front of a contour of a job; every run is a task of a sweep."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import TypedDict

import numpy as np

from kerfpath._repr import short_repr
from kerfpath.auditor import Check
from kerfpath.cad import Part
from kerfpath.cell import Cell
from kerfpath.contour import Contour
from kerfpath.errors import InputError, NoFeasiblePath
from kerfpath.front import (
    AHEAD,
    Evaluation,
    Front,
    FrontSearch,
    ParetoProblem,
    SearchKind,
    Subproblem,
    SubproblemData,
    criteria_named,
    graph_of_runs,
)
from kerfpath.job import Job, cell_of_job
from kerfpath.plans import Plan
from kerfpath.progress import Progress, no_progress
from kerfpath.study._job import LoadedJob, digest, load_job
from kerfpath.sweep import Result, Sweep

__all__ = ["JobFront", "pareto_of_job", "problem_of_job"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class JobFront:
    """The Pareto front of a contour of a job.

    Parameters
    ----------
    job : Job
    digest : str
        Hash of the job and its files.
    contour : str
        Name of the contour.
    others : tuple of str
        Names of the other contours of the job.
    front : Front
    """

    job: Job
    digest: str
    contour: str
    others: tuple[str, ...]
    front: Front

    __repr__ = short_repr


def pareto_of_job(
    job_file: Path,
    *,
    store: Path,
    contour: str | None = None,
    criteria: Sequence[str] = ("displacement", "velocity", "range"),
    runs: int = 100,
    search: SearchKind = "adaptive",
    seed: int = 0,
    ahead: int = AHEAD,
    scheduler: str | None = None,
    processes: int | None = None,
    progress: Progress = no_progress,
) -> JobFront:
    """Return the Pareto front of a contour; runs that are in the store are not repeated.

    Parameters
    ----------
    job_file : Path
    store : Path
        Store of the sweep, see `kerfpath.sweep.run`.
    contour : str, optional
        Name of the contour; default: the longest.
    criteria, runs, search, seed, ahead
        As in `kerfpath.pareto`; "time" starts from home_deg in [sequence] of the job.
    scheduler, processes, progress
        As in `kerfpath.sweep.run`.

    Raises
    ------
    NoFeasiblePath
        No run has a plan; the message says why.
    InputError
        As `read_job`, `kerfpath.pareto` and `kerfpath.sweep.run`; also where the job has no such
        contour.
    """
    whole = digest(job_file)
    here = str(job_file.resolve())
    known = load_job(here, whole)
    name, others = _named_contour(known, contour)
    problem = _problem(here, whole, name, tuple(criteria))
    front_search = FrontSearch(problem, runs=runs, search=search, seed=seed, ahead=ahead)
    with Sweep(
        solve,
        store=store,
        scheduler=scheduler,
        processes=processes,
        progress=progress,
        total=front_search.runs,
    ) as sweep:

        def submit(number: int, run: Subproblem) -> Callable[[], Evaluation | str]:
            key = sweep.submit(
                job=here,
                digest=whole,
                contour=name,
                criteria=list(criteria),
                run=run.to_data(),
                first=number == 0,
            )
            return lambda: _evaluation(sweep.result(key))

        front = front_search.run(submit)
    return JobFront(job=known.job, digest=whole, contour=name, others=others, front=front)


class SolvedData(TypedDict, total=False):
    """The result of a run as JSON data: `why` it has no plan, or the evaluation of its plan."""

    why: str
    losses: list[float]
    spans: list[list[float]]


def solve(
    *,
    job: str,
    digest: str,
    contour: str,
    criteria: Sequence[str],
    run: SubproblemData,
    first: bool,
) -> SolvedData:
    """Do one run; this is the task of a sweep.

    Raises
    ------
    NoFeasiblePath
        The `first` run, which has the full limits, has no path.
    """
    problem = _problem(job, digest, contour, tuple(criteria))
    made = problem.solve(Subproblem.from_data(run), first=first)
    if isinstance(made, str):
        return {"why": made}
    found = problem.evaluate(made)
    return {"losses": found.losses.tolist(), "spans": found.spans.tolist()}


def _evaluation(result: Result) -> Evaluation | str:
    failure = result.failure
    if failure is None:
        found: SolvedData = result.value
        if "why" in found:
            return found["why"]
        return Evaluation(losses=np.array(found["losses"]), spans=np.array(found["spans"]))
    if failure.kind == "NoFeasiblePath":
        raise NoFeasiblePath(failure.message, proved=False, node=-1)
    if failure.kind == "InputError":
        raise InputError(failure.message)
    return failure.reason


@lru_cache(maxsize=2)
def _problem(path: str, digest_then: str, contour: str, criteria: tuple[str, ...]) -> ParetoProblem:
    """Return the problem that the runs of a contour share, cached for the next task of a worker."""
    known = load_job(path, digest_then)
    cell = cell_of_job(known.job, known.part)
    return problem_of_job(known.job, known.part, contour, criteria, cell)


def problem_of_job(
    job: Job, part: Part, contour: str, criteria: Sequence[str], cell: Cell | None
) -> ParetoProblem:
    """Return the problem that the runs of a contour of a job share.

    Parameters
    ----------
    job : Job
    part : Part
        The part of the job.
    contour : str
        Name of a contour of the job.
    criteria : sequence of str
        As in `kerfpath.pareto`.
    cell : Cell or None
        The cell of the job.

    Raises
    ------
    InputError
        A criterion is unknown, or something that it needs is missing.
    NoFeasiblePath
        No course of the external axes leads to a plan.
    """
    task = next(task for task in job.tasks(part) if task.name == contour)
    drawn = task.candidates(part)[0]
    nodes = task.sample(drawn)
    asked = task.asked(job.options)
    speed = task.speed if nodes.time is None else None
    if asked.method == "continuous":
        job.robot.require_no_free_joint("a Pareto set off the grid")
    options = replace(asked, feed="constant", refine=False, certify=None)
    return ParetoProblem(
        contour=nodes,
        robot=job.robot,
        tool=job.tool,
        placement=job.placement,
        speed=speed,
        options=options,
        criteria=criteria_named(criteria, job.robot, options=options, cell=cell, home=job.home),
        graph=graph_of_runs(
            nodes,
            job.robot,
            tool=job.tool,
            placement=job.placement,
            speed=speed,
            options=asked,
            cell=cell,
        ),
        cell=cell,
        home=job.home,
        audit=lambda made: _faults(job, drawn, made, cell),
    )


def _faults(job: Job, drawn: Contour, made: Plan, cell: Cell | None) -> list[Check]:
    table = job.tolerances.checks(made, reference=drawn, cell=cell)
    return [check for check in table if check.level == "error" and not check.ok]


def _named_contour(known: LoadedJob, contour: str | None) -> tuple[str, tuple[str, ...]]:
    """Return the name of the contour (default: the longest) and the names of the others."""
    tasks = {task.name: task for task in known.job.tasks(known.part)}
    if contour is None:
        contour = max(tasks, key=lambda name: tasks[name].drawn(known.part).length)
    elif contour not in tasks:
        raise InputError(
            f"{known.job.path}: expected the name of a contour of the job, got {contour!r}; its "
            f"contours: {', '.join(tasks)}"
        )
    return contour, tuple(name for name in tasks if name != contour)
