"""Programs as text: checked by the preflight, formatted, and read back."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from kerfpath.arrays import short_repr
from kerfpath.errors import InputError
from kerfpath.plans import Plan
from kerfpath.post.build import build_program
from kerfpath.post.checks import preflight
from kerfpath.post.comparison import deviations
from kerfpath.post.flow import unsafe_paths
from kerfpath.post.languages import Language, LanguageSettings
from kerfpath.post.languages import language as find_language
from kerfpath.post.line_reader import CheckedTexts
from kerfpath.post.program import Program, ProgramIssue
from kerfpath.post.read_program import ReadProgram
from kerfpath.robots import Robot


def post(
    source: Program | Sequence[Plan],
    language: str = "rapid",
    settings: LanguageSettings | None = None,
    *,
    strict: bool = False,
) -> dict[str, str]:
    """Return the files of a program in a robot language; the same input gives the same bytes.

    The text is read back first, compared with the program, and every path through it followed.

    Parameters
    ----------
    source : Program or sequence of Plan
        Plans become a program with the defaults of `build_program`.
    language : str
        One of `languages()`.
    settings : LanguageSettings, optional
        Settings of the language; default: its defaults.
    strict : bool
        Treat warnings as errors.

    Returns
    -------
    dict of str to str
        Text of every file by its name, the one to start first.

    Raises
    ------
    InputError
        The language is unknown, the settings are those of another language, the preflight finds
        errors, the text does not read back as the program, or a path through it is not safe.
    """
    program = source if isinstance(source, Program) else build_program(source)
    return post_and_read(program, language, settings, strict=strict).files


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ProgramText:
    """A program as text.

    Parameters
    ----------
    files : dict of str to str
        Text of every file by its name, the one to start first.
    read : ReadProgram or None
        The program as read back; None if the language has no reader.
    warnings : tuple of ProgramIssue
        Warnings of the preflight.
    """

    files: dict[str, str]
    read: ReadProgram | None
    warnings: tuple[ProgramIssue, ...]

    __repr__ = short_repr


def post_and_read(
    program: Program,
    language: str = "rapid",
    settings: LanguageSettings | None = None,
    *,
    strict: bool = False,
) -> ProgramText:
    """Return a program as text, what was read back of it, and the warnings of its preflight.

    Arguments and errors are those of `post`.
    """
    chosen = find_language(language)
    settings = chosen.settings() if settings is None else settings
    issues = preflight(program, language, settings)
    refused = [i for i in issues if strict or i.level == "error"]
    read = None
    if not refused:
        settings = chosen.completed(settings)
        files = chosen.formatter(program, settings).files()
        if chosen.read is not None:
            read = read_program(files, language, program.robot, settings)
            refused = deviations(program, read, chosen, settings) or unsafe_paths(read)
    if refused:
        more = f" (and {len(refused) - 1} more)" if len(refused) > 1 else ""
        raise InputError(f"program {program.name!r}: {refused[0]}{more}")
    return ProgramText(files=files, read=read, warnings=tuple(issues))


def read_program(
    files: Mapping[str, str],
    language: str,
    robot: Robot,
    settings: LanguageSettings | None = None,
    *,
    main: str | None = None,
) -> ReadProgram:
    """Read a program from its files, in the convention of a language.

    Parameters
    ----------
    files : mapping of str to str
        Text of each file by its name; files that are not called are not read.
    language : str
        One of `languages()`.
    robot : Robot
        Robot to whose joints the controller's axes are converted.
    settings : LanguageSettings, optional
        Settings with which it was written; default: those of the language.
    main : str, optional
        The file that is started; default: the first.

    Raises
    ------
    InputError
        The language is unknown or has no reader, a file is missing, the settings or the language
        do not cover the external axes, or a line cannot come from the formatter or does not fit
        the others; then with file and line.
    """
    chosen = find_language(language)
    settings = chosen.completed(settings)
    if chosen.read is None:
        raise InputError(f"language {language!r} has no reader, so its programs cannot be read")
    main = next(iter(files)) if main is None else main
    if robot.externals:
        says = chosen.externals
        unsaid = [chosen.refusal(robot)] if says is None else [*says(robot, settings)]
        if unsaid:
            raise InputError(f"{main}: {unsaid[0]}")
    try:
        with np.errstate(over="raise", divide="raise", invalid="raise"):
            read = chosen.read(main, CheckedTexts(files, chosen.longest_line), robot, settings)
            return replace(read, externals=robot.externals)
    except KeyError as missing:
        raise InputError(f"{main}: the file {missing.args[0]!r} is missing") from None
    except InputError:
        raise
    except (ArithmeticError, ValueError) as error:
        raise InputError(
            f"{main}: its numbers do not form a pose or joints ({error}); write the program again"
        ) from None


def read_as_written(program: Program, chosen: Language, settings: LanguageSettings) -> ReadProgram:
    """Return a program as the reader of a language reads it from the formatter's text.

    There is no preflight and no comparison: the result is a reference for another text.

    Parameters
    ----------
    program : Program
    chosen : Language
        Language with a reader.
    settings : LanguageSettings

    Raises
    ------
    InputError
        The language cannot express the program.
    """
    settings = chosen.completed(settings)
    files = chosen.formatter(program, settings).files()
    return read_program(files, chosen.name, program.robot, settings)
