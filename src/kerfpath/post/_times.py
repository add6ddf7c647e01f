"""When each step of a program ends, for languages that write times."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from kerfpath.errors import InputError
from kerfpath.post._issue import ProgramIssue
from kerfpath.post._program import JointMove, LinearMove, Move, Program, Wait
from kerfpath.transfer import least_time

__all__ = [
    "SHORTEST_CRUISE", "TICK", "air_times", "check_times", "cruises", "not_whole", "timetable",
]  # fmt: skip

SHORTEST_CRUISE = 1e-3
"""Shortest time (s) that is written for a joint move."""
TICK = 0.01
"""Step (s) in which some controllers count times."""
TICK_NOISE = 1e-4
"""Largest difference (s) of a time from a multiple of it."""
SHORTEST = 1e-6
"""Shortest duration (s) of a move that can be written."""


def timetable(program: Program) -> list[tuple[Move | Wait, float]]:
    """Return each move and wait with the time (s) at which it ends; the first target is at 0.

    Waits and moves take their planned times. A joint move is straight, from stop to stop; without a
    planned time it takes the least time within the joint limits, divided by its share of the full
    speed.

    Raises
    ------
    InputError
        The joint limits are not known.
    """
    steps = [step for step in program.steps if isinstance(step, JointMove | LinearMove | Wait)]
    ways = np.diff(np.array([move.q for move in program.moves]), axis=0)
    least = iter([0.0, *least_time(ways, *program.robot.speed_limits()).tolist()])
    took = []
    for step in steps:
        full = 0.0 if isinstance(step, Wait) else next(least)
        if isinstance(step, JointMove):
            took.append(full / step.speed if step.duration is None or not full else step.duration)
        else:
            took.append(step.time if isinstance(step, Wait) else step.duration)
    return list(zip(steps, np.cumsum(took).tolist(), strict=True))


def cruises(program: Program) -> dict[Move, float]:
    """Return how long planned joint moves take (s) at constant speed.

    Without acceleration, that is the way of the slowest joint by its share of its full speed.
    """
    if program.robot.velocity is None:
        return {}
    return {
        move: float((np.abs(move.q - before.q) / program.robot.velocity).max() / move.speed)
        for before, move in pairwise(program.moves)
        if isinstance(move, JointMove) and move.duration is not None
    }


def air_times(program: Program) -> list[float | None]:
    """Return how long each move takes (s), from `timetable`; None if that is not known.

    It is None for the first move, for moves along the path, and if the limits are not known.
    """
    if program.robot.velocity is None or program.robot.acceleration is None:
        return [None] * len(program.moves)
    steps, ends = zip(*timetable(program), strict=True)
    took = np.diff(ends, prepend=ends[0]).tolist()
    return [
        time if isinstance(step, JointMove) and k > 0 else None
        for k, (step, time) in enumerate(zip(steps, took, strict=True))
        if not isinstance(step, Wait)
    ]


def not_whole(time: float) -> bool:
    """Return whether a time (s) is not a multiple of `TICK`."""
    return abs(time - TICK * round(time / TICK)) > TICK_NOISE


def check_times(program: Program, settings: object = None) -> Iterator[ProgramIssue]:
    """Yield what prevents writing times: unknown limits, no start, a move without a duration."""
    try:
        program.robot.speed_limits()
    except InputError as error:
        yield ProgramIssue("error", "joint-speed", str(error), "program")
    if not isinstance(next(iter(program.moves), None), JointMove):
        message = "times start at a first joint move, but there is none"
        yield ProgramIssue("error", "start", message, "program")
    for section in program.sections:
        for number, move in enumerate(section.moves):
            took = move.duration if isinstance(move, LinearMove) else 1.0
            if not SHORTEST <= took < np.inf:
                message = f"the move takes {took:g} s, expected at least {SHORTEST:g} s"
                yield ProgramIssue("error", "duration", message, f"{section.name}, move {number}")
