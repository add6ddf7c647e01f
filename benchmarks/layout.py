"""Layout: what a better place for the demo part gains, and what the cheap tests save."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from benchmarks._figures import Figure, Report
from kerfpath.job import Job, warm_up
from kerfpath.search import SearchProblem, find_least_interval
from kerfpath.study import Layout, digest, layout
from kerfpath.study._evaluator import SampledContour
from kerfpath.study.placing._evaluate import contours_of, middle_of
from kerfpath.study.placing._place import move_job, numbers_of
from kerfpath.study.placing._search import HALF

__all__ = ["run"]

HOW = """\
`kerfpath layout b_pillar_layout.toml`: the demo part with its shift in x and y, yaw and tilt, for
the fastest speed of its slowest contour, on two processes, no map; quick: two of its contours, 16
placements. Bounds: the speed that a bound allows over the exact one, of every contour at random
placements, and the time of one thread against that of the exact search, both with their graphs;
a stretch is that about the node that binds at the placement of the job."""
DEMO = Path(__file__).parent.parent / "src" / "kerfpath" / "demo"
STRIDES = (2, 4, 8)


def run(*, quick: bool = False) -> Report:
    """Lay out the demo part, and hold bounds against exact values."""
    warm_up()
    with tempfile.TemporaryDirectory() as folder:
        job = _job(Path(folder), quick=quick)
        begun = perf_counter()
        found = layout(
            job, store=Path(folder) / "layout.sqlite", map_points=0, processes=2,
            evaluations=16 if quick else None,
        )  # fmt: skip
        seconds = perf_counter() - begun
        contours = contours_of(str(job), digest(job), found.goal)
        bounds = _bounds(found, contours, 1 if quick else 4)
    assert found.best is not None
    before, after = found.before.value, found.best.result.value
    assert before is not None
    assert after is not None
    solved = sum(trial.searched for trial in found.tried)
    told = ", ".join(f"{name} = {value:g}" for name, value in found.best.offsets.items())
    return Report(
        title="Layout",
        how=HOW,
        figures=[
            Figure(what="slowest contour as shipped", values=[before], unit="m/min"),
            Figure(what="slowest contour, best placement", values=[after], unit="m/min", note=told),
            Figure(what="placements tried", values=[len(found.tried)], unit=""),
            Figure(what="of them solved exactly", values=[solved], unit=""),
            Figure(what="time", values=[seconds]),
            *bounds,
        ],
        findings=[
            f"{100 * (after / before - 1):.1f} % faster than as shipped; "
            f"{100 * (1 - solved / len(found.tried)):.0f} % of the placements needed no exact "
            f"search; {'proved' if found.proved else 'not proved'} the best of those tried"
        ],
    )


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
    path = (folder / "job.toml").resolve()
    path.write_text(text, encoding="utf-8")
    return path


def _bounds(found: Layout, contours: Sequence[SampledContour], placements: int) -> list[Figure]:
    """Return how far bounds are above exact speeds, and the share of time that they take."""
    middle, rng = middle_of(found.job, contours), np.random.default_rng(5)
    over: dict[str, list[float]] = {}
    share: dict[str, list[float]] = {}
    _timed(found.job, contours[0], np.arange(len(contours[0].nodes)))  # what is loaded once
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
    """Return the least interval over some nodes, s, and how long it took to find."""
    begun = perf_counter()
    graph = job.graph(contour.nodes, replace(job.options, comfort=None), only=nodes)
    problem = SearchProblem(
        q=graph.q, start=graph.start, dt=1.0, limits=job.options.limits(job.robot),
        endless=job.robot.endless,
    )  # fmt: skip
    return find_least_interval(problem).dt, perf_counter() - begun
