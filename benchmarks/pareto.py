"""The Pareto set: adaptive runs beside a grid of weights and NSGA-II, and the time of 200 plans."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from importlib.resources import files
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from time import perf_counter, process_time
from typing import Any

import numpy as np

from benchmarks import _random_contours as random_contours
from benchmarks._figures import Figure, Report, Sheet, in_turn
from benchmarks._local_programs import attacks
from benchmarks._nsga import by_nsga
from kerfpath import Contour, NoFeasiblePath, ParetoSet, fastest_speed, pareto
from kerfpath.front import ParetoProblem, SearchKind, criteria_named, hypervolume
from kerfpath.job import read_job
from kerfpath.options import PlanOptions
from kerfpath.planner import layered_graph
from kerfpath.setup import Setup
from kerfpath.study import pareto_of_job

__all__ = ["run"]

JOB = Path(str(files("kerfpath.demo") / "b_pillar.toml"))
SEARCHES: tuple[SearchKind, ...] = ("adaptive", "grid")
SEED = 0
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

BEYOND = (
    "criteria",
    "plans of the grid",
    "beaten off it",
    "by, of the first criterion: median, most",
    "plans off it",
    "hypervolume on the grid",
    "and off it",
)

ATTACKED = (
    ("abb_irb2400_155", 0.6, ("displacement", "velocity")),
    ("kuka_kr16_r1610_2", 0.6, ("displacement", "acceleration", "range_6")),
    ("staubli_tx2_90xl", 0.6, ("displacement_2", "displacement_6", "increment_4")),
    ("abb_irb2400_155", 0.97, ("displacement", "acceleration")),
    ("staubli_tx2_90xl", 0.97, ("displacement", "velocity", "rotation")),
    ("kuka_kr16_r1610_2", 0.5, ("displacement", "speed", "range")),
)
"""Robots, shares of the fastest speed on a coarse grid, and criteria of the fronts attacked."""
NODES, STEP = 41, np.radians(2.0)
ATTACKS = (
    "robot",
    "share of the fastest speed",
    "criteria",
    "plans",
    "beaten by > 0.1 %",
    "by > 1 %",
    "by at most",
    "CPU of the front, s",
    "of the attacks, s",
)
HOW_ATTACKED = """\
Random contours (seed 77) of 41 nodes, gamma in steps of 2 deg. Every plan of a front of 30 runs is
attacked by sequential linear programs with HiGHS, which share no code with the planner but the
kinematics: gamma of every node moves to lower one criterion, or all of them, while none gets worse
and (5), (6) and the ranges of joints are kept. They begin with the plan itself, its two neighbours
on the front, and two random changes of gamma, up to 0.03 and 0.15 rad. A gain is a share of the
value of one criterion, which counts as at least a thousandth of the scale of the front; motions
that do not pass the audit do not count. One run each."""

HOW = """\
The trim line of the shipped demo job (`kerfpath/demo/b_pillar.toml`, IRB 4600-60, 9 m/min, 728
nodes, gamma in steps of 1 deg, two postures), its graph built before, every plan audited. All
searches begin with the same runs, one for each criterion, and may use the whole limits. Grid:
objective, metric, the weight of one joint at a time times 1/4 or 4, eta_v and eta_a of 1, 0.9 and
0.8, in random order. NSGA-II (pymoo), population 20: the factors on six weights, from 1/4 to 4,
eta_v and eta_a down to a tenth, objective and metric. Hypervolume: of the box between the ideal and
the reference that the first runs leave (above 1 where later runs are better than the ideal). Gap:
largest distance of neighbours in one criterion, the box being 1 wide. Covers: share of the other's
plans that one here is as good as or better. The second table: as many runs again, every second
one over continuous gamma; how many plans of the grid's front (of all runs) one of them beats, as
good in all criteria and better in one, and by how much of the first criterion at most; both
hypervolumes are of one box around both fronts, a tenth larger. One run each, as many threads as
cores; then fewer runs on one and on two, in turn; and the study of the job from its file on, in
processes, off the grid, too."""

TARGET = 120.0
"""s for the 200 runs of the first case on two cores."""


def run(*, quick: bool) -> list[Report]:
    """Compare the two searches, measure the time, and attack the plans of fronts."""
    return [_searches(quick=quick), _attacked(quick=quick)]


def _attacked(*, quick: bool) -> Report:
    rows, worst = [], 0.0
    for number, (name, share, criteria) in enumerate(ATTACKED[:1] if quick else ATTACKED):
        task = _drawn(name, number, share)
        begun = process_time()
        front = pareto(criteria=criteria, runs=6 if quick else 30, gamma_step=STEP, **task)
        made = process_time()
        found = attacks(front, PlanOptions(), say=lambda _: None)
        gains = np.array([attack.gain for attack in found if attack.valid])
        worst = max(worst, float(gains.max(initial=0.0)))
        rows.append(
            (
                name, f"{share:.0%}", ", ".join(criteria), str(len(front.plans)),
                *(str(int((gains > over).sum())) for over in (1e-3, 1e-2)),
                f"{gains.max(initial=0.0):.2%}", f"{made - begun:.0f}",
                f"{process_time() - made:.0f}",
            )
        )  # fmt: skip
    return Report(
        title="Plans of Pareto sets, attacked by local programs",
        how=HOW_ATTACKED,
        sheets=[Sheet(columns=ATTACKS, rows=rows, words=3)],
        findings=[f"no plan is beaten by more than {worst:.2%} of a criterion"],
    )


def _drawn(name: str, number: int, share: float) -> dict[str, Any]:
    """Return the task of a random contour that a robot can cut."""
    machine = random_contours.arm(name)
    assert machine.reach is not None
    task: dict[str, Any] = {
        "robot": machine,
        "tool": random_contours.head(),
        "placement": np.eye(4),
    }
    while True:
        rng = np.random.default_rng([77, number, *name.encode()])
        contour = random_contours.contour(rng, machine.reach).resample(count=NODES)
        try:
            fastest = fastest_speed(contour, gamma_step=random_contours.COARSE, **task)
        except NoFeasiblePath:
            number += 1000
            continue
        return task | {"contour": contour, "speed": share * fastest.speed}


def _searches(*, quick: bool) -> Report:
    nodes, options = _task()
    runs, few = (12, 4) if quick else (200, 40)
    figures, rows, beyond, findings = [], [], [], []
    for criteria in CASES:
        made, volume = {}, {}
        for search in SEARCHES:
            start = perf_counter()
            found = pareto(
                nodes, **options, criteria=criteria, runs=runs, search=search, method="exact"
            )
            seconds = perf_counter() - start
            made[search], volume[search] = found, found.hypervolume
            what = f"{runs} runs, {search}: {', '.join(criteria)}"
            figures.append(Figure(what=what, values=[seconds]))
        for search, other in (SEARCHES, SEARCHES[::-1]):
            rows.append(_cells(criteria, search, made[search], made[other]))
        rows.append(_nsga(nodes, options, criteria, made["adaptive"], runs, figures))
        beyond.append(_off_grid(nodes, options, criteria, made["adaptive"], figures))
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
    alike = partial(pareto, nodes, **options, runs=few, method="exact")
    each = {w: partial(alike, workers=w) for w in (1, 2)}
    timed = in_turn({f"{few} runs, workers {w}": each[w] for w in each}, 1 if quick else 3)
    for w in (1, 2):
        timed[f"{runs} runs as a sweep, processes {w}"] = [_swept(runs, w)]
    figures += [Figure(what=what, values=values) for what, values in timed.items()]
    one, two, alone, both = (median(values) for values in timed.values())
    findings.append(f"two threads are {one / two:.2f} times as fast as one")
    findings.append(
        f"as a sweep (kerfpath pareto), two processes are {alone / both:.2f} times as fast as one; "
        "reading, graphs and all"
    )
    return Report(
        title="Pareto set: adaptive against a grid of weights",
        how=HOW,
        figures=figures,
        sheets=[
            Sheet(columns=COLUMNS, rows=rows, words=2),
            Sheet(columns=BEYOND, rows=beyond, words=1),
        ],
        findings=findings,
    )


def _swept(runs: int, processes: int) -> float:
    """Return the time of the study of the demo's longest contour from job to front, s."""
    with TemporaryDirectory() as folder:
        start = perf_counter()
        pareto_of_job(
            JOB, store=Path(folder) / "s", criteria=CASES[0], runs=runs, processes=processes
        )
        return perf_counter() - start


