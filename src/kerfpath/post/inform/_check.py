"""Issues that only INFORM has."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from kerfpath.post._issue import ProgramIssue
from kerfpath.post._program import Await, JointMove, Program, Section, Wait
from kerfpath.post._standing import warn_of_late_switches
from kerfpath.post._times import TICK, not_whole
from kerfpath.post.inform._axes import axes_from_joints
from kerfpath.post.inform._settings import InformSettings

__all__ = ["check"]

TURNING = {3: "R", 5: "T", 0: "S"}
"""The axes whose turns a type gives, within 360 deg."""
WHOLE_TURN_DEG = 360.0


def check(program: Program, settings: InformSettings) -> Iterator[ProgramIssue]:
    """Yield the issues that only this language has."""
    pulses = program.robot.externals or settings.pulses_per_deg is not None
    if not pulses and any(isinstance(m, JointMove) for m in program.moves):
        yield ProgramIssue(
            "warning",
            "joint-targets",
            "joint moves go to positions with a manipulator type (RCONF), not to pulses; give "
            "pulses_per_deg from the robot's parameters, or check each start at low speed",
            "program",
        )
    for section in program.sections:
        yield from warn_of_late_switches(section, "INFORM")
        yield from _check_times(section)
        yield from _check_turns(program, section, settings)


def _check_times(section: Section) -> Iterator[ProgramIssue]:
    for number, step in enumerate(section.steps):
        times = [step.time] if isinstance(step, Wait) else []
        times += [step.timeout] if isinstance(step, Await) else []
        if any(not_whole(time) for time in times):
            yield ProgramIssue(
                "error",
                "time-step",
                f"expected waits in steps of {TICK * 1e3:g} ms, got {times[0] * 1e3:g} ms",
                f"{section.name}, step {number}",
            )


def _check_turns(
    program: Program, section: Section, settings: InformSettings
) -> Iterator[ProgramIssue]:
    """Check that the turns of R, T and S can be expressed where a position is not in pulses."""
    if not section.moves or program.robot.externals:
        return
    q = np.array([move.q for move in section.moves])
    axes_deg = np.degrees(axes_from_joints(program.robot, q))
    for k, move in enumerate(section.moves):
        if isinstance(move, JointMove) and settings.pulses_per_deg is not None:
            continue
        for i, name in TURNING.items():
            if abs(axes_deg[k, i]) > WHOLE_TURN_DEG:
                yield ProgramIssue(
                    "error",
                    "turns",
                    f"{name} = {axes_deg[k, i]:.1f} deg cannot be expressed by a position, only up "
                    f"to {WHOLE_TURN_DEG:g} deg either way; limit the axis",
                    f"{section.name}, move {k}",
                )
