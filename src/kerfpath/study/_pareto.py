"""The Pareto set of a contour of a job, every run a task of a sweep."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from kerfpath._told import told
from kerfpath.auditor import Check
from kerfpath.cell import Cell
from kerfpath.contour import Contour
from kerfpath.errors import InputError, NoFeasiblePath
from kerfpath.front import (
    AHEAD,
    Attempts,
    Collection,
    Front,
    Judge,
    Reached,
    Run,
    RunData,
    Search,
    judge_of,
    reach_of,
)
from kerfpath.job import Job, cell_of_job
from kerfpath.plans import Plan
from kerfpath.progress import Progress, no_progress
from kerfpath.study._job import Loaded, digest, loaded
from kerfpath.sweep import Result, Sweep

__all__ = ["Studied", "pareto_of_job"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Studied:
    """The front of a contour of a job.

    Parameters
    ----------
    job : Job
    digest : str
        Hash of the job and its files.
    contour : str
    others : tuple of str
        The other contours of the job.
    front : Front
    """

    job: Job
    digest: str
    contour: str
    others: tuple[str, ...]
    front: Front

    __repr__ = told


def pareto_of_job(
    job_file: Path,
    *,
    store: Path,
    contour: str | None = None,
    criteria: Sequence[str] = ("displacement", "velocity", "range"),
    runs: int = 100,
    search: Search = "adaptive",
    seed: int = 0,
    ahead: int = AHEAD,
    scheduler: str | None = None,
    processes: int | None = None,
    progress: Progress = no_progress,
) -> Studied:
    """Return the front of a contour; what is in the store already is not done again.

    Parameters
    ----------
    job_file : Path
    store : Path
        Of the sweep, see `kerfpath.sweep.run`.
    contour : str, optional
        Name; default: the longest.
    criteria, runs, search, seed, ahead
        As in `kerfpath.pareto`; "time" starts from home_deg of the job's [sequence].
    scheduler, processes, progress
        As in `kerfpath.sweep.run`.

    Raises
    ------
    NoFeasiblePath
        No run has a plan; says why not.
    InputError
        As `read_job`, `kerfpath.pareto` and `kerfpath.sweep.run`; a contour that is not in the job.
    """
    whole = digest(job_file)
    here = str(job_file.resolve())
    known = loaded(here, whole)
    name, others = _picked(known, contour)
    stage = _stage(here, whole, name, tuple(criteria))
    collection = Collection(
        stage.attempts,
        judge=stage.judge,
        runs=runs,
        search=search,
        seed=seed,
        ahead=ahead,
    )
    with Sweep(
        attempt,
        store=store,
        scheduler=scheduler,
        processes=processes,
        progress=progress,
        total=collection.runs,
    ) as sweep:
        first = True

        def submit(run: Run) -> Callable[[], Reached | str]:
            nonlocal first
            key = sweep.submit(
                job=here,
                digest=whole,
                contour=name,
                criteria=list(criteria),
                run=run.data(),
                first=first,
            )
            first = False
            return lambda: _settled(sweep.result(key))

        collection.gather(submit)
    return Studied(
        job=known.job, digest=whole, contour=name, others=others, front=collection.result()
    )


def attempt(
    *,
    job: str,
    digest: str,
    contour: str,
    criteria: Sequence[str],
    run: RunData,
    first: bool,
) -> dict[str, Any]:
    """Do one run: return the losses of its plan and the reach of its joints, or why there is none.

    Raises
    ------
    NoFeasiblePath
        The `first` run, which has all that is allowed, has no path.
    """
    stage = _stage(job, digest, contour, tuple(criteria))
    made = (stage.attempts.first if first else stage.attempts.of)(Run.of_data(run))
    if isinstance(made, str):
        return {"why": made}
    return {"losses": stage.judge.losses(made).tolist(), "reach": reach_of(made).tolist()}


def _settled(result: Result) -> Reached | str:
    failure = result.failure
    if failure is None:
        found: dict[str, Any] = result.value
        if "why" in found:
            return str(found["why"])
        return np.array(found["losses"]), np.array(found["reach"])
    if failure.kind == "NoFeasiblePath":
        raise NoFeasiblePath(failure.message, proved=False, node=-1)
    if failure.kind == "InputError":
        raise InputError(failure.message)
    return failure.reason


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Stage:
    """What the runs of a contour have in common."""

    attempts: Attempts
    judge: Judge


@lru_cache(maxsize=2)
def _stage(path: str, digest_then: str, contour: str, criteria: tuple[str, ...]) -> _Stage:
    known = loaded(path, digest_then)
    job, part = known.job, known.part
    task = next(task for task in job.tasks(part) if task.name == contour)
    drawn = task.candidates(part)[0]
    nodes = task.sample(drawn)
    cell = cell_of_job(job, part)
    options = replace(job.options, feed="constant", refine=False)
    home = None if job.sequence is None else job.sequence.home_deg
    judge = judge_of(
        criteria,
        job.robot,
        eta_v=options.eta_v,
        eta_a=options.eta_a,
        cell=cell,
        comfort=options.comfort,
        home=None if home is None else np.radians(home),
    )
    attempts = Attempts(
        contour=nodes,
        robot=job.robot,
        tool=job.tool,
        placement=job.placement,
        speed=task.speed if nodes.time is None else None,
        options=options,
        graph=job.graph(nodes),
        cell=cell,
        audit=lambda made: _faults(job, drawn, made, cell),
    )
    return _Stage(attempts=attempts, judge=judge)


def _faults(job: Job, drawn: Contour, made: Plan, cell: Cell | None) -> list[Check]:
    table = job.tolerances.checks(made, reference=drawn, cell=cell)
    return [check for check in table if check.level == "error" and not check.ok]


def _picked(known: Loaded, contour: str | None) -> tuple[str, tuple[str, ...]]:
    """Return the name of the contour, the longest if none is named, and those of the others."""
    tasks = {task.name: task for task in known.job.tasks(known.part)}
    if contour is None:
        contour = max(tasks, key=lambda name: tasks[name].drawn(known.part).length)
    elif contour not in tasks:
        raise InputError(
            f"{known.job.path}: expected the name of a contour of the job, got {contour!r}; it has "
            f"{', '.join(tasks)}"
        )
    return contour, tuple(name for name in tasks if name != contour)