def _task() -> tuple[Contour, dict[str, Any]]:
    """Return the demo's trim line and its planning options, with its graph."""
    job = read_job(JOB)
    part = job.read_part()
    task = next(task for task in job.contours if task.name == "trim")
    nodes = task.sample(part.contour(task.pick))
    options: dict[str, Any] = {"tool": job.tool, "placement": job.placement, "robot": job.robot}
    options |= {key: getattr(job.options, key) for key in ("gamma_step", "frames", "postures")}
    graph = layered_graph(nodes, **options)
    return nodes, options | {"speed": task.speed, "graph": graph}


def _off_grid(
    nodes: Contour,
    options: dict[str, Any],
    criteria: Sequence[str],
    grid: ParetoSet,
    figures: list[Figure],
) -> tuple[str, ...]:
    """Measure the same number of runs, half of them off the grid, and return their row."""
    start = perf_counter()
    found = pareto(nodes, **options, criteria=criteria, runs=grid.tried)
    what = f"{grid.tried} runs, every second over continuous gamma: {', '.join(criteria)}"
    figures.append(Figure(what=what, values=[perf_counter() - start]))
    here, there = found.values * found.sense, grid.values * grid.sense
    as_good = (here[:, None] <= there).all(axis=2)
    beats = as_good & (here[:, None] < there).any(axis=2)
    saved = np.where(beats, 1 - here[:, None, 0] / there[:, 0], -np.inf).max(axis=0)
    saved = saved[beats.any(axis=0)]
    both = np.vstack([here, there])
    low, size = both.min(axis=0), 1.1 * np.ptp(both, axis=0)
    volumes = [hypervolume((side - low) / size, np.ones(len(criteria))) for side in (there, here)]
    return (
        ", ".join(criteria),
        str(len(there)),
        f"{len(saved) / len(there):.0%}",
        f"{np.median(saved):.1%}, {saved.max():.1%}" if len(saved) else "-",
        str(len(here)),
        *(f"{volume:.3f}" for volume in volumes),
    )


