"""Programs too long for one file, divided between contours: never where the beam is on."""

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
    """Return the program with names of sections cut to `longest_name`, and none twice or taken."""
    texts = (section.name for section in program.sections)
    names = identifiers(texts, taken=(program.name, *taken), longest=longest_name)
    sections = (replace(s, name=name) for s, name in zip(program.sections, names, strict=True))
    return replace(program, sections=tuple(sections))


def divide_sections(
    sections: Sequence[Section], lines: Sequence[int], most_lines: int
) -> list[list[Section]]:
    """Return sections, of so many lines each, in order, in files of at most `most_lines` lines.

    A section that is longer by itself has a file of its own: a file ends where the robot stands
    with the beam off, as between two sections.
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
    """Yield the contours of more lines than a file is to have: none is divided.

    A warning where the language gives each of them a file of its own.
    """
    if written.too_long is None:
        return
    remedy = "allow more with lines_per_file, or take fewer nodes (spacing_mm) or arcs (arcs_mm)"
    kept = "" if written.too_long == "error" else ", and has a file of its own"
    most = written.room()
    for name, count in written.lengths().items():
        if count > most:
            message = (
                f"the contour has {count} lines, lines_per_file allows {most}; it is not "
                f"divided, as the robot could stop there with the beam on{kept}: {remedy}"
            )
            yield ProgramIssue(written.too_long, "file-length", message, name)


def divide_program(
    program: Program, lines: Sequence[int], room: int, longest_name: int
) -> dict[str, list[Section]]:
    """Return the files, by their names, that sections of so many lines each are divided in."""
    groups = divide_sections(program.sections, lines, room)
    taken = [program.name, *(section.name for section in program.sections)]
    names = identifiers([program.name] * len(groups), taken=taken, longest=longest_name)
    return dict(zip(names, groups, strict=True))


def require_one_file(name: str, lines: Sequence[str], most_lines: int) -> dict[str, str]:
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
