"""Issues that only trajectories have."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from kerfpath.auditor import Level
from kerfpath.errors import InputError
from kerfpath.post._issue import ProgramIssue
from kerfpath.post._program import CircularMove, LinearMove, Program
from kerfpath.post._times import check_times
from kerfpath.post.ros._trajectory import rates, trajectory
from kerfpath.post.ros._write import RosSettings, joint_names

__all__ = ["check"]

NOISE = 1e-3
"""Share of a limit that rounding, and the parabola through uneven points, may add."""


def check(program: Program, settings: RosSettings) -> Iterator[ProgramIssue]:
    """Yield what a trajectory cannot express, and where it exceeds limits of the joints."""
    issues = [*check_times(program), *_check_shape(program, settings)]
    yield from issues
    if not issues:
        yield from _check_limits(program, settings)


def _check_shape(program: Program, settings: RosSettings) -> Iterator[ProgramIssue]:
    count, joints = len(joint_names(program.robot, settings)), program.robot.joints
    if count != joints:
        message = f"expected {joints} names in joint_names, got {count}"
        yield ProgramIssue("error", "joint-names", message, "program")
    steps = [(section.name, step) for section in program.sections for step in section.moves]
    for (name, move), (_, after) in zip(steps, [*steps[1:], ("", None)], strict=True):
        if isinstance(move, CircularMove):
            message = "a trajectory has no arcs; leave arcs_mm out of the job"
            yield ProgramIssue("error", "arc", message, name)
        if move.zone > 0 and not (isinstance(move, LinearMove) and isinstance(after, LinearMove)):
            message = "a corner can only be rounded between linear moves; expected a stop"
            yield ProgramIssue("error", "zone", message, name)


def _check_limits(program: Program, settings: RosSettings) -> Iterator[ProgramIssue]:
    try:
        motion = trajectory(program, settings.step_ms * 1e-3)
    except InputError as error:
        yield ProgramIssue("error", "straight", str(error), "program")
        return
    found = rates(motion.time, motion.q, motion.stops)
    words: tuple[tuple[Level, str], ...] = (("error", "velocity"), ("warning", "acceleration"))
    for values, limit, (level, what) in zip(
        found, program.robot.speed_limits(), words, strict=True
    ):
        share = np.abs(values) / limit
        if share.max() > 1 + NOISE:
            k, joint = np.unravel_index(int(share.argmax()), share.shape)
            yield ProgramIssue(
                level,
                f"joint-{what}",
                f"{program.robot.joint_names[int(joint)]} needs {share.max():.0%} of its "
                f"{what} limit {motion.time[k]:.3f} s after the start",
                "program",
            )
