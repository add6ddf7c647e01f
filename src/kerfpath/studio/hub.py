"""Work in threads: each does only the newest request, and running work can be stopped."""

from __future__ import annotations

import asyncio
import logging
from collections import OrderedDict
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from itertools import islice
from threading import Event, Lock
from time import monotonic
from typing import Literal, TypedDict

import numpy as np
from numpy.typing import ArrayLike

from kerfpath.arrays import Array
from kerfpath.errors import InputError, KerfpathError
from kerfpath.job import CutResult, JobResult
from kerfpath.plans import Plan
from kerfpath.post import JointMove, LinearMove, Program, Wait, timetable
from kerfpath.progress import stopped_by
from kerfpath.robots import Robot
from kerfpath.studio.messages import Cycle, Message, ProgramMessage, Segment, flat

# -----------------------------------------------------------------------------
# The clock of a program: its segments with their times, from the first target to the last.

Kind = Literal["move", "approach", "pierce", "retract"]
Timed = JointMove | LinearMove | Wait
"""Steps that have a time in the timetable."""
RAMP = 9
"""Number of points that show the acceleration of a joint move."""
STRAIGHT = 9
"""Number of points that show a straight move along the tool axis; joint speeds hardly vary."""
UNPLANNED = (
    "The job has no [sequence]: the transfer moves are straight joint motions, which have not been "
    "checked for collisions."
)
NO_CELL = "The job has no [cell]: the transfer moves have not been checked for collisions."


class _Whose(TypedDict):
    """The contour that a stretch of a program belongs to."""

    contour: str


def program_message(result: JobResult, revision: int) -> ProgramMessage:
    """Return the segments of a result's program in its order, or the reason why there is none.

    Times are those that programs contain, in languages with times: cuts take the planned time,
    joint moves the least time that the limits and air_speed allow.

    Parameters
    ----------
    result : JobResult
    revision : int
        Revision of the job.
    """
    missing = [cut.contour for cut in result.cuts if cut.plan is None]
    why = ""
    if missing:
        why = f"There is no program: no plan for {', '.join(missing)}."
    elif result.stuck is not None:
        why = f"There is no program: {result.stuck}."
    if not why:
        try:
            return _clock(result, revision)
        except InputError as refused:
            why = f"There is no program: {refused}."
    return ProgramMessage(revision=revision, total=0.0, segments=[], checked=False, notes=[why])


def cycle_of(message: ProgramMessage) -> Cycle | None:
    """Return the shares of a program's time; None without a program."""
    if not message.segments:
        return None
    spent = {"cut": 0.0, "pierce": 0.0}
    for segment in message.segments:
        if segment.kind in spent:
            spent[segment.kind] += segment.end - segment.begin
    cutting, piercing = spent["cut"], spent["pierce"]
    air = message.total - cutting - piercing
    return Cycle(cutting=cutting, air=air, piercing=piercing, total=message.total)


def _clock(result: JobResult, revision: int) -> ProgramMessage:
    # Arcs pass the same points at the same times: show the nodes of the plans instead.
    options = replace(result.job.program, arc_tolerance=None)
    program = options.program(result.plans, result.moves)
    segments = list(_segments(program, [cut for cut in result.cuts if cut.plan is not None]))
    notes = []
    if result.part is None:
        notes.append(UNPLANNED)
    elif not program.air_checked:
        notes.append(NO_CELL)
    return ProgramMessage(
        revision=revision,
        total=segments[-1].end,
        segments=segments,
        checked=program.air_checked,
        notes=notes,
    )


def _segments(program: Program, cuts: Sequence[CutResult]) -> Iterator[Segment]:
    """Yield the segments of a program, which has one section for each cut."""
    robot, clock = program.robot, iter(timetable(program))
    here, begin = program.moves[0].q, 0.0
    for section, cut in zip(program.sections, cuts, strict=True):
        made = cut.plan
        assert made is not None
        whose: _Whose = {"contour": cut.contour}
        straight = [step for step in section.steps if isinstance(step, LinearMove)]
        into, out = straight[0], straight[-1]
        # All moves of the path form one segment; its plan has all of the nodes.
        for step, end in islice(clock, sum(isinstance(s, Timed) for s in section.steps)):
            if isinstance(step, Wait):
                rest = _stretch("pierce", begin, end, [0.0, end - begin], [here, here])
                yield rest.model_copy(update=whose)
            elif isinstance(step, JointMove):
                if end > begin:
                    yield _stretch(
                        "move", begin, end, *_from_stop_to_stop(robot, here, step.q, end - begin)
                    )
                here = step.q
            elif step is into or step is out:
                kind: Literal["approach", "retract"] = "approach" if step is into else "retract"
                q = _straight(made, here, step.q, 0 if step is into else -1)
                time = np.linspace(0.0, end - begin, len(q))
                yield _stretch(kind, begin, end, time, q).model_copy(update=whose)
                here = step.q
            else:
                here = step.q
                if step is not straight[-2]:
                    continue  # the segment ends at the end of the path
                yield Segment(kind="cut", begin=begin, end=end, plan=made.name, **whose)
            begin = end


