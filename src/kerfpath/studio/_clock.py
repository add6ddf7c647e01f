"""The clock of a program: its segments with their times, from the first target to the last."""

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
