"""Output of the commands that plan many times: batch, pareto and layout."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from rich.markup import escape

from kerfpath.cli.drawing_output import show_drawing
from kerfpath.cli.plan_output import finish_run
from kerfpath.cli.show import (
    busy,
    compile_kernels,
    out,
    print_json,
    progress_bars,
    resumable,
    show_files,
    sweep_bar,
    table,
)
from kerfpath.front import Front, SearchKind
from kerfpath.job import Goal, make_folder, read_job, require_language, require_place
from kerfpath.planner import FINER, ON_THIS_GRID
from kerfpath.report import LayoutEntry
from kerfpath.study import (
    ROBOT_COLUMNS,
    ROBOT_NOTES,
    ROBOT_WORDS,
    BatchResult,
    JobFront,
    axes_of,
    layout,
    layout_entry,
    pareto_of_job,
    plan_picked,
    ranges_of,
    read_pick,
    robot_rows,
    robots_entry,
    which_robots,
    write_layout,
    write_pareto,
    write_robots,
)
from kerfpath.study import batch as plan_batch

# -----------------------------------------------------------------------------
# `kerfpath batch`: plan many jobs and print a row for each.


def plan_jobs(
    jobs: Sequence[Path], folder: Path, scheduler: str | None, processes: int | None
) -> bool:
    """Plan jobs, write their files and print a row for each; return whether all have passed."""
    if scheduler is None:
        compile_kernels()
    with sweep_bar("jobs") as progress:
        found = plan_batch(
            jobs, folder, scheduler=scheduler, processes=processes, progress=progress
        )
    passed = sum(row.passed for row in found)
    print_json({"passed": passed == len(found), "jobs": [_batch_entry(row) for row in found]})
    columns = ["job", "contours", "passed", "cutting s", "seconds", "program or reason"]
    table(columns, [_cells(row) for row in found], numbers=columns[1:5])
    out.print(
        f"{passed} of {len(found)} jobs passed; their files are in {escape(str(folder))}, "
        "in one folder for each job"
    )
    return passed == len(found)


def _batch_entry(row: BatchResult) -> dict[str, object]:
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


# -----------------------------------------------------------------------------
# `kerfpath pareto`: find the front of a contour, or write a plan picked from it.

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
) -> None:
    """Find the front of a contour, write pareto.json and pareto.html, and print its plans."""
    make_folder(folder, ("pareto.json", "pareto.html"))
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
    print_json(_pareto_entry(found, written))
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


def _pareto_entry(found: JobFront, written: Sequence[Path]) -> dict[str, object]:
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


def pick_plan(job_file: Path, folder: Path, which: str, *, refine: bool, strict: bool) -> None:
    """Plan the job with the picked plan of one contour, and write its files.

    Raises
    ------
    typer.Exit
        Code 1: some contour has no plan that passes its audit.
    """
    pick = read_pick(folder, job_file, which)
    to = folder / f"plan-{pick.number}"
    job = read_job(job_file)
    require_language(job)
    require_place(job, to)
    compile_kernels(job.robot.kinematics)
    with progress_bars() as progress:
        part, outcome = plan_picked(job_file, pick, refine=refine, progress=progress)
    show_drawing(part)
    out.print(f"[bold]{escape(pick.contour)}[/] as plan {pick.number} of its front")
    more = {"picked": {"contour": pick.contour, "number": pick.number, "refined": refine}}
    finish_run(outcome, part, to, strict=strict, more=more)


# -----------------------------------------------------------------------------
# `kerfpath layout --robots`: find the robots that can do a job, and how fast they are.


def show_robots_for(
    job: Path,
    folder: Path,
    *,
    scheduler: str | None,
    processes: int | None,
    ratio: str | None,
) -> bool:
    """Print how fast each robot can do a job, write the list; return whether one is fast enough.

    Raises
    ------
    InputError
        As `which_robots`; or the folder cannot be made.
    """
    make_folder(folder, ("robots.json", "robots.html"))
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
    files = [str(path) for path in written]
    print_json({"able": able, "robots": robots_entry(found), "files": files})
    columns = [f"{what.lower()} {unit}".strip() for what, unit in ROBOT_COLUMNS]
    numbers = [column for i, column in enumerate(columns) if i not in ROBOT_WORDS]
    rows = [[escape(v) for v in row] for row in robot_rows(found)]
    table(columns, rows, numbers=numbers, spare=[columns[1], columns[2], columns[5]])
    out.print(" ".join(ROBOT_NOTES))
    show_files(written)
    return able


# -----------------------------------------------------------------------------
# `kerfpath layout`: find the best placement and its gain, or why no placement is feasible.

REMEDIES = {
    "unreachable": "bring the part nearer, allow another posture, or widen the ranges",
    "collision": "give the head more room, lower near_miss_mm, or widen the ranges",
    "speed": "ask for lower speeds, or widen the ranges",
}
ON_ONE_LINE = 200
"""Most characters of a reason that are printed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LayoutOptions:
    """Options of `kerfpath.study.layout` on the command line; None takes the value of the job."""

    goal: Goal | None
    evaluations: int | None
    seed: int | None
    tolerance_mm: float | None
    tolerance_deg: float | None
    map_points: int | None

    def given(self) -> list[str]:
        """Return the names of the options that were given, as typed."""
        values = asdict(self).items()
        return [f"--{name.replace('_', '-')}" for name, value in values if value is not None]


