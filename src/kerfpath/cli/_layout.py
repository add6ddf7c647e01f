"""`kerfpath layout`: find the best placement and its gain, or why no placement is feasible."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from rich.markup import escape

from kerfpath.cli._show import (
    busy,
    compile_kernels,
    out,
    print_json,
    progress_bars,
    resumable,
    show_files,
    table,
)
from kerfpath.job import Goal, make_folder
from kerfpath.planner import FINER, ON_THIS_GRID
from kerfpath.report import LayoutEntry
from kerfpath.study import layout, layout_entry, ranges_of, write_layout

__all__ = ["LayoutOptions", "show_layout"]

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
    as_json: bool,
) -> bool:
    """Find the best placement, write its files, print it; return whether any is feasible."""
    ranges = ranges_of(vary)
    make_folder(folder)
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
    if as_json:
        print_json({**entry, "files": [str(path) for path in written]})
        return bool(entry["feasible"])
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
    said = f"{tried} placements tried, {count} feasible, {solved}"
    if entry["off_grid"]:
        out.print(f"{said} planned over continuous rotation; this one is the best of them")
        out.print(_claim(entry, unit))
        return
    others = (
        "be better" if entry["open_bound"] is None else f"reach {entry['open_bound']:.3f}{unit}"
    )
    proved = "it is proved that no other of them is better there"
    still = f"others of them may {others}"
    out.print(f"{said} solved exactly; {proved if entry['proved'] else still}")
    out.print(f"speeds and displacements are those {ON_THIS_GRID}; {FINER}: see kerfpath speed")


def _claim(entry: LayoutEntry, unit: str) -> str:
    """Return what is proved about the placements that were not planned."""
    said = []
    if count := entry["stages"].get("proved", 0):
        said.append(f"{count} proved to be no faster at any rotation")
    if count := entry["estimated"]:
        best = "" if entry["open_bound"] is None else f" (at best {entry['open_bound']:.3f}{unit})"
        said.append(f"{count} judged by an estimate alone{best}, which proves nothing")
    return f"of the others: {'; '.join(said)}" if said else "no other placement can be better"


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
