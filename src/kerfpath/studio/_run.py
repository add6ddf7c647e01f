"""The run of a job in the studio: it sends the result of each contour and can be stopped."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from time import perf_counter

from kerfpath.job import (
    Candidate,
    CutRequest,
    CutResult,
    Job,
    JobResult,
    PreparedJob,
    advised,
    certified,
    cut_candidate,
    measured,
    order_cuts,
)
from kerfpath.planner import draft
from kerfpath.plans import Plan
from kerfpath.studio._bench import Bench
from kerfpath.studio._clock import program_message
from kerfpath.studio._keys import PROVING, cut_key
from kerfpath.studio._map import map_id
from kerfpath.studio._messages import PlanMessage, ProgressMessage
from kerfpath.studio._numbers import Message
from kerfpath.studio._plan_entry import no_path_message, plan_message
from kerfpath.studio._scene import tables_of
from kerfpath.studio._ways import ways_of
from kerfpath.studio._work import Seldom, Stop

__all__ = ["Run", "drafts_of"]

Say = Callable[[Message], None]
SHOWN_EVERY = 0.1
"""Least time between two progress messages, s."""


class Run:
    """One run of a job; each result is sent and kept as soon as it is there.

    Parameters
    ----------
    bench : Bench
    prepared : PreparedJob
    revision : int
        Revision of the job.
    say : callable
        Takes messages.
    stop : Stop
    """

    def __init__(
        self, bench: Bench, prepared: PreparedJob, revision: int, say: Say, stop: Stop
    ) -> None:
        self._bench, self._prepared, self._revision = bench, prepared, revision
        self._say, self._stop, self._seldom = say, stop, Seldom(SHOWN_EVERY)
        self._tables = dict(zip(prepared.names, tables_of(prepared), strict=True))
        self._seconds: dict[str, float] = {}

    def progress(self, what: str, done: int, total: int, /) -> None:
        """Take the progress of the work, and stop it if requested.

        Raises
        ------
        Superseded
            The run is asked to stop.
        """
        self._stop.check()
        if self._seldom.may():
            self._say(ProgressMessage(busy=True, label=what, done=done, total=total))

    def contours(
        self, first: str | None, took: Callable[[str, tuple[CutResult, ...]], None]
    ) -> list[list[tuple[CutResult, ...]]]:
        """Plan and audit every contour, `first` before the others; return each candidate's cuts.

        `took` takes the name of each contour and its cuts that are shown.

        Raises
        ------
        Superseded
            Something else has been requested meanwhile.
        """
        requests = list(self._prepared.contours)
        tried: dict[str, list[tuple[CutResult, ...]]] = {}
        for request in sorted(requests, key=lambda each: each.task.name != first):
            begun, name = perf_counter(), request.task.name
            tried[name] = [
                self._candidate(request, number, candidate)
                for number, candidate in enumerate(request.candidates)
            ]
            self._seconds[name] = perf_counter() - begun
            shown = next((c for c in tried[name] if all(cut.passed for cut in c)), tried[name][0])
            # Call this first: a page asks for the map as soon as it gets a plan.
            took(name, shown)
            self._show(shown)
        return [tried[request.task.name] for request in requests]

    def ordered(self, tried: Sequence[Sequence[tuple[CutResult, ...]]]) -> JobResult:
        """Order the cuts, plan the transfer moves, and send the program.

        Raises
        ------
        Superseded
            Something else has been requested meanwhile.
        """
        result = order_cuts(self._prepared, tried, self.progress)
        self._stop.check()
        if result.part is not None:  # turns of joints and chosen candidates may differ now
            self._show(result.cuts)
        self._say(program_message(result, self._revision))
        return result

    def settled(self, result: JobResult, first: str | None) -> JobResult:
        """Prove the requested bounds, and search for changes that make missing paths.

        Raises
        ------
        Superseded
            Something else has been requested meanwhile.
        """
        cuts = list(result.cuts)
        for i in sorted(range(len(cuts)), key=lambda i: cuts[i].contour != first):
            if cuts[i].plan is None:
                cuts[i] = advised(self._prepared, cuts[i], self.progress)
                self._broken(cuts[i], settled=True)
            elif cuts[i].request.options.certify is not None:
                cuts[i] = self._proved(cuts[i])
                self._plan(cuts[i], _of_same(cuts, cuts[i]), settled=True)
        self._stop.check()
        return measured(self._prepared, result.with_cuts(tuple(cuts)))

    def _candidate(
        self, request: CutRequest, number: int, candidate: Candidate
    ) -> tuple[CutResult, ...]:
        key = f"{cut_key(self._prepared.job, request)} {number}"
        found = self._bench.cuts.get(key)
        if found is None:
            found = cut_candidate(
                self._prepared, request, candidate, self.progress, graph_of=self._bench.graph
            )
            self._bench.cuts.put(key, found)
        self._stop.check()
        # The requested proof and the index of the table may have changed.
        return tuple(replace(cut, request=request) for cut in found)

    def _proved(self, cut: CutResult) -> CutResult:
        made = cut.plan
        assert made is not None
        source = self._prepared.job.source.get("plan", {})
        asked = sorted((k, source[k]) for k in PROVING if k in source)
        key = f"{cut_key(self._prepared.job, cut.request)} {asked} {hash(made.q.tobytes())}"
        found = self._bench.proved.get(key)
        if found is None:
            found = certified(cut, self.progress)
            self._bench.proved.put(key, found)
        return replace(found, request=cut.request)

    def _show(self, cuts: Sequence[CutResult]) -> None:
        for cut in cuts:
            if cut.plan is None:
                self._broken(cut, settled=False)
            else:
                done = cut.request.options.certify is None
                self._plan(cut, _of_same(cuts, cut), settled=done)

    def _plan(self, cut: CutResult, pieces: Sequence[CutResult], *, settled: bool) -> None:
        assert cut.plan is not None
        _, graph = self._bench.whole(self._prepared.job, pieces)
        self._say(
            plan_message(
                cut,
                cut.plan,
                revision=self._revision,
                graph=map_id(graph),
                pieces=len(pieces),
                settled=settled,
                audited=True,
                seconds=self._seconds.get(cut.contour, 0.0),
            )
        )

    def _broken(self, cut: CutResult, *, settled: bool) -> None:
        ways = ways_of(cut, self._tables[cut.contour]) if settled else None
        self._say(
            no_path_message(
                cut,
                self._prepared.job.placement,
                revision=self._revision,
                graph=map_id(cut.graph),
                ways=ways,
            )
        )


def _of_same(cuts: Sequence[CutResult], cut: CutResult) -> list[CutResult]:
    """Return the cuts of one contour."""
    return [other for other in cuts if other.contour == cut.contour]


def drafts_of(
    job: Job, cut: CutResult, before: Plan, revision: int
) -> tuple[Plan, PlanMessage] | None:
    """Return a motion near the previous one that satisfies the new job; None if there is none.

    Parameters
    ----------
    job : Job
        The new job, with other weights, limits, metric, objective or speed than before.
    cut : CutResult
        The previous result of the contour.
    before : Plan
        The motion to start from: that of the cut, or a later draft.
    revision : int
        Revision of the job.
    """
    begun, task = perf_counter(), cut.request.task
    specs = {spec.name: spec for spec in job.contours if spec.table.pick_all is None}
    # A contour of a `pick_all` table keeps its old request: no draft if the windows have changed.
    spec = specs.get(task.name, task)
    windows = {each.windows for each in job.contours if each.table.pick_all is not None}
    if spec is task and windows - {task.windows}:
        return None
    slower = task.speed / spec.speed
    made = draft(before, spec.asked(job.options), dt=cut.candidate.dt * slower)
    if made is None:
        return None
    message = plan_message(
        replace(cut, plan=made),
        made,
        revision=revision,
        graph=map_id(cut.graph),
        pieces=1,
        settled=False,
        audited=False,
        seconds=perf_counter() - begun,
    )
    return made, message
