"""The refinement: whether it gives the same result from every grid, and the time of whole plans."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace
from importlib.resources import files
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from benchmarks import _arm
from benchmarks._descartes import NotRun, Task, solve
from benchmarks._figures import Figure, Report, Sheet, in_turn, peak_megabytes
from kerfpath import Contour, NoFeasiblePath, Robot, plan
from kerfpath.arrays import Array
from kerfpath.graph import LayeredGraph
from kerfpath.job import Job, read_job
from kerfpath.planner import layered_graph
from kerfpath.plans import Plan

__all__ = ["run"]

PARTS = ("trim", "hole 30 left", "hole 20")
"""Contours of the shipped demo job."""
STEPS = (8.0, 4.0, 2.0, 1.0, 0.5)
"""Steps of gamma, deg."""
SPEED = 10 / 60
"""Cutting speed of the whole plan, m/s."""
FREE = 1e6
"""Multiple of the accelerations that is never active."""
STEPPING = 3.0
"""Multiple of the arm's accelerations at which they are active but still let gamma step."""
COLUMNS = (
    "contour",
    "nodes",
    "step deg",
    "vertices",
    "grid optimum",
    "refined",
    "no limit",
    "graph s",
    "search s",
    "refine s",
)
PEER_STEP = 2.0
"""Step of gamma for Descartes, deg; at 1 deg its graph takes four times the memory."""

HOW_STEPS = """\
The trim line and two holes of the shipped demo job (`kerfpath/demo/b_pillar.toml`, IRB 4600-60,
its speeds, spacings, posture and limits), planned on grids of gamma from coarse to fine. Grid:
the proved optimum of that grid. Refined: `plan(refine=True)`, which begins from that path and from
the best one without acceleration limits; where the grid has no path, from the latter alone. No
limit: the same without acceleration limits, at most that much can be gained by raising them. One
run each, kernels warm; the graph is built on all cores."""

HOW_WHOLE = """\
The wavy closed contour of the search benchmark on the IRB 2400: 1000 nodes, gamma in steps of 1
deg, all postures; once with the maker's ranges, where every turn of a joint with more than one is a
vertex of its own (joint 6 has 800 deg), once with joints 4 and 6 endless, compared by (13); 10
m/min, velocity limits of the maker, three times the assumed accelerations of 600 to 3000 deg/s^2
(at this spacing of nodes less would never let gamma step). From contour and robot to the refined
plan: frames, kinematics and graph, exact search, refinement; kernels warm. The parts are timed in
further runs, in turn. Tesseract Descartes: the same poses, gamma in steps of 2 deg, joints in plain
ranges of at most one turn, no velocity or acceleration limits (first-order), no collision checks, a
process of its own, as in the search benchmark."""


def run(*, quick: bool) -> list[Report]:
    """Measure both."""
    return [_steps(quick=quick), _whole(quick=quick)]


