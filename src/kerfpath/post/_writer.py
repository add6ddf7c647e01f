"""Write robot programs: preflight, format, and put the text in its file at one stroke."""

from __future__ import annotations

import os
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from kerfpath.errors import InputError
from kerfpath.plans import Plan
from kerfpath.post._languages import language as find_language
from kerfpath.post._preflight import preflight
from kerfpath.post._program import Program, build_program

__all__ = ["post", "write_program"]


def post(source: Program | Sequence[Plan], language: str = "rapid") -> str:
    """Return the text of a program in a robot language; the same input gives the same text.

    Parameters
    ----------
    source : Program or sequence of Plan
        Plans become a program with the defaults of `build_program`.
    language : str
        One of `LANGUAGES`.

    Raises
    ------
    InputError
        An unknown language, or a program that its preflight refuses.
    """
    chosen = find_language(language)
    program = source if isinstance(source, Program) else build_program(source)
    refusals = [issue for issue in preflight(program, language) if issue.level == "error"]
    if refusals:
        more = f" (and {len(refusals) - 1} more)" if len(refusals) > 1 else ""
        raise InputError(f"program {program.name!r}: {refusals[0]}{more}")
    return chosen.write(program)


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
