"""`kerfpath layout --robots`: find the robots that can do a job, and how fast they are."""

from __future__ import annotations

from pathlib import Path

from rich.markup import escape

from kerfpath.cli._show import compile_kernels, out, print_json, show_files, sweep_bar, table
from kerfpath.job import make_folder
from kerfpath.study import (
    ROBOT_COLUMNS,
    ROBOT_NOTES,
    ROBOT_WORDS,
    robot_rows,
    robots_entry,
    which_robots,
    write_robots,
)

__all__ = ["show_robots_for"]


def show_robots_for(
    job: Path,
    folder: Path,
    *,
    scheduler: str | None,
    processes: int | None,
    ratio: str | None,
    as_json: bool,
) -> bool:
    """Print how fast each robot can do a job, write the list; return whether one is fast enough.

    Raises
    ------
    InputError
        As `which_robots`; or the folder cannot be made.
    """
    make_folder(folder)
    if scheduler is None:
        compile_kernels()
    with sweep_bar("robots") as progress:
        found = which_robots(
            job,
            store=folder / "robots.sqlite",
            scheduler=scheduler,
            processes=processes,
            acceleration_ratio=ratio,
            progress=progress,
        )
    written = write_robots(job, found, folder)
    able = any(each.binding and (each.binding.margin or 0.0) >= 1 for each in found)
    if as_json:
        files = [str(path) for path in written]
        print_json({"able": able, "robots": robots_entry(found), "files": files})
        return able
    columns = [f"{what.lower()} {unit}".strip() for what, unit in ROBOT_COLUMNS]
    numbers = [column for i, column in enumerate(columns) if i not in ROBOT_WORDS]
    rows = [[escape(v) for v in row] for row in robot_rows(found)]
    table(columns, rows, numbers=numbers, spare=[columns[1], columns[2], columns[5]])
    out.print(" ".join(ROBOT_NOTES))
    show_files(written)
    return able
