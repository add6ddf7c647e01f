"""What VAL 3 says otherwise than planned, or not at all."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from kerfpath.post._divide import long_contours
from kerfpath.post._issue import ProgramIssue
from kerfpath.post._program import LinearMove, Program, Section
from kerfpath.post._standing import switched_later
from kerfpath.post.val3._axes import configurations
from kerfpath.post.val3._settings import Val3Settings
from kerfpath.post.val3._write import AROUND, Val3

__all__ = ["check"]


def check(program: Program, settings: Val3Settings) -> Iterator[ProgramIssue]:
    """Yield the issues that only this language has."""
    if settings.laser_output is not None and settings.laser_output == settings.gas_output:
        said = f"laser and gas are switched by the same output, {settings.gas_output}"
        yield ProgramIssue("error", "output", said, "program")
    room = settings.lines_per_file - AROUND
    yield from long_contours(Val3(program, settings).lengths(), room, "warning")
    for section in program.sections:
        yield from switched_later(section, "VAL 3")
        yield from _postures(program, section)


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
