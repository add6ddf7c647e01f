"""Layout: the gain of a better placement of the demo part, and the savings of the cheap tests."""

from __future__ import annotations

import resource
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np

from benchmarks._figures import Figure, Report
from kerfpath.job import Goal, Job, warm_up
from kerfpath.search import SearchProblem, find_least_interval
from kerfpath.study import Layout, job_key, layout
from kerfpath.study.loaded_job import SampledContour
from kerfpath.study.placing.evaluators import PlacementValue
from kerfpath.study.placing.place import middle_of, move_job, numbers_of
from kerfpath.study.placing.search import HALF
from kerfpath.study.placing.study import contours_of, evaluate_placements, nodes_of

__all__ = ["run"]

HOW = """\
`kerfpath layout b_pillar_layout.toml`, on two processes, no map: the demo part with its shift in x
and y, yaw and tilt, over continuous gamma and, in the same run, by the grid (method = "exact").
What they choose is planned over continuous gamma, either way. Cases: the fastest speed of the
slowest of all seven contours, of the slot and the 20 mm hole, and of two small rings on a grid of
10 deg; the displacement of all seven. Quick: slot and hole alone, 16 placements. Time is that of
all processes, on their processors.
Bounds: the speed that a bound of the grid allows over the exact one, of every contour at random
placements, and the time of one thread against that of the exact search, both with their graphs; a
stretch is that about the node that binds at the placement of the job."""
DEMO = Path(__file__).parent.parent / "src" / "kerfpath" / "demo"
STRIDES = (2, 4, 8)
TWO = """\
[robot]
model = "abb_irb4600_60_205"
acceleration_ratio = "iontec_20_to_70kg"
[tool]
head = "laser-head-45"
[part]
file = "rings.csv"
xyz_mm = [1200, 0, 500]
[[contour]]
pick = "small"
speed_m_min = 2
count = 41
[[contour]]
pick = "large"
speed_m_min = 2
count = 61
[plan]
gamma_step_deg = 10
posture = "front/up"
[layout]
x_mm = [-150, 150]
y_mm = [-150, 150]
yaw_deg = [-30, 30]
evaluations = 64
"""


class Case(NamedTuple):
    """A layout that is searched in both ways."""

    name: str
    job: Path
    goal: Goal
    evaluations: int | None


def run(*, quick: bool = False) -> Report:
    """Lay out parts over continuous gamma and on the grid, and compare bounds with exact values."""
    warm_up()
    figures: list[Figure] = []
    findings: list[str] = []
    with tempfile.TemporaryDirectory() as folder:
        cases = _cases(Path(folder), quick=quick)
        known = [_both(case, figures, findings) for case in cases]
        first = cases[0]
        contours = contours_of(**job_key(first.job))
        figures += _bounds(known[0], contours, 1 if quick else 4)
    return Report(title="Layout", how=HOW, figures=figures, findings=findings)


def _cases(folder: Path, *, quick: bool) -> list[Case]:
    """Return the layouts to search."""
    two = _job(folder, quick=True)
    if quick:
        return [Case("slot and hole", two, "speed", 16)]
    whole = _job(folder, quick=False)
    return [
        Case("demo", whole, "speed", None),
        Case("slot and hole", two, "speed", 80),
        Case("rings", _rings(folder), "speed", None),
        Case("demo, motion", whole, "motion", 120),
    ]


def _both(case: Case, figures: list[Figure], findings: list[str]) -> Layout:
    """Search the best placement over continuous gamma and on the grid; return the latter."""
    text = case.job.read_text(encoding="utf-8")
    grid = case.job.with_name(f"grid_{case.job.name}")
    grid.write_text(text.replace("[plan]", '[plan]\nmethod = "exact"'), encoding="utf-8")
    found: list[Layout] = []
    seconds: list[float] = []
    for job in (case.job, grid):
        begun = _busy()
        found.append(
            layout(
                job, store=job.with_suffix(f".{case.goal}.sqlite"), map_points=0, processes=2,
                evaluations=case.evaluations, goal=case.goal,
            )
        )  # fmt: skip
        seconds.append(_busy() - begun)
    off, on = found
    worth = [_planned(case, placed) for placed in found]
    unit = "" if case.goal == "motion" else "m/min"
    rows: list[tuple[str, float | None, str]] = [
        ("as shipped, planned", off.before.value, unit),
        ("best placement, planned", worth[0], unit),
        ("best placement of the grid, planned", worth[1], unit),
        (
            "best placement of the grid, on the grid",
            None if on.best is None else on.best.result.value,
            unit,
        ),
        ("placements planned", off.solved, f"of {len(off.tried)}"),
        ("proved to be no faster", off.stages["proved"], f"of {len(off.tried)}"),
        ("judged by an estimate alone", off.estimated, f"of {len(off.tried)}"),
        ("time", seconds[0], "s"),
        ("time of the grid", seconds[1], "s"),
    ]
    figures += [
        Figure(
            what=f"{case.name}: {what}", values=[float("nan") if value is None else value], unit=of
        )
        for what, value, of in rows
    ]
    share = worth[0] / worth[1]
    gain = 1 / share - 1 if case.goal == "motion" else share - 1
    findings.append(
        f"{case.name}: {100 * gain:+.1f} % over what the grid chooses, "
        f"{seconds[0] / seconds[1]:.1f} times its time; "
        + ("proved the best of those tried" if off.proved else "others left to estimates")
    )
    return on


