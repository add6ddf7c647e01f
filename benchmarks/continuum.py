"""Continuous gamma beside the grid: the demo's contours, steps of gamma, long contours."""

from __future__ import annotations

from dataclasses import replace
from importlib.resources import files
from pathlib import Path

import numpy as np

from benchmarks import _long_contours
from benchmarks._certified import GAP, Task, Weighed, weigh
from benchmarks._figures import Report, Sheet
from kerfpath import Contour
from kerfpath.job import Job, read_job

__all__ = ["run"]

QUICK = ("hole 30 left", "hole 10")
"""Contours of the demo in a quick run."""
STEPPED = ("access opening", "hole 25", "slot", "hole 20")
"""Contours that are planned from several steps of gamma."""
STEPS = (10.0, 5.0, 2.0, 1.0, 0.5)
"""Steps of gamma, deg."""
COLUMNS = (
    "contour",
    "nodes",
    "cost",
    "grid, refined",
    "less by %",
    "bound",
    "gap %",
    "plan s",
    "grid's plan s",
    "certificate s",
)

HOW_DEMO = f"""\
The contours of the shipped demo job (`kerfpath/demo/b_pillar.toml`: IRB 4600-60, its speeds,
spacings, posture and limits). Cost: of `plan` (method "continuous", gamma sampled as the job says).
Grid, refined: method "exact" with `refine` on a grid of 1 deg. Less by: what the first saves of the
second. Bound: what `certify` proves that no motion can fall below, asked for a gap of
{100 * GAP:g} %. One run each, kernels warm; the graph is in the seconds of a plan, built on all
cores."""

HOW_STEPS = """\
Contours of the demo job, planned over continuous gamma whose value function is sampled in coarse
and in fine steps; and, in the same run, on grids of these steps, refined. Spread: the dearest over
the cheapest of the same method, less one. One run each, the graph in the seconds of a plan."""


def run(*, quick: bool) -> list[Report]:
    """Measure all of them."""
    job = read_job(Path(str(files("kerfpath.demo") / "b_pillar.toml")))
    tasks = demo_tasks(job)
    weigh("", 0, tasks[QUICK[1]])  # kernels
    reports = [_demo({name: tasks[name] for name in (QUICK if quick else tasks)})]
    stepped = QUICK[1:] if quick else STEPPED
    reports.append(_steps({n: tasks[n] for n in stepped}, STEPS[::2] if quick else STEPS))
    return reports + _long_contours.run(quick=quick)


def demo_tasks(job: Job) -> dict[str, Task]:
    """Return the tasks of a job by the names of their contours."""
    part = job.read_part()

    def task(nodes: Contour, speed: float) -> Task:
        return Task(
            contour=nodes,
            robot=job.robot,
            tool=job.tool,
            placement=job.placement,
            speed=speed,
            options=replace(job.options, method="continuous"),
        )

    return {
        spec.name: task(spec.sample(part.contour(spec.pick)), spec.speed) for spec in job.contours
    }


def _demo(tasks: dict[str, Task]) -> Report:
    made = [weigh(name, 0, task) for name, task in tasks.items()]
    over = [w for w in made if w.bound is not None and w.cost is not None and w.bound > w.cost]
    return Report(
        title="Continuous gamma: the demo's contours",
        how=HOW_DEMO,
        sheets=[Sheet(columns=COLUMNS, rows=[_cells(w) for w in made])],
        findings=[f"bounds above a cost: {len(over)}"],
    )


def _cells(w: Weighed) -> tuple[str, ...]:
    return (
        w.name,
        str(w.nodes),
        _words(w.cost, "{:.4f}"),
        _words(w.grid_cost, "{:.4f}"),
        _words(w.excess, "{:.3f}", -100),
        _words(w.bound, "{:.4f}"),
        _words(w.gap, "{:.3f}", 100),
        f"{w.graph_seconds + w.seconds:.3g}",
        f"{w.grid_graph_seconds + w.grid_seconds:.3g}",
        f"{w.certificate_seconds:.3g}",
    )


def _words(value: float | None, pattern: str, times: float = 1) -> str:
    return "-" if value is None else pattern.format(times * value)


def _steps(tasks: dict[str, Task], steps: tuple[float, ...]) -> Report:
    """Plan each task from each step of gamma, by both methods."""
    rows, findings = [], []
    for name, task in tasks.items():
        costs: dict[str, list[float]] = {"continuous": [], "grid": []}
        for step in steps:
            sampled = np.radians(step)
            here = replace(task, options=replace(task.options, gamma_step=sampled)).made()
            there = task.on_grid(gamma_step=sampled).made()
            for method, made in (("continuous", here), ("grid", there)):
                if made.cost is not None:
                    costs[method].append(made.cost)
            rows.append(
                (
                    name,
                    f"{step:g}",
                    _words(here.cost, "{:.4f}"),
                    _words(there.cost, "{:.4f}"),
                    f"{here.graph_seconds + here.seconds:.3g}",
                    f"{there.graph_seconds + there.seconds:.3g}",
                )
            )
        told = "; ".join(f"{method} {_spread(of, len(steps))}" for method, of in costs.items())
        findings.append(f"{name}: {told}")
    columns = ("contour", "step deg", "cost", "grid, refined", "plan s", "grid's plan s")
    return Report(
        title="Continuous gamma: from steps of gamma coarse to fine",
        how=HOW_STEPS,
        sheets=[Sheet(columns=columns, rows=rows)],
        findings=findings,
    )


def _spread(costs: list[float], steps: int) -> str:
    if not costs:
        return "finds no plan"
    spread = f"spread {100 * (max(costs) / min(costs) - 1):.3f} %"
    return spread if len(costs) == steps else f"{spread}, no plan from {steps - len(costs)} steps"
