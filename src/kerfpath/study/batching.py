"""A batch: plan, audit and write many jobs, each as a separate task."""

from __future__ import annotations

import base64
import json
import os
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypedDict

from kerfpath.arrays import short_repr
from kerfpath.errors import InputError
from kerfpath.job import (
    FileTexts,
    JobResult,
    make_folder,
    read_job,
    require_folder,
    require_language,
    require_place,
    result_texts,
    run_job,
    stale_program,
)
from kerfpath.post import ProgramOptions, replace_program
from kerfpath.progress import Progress, no_progress
from kerfpath.report import with_library, without_library
from kerfpath.study.loaded_job import job_key, load_job
from kerfpath.sweep import Result, Sweep

STORE = "batch.sqlite"
"""Name of the store file in the folder of a batch."""
PAGE = "report.html"
"""The report of a run; it is mostly a script library, which is not stored with each result."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BatchResult:
    """The result of one job of a batch.

    Parameters
    ----------
    job, folder : Path
        The job file, and the folder with the files of its run.
    passed : bool
        Whether every contour has a plan that passes its audit, the transfer moves pass too, and
        the program that the job asks for is written.
    contours, kept : int
        Number of contours, and number of those with a plan that passes its audit; 0 where the job
        is refused.
    cutting_time : float s, optional
        Cutting time of all contours; None unless each has a plan.
    program : str
        Name of the program file in the folder; empty where there is none.
    reason : str
        Why the job has not passed; empty where it has.
    notes : tuple of str
        Notes on the files, as `kerfpath plan` prints them.
    seconds : float s
        Time for reading, planning and auditing.
    """

    job: Path
    folder: Path
    passed: bool
    contours: int = 0
    kept: int = 0
    cutting_time: float | None = None
    program: str = ""
    reason: str = ""
    notes: tuple[str, ...] = ()
    seconds: float = 0.0

    __repr__ = short_repr


def batch(
    jobs: Sequence[str | os.PathLike[str]],
    out: str | os.PathLike[str],
    *,
    scheduler: str | None = None,
    processes: int | None = None,
    progress: Progress = no_progress,
) -> list[BatchResult]:
    """Plan, audit and write many jobs as `kerfpath plan` does; a failing job does not stop others.

    Results are stored in `out` as they come: a second call plans only jobs that are new or have
    changed, and writes files that are missing or differ. Files are written by this process, so
    workers need only the job files.

    Parameters
    ----------
    jobs : sequence of path
        Job files, at the same path on every worker.
    out : path
        Folder for the store and for one folder per job, named after the job file.
    scheduler, processes, progress
        As in `kerfpath.sweep.run`.

    Returns
    -------
    list of BatchResult
        In the order of `jobs`.

    Raises
    ------
    InputError
        There are no jobs; two would share a folder; a file is where a folder should be; a job
        changes during the batch; and as `kerfpath.sweep.run`.
    """
    out = Path(out)
    paths = [Path(job) for job in jobs]
    folders = _folders(paths, out)
    make_folder(out)
    found: list[BatchResult] = []
    with Sweep(
        plan_job, store=out / STORE, scheduler=scheduler, processes=processes, progress=progress
    ) as tasks:
        asked = [_submit(tasks, *each) for each in zip(paths, folders, strict=True)]
        for path, folder, given in zip(paths, folders, asked, strict=True):
            if isinstance(given, InputError):
                found.append(BatchResult(job=path, folder=folder, passed=False, reason=str(given)))
            else:
                options, key = given
                found.append(_written(path, folder, options, tasks.result(key)))
    return found


def _folders(paths: Sequence[Path], out: Path) -> list[Path]:
    """Return the folder of each job.

    Raises
    ------
    InputError
        There are no jobs, two have the same name, or a file is where a folder should be.
    """
    if not paths:
        raise InputError("no jobs: a batch needs at least one job file")
    first: dict[str, Path] = {}
    for path in paths:
        other = first.setdefault(path.stem.casefold(), path)
        if other is not path:
            raise InputError(
                f"{other} and {path} would both be written to {out / path.stem}; rename one of "
                "them, or plan it in a batch with another --out"
            )
    folders = [out / path.stem for path in paths]
    for folder in folders:
        require_folder(folder)
    return folders


def _submit(tasks: Sweep, path: Path, folder: Path) -> tuple[ProgramOptions, str] | InputError:
    """Submit a job; return its program options and the key of its task, or the error in it."""
    try:
        key = job_key(path)  # before it is read: a task whose file has changed since is refused
        job = read_job(path)
        require_place(job, folder)
        return job.program, tasks.submit(**key)
    except InputError as error:
        return error


class PlannedData(TypedDict):
    """The result of a job as JSON data: most fields of a `BatchResult`, and its packed files."""

    passed: bool
    contours: int
    kept: int
    cutting_time: float | None
    program: list[str]
    reason: str
    notes: list[str]
    files: str


def plan_job(*, job: str, digest: str) -> PlannedData:
    """Plan and audit a job; this is the task of a batch.

    Raises
    ------
    InputError
        As `run_job`; also where the program's language does not fit the robot.
    """
    found = load_job(job, digest)
    require_language(found.job)
    outcome = run_job(found.job, found.part)
    texts = result_texts(outcome)
    by_contour: dict[str, bool] = {}
    for cut in outcome.cuts:
        by_contour[cut.contour] = by_contour.get(cut.contour, True) and cut.passed
    times = [None if cut.plan is None else float(cut.plan.time[-1]) for cut in outcome.cuts]
    return {
        "passed": outcome.passed and not texts.refused,
        "contours": len(by_contour),
        "kept": sum(by_contour.values()),
        "cutting_time": None if None in times else sum(t for t in times if t is not None),
        "program": list(texts.program),
        "reason": _reason(outcome, texts),
        "notes": [*texts.notes, *texts.faults],
        "files": _pack(texts.files),
    }


def _reason(outcome: JobResult, texts: FileTexts) -> str:
    """Return the first reason why a run has not passed, and how many more there are."""
    reasons = [
        f"{cut.name}: {cut.failure or issue}"
        for cut in outcome.cuts
        if not cut.passed
        for issue in [next((str(c.issue()) for c in cut.checks if not c.ok), "no plan")]
    ]
    if outcome.stuck is not None:
        reasons.append(f"moves between contours: {outcome.stuck}")
    reasons += [f"moves between contours: {c.issue()}" for c in outcome.air if not c.ok]
    reasons += [texts.refused] if texts.refused else []
    more = f" (and {len(reasons) - 1} more)" if len(reasons) > 1 else ""
    return reasons[0] + more if reasons else ""


def _pack(files: dict[str, str]) -> str:
    """Return files as compressed text, a fifth of their size."""
    lean = {name: without_library(t) if name == PAGE else t for name, t in files.items()}
    return base64.b64encode(zlib.compress(json.dumps(lean).encode())).decode()


def _unpack(packed: str) -> dict[str, str]:
    files = json.loads(zlib.decompress(base64.b64decode(packed)))
    return {name: with_library(t) if name == PAGE else t for name, t in files.items()}


def _written(job: Path, folder: Path, options: ProgramOptions, result: Result) -> BatchResult:
    """Write the files of a result that are missing or differ, and return the result."""
    if result.failure is not None:
        reason = result.failure.reason
        return BatchResult(
            job=job, folder=folder, passed=False, reason=reason, seconds=result.seconds
        )
    found: PlannedData = result.value
    program = found["program"]
    replaced = replace_program(folder, _unpack(found["files"]), program)
    notes = found["notes"]
    notes += [f"{path.name} is from an earlier run and was removed" for path in replaced.removed]
    if stale := next(iter(replaced.edited), stale_program(options, folder, program)):
        notes.append(f"{stale.name} is from an earlier run and does not belong to this plan")
    return BatchResult(
        job=job,
        folder=folder,
        passed=found["passed"],
        contours=found["contours"],
        kept=found["kept"],
        cutting_time=found["cutting_time"],
        program=program[0] if program else "",
        reason=found["reason"],
        notes=tuple(notes),
        seconds=result.seconds,
    )
