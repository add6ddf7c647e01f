"""The Pareto set of a contour: its runs, and the edits that make the plan of one the job's."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from time import perf_counter
from typing import Literal, NamedTuple

import moocore
import numpy as np

from kerfpath._arrays import Array
from kerfpath.errors import InputError
from kerfpath.front import AHEAD, Criterion, Evaluation, FrontSearch, Subproblem
from kerfpath.job import CutResult, Job, PreparedJob
from kerfpath.plans import Plan
from kerfpath.studio._decide_messages import (
    AxisEntry,
    CandidateMessage,
    FrontMessage,
    PointEntry,
)
from kerfpath.studio._messages import EditEntry
from kerfpath.studio._numbers import Message
from kerfpath.studio._plan_entry import plan_message
from kerfpath.studio._work import Newest, Seldom, Stop
from kerfpath.study import problem_of_job

__all__ = ["Fronts"]

SHOWN_EVERY = 0.25
"""Least time between two messages about new points, s."""
Say = Callable[[Message], None]
State = Literal["running", "done", "stopped"]


class _Point(NamedTuple):
    """A run that has a plan, with its losses."""

    number: int
    run: Subproblem
    losses: Array
    plan: Plan
    seconds: float


class _Study(NamedTuple):
    """The points of one contour at one revision of the job."""

    revision: int
    prepared: PreparedJob
    cut: CutResult
    criteria: tuple[Criterion, ...]
    points: dict[int, _Point]
    total: int


class Fronts:
    """Searches for the Pareto set of the contour that was requested last.

    Parameters
    ----------
    say : callable
        Takes messages, from any thread.
    failed : callable
        Takes the exception of a failed search; called in its thread.
    """

    def __init__(self, say: Say, failed: Callable[[BaseException], None]) -> None:
        self._say = say
        self._work = Newest("front", failed)
        self._study: _Study | None = None

    def look(
        self, prepared: PreparedJob, cut: CutResult, names: Sequence[str], runs: int, revision: int
    ) -> None:
        """Start the search for the set of a contour; it replaces a running search."""
        self._work.ask(partial(self._look, prepared, cut, names, runs, revision))

    def cancel(self) -> None:
        """Stop the search; the points that were found stay."""
        self._work.cancel()

    def close(self) -> None:
        """Stop the search, and end the thread."""
        self._work.close()

    def candidate(self, contour: str, number: int, graph: str) -> CandidateMessage:
        """Return the motion of a point.

        Raises
        ------
        InputError
            There is no such point.
        """
        study = self._study
        point = None if study is None else study.points.get(number)
        if study is None or point is None or study.cut.contour != contour:
            raise InputError("point: there is no such point any more; search for the set again")
        said = plan_message(
            replace(study.cut, plan=point.plan),
            point.plan,
            revision=study.revision,
            graph=graph,
            pieces=1,
            settled=True,
            audited=False,
            seconds=point.seconds,
        )
        return CandidateMessage(contour=contour, number=number, plan=said)

    def _look(
        self,
        prepared: PreparedJob,
        cut: CutResult,
        names: Sequence[str],
        runs: int,
        revision: int,
        stop: Stop,
    ) -> None:
        """Do the runs one after the other; send each point when it is found."""
        problem = problem_of_job(prepared.job, prepared.part, cut.contour, names, prepared.cell)
        study = _Study(revision, prepared, cut, problem.criteria, {}, runs)
        self._study, seldom = study, Seldom(SHOWN_EVERY)
        self._say(_message(study, 0, "running"))
        done = 0

        def submit(number: int, run: Subproblem) -> Callable[[], Evaluation | str]:
            nonlocal done
            stop.check()
            begun = perf_counter()
            made = problem.solve(run, first=number == 0)
            found: Evaluation | str = made if isinstance(made, str) else problem.evaluate(made)
            done += 1
            if isinstance(found, Evaluation) and not isinstance(made, str):
                seconds = perf_counter() - begun
                study.points[number] = _Point(number, run, found.losses, made, seconds)
            if seldom.may():
                self._say(_message(study, done, "running"))
            return lambda: found

        try:
            FrontSearch(problem, runs=runs, search="adaptive", seed=0, ahead=AHEAD).run(submit)
        finally:
            if self._study is study:
                self._say(_message(study, done, "done" if done == runs else "stopped"))


def _message(study: _Study, done: int, state: State) -> FrontMessage:
    """Return the message about the points found so far."""
    points = list(study.points.values())
    best = np.zeros(0, dtype=bool)
    if points:
        best = moocore.is_nondominated(np.array([point.losses for point in points]))
    sense = np.array([axis.sense for axis in study.criteria])
    return FrontMessage(
        revision=study.revision,
        contour=study.cut.contour,
        axes=[
            AxisEntry(
                name=axis.name,
                words=axis.words,
                unit=axis.unit,
                better="more" if axis.more_is_better else "less",
            )
            for axis in study.criteria
        ],
        points=[
            PointEntry(
                number=point.number,
                values=(sense * point.losses).tolist(),
                best=bool(kept),
                edits=_edits(point.run, study.prepared.job),
            )
            for point, kept in zip(points, best, strict=True)
        ],
        done=done,
        total=study.total,
        state=state,
    )


def _edits(run: Subproblem, job: Job) -> list[EditEntry] | None:
    """Return the edits that make the plan of a run the job's; None if the job has no keys for them.

    A job has no keys for windows of joints, or for a clearance of a single contour.
    """
    if run.windowed(job.robot.endless) or run.clearance:
        return None
    asked: dict[str, object] = {
        "objective": run.objective,
        "metric": run.metric,
        "weights": [float(f"{weight:.12g}") for weight in run.weights],
        "eta_velocity": run.eta_v,
        "eta_acceleration": run.eta_a,
        "method": "continuous" if run.continuous else "exact",
        "refine": False,
    }
    return [EditEntry(path=["plan", key], value=value) for key, value in asked.items()]
