"""`kerfpath new`: write a first job for a drawing; `kerfpath studio` does so for one without."""

from __future__ import annotations

from pathlib import Path

from rich.markup import escape

from kerfpath.cad import read
from kerfpath.cli.drawing_output import drawn, show_drawing
from kerfpath.cli.show import out, print_json
from kerfpath.errors import InputError
from kerfpath.files import write_whole
from kerfpath.job import Drawing, job_text


def write_new(drawing: Drawing, job: Path | None, *, robot: str | None = None) -> None:
    """Write a first job for a drawing, and print what it has and what to do next.

    Raises
    ------
    InputError
        There is a job already, or as `first_job`.
    """
    job = job or drawing.file.with_suffix(".toml")
    if job.exists():
        raise InputError(
            f"{job}: there is a file already, which is never overwritten; give another name with "
            "--out, or delete it"
        )
    part = drawn(drawing)
    text = job_text(part, job, robot=robot, drawing=drawing)
    _write(job, text)
    print_json({"job": str(job), "drawing": str(drawing.file), "text": text})
    show_drawing(part)
    out.print(f"wrote {escape(str(job))}; now change what is marked as a guess there, then:")
    out.print(f"  kerfpath check {escape(str(job))}", highlight=False)
    out.print(f"  kerfpath plan {escape(str(job))}")


def first_job(drawing: Path) -> Path:
    """Return the job beside a drawing with the same name; write one if there is none.

    Raises
    ------
    InputError
        The drawing cannot be read; the job cannot be written.
    """
    job = drawing.with_suffix(".toml")
    if not job.exists():
        _write(job, job_text(read(drawing), job))
    return job


def _write(job: Path, text: str) -> None:
    try:
        write_whole({job: text.encode()})
    except OSError as error:
        raise InputError(
            f"{job}: cannot write a job for the drawing ({error.strerror}); copy the drawing to "
            "a writable folder"
        ) from None
