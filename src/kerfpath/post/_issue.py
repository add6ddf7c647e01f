"""One thing that speaks against a program."""

from __future__ import annotations

from dataclasses import dataclass

from kerfpath._repr import short_repr
from kerfpath.auditor import Level

__all__ = ["ProgramIssue"]


@dataclass(frozen=True, slots=True)
class ProgramIssue:
    """One thing that is wrong with a program, or that its user has to know.

    Parameters
    ----------
    level : {"error", "warning"}
        An error forbids writing the program.
    code : str
        What kind of issue it is.
    message : str
        What was expected, what came, and what to do.
    place : str
        Where in the program.
    """

    level: Level
    code: str
    message: str
    place: str

    __repr__ = short_repr

    def __str__(self) -> str:
        return f"{self.place}: {self.message}"
