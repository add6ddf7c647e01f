"""Programs as text: refused by their preflight, formatted, read back, and written."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path

import numpy as np

from kerfpath.errors import InputError
from kerfpath.plans import Plan
from kerfpath.post._build import build_program
from kerfpath.post._compare import deviations
from kerfpath.post._languages import language as find_language
from kerfpath.post._meant import Meant
from kerfpath.post._preflight import preflight
from kerfpath.post._program import Program
from kerfpath.post._read import ReadProgram
from kerfpath.post._settings import Settings
from kerfpath.robots import Robot

__all__ = ["post", "read_program", "write_files", "write_program"]


def post(
    source: Program | Sequence[Plan],
    language: str = "rapid",
    settings: Settings | None = None,
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
    settings : Settings, optional
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
    chosen = find_language(language)
    settings = chosen.settings() if settings is None else settings
    program = source if isinstance(source, Program) else build_program(source)
    refused = [i for i in preflight(program, language, settings) if strict or i.level == "error"]
    if not refused:
        settings = chosen.completed(settings)
        files = chosen.formatter(program, settings).files()
        if chosen.read is None:
            return files
        read = read_program(files, language, program.robot, settings)
        refused = deviations(program, read, chosen, settings)
    if refused:
        more = f" (and {len(refused) - 1} more)" if len(refused) > 1 else ""
        raise InputError(f"program {program.name!r}: {refused[0]}{more}")
    return files


def read_program(
    files: Mapping[str, str],
    language: str,
    robot: Robot,
    settings: Settings | None = None,
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
    settings : Settings, optional
        With which it was written; default: the language's defaults.
    main : str, optional
        The file that is started; default: the first.

    Raises
    ------
    InputError
        An unknown language or one without a reader, a file that is not there, a line that is not
        of our making, or that does not fit the others: file and line.
    """
    chosen = find_language(language)
    settings = chosen.completed(settings)
    if chosen.read is None:
        raise InputError(f"language {language!r} has no reader, so that its programs stay unread")
    main = next(iter(files)) if main is None else main
    try:
        with np.errstate(over="raise", divide="raise", invalid="raise"):
            return chosen.read(main, Meant(files), robot, settings)
    except KeyError as missing:
        raise InputError(f"{main}: the file {missing.args[0]!r} is not there") from None
    except InputError:
        raise
    except (ArithmeticError, ValueError) as error:
        raise InputError(
            f"{main}: numbers in it make no pose or joints ({error}); write the program again"
        ) from None


def write_files(folder: str | os.PathLike[str], files: Mapping[str, str]) -> list[Path]:
    """Write the files of a program into a folder, each whole or not at all, the first one last.

    So the program that is started calls no file that is not there yet.

    Raises
    ------
    InputError
        A file cannot be written.
    """
    paths = {name: Path(folder) / name for name in files}
    for name in reversed(list(files)):
        try:
            paths[name].parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"{paths[name].parent}: no folder can be made ({error})") from None
        write_program(paths[name], files[name])
    return list(paths.values())


def write_program(path: str | os.PathLike[str], text: str) -> None:
    """Write `text` to the file at `path`, whole or not at all.

    The text goes to a file beside it first, so that no controller ever loads half a program.

    Raises
    ------
    InputError
        The file cannot be written.
    """
    target = Path(path)
    if not target.name:
        raise InputError(f"cannot write the program to {str(path)!r}: expected a file name")
    beside = target.with_name(f".{target.name}.{os.getpid()}.tmp")
    try:
        beside.write_bytes(text.encode("utf-8"))
        beside.replace(target)
    except OSError as error:
        with suppress(OSError):
            beside.unlink(missing_ok=True)
        raise InputError(f"cannot write the program to {target}: {error.strerror}") from None
