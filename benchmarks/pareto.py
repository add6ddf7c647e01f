"""The Pareto set: adaptive runs against a plain grid of weights, and what 200 plans take."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from importlib.resources import files
from pathlib import Path
from time import perf_counter
from typing import Any

from benchmarks._figures import Figure, Report, Sheet, in_turn
from kerfpath import Contour, ParetoSet, pareto
from kerfpath.cad import read as read_drawing
from kerfpath.front import Search
from kerfpath.job import read_job
from kerfpath.planner import layered_graph

__all__ = ["run"]

SEARCHES: tuple[Search, ...] = ("adaptive", "grid")
CASES = (("displacement", "velocity", "range"), ("displacement", "acceleration", "range_6"))
COLUMNS = (
    "criteria",
    "search",
    "hypervolume",
    "largest gap",
    "plans",
    "feasible",
    "covers the other",
)

HOW = """\
The trim line of the shipped demo job (`kerfpath/demo/b_pillar.toml`, IRB 4600-60, 9 m/min, 728
nodes, gamma in steps of 1 deg, two postures), its graph built before, every plan audited. Both
searches begin with the same runs, one for each criterion, and may use the whole limits. Grid:
objective, metric, the weight of one joint at a time times 1/4 or 4, eta_v and eta_a of 1, 0.9 and
0.8, in random order. Hypervolume: of the box between the ideal and the reference that the first
runs leave (above 1 where later runs are better than the ideal). Gap: largest distance of neighbours
in one criterion, the box being 1 wide. Covers: share of the other's plans that one here is as good
as or better. One run each, as many threads as cores; then fewer runs on one and on two."""

TARGET = 120.0
"""s for the 200 runs of the first case on two cores."""


def run(*, quick: bool) -> Report:
    """Compare the two searches, and take the time."""
    nodes, options = _task()
    runs, few = (12, 4) if quick else (200, 40)
    figures, rows, findings = [], [], []
    for criteria in CASES:
        made, volume = {}, {}
        for search in SEARCHES:
            start = perf_counter()
            found = pareto(nodes, **options, criteria=criteria, runs=runs, search=search)
            seconds = perf_counter() - start
            made[search], volume[search] = found, found.hypervolume
            what = f"{runs} runs, {search}: {', '.join(criteria)}"
            figures.append(Figure(what=what, values=[seconds]))
        for search, other in (SEARCHES, SEARCHES[::-1]):
            rows.append(_cells(criteria, search, made[search], made[other]))
        findings.append(
            f"{', '.join(criteria)}: hypervolume of the adaptive search over that of the grid "
            f"{volume['adaptive'] / volume['grid']:.3f}"
        )
    took = figures[0].values[0]
    if not quick:
        findings.append(
            f"{runs} adaptive runs: {took:.0f} s; the target of {TARGET:.0f} s on two cores is "
            f"{'met' if took < TARGET else 'missed'}"
        )
    each = {w: partial(pareto, nodes, **options, runs=few, workers=w) for w in (1, 2)}
    timed = in_turn({f"{few} runs, workers {w}": call for w, call in each.items()}, 1)
    figures += [Figure(what=what, values=values) for what, values in timed.items()]
    one, two = (values[0] for values in timed.values())
    findings.append(f"two threads are {one / two:.2f} times as fast as one")
    return Report(
        title="Pareto set: adaptive against a grid of weights",
        how=HOW,
        figures=figures,
        sheets=[Sheet(columns=COLUMNS, rows=rows, words=2)],
        findings=findings,
    )


def _task() -> tuple[Contour, dict[str, Any]]:
    """Return the demo's trim line, and how it is planned, its graph and all."""
    job = read_job(Path(str(files("kerfpath.demo") / "b_pillar.toml")))
    part = read_drawing(job.part_file, unit=job.part_unit)
    task = next(task for task in job.contours if task.name == "trim")
    nodes = task.sample(part.contour(task.pick))
    options: dict[str, Any] = {"tool": job.tool, "placement": job.placement, "robot": job.robot}
    options |= {key: job.plan_options[key] for key in ("gamma_step", "frames", "postures")}
    graph = layered_graph(nodes, **options)
    return nodes, options | {"speed": task.speed, "graph": graph}


def _cells(
    criteria: Sequence[str], search: Search, found: ParetoSet, other: ParetoSet
) -> tuple[str, ...]:
    return (
        ", ".join(criteria),
        search,
        f"{found.hypervolume:.4f}",
        f"{found.gap:.3f}",
        str(len(found.plans)),
        f"{found.feasible} of {found.tried}",
        f"{found.coverage(other):.0%}",
    )
