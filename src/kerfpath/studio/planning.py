"""The planning of a session, in separate threads: first a draft, then a complete run."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from threading import Event
from time import perf_counter
from typing import NamedTuple

from kerfpath.cad import Part
from kerfpath.compiling import LATER
from kerfpath.contour import Contour
from kerfpath.errors import InputError, KerfpathError, NoFeasiblePath
from kerfpath.graph import LayeredGraph
from kerfpath.job import (
    Candidate,
    CutRequest,
    CutResult,
    Job,
    JobResult,
    PreparedJob,
    advised,
    all_of,
    certified,
    cut_candidate,
    fastest_along,
    foresee,
    is_compiled,
    measured,
    moved_into_reach,
    order_cuts,
    warm_up,
)
from kerfpath.planner import at_most, warm_start
from kerfpath.plans import Plan
from kerfpath.studio.cache import (
    PROVING,
    ResultCache,
    cut_key,
    motion_key,
    part_key,
    setup_key,
)
from kerfpath.studio.entries import (
    alternatives,
    clearance_message,
    no_path_message,
    part_message,
    plan_message,
)
from kerfpath.studio.messages import (
    CandidateMessage,
    CandidateRequest,
    ClearanceMessage,
    EditEntry,
    ErrorMessage,
    FastestMessage,
    FrontRequest,
    LayoutRequest,
    Message,
    OutcomeMessage,
    PlanMessage,
    ProgressMessage,
    SceneMessage,
)
from kerfpath.studio.pose_map import map_id
from kerfpath.studio.program import cycle_of, exports_of, program_message
from kerfpath.studio.scene import Meshes, scene_of, scene_of_robot, tables_of
from kerfpath.studio.studies import Fronts, Layouts
from kerfpath.studio.work import Newest, Seldom, Stop, said_of
from kerfpath.study.placing import placement_of

# -----------------------------------------------------------------------------
# The fastest constant speed of a contour, as an edit of the job.


def fastest_message(
    prepared: PreparedJob, contour: str, index: int, revision: int
) -> FastestMessage:
    """Return the fastest constant speed of a contour, and the limit that binds.

    Parameters
    ----------
    prepared : PreparedJob
    contour : str
        Name of the contour.
    index : int
        Index of its [[contour]] table in the job.
    revision : int
        Revision of the job.

    Raises
    ------
    NoFeasiblePath
        The contour cannot be cut at any speed.
    """
    job = prepared.job
    request = next(each for each in prepared.contours if each.task.name == contour)
    nodes = request.candidates[0].nodes
    leaves = job.options.refine or job.options.method == "continuous"
    try:
        own = replace(job, options=request.options)
        found = fastest_along(own, nodes, prepared.cell, refine=leaves)
    except NoFeasiblePath as broken:
        raise broken.with_message(f"{contour}: no speed is feasible: {broken}") from None
    speed = float(at_most(found.speed * 60))
    place = " ".join(f"{mm:.1f}" for mm in (nodes.points[found.node] * 1e3).tolist())
    return FastestMessage(
        revision=revision,
        contour=contour,
        speed_m_min=speed,
        on_grid_m_min=None if found.on_grid is None else float(at_most(found.on_grid * 60)),
        binds=f"the {found.limit} of {job.robot.joint_names[found.joint]} at node {found.node}, "
        f"{place} mm",
        edits=[EditEntry(path=["contour", index, "speed_m_min"], value=speed)],
    )


# -----------------------------------------------------------------------------
# The run of a job in the studio: it sends the result of each contour and can be stopped.

Say = Callable[[Message], None]
SHOWN_EVERY = 0.1
"""Least time between two progress messages, s."""


class Run:
    """One run of a job; each result is sent and kept as soon as it is there.

    Parameters
    ----------
    cache : ResultCache
    prepared : PreparedJob
    revision : int
        Revision of the job.
    say : callable
        Takes messages.
    stop : Stop
    """

    def __init__(
        self, cache: ResultCache, prepared: PreparedJob, revision: int, say: Say, stop: Stop
    ) -> None:
        self._cache, self._prepared, self._revision = cache, prepared, revision
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
                far = cuts[i].lacks_poses and cuts[i].advice is None
                self._broken(cuts[i], settled=not far)
            elif cuts[i].request.options.certify is not None:
                cuts[i] = self._proved(cuts[i])
                self._plan(cuts[i], _of_same(cuts, cuts[i]), settled=True)
        if any(cut.lacks_poses for cut in cuts):
            self.progress("looking for a move of the part into reach", 0, 0)
            moves = moved_into_reach(self._prepared, cuts)
            for i, cut in enumerate(cuts):
                if cut.lacks_poses and cut.advice is None:
                    cuts[i] = replace(cut, advice=moves.get(cut.contour))
                    self._broken(cuts[i], settled=True)
        self._stop.check()
        return measured(self._prepared, result.with_cuts(tuple(cuts)))

    def _candidate(
        self, request: CutRequest, number: int, candidate: Candidate
    ) -> tuple[CutResult, ...]:
        key = f"{cut_key(self._prepared.job, request)} {number}"
        found = self._cache.cuts.get(key)
        if found is None:
            found = cut_candidate(
                self._prepared, request, candidate, self.progress, graph_of=self._cache.graph
            )
            self._cache.cuts.put(key, found)
        self._stop.check()
        # The requested proof and the index of the table may have changed.
        return tuple(replace(cut, request=request) for cut in found)

    def _proved(self, cut: CutResult) -> CutResult:
        made = cut.plan
        assert made is not None
        source = self._prepared.job.source.get("plan", {})
        asked = sorted((k, source[k]) for k in PROVING if k in source)
        key = f"{cut_key(self._prepared.job, cut.request)} {asked} {hash(made.q.tobytes())}"
        found = self._cache.proved.get(key)
        if found is None:
            found = certified(cut, self.progress)
            self._cache.proved.put(key, found)
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
        _, graph = self._cache.whole(self._prepared.job, pieces)
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
        relaxations = None
        if settled:
            where = placement_of(self._prepared)
            relaxations = alternatives(cut, self._tables[cut.contour], where)
        self._say(
            no_path_message(
                cut,
                self._prepared.job.placement,
                revision=self._revision,
                graph=map_id(cut.graph),
                relaxations=relaxations,
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
    if not spec.speed:  # that of its program, which is read with the new job
        return None
    slower = task.speed / spec.speed
    made = warm_start(before, spec.asked(job.options), dt=cut.candidate.dt * slower)
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


# -----------------------------------------------------------------------------
# The planning of a session, in separate threads: first a draft, then a complete run.

PATIENCE = 0.3
"""Time without a change after which a run begins while a draft is shown, s."""


class Outcome(NamedTuple):
    """The result of a revision of the job; `settled` is False while bounds are being computed."""

    revision: int
    result: JobResult
    settled: bool


class Planning:
    """Plans the newest job, and keeps intermediate results for the next one.

    Parameters
    ----------
    say : callable
        Takes messages, from any thread.
    ready : callable
        Takes each job that has been prepared, and its revision; from any thread.
    refused : callable
        Takes the error of an invalid job, and its revision; from any thread.

    Attributes
    ----------
    meshes : Meshes
        Meshes of the scene.
    prepared : PreparedJob or None
        The job that was prepared last.
    cuts : dict of str to tuple of CutResult
        Results of each contour, by its name.
    revisions : dict of str to int
        Revision of the job that each contour was planned for, or an earlier one.
    result : Outcome or None
        Result of the job that was planned last.
    layouts : Layouts
        Placements of the part.
    """

    def __init__(
        self,
        say: Callable[[Message], None],
        ready: Callable[[PreparedJob, int], None],
        refused: Callable[[InputError, int], None],
    ) -> None:
        self._say, self._ready, self._refused = say, ready, refused
        self._cache = ResultCache()
        self._runs = Newest("run", self._failed)
        self._drafts = Newest("draft", self._failed)
        self._speeds = Newest("speed", self._failed)
        self._fronts = Fronts(say, self._failed)
        self.layouts = Layouts(say, self._failed)
        self._before: tuple[str, dict[str, Plan]] = ("", {})
        """Where drafts start: a `motion_key`, and the plans of contours for it."""
        self._scene, self._looked = "", ""
        self._clearances: dict[str, ClearanceMessage] = {}
        self._part: tuple[str, Part] | None = None
        self.meshes = self._shown = Meshes()
        self.prepared: PreparedJob | None = None
        self.cuts: dict[str, tuple[CutResult, ...]] = {}
        self.revisions: dict[str, int] = {}
        self.result: Outcome | None = None

    def take(self, job: Job, revision: int, first: str | None) -> None:
        """Plan a job in place of any other, the contour `first` before the others."""
        for each in (self._fronts, self._speeds, self.layouts):
            each.cancel()
        hurry = Event()
        if first is not None and motion_key(job) == self._before[0] and first in self._before[1]:
            self._drafts.ask(partial(self._draft, job, revision, first, hurry))
        else:
            self._drafts.cancel()
            hurry.set()
        self._runs.ask(partial(self._run, job, revision, first, hurry))

    def whole(
        self, contour: str
    ) -> tuple[PreparedJob, tuple[CutResult, ...], Contour, LayeredGraph]:
        """Return the results of a contour, with the nodes and the graph of all of it.

        Raises
        ------
        InputError
            The contour is not planned yet.
        """
        cuts, prepared = self.cuts.get(contour), self.prepared
        if cuts is None or prepared is None:
            raise InputError(f"contour {contour!r:.60} is not planned yet; wait until it is")
        return prepared, cuts, *self._cache.whole(prepared.job, cuts)

    def fastest(self, contour: str, revision: int) -> None:
        """Search for the fastest constant speed of a contour.

        Raises
        ------
        InputError
            There is no such contour.
        """
        prepared = self.prepared
        if prepared is None or contour not in prepared.names:
            raise InputError(f"contour {contour!r:.60} is not known; wait until the job is read")
        index = tables_of(prepared)[prepared.names.index(contour)]

        def work(stop: Stop) -> None:
            self._say(ProgressMessage(busy=True, label=f"{contour}: fastest speed"))
            try:
                found: Message = fastest_message(prepared, contour, index, revision)
            except KerfpathError as error:
                found = ErrorMessage(message=str(error), about="fastest")
            stop.check()
            self._say(found)
            self._say(ProgressMessage(busy=False))

        self._speeds.ask(work)

    def front(self, ask: FrontRequest, revision: int) -> None:
        """Search for the Pareto set of a contour.

        Raises
        ------
        InputError
            The current job is not planned yet.
        """
        planned = self.result
        cuts = self.cuts.get(ask.contour)
        if planned is None or planned.revision != revision or self.prepared is None or not cuts:
            raise InputError("front: the current job is not planned yet; wait until it is")
        self._fronts.look(self.prepared, cuts[0], ask.criteria, ask.runs, revision)

    def look(self, ask: LayoutRequest, revision: int) -> None:
        """Search for the best placement.

        Raises
        ------
        InputError
            The current job is not planned yet.
        """
        planned = self.result
        if planned is None or planned.revision != revision or self.prepared is None:
            raise InputError("layout: the current job is not planned yet; wait until it is")
        self.layouts.look(self.prepared, ask, revision)

    def candidate(self, ask: CandidateRequest) -> CandidateMessage:
        """Return the motion of a point of the Pareto set.

        Raises
        ------
        InputError
            There is no such point, or the contour is not planned.
        """
        _, _, _, graph = self.whole(ask.contour)
        return self._fronts.candidate(ask.contour, ask.number, map_id(graph))

    def cancel(self) -> None:
        """Stop all running work."""
        for each in (self._drafts, self._runs, self._speeds, self._fronts, self.layouts):
            each.cancel()
        self._say(ProgressMessage(busy=False))

    def close(self) -> None:
        """Stop all work, and end the threads."""
        for each in (self._drafts, self._runs, self._speeds, self._fronts, self.layouts):
            each.close()

    def _draft(self, job: Job, revision: int, contour: str, hurry: Event, stop: Stop) -> None:
        """Send a motion near the previous one, if there is one."""
        key, plans = self._before
        found = drafts_of(job, self.cuts[contour][0], plans[contour], revision)
        stop.check()
        if found is None or not self._is_clear(found[0]):
            hurry.set()
            return
        made, message = found
        if self._before[0] == key:
            plans[contour] = made
        self._say(message)

    def _is_clear(self, made: Plan) -> bool:
        """Return whether a motion is free of collisions; True without a cell."""
        cell = None if self.prepared is None else self.prepared.cell
        return cell is None or bool(cell.clear_through(made.unwrapped))

    def _run(self, job: Job, revision: int, first: str | None, hurry: Event, stop: Stop) -> None:
        """Plan a job, from reading its drawing to the bounds of its plans."""
        waited = 0.0
        while waited < PATIENCE and not hurry.is_set():
            stop.rest(PATIENCE / 20)
            waited += PATIENCE / 20
        self._say(ProgressMessage(busy=True, label="reading the drawing"))
        try:
            if self.prepared is None:
                self._show(*scene_of_robot(job, revision))
            self._show_part(job, revision)
            prepared = self._cache.prepared(job)
        except InputError as fault:
            self._refused(fault, revision)
            self._say(ProgressMessage(busy=False))
            return
        stop.check()
        self._cache.begin()
        self.prepared = prepared
        self._show_scene(prepared, revision)
        self._ready(prepared, revision)
        kinematics = prepared.job.robot.kinematics
        if not is_compiled(kinematics):
            self._say(ProgressMessage(busy=True, label="compiling the kernels, first run only"))
            warm_up(kinematics, later=LATER)
        run = Run(self._cache, prepared, revision, self._say, stop)
        tried = run.contours(first, partial(self._took, motion_key(job), revision))
        self._look_ahead(prepared, revision, run)
        self._settle(run.ordered(tried), revision, settled=False)
        assert self.result is not None
        self._measure(self.result, stop)
        self._settle(run.settled(self.result.result, first), revision, settled=True)
        self._say(ProgressMessage(busy=False))

    def _settle(self, result: JobResult, revision: int, *, settled: bool) -> None:
        """Keep and send the result of a revision."""
        self.result = Outcome(revision, result, settled)
        self._say(_outcome(result, revision, settled=settled))

    def _measure(self, found: Outcome, stop: Stop) -> None:
        """Send the distances along the plans, if there is a cell."""
        cell, known = found.result.cell, self._clearances
        self._clearances = {}
        if cell is None:
            return
        setup = setup_key(found.result.job)
        self._say(ProgressMessage(busy=True, label="distances in the cell"))
        for cut in found.result.cuts:
            if cut.plan is None:
                continue
            key = f"{setup} {cut.plan.name} {hash(cut.plan.q.tobytes())}"
            made = known.get(key) or clearance_message(cell, cut, found.revision, stop)
            if made is None:
                continue
            self._clearances[key] = made.model_copy(update={"revision": found.revision})
            self._say(self._clearances[key])

    def _look_ahead(self, prepared: PreparedJob, revision: int, run: Run) -> None:
        """Send the errors that forbid a program whatever the plans are, once per setup."""
        setup = setup_key(prepared.job)
        if setup == self._looked:
            return
        run.progress("checking the job for its program", 0, 0)
        if found := foresee(prepared):
            self._refused(all_of(found), revision)
        self._looked = setup

    def _took(self, key: str, revision: int, contour: str, cuts: tuple[CutResult, ...]) -> None:
        """Keep the results of a contour."""
        if self._before[0] != key:
            self._before = key, {}
        self.cuts[contour] = cuts
        self.revisions[contour] = revision  # set after the cuts, so that it is never newer
        made = cuts[0].plan
        if len(cuts) == 1 and made is not None:
            self._before[1][contour] = made
        else:
            self._before[1].pop(contour, None)

    def _show_scene(self, prepared: PreparedJob, revision: int) -> None:
        """Send the scene, unless it is unchanged."""
        setup = setup_key(prepared.job)
        if setup == self._scene:
            return
        scene, meshes = scene_of(prepared, revision)
        self.layouts.stands(prepared, revision)
        self._show(scene, meshes)
        self._scene = setup
        known = set(prepared.names)
        self.cuts = {name: cuts for name, cuts in self.cuts.items() if name in known}

    def _show_part(self, job: Job, revision: int) -> None:
        """Send the loops that can be picked, unless they are unchanged."""
        part = self._cache.part(job)
        key = f"{part_key(job)} {job.placement.tolist()}"
        # Keep it before sending: a page may ask for a loop as soon as it knows of it.
        before, self._part = self._part, (key, part)
        if before is None or before[0] != key:
            self._say(part_message(job, part, revision))

    def known_part(self) -> Part:
        """Return the content of the drawing.

        Raises
        ------
        InputError
            The drawing is not read yet.
        """
        if self._part is None:
            raise InputError("the drawing is not read yet; wait until its loops are shown")
        return self._part[1]

    def _show(self, message: SceneMessage, meshes: Meshes) -> None:
        # A page may still ask for meshes of the previous scene.
        self.meshes = Meshes({**self._shown, **meshes})
        self._shown = meshes
        self._say(message)

    def _failed(self, error: BaseException) -> None:
        """Send the error of a thread."""
        self._say(ErrorMessage(message=said_of(error)))
        self._say(ProgressMessage(busy=False))


def _outcome(result: JobResult, revision: int, *, settled: bool) -> OutcomeMessage:
    """Return the message about the result of a run."""
    notes = [] if result.stuck is None else [f"Transfer moves: {result.stuck}"]
    notes += [f"Transfer moves: {c.issue()}" for c in result.air if not c.ok]
    return OutcomeMessage(
        revision=revision,
        passed=result.passed,
        exports=exports_of(result, settled=settled),
        cycle=cycle_of(program_message(result, revision)),
        notes=notes,
    )
