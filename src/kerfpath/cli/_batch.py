"""`kerfpath batch`: plan many jobs and print a row for each."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rich.markup import escape

from kerfpath.cli._show import compile_kernels, out, print_json, sweep_bar, table
from kerfpath.study import BatchResult, batch

__all__ = ["plan_jobs"]


def plan_jobs(
    jobs: Sequence[Path],
    folder: Path,
    scheduler: str | None,
    processes: int | None,
    *,
    as_json: bool,
) -> bool:
    """Plan jobs, write their files and print a row for each; return whether all have passed."""
    if scheduler is None:
        compile_kernels()
    with sweep_bar("jobs") as progress:
        found = batch(jobs, folder, scheduler=scheduler, processes=processes, progress=progress)
    passed = sum(row.passed for row in found)
    if as_json:
        print_json({"passed": passed == len(found), "jobs": [_entry(row) for row in found]})
    else:
        columns = ["job", "contours", "passed", "cutting s", "seconds", "program or reason"]
        table(columns, [_cells(row) for row in found], numbers=columns[1:5])
        out.print(
            f"{passed} of {len(found)} jobs passed; their files are in {escape(str(folder))}, "
            "in one folder for each job"
        )
    return passed == len(found)


def _entry(row: BatchResult) -> dict[str, object]:
    return {
        "job": str(row.job),
        "folder": str(row.folder),
        "passed": row.passed,
        "contours": row.contours,
        "contours_passed": row.kept,
        "cutting_time_s": row.cutting_time,
        "program": row.program or None,
        "reason": row.reason or None,
        "notes": list(row.notes),
        "seconds": row.seconds,
    }


def _cells(row: BatchResult) -> list[str]:
    return [
        escape(row.job.name),
        f"{row.kept}/{row.contours}" if row.contours else "-",
        "yes" if row.passed else "NO",
        "-" if row.cutting_time is None else f"{row.cutting_time:.2f}",
        f"{row.seconds:.1f}",
        escape(row.reason or row.program or 'none: language = "none"'),
    ]
