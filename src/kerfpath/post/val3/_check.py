"""What VAL 3 says otherwise than planned, or not at all."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from kerfpath.post._issue import ProgramIssue
from kerfpath.post._program import LinearMove, Program, Section
from kerfpath.post.val3._axes import configurations
from kerfpath.post.val3._settings import Val3Settings

__all__ = ["check"]


def check(program: Program, settings: Val3Settings) -> Iterator[ProgramIssue]:
    """Yield the issues that only this language has."""
    if settings.laser_output is not None and settings.laser_output == settings.gas_output:
        said = f"laser and gas are switched by the same output, {settings.gas_output}"
        yield ProgramIssue("error", "output", said, "program")
    for section in program.sections:
        yield from _switches(section)
        yield from _postures(program, section)


def _switches(section: Section) -> Iterator[ProgramIssue]:
    """Tell of switches that come later than planned, and of stops that they need."""
    moves = [m for m in section.moves if isinstance(m, LinearMove) and m.switches]
    leads = [switch.lead_time for m in moves for switch in m.switches if switch.lead_time > 0]
    if leads:
        yield ProgramIssue(
            "warning",
            "lead-time",
            f"{len(leads)} switches are to come up to {max(leads) * 1e3:g} ms ahead, which VAL 3 "
            "cannot say: they come once the tip stands; measure the delay, and give no lead",
            section.name,
        )
    if flying := sum(move.zone > 0 for move in moves):
        yield ProgramIssue(
            "warning",
            "stop-to-switch",
            f"the robot will stop at {flying} places to switch there, as at each micro joint: "
            "VAL 3 switches only where it stands",
            section.name,
        )


def _postures(program: Program, section: Section) -> Iterator[ProgramIssue]:
    """Check that no straight move changes the configuration."""
    if not section.moves:
        return
    words = configurations(program.robot, np.array([move.q for move in section.moves]))
    for k, move in enumerate(section.moves[1:], 1):
        if isinstance(move, LinearMove) and words[k] != words[k - 1]:
            yield ProgramIssue(
                "warning",
                "posture-change",
                f"the configuration changes from {' '.join(map(str, words[k - 1]))} to "
                f"{' '.join(map(str, words[k]))} in a straight move, which the controller may "
                "refuse",
                f"{section.name}, move {k}",
            )
