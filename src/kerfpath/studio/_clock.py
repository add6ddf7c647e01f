"""The clock of a program: what the robot does when, from its first target to its last."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import islice
from typing import Literal, TypedDict

import numpy as np
from numpy.typing import ArrayLike

from kerfpath._arrays import Array
from kerfpath.errors import InputError
from kerfpath.job import CutResult, JobResult
from kerfpath.plans import Plan
from kerfpath.post import JointMove, LinearMove, Program, Wait, timetable
from kerfpath.robots import Robot
from kerfpath.studio._messages import Cycle, ProgramMessage, Segment
from kerfpath.studio._numbers import flat

__all__ = ["cycle_of", "program_message"]

Kind = Literal["move", "approach", "pierce", "retract"]
Timed = JointMove | LinearMove | Wait
"""Steps that the timetable has."""
RAMP = 9
"""Points by which gaining speed is drawn."""
STRAIGHT = 9
"""Points by which a straight move along the tool axis is drawn: joints go all but evenly there."""
UNPLANNED = (
    "The job has no [sequence]: between the contours the robot moves straight from joints to "
    "joints, and nothing has looked whether that is clear."
)
NO_CELL = "The job has no [cell]: nothing has looked whether the moves between contours are clear."


class _Whose(TypedDict):
    """Whose stretch of a program it is."""

    contour: str


def program_message(result: JobResult, revision: int) -> ProgramMessage:
    """Return what the program of a result does, in its order, or why there is none.

    Times are those that the languages write which say any: of cuts as planned, of joint moves the
    least that limits and air_speed leave them.

    Parameters
    ----------
    result : JobResult
    revision : int
        Of the job that it is of.
    """
    missing = [cut.contour for cut in result.cuts if cut.plan is None]
    why = ""
    if missing:
        why = f"There is no program: {', '.join(missing)} has no plan."
    elif result.stuck is not None:
        why = f"There is no program: {result.stuck}."
    if not why:
        try:
            return _clock(result, revision)
        except InputError as refused:
            why = f"There is no program: {refused}."
    return ProgramMessage(revision=revision, total=0.0, segments=[], checked=False, notes=[why])


def cycle_of(message: ProgramMessage) -> Cycle | None:
    """Return where the time of a program goes; None where there is none."""
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
    # Arcs lead by the same places in the same times: the nodes of the plans are shown.
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
    """Yield the stretches of a program, a section of which is of each cut."""
    robot, clock = program.robot, iter(timetable(program))
    here, begin = program.moves[0].q, 0.0
    for section, cut in zip(program.sections, cuts, strict=True):
        made = cut.plan
        assert made is not None
        whose: _Whose = {"contour": cut.contour}
        straight = [step for step in section.steps if isinstance(step, LinearMove)]
        into, out = straight[0], straight[-1]
        # The moves of the path, which its plan has with all of their nodes, are one stretch.
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
                    continue  # the clock goes on to the end of the path
                yield Segment(kind="cut", begin=begin, end=end, plan=made.name, **whose)
            begin = end


def _stretch(kind: Kind, begin: float, end: float, time: ArrayLike, q: ArrayLike) -> Segment:
    return Segment(kind=kind, begin=begin, end=end, time=flat(time), q=flat(q))


def _from_stop_to_stop(robot: Robot, one: Array, two: Array, took: float) -> tuple[Array, Array]:
    """Return times (m,) and joints (m, n) of a joint move that gains speed, holds and loses it.

    The slowest joint gains it at its full acceleration, and the others go with it.
    """
    way = np.abs(two - one)
    gain = float((way / robot.speed_limits()[1]).max())
    # Without gaining and losing speed it would take this long; half, where that is all it does.
    even = (took + np.sqrt(max(took**2 - 4 * gain, 0.0))) / 2
    gaining = min(gain / even, took / 2)
    ramp = np.linspace(0.0, gaining, RAMP)
    half = np.array([*ramp, took / 2])
    covered = np.array([*(ramp**2 / (2 * gaining * even)), 0.5])
    time = np.concatenate([half, took - half[-2::-1]])
    share = np.concatenate([covered, 1 - covered[-2::-1]])
    return time, one + share[:, None] * (two - one)


def _straight(made: Plan, one: Array, two: Array, end: int) -> Array:
    """Return joints (m, n) along the tool axis between two joint vectors, at an end of a plan."""
    guess = one + np.linspace(0.0, 1.0, STRAIGHT)[:, None] * (two - one)
    arm, n = made.robot.alone(), made.robot.family.joints  # external axes stand still
    T = arm.forward(np.array([one, two])[:, :n])
    poses = np.repeat(T[:1], STRAIGHT, axis=0)
    poses[:, :3, 3] = np.linspace(T[0, :3, 3], T[1, :3, 3], STRAIGHT)
    posture = np.full(STRAIGHT, made.posture[end])
    return np.column_stack([arm.follow(poses, guess[:, :n], posture), guess[:, n:]])
