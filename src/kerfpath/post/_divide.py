"""Divide programs that are too long for one file between contours, where the beam is off."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

from kerfpath._names import LONGEST_NAME, identifiers
from kerfpath.errors import InputError
from kerfpath.post._formatter import Formatter
from kerfpath.post._issue import ProgramIssue
from kerfpath.post._program import Program, Section

__all__ = [
    "divide_program",
    "divide_sections",
    "find_long_contours",
    "rename_sections",
    "require_one_file",
]


def rename_sections(
    program: Program, taken: Iterable[str] = (), *, longest_name: int = LONGEST_NAME
) -> Program:
    """Return the program with unique section names of at most `longest_name` characters.

    None of them is the name of the program or in `taken`.
    """
    texts = (section.name for section in program.sections)
    names = identifiers(texts, taken=(program.name, *taken), longest=longest_name)
    sections = (replace(s, name=name) for s, name in zip(program.sections, names, strict=True))
    return replace(program, sections=tuple(sections))


def divide_sections(
    sections: Sequence[Section], lines: Sequence[int], most_lines: int
) -> list[list[Section]]:
    """Return the sections, with their numbers of `lines`, in files of at most `most_lines` lines.

    Their order stays. A longer section gets its own file: a file may only end between two sections,
    where the robot is stopped with the beam off.
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


def find_long_contours(written: Formatter) -> Iterator[ProgramIssue]:
    """Yield an issue for each contour with more lines than a file may have: none is divided.

    It is a warning if the language gives the contour its own file.
    """
    if written.too_long is None:
        return
    remedy = "raise lines_per_file, or use fewer nodes (spacing_mm) or arcs (arcs_mm)"
    kept = "" if written.too_long == "error" else ", and gets its own file"
    most = written.room()
    for name, count in written.lengths().items():
        if count > most:
            message = (
                f"the contour has {count} lines, but lines_per_file allows {most}; it is not "
                f"divided, because the robot could stop there with the beam on{kept}; {remedy}"
            )
            yield ProgramIssue(written.too_long, "file-length", message, name)


def divide_program(
    program: Program, lines: Sequence[int], room: int, longest_name: int
) -> dict[str, list[Section]]:
    """Return the sections of each file by its name; `lines` has the length of each section."""
    groups = divide_sections(program.sections, lines, room)
    taken = [program.name, *(section.name for section in program.sections)]
    names = identifiers([program.name] * len(groups), taken=taken, longest=longest_name)
    return dict(zip(names, groups, strict=True))


def require_one_file(name: str, lines: Sequence[str], most_lines: int) -> dict[str, str]:
    """Return the text of a program that cannot be divided, by the name of its file.

    Raises
    ------
    InputError
        The program has more than `most_lines` lines.
    """
    if len(lines) > most_lines:
        raise InputError(
            f"{name}: the program has {len(lines)} lines, but lines_per_file allows {most_lines} "
            "and this language cannot divide it; cut fewer contours in one program, or raise "
            "lines_per_file"
        )
    return {name: "\n".join([*lines, ""])}