def show_layout(
    job: Path,
    folder: Path,
    *,
    vary: Sequence[str],
    options: LayoutOptions,
    scheduler: str | None,
    processes: int | None,
) -> bool:
    """Find the best placement, write its files, print it; return whether any is feasible."""
    ranges = ranges_of(vary)
    make_folder(folder, ("layout.json", "layout.html", "placed.toml"))
    compile_kernels()
    with progress_bars("") as progress, resumable():
        found = layout(
            job,
            store=folder / "layout.sqlite",
            ranges=ranges,
            scheduler=scheduler,
            processes=processes,
            progress=progress,
            **asdict(options),
        )
    with busy("writing"):
        written = write_layout(found, folder)
    entry = layout_entry(found)
    print_json({**entry, "files": [str(path) for path in written]})
    by_default = " (by default: no range in [layout] or --vary)" if found.by_default else ""
    spans = ", ".join(f"{name} {low:g} to {high:g}" for name, (low, high) in found.ranges.items())
    out.print(escape(f"varied{by_default}: {spans}"))
    _show_best(entry)
    _show_why(entry)
    show_files(written)
    return bool(entry["feasible"])


def _show_best(entry: LayoutEntry) -> None:
    best, shipped, unit = entry["best"], entry["shipped"], f" {entry['unit']}".rstrip()
    if best is None:
        return
    tried, solved = len(entry["tried"]), entry["exact_searches"]
    motion = entry["goal"] == "motion"
    rows = []
    for contour in entry["contours"]:
        row = [escape(contour["name"])]
        for side in (contour["before"], contour["after"]):
            side = side or {}
            value = side.get("value") if motion else side.get("fastest_m_min")
            row.append("-" if value is None else f"{value:.3f}")
            known = "joint" in side
            binds = f"joint {side['joint']} {side['limit']}" if known else ""
            row += [] if motion else [binds, str(side["node"]) if known else ""]
        rows.append(row)
    what = "displacement" if motion else "m/min"
    sides = [[f"{when} {what}", *([] if motion else [f"binds {when}", f"node {when}"])]
             for when in ("before", "after")]  # fmt: skip
    columns = ["contour", *sides[0], *sides[1]]
    spare = [c for c in columns if "node" in c or c == "binds before"]
    table(columns, rows, numbers=[c for c in columns if what in c or "node" in c], spare=spare)
    offsets = ", ".join(f"{name} = {value:g}" for name, value in best["offsets"].items())
    out.print(f"[bold]best placement[/]: {escape(offsets)}")
    was = f"{shipped['value']:.3f}{unit}" if shipped["value"] is not None else shipped["status"]
    gain = "" if best["gain"] is None else f", {100 * best['gain']:+.1f} %"
    out.print(f"{entry['goal']}: {best['value']:.3f}{unit}, as placed in the job {was}{gain}")
    count = entry["statuses"].get("feasible", 0)
    counts = f"{tried} placements tried, {count} feasible, {solved}"
    if entry["off_grid"]:
        out.print(f"{counts} planned over continuous rotation; this one is the best of them")
        out.print(_claim(entry, unit))
        return
    others = (
        "be better" if entry["open_bound"] is None else f"reach {entry['open_bound']:.3f}{unit}"
    )
    proved = "it is proved that no other of them is better there"
    still = f"others of them may {others}"
    out.print(f"{counts} solved exactly; {proved if entry['proved'] else still}")
    out.print(f"speeds and displacements are those {ON_THIS_GRID}; {FINER}: see kerfpath speed")


def _claim(entry: LayoutEntry, unit: str) -> str:
    """Return what is proved about the placements that were not planned."""
    parts = []
    if count := entry["stages"].get("proved", 0):
        parts.append(f"{count} proved to be no faster at any rotation")
    if count := entry["estimated"]:
        best = "" if entry["open_bound"] is None else f" (at best {entry['open_bound']:.3f}{unit})"
        parts.append(f"{count} judged by an estimate alone{best}, which proves nothing")
    return f"of the others: {'; '.join(parts)}" if parts else "no other placement can be better"


def _show_why(entry: LayoutEntry) -> None:
    near = entry["nearest"]
    if near is None:
        return
    parts = []
    for why in entry["reasons"]:
        at = f" ({why['contour']}, node {why['node']})" if why["contour"] else ""
        parts.append(f"{why['count']} {why['status']}{at}")
    worst = max(REMEDIES, key=lambda status: entry["statuses"].get(status, 0))
    among = "by samples of the rotation" if entry["off_grid"] else ON_THIS_GRID
    out.print(
        escape(
            f"no placement is feasible {among}: of {len(entry['tried'])} tried "
            f"{', '.join(parts)}: {REMEDIES[worst]}; {FINER}"
        )
    )
    offsets = ", ".join(f"{name} = {value:g}" for name, value in near["offsets"].items())
    where = f"{near['contour']}, node {near['node']} of {near['nodes']}: " if "node" in near else ""
    out.print(escape(f"nearest: {offsets}; {where}{near['reason'][:ON_ONE_LINE]}"))
