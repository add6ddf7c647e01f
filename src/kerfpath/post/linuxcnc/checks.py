"""What LinuxCNC cannot express, and where it will not keep the times of a program."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise

import numpy as np

from kerfpath.post.arcs import check_times
from kerfpath.post.linuxcnc.controller import LinuxcncSettings, goes_nowhere
from kerfpath.post.linuxcnc.motion import LEADING, stretch
from kerfpath.post.program import (
    CircularMove,
    LinearMove,
    Program,
    ProgramIssue,
    Section,
    Step,
    switches_of,
)

SLOWEST = float(np.radians(0.1)) / 60
"""Speed (rad/s) of the leading joints below which the interpreter takes this one instead."""
LONGER = 0.03
"""Share by which a contour may take longer than planned before that is reported."""


def without_leads(program: Program, settings: object = None) -> Program:
    """Return the program without lead times: M62 acts as the next move begins."""

    def late(step: Step) -> Step:
        if not isinstance(step, LinearMove):
            return step
        return replace(step, switches=tuple(replace(s, lead_time=0.0) for s in step.switches))

    sections = [replace(s, steps=tuple(late(step) for step in s.steps)) for s in program.sections]
    return replace(program, sections=tuple(sections))


def check(program: Program, settings: LinuxcncSettings) -> Iterator[ProgramIssue]:
    """Yield what the program cannot express, and where LinuxCNC will not keep its times."""
    issues = [*check_times(program), *_check_shape(program)]
    yield from issues
    if any(issue.level == "error" for issue in issues):
        return
    yield from _check_leads(program)
    for section in program.sections:
        yield from _check_slow(section)
        yield from _check_look_ahead(program, section, settings)


def _check_shape(program: Program) -> Iterator[ProgramIssue]:
    """Check that there are no arcs, and that corners are rounded along the path alone."""
    steps = [(section.name, step) for section in program.sections for step in section.moves]
    for (name, move), (_, after) in zip(steps, [*steps[1:], ("", None)], strict=True):
        if isinstance(move, CircularMove):
            message = "the joints have no arcs; leave arcs_mm out of the job"
            yield ProgramIssue("error", "arc", message, name)
        if move.zone > 0 and not (isinstance(move, LinearMove) and isinstance(after, LinearMove)):
            message = "a corner can only be rounded between linear moves; expected a stop"
            yield ProgramIssue("error", "zone", message, name)


def _check_leads(program: Program) -> Iterator[ProgramIssue]:
    leads = [s.lead_time for move in program.moves for s in switches_of(move) if s.lead_time > 0]
    if leads:
        message = (
            f"{len(leads)} switches are planned up to {max(leads) * 1e3:g} ms ahead, but LinuxCNC "
            "switches as the tip arrives; measure the delay, and set no lead time"
        )
        yield ProgramIssue("warning", "lead-time", message, "program")


def _check_slow(section: Section) -> Iterator[ProgramIssue]:
    """Check that the leading joints are not slower than the interpreter allows."""
    moves = section.moves
    for number, (before, move) in enumerate(pairwise(moves), 1):
        if not isinstance(move, LinearMove):
            continue
        way = move.q - before.q
        length = float(np.linalg.norm(way[:LEADING]))
        if not goes_nowhere(way[:LEADING]) and length < SLOWEST * move.duration:
            message = (
                f"the first {LEADING} joints turn by {np.degrees(length):.3g} deg in "
                f"{move.duration:.3g} s, but LinuxCNC moves them by at least 0.1 deg/min; use "
                "coarser nodes"
            )
            yield ProgramIssue("error", "slow", message, f"{section.name}, move {number}")


def _check_look_ahead(
    program: Program, section: Section, settings: LinuxcncSettings
) -> Iterator[ProgramIssue]:
    """Warn if the cut takes longer because its moves are short for the speed of the joints.

    The planner looks ahead one move and ramps with half the acceleration a: it keeps the time t of
    a move in which no joint turns faster than a t / 2.
    """
    robot = program.robot
    _, acceleration = robot.speed_limits()
    path = [k for k, move in enumerate(section.moves) if move.zone > 0]
    if not path:
        return
    first, last = path[0], path[-1] + 1  # from the stop before to the stop behind
    moves = [move for move in section.moves[first : last + 1] if isinstance(move, LinearMove)]
    q = np.array([section.moves[first - 1].q, *(move.q for move in moves)])
    took = np.array([move.duration for move in moves])
    run = stretch((), q, took, robot, settings)
    planned = float(took.sum())
    if run.time <= (1 + LONGER) * planned:
        return
    needed = 2 * np.abs(np.diff(q, axis=0)) / took[:, None] / acceleration
    short = needed.max(axis=1) > took
    if not short.any():
        return
    k, joint = divmod(int(needed.argmax()), needed.shape[1])
    slower = float(np.sqrt((took / needed.max(axis=1))[short].min()))
    message = (
        f"LinuxCNC takes {run.time:.3g} s for the cut planned in {planned:.3g} s: it looks ahead "
        f"one move and ramps with half the acceleration, for which {int(short.sum())} of "
        f"{len(took)} moves are too short. {robot.joint_names[joint]} needs moves of "
        f"{needed[k, joint] * 1e3:.3g} ms; raise spacing_mm to "
        f"{needed[k, joint] * moves[k].speed * 1e3:.1f}, or lower the speed to {slower:.0%}"
    )
    yield ProgramIssue("warning", "look-ahead", message, f"{section.name}, move {first + k}")