def _stretch(kind: Kind, begin: float, end: float, time: ArrayLike, q: ArrayLike) -> Segment:
    return Segment(kind=kind, begin=begin, end=end, time=flat(time), q=flat(q))


def _from_stop_to_stop(robot: Robot, one: Array, two: Array, took: float) -> tuple[Array, Array]:
    """Return times (m,) s and joints (m, n) of a joint move: accelerate, hold speed, decelerate.

    The slowest joint accelerates at its limit, and the others follow in proportion.
    """
    way = np.abs(two - one)
    gain = float((way / robot.speed_limits()[1]).max())
    # Duration at the held speed alone; half of `took` if the move only accelerates and brakes.
    even = (took + np.sqrt(max(took**2 - 4 * gain, 0.0))) / 2
    gaining = min(gain / even, took / 2)
    ramp = np.linspace(0.0, gaining, RAMP)
    half = np.array([*ramp, took / 2])
    covered = np.array([*(ramp**2 / (2 * gaining * even)), 0.5])
    time = np.concatenate([half, took - half[-2::-1]])
    share = np.concatenate([covered, 1 - covered[-2::-1]])
    return time, one + share[:, None] * (two - one)


def _straight(made: Plan, one: Array, two: Array, end: int) -> Array:
    """Return joints (m, n) of a straight tip motion between two joint vectors, at a plan's end."""
    guess = one + np.linspace(0.0, 1.0, STRAIGHT)[:, None] * (two - one)
    arm, n = made.robot.alone(), made.robot.family.joints  # external axes are at rest
    T = arm.forward(np.array([one, two])[:, :n])
    poses = np.repeat(T[:1], STRAIGHT, axis=0)
    poses[:, :3, 3] = np.linspace(T[0, :3, 3], T[1, :3, 3], STRAIGHT)
    posture = np.full(STRAIGHT, made.posture[end])
    return np.column_stack([arm.follow(poses, guess[:, :n], posture), guess[:, n:]])


# -----------------------------------------------------------------------------
# The open pages, and the newest message of each kind for them.

LAST = (
    "job",
    "options",
    "part",
    "scene",
    "program",
    "outcome",
    "progress",
    "kept",
    "front",
    "layout",
)
"""Kinds of messages whose last one a new page gets; it also gets the last plans per contour."""


class Page:
    """One open page with the messages that wait for it, only the newest of each kind.

    A page that does not read holds no more memory than one full set of messages.
    """

    def __init__(self) -> None:
        self._waiting: OrderedDict[object, str] = OrderedDict()
        self._there = asyncio.Event()

    def put(self, key: object, text: str) -> None:
        """Queue a message; it replaces a waiting one with the same key."""
        self._waiting[key] = text
        self._waiting.move_to_end(key)
        self._there.set()

    def say(self, message: Message) -> None:
        """Queue an answer; it replaces a waiting one of the same kind about the same contour."""
        about = [getattr(message, name, None) for name in ("type", "contour", "about")]
        self.put(tuple(about), message.model_dump_json())

    async def next(self) -> str:
        """Return the next message, once there is one."""
        while not self._waiting:
            self._there.clear()
            await self._there.wait()
        _, text = self._waiting.popitem(last=False)
        return text


