"""Programs as text: refused by their preflight, formatted, read back, and written."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from kerfpath._repr import short_repr
from kerfpath.errors import InputError
from kerfpath.plans import Plan
from kerfpath.post._build import build_program
from kerfpath.post._compare import deviations
from kerfpath.post._issue import ProgramIssue
from kerfpath.post._languages import Language
from kerfpath.post._languages import language as find_language
from kerfpath.post._meant import CheckedTexts
from kerfpath.post._preflight import preflight
from kerfpath.post._program import Program
from kerfpath.post._read import ReadProgram
from kerfpath.post._settings import LanguageSettings
from kerfpath.robots import Robot

__all__ = ["ProgramText", "post", "post_and_read", "read_as_written", "read_program"]


def post(
    source: Program | Sequence[Plan],
    language: str = "rapid",
    settings: LanguageSettings | None = None,
    *,
    strict: bool = False,
) -> dict[str, str]:
    """Return the files of a program in a robot language; the same input gives the same bytes.

    What is written is read back and compared with the program first.

    Parameters
    ----------
    source : Program or sequence of Plan
        Plans become a program with the defaults of `build_program`.
    language : str
        One of `languages()`.
    settings : LanguageSettings, optional
        Those of the language; default: its defaults.
    strict : bool
        Refuse what is only warned of otherwise.

    Returns
    -------
    dict of str to str
        Text of every file by its name, the one to start first.

    Raises
    ------
    InputError
        An unknown language, settings of another language, a program that its preflight refuses,
        or one that does not read back as it was meant.
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
        What the text says; None where the language has no reader.
    warnings : tuple of ProgramIssue
        Of the preflight.
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

    Arguments and refusals are those of `post`.
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
            refused = deviations(program, read, chosen, settings)
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
    """Return what the files of a program say, in a language's own convention.

    Parameters
    ----------
    files : mapping of str to str
        Text of each file by its name; those that are not called are not looked at.
    language : str
        One of `languages()`.
    robot : Robot
        Whose joints the controller's axes are turned into.
    settings : LanguageSettings, optional
        With which it was written; default: the language's defaults.
    main : str, optional
        The file that is started; default: the first.

    Raises
    ------
    InputError
        An unknown language or one without a reader, a file that is not there, external axes that
        the settings or the language do not say, a line that is not of our making, or that does not
        fit the others: file and line.
    """
    chosen = find_language(language)
    settings = chosen.completed(settings)
    if chosen.read is None:
        raise InputError(f"language {language!r} has no reader, so that its programs stay unread")
    main = next(iter(files)) if main is None else main
    if robot.externals:
        says = chosen.externals
        unsaid = [chosen.refusal(robot)] if says is None else [*says(robot, settings)]
        if unsaid:
            raise InputError(f"{main}: {unsaid[0]}")
    try:
        with np.errstate(over="raise", divide="raise", invalid="raise"):
            read = chosen.read(main, CheckedTexts(files), robot, settings)
            return replace(read, externals=robot.externals)
    except KeyError as missing:
        raise InputError(f"{main}: the file {missing.args[0]!r} is not there") from None
    except InputError:
        raise
    except (ArithmeticError, ValueError) as error:
        raise InputError(
            f"{main}: numbers in it make no pose or joints ({error}); write the program again"
        ) from None


def read_as_written(program: Program, chosen: Language, settings: LanguageSettings) -> ReadProgram:
    """Return what the reader of a language makes of a program that its formatter writes.

    Neither refused nor compared: what a text would say, as a measure for another.

    Parameters
    ----------
    program : Program
    chosen : Language
        With a reader.
    settings : LanguageSettings

    Raises
    ------
    InputError
        The language cannot say it.
    """
    settings = chosen.completed(settings)
    files = chosen.formatter(program, settings).files()
    return read_program(files, chosen.name, program.robot, settings)
