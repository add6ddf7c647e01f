"""`kerfpath script`: write a job as a Python script."""

from __future__ import annotations

from pathlib import Path

from rich.markup import escape

from kerfpath._writing import write_whole
from kerfpath.cli._drawing import drawing_of
from kerfpath.cli._show import out
from kerfpath.errors import InputError
from kerfpath.job import prepare, python_script, read_job

__all__ = ["write_script"]


def write_script(path: Path, output: Path | None) -> None:
    """Write the script of a job to a file, or print it without one.

    Raises
    ------
    InputError
        The job cannot be prepared or written as a script, or the file cannot be written.
    """
    job = read_job(path)
    folder = None if output is None else output.absolute().parent
    text = python_script(prepare(job, drawing_of(job)), folder)
    if output is None:
        print(text, end="")
        return
    try:
        write_whole({output: text.encode()})
    except OSError as error:
        raise InputError(f"{output}: cannot write ({error.strerror}); choose another -o") from None
    out.print(f"wrote {escape(str(output))}")
