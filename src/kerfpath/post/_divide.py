"""Programs too long for one routine or file, divided."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from kerfpath.errors import InputError
from kerfpath.post._names import LONGEST_NAME, identifiers
from kerfpath.post._program import Program, Section

__all__ = ["divided", "in_files", "in_one_file"]


def divided(program: Program, most_steps: int, *, longest_name: int = LONGEST_NAME) -> Program:
    """Return the program with no section of more than `most_steps` steps.

    The parts of a section that is longer are called by its name and a number; the laser may stay
    on from one to the next. Names are cut to `longest_name` characters, and stay different.
    """
    parts = [
        replace(section, steps=section.steps[first : first + most_steps])
        for section in program.sections
        for first in range(0, max(len(section.steps), 1), most_steps)
    ]
    names = identifiers((part.name for part in parts), taken=(program.name,), longest=longest_name)
    named = [replace(part, name=name) for part, name in zip(parts, names, strict=True)]
    return replace(program, sections=tuple(named))


def in_files(
    sections: Sequence[Section], lines: Sequence[int], most_lines: int
) -> list[list[Section]]:
    """Return sections, of so many lines each, in order, in files of at most `most_lines` lines.

    A section that is longer by itself has a file of its own.
    """
    files: list[list[Section]] = []
    room = 0
    for section, count in zip(sections, lines, strict=True):
        if not files or count > room:
            files.append([])
            room = most_lines
        files[-1].append(section)
        room -= count
    return files


def in_one_file(name: str, lines: Sequence[str], most_lines: int) -> dict[str, str]:
    """Return the text of a program that cannot be divided, by the name of its file.

    Raises
    ------
    InputError
        It has more than `most_lines` lines.
    """
    if len(lines) > most_lines:
        raise InputError(
            f"{name}: the program has {len(lines)} lines, lines_per_file allows {most_lines}, and "
            "this language cannot divide it; cut fewer contours in one program, or allow more lines"
        )
    return {name: "\n".join([*lines, ""])}