class Hub:
    """All open pages, and the messages that a new page gets first."""

    def __init__(self) -> None:
        self._pages: set[Page] = set()
        self._last: dict[str, str] = {}
        self._of_contour: dict[str, OrderedDict[str, str]] = {}

    def __len__(self) -> int:
        return len(self._pages)

    def open(self) -> Page:
        """Return a new page; the last message of each kind is queued for it."""
        page = Page()
        for kind in LAST:
            if kind in self._last:
                page.put(kind, self._last[kind])
        for contour, said in self._of_contour.items():
            for name, text in said.items():
                page.put((contour, name), text)
        self._pages.add(page)
        return page

    def close(self, page: Page) -> None:
        """Forget a page."""
        self._pages.discard(page)

    def say(self, message: Message) -> None:
        """Send a message to every page, and keep it for pages that open later."""
        kind, text = str(getattr(message, "type", "")), message.model_dump_json()
        contour = getattr(message, "contour", None)
        key: object = kind
        if kind == "clearance":
            name = f"clearance {getattr(message, 'name', '')}"
            self._of_contour.setdefault(str(contour), OrderedDict())[name] = text
            key = contour, name
        elif kind in ("plan", "nopath"):
            key = self._keep(str(contour), kind, message, text)
        else:
            self._last[kind] = text
        for page in self._pages:
            page.put(key, text)

    def keep_only(self, contours: list[str]) -> None:
        """Forget the messages about contours that the job no longer has."""
        for gone in self._of_contour.keys() - set(contours):
            del self._of_contour[gone]

    def _keep(self, contour: str, kind: str, message: Message, text: str) -> object:
        """Keep a contour's plan, the plans of its pieces, or the reason why it has none."""
        name = kind if kind == "nopath" else f"plan {getattr(message, 'name', '')}"
        said = self._of_contour.setdefault(contour, OrderedDict())
        alone = kind == "nopath" or getattr(message, "pieces", 1) == 1 or "nopath" in said
        if alone:
            said.clear()
        said[name] = text
        return contour, name


# -----------------------------------------------------------------------------
# Work in threads: each does only the newest request, and running work can be stopped.

log = logging.getLogger("kerfpath.studio")


class Superseded(Exception):  # not an error, so its name does not end in Error
    """Raised inside work whose result is no longer wanted."""


class Stop:
    """A flag that asks running work to stop."""

    def __init__(self) -> None:
        self._event = Event()

    def set(self) -> None:
        """Ask the work to stop."""
        self._event.set()

    @property
    def asked(self) -> bool:
        """Whether the work is asked to stop."""
        return self._event.is_set()

    def check(self) -> None:
        """Raise `Superseded` if the work is asked to stop.

        Raises
        ------
        Superseded
            The work is asked to stop.
        """
        if self._event.is_set():
            raise Superseded

    def rest(self, seconds: float) -> None:
        """Wait, unless the work is asked to stop meanwhile.

        Raises
        ------
        Superseded
            The work is asked to stop.
        """
        if self._event.wait(seconds):
            raise Superseded


class Newest:
    """A thread that does only the newest request; a new one asks the running work to stop.

    Parameters
    ----------
    name : str
        Name of the thread.
    failed : callable
        Takes every exception of the work except `Superseded`; called in that thread.
    """

    def __init__(self, name: str, failed: Callable[[BaseException], None]) -> None:
        self._pool = ThreadPoolExecutor(1, thread_name_prefix=f"studio-{name}")
        self._failed, self._lock = failed, Lock()
        self._stop = Stop()

    def ask(self, work: Callable[[Stop], None]) -> None:
        """Do this next, in place of every earlier request."""
        with self._lock:
            self._stop.set()
            stop = self._stop = Stop()
            future = self._pool.submit(_do, work, stop)
        future.add_done_callback(self._done)

    def cancel(self) -> None:
        """Stop the running work."""
        with self._lock:
            self._stop.set()

    def close(self) -> None:
        """Stop the running work and take no further requests."""
        self.cancel()
        self._pool.shutdown(wait=False, cancel_futures=True)

    def _done(self, future: Future[None]) -> None:
        if future.cancelled():
            return
        error = future.exception()
        if error is not None and not isinstance(error, Superseded):
            self._failed(error)


def _do(work: Callable[[Stop], None], stop: Stop) -> None:
    stop.check()
    with stopped_by(stop.check):
        work(stop)


class Seldom:
    """A limiter of how often something is done.

    Parameters
    ----------
    every : float s
        Least time from one permission to the next.
    """

    def __init__(self, every: float) -> None:
        self._every, self._last = every, -every

    def may(self) -> bool:
        """Return whether enough time has passed since it last returned True."""
        now = monotonic()
        if now - self._last < self._every:
            return False
        self._last = now
        return True


def said_of(error: BaseException) -> str:
    """Return the message of an exception in one line; an internal error is also logged."""
    if isinstance(error, KerfpathError):
        return str(error)
    log.error("the studio's work failed", exc_info=error)
    return f"internal error, {type(error).__name__}: {error}; see the terminal for the traceback"
