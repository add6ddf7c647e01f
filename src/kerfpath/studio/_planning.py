"""The planning of a session, in separate threads: first a draft, then a complete run."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from threading import Event
from typing import NamedTuple

from kerfpath.cad import Part
from kerfpath.compiling import FOR_BOUNDS
from kerfpath.contour import Contour
from kerfpath.errors import InputError, KerfpathError
from kerfpath.graph import LayeredGraph
from kerfpath.job import (
    CutResult,
    Job,
    JobResult,
    PreparedJob,
    all_of,
    foresee,
    is_compiled,
    warm_up,
)
from kerfpath.plans import Plan
from kerfpath.studio._asks import FrontOf, LayoutOf, PointOf
from kerfpath.studio._bench import Bench
from kerfpath.studio._clearance import clearance_message
from kerfpath.studio._clock import cycle_of, program_message
from kerfpath.studio._decide_messages import CandidateMessage
from kerfpath.studio._exports import exports_of
from kerfpath.studio._fastest import fastest_message
from kerfpath.studio._front import Fronts
from kerfpath.studio._keys import motion_key, part_key, setup_key
from kerfpath.studio._layout import Layouts
from kerfpath.studio._loops import part_message
from kerfpath.studio._map import map_id
from kerfpath.studio._messages import (
    ClearanceMessage,
    ErrorMessage,
    OutcomeMessage,
    ProgressMessage,
    SceneMessage,
)
from kerfpath.studio._numbers import Message
from kerfpath.studio._run import Run, drafts_of
from kerfpath.studio._scene import Meshes, scene_of, scene_of_robot, tables_of
from kerfpath.studio._work import Newest, Stop, said_of

__all__ = ["Outcome", "Planning"]

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
        self._bench = Bench()
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
        return prepared, cuts, *self._bench.whole(prepared.job, cuts)

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

    def front(self, ask: FrontOf, revision: int) -> None:
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

    def look(self, ask: LayoutOf, revision: int) -> None:
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

    def candidate(self, ask: PointOf) -> CandidateMessage:
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
            prepared = self._bench.prepared(job)
        except InputError as fault:
            self._refused(fault, revision)
            self._say(ProgressMessage(busy=False))
            return
        stop.check()
        self._bench.begin()
        self.prepared = prepared
        self._show_scene(prepared, revision)
        self._ready(prepared, revision)
        kinematics = prepared.job.robot.kinematics
        if not is_compiled(kinematics):
            self._say(ProgressMessage(busy=True, label="compiling the kernels, first run only"))
            warm_up(kinematics, later=FOR_BOUNDS)
        run = Run(self._bench, prepared, revision, self._say, stop)
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
        part = self._bench.part(job)
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
