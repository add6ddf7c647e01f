"""Issues that only VAL 3 has."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from kerfpath.post._issue import ProgramIssue
from kerfpath.post._program import Program
from kerfpath.post._standing import warn_of_changed_postures, warn_of_late_switches
from kerfpath.post.val3._axes import configurations
from kerfpath.post.val3._settings import Val3Settings

__all__ = ["check"]


def check(program: Program, settings: Val3Settings) -> Iterator[ProgramIssue]:
    """Yield the issues that only this language has."""
    for section in program.sections:
        yield from warn_of_late_switches(section, "VAL 3")
        q = np.array([move.q for move in section.moves]).reshape(-1, 6)
        yield from warn_of_changed_postures(section, configurations(program.robot, q))
