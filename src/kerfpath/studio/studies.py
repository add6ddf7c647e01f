"""Searches over many plans: the Pareto set of a contour, and other placements of the part."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from os import cpu_count
from time import perf_counter
from typing import Literal, NamedTuple

import moocore
import numpy as np

from kerfpath.arrays import Array
from kerfpath.errors import InputError
from kerfpath.files import scratch_folder
from kerfpath.front import AHEAD, Criterion, Evaluation, FrontSearch, Subproblem
from kerfpath.job import CutResult, Job, PreparedJob
from kerfpath.plans import Plan
from kerfpath.report.layout import WORDS
from kerfpath.studio.document import Change, with_values
from kerfpath.studio.entries import plan_message
from kerfpath.studio.messages import (
    AxisEntry,
    CandidateMessage,
    EditEntry,
    FrontMessage,
    LayoutMessage,
    LayoutRequest,
    Message,
    OutOfReach,
    Place,
    PointEntry,
    ReachMessage,
    ReachRequest,
    TryEntry,
    flat,
)
from kerfpath.studio.work import Newest, Seldom, Stop
from kerfpath.study import job_key, problem_of_job
from kerfpath.study.placing import (
    Layout,
    Placement,
    PlacementTrial,
    changes_of,
    contours_of,
    layout_as,
    middle_of,
    nodes_of,
    placed_text,
    placement_of,
)

# -----------------------------------------------------------------------------
# The Pareto set of a contour: its runs, and the edits that make the plan of one the job's.

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


class _FrontStudy(NamedTuple):
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
        self._study: _FrontStudy | None = None

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
        study = _FrontStudy(revision, prepared, cut, problem.criteria, {}, runs)
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


def _message(study: _FrontStudy, done: int, state: State) -> FrontMessage:
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


# -----------------------------------------------------------------------------
# Other placements of the part: the test of reach, and the search for the best one.

SHOWN = 20
"""Number of placements that a page gets, the best first."""


class Layouts:
    """Tests reach at placements and searches for the best one; only the newest request counts.

    Parameters
    ----------
    say : callable
        Takes messages, from any thread.
    failed : callable
        Takes the exception of failed work; called in its thread.
    """

    def __init__(self, say: Say, failed: Callable[[BaseException], None]) -> None:
        self._say = say
        self._search = Newest("layout", failed)
        self._hand = Newest("reach", failed)
        self._study: _LayoutStudy | None = None
        self._stands: tuple[int, PreparedJob] | None = None

    def stands(self, prepared: PreparedJob, revision: int) -> None:
        """Take the job of the scene that is sent now; offsets refer to it."""
        self._stands = revision, prepared

    def reach(self, ask: ReachRequest, answer: Say) -> None:
        """Answer which nodes are out of reach, unless a newer question comes first.

        Raises
        ------
        InputError
            There is no scene yet.
        """
        revision, prepared = self._there()

        def work(stop: Stop) -> None:
            at = placement_of(prepared)
            found = at.out_of_reach(ask.offsets)
            stop.check()
            answer(
                ReachMessage(
                    revision=revision,
                    number=ask.number,
                    middle=flat(at.middle),
                    contours=[
                        OutOfReach(
                            name=request.task.name,
                            nodes=len(request.candidates[0].nodes),
                            out=out.tolist(),
                        )
                        for request, out in zip(at.requests, found, strict=True)
                    ],
                )
            )

        self._hand.ask(work)

    def placed(self, ask: Place) -> list[Change]:
        """Return the changes of the job that apply offsets.

        Raises
        ------
        InputError
            There is no scene, or it has changed since.
        """
        scene, prepared = self._there()
        if scene != ask.scene:
            raise InputError("place: the scene has changed meanwhile; repeat the move")
        return _changes(placement_of(prepared), ask.offsets)

    def look(self, prepared: PreparedJob, ask: LayoutRequest, revision: int) -> None:
        """Start the search for the best placement; it replaces a running search."""
        self._search.ask(partial(self._look, prepared, ask, revision))

    def changes(self, number: int, revision: int) -> list[Change]:
        """Return the changes of the job that apply a placement that was tried.

        Raises
        ------
        InputError
            There is no such placement, it is not feasible, or the job has changed since.
        """
        study = self._study
        if study is None or study.revision != revision or number >= len(study.trials):
            raise InputError("take: there is no such placement any more; search again")
        why = study.trials[number].result.infeasibility
        if why is not None:
            raise InputError(f"take: the placement is infeasible: {why.reason}; take another one")
        return _changes(study.placement, study.trials[number].offsets)

    def cancel(self) -> None:
        """Stop the search; the placements that it found stay."""
        self._search.cancel()

    def close(self) -> None:
        """Stop all work, and end the threads."""
        self._search.close()
        self._hand.close()

    def _there(self) -> tuple[int, PreparedJob]:
        if self._stands is None:
            raise InputError("the job is not read yet; wait until its part is shown")
        return self._stands

    def _look(self, prepared: PreparedJob, ask: LayoutRequest, revision: int, stop: Stop) -> None:
        """Search on a copy of the job, as the job itself may be saved meanwhile."""
        study: _LayoutStudy | None = None
        try:
            with scratch_folder() as folder:
                job = folder / "job.toml"
                text = placed_text(prepared.job, {}, folder, "a copy")
                if ask.grid:
                    text = with_values(text, [(("plan", "method"), "exact")])
                job.write_text(text, encoding="utf-8")
                nodes = nodes_of(contours_of(**job_key(job)))
                at = Placement(
                    job=prepared.job,
                    requests=tuple(prepared.contours),
                    middle=middle_of(prepared.job, nodes),
                )
                study = self._study = _LayoutStudy(at, ask, revision, self._say, stop)
                table = prepared.job.layout.model_copy(
                    update={"goal": ask.goal, "evaluations": ask.evaluations, "map_points": 0}
                )
                found = layout_as(
                    job,
                    table,
                    store=folder / "store.sqlite",
                    ranges=ask.ranges,
                    processes=max(1, (cpu_count() or 1) - 1),
                    progress=study.progress,
                    found=study.found,
                )
                study.say("done", found)
        finally:
            if study is not None and study.state == "running":
                study.say("stopped")


class _LayoutStudy:
    """The placements that one search has tried so far."""

    def __init__(
        self, placement: Placement, ask: LayoutRequest, revision: int, say: Say, stop: Stop
    ) -> None:
        self.placement, self.revision = placement, revision
        self.trials: list[PlacementTrial] = []
        self.state: State = "running"
        self._numbers: dict[PlacementTrial, int] = {}
        self._ask, self._say, self._stop = ask, say, stop
        self._seldom, self._at = Seldom(SHOWN_EVERY), ("", 0, 0)

    def progress(self, what: str, done: int, total: int, /) -> None:
        """Take the progress of the search, and stop it if requested.

        Raises
        ------
        Superseded
            The search is asked to stop.
        """
        self._stop.check()
        self._at = what, done, total
        if self._seldom.may():
            self.say("running")

    def found(self, trial: PlacementTrial) -> None:
        """Take a placement that is new or of which more is known."""
        if trial not in self._numbers:
            self._numbers[trial] = len(self.trials)
            self.trials.append(trial)

    def say(self, state: State, end: Layout | None = None) -> None:
        """Send the state of the search."""
        self.state = state
        label, done, total = self._at
        self._say(
            LayoutMessage(
                revision=self.revision,
                goal=self._ask.goal,
                grid=self._ask.grid,
                unit=WORDS[self._ask.goal],
                best=[self._entry(trial) for trial in sorted(self.trials, key=self._rank)[:SHOWN]],
                tried=len(self.trials),
                feasible=sum(trial.result.feasible for trial in self.trials),
                label=label,
                done=done,
                total=total,
                state=state,
                said="" if end is None else _said(end),
            )
        )

    def _rank(self, trial: PlacementTrial) -> tuple[int, float]:
        """Return a sort key: planned placements first, then estimates, then infeasible ones."""
        result, sign = trial.result, 1 if self._ask.goal == "motion" else -1
        if result.infeasibility is not None:
            return 2, -result.infeasibility.progress
        if result.value is not None:
            return 0, sign * result.value
        return 1, 0.0 if result.promise is None else sign * result.promise

    def _entry(self, trial: PlacementTrial) -> TryEntry:
        result = trial.result
        part, rest = self.placement.motions(trial.offsets)
        return TryEntry(
            number=self._numbers[trial],
            offsets=dict(trial.offsets),
            status=result.status,
            stage=result.stage,
            value=result.value,
            bound=result.bound,
            estimate=result.estimate,
            reason=None if result.infeasibility is None else result.infeasibility.reason,
            part=flat(part),
            rest=flat(rest),
        )


def _said(end: Layout) -> str:
    """Return in words what is known of the placements other than the best one."""
    if end.best is None:
        why = end.nearest.result.infeasibility
        return "No placement is feasible" + (f"; the nearest fails: {why.reason}" if why else "")
    if end.proved:
        return "Proved: no other placement that was tried is better."
    count = f"{end.estimated} of the placements that were tried"
    return f"{count} were judged by an estimate alone, which proves nothing."


def _changes(placement: Placement, offsets: Mapping[str, float]) -> list[Change]:
    """Return the changes of the job that apply offsets."""
    return list(changes_of(placement.job, placement.numbers(offsets)))
