"""`kerfpath pareto`: find the front of a contour, or write a plan picked from it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rich.markup import escape

from kerfpath.cli._drawing import show_drawing
from kerfpath.cli._plan import finish_run
from kerfpath.cli._show import (
    busy,
    compile_kernels,
    out,
    print_json,
    progress_bars,
    show_files,
    sweep_bar,
    table,
)
from kerfpath.front import Front, SearchKind
from kerfpath.job import make_folder, read_job, require_folder, require_language
from kerfpath.study import JobFront, axes_of, pareto_of_job, plan_picked, read_pick, write_pareto

__all__ = ["pick_plan", "show_front"]

SHOWN = 12
"""Most rows of the table; the report has all plans."""


def show_front(
    job_file: Path,
    folder: Path,
    *,
    contour: str | None,
    criteria: Sequence[str],
    runs: int,
    search: SearchKind,
    seed: int,
    ahead: int,
    scheduler: str | None,
    processes: int | None,
    as_json: bool,
) -> None:
    """Find the front of a contour, write pareto.json and pareto.html, and print its plans."""
    make_folder(folder)
    compile_kernels()
    with sweep_bar("runs") as progress:
        found = pareto_of_job(
            job_file,
            store=folder / "pareto.sqlite",
            contour=contour,
            criteria=criteria,
            runs=runs,
            search=search,
            seed=seed,
            ahead=ahead,
            scheduler=scheduler,
            processes=processes,
            progress=progress,
        )
    with busy("writing"):
        written = write_pareto(found, folder)
    if as_json:
        print_json(_entry(found, written))
        return
    front = found.front
    chosen = "" if contour or not found.others else f", the longest of {len(found.others) + 1}"
    out.print(
        f"[bold]{escape(found.contour)}[/]{chosen}: {len(front.runs)} plans that no other beats, "
        f"of {front.feasible} feasible runs of {front.tried}; hypervolume {front.hypervolume:.4f}, "
        f"largest gap {front.gap:.3f}"
    )
    _show_plans(front)
    if any(run.continuous for run in front.runs):
        out.print(front.beyond_the_grid)
    for why, number in front.failures.items():
        out.print(f"no plan in {number} runs: {escape(why)}")
    show_files(written)
    out.print(
        f"to write one: kerfpath pareto {escape(str(job_file))} --out {escape(str(folder))} "
        f"--pick {front.numbers[front.balanced_at]} (the balanced one)"
    )


def _show_plans(front: Front) -> None:
    axes = axes_of(front)
    columns = ["plan", *(f"{axis.name} {axis.unit_and_arrow}" for axis in axes)]
    values = front.values * [axis.shown[0] for axis in axes]
    step = max(1, -(-len(values) // SHOWN))
    rows = [
        [str(front.numbers[i]), *(f"{value:.4g}" for value in values[i])]
        for i in range(0, len(values), step)
    ]
    table(columns, rows, numbers=columns, spare=columns[:3:-1])
    more = f"; shown is one in {step} of the {len(values)} plans, the report has all"
    out.print(f"arrows: the better direction{more if step > 1 else ''}")


def _entry(found: JobFront, written: Sequence[Path]) -> dict[str, object]:
    front = found.front
    return {
        "contour": found.contour,
        "criteria": list(front.criteria),
        "units": list(front.units),
        "plans": [
            {"number": number, "values": values}
            for number, values in zip(front.numbers, front.values.tolist(), strict=True)
        ],
        "balanced": front.numbers[front.balanced_at],
        "tried": front.tried,
        "feasible": front.feasible,
        "failures": dict(front.failures),
        "hypervolume": front.hypervolume,
        "gap": front.gap,
        "on_grid": len(front.on_grid),
        "left_behind": int(front.left_behind.sum()),
        "files": [str(path) for path in written],
    }


def pick_plan(
    job_file: Path, folder: Path, which: str, *, refine: bool, strict: bool, as_json: bool
) -> None:
    """Plan the job with the picked plan of one contour, and write its files.

    Raises
    ------
    typer.Exit
        Code 1: some contour has no plan that passes its audit.
    """
    pick = read_pick(folder, job_file, which)
    to = folder / f"plan-{pick.number}"
    require_folder(to)
    job = read_job(job_file)
    require_language(job)
    compile_kernels(job.robot.kinematics)
    with progress_bars() as progress:
        part, outcome = plan_picked(job_file, pick, refine=refine, progress=progress)
    if not as_json:
        show_drawing(part)
        out.print(f"[bold]{escape(pick.contour)}[/] as plan {pick.number} of its front")
    more = {"picked": {"contour": pick.contour, "number": pick.number, "refined": refine}}
    finish_run(outcome, part, to, as_json=as_json, strict=strict, more=more)
