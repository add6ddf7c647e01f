"""What only RAPID has to be told of: contours longer than a module is to be."""

from __future__ import annotations

from collections.abc import Iterator

from kerfpath.post._divide import long_contours
from kerfpath.post._issue import ProgramIssue
from kerfpath.post._program import Program
from kerfpath.post.rapid._settings import RapidSettings
from kerfpath.post.rapid._write import Rapid

__all__ = ["check"]


def check(program: Program, settings: RapidSettings) -> Iterator[ProgramIssue]:
    """Yield the issues that only this language has."""
    yield from long_contours(Rapid(program, settings).lengths(), settings.lines_per_file, "warning")
