"""An issue that the checks find in a program."""

from __future__ import annotations

from dataclasses import dataclass

from kerfpath._repr import short_repr
from kerfpath.auditor import Level

__all__ = ["ProgramIssue"]


@dataclass(frozen=True, slots=True)
class ProgramIssue:
    """An error in a program, or a warning to its user.

    Parameters
    ----------
    level : {"error", "warning"}
        An error forbids writing the program.
    code : str
        Kind of the issue.
    message : str
        What was expected, what came, and what to do.
    place : str
        Place in the program.
    """

    level: Level
    code: str
    message: str
    place: str

    __repr__ = short_repr

    def __str__(self) -> str:
        return f"{self.place}: {self.message}"
