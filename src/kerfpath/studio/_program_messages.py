"""Messages about the text of a program; README.md in this folder defines their keys."""

from __future__ import annotations

from typing import Literal

from kerfpath.studio._numbers import Message, Numbers

__all__ = ["FileEntry", "FindingEntry", "ProgramTextMessage"]


class FileEntry(Message):
    """A file of the program, its text, and the times of its lines."""

    name: str
    text: str
    lines: list[int]
    begin: Numbers
    end: Numbers


class FindingEntry(Message):
    """A finding of the preflight of a program, and its place."""

    level: str
    message: str
    place: str
    file: str | None
    line: int | None


class ProgramTextMessage(Message):
    """The program in a robot's language."""

    type: Literal["program_text"] = "program_text"
    language: str
    revision: int
    files: list[FileEntry]
    findings: list[FindingEntry]
    notes: list[str]
    faults: list[str]