def _cells(
    criteria: Sequence[str], search: SearchKind, found: ParetoSet, other: ParetoSet
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


def _nsga(
    nodes: Contour,
    options: dict[str, Any],
    criteria: Sequence[str],
    ours: ParetoSet,
    budget: int,
    figures: list[Figure],
) -> tuple[str, ...]:
    """Measure NSGA-II, and return its row: it has the same first runs, box and budget as ours."""
    robot = options["robot"]
    asked = PlanOptions(gamma_step=options["gamma_step"], frames=options["frames"])
    problem = ParetoProblem(
        contour=nodes, setup=Setup.of(robot, options["tool"], options["placement"]),
        speed=options["speed"], options=asked, graph=options["graph"],
        criteria=criteria_named(criteria, robot, options=asked, cell=None, home=None),
    )  # fmt: skip
    start = perf_counter()
    losses, feasible = by_nsga(problem, problem.first_runs(), budget=budget, seed=SEED)
    what = f"{budget} runs, NSGA-II: {', '.join(criteria)}"
    figures.append(Figure(what=what, values=[perf_counter() - start]))
    here, there = losses, ours.values * ours.sense
    ideal, reference = ours.ideal * ours.sense, ours.reference * ours.sense
    scaled = (here - ideal) / (reference - ideal)
    covered = (here[:, None] <= there).all(axis=2).any(axis=0).mean()
    return (
        ", ".join(criteria),
        "NSGA-II",
        f"{hypervolume(scaled, np.ones(len(criteria))):.4f}",
        f"{np.diff(np.sort(scaled, axis=0), axis=0).max(initial=0.0):.3f}",
        str(len(here)),
        f"{feasible} of {budget}",
        f"{covered:.0%}",
    )
