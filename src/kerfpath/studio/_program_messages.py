"""What the server says of the text of a program, see README.md beside this file."""

from __future__ import annotations

from typing import Literal

from kerfpath.studio._numbers import Message, Numbers

__all__ = ["FileEntry", "FindingEntry", "ProgramTextMessage"]


class FileEntry(Message):
    """A file and its text."""

    name: str
    text: str
    lines: list[int]
    begin: Numbers
    end: Numbers


class FindingEntry(Message):
    """What the preflight of a program finds, and where."""

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
