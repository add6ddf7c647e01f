"""`kerfpath post`: the program of a plan, written or printed."""

from __future__ import annotations

from pathlib import Path

from rich.markup import escape

from kerfpath.cli._show import out, print_json
from kerfpath.job import program_from_file
from kerfpath.post import write_files, write_program

__all__ = ["write_post"]


def write_post(
    plan_file: Path, language: str, output: Path | None, *, strict: bool, as_json: bool,
    dry_share: float | None = None,
) -> None:  # fmt: skip
    """Write the files of a plan's program to `output`; print them without one.

    One file is written as `output`; several, or one into a folder that is there, keep their names.
    """
    files, warnings = program_from_file(plan_file, language, strict=strict, dry_share=dry_share)
    written: list[Path] = []
    if output is not None and (len(files) > 1 or output.is_dir()):
        written = write_files(output, files)
    elif output is not None:
        write_program(output, next(iter(files.values())))
        written = [output]
    if as_json:
        print_json(
            {
                "language": language,
                "files": [str(path) for path in written],
                "texts": None if written else files,
                "notes": warnings,
            }
        )
    elif not written:
        for name, text in files.items():
            if len(files) > 1:
                print(f"----- {name} -----")
            print(text, end="")
    else:
        for warning in warnings:
            out.print(f"note: {escape(warning)}")
        for path in written:
            out.print(f"wrote {escape(str(path))}")