def _busy() -> float:
    """Return the processor time of this process and of its ended children, s."""
    spent = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(each.ru_utime + each.ru_stime for each in spent)


def _planned(case: Case, placed: Layout) -> float:
    """Return the value of the best placement over continuous gamma, or of that of the job."""
    offsets = {} if placed.best is None else dict(placed.best.offsets)
    job, digest = job_key(case.job).values()
    data = evaluate_placements(
        job=job, digest=digest, goal=case.goal, places=[offsets], stretches=[], exact=True
    )
    value = PlacementValue.from_data(data).value
    return float("nan") if value is None else value


def _rings(folder: Path) -> Path:
    """Return a job of two rings from a table of points."""
    rows = ["contour,x_mm,y_mm,z_mm,nx,ny,nz"]
    for name, radius, middle in (("small", 8, -40), ("large", 20, 40)):
        for angle in np.linspace(0, 2 * np.pi, 73)[:-1]:
            x, y = radius * np.cos(angle), middle + radius * np.sin(angle)
            rows.append(f"{name},{x:.4f},{y:.4f},0,0,0,1")
    (folder / "rings.csv").write_text("\n".join(rows), encoding="utf-8")
    path = (folder / "rings.toml").resolve()
    path.write_text(TWO, encoding="utf-8")
    return path


def _job(folder: Path, *, quick: bool) -> Path:
    """Return the demo's job, or one of two of its contours on a coarser grid."""
    text = (DEMO / "b_pillar_layout.toml").read_text(encoding="utf-8")
    text = text.replace('"b_pillar.step"', f"'{DEMO / 'b_pillar.step'}'")
    if quick:
        head, *contours = text.split("[[contour]]")
        rest = (
            contours[-1].partition("[plan]")[2].replace("gamma_step_deg = 1", "gamma_step_deg = 3")
        )
        text = f"{head}[[contour]]{'[[contour]]'.join(contours[2:4])}[plan]{rest}"
    path = (folder / f"job{len(text)}.toml").resolve()
    path.write_text(text, encoding="utf-8")
    return path


def _bounds(found: Layout, contours: Sequence[SampledContour], placements: int) -> list[Figure]:
    """Return how far bounds are above exact speeds, and the share of time that they take."""
    middle, rng = middle_of(found.job, nodes_of(contours)), np.random.default_rng(5)
    over: dict[str, list[float]] = {}
    share: dict[str, list[float]] = {}
    _timed(found.job, contours[0], np.arange(len(contours[0].nodes)))  # load and compile once
    for _ in range(placements):
        at = {name: float(rng.uniform(*span)) for name, span in found.ranges.items()}
        job = move_job(found.job, numbers_of(found.job, at, middle))
        for contour, known in zip(contours, found.before.contours, strict=True):
            last, node = len(contour.nodes) - 1, known.node
            assert node is not None
            exact, whole = _timed(job, contour, np.arange(last + 1))
            ways = {f"1 of {s} nodes": np.arange(0, last + 1, s) for s in STRIDES}
            ways["stretch"] = np.arange(max(0, node - HALF), min(last, node + HALF) + 1)
            for name, nodes in ways.items():
                interval, seconds = _timed(job, contour, nodes)
                over.setdefault(name, []).append(exact / (interval / (nodes[1] - nodes[0])))
                share.setdefault(name, []).append(seconds / whole)
    return [
        Figure(what=f"{name}: {what}", values=values[name], unit="times the exact")
        for name in over
        for what, values in (("speed", over), ("time", share))
    ]


def _timed(job: Job, contour: SampledContour, nodes: Any) -> tuple[float, float]:
    """Return the least interval over some nodes, s, and the time to find it."""
    begun = perf_counter()
    graph = job.graph(contour.nodes, replace(job.options, comfort=None), only=nodes)
    problem = SearchProblem(
        q=graph.q, start=graph.start, dt=1.0, limits=job.options.limits(job.robot),
        endless=job.robot.endless,
    )  # fmt: skip
    return find_least_interval(problem).dt, perf_counter() - begun