def _steps(*, quick: bool) -> Report:
    job = read_job(Path(str(files("kerfpath.demo") / "b_pillar.toml")))
    part = job.read_part()
    steps = STEPS[:2] if quick else STEPS
    rows, findings = [], []
    for name in PARTS[1:] if quick else PARTS:
        task = next(task for task in job.contours if task.name == name)
        nodes = task.sample(part.contour(task.pick))
        _step_row(job, nodes, task.speed, steps[0])
        made = [_step_row(job, nodes, task.speed, step) for step in steps]
        rows += [row.cells(name, len(nodes)) for row in made]
        findings.append(_spread(name, made))
    return Report(
        title="Refinement from grids of different steps",
        how=HOW_STEPS,
        sheets=[Sheet(columns=COLUMNS, rows=rows)],
        findings=findings,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Row:
    """The results from one grid; costs and seconds of the refinement are None without a plan."""

    step: float
    vertices: int
    graph_seconds: float
    search_seconds: float
    grid: float | None = None
    refined: float | None = None
    free: float | None = None
    refine_seconds: float | None = None

    def cells(self, name: str, nodes: int) -> tuple[str, ...]:
        """Return the row as text, by `COLUMNS`."""
        costs = (_words(cost, "{:.4f}") for cost in (self.grid, self.refined, self.free))
        seconds = (self.graph_seconds, self.search_seconds, self.refine_seconds)
        return (
            name,
            str(nodes),
            f"{self.step:g}",
            str(self.vertices),
            *costs,
            *(_words(value, "{:.3g}") for value in seconds),
        )


def _words(value: float | None, pattern: str) -> str:
    return "-" if value is None else pattern.format(value)


def _step_row(job: Job, nodes: Contour, speed: float, step: float) -> _Row:
    """Plan a contour of the job on a grid of this step, deg, and refine the plan."""
    options = replace(job.options, method="exact", gamma_step=np.radians(step), refine=False)
    space: dict[str, Any] = {"tool": job.tool, "placement": job.placement}
    start = perf_counter()
    graph = job.graph(nodes, options)
    built = perf_counter()
    free = job.robot.with_limits(acceleration=FREE * job.robot.speed_limits()[1])

    def made(robot: Robot, *, refine: bool = False) -> float | None:
        with suppress(NoFeasiblePath):
            asked = replace(options, refine=refine)
            return plan(nodes, robot, speed=speed, graph=graph, options=asked, **space).cost
        return None

    grid_cost = made(job.robot)
    searched = perf_counter()
    refined = made(job.robot, refine=True)
    done = perf_counter()
    return _Row(
        step=step,
        vertices=len(graph.q),
        graph_seconds=built - start,
        search_seconds=searched - built,
        grid=grid_cost,
        refined=refined,
        free=made(free, refine=True),
        refine_seconds=done - searched - (searched - built),
    )


def _spread(name: str, rows: list[_Row]) -> str:
    """Return the spread of the refined costs and of the grids' optima of one contour, as text."""
    found = [(row.grid, row.refined) for row in rows if row.grid and row.refined]
    if not found:
        return f"{name}: no grid has a path"
    grid, refined = (np.array(costs) for costs in zip(*found, strict=True))
    best = refined.min()
    return (
        f"{name}: {len(found)} of {len(rows)} grids have a path; the refined costs are at most "
        f"{100 * (refined.max() / best - 1):.3f} % above the least of them, the optima of the "
        f"grids {100 * (grid.min() / best - 1):.3f} to {100 * (grid.max() / best - 1):.3f} %"
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Wave:
    """The whole problem: contour, arm and step of gamma."""

    contour: Contour
    robot: Robot
    gamma_step: float

    @property
    def space(self) -> dict[str, Any]:
        return {
            "tool": _arm.tool(),
            "placement": _arm.placement(),
            "gamma_step": self.gamma_step,
        }

    def graph(self) -> LayeredGraph:
        return layered_graph(self.contour, self.robot, **self.space)

    def plan(self, graph: LayeredGraph | None = None, *, refine: bool = True) -> Plan:
        return plan(
            self.contour,
            self.robot,
            speed=SPEED,
            graph=graph,
            method="exact",
            refine=refine,
            **self.space,
        )


def _whole(*, quick: bool) -> Report:
    nodes, step, peer_step = (100, 6.0, 12.0) if quick else (1000, 1.0, PEER_STEP)
    arm = _arm.arm()
    stepping = arm.with_limits(acceleration=STEPPING * arm.speed_limits()[1])
    arms = {
        "every turn a vertex": stepping.with_limits(endless=np.zeros(6, bool)),
        "joints 4 and 6 endless": stepping,
    }
    figures, findings, ours = list[Figure](), list[str](), list[float]()
    for name, robot in arms.items():
        wave = _Wave(contour=_arm.wave(nodes), robot=robot, gamma_step=np.radians(step))
        made, told = _ours(name, wave, 2 if quick else 5)
        figures += made
        findings.append(told)
        ours.append(float(np.median(made[0].values)))
    try:
        peer, told = _peer(_arm.wave(nodes), peer_step, ours)
    except NotRun as why:
        figures.append(Figure(what="Tesseract Descartes", note=str(why)))
    else:
        figures.append(peer)
        findings.append(told)
    return Report(
        title=f"Whole plan, {nodes} nodes, gamma in steps of {step:g} deg",
        how=HOW_WHOLE,
        figures=figures,
        findings=findings,
    )


def _ours(name: str, wave: _Wave, runs: int) -> tuple[list[Figure], str]:
    """Return the times of a whole plan and of its parts, and a description of the graph."""
    whole = in_turn({name: wave.plan}, runs)[name]
    graph = wave.graph()
    made, refined = wave.plan(graph, refine=False), wave.plan(graph)
    parts = in_turn(
        {
            "  of which frames, kinematics and graph": wave.graph,
            "  of which exact search": lambda: wave.plan(graph, refine=False),
            "  search and refinement": lambda: wave.plan(graph),
        },
        runs,
    )
    vertices = len(graph.q)
    peak = peak_megabytes(wave.plan)
    note = f"cost {made.cost:.4f} on the grid, {refined.cost:.4f} refined, +{peak:.0f} MB"
    figures = [
        Figure(what=f"kerfpath, {name}", values=whole, note=note),
        *(Figure(what=part, values=taken) for part, taken in parts.items()),
    ]
    return figures, f"{name}: {vertices} vertices, {vertices / len(wave.contour):.0f} a layer"


def _peer(contour: Contour, step: float, ours: list[float]) -> tuple[Figure, str]:
    """Return Descartes' times on the same poses, and the comparison with ours."""
    robot, samples = _arm.arm_of_one_turn(), round(360 / step)
    frames: Array = np.ascontiguousarray(_arm.placement() @ contour.frames("rotation-minimising"))
    graph = layered_graph(
        contour,
        robot,
        tool=_arm.tool(),
        placement=_arm.placement(),
        gamma_step=2 * np.pi / samples,
    )
    sizes = np.diff(graph.start)
    theirs = solve(
        Task(
            robot=robot,
            tool=_arm.tool(),
            frames=frames,
            samples=samples,
            sizes=sizes.tolist(),
            runs=3,
        )
    )
    figure = Figure(
        what=f"Tesseract Descartes, first-order, {step:g} deg",
        values=theirs.seconds,
        note=f"+{theirs.peak_megabytes:.0f} MB, {theirs.cores_busy:.1f} cores busy",
    )
    ratios = " and ".join(f"{float(np.median(theirs.seconds)) / own:.1f}" for own in ours)
    return figure, (
        f"Descartes: {sizes.mean():.0f} vertices a layer; takes {ratios} times as long as "
        "kerfpath's whole plans, without limits of velocity and acceleration"
    )
