"""A session: one job that is edited, planned and shown; all open pages see the same state."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from functools import partial
from itertools import count
from pathlib import Path
from typing import NamedTuple, TypeVarTuple

from kerfpath.cad import SUFFIXES, unit_question
from kerfpath.cell import MESHES
from kerfpath.errors import InputError, KerfpathError
from kerfpath.files import write_whole
from kerfpath.job import (
    SOLIDS,
    TABLES,
    Drawing,
    FileTexts,
    Job,
    JobResult,
    PreparedJob,
    job_text,
    only_loops,
    program_texts,
    python_script,
    read_job,
    read_solid,
    result_texts,
    with_loops,
    without_contour,
)
from kerfpath.studio.document import Change, Document, KeptJobs, with_values
from kerfpath.studio.entries import faults_of, job_file, job_message
from kerfpath.studio.hub import Hub, Page
from kerfpath.studio.messages import (
    CandidateRequest,
    Command,
    ContourName,
    ContourRequest,
    CutLoops,
    Edit,
    Edits,
    ErrorMessage,
    Fault,
    FrontRequest,
    Keep,
    KeptCommand,
    LayoutRequest,
    MapMessage,
    Message,
    NoPathMessage,
    OptionsMessage,
    Place,
    PlanMessage,
    PoseMessage,
    PoseRequest,
    ProgramRequest,
    ReachRequest,
    Relax,
    RemoveContour,
    Rename,
    ReplaceText,
    Request,
    Save,
    SceneMessage,
    ShadeRequest,
    Take,
    TechniqueRequest,
)
from kerfpath.studio.options import options_message
from kerfpath.studio.planning import Outcome, Planning
from kerfpath.studio.pose_map import (
    map_message,
    pose_message,
    shade_message,
    shades_of,
    technique_message,
    with_collisions,
)
from kerfpath.studio.program import WAIT, File, in_language, program_text
from kerfpath.studio.scene import tables_of
from kerfpath.studio.work import Newest, Stop, said_of

# -----------------------------------------------------------------------------
# Answers to the read-only questions of pages about planned contours.


class Answers:
    """Answers the questions of pages about the current plans.

    Slow questions have a thread for each page and kind: a newer one stops the one before.

    Parameters
    ----------
    planning : Planning
    say : callable
        Takes the page and the answer, from any thread.
    failed : callable
        Takes the page, the kind of question and the exception; called in that thread.
    """

    def __init__(
        self,
        planning: Planning,
        say: Callable[[Page, Message], None],
        failed: Callable[[Page, str, BaseException], None],
    ) -> None:
        self._planning, self._say, self._failed = planning, say, failed
        self._work: dict[tuple[Page, str], Newest] = {}

    def map(self, contour: str, revision: int) -> MapMessage:
        """Return the map of a contour.

        Raises
        ------
        InputError
            The contour is not planned yet.
        """
        prepared, cuts, nodes, graph = self._planning.whole(contour)
        shades = shades_of(prepared.job, graph, prepared.cell)
        return map_message(
            cuts, nodes, graph, robot=prepared.job.robot, shades=shades, revision=revision
        )

    def pose(self, ask: PoseRequest) -> PoseMessage:
        """Return the joints of the robot at a place of a map.

        Raises
        ------
        InputError
            The contour is not planned yet, or the map has no such node or posture.
        """
        prepared, cuts, nodes, graph = self._planning.whole(ask.contour)
        K, _, postures = graph.reason.shape
        if not (ask.node < K and ask.posture < postures):
            raise InputError(
                f"reason: expected a node below {K} and a posture below {postures}, got "
                f"{ask.node} and {ask.posture}"
            )
        return pose_message(
            ask.contour, prepared.job, cuts, nodes, with_collisions(cuts[0], graph),
            node=ask.node, gamma=ask.gamma, posture=ask.posture,
        )  # fmt: skip

    def shade(self, page: Page, ask: ShadeRequest, revision: int) -> None:
        """Compute a quantity over a map; `by` None stops a running computation."""
        by = ask.by
        if by is None:
            self._cancel(page, ask.type)
            return

        def look(stop: Stop) -> Message:
            prepared, _, _, graph = self._planning.whole(ask.contour)
            return shade_message(
                ask.contour, prepared.job, graph, prepared.cell, by, revision=revision, stop=stop
            )

        self._ask(page, ask.type, look)

    def technique(self, page: Page, ask: TechniqueRequest) -> None:
        """Compute the course of another technique; `method` None stops a running computation."""
        method = ask.method
        if method is None:
            self._cancel(page, ask.type)
            return

        def look(stop: Stop) -> Message:
            revision = self._planning.revisions.get(ask.contour, 0)
            prepared, cuts, nodes, graph = self._planning.whole(ask.contour)
            return technique_message(prepared, cuts[0], nodes, graph, method, revision=revision)

        self._ask(page, ask.type, look)

    def leave(self, page: Page) -> None:
        """Stop the work of a page, and end its threads."""
        for key in [key for key in self._work if key[0] is page]:
            self._work.pop(key).close()

    def close(self) -> None:
        """Stop the work of all pages, and end the threads."""
        for page, _ in list(self._work):
            self.leave(page)

    def _ask(self, page: Page, kind: str, look: Callable[[Stop], Message]) -> None:
        if (page, kind) not in self._work:
            self._work[page, kind] = Newest(kind, partial(self._failed, page, kind))
        self._work[page, kind].ask(partial(self._answer, page, look))

    def _cancel(self, page: Page, kind: str) -> None:
        if (page, kind) in self._work:
            self._work[page, kind].cancel()

    def _answer(self, page: Page, look: Callable[[Stop], Message], stop: Stop) -> None:
        found = look(stop)
        stop.check()
        self._say(page, found)


# -----------------------------------------------------------------------------
# A filter that drops outdated messages of other threads and adds the previous cost to plans.


class _Cost(NamedTuple):
    """The cost of the plan of a revision, and of the previous revision."""

    revision: int
    cost: float
    before: float | None


class OutdatedFilter:
    """A filter that drops messages older than one that was sent."""

    def __init__(self) -> None:
        self._said: dict[tuple[str, str], tuple[int, bool]] = {}
        self._costs: dict[str, _Cost] = {}

    def of(self, message: Message) -> Message | None:
        """Return the message, a plan with its previous cost; None if a newer one was sent.

        A draft counts as older than the plan of a run of the same revision.
        """
        revision = getattr(message, "revision", None)
        if revision is None:
            return message
        kind, contour = str(getattr(message, "type", "")), getattr(message, "contour", None) or ""
        if isinstance(message, PlanMessage | NoPathMessage):
            kind = "course"
        full = not isinstance(message, PlanMessage) or message.checks is not None
        if self._said.get((kind, contour), (0, False)) > (revision, full):
            return None
        self._said[kind, contour] = revision, full
        return self._with_cost(message) if isinstance(message, PlanMessage) else message

    def keep_only(self, contours: list[str]) -> None:
        """Forget the contours that the job no longer has."""
        known = {*contours, ""}
        self._said = {key: said for key, said in self._said.items() if key[1] in known}
        self._costs = {name: cost for name, cost in self._costs.items() if name in known}

    def _with_cost(self, message: PlanMessage) -> PlanMessage:
        if message.pieces > 1:
            return message
        known = self._costs.get(message.contour)
        if known is None:
            before = None
        elif known.revision < message.revision:
            before = known.cost
        else:
            before = known.before
        self._costs[message.contour] = _Cost(message.revision, message.cost, before)
        return message.model_copy(update={"previous_cost": before})


@contextmanager
def _stored(folder: Path, name: str, data: bytes) -> Iterator[Path]:
    """Yield the file beside the job with this content; a new one goes if it is refused.

    Raises
    ------
    InputError
        It cannot be written.
    """
    given = Path(name)
    for number in count(1):
        file = folder / (name if number == 1 else f"{given.stem}-{number}{given.suffix}")
        if not file.exists():
            break
        if file.is_file() and file.read_bytes() == data:
            break
    new = not file.exists()
    try:
        if new:
            write_whole({file: data})
    except OSError as error:
        raise InputError(f"{file.name}: cannot be written ({error.strerror})") from None
    try:
        yield file
    except InputError as error:
        if new:
            file.unlink()
        raise InputError(str(error).replace(str(file), file.name)) from None


def _require_suffix(name: str, suffixes: Collection[str], what: str) -> None:
    given = Path(name)
    if given.name != name or not name.isprintable() or given.suffix.lower() not in suffixes:
        raise InputError(f"expected {what}, got {name!r:.80}; export it as one")


# -----------------------------------------------------------------------------
# A session: one job that is edited, planned and shown; all open pages see the same state.

_Ts = TypeVarTuple("_Ts")
FINE = TABLES["cell"].model_fields["deviation_mm"].default / 1000
"""Largest distance of the triangles of a solid from its faces, m, unless a job says otherwise."""


class Session:
    """One job that is edited and planned; everything except planning runs in the server's thread.

    Parameters
    ----------
    document : Document
        The job.
    """

    def __init__(self, document: Document) -> None:
        self.document = document
        self.hub = Hub()
        self.kept = KeptJobs()
        self._planning = Planning(self._from_thread, self._prepared_there, self._refused_there)
        self._answers = Answers(self._planning, self._to_page, self._answer_failed)
        self._filter = OutdatedFilter()
        self._job: Job | None = None
        self._faults: list[Fault] = []
        self._contours: list[ContourName] = []
        self._interval = 1.0
        self._first: str | None = None
        self._options: OptionsMessage | None = None
        self._alternatives: dict[str, NoPathMessage] = {}
        self._changed = asyncio.Event()
        self._files: tuple[JobResult, FileTexts] | None = None
        self._loop: asyncio.AbstractEventLoop | None = None

    async def work(self) -> None:
        """Read and plan the job after each change, until this task is cancelled."""
        self._loop = asyncio.get_running_loop()
        self._changed.set()
        try:
            while True:
                await self._changed.wait()
                self._changed.clear()
                await self._read()
        finally:
            self._answers.close()
            self._planning.close()

    def leave(self, page: Page) -> None:
        """Forget a page that is closed."""
        self.hub.close(page)
        self._answers.leave(page)

    @property
    def meshes(self) -> dict[str, bytes]:
        """The meshes of the scene, by their ids."""
        return self._planning.meshes

    async def hear(self, ask: Request, page: Page) -> None:
        """Carry out the request of a page; an error is sent to it as the answer."""
        try:
            await self._do(ask, page)
        except KerfpathError as error:
            page.say(ErrorMessage(message=str(error), about=ask.type))

    async def program(self, language: str | None) -> tuple[JobResult, FileTexts]:
        """Return the result of the job and its program in a language, by default that of the job.

        Raises
        ------
        InputError
            The current job is not planned yet, or the language is unknown.
        """
        result = in_language(self._planned().result, language)
        return result, await asyncio.to_thread(program_texts, result)

    async def files(self) -> FileTexts:
        """Return all files of the result.

        Raises
        ------
        InputError
            The current job is not planned yet, or its bounds are still being computed.
        """
        planned = self._planned()
        if not planned.settled:
            raise InputError(f"{WAIT}; wait for them")
        if self._files is None or self._files[0] is not planned.result:
            self._files = planned.result, await asyncio.to_thread(result_texts, planned.result)
        return self._files[1]

    async def begin(self, name: str, data: bytes, *, robot: str | None, unit: str | None) -> None:
        """Begin a new job with a drawing, as one step of undo; head and language stay.

        The drawing is written beside the job; a file that is there keeps its content.

        Raises
        ------
        InputError
            It is no drawing that can be read, or its unit is unlikely and none is given.
        """
        path = self.document.path

        def text() -> str:
            _require_suffix(name, SUFFIXES, "a drawing, such as .step, .iges, .dxf or .stl")
            with _stored(path.parent, name, data) as file:
                drawing = Drawing(file=file, unit=unit)
                part = drawing.read()
                question = unit_question(part.unit, part.bounding_box)
                if unit is None and question:
                    raise InputError(question)
                return job_text(part, path, robot=robot, drawing=drawing)

        made = await asyncio.to_thread(text)
        before = {} if self._job is None else self._job.source
        kept = [
            ((table, key), before[table][key])
            for table, key in (("tool", "head"), ("program", "language"))
            if key in before.get(table, {})
        ]
        self._replace(with_values(made, kept) if kept else made)

    async def solid(self, name: str, data: bytes, *, unit: str) -> dict[str, object]:
        """Write a file with a solid beside the job; return its keys of a fixture, and its bounds.

        A file that is there keeps its content.

        Returns
        -------
        dict
            `file`, its `unit` if it is a mesh, and `bounds_mm`, the corners (2, 3) of the box
            around the solid.

        Raises
        ------
        InputError
            There is no closed solid in it.
        """

        def read() -> dict[str, object]:
            _require_suffix(name, SOLIDS, "a solid, such as .step, .stl, .obj or .ply")
            own = {"unit": unit} if name.lower().endswith(MESHES) else {}
            with _stored(self.document.path.parent, name, data) as file:
                shape = read_solid(file, own.get("unit"), FINE)
            bounds = (shape.bounds * 1e3).round(3).tolist()
            return {"file": file.name, **own, "bounds_mm": bounds}

        return await asyncio.to_thread(read)

    async def script(self) -> File:
        """Return the job as a Python script.

        Raises
        ------
        InputError
            The current job is not planned yet, or it has options that a script cannot express.
        """
        self._planned()
        prepared, path = self._planning.prepared, self.document.path
        assert prepared is not None
        named = replace(prepared, job=replace(prepared.job, path=path))
        text = await asyncio.to_thread(python_script, named)
        return File(f"{path.stem}.py", "text/x-python", text.encode())

    def _planned(self) -> Outcome:
        planned = self._planning.result
        if planned is None or planned.revision != self.document.revision:
            raise InputError("the current job is not planned yet; wait until it is")
        return planned

    async def _do(self, ask: Request, page: Page) -> None:
        match ask:
            case Edit():
                self._change([(ask.path, ask.value)], ask.gesture)
            case Edits():
                self._change([(one.path, one.value) for one in ask.edits])
            case ReplaceText():
                self._replace(ask.text)
            case Command(type="undo"):
                self.document.undo()
                self._changed.set()
            case Command(type="redo"):
                self.document.redo()
                self._changed.set()
            case Command(type="cancel"):
                self._planning.cancel()
            case Command():
                self._changed.set()
            case Save():
                self.document.save(over=ask.over)
                self._say_job()
            case ContourRequest(type="focus"):
                self._first = ask.contour
            case ContourRequest(type="fastest"):
                self._planning.fastest(ask.contour, self.document.revision)
            case ContourRequest():
                revision = self.document.revision
                page.say(await asyncio.to_thread(self._answers.map, ask.contour, revision))
            case PoseRequest():
                page.say(await asyncio.to_thread(self._answers.pose, ask))
            case ShadeRequest():
                self._answers.shade(page, ask, self.document.revision)
            case TechniqueRequest():
                self._answers.technique(page, ask)
            case Relax():
                self._relax(ask)
            case CutLoops():
                part, change = self._planning.known_part(), only_loops if ask.alone else with_loops
                self._replace(change(await self._job_now(), part, ask.loops))
            case RemoveContour():
                self._replace(without_contour(await self._job_now(), ask.index))
            case Keep() | Rename() | KeptCommand():
                self._keep(ask)
            case FrontRequest():
                self._planning.front(ask, self.document.revision)
            case CandidateRequest():
                page.say(await asyncio.to_thread(self._planning.candidate, ask))
            case ReachRequest():
                self._planning.layouts.reach(ask, lambda said: self._soon(page.say, said))
            case Place():
                self._change(self._planning.layouts.placed(ask))
            case LayoutRequest():
                self._planning.look(ask, self.document.revision)
            case Take():
                self._change(self._planning.layouts.changes(ask.number, self.document.revision))
            case ProgramRequest():
                revision = self.document.revision
                result, texts = await self.program(ask.language)
                page.say(await asyncio.to_thread(program_text, result, texts, revision))

    def _change(self, changes: Sequence[Change], gesture: str | None = None) -> None:
        self.document.change(changes, gesture)
        self._changed.set()

    def _replace(self, text: str) -> None:
        self.document.replace(text)
        self._changed.set()

    async def _job_now(self) -> Job:
        """Return the job of the newest text.

        Raises
        ------
        InputError
            The text is not a valid job.
        """
        document = self.document
        if self._job is None or self._job.text != document.text:
            return await asyncio.to_thread(read_job, document.file, copy_of=document.path)
        return self._job

    def _relax(self, ask: Relax) -> None:
        known = self._alternatives.get(ask.contour)
        options = [] if known is None else known.relaxations or []
        if ask.index >= len(options):
            raise InputError(f"contour {ask.contour!r:.60} has no relaxation {ask.index}")
        self._change([(tuple(one.path), one.value) for one in options[ask.index].edits])

    def _keep(self, ask: Keep | Rename | KeptCommand) -> None:
        """Keep the job, or rename, forget or restore one that is kept."""
        match ask:
            case Keep():
                asked = None if self._job is None else self._job.options
                if asked is None:
                    raise InputError("keep: the job is not planned yet; wait, or correct its error")
                self.kept.keep(self.document, ask.name, asked.metric, asked.objective)
            case Rename():
                self.kept.rename(ask.id, ask.name)
            case KeptCommand(type="forget"):
                self.kept.forget(ask.id)
            case KeptCommand():
                self._replace(self.kept.text(ask.id))
        self.hub.say(self.kept.message())

    async def _read(self) -> None:
        """Read the current job and start planning it."""
        document = self.document
        revision = document.revision
        try:
            job = await asyncio.to_thread(read_job, document.file, copy_of=document.path)
        except InputError as error:
            self._job, self._faults = None, faults_of(error, document.text)
            self._planning.cancel()
            self._say_job()
            return
        if document.revision != revision:
            return  # the job has changed meanwhile and will be read again
        self._job, self._faults = job, []
        self._say_job()
        self._planning.take(job, revision, self._first or self._default_first())

    def _default_first(self) -> str | None:
        return self._contours[0].name if self._contours else None

    def _say_job(self) -> None:
        self.hub.say(
            job_message(
                self.document, self._job, self._contours, self._faults, interval=self._interval
            )
        )
        if self._job is None:
            return
        tables = job_file(self._job).robot.external
        options = options_message(self._job.robot, [table.called or "" for table in tables])
        if options != self._options:
            self._options = options
            self.hub.say(options)

    def _to_page(self, page: Page, message: Message) -> None:
        self._soon(page.say, message)

    def _answer_failed(self, page: Page, kind: str, error: BaseException) -> None:
        self._to_page(page, ErrorMessage(message=said_of(error), about=kind))

    def _from_thread(self, message: Message) -> None:
        """Take a message; may be called from any thread."""
        self._soon(self._say, message)

    def _soon(self, take: Callable[[*_Ts], None], *what: *_Ts) -> None:
        """Call `take(*what)` in the thread of the server, unless that has ended."""
        assert self._loop is not None
        with suppress(RuntimeError):  # the loop is closed: no page is connected any more
            self._loop.call_soon_threadsafe(take, *what)

    def _say(self, message: Message) -> None:
        newer = self._filter.of(message)
        if newer is None:
            return
        if isinstance(newer, NoPathMessage):
            self._alternatives[newer.contour] = newer
        elif isinstance(newer, PlanMessage):
            self._alternatives.pop(newer.contour, None)
        elif isinstance(newer, SceneMessage):
            names = [contour.name for contour in newer.contours]
            self.hub.keep_only(names)
            self._filter.keep_only(names)
            self.kept.keep_only(names)
        self.hub.say(newer)
        if self.kept.take(newer):
            self.hub.say(self.kept.message())

    def _prepared_there(self, prepared: PreparedJob, revision: int) -> None:
        self._soon(self._prepared, prepared, revision)

    def _prepared(self, prepared: PreparedJob, revision: int) -> None:
        """Take the names of the job's contours, once its drawing has been read."""
        pairs = zip(prepared.names, tables_of(prepared), strict=True)
        contours = [ContourName(name=name, index=index) for name, index in pairs]
        interval = prepared.contours[0].candidates[0].dt if prepared.contours else 1.0
        if (contours, interval) != (self._contours, self._interval):
            self._contours, self._interval = contours, interval
            self._say_job()

    def _refused_there(self, error: InputError, revision: int) -> None:
        self._soon(self._refused, error, revision)

    def _refused(self, error: InputError, revision: int) -> None:
        """Take an error of the job that only its drawing or its cell reveals."""
        if revision == self.document.revision:
            self._faults = faults_of(error, self.document.text)
            self._say_job()
